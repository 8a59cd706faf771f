"""What a machinist asks of stability lobes: which speed for a depth, how to remove most, how far a planned cut is from chatter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.shown import Drawn, Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.power import SpindleDrive, spindle_load
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.stability.band_shares import BandShares
from rcsa_ident.stability.labels.tested_cuts import Tally
from rcsa_ident.stability.methods import MethodName
from rcsa_ident.stability.operating_point import Bound, OperatingPoint, operating_point
from rcsa_ident.stability.pockets import peaks
from rcsa_ident.stability.result import PROBABILITY, RESERVE, TOLERANCE, Pocket, StabilityLobes

#: Depths at which it is asked what a cutter with a shape takes.
_DEPTHS = 49


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class UsableDepths(Shown):
    """How deep one may cut at each speed, and what stands against more.

    `spindle_speed` [rad/s], shape (n,): rising
    `limit` [m], shape (n,): the stability limit, up to the largest depth
    `stable` [m], shape (n,): the recommended depth by stability alone: the limit less what is held back of it; infinite beyond `deepest`,
        NaN where the limits are no source of one
    `by_power`, `by_torque` [m], shape (n,): by what the spindle has; infinite beyond `deepest`
    `depth` [m], shape (n,): the smallest of them; 0 beyond the spindle's highest speed, infinite where nothing limits the cut up to
        `deepest`, NaN where none is recommended
    `bound`: tuple of Bound, length n
    `removal_rate` [m^3/s], shape (n,): at that depth; None without a feed
    `deepest` [m]: the largest depth less the reserve: limits were looked for no further, so no depth beyond it can be recommended
    """

    spindle_speed: FloatArray
    limit: FloatArray
    stable: FloatArray
    by_power: FloatArray
    by_torque: FloatArray
    depth: FloatArray
    bound: tuple[Bound, ...]
    removal_rate: FloatArray | None
    deepest: float

    def __post_init__(self) -> None:
        for name in self._arrays:
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def _arrays(self) -> tuple[str, ...]:
        names = ("spindle_speed", "limit", "stable", "by_power", "by_torque", "depth")
        return names if self.removal_rate is None else (*names, "removal_rate")

    @property
    def removal(self) -> FloatArray:
        """The removal rate, shape (n,) [m^3/s]. Raises `InputError`: without a feed per tooth it is not known."""
        if self.removal_rate is None:
            raise InputError("feed_per_tooth", "nothing", "the feed per tooth [m]: the removal rate grows with it")
        return self.removal_rate

    def between(self, low: float, high: float) -> UsableDepths:
        """Return what is known of a range of speeds [rad/s]."""
        inside = (self.spindle_speed >= low * (1.0 - 1e-9)) & (self.spindle_speed <= high * (1.0 + 1e-9))
        arrays = {"removal_rate": None} | {name: getattr(self, name)[inside] for name in self._arrays}
        bound = tuple(b for b, there in zip(self.bound, inside, strict=True) if there)
        return UsableDepths(**arrays, bound=bound, deepest=self.deepest)

    def __str__(self) -> str:
        if self.spindle_speed.size == 0:
            return "no speeds"
        speed, depth = to_rpm(self.spindle_speed), 1e3 * self.depth
        if np.isnan(depth).any():
            return f"{speed[0]:.0f} to {speed[-1]:.0f} rev/min: no depth is recommended"
        low, high = ("none" if np.isinf(d) else f"{d:.2f} mm" for d in (depth.min(), depth.max()))
        return f"{speed[0]:.0f} to {speed[-1]:.0f} rev/min: recommended depth " + (low if low == high else f"{low} to {high}")


def usable_depths(
    lobes: StabilityLobes,
    process: MillingProcess,
    drive: SpindleDrive,
    tolerance: float = TOLERANCE,
    probability: float = PROBABILITY,
    reserve: float = RESERVE,
) -> UsableDepths:
    """Return how deep one may cut at each speed.

    `lobes`: speeds rise
    `process`: power, torque and removal rate grow with its feed per tooth; a drive whose power and torque have no limit does without
    `tolerance`, `probability`, `reserve`: what is held back: see `StabilityLobes.recommended_depth`
    """
    speed = lobes.spindle_speed
    stable = lobes.recommended_depth(tolerance, probability, reserve)
    torque, power = drive.torque_at(speed), drive.power_at(speed)
    taken = None
    if process.feed_per_tooth is not None:
        taken = _taken(process, lobes.max_depth)
        torque, power = (np.interp(most, taken.torque, taken.depth, right=np.inf) for most in (torque, power / speed))
    elif np.any(np.isfinite(drive.torque) | np.isfinite(drive.power)):
        raise InputError("feed_per_tooth", "nothing", "the feed per tooth [m]: power and torque grow with it")
    by_torque, by_power = lobes.searched(torque, reserve), lobes.searched(power, reserve)
    table = np.stack([stable, by_power, by_torque])
    depth = table.min(axis=0)
    which = table.argmin(axis=0)
    names = (Bound.CHATTER, Bound.POWER, Bound.TORQUE)
    bound = [
        Bound.SPEED if d == 0.0 else Bound.DEPTH if d == np.inf else names[k] for d, k in zip(depth.tolist(), which.tolist(), strict=True)
    ]
    removal_rate = None
    if taken is not None:
        removal_rate = np.interp(depth, taken.depth, taken.volume, right=np.inf) * speed
    deepest = (1.0 - reserve) * lobes.max_depth
    return UsableDepths(speed, lobes.nominal, stable, by_power, by_torque, depth, tuple(bound), removal_rate, deepest)


class _Taken(NamedTuple):
    """What a cut takes from the spindle over its depth.

    `depth` [m], shape (n,): rising from 0; straight lines in between
    `torque` [N m], shape (n,); `volume` [m^3/rad], shape (n,)
    """

    depth: FloatArray
    torque: FloatArray
    volume: FloatArray


def _taken(process: MillingProcess, deepest: float) -> _Taken:
    """What a cut takes: along a wall in proportion to its depth, of a shape as it is at depths up to the deepest one."""
    reach = process.within_reach(deepest)
    depth = np.array([0.0, 1e3 * deepest]) if process.is_plain else reach * np.linspace(0.0, 1.0, _DEPTHS) ** 2
    loads = [spindle_load(process.cutter, process.conditions(1.0, float(a)), process.coefficients) for a in depth[1:]]
    torque, volume = (np.array([0.0, *(getattr(load, name) for load in loads)]) for name in ("torque", "removal_rate"))
    return _Taken(depth, torque, volume)


def highest_removal(usable: UsableDepths, process: MillingProcess, count: int = 3) -> list[OperatingPoint]:
    """Return the cuts that remove most, one for each pocket, the best first; before them, speeds where nothing limits the depth."""
    found: list[OperatingPoint] = []
    if np.isnan(usable.depth).any():
        return found
    # whatever the feed is, the removal rate grows with speed and depth
    level = usable.depth * usable.spindle_speed if usable.removal_rate is None else usable.removal_rate
    for speed, _ in peaks(usable.spindle_speed, level, count):
        place = int(np.argmin(np.abs(usable.spindle_speed - speed)))
        at, depth, limit = (float(values[place]) for values in (usable.spindle_speed, usable.depth, usable.limit))
        if depth > 0.0:
            found.append(operating_point(process, at, depth, limit, usable.bound[place]))
    return found


@dataclass(frozen=True, slots=True, repr=False)
class SpeedWindow(Shown):
    """Speeds at which a depth is allowed.

    Parameters
    ----------
    low, high : float [rad/s]
    best : float [rad/s]
        Where most is allowed; the middle where that is so at several.
    allowed : float [m]
        What is allowed there; infinite where nothing limits the cut up to the depth that was searched.
    """

    low: float
    high: float
    best: float
    allowed: float

    @property
    def width(self) -> float:
        """Width over the middle."""
        return (self.high - self.low) / (0.5 * (self.high + self.low))

    def __str__(self) -> str:
        most = "with no limit in the depths asked for" if self.allowed == np.inf else f"up to {1e3 * self.allowed:.2f} mm"
        best = f"{most} at {to_rpm(self.best):.0f} rev/min"
        return f"{to_rpm(self.low):.0f} to {to_rpm(self.high):.0f} rev/min, {best}"


def speed_windows(usable: UsableDepths, depth: float) -> list[SpeedWindow]:
    """Return the ranges of speed in which a depth is allowed, the one with the most reserve first; ends by straight lines.

    Raises `InputError`: of a depth beyond `usable.deepest` nothing is known.
    """
    depth = positive("depth", depth, "m")
    if depth > usable.deepest * (1.0 + 1e-12):
        raise InputError("depth", depth, f"at most {usable.deepest:g} m: limits were looked for no further")
    # so deep is allowed at least; with an infinity there is no straight line
    speed, allowed = usable.spindle_speed, np.minimum(usable.depth, usable.deepest)
    good = allowed >= depth
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    found = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        low = _crossing(speed, allowed, first - 1, depth) if first > 0 else float(speed[0])
        high = _crossing(speed, allowed, end - 1, depth) if end < speed.size else float(speed[-1])
        top = float(usable.depth[first:end].max())
        best = first + np.flatnonzero(usable.depth[first:end] >= top * (1.0 - 1e-12))
        found.append(SpeedWindow(low, high, 0.5 * float(speed[best[0]] + speed[best[-1]]), top))
    return sorted(found, key=lambda w: (-w.allowed, -w.width))


def _crossing(speed: FloatArray, level: FloatArray, place: int, value: float) -> float:
    """Where the line from `place` to the next meets a value."""
    a, b = float(level[place]), float(level[place + 1])
    return float(speed[place] + (value - a) / (b - a) * (speed[place + 1] - speed[place]))


@dataclass(frozen=True, slots=True, repr=False)
class PlannedCut(Shown):
    """How a cut stands that somebody wants to make.

    Parameters
    ----------
    spindle_speed : float [rad/s]
    depth : float [m]
    limit : float [m]
        Infinite where it is stable up to the depth that was asked for.
    robust_limit : float [m]
        The lowest within the tolerance of the speed and with the probability that were asked for; infinite as `limit` is.
    chatter_frequency : float or None [rad/s]
        Of the vibration at the limit; None where it is stable up to the depth that was asked for.
    slower, faster : float or None [rad/s]
        The nearest speeds at which the same depth is on the other side of the limit; None if the range holds none.
    probability : float or None
        That it is stable, where machines were drawn.
    load : float
        Share of the power or of the torque that it takes, the larger of both; 0 without known limits.
    power : float [W]
    torque : float [N m]
    removal_rate : float [m^3/s]
    method : str
        By which it was judged; zero-order limits are a preview.
    """

    spindle_speed: float
    depth: float
    limit: float
    robust_limit: float
    chatter_frequency: float | None
    slower: float | None
    faster: float | None
    probability: float | None
    load: float
    power: float
    torque: float
    removal_rate: float
    method: str

    @property
    def stable(self) -> bool:
        """Whether the machine as it was identified allows it."""
        return self.depth <= self.limit

    @property
    def margin(self) -> float:
        """Share of the cut's depth by which the limit lies above it; negative above the limit."""
        return self.limit / self.depth - 1.0

    def __str__(self) -> str:
        limit = "no stability limit in the depths asked for" if self.limit == np.inf else f"stability limit {1e3 * self.limit:.2f} mm"
        sure = "" if self.probability is None else f", stable with {100.0 * self.probability:.0f} % probability"
        state = "stable" if self.stable else "chatter"
        return f"{to_rpm(self.spindle_speed):.0f} rev/min, {1e3 * self.depth:.2f} mm: {state} by {self.method}, {limit}{sure}"


