"""Which cuts a tooling can make on a machine, and which of them is recommended: one computation, whatever curve stands beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import AXIAL_DEPTH, SEARCHED_DEPTH, SPINDLE_SPEED
from rcsa_ident.base.units import to_hz
from rcsa_ident.cutting.power import SpindleDrive
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.stability.advice import Advice, UsableDepths, highest_removal, planned_cut, speed_windows, usable_depths
from rcsa_ident.stability.band_shares import BandShares, band_shares
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.labels.tested_cuts import TestedCuts
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multiplier_limits import Growth, longest_step
from rcsa_ident.stability.operating_point import Bound, HeldBack, OperatingPoint, operating_point
from rcsa_ident.stability.pockets import AROUND, least_within_tolerance, pad_speeds, speeds_around
from rcsa_ident.stability.result import PROBABILITY, RESERVE, TOLERANCE, Pocket, StabilityLobes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.tool_holder.proportions import edge_length
from rcsa_ident.workflows.tool_change import Fitting, ToolChange, classify_tested_cuts

_UNLIMITED = SpindleDrive.flat(None, None, None)
#: Speeds within the tolerance at which a recommended depth is looked at once more, and how often it may have to give way.
_DENSE, _LOOKS = 41, 4
#: Just below the lowest limit that the close speeds have shown.
_BELOW = 0.995
Place = TypeVar("Place", OperatingPoint, Pocket)


@dataclass(frozen=True, slots=True)
class _Shares:
    """What a recommendation holds back."""

    tolerance: float
    probability: float
    reserve: float


def advise(
    change: ToolChange,
    drive: SpindleDrive = _UNLIMITED,
    tolerance: float = TOLERANCE,
    probability: float = PROBABILITY,
    reserve: float = RESERVE,
    depth: float | None = None,
    planned: Sequence[tuple[float, float]] = (),
    tested: TestedCuts | None = None,
) -> Advice:
    """Return the stability limits of a tooling, and what is recommended within them.

    The recommended cuts do not depend on the method of the limits beside them.

    `drive`: what the spindle has; without a feed per tooth its power and torque cannot be asked
    `tolerance`, `probability`, `reserve`: what a recommendation holds back: see `StabilityLobes.recommended_depth`
    `depth` [m]: at which speeds may one cut so deep?
    `planned`: sequence of (speed [rad/s], depth [m]); how far are these cuts from chatter?
    `tested`: cuts that were tried: how many do the limits tell right?
    """
    process, shares, asked = change.process, _Shares(tolerance, probability, reserve), change
    SEARCHED_DEPTH.checked("max_depth", change.max_depth)
    if depth is not None:
        AXIAL_DEPTH.checked("depth", depth)
    for i, (speed, at) in enumerate(planned):
        SPINDLE_SPEED.checked(f"planned[{i}] spindle speed", speed)
        AXIAL_DEPTH.checked(f"planned[{i}] axial depth", at)
    if depth is not None and 0.0 <= reserve < 1.0:
        # twice as deep as tells whether this depth may be cut: straight lines to the limits beside it show where its windows end
        change = replace(change, max_depth=min(max(change.max_depth, 2.0 * depth / (1.0 - reserve)), AXIAL_DEPTH.most))
    wide = _limits_beside(change, pad_speeds(change.speeds, tolerance, [speed for speed, _ in planned]))
    low, high = float(np.min(change.speeds)), float(np.max(change.speeds))

    def usable_of(limits: StabilityLobes) -> UsableDepths:
        return usable_depths(limits, process, drive, tolerance, probability, reserve)

    usable, lobes = usable_of(wide).between(low, high), wide.between(low, high)
    found = _Recommended()
    if asked.recommend:
        # nothing of the recommendation hangs on what else is asked
        same = isinstance(asked.method, ZeroOrder) and not planned and depth is None
        found = _recommended(asked, wide if same else _preview(asked, tolerance, wide), usable_of, shares)
    else:
        pockets = lobes.best_speeds(recommended=usable.stable)
        found = _Recommended(pockets=tuple(replace(pocket, recommended_depth=np.nan) for pocket in pockets))
    judged = _judged(change, [speed for speed, _ in planned], tolerance) if asked.recommend else {}
    best = next((point for point in found.points if np.isfinite(point.depth)), None)
    return Advice(
        change.tooling.name,
        None if isinstance(change.tooling, BareCutter) else change.tooling.assembly.stickout,
        lobes,
        usable,
        found.points,
        () if depth is None else tuple(speed_windows(usable, depth)),
        tuple(planned_cut(wide, process, drive, speed, at, tolerance, probability, judged.get(speed)) for speed, at in planned),
        None if tested is None else classify_tested_cuts(change, tested),
        tuple(dict.fromkeys([*change.remarks(lobes), *drive.remarks, *found.remarks])),
        found.pockets,
        found.by,
        None if best is None else _band_of(asked, best.spindle_speed, tolerance),
        found.around,
        change.machine.state(),
    )


def _band_of(change: ToolChange, speed: float, tolerance: float) -> BandShares | None:
    """What the band of the limit at a recommended speed consists of."""
    if change.draws < 2:
        return None
    ((_, tip),) = change.tips(np.array([speed]), change.machine.lines(), spread=True)
    asked = change.process, speed, change.max_depth, tolerance, change.tooling.stated
    return band_shares(tip, *asked) if isinstance(tip, UncertainReceptance) else None


def _limits_beside(change: ToolChange, speeds: FloatArray) -> StabilityLobes:
    """Limits at the speeds that were asked for, among further ones beside them."""
    if change.machine.speed_range is None:
        return change.limits(speeds)
    # close speeds share the machine at their middle, which those that nobody has asked for shall not move
    known = np.unique(change.speeds)
    asked = np.searchsorted(known, speeds * (1.0 - 1e-9)) < np.searchsorted(known, speeds * (1.0 + 1e-9))
    places = [np.flatnonzero(part) for part in (asked, ~asked) if part.any()]
    return StabilityLobes.joined([change.limits(speeds[own]) for own in places], places)


def _preview(change: ToolChange, tolerance: float, known: StabilityLobes) -> StabilityLobes:
    """Zero-order limits, which say where to look; those that are known where that method does not take the cut, as at a varying speed."""
    try:
        return _limits_beside(replace(change, method=ZeroOrder()), pad_speeds(change.speeds, tolerance))
    except InputError:
        return known


def _judged(change: ToolChange, speeds: Sequence[float], tolerance: float) -> dict[float, StabilityLobes]:
    """Limits around the speeds of planned cuts by the method that fits them; none where it does not take the cut."""
    near = {speed: speed * np.linspace(1.0 - tolerance, 1.0 + tolerance, 5 if tolerance > 0.0 else 1) for speed in speeds}
    if not near:
        return {}
    try:
        found = change.fitting_limits(np.unique(np.concatenate(list(near.values())))).lobes
    except InputError:
        return {}
    return {speed: found.between(float(own[0]), float(own[-1])) for speed, own in near.items()}


@dataclass(frozen=True, slots=True)
class _Recommended:
    """Recommended cuts, pockets, the method behind them, what speaks against them, and the limits around them."""

    points: tuple[OperatingPoint, ...] = ()
    pockets: tuple[Pocket, ...] = ()
    by: str | None = None
    remarks: tuple[str, ...] = ()
    around: tuple[StabilityLobes, ...] = ()


def _recommended(
    change: ToolChange, preview: StabilityLobes, usable_of: Callable[[StabilityLobes], UsableDepths], shares: _Shares
) -> _Recommended:
    """Return the cuts that are recommended.

    Zero-order limits only say where to look: half a percent beside a pocket's top another vibration may be the limit, of which they know
    nothing. Around the best of their pockets the limits are computed anew, so close that the tolerance of the speed is seen.
    """
    low, high = float(np.min(change.speeds)), float(np.max(change.speeds))
    usable = usable_of(preview).between(low, high)
    # zero-order limits that are no source of a recommendation still know where pockets may be
    tops = [found.spindle_speed for found in highest_removal(usable, change.process)]
    tops = tops or [found.spindle_speed for found in preview.between(low, high).best_speeds(recommended=usable.stable)]
    blocks = speeds_around(tops, shares.tolerance, (low, high))
    if not blocks:
        return _Recommended(by=FullDiscretisation.name)
    try:
        fitting = change.fitting_limits(np.unique(np.concatenate([block.speeds for block in blocks])))
    except InputError as error:
        return _Recommended(remarks=(f"no cut is recommended: {error}",))
    points, pockets = list[OperatingPoint](), list[Pocket]()
    around = dict[float, StabilityLobes]()
    for block in blocks:
        own = fitting.lobes.between(float(block.speeds[0]), float(block.speeds[-1]))
        depths = usable_of(own)
        for point in highest_removal(depths.between(*block.tops), change.process, 1):
            points.append(_checked(change, fitting, own, depths, point.spindle_speed, shares))
            around[point.spindle_speed] = own
        pockets += own.between(*block.tops).best_speeds(1, depths.between(*block.tops).stable)
    # where nothing limits the depth comes first, where a reason forbids one last
    points.sort(key=lambda point: (bool(point.why), -(point.depth * point.spindle_speed)))
    pockets.sort(key=lambda pocket: -pocket.limit_depth)
    kept = _apart(points)
    close = tuple(around[point.spindle_speed] for point in kept)
    return _Recommended(tuple(kept), tuple(_apart(pockets)), fitting.lobes.method, fitting.lobes.warnings, close)


def _apart(found: Sequence[Place], count: int = 3) -> list[Place]:
    """The first of those that stand close to each other."""
    kept: list[Place] = []
    for each in found:
        if all(abs(each.spindle_speed / other.spindle_speed - 1.0) > AROUND for other in kept):
            kept.append(each)
    return kept[:count]


def _checked(
    change: ToolChange, fitting: Fitting, own: StabilityLobes, usable: UsableDepths, speed: float, shares: _Shares
) -> OperatingPoint:
    """Return the cut that is recommended at a speed: its depth is looked at once more, closer than limits are computed.

    A narrow lobe, or an island of instability, may stand between speeds; growth at one depth is continuous over the speed.
    """
    place = int(np.argmin(np.abs(own.spindle_speed - speed)))
    limit = float(own.nominal[place])
    least = float(least_within_tolerance(own.spindle_speed, own.nominal, shares.tolerance)[place])
    robust = float(own.robust_limit(shares.tolerance, shares.probability)[place])
    for _ in range(_LOOKS):
        worst = _lost_beside(fitting, speed, shares.tolerance, (_BELOW * least, (1.0 - shares.reserve) * robust))
        if worst is None:
            break
        at, cut = worst
        found = float(FullDiscretisation().lobes(cut.modes, cut.process, np.array([at]), change.max_depth).nominal[0])
        found = min(found, _BELOW * least)
        robust, least = robust * found / least, found
    else:
        why = f"within ±{100.0 * shares.tolerance:g} % of this speed the limit changes too quickly: no depth is recommended"
        return operating_point(change.process, speed, np.inf, limit, Bound.CHATTER).without_depth(Bound.CHATTER, why)
    depth, drawn = (1.0 - shares.reserve) * robust, None if own.drawn is None else robust
    held = HeldBack(limit, least, drawn, depth, shares.tolerance, shares.probability, shares.reserve)
    searched = float(own.searched(np.array([held.depth]), shares.reserve)[0])
    table = ((Bound.CHATTER, searched), (Bound.POWER, float(usable.by_power[place])), (Bound.TORQUE, float(usable.by_torque[place])))
    bound, depth = min(table, key=lambda each: each[1])
    if depth == np.inf:
        return operating_point(change.process, speed, depth, limit, Bound.DEPTH)
    point = operating_point(change.process, speed, depth, limit, bound, held)
    known = _known_frequencies(change)
    near = (own.spindle_speed >= speed * (1.0 - shares.tolerance)) & (own.spindle_speed <= speed * (1.0 + shares.tolerance))
    chatter = float(own.chatter_frequency[near][np.argmin(own.nominal[near])])
    if known is not None and np.isfinite(chatter) and not known[0] <= chatter <= known[1]:
        band = f"{to_hz(known[0]):.0f} to {to_hz(known[1]):.0f} Hz"
        told = f"the vibration at the limit has {to_hz(chatter):.0f} Hz, outside of the known {band}"
        return point.without_depth(Bound.FREQUENCY, f"{told}: no depth is recommended")
    if not isinstance(change.tooling, BareCutter):
        longest, where = edge_length(change.tooling.assembly, change.tooling.cutter)
        if depth > longest * (1.0 + 1e-9):
            told = f"chatter and spindle allow {1e3 * depth:.4g} mm, deeper than the tool's {where} of {1e3 * longest:.4g} mm"
            return point.without_depth(Bound.EDGE, f"{told}: no depth is recommended")
    return point


def _known_frequencies(change: ToolChange) -> tuple[float, float] | None:
    """The frequencies that the machine was identified at, or the tip measured at [rad/s]; None where modes hold at all of them."""
    if change.machine.band is not None:
        return change.machine.band
    lines = change.machine.lines()
    return (float(lines[0]), float(lines[-1])) if change.machine.ends else None


def _lost_beside(fitting: Fitting, speed: float, tolerance: float, depths: Sequence[float]) -> tuple[float, MonodromyOperator] | None:
    """A speed within the tolerance at which one of some depths is not stable, and the cut there; None where there is none."""
    if not fitting.cuts:
        return None
    speeds = speed * np.linspace(1.0 - tolerance, 1.0 + tolerance, _DENSE if tolerance > 0.0 else 1)
    cuts = [min(fitting.cuts, key=lambda known: float(np.min(np.abs(known[0] - at))))[1] for at in speeds.tolist()]
    for depth in (cuts[0].process.within_reach(each) for each in depths if each > 0.0):
        grown = np.empty(speeds.size)
        start = None
        for i, (at, cut) in enumerate(zip(speeds.tolist(), cuts, strict=True)):
            growth = Growth(cut, at, longest_step(cut))
            growth.start = start
            grown[i] = growth(depth)
            start = growth.start
        if grown.max() >= 0.0:
            worst = int(np.argmax(grown))
            return float(speeds[worst]), cuts[worst]
    return None
