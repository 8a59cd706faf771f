"""What cuts that were not made yet would tell of a machine, and what of it matters to the tooltips that are wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.coupled.design import coupled_information
from rcsa_ident.identification.cut_data import prepare
from rcsa_ident.identification.data import SMOOTH_ERROR, IdentificationData
from rcsa_ident.identification.experiment_design import (
    CandidateCuts,
    compressed,
    expected_cut,
    harmonics,
    information,
    tip_changes,
    unknowns,
)
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.machine.machine import STIFFNESS_SPREAD
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.geometry import ToolAssembly, stiffened
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.turning import turning_pair

#: Two cuts of one tooling differ by at least this share of their speed; a programmed speed is met within as much.
SPACING = 0.01
#: Frequencies at which the wanted tooltip is judged.
JUDGED = 160
#: A cut that may be made: its tooling's name, and how.
Candidate = tuple[str, CuttingConditions]


def apart(
    machine: IdentifiedMachine,
    candidates: Sequence[Candidate],
    toolings: Sequence[Tooling],
    targets: Sequence[Tooling],
    coefficients: CuttingCoefficients,
    noise: float,
    model_error: Mapping[Dof, float],
    band_hz: tuple[float, float],
) -> CandidateCuts:
    """Return what the candidates would tell of planes that feel nothing of each other; parameters as of `plan.plan_cuts`."""
    posteriors = machine.posteriors()
    axes = list(posteriors)
    data = _data(candidates, toolings, coefficients, noise, axes)
    rows = tuple(compressed(each) for each in information(data, posteriors, model_error))
    size = rows[0].shape[1]
    omega = 2.0 * np.pi * np.linspace(*band_hz, JUDGED)
    starts, first = {}, 0
    for each in data.axes:
        starts[each.axis] = first
        first += unknowns(posteriors[each.axis])
    wanted, floor = [], []
    for target in targets:
        exact, stiffer = (tool_holder_receptance(a, omega) for a in (target.assembly, stiffened(target.assembly, STIFFNESS_SPREAD)))
        weights, least = np.zeros((size, len(axes), 2 * JUDGED)), 0.0
        for i, (axis, posterior) in enumerate(posteriors.items()):
            value, change = tip_changes(posterior, exact)
            norm = float(np.linalg.norm(value)) * np.sqrt(len(axes))
            weights[starts[axis] : starts[axis] + change.shape[1], i] = np.vstack([change.real, change.imag]).T / norm
            least += (float(np.linalg.norm(tip_changes(posterior, stiffer)[0] - value)) / norm) ** 2
        wanted.append(weights.reshape(size, -1))
        floor.append(least)
    return CandidateCuts(rows, tuple(wanted), tuple(floor), _too_close(candidates))


def together(
    machine: IdentifiedMachine,
    candidates: Sequence[Candidate],
    toolings: Sequence[Tooling],
    targets: Sequence[Tooling],
    coefficients: CuttingCoefficients,
    noise: float,
    model_error: Mapping[Dof, float],
    band_hz: tuple[float, float],
) -> CandidateCuts:
    """Return what the candidates would tell of planes that feel each other; what is wanted holds the cross terms, too.

    Each tooltip FRF counts as a share of the direct one under the same force.
    """
    assert machine.whole is not None
    data = _data(candidates, toolings, coefficients, noise, [Dof.X, Dof.Y], machine.whole.turns)
    rows = tuple(compressed(each) for each in coupled_information(data, machine.whole, model_error))
    size = rows[0].shape[1]
    omega = 2.0 * np.pi * np.linspace(*band_hz, JUDGED)
    wanted, floor = [], []
    for target in targets:
        # what its drawing leaves open is nothing that a cut of another tooling tells
        tip = machine.tip(target.assembly, omega, stiffness_spread=0.0)
        # of both directions, as a mean of their relative variances
        norm = np.sqrt(2.0) * np.linalg.norm(np.einsum("njj->nj", tip.values), axis=0)
        change = tip.spread / norm
        weights = np.zeros((size, 2, *change.shape[1:]))
        weights[: len(change), 0], weights[: len(change), 1] = change.real, change.imag
        stiffer = machine.tip(stiffened(target.assembly, STIFFNESS_SPREAD), omega, spread=False).values
        wanted.append(weights.reshape(size, -1))
        floor.append(float(np.linalg.norm((stiffer - tip.values) / norm)) ** 2)
    return CandidateCuts(rows, tuple(wanted), tuple(floor), _too_close(candidates))


def _data(
    candidates: Sequence[Candidate],
    toolings: Sequence[Tooling],
    coefficients: CuttingCoefficients,
    noise: float,
    axes: Sequence[Dof],
    turns: bool = False,
) -> IdentificationData:
    """The candidates' lines beside the tool-holders' receptances, turning ones where that is asked."""
    named = {t.name: t for t in toolings}
    forces: dict[tuple[str, float, float], tuple[ComplexArray, ComplexArray]] = {}
    cuts = []
    lowest = min(conditions.spindle_speed for _, conditions in candidates)
    for k, (name, conditions) in enumerate(candidates):
        cutter, speed = named[name].cutter, conditions.spindle_speed
        alike = name, conditions.axial_depth, conditions.feed_angle
        if alike not in forces:
            forces[alike] = force_and_slope(cutter, conditions, coefficients, harmonics(cutter.teeth, lowest))
        cuts.append(expected_cut(f"{k}", name, speed, cutter.teeth, *forces[alike], noise, axes))
    receptances = {name: partial(tool_holder_receptance, t.assembly) for name, t in named.items()}
    turning = {name: partial(_turning, t.assembly) for name, t in named.items()} if turns else None
    edges = [coefficients.edge_spread if edge > 0.0 else 0.0 for edge in (coefficients.tangential_edge, coefficients.radial_edge)]
    spreads = (coefficients.tangential_spread, coefficients.ratio_spread, *edges)
    return prepare(cuts, receptances, {name: t.cutter.teeth for name, t in named.items()}, spreads, turning).with_smooth_errors(
        SMOOTH_ERROR
    )


def _turning(assembly: ToolAssembly, omega: FloatArray, ratio: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    return turning_pair(assembly, omega, ratio)


def _too_close(candidates: Sequence[Candidate]) -> np.ndarray:
    """True for two cuts of one tooling whose speeds are nearly the same, shape (k, k)."""
    speed = np.array([conditions.spindle_speed for _, conditions in candidates])
    tooling = np.array([name for name, _ in candidates])
    ratio = np.abs(np.log(speed[:, None] / speed[None, :]))
    return (tooling[:, None] == tooling[None, :]) & (ratio < np.log1p(SPACING) * (1.0 - 1e-6))
