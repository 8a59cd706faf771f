"""After a tool change: what the tip does, which cuts are stable, which one is recommended.

Command line, service, page, report and a script ask here, so that all of them say the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import SEARCHED_DEPTH, SPINDLE_SPEED
from rcsa_ident.base.units import from_hz, to_hz, to_rpm
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.machine.learnt_tip import LearntTip
from rcsa_ident.machine.machine import STIFFNESS_SPREAD, Machine, TipSource
from rcsa_ident.machine.speed_dependence import Tips, tips_over_speed
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import BareCutter, Tooling
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.labels.coverage import Covered, TestedAnswers, unlabelled
from rcsa_ident.stability.labels.label_noise import LabelNoise
from rcsa_ident.stability.labels.tested_cuts import Tally, TestedCuts, tally
from rcsa_ident.stability.lobes import (
    APART,
    DRAWS,
    asked_directions,
    asked_speeds,
    both_directions,
    directions_for,
    limits_of,
    unusual_speeds,
    with_own_draws,
)
from rcsa_ident.stability.methods import StabilityMethod, Watch, Watched
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.pockets import pad_speeds
from rcsa_ident.stability.result import TOLERANCE, StabilityLobes
from rcsa_ident.stability.stability_map import MonodromyMethod, StabilityMap, stability_map
from rcsa_ident.stability.surface_error import SurfaceError, surface_location_error
from rcsa_ident.stability.tip_modes import TIP, TipModes, fitted_modes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.proportions import edge_length

#: How far beyond the identified band receptances are computed where a method fits modes to them: those above it are the tool's own.
BEYOND = 1.5
#: Modes of a tool-holder are looked for up to so many times the highest frequency of the limits, so far apart [rad/s], and told from
#: that share of the flexibility below on, for which every fourth frequency is enough.
ABOVE, _ABOVE_STEP, CRITICAL, _ABOVE_EVERY = 2.5, from_hz(10.0), 0.7, 4
#: Seconds for a line and an unknown of the posterior, those of planes that feel each other, and further seconds for a speed with bands.
_SPREAD_SECONDS, _SPREAD_SECONDS_OF_BOTH, _BAND_SECONDS = 1e-6, 9e-6, 2e-4
#: A machine that changes with speed costs so many further seconds, and so many the modes of a tip.
_CHANGING_SECONDS, _FIT_SECONDS = 4.0, 1.0
#: What recommendations are computed by, and at about how many speeds; what the limit of a drawn machine costs of a limit.
_FITTING, _FITTED_SPEEDS, _DRAWN = FullDiscretisation(), 35, 0.05
#: Machines that are drawn there at least, and of all of them so many as take about this time at one speed [s].
_FEWEST, _DRAWN_SECONDS = 20, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class TipAnswer:
    """What the tip of a tooling does.

    `remarks`: what the user should know
    `speed` [rad/s]: spindle speed that it holds at; None where it does not change
    `state`: for which state of the machine it holds, in words; empty where it has one alone
    """

    tooling: Tooling
    tip: UncertainReceptance
    remarks: tuple[str, ...]
    speed: float | None = None
    state: str = ""


def tooltip(
    machine: TipSource,
    tooling: Tooling,
    omega: FloatArray | None = None,
    speed: float | None = None,
    spread: bool = True,
    stiffness_spread: float = STIFFNESS_SPREAD,
    relative: bool = False,
) -> TipAnswer:
    """Return the tip's receptance of a tooling on a machine.

    `omega`: array, shape (n,) [rad/s], default the machine's `lines`
    `speed` [rad/s]: spindle speed, for a machine that changes with it; by default the middle of the speeds that it is known at
    `spread`: with what the records leave open
    `stiffness_spread`: standard deviation of the tool-holder's stiffness, as a share
    `relative`: relative to the workpiece, as limits are computed from; by default the tool's own
    """
    if speed is not None:
        SPINDLE_SPEED.checked("speed", speed)
    here = machine.at(speed)
    tip = (here.relative_tip if relative else here.tip)(tooling, omega, spread, stiffness_spread, here.translations)
    if isinstance(tip, TipModes):
        lines = tip.receptance().omega if omega is None else omega
        tip = UncertainReceptance(lines, tip.response(lines), TIP, TIP)
    remarks = [*tooling.remarks, *machine.remarks, *([] if speed is None else _outside_speeds(machine, np.array([speed])))]
    if machine.band is not None and tip.omega.max() > 1.001 * machine.band[1]:
        top = to_hz(machine.band[1])
        remarks.append(f"the machine is known up to {top:.0f} Hz; above that the receptance is extrapolated")
    remarks += tooling.cutter.cylinder_remarks()
    answered = machine.speed_answered(speed)
    return TipAnswer(tooling, tip, tuple(remarks), answered, machine.state(answered))


@dataclass(frozen=True, slots=True, eq=False)
class Fitting:
    """Limits by a method that fits the cut, and the cut itself at those speeds.

    `cuts`: tuple of (speeds [rad/s], MonodromyOperator); one for each block of speeds that share a tip; none where limits come from labels
    """

    lobes: StabilityLobes
    cuts: tuple[tuple[FloatArray, MonodromyOperator], ...]


@dataclass(frozen=True, slots=True, eq=False)
class ToolChange:
    """A tooling on a machine, and the cut that is asked about.

    `speeds` [rad/s], shape (n,): rising
    `max_depth` [m]: depths beyond it are not of interest
    `draws`: machines drawn from what the records leave open; 0 leaves it aside
    `stiffness_spread`: standard deviation of the tool-holder's stiffness, as a share
    `recommend`: whether cuts are recommended, too: zero-order limits alone are a preview, there at once
    """

    machine: TipSource
    tooling: Tooling
    cut: CutSpec
    speeds: FloatArray
    max_depth: float
    method: StabilityMethod = ZeroOrder()  # noqa: RUF009 - frozen
    draws: int = DRAWS
    stiffness_spread: float = STIFFNESS_SPREAD
    recommend: bool = True

    def __post_init__(self) -> None:
        if np.size(self.speeds):  # a path brings its own
            asked_speeds(self.speeds)
        SEARCHED_DEPTH.checked("max_depth", self.max_depth)
        if not 0.0 <= self.stiffness_spread <= 0.5:
            raise InputError("stiffness_spread", self.stiffness_spread, "a share from 0 to 0.5")

    @property
    def process(self) -> MillingProcess:
        """What cuts what, and how."""
        return self.cut.process(self.tooling.cutter, self.machine.workpiece)

    @property
    def omega(self) -> FloatArray:
        """Frequencies of the receptances that the limits are computed from, shape (k,) [rad/s]."""
        return self._lines_of(self.method)

    def _lines_of(self, method: StabilityMethod) -> FloatArray:
        return self.machine.lines(BEYOND if method.needs == "modes" else 1.0)

    @property
    def seconds(self) -> float:
        """About how long an advice takes on one core of a plain server [s], with the speeds beside those that are asked for."""
        zero_order = isinstance(self.method, ZeroOrder)
        speeds = pad_speeds(self.speeds, TOLERANCE)
        found = float(np.sum(self._seconds_of(self.method, speeds)))
        # of drawn machines, whose lobes come closer as a spindle turns slower
        found += _BAND_SECONDS * float(np.sum(4000.0 / to_rpm(speeds))) if self.draws else 0.0
        found += _FIT_SECONDS if self.method.needs == "modes" else 0.0
        if not (zero_order and self.machine.prepared):
            found += _CHANGING_SECONDS if self.machine.speed_range is not None else 0.0
            found += spread_seconds(self.machine, self.omega) if self.draws else 0.0
        each = float(np.mean(self._seconds_of(_FITTING, self.speeds)))
        # of what is known exactly none are drawn
        drawn = 0.0 if self.machine.unknowns == 0 and self.tooling.spread.exact else _DRAWN
        if self.recommend:
            found += _FIT_SECONDS + _FITTED_SPEEDS * each * (1.0 + drawn * self.fitting_draws)
        if not zero_order:
            # limits of drawn machines are asked at speeds apart, and at each where the limit turns
            found += min(speeds.size, np.log(speeds[-1] / speeds[0]) / np.log1p(APART) + 20.0) * each * drawn * self.draws
        return found

    @property
    def fitting_draws(self) -> int:
        """How many machines are drawn where cuts are recommended: fewer where each limit takes long, as with teeth that are not alike."""
        each = float(np.mean(self._seconds_of(_FITTING, self.speeds)))
        return min(self.draws, max(_FEWEST, int(_DRAWN_SECONDS / each)))

    def _seconds_of(self, method: StabilityMethod, speeds: FloatArray) -> FloatArray:
        """About how long a method takes for the limit at each speed [s]."""
        return method.seconds_per_operation * method.operations(self.process, speeds, float(self._lines_of(method)[-1]), self.max_depth)

    def tips(self, speeds: FloatArray, omega: FloatArray | None = None, spread: bool = False) -> Tips:
        """Yield the tip for each block of speeds that share one, in the directions that count for the cut; see `tips_over_speed`."""
        lines = self.machine.lines(BEYOND) if omega is None else omega
        return tips_over_speed(self.machine, self.tooling, lines, speeds, spread, self.stiffness_spread, asked_directions(self.process))

    def watched(self, watch: Watch) -> ToolChange:
        """Return the same question, whose method tells each speed's limit once it is known, where it asks speed by speed."""
        return replace(self, method=replace(self.method, watch=watch)) if isinstance(self.method, Watched) else self  # type: ignore[type-var]

    def limits(self, speeds: FloatArray | None = None, max_depth: float | None = None, draws: int | None = None) -> StabilityLobes:
        """Return the stability limits at rising speeds, each asked of the machine as it is at that speed; by default as asked for."""
        speeds = np.unique(self.speeds if speeds is None else speeds)
        depth, draws = self.max_depth if max_depth is None else max_depth, self.draws if draws is None else draws
        process, parts, order = self.process, [], []
        if isinstance(self.machine, LearntTip):
            return self.machine.limits(process, speeds, depth, draws)
        for places, tip in self.tips(speeds, self.omega, draws > 0):
            order.append(places)
            parts.append(limits_of(tip, process, speeds[places], depth, self.method, draws))
        return StabilityLobes.joined(parts, order)

    def fitting_limits(self, speeds: FloatArray, draws: int | None = None) -> Fitting:
        """Return the limits at rising speeds by the method that fits any cut, each drawn machine's by its own period map."""
        draws, process = self.fitting_draws if draws is None else draws, self.process
        if isinstance(self.machine, LearntTip):
            # its limits are those of the draws, and their error is that of the method which they were learnt by
            return Fitting(self.machine.limits(process, speeds, self.max_depth, draws), ())
        parts, order, cuts = [], [], []
        for places, tip in self.tips(speeds, spread=draws > 1):
            modes = modes_of(tip, process)
            found = _FITTING.lobes(modes, process, speeds[places], self.max_depth)
            if draws > 1 and isinstance(tip, UncertainReceptance) and tip.complete:
                found = with_own_draws(found, tip, modes, process, draws)
            order.append(places)
            parts.append(found)
            cuts.append((speeds[places], _FITTING.monodromy(modes, process)))
        return Fitting(StabilityLobes.joined(parts, order), tuple(cuts))

    def remarks(self, lobes: StabilityLobes) -> tuple[str, ...]:
        """Return what speaks against limits."""
        band = self.machine.band
        labels = unlabelled(self.machine.posterior.points, self.process) if isinstance(self.machine, LearntTip) else ()
        outside = None if band is None else _outside_band(lobes, band)
        said = [
            *self.tooling.remarks,
            *self.machine.remarks,
            *labels,
            *lobes.warnings,
            *self._beyond(lobes),
            *([outside] if outside else []),
            *_outside_speeds(self.machine, self.speeds),
            *unusual_speeds(self.process, self.speeds),
        ]
        return tuple(dict.fromkeys(said))

    def _beyond(self, lobes: StabilityLobes) -> list[str]:
        """Sentences where the limits leave out what is there: the end of the tool's edges, a mode above the frequencies."""
        if isinstance(self.tooling, BareCutter):
            return []
        longest, where = edge_length(self.tooling.assembly, self.tooling.cutter)
        deeper = int(np.sum(np.minimum(lobes.limit_depth, self.max_depth) > longest * (1.0 + 1e-9)))
        told = f"at {deeper} of {lobes.spindle_speed.size} speeds the limit is deeper than the tool's {where} of {1e3 * longest:.4g} mm"
        return [*([told] if deeper else []), *_modes_above(self.machine, self.tooling, self.omega)]


