"""Idle against in process: a hammer test's receptances beside the identified ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.rational import rational_fit
from rcsa_ident.machine.machine import Machine
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.workflows.contact import neighbour_noise

#: Modes farther apart than this share of their frequency are not the same one.
MATCH = 0.12
#: A mode makes up at least this share of the receptance at its frequency, and is at least so high against the highest value.
LEAST_SHARE, _LEAST_PEAK = 0.2, 0.02
#: Damping ratio above which a pole is background; share of a receptance that no fit needs to resolve.
MOST_DAMPING, LEAST_NOISE = 0.25, 2e-3
#: Width of the bands in which the FRAC is taken [Hz].
FRAC_BAND = 250.0


class Place(StrEnum):
    """Where force and response of a hammer test stand.

    ``tip``: both at the tool's tip (C11); ``cross``: force at the tip, response at the spindle's flange (C31); ``spindle``: both at the
    spindle's flange with the tooling clamped (C33); ``flange``: the same without a tooling (B33).
    """

    TIP = "tip"
    CROSS = "cross"
    SPINDLE = "spindle"
    FLANGE = "flange"


@dataclass(frozen=True, slots=True)
class LocalMode:
    """A mode that shows in a receptance.

    `frequency` [rad/s]: natural frequency
    `damping` [-]
    `compliance` [m/N]: of the whole receptance there; its inverse is the dynamic stiffness
    """

    frequency: float
    damping: float
    compliance: float


@dataclass(frozen=True, slots=True, eq=False)
class ResponseComparison:
    """One response, twice.

    `omega` [rad/s], shape (n,): the hammer test's, within the band where the machine was identified
    `hammer`, `identified` [m/N], shape (n,)
    `deviation`: (array, array) or None; standard deviations of the identified real and imaginary part
    `frac` [-]: over the whole band
    `error` [-]: ||identified - hammer|| / ||hammer||
    `modes`: tuple of (LocalMode, LocalMode or None); of the hammer test, and the identified one that belongs to it
    `band_frac`: (array, array); middles of bands [rad/s], FRAC in each
    """

    place: Place
    axis: Dof
    omega: FloatArray
    hammer: ComplexArray
    identified: ComplexArray
    deviation: tuple[FloatArray, FloatArray] | None
    frac: float
    error: float
    modes: tuple[tuple[LocalMode, LocalMode | None], ...]
    band_frac: tuple[FloatArray, FloatArray]


def compare(
    machine: Machine,
    tests: Mapping[tuple[Place, Dof], tuple[FloatArray, ComplexArray]],
    assembly: ToolAssembly | None = None,
    speed: float | None = None,
    bands: bool = True,
) -> list[ResponseComparison]:
    """Return each hammer test beside what the identified machine says of the same response.

    `tests`: mapping of (Place, Dof) to (array, complex array), shapes (n,) [rad/s] and (n,) [m/N]
    `assembly`: of all places but the bare flange
    `speed` [rad/s]: for a machine that changes with it; by default the middle of the campaign's
    `bands`: also the posterior's standard deviations
    """
    found = []
    for (place, axis), (omega, values) in tests.items():
        if axis not in machine.axes:
            raise InputError("hammer test", axis.upper(), f"an identified axis: {', '.join(a.upper() for a in machine.axes)}")
        if place is not Place.FLANGE and assembly is None:
            raise InputError("hammer test", place, "the tooling that was clamped, or a test of the bare flange")
        low, high = machine.band or (0.0, np.inf)
        inside = (omega >= low) & (omega <= high) & (omega > 0.0)
        if np.sum(inside) < 8:
            raise InputError("hammer test", f"{np.sum(inside)} frequencies in the identified band", "eight at least")
        omega, values = omega[inside], np.asarray(values)[inside]
        found.append(_one(machine.at(speed), place, axis, omega, values, assembly, bands))
    return found


def _one(
    machine: Machine,
    place: Place,
    axis: Dof,
    omega: FloatArray,
    hammer: ComplexArray,
    assembly: ToolAssembly | None,
    bands: bool,
) -> ResponseComparison:
    if assembly is None or place is Place.FLANGE:
        ends, response = ("flange", "flange"), machine.receptance(omega, (axis,))
    else:
        if place is not Place.TIP:
            machine.check_behind_joint((axis,))
        ends = {Place.TIP: ("tip", "tip"), Place.CROSS: ("spindle", "tip"), Place.SPINDLE: ("spindle", "spindle")}[place]
        response = machine.coupled(assembly, omega, (axis,))
    entry = Coordinate(ends[0], axis), Coordinate(ends[1], axis)
    identified = response.between(*(str(c) for c in entry))
    deviation = response.deviation().get(entry) if bands else None
    # both at the hammer's noise, so that both fits resolve alike
    noise = neighbour_noise(hammer)
    modes = matched(local_modes(omega, hammer, noise), local_modes(omega, identified, noise))
    error = float(np.linalg.norm(identified - hammer) / np.linalg.norm(hammer))
    return ResponseComparison(
        place, axis, omega, hammer, identified, deviation, frac(hammer, identified), error, modes, _band_frac(omega, hammer, identified)
    )


def frac(one: ComplexArray, other: ComplexArray) -> float:
    """Return the frequency response assurance criterion |a^H b|^2 / (a^H a b^H b): 1 for the same shape, whatever its scale [-]."""
    top = np.abs(np.vdot(one, other)) ** 2
    return float(top / max(float(np.vdot(one, one).real * np.vdot(other, other).real), 1e-300))


def _band_frac(omega: FloatArray, one: ComplexArray, other: ComplexArray) -> tuple[FloatArray, FloatArray]:
    width = 2.0 * np.pi * FRAC_BAND
    count = max(round((omega[-1] - omega[0]) / width), 1)
    edges = np.linspace(omega[0], omega[-1], count + 1)
    rows = []
    for k, (low, high) in enumerate(pairwise(edges)):
        inside = (omega >= low) & ((omega < high) | (k == count - 1))
        if np.sum(inside) >= 3:
            rows.append((0.5 * (low + high), frac(one[inside], other[inside])))
    return np.array([r[0] for r in rows]), np.array([r[1] for r in rows])


def local_modes(omega: FloatArray, values: ComplexArray, noise: FloatArray | None = None) -> list[LocalMode]:
    """Return the modes that show in a receptance, by frequency.

    A rational function is fitted (`dynamics.rational`); of its poles those count that lie in the band, oscillate, and make up a
    visible share of the receptance where they stand.

    `noise` [m/N], shape (n,): standard deviation of the real and of the imaginary part each; by default from neighbouring frequencies
    """
    noise = np.maximum(neighbour_noise(values) if noise is None else noise, LEAST_NOISE * np.abs(values))
    fit = rational_fit(omega, values, noise=noise)
    found = []
    for pole, residue in zip(fit.pole, fit.residue[:, 0, 0], strict=True):
        natural = float(np.abs(pole))
        damping = float(-pole.real / natural)
        if not omega[0] < natural < omega[-1] or damping > MOST_DAMPING:
            continue
        size = float(np.abs(fit.response(np.array([natural]))[0, 0, 0]))
        own = float(np.abs(residue / pole.real))
        if own > LEAST_SHARE * size and own > _LEAST_PEAK * float(np.abs(values).max()):
            found.append(LocalMode(natural, damping, size))
    return sorted(found, key=lambda m: m.frequency)


def matched(first: list[LocalMode], second: list[LocalMode]) -> tuple[tuple[LocalMode, LocalMode | None], ...]:
    """Return each mode of the first with the one of the second that is nearest in frequency, the highest peaks choosing first."""
    free = list(second)
    partner: dict[int, LocalMode] = {}
    for i in sorted(range(len(first)), key=lambda i: -first[i].compliance):
        near = [m for m in free if abs(m.frequency / first[i].frequency - 1.0) < MATCH]
        if near:
            best = min(near, key=lambda m: abs(m.frequency - first[i].frequency))
            partner[i] = best
            free.remove(best)
    return tuple((mode, partner.get(i)) for i, mode in enumerate(first))
