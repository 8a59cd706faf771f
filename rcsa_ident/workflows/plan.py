"""Which cuts to make next: those that tell most about the tooltips that are wanted, among those that are stable and allowed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.cutting.chip import feed_for_chip
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import AnyEngagement, CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force_directions import WORTH, gain_across, lines_of, turned
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.experiment_design import (
    CandidateCuts,
    Goal,
    MeanVariance,
    deviations,
    exchanged,
    greedy,
)
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.machine.speed_dependence import tips_over_speed
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.measurement import MAX_FREQUENCY, CutMeasurement
from rcsa_ident.stability.lobes import asked_directions, stability_lobes
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.prospects import SPACING, apart, together

#: Frequencies of the receptances behind the lobes [Hz]: lowest, step.
LOBE_FREQUENCIES = (100.0, 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class CutConstraints:
    """Which cuts may be made.

    `lowest`, `highest` [rad/s]: spindle speeds
    `depths`: tuple of float [m], axial depths to choose from
    `feed_per_tooth` [m]; `feed_angle` [rad]
    `second_feed` [rad]: direction of the feed of other cuts: what is felt across the planes is then told better. None: all go along
        `feed_angle`.
    `margin` [-]: the stability limit is at least so many times the depth, at the speed and `SPACING` around it
    `chip_thickness` [m]: each tooling's feed per tooth is then the one at which its chip is nowhere thicker, and `feed_per_tooth` is not
        asked: high-feed cutters take several times the feed of a wall
    """

    lowest: float
    highest: float
    depths: tuple[float, ...]
    feed_per_tooth: float
    engagement: AnyEngagement
    feed_angle: float = 0.0
    margin: float = 1.5
    method: StabilityMethod = field(default_factory=ZeroOrder)
    second_feed: float | None = None
    chip_thickness: float | None = None

    def __post_init__(self) -> None:
        positive("lowest speed", self.lowest, "rad/s")
        positive("feed per tooth", self.feed_per_tooth, "m")
        if not self.lowest <= self.highest < np.inf:
            raise InputError("highest speed", self.highest, f"a finite speed, the lowest ({self.lowest:g}) or more [rad/s]")
        if not self.depths:
            raise InputError("depths", "none", "at least one depth")
        for depth in self.depths:
            positive("depth", depth, "m")
        if not 1.0 <= self.margin < np.inf:
            raise InputError("margin", self.margin, "a finite number, 1 or more")

    def feed_of(self, cutter: Cutter, depth: float) -> float:
        """Return the feed per tooth of a cutter at a depth [m]."""
        return self.feed_per_tooth if self.chip_thickness is None else feed_for_chip(cutter, self.engagement, depth, self.chip_thickness)

    @property
    def feeds(self) -> tuple[float, ...]:
        """Directions of the feed [rad]."""
        return (self.feed_angle,) if self.second_feed is None else (self.feed_angle, self.second_feed)

    @property
    def speeds(self) -> FloatArray:
        """Whole rev/min, a little more than `SPACING` apart, shape (n,) [rad/s]."""
        count = int(np.log(self.highest / self.lowest) / (1.02 * SPACING)) + 1
        rpm = to_rpm(np.geomspace(self.lowest, self.highest, count))
        # rounding does not lead out of what is allowed
        inside = np.clip(np.round(rpm), np.ceil(rpm[0] - 1e-6), max(np.floor(rpm[-1] + 1e-6), np.ceil(rpm[0] - 1e-6)))
        return from_rpm(np.unique(inside))


@dataclass(frozen=True, slots=True)
class PlannedCut:
    """A cut to make. `limit_depth` [m]: up to which it is expected to be stable; infinite beyond what was looked at."""

    tooling: str
    conditions: CuttingConditions
    limit_depth: float


@dataclass(frozen=True, slots=True)
class ShortestPlan:
    """How many of a plan's cuts a wanted band takes.

    `cuts`: the first so many; all of them where the band is not reached
    `band` [-]: what they reach: the largest of the targets'
    """

    cuts: int
    band: float
    reached: bool


@dataclass(frozen=True, slots=True, eq=False)
class PlannedCuts:
    """Cuts to make next, those that tell most first.

    `cuts`: tuple of PlannedCut, length n
    `targets`: tuple of str, length t; the toolings whose tooltips are wanted
    `band` [-], shape (n + 1, t): expected relative standard deviation of each target's tooltip FRF, before and after each cut
    `even` [-], shape (t,): the same after as many cuts at even distances of the allowed speeds, as deep as they may be
    `even_cuts`: these
    `candidates`, `unstable`: cuts to choose from, and those that were left out since they may chatter
    `warnings`: what did not go as it was asked for
    `judges`: one stable cut with each target that is not cut with otherwise: nothing is learned from it, it judges the answer
    """

    cuts: tuple[PlannedCut, ...]
    targets: tuple[str, ...]
    band: FloatArray
    even: FloatArray
    even_cuts: tuple[PlannedCut, ...]
    candidates: int
    unstable: int
    warnings: tuple[str, ...] = ()
    judges: tuple[PlannedCut, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "band", frozen(self.band))
        object.__setattr__(self, "even", frozen(self.even))

    def fewest(self, wanted: float) -> ShortestPlan:
        """Return the fewest of the first cuts after which no target's band is wider than `wanted` [-]."""
        widest = self.band.max(axis=1)
        enough = np.flatnonzero(widest <= positive("wanted band", wanted))
        cuts = int(enough[0]) if enough.size else len(self.cuts)
        return ShortestPlan(cuts, float(widest[cuts]), bool(enough.size))