def modes_of(tip: Receptance | TipModes, process: MillingProcess) -> TipModes:
    """Return a tip's modes, fitted where they are not known."""
    if isinstance(tip, TipModes):
        return tip
    return fitted_modes(directions_for(process, tip))[0]


def classify_tested_cuts(change: ToolChange, cuts: TestedCuts) -> Tally:
    """Return how many tested cuts lie on the side of the limit where they were seen, each asked at its own speed and as it was made."""
    if isinstance(change.machine, LearntTip):
        # it tells cuts, not limits: a cut may be stable above an unstable depth
        return tally(cuts, np.where(change.machine.answers(change.process, cuts).stable >= 0.5, np.inf, 0.0))
    limit = np.empty(cuts.axial_depth.shape)
    for places, one in _as_made(change, cuts):
        some = cuts.at_places(places)
        lobes = one.limits(some.spindle_speed, max(change.max_depth, 1.01 * float(cuts.axial_depth.max())), 0)
        limit[places] = lobes.limit_depth[np.searchsorted(lobes.spindle_speed, some.spindle_speed)]
    return tally(cuts, limit)


def tested_answers(change: ToolChange, cuts: TestedCuts) -> TestedAnswers:
    """Return the probability that each tested cut is called stable, and whether labels cover it.

    A machine that was identified, or modes without spreads, say it by their own limits and what those leave open, beside the doubt that
    labels always have: no label covers any cut. A learnt tip says it by its draws, and by its labels without physics.
    """
    if isinstance(change.machine, LearntTip):
        return change.machine.answers(change.process, cuts)
    found, deepest = np.empty(cuts.axial_depth.shape), max(change.max_depth, 4.0 * float(cuts.axial_depth.max()))
    for places, one in _as_made(change, cuts):
        some = cuts.at_places(places)
        speeds, place = np.unique(some.spindle_speed, return_inverse=True)
        lobes = one.limits(speeds, deepest)
        drawn = lobes.limit_depth[None] if lobes.drawn is None else lobes.drawn
        margin = np.log(np.minimum(drawn, deepest))[:, place] - np.log(some.axial_depth)
        found[places] = LabelNoise().stable(margin).mean(axis=0)
    return TestedAnswers(found, (Covered.NO,) * found.size)


