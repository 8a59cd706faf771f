"""A machine that changes with the spindle's speed: which one answers at a speed, and lobes whose every speed asks its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.posterior import MachineAxis
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.workflows.lobes import LobeConditions, lobe_bands, tooling_lobes
from rcsa_ident.workflows.tip import STIFFNESS_SPREAD, TooltipResponse, tooltip

Machine = Mapping[Dof, MachineAxis]
#: Speeds of one block share one tip receptance: relative width of a block.
BLOCK = 0.025
#: Largest ratio of speeds over which the spread that the posterior leaves is taken for a straight line.
STRAIGHT = 1.6


@dataclass(frozen=True, slots=True, eq=False)
class MachineOverSpeed:
    """An identified machine, with models of single ranges of speed where there are some.

    Parameters
    ----------
    whole : mapping of Dof to MachineAxis
        From all cuts.
    bands : sequence of ((float, float), mapping of Dof to MachineAxis)
        Lowest and highest speed [rad/s] of each range, and its machine.
    """

    whole: Machine
    bands: Sequence[tuple[tuple[float, float], Machine]] = ()

    def at(self, speed: float | None) -> Machine:
        """Return the machine that answers at a speed [rad/s]: that of its band or of the nearest one, else the whole campaign's."""
        if speed is None or not self.bands:
            return self.whole
        return min(self.bands, key=lambda band: max(band[0][0] - speed, speed - band[0][1], 0.0))[1]

    @property
    def speed_range(self) -> tuple[float, float] | None:
        """Lowest and highest speed [rad/s] at which it is known how the machine changes; None where it does not change."""
        ranges = [_softening_range(self.whole), *(speeds for speeds, _ in self.bands)]
        known = [each for each in ranges if each is not None]
        return (min(low for low, _ in known), max(high for _, high in known)) if known else None


def _softening_range(machine: Machine) -> tuple[float, float] | None:
    """Lowest and highest speed [rad/s] of a machine that changes with speed."""
    for part in machine.values():
        if part.posterior is not None and part.posterior.layout.softening:
            middle, half = part.posterior.speed_range
            return middle - half, middle + half
    return None


def lobes_over_speed(
    machine: MachineOverSpeed,
    assembly: ToolAssembly,
    omega: FloatArray,
    conditions: LobeConditions,
    bands: bool = True,
    stiffness_spread: float = STIFFNESS_SPREAD,
) -> tuple[StabilityLobes, tuple[FloatArray, FloatArray] | None]:
    """Return the lobes of a tooling, where each speed feels the machine as it is at that speed, and their band.

    Parameters
    ----------
    machine : MachineOverSpeed
    assembly : ToolAssembly
    omega : array, shape (k,) [rad/s]
        Of the receptances that the lobes are computed from.
    conditions : LobeConditions
        Its speeds are split into blocks; in a block the machine stays what it is at the block's middle.
    bands : bool
    stiffness_spread : float
        Standard deviation of the tool-holder's stiffness, as a share.

    Returns
    -------
    StabilityLobes, and (array, array) [m] or None as from `lobe_bands`
    """
    order: list[np.ndarray] = []
    found: list[StabilityLobes] = []
    edges: list[tuple[FloatArray, FloatArray] | None] = []
    for places, tip in responses_over_speed(machine, assembly, omega, conditions.speeds, bands, stiffness_spread):
        here = replace(conditions, speeds=conditions.speeds[places])
        order.append(places)
        found.append(tooling_lobes(tip, here))
        edges.append(lobe_bands(tip, here) if bands else None)
    back = np.argsort(np.concatenate(order))
    joined = joined_lobes(found, order)
    known = [edge for edge in edges if edge is not None]
    if len(known) < len(edges):
        return joined, None
    return joined, (np.concatenate([low for low, _ in known])[back], np.concatenate([high for _, high in known])[back])