def planned_cut(
    lobes: StabilityLobes,
    process: MillingProcess,
    drive: SpindleDrive,
    speed: float,
    depth: float,
    tolerance: float = TOLERANCE,
    probability: float = PROBABILITY,
    judged: StabilityLobes | None = None,
) -> PlannedCut:
    """Return how a cut stands; its speed is one of those of the lobes (`pad_speeds` puts it among them).

    `judged`, limits around that speed by a method that fits the cut, tell all but where chatter begins beside it.
    """
    depth = positive("depth", depth, "m")
    speeds = lobes.spindle_speed
    place = int(np.argmin(np.abs(speeds - positive("speed", speed, "rad/s"))))
    if abs(speeds[place] - speed) > 1e-6 * speed or depth > lobes.max_depth:
        raise InputError("planned cut", f"{speed:g} rad/s and {depth:g} m", f"a speed of the lobes and at most {lobes.max_depth:g} m")
    nominal = lobes.nominal
    other = (nominal >= depth) != (nominal[place] >= depth)
    below, above = np.flatnonzero(other[:place]), np.flatnonzero(other[place + 1 :])
    slower = _crossing(speeds, nominal, int(below[-1]), depth) if below.size else None
    faster = _crossing(speeds, nominal, place + int(above[0]), depth) if above.size else None
    if judged is not None:
        lobes, place = judged, int(np.argmin(np.abs(judged.spindle_speed - speed)))
    load = spindle_load(process.cutter, process.conditions(speed, depth), process.coefficients)
    at = np.array([speed])
    power, torque = drive.power_at(at)[0], drive.torque_at(at)[0]
    with np.errstate(divide="ignore"):
        share = float(np.max(np.array([load.power, load.torque]) / np.array([power, torque])))
    lowest = lobes.recommended_depth(tolerance, probability, reserve=0.0)[place]
    return PlannedCut(
        speed,
        depth,
        float(lobes.limit_depth[place]),
        float(lowest),
        None if lobes.stable[place] else float(lobes.chatter_frequency[place]),
        slower,
        faster,
        lobes.probability(place, depth),
        share,
        load.power,
        load.torque,
        load.removal_rate,
        lobes.method,
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Advice(Drawn):
    """Which cuts a tooling can make, and which of them is recommended.

    Parameters
    ----------
    tooling : str
        Its name.
    stickout : float or None [m]
    lobes : StabilityLobes
        At the speeds that were asked for.
    usable : UsableDepths
        What is recommended at each of them, within power and torque.
    recommended : tuple of OperatingPoint
        The cuts that remove most, one for each pocket, the best first; none where they were not asked for.
    windows : tuple of SpeedWindow
        Speeds at which a depth is recommended, where one was asked for.
    planned : tuple of PlannedCut
    tested : Tally or None
        How many of the cuts that were tried the limits tell right.
    remarks : tuple of str
        What the user should know.
    pockets : tuple of Pocket
        The speeds with the highest limits, the highest first.
    recommended_by : str or None
        The method that computed recommended cuts and pockets; None where nothing was to be recommended.
    band : BandShares or None
        What the band of the first recommended cut's limit consists of, where machines were drawn.
    around : tuple of StabilityLobes
        Limits around the recommended cuts, by the method that computed them, with bands of their own: there they take the place of a
        preview.
    state : str
        For which state of the machine it holds, as ``warm machine``; empty where that has one alone.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
    >>> cut = ri.CutSpec(feed_per_tooth=0.1e-3)
    >>> advice = ri.advise(machine, tool, cut, ri.rpm(8000, 16_000, 100), depth=1e-3, planned=[(ri.rpm(10_000), 1e-3)])
    >>> print(advice.recommended[0])  # doctest: +ELLIPSIS
    14456 rev/min: stability limit 1.9... mm, recommended ... mm, 5... cm³/min, 0.8... kW
    >>> print(advice.windows[0])  # doctest: +ELLIPSIS
    13... to 16000 rev/min, up to 1.6... mm at 14600 rev/min
    >>> print(advice.planned[0])
    10000 rev/min, 1.00 mm: stable by full-discretisation, stability limit 1.31 mm, stable with 100 % probability
    """

    tooling: str
    stickout: float | None
    lobes: StabilityLobes
    usable: UsableDepths
    recommended: tuple[OperatingPoint, ...]
    windows: tuple[SpeedWindow, ...]
    planned: tuple[PlannedCut, ...]
    tested: Tally | None
    remarks: tuple[str, ...]
    pockets: tuple[Pocket, ...] = ()
    recommended_by: str | None = None
    band: BandShares | None = None
    around: tuple[StabilityLobes, ...] = ()
    state: str = ""

    @property
    def preview(self) -> bool:
        """Whether the lobes are zero-order ones beside cuts of another method: they say where to look, not how deep one may cut."""
        return self.lobes.method == MethodName.ZERO_ORDER != self.recommended_by

    @property
    def drawn_around(self) -> tuple[StabilityLobes, ...] | None:
        """Limits that a figure draws over a preview; None where the lobes are none."""
        return self.around if self.preview else None

    @property
    def common(self) -> FloatArray | None:
        """What is stable on all machines that were drawn, shape (n,) [m], infinite beyond the largest depth; None where none were."""
        return None if self.lobes.drawn is None else self.lobes.searched(self.lobes.limit_quantile(1.0))

    def __str__(self) -> str:
        none = self.lobes.withheld or "no cut is recommended"
        return f"{self.tooling}: {self.recommended[0] if self.recommended else none}"