def _as_made(change: ToolChange, cuts: TestedCuts) -> list[tuple[NDArray[np.intp], ToolChange]]:
    """Places of cuts that were made alike, and the question with the cut that they were."""
    return [
        (places, replace(change, cut=replace(change.cut, engagement=made.engagement, feed_per_tooth=made.feed_per_tooth)))
        for places, made in cuts.alike(change.process)
    ]


def map_of(change: ToolChange, depths: int = 100, full: bool = False) -> StabilityMap:
    """Return the map of stable cuts up to the largest depth: above the first loss of stability a cut may be stable again.

    `change`: its method, if that gives maps, else full-discretisation
    `depths`: equal steps of the depth
    `full`: compute every point
    """
    method = change.method if isinstance(change.method, MonodromyMethod) else FullDiscretisation()
    speeds, depth = np.unique(change.speeds), change.max_depth * np.arange(1, depths + 1) / depths
    parts = []
    for places, tip in change.tips(speeds):
        parts.append(stability_map(modes_of(tip, change.process), change.process, speeds[places], depth, method, full))
    return StabilityMap.joined(parts)


def surface_of(change: ToolChange, depth: float) -> SurfaceError:
    """Return the surface location error at a depth [m], each speed with the machine as it is there."""
    speeds = np.unique(change.speeds)
    error, parts = np.zeros((speeds.size, 0)), list[SurfaceError]()
    for places, tip in change.tips(speeds):
        part = surface_location_error(tip if isinstance(tip, TipModes) else both_directions(tip), change.process, speeds[places], depth)
        error = np.zeros((speeds.size, part.height.size)) if not parts else error
        error[places] = part.error
        parts.append(part)
    warnings = tuple(dict.fromkeys(warning for part in parts for warning in part.warnings))
    return SurfaceError(speeds, parts[0].height, error, parts[0].wall, warnings)