def responses_over_speed(
    machine: MachineOverSpeed, assembly: ToolAssembly, omega: FloatArray, speeds: FloatArray, bands: bool, stiffness_spread: float
) -> Iterator[tuple[np.ndarray, TooltipResponse]]:
    """Yield the tip's response for each block of speeds that share one, beside the places of these speeds.

    Every speed is in one block; the spread of all blocks has the same directions, where the same machine answers.
    """
    for own, indices in _by_machine(machine, speeds):
        response = _Response(own, assembly, omega, speeds[indices], bands, stiffness_spread)
        for block in _blocks(own, speeds[indices]):
            yield indices[block], response.at(speeds[indices[block]])


def joined_lobes(parts: Sequence[StabilityLobes], places: Sequence[np.ndarray]) -> StabilityLobes:
    """Return the lobes of all blocks as one, each speed back in its place."""
    back = np.argsort(np.concatenate(places))
    lowest = min(parts, key=lambda lobes: lobes.absolute_limit)
    return StabilityLobes(
        np.concatenate([p.spindle_speed for p in parts])[back],
        np.concatenate([p.limit_depth for p in parts])[back],
        np.concatenate([p.chatter_frequency for p in parts])[back],
        np.concatenate([p.lobe for p in parts])[back],
        lowest.absolute_limit,
        lowest.absolute_frequency,
        parts[0].method,
        tuple(dict.fromkeys(warning for p in parts for warning in p.warnings)),
        np.concatenate([p.flip for p in parts])[back],
    )


def _by_machine(machine: MachineOverSpeed, speeds: FloatArray) -> list[tuple[Machine, np.ndarray]]:
    """Each machine that answers at some of the speeds, and where those stand."""
    answering = [machine.at(speed) for speed in speeds.tolist()]
    distinct = {id(each): each for each in answering}
    ids = np.array([id(each) for each in answering])
    return [(each, np.flatnonzero(ids == key)) for key, each in distinct.items()]


def _blocks(machine: Machine, speeds: FloatArray) -> list[np.ndarray]:
    """Indices of the speeds of each block; a machine that does not change has one, and so has what lies beyond its range."""
    known = _softening_range(machine)
    if known is None:
        return [np.arange(speeds.size)]
    number = np.floor(np.log(np.clip(speeds, *known) / known[0]) / np.log1p(BLOCK)).astype(int)
    return [np.flatnonzero(number == n) for n in np.unique(number)]


class _Response:
    """Tip receptances of one machine at speeds: each its own, with a spread that is interpolated between a few."""

    def __init__(
        self, machine: Machine, assembly: ToolAssembly, omega: FloatArray, speeds: FloatArray, bands: bool, stiffness_spread: float
    ) -> None:
        self.machine, self.assembly, self.omega, self.stiffness_spread = machine, assembly, omega, stiffness_spread
        self.known = _softening_range(machine)
        self.anchors, self.spreads = np.zeros(0), list[Mapping[Dof, ComplexArray]]()
        if self.known is None:
            self.alone = self._tip(None, bands)
        elif bands:
            low, high = np.clip([speeds.min(), speeds.max()], *self.known)
            pieces = int(np.ceil(np.log(high / low) / np.log(STRAIGHT)))
            self.anchors = np.linspace(low, high, pieces + 1) if high > (1.0 + BLOCK) * low else np.array([0.5 * (low + high)])
            self.spreads = [self._tip(speed, True).spread for speed in self.anchors.tolist()]

    def _tip(self, speed: float | None, bands: bool) -> TooltipResponse:
        return tooltip(self.machine, self.assembly, self.omega, bands, speed, self.stiffness_spread)

    def at(self, speeds: FloatArray) -> TooltipResponse:
        """Return the response at the middle of a block's speeds."""
        if self.known is None:
            return self.alone
        speed = float(np.mean(np.clip([speeds.min(), speeds.max()], *self.known)))
        response = self._tip(speed, False)
        if not self.spreads:
            return response
        # the directions are those of the covariance, the same at all speeds: their responses can be interpolated
        place = float(np.interp(speed, self.anchors, np.arange(self.anchors.size)))
        first = min(int(place), self.anchors.size - 1)
        second, share = min(first + 1, self.anchors.size - 1), place - first
        axes = self.spreads[first]
        return replace(response, spread={a: (1.0 - share) * axes[a] + share * self.spreads[second][a] for a in axes})