def plan_cuts(
    machine: IdentifiedMachine,
    toolings: Sequence[Tooling],
    targets: Sequence[Tooling],
    allowed: CutConstraints,
    coefficients: CuttingCoefficients,
    noise: float,
    model_error: Mapping[Dof, float],
    band_hz: tuple[float, float],
    count: int,
    wanted: float | None = None,
    goal: Goal | None = None,
) -> PlannedCuts:
    """Return the cuts that tell most about the targets' tooltips: greedy choice, then exchange.

    `machine`: with posteriors
    `toolings`: to cut with
    `targets`: whose tooltip FRFs are wanted; they need not be cut with
    `coefficients`: with the spreads of what is not known about them
    `noise` [m]: standard deviation of a displacement line's real and imaginary part each
    `model_error`: share of each line that stays unexplained, as identified
    `band_hz`: (float, float); where the tooltips are wanted
    `count`: most cuts
    `wanted` [-]: stop at the fewest cuts that are found to bring all targets' bands below it
    `goal`: by default the targets' mean variance
    Raises `InputError` if an axis has no posterior, or no cut is stable and allowed.
    """
    check(machine, toolings, targets, count, band_hz)
    goal = MeanVariance() if goal is None else goal
    candidates, unstable, deepest = _candidates(machine, toolings, allowed, coefficients)
    if not candidates:
        found = f"none of {unstable} stable with a margin of {allowed.margin:g} (the deepest stable one would be {1e3 * deepest:.3g} mm)"
        raise InputError("cuts", found, "depths, speeds and toolings of which at least one is")
    made = [(cut.tooling, cut.conditions) for cut in candidates]
    asked = machine, made, toolings, targets, coefficients, noise, model_error, band_hz
    prospects = together(*asked) if machine.coupled_planes else apart(*asked)
    order = greedy(prospects, count, goal)
    warnings = []
    if len(order) < count:
        warnings.append(f"only {len(order)} of {count} cuts: no further stable speed is {100 * SPACING:g} % away from the others")
    order = exchanged(prospects, order, goal) if wanted is None else _shortest(prospects, order, goal, positive("wanted band", wanted))
    even = _even(candidates, toolings, allowed, len(order))
    band = deviations(prospects, order)
    if wanted is not None and band[-1].max() > wanted:
        warnings.append(
            f"a standard deviation of {100 * wanted:.3g} % is not reached: {len(order)} cuts give {100 * band[-1].max():.3g} % "
            f"({100 * band[0].max():.3g} % without them)"
        )
    return PlannedCuts(
        tuple(candidates[k] for k in order),
        tuple(t.name for t in targets),
        band,
        prospects.deviation(prospects.covariance(even)),
        tuple(candidates[k] for k in even),
        len(candidates),
        unstable,
        tuple(warnings),
        _judges(machine, toolings, targets, allowed, coefficients),
    )