def spread_seconds(machine: TipSource, omega: FloatArray) -> float:
    """Return about how long the spread of a tip at some frequencies takes where nothing is worked out before [s]."""
    return (_SPREAD_SECONDS_OF_BOTH if machine.coupled_planes else _SPREAD_SECONDS) * machine.unknowns * omega.size


def _modes_above(machine: TipSource, tooling: Tooling, omega: FloatArray) -> list[str]:
    """A sentence where the tip is as flexible above the frequencies of the limits as below: the tool's own modes, of its elements.

    What a limit depends on is how negative the real part of the tip's receptance is. A measurement says nothing beyond its end: the
    flange is then held at rest, which leaves the tool-holder's modes about where they are.
    """
    if not (isinstance(machine, Machine) or machine.ends) or isinstance(tooling, BareCutter):
        return []
    source, top = machine.at(None), float(omega[-1])
    above = np.arange(top, ABOVE * top, _ABOVE_STEP)

    def tip(at: FloatArray) -> Receptance:
        found = source.relative_tip(tooling, at, spread=False)
        assert not isinstance(found, TipModes)
        return found

    known = _lowest_real_part(tip(omega[::-_ABOVE_EVERY][::-1]))[1]
    if machine.ends:
        rest = Receptance(above, np.zeros((above.size, 2, 2)), plane("flange"), plane("flange"))
        beyond = couple(tool_holder_receptance(tooling.assembly, above), rest, None).block((Coordinate("tip", Dof.X),))
    else:
        beyond = tip(above)
    where, least = _lowest_real_part(beyond)
    # at the top itself it is the flank of a mode that the limits see
    if where == top or least >= min(CRITICAL * known, 0.0):
        return []
    share = f"{least / known:.2g}" if 100.0 * known < least else "more than 100"
    return [
        f"a mode of this tool-holder at about {to_hz(where):.0f} Hz lies above the {to_hz(top):.0f} Hz up to which limits are computed, "
        f"and there the tip is {share} times as flexible as below: true limits may be lower"
    ]


