"""Limits from multipliers: the first loss of stability at each speed, with a step that an estimate of the error chose."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.stability.first_instability import CAREFUL, first_loss
from rcsa_ident.stability.methods import ABOVE_TOP, FITTED_MODES, LOOKS, Watch, coarse_to_fine
from rcsa_ident.stability.monodromy import RESIDUAL, MonodromyOperator, Multiplier, common_period, stable_depth_bound
from rcsa_ident.stability.result import StabilityLobes

#: Share of the strongest mode's peak below which a mode does not decide on the length of a step.
_WEAK = 0.02
#: Nodes per period of the highest mode that counts, with polynomials of high degree and as many more with those of low degree;
#: steps, where coefficients stand still.
_NODES, _LOW_DEGREE, _STEPS = 9.0, 4.0, 24.0
#: Depth over axial pitch beyond which islands may stand under a limit: at 5 % immersion and 30 degrees one stands at 0.2, at 20 % and
#: 17 degrees at 0.03.
ISLANDS = 0.03
#: Residual of the multiplier for a first look, and of the one that has to be one in size at the limit, to which share.
ROUGH, _SETTLED, _ONE = 1e-4, 1e-9, 0.02
#: A cut is lost, too, where a vibration grows by this factor within so many passes of the teeth, even if it dies away after them.
GROWS, PASSES = 1000.0, 40
#: From so many noises, of which one is enough where a vibration grows by less than this share of it.
_NOISES, _DOUBTFUL = 4, 30.0
#: Share of a limit by multipliers at which that is looked at: at the limit itself nothing dies away.
BEFORE = 0.99
#: Krylov vectors of a look at a depth, as counted on identified machines; share of the period that helix and entry add to the cut.
_VECTORS, _ENTRY = 30.0, 0.2
#: How much finer the step is by which the error is told, and how often the search is repeated with it.
_FINER, _REPEATS = 1.6, 5


def check_resolution(intervals: int | None, tolerance: float) -> None:
    """Raise `InputError` where one of them is not usable."""
    if intervals is not None and not 1 <= intervals <= 5000:
        raise InputError("intervals", intervals, "None, or a whole number from 1 to 5000")
    if not 1e-8 <= tolerance <= 0.1:
        raise InputError("tolerance", tolerance, "a share from 1e-8 to 0.1")


class Growth:
    """Logarithm of the multiplier per tooth period over the depth, at one speed and step; remembers where it started."""

    def __init__(self, cut: MonodromyOperator, speed: float, step: float, residual: float = RESIDUAL) -> None:
        self.cut, self.speed, self.step, self.residual = cut, speed, step, residual
        self.start: ComplexArray | None = None
        self.calls = 0
        self.teeth = cut.period * cut.process.cutter.teeth / (2.0 * np.pi)

    def __call__(self, depth: float) -> float:
        self.calls += 1
        found = self.cut.multiplier(self.speed, depth, self.step, self.start, residual=self.residual)
        self.start = found.vector
        return float(np.log(max(abs(found.value), 1e-300))) / self.teeth


class Passage:
    """Logarithm of the growth of a vibration within `PASSES` over `GROWS`, over the depth, at one speed and step."""

    def __init__(self, cut: MonodromyOperator, speed: float, step: float) -> None:
        self.cut, self.speed, self.step = cut, speed, step
        self.periods = int(np.ceil(PASSES * 2.0 * np.pi / (cut.period * cut.process.cutter.teeth)))

    def __call__(self, depth: float) -> float:
        grown = self._from_noise(depth, 0)
        if grown > GROWS / _DOUBTFUL:
            grown = max(grown, *(self._from_noise(depth, seed) for seed in range(1, _NOISES)))
        return float(np.log(grown / GROWS))

    def _from_noise(self, depth: float, seed: int) -> float:
        return self.cut.growth(self.speed, depth, self.step, self.periods, GROWS**2, seed)


def longest_step(cut: MonodromyOperator) -> float:
    """Length of a step that is good to some thousandths of the limit [s]."""
    strength = cut.modes.strength
    wave = 2.0 * np.pi / float(np.max(np.abs(cut.arrays.pole)[strength >= _WEAK * strength.max()]))
    degree = cut.table.shape[1] - 1
    return wave / _STEPS if cut.frozen else degree * wave / (_NODES * (1.0 + _LOW_DEGREE / degree**2))


def visits(process: MillingProcess, speeds: FloatArray, top: float, max_depth: float, degree: int, frozen: bool) -> FloatArray:
    """Return about how often a mode is moved on to the next point until the limits of a fitted tip are known, shape (n,).

    `speeds` [rad/s], shape (n,)
    `top` [rad/s]: where the tip's receptance ends
    `max_depth` [m]
    `degree`, `frozen`: as of `MonodromyOperator`
    """
    cutter, engagement = process.cutter, process.widest
    uneven = bool(np.ptp(cutter.pitch) > 1e-9 or np.ptp(cutter.runout) > 0.0)
    period = common_period(process, 2.0 * np.pi if uneven else float(cutter.pitch[0]))
    # every tooth that differs enters and leaves at points of its own
    windows = cutter.teeth if uneven else 1
    cutting = min(cutter.teeth * (engagement.exit - engagement.entry) / (2.0 * np.pi) + _ENTRY, 1.0)
    waves = period / speeds * ABOVE_TOP * top / (2.0 * np.pi)
    each = degree * _STEPS if frozen else _NODES * (1.0 + _LOW_DEGREE / degree**2)
    points = np.maximum(cutting * waves * each, 2.0 * degree * windows)
    islands = islands_from(process)
    looks = LOOKS + (np.log(max_depth / islands) / np.log(CAREFUL) if islands < max_depth else 0.0)
    passing = PASSES * 2.0 * np.pi / (cutter.teeth * period)
    return (looks * _VECTORS + passing) * points * (FITTED_MODES + windows - 1)


def islands_from(process: MillingProcess) -> float:
    """The depth beyond which islands of instability may stand under the first limit.

    Where a helix spreads an interrupted cut over the angle, period doubling ends above as well as below, at depths that are shares
    of the axial pitch.
    """
    in_cut = process.cutter.teeth * (process.widest.exit - process.widest.entry) / (2.0 * np.pi)
    if process.cutter.largest_lag < 2e-6 / process.cutter.diameter or in_cut >= 1.0:
        return np.inf
    return float(ISLANDS * 2.0 * np.pi / (process.cutter.teeth * process.cutter.largest_lag))


def marched_lobes(
    cut: MonodromyOperator,
    speeds: FloatArray,
    max_depth: float,
    intervals: int | None,
    tolerance: float,
    method: str,
    watch: Watch | None = None,
) -> StabilityLobes:
    """Return the lobes of a cut by its multipliers: the first loss of stability at each speed, and how the tool vibrates there."""
    limit = np.full(speeds.size, np.inf)
    chatter = np.full(speeds.size, np.nan)
    lobe, flip = np.full(speeds.size, -1, dtype=np.intp), np.zeros(speeds.size, dtype=bool)
    low, lost, passing = stable_depth_bound(cut.modes, cut.process), 0, 0
    for i in coarse_to_fine(speeds.size):
        speed = float(speeds[i])
        depth, step, good = _limit(cut, speed, low, max_depth, intervals, tolerance)
        sooner = _passing_limit(cut, speed, step, low, cut.process.within_reach(max_depth) if depth is None else depth, tolerance)
        passing += sooner is not None
        depth = depth if sooner is None else sooner
        if depth is not None:
            found = cut.multiplier(speed, depth, step, waves=True, residual=_SETTLED)
            limit[i], chatter[i] = depth, dominant(found)
            lobe[i] = int(chatter[i] / (speed * cut.process.cutter.teeth))
            # a quasi-periodic vibration may pass -1, too, but as one of a pair
            flip[i] = found.value.real < 0.0 and abs(found.value.imag) < 1e-6 * abs(found.value)
            good = sooner is not None or (good and abs(abs(found.value) - 1.0) < _ONE)
        lost += not good
        if watch is not None:
            watch(speed, float(limit[i]), float(chatter[i]))
    doubts = [f"at {lost} of {speeds.size} speeds the limit is not converged to {100.0 * tolerance:g} %"] if lost else []
    if passing:
        doubts.append(
            f"at {passing} of {speeds.size} speeds the limit is the depth at which a vibration grows a thousandfold within {PASSES} teeth, "
            "although it would die away after them: somewhat deeper cuts are stable in theory only"
        )
    return StabilityLobes(speeds, limit, chatter, lobe, max_depth, method, warnings=tuple(doubts), flip=flip)


def _passing_limit(cut: MonodromyOperator, speed: float, step: float, low: float, deepest: float, tolerance: float) -> float | None:
    """The depth at which a vibration grows too much before it dies away; None if there is none up to a limit by multipliers."""
    passage = Passage(cut, speed, step)
    return None if passage(BEFORE * deepest) < 0.0 else first_loss(passage, low, deepest, tolerance)


def dominant(found: Multiplier) -> float:
    """The frequency at which the tip vibrates most [rad/s]."""
    return float(found.omega[np.argmax(found.motion)])


def _limit(
    cut: MonodromyOperator, speed: float, low: float, max_depth: float, intervals: int | None, tolerance: float
) -> tuple[float | None, float, bool]:
    """The limit, the step that it was found with, and whether a finer one agrees."""
    tooth = 2.0 * np.pi / (cut.process.cutter.teeth * speed)
    if intervals is not None:
        step = tooth / intervals
        return first_loss(Growth(cut, speed, step), low, max_depth, 1e-3 * tolerance, careful_from=islands_from(cut.process)), step, True
    # a search that is a little too deep and a little rough, then the limit from where it ended
    step = longest_step(cut)
    deepest = cut.process.within_reach(1.1 * max_depth)
    depth = first_loss(Growth(cut, speed, step, ROUGH), low, deepest, 10.0 * tolerance, careful_from=islands_from(cut.process))
    if depth is None:
        return None, step, True
    for _ in range(_REPEATS):
        growth = Growth(cut, speed, step)
        found = _polished(growth, depth, tolerance)
        if found is None:
            # not there with the finer step: looked for again
            depth = first_loss(growth, low, deepest, tolerance, careful_from=islands_from(cut.process))
            if depth is None:
                return None, step, True
            found = depth, (growth(1.01 * depth) - growth(0.99 * depth)) / (0.02 * depth)
        depth, slope = found
        step /= _FINER
        finer = Growth(cut, speed, step)
        finer.start = growth.start
        # what a step that is shorter by the same share again and again would add, too
        change = finer(depth) / slope / (1.0 - _FINER**-cut.order)
        if abs(change) < 0.5 * tolerance * depth:
            depth -= change
            return (depth if depth <= max_depth else None), step, True
    return (depth if depth <= max_depth else None), step, False


def _polished(growth: Growth, depth: float, tolerance: float) -> tuple[float, float] | None:
    """The root next to a depth by the secant method, with the slope there; None if it leaves the neighbourhood."""
    a, b = depth, depth * (1.0 + 0.01)
    at_a, at_b = growth(a), growth(b)
    for _ in range(12):
        slope = (at_b - at_a) / (b - a)
        if not slope > 0.0:
            return None
        c = b - at_b / slope
        if not 0.7 * depth < c < 1.4 * depth:
            return None
        if abs(c - b) < 0.2 * tolerance * depth:
            return c, slope
        a, at_a, b, at_b = b, at_b, c, growth(c)
    return None