def _judges(
    machine: IdentifiedMachine,
    toolings: Sequence[Tooling],
    targets: Sequence[Tooling],
    allowed: CutConstraints,
    coefficients: CuttingCoefficients,
) -> tuple[PlannedCut, ...]:
    """The deepest stable cut, and of these the one nearest to the middle of the speeds, with each target that is not cut with."""
    made, middle, found = {tooling.name for tooling in toolings}, float(np.sqrt(allowed.lowest * allowed.highest)), []
    for target in targets:
        if target.name not in made:
            cuts, _, _ = _candidates(machine, [target], allowed, coefficients)
            found += sorted(cuts, key=lambda cut: (-cut.conditions.axial_depth, abs(cut.conditions.spindle_speed - middle)))[:1]
    return tuple(found)


def alternating(allowed: CutConstraints, toolings: Sequence[Tooling], coefficients: CuttingCoefficients) -> CutConstraints:
    """Return the constraints with a feed at right angles beside the first one, where that pushes the tools in further directions."""
    depth = max(allowed.depths)
    lines = [
        lines_of(
            tooling.cutter,
            CuttingConditions(speed, depth, allowed.feed_of(tooling.cutter, depth), allowed.engagement, allowed.feed_angle),
            coefficients,
            2.0 * np.pi * MAX_FREQUENCY,
        )
        for tooling in toolings
        for speed in allowed.speeds.tolist()
    ]
    worth = gain_across(lines, turned(lines)) > WORTH
    return replace(allowed, second_feed=allowed.feed_angle + 0.5 * np.pi) if worth else allowed


def line_noise(measurements: Sequence[CutMeasurement]) -> float:
    """Return the standard deviation of a displacement line's real and imaginary part in some cuts: the median over all lines [m]."""
    each = [np.sqrt(np.sum(lines.variance, axis=1)) * np.abs(lines.force) for m in measurements for lines in m.axes.values()]
    if not each:
        raise InputError("cuts", "none usable", "at least one usable cut to learn the noise from")
    return float(np.median(np.concatenate(each)))


def check(
    machine: IdentifiedMachine, toolings: Sequence[Tooling], targets: Sequence[Tooling], count: int, band_hz: tuple[float, float]
) -> None:
    """Raise an `InputError` if nothing can be planned so; parameters as those of `plan_cuts`."""
    for axis, part in machine.identified.items():
        if part.posterior is None and not machine.coupled_planes:
            raise InputError(f"axis {axis.upper()}", "no covariance", "an identification with a posterior")
    for name, given in (("toolings", toolings), ("targets", targets)):
        if not given:
            raise InputError(name, "none", "at least one tooling")
        names = [t.name for t in given]
        if len(set(names)) < len(names):
            raise InputError(name, ", ".join(names), "toolings of different names")
    if count < 1:
        raise InputError("cuts", count, "1 or more")
    if not 0.0 < band_hz[0] < band_hz[1] < np.inf:
        raise InputError("band", list(band_hz), "lower and upper end, 0 < lower < upper [Hz]")