def _lowest_real_part(tip: Receptance) -> tuple[float, float]:
    """Frequency [rad/s] and value [m/N] of the most negative real part along a direction of the tip."""
    least = np.einsum("nii->ni", tip.values).real.min(axis=1)
    worst = int(np.argmin(least))
    return float(tip.omega[worst]), float(least[worst])


def _outside_band(lobes: StabilityLobes, band: tuple[float, float]) -> str | None:
    """Return a sentence where the limiting vibration lies outside the band in which the machine is known, else None."""
    low, high = (to_hz(w) for w in band)
    frequency = to_hz(lobes.chatter_frequency[np.isfinite(lobes.chatter_frequency)])
    outside = (frequency < low) | (frequency > high)
    if not outside.any():
        return None
    worst = float(frequency[outside][np.argmax(np.abs(frequency[outside] - 0.5 * (low + high)))])
    return (
        f"at {int(outside.sum())} of {lobes.spindle_speed.size} speeds chatter is expected outside the identified band "
        f"{low:.0f}-{high:.0f} Hz (as far as {worst:.0f} Hz): the machine is extrapolated there"
    )


def _outside_speeds(machine: TipSource, speeds: FloatArray) -> list[str]:
    """Return a sentence where a machine that changes with speed is asked for speeds that it was not cut at."""
    known = machine.speed_range
    # the last digit of a speed that was written in rev/min is nobody's wish
    if known is None or (speeds.min() >= known[0] * (1.0 - 1e-9) and speeds.max() <= known[1] * (1.0 + 1e-9)):
        return []
    low, high = (to_rpm(speed) for speed in known)
    return [
        f"the machine was identified from {low:.0f} to {high:.0f} rev/min; outside this range its dynamics at the nearest speed are used"
    ]