def _candidates(
    machine: IdentifiedMachine, toolings: Sequence[Tooling], allowed: CutConstraints, coefficients: CuttingCoefficients
) -> tuple[list[PlannedCut], int, float]:
    """All stable cuts, tooling by tooling, speed by speed; how many may chatter; the deepest that would be stable anywhere [m]."""
    around = np.array([1.0 - SPACING, 1.0, 1.0 + SPACING])
    speeds = allowed.speeds
    deepest, unstable, cuts = 0.0, 0, []
    for tooling in toolings:
        # a speed whose first tooth-passing line lies above the band shows nothing
        seen = speeds[speeds * tooling.cutter.teeth <= 2.0 * np.pi * MAX_FREQUENCY]
        if not seen.size:
            continue
        # without anything known across the planes nothing weighs one feed against the other: they take turns
        feeds = len(allowed.feeds)
        turns = [seen] * feeds if machine.coupled_planes else [seen[k::feeds] for k in range(feeds)]
        for feed, own in zip(allowed.feeds, turns, strict=True):
            if not own.size:
                continue
            limits = limits_at(machine, tooling, allowed, coefficients, feed, np.outer(around, own).ravel())
            limits = limits.reshape(around.size, -1).min(axis=0)
            deepest = max(deepest, float(limits.max()) / allowed.margin)
            for speed, limit in zip(own.tolist(), limits.tolist(), strict=True):
                for depth in allowed.depths:
                    if allowed.margin * depth > limit:
                        unstable += 1
                        continue
                    own_feed = allowed.feed_of(tooling.cutter, depth)
                    chosen = CuttingConditions(speed, depth, own_feed, allowed.engagement, feed)
                    cuts.append(PlannedCut(tooling.name, chosen, limit))
    return cuts, unstable, deepest


def limits_at(
    machine: IdentifiedMachine,
    tooling: Tooling,
    allowed: CutConstraints,
    coefficients: CuttingCoefficients,
    feed_angle: float,
    speeds: FloatArray,
) -> FloatArray:
    """Return the stability limit at each speed, up to twice what the constraints ask for, shape (n,) [m].

    `feed_angle` [rad]; `speeds` [rad/s], shape (n,)
    """
    omega = 2.0 * np.pi * np.arange(LOBE_FREQUENCIES[0], MAX_FREQUENCY, LOBE_FREQUENCIES[1])
    # with unlike teeth the feed decides which of them cut
    feed = allowed.feed_of(tooling.cutter, max(allowed.depths))
    process = MillingProcess(tooling.cutter, coefficients, allowed.engagement, feed_angle, feed_per_tooth=feed)
    limits, deepest = np.empty(speeds.size), 2.0 * allowed.margin * max(allowed.depths)
    for places, tip in tips_over_speed(machine, tooling, omega, speeds, spread=False, directions=asked_directions(process)):
        limits[places] = stability_lobes(tip, process, speeds[places], deepest, allowed.method).limit_depth
    return limits


def _shortest(prospects: CandidateCuts, order: list[int], goal: Goal, wanted: float) -> list[int]:
    """The fewest cuts that are found to reach a band: the greedy choice's, then ever fewer as long as an exchange reaches it."""
    band = deviations(prospects, order).max(axis=1)
    if band[0] <= wanted:
        return []
    enough = np.flatnonzero(band <= wanted)
    best = order[: int(enough[0])] if enough.size else exchanged(prospects, order, goal)
    if not enough.size and deviations(prospects, best)[-1].max() > wanted:
        return best
    while len(best) > 1:
        fewer = exchanged(prospects, greedy(prospects, len(best) - 1, goal), goal)
        if prospects.deviation(prospects.covariance(fewer)).max() > wanted:
            break
        best = fewer
    return best


def _even(candidates: Sequence[PlannedCut], toolings: Sequence[Tooling], allowed: CutConstraints, count: int) -> list[int]:
    """As many cuts as a plan has, shared evenly among the toolings, at stable speeds nearest to even distances, as deep as allowed."""
    chosen: list[int] = []
    present = [t.name for t in toolings if any(c.tooling == t.name for c in candidates)]
    for i, name in enumerate(present):
        own = [k for k, c in enumerate(candidates) if c.tooling == name]
        deepest: dict[float, int] = {}
        for k in own:
            speed = candidates[k].conditions.spindle_speed
            if speed not in deepest or candidates[k].conditions.axial_depth > candidates[deepest[speed]].conditions.axial_depth:
                deepest[speed] = k
        share = count // len(present) + (i < count % len(present))
        places = np.linspace(allowed.lowest, allowed.highest, share) if share > 1 else [0.5 * (allowed.lowest + allowed.highest)] * share
        for place in places:
            if not deepest:
                break
            chosen.append(deepest.pop(min(deepest, key=lambda s: abs(s - place))))
    return chosen
