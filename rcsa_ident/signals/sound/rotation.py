"""How the spindle turns within a record: its speed window by window, and its angle sample by sample."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.units import to_hz
from rcsa_ident.signals._kernels import angle_sums, best_path, comb_scores, told_angles, turned, walked
from rcsa_ident.signals.sound.line_prominence import PADDED, WINDOW, LineGains
from rcsa_ident.signals.steady_part import hann

#: Orders that are looked at.
ORDERS = 40
#: Largest change of speed from one window to the next, as so many standard deviations.
_LARGEST_CHANGE = 7.5
#: Revolutions of the blocks in which the angle is followed, and their least length [s].
_BLOCK_TURNS, _SHORTEST_BLOCK = 4.0, 0.012
#: Blocks below which no more is told than was known.
_FEWEST_BLOCKS = 4
#: Times over which the lines' amplitudes are taken as one [s], one after the other: neighbours are brought into line before what lies
#: farther apart, and at last all of the record, since what turns all orders in proportion is the spindle.
_AMPLITUDE_TIMES = (0.25, 1.0, 4.0, np.inf)
#: Evidence from which on a speed changes.
_EVIDENT = 5.0
#: Spectral densities of the angular acceleration that are tried [rad^2/s^3].
_DENSITIES = 10.0 ** np.arange(-4.0, 5.0)


@dataclass(frozen=True, slots=True, eq=False)
class Rotation:
    """The spindle's angle over a record.

    `rate` [Hz]
    `angle` [rad], shape (n,): at each sample, from the first one
    `time` [s], shape (b,): middles of the blocks that told it
    `information` [1/rad^2], shape (b,): what each told of it
    `evidence`: by how much the record is likelier (logarithm) under a speed that changes than under one that does not
    """

    rate: float
    angle: FloatArray
    time: FloatArray
    information: FloatArray
    evidence: float = 0.0

    @property
    def spindle_speed(self) -> float:
        """Mean speed [rad/s], where the blocks told it."""
        speeds, weight = self.speeds()
        return float(np.average(speeds, weights=weight))

    @property
    def uneven(self) -> bool:
        """True where the record says that the speed changes."""
        return self.evidence > _EVIDENT

    def about(self, speed: float) -> tuple[float, FloatArray]:
        """Return the speed of the line that fits the angle best [rad/s], and what the angle deviates from it, shape (n,) [rad].

        `speed` [rad/s]: about the speed
        """
        at = np.arange(self.angle.size) - 0.5 * (self.angle.size - 1)
        off = self.angle - speed / self.rate * (at - at[0])
        slope = float(at @ off / (at @ at))
        return speed + slope * self.rate, off - slope * at - off.mean()

    @property
    def speed_std(self) -> float:
        """Standard deviation of the mean speed [rad/s]."""
        middle = np.average(self.time, weights=self.information)
        return float(1.0 / np.sqrt(np.sum(self.information * (self.time - middle) ** 2)))

    def speeds(self, window: float = 0.25) -> tuple[FloatArray, FloatArray]:
        """Return the mean speed in windows of about this length [s] that follow each other [rad/s], and their weights, a sum of 1."""
        count = max(int((self.angle.size - 1) / (window * self.rate)), 1)
        ends = np.linspace(0, self.angle.size - 1, count + 1).astype(int)
        weight = np.histogram(self.time * self.rate, ends, weights=self.information)[0]
        return np.diff(self.angle[ends]) / np.diff(ends) * self.rate, weight / weight.sum()


@dataclass(frozen=True, slots=True)
class Pace:
    """How a speed is followed window by window.

    `window` [s]: length of the windows, which hold a few revolutions at least
    `change` [-]: standard deviation of the change of speed from one to the next, as a share
    `step` [-]: between trial speeds, as a share
    """

    window: float = WINDOW
    change: float = 2e-3
    step: float = 2e-4

    @property
    def slowest(self) -> float:
        """Frequency of a spindle that turns often enough in a window [Hz]."""
        return _BLOCK_TURNS / self.window

    def length(self, rate: float, lowest: float, samples: int) -> int:
        """Return the samples of a window, where the spindle turns at `lowest` [Hz] at least; at most what there are."""
        return min(round(max(self.window, _BLOCK_TURNS / lowest) * rate), samples)


#: Of a speed that wanders, and of one that changes on purpose.
WANDER, RAMP = Pace(), Pace(0.25, 8e-3, 1e-3)


def speed_path(heard: LineGains, lowest: float, highest: float, pace: Pace = WANDER) -> tuple[FloatArray, FloatArray]:
    """Return the likeliest path of the spindle's frequency through windows that overlap by half.

    In each window a trial frequency is worth what lines at its multiples are worth; from one window to the next it changes little.

    `heard`: of the record
    `lowest`, `highest` [Hz]: where it is looked for
    Returns `middles`, array, shape (w,): samples from the first one to the windows' middles.
    Returns `frequency`, array, shape (w,) [Hz].
    """
    length = pace.length(heard.rate, lowest, heard.samples.shape[0])
    trial = np.exp(np.arange(np.log(lowest), np.log(highest) + pace.step, pace.step))
    scores = comb_scores(heard.of(length)[0], trial * PADDED * length / heard.rate, ORDERS, False)
    path, _ = best_path(scores, max(round(_LARGEST_CHANGE * pace.change / pace.step), 1), 0.5 * (pace.step / pace.change) ** 2)
    return heard.middles(length), trial[path]


def follow(samples: FloatArray, rate: float, middles: FloatArray, frequency: FloatArray, teeth: int = 0) -> Rotation:
    """Return the spindle's angle at each sample: the phase that the strong orders have in common.

    In each block of a few revolutions the lines' phases tell the angle; how fast it may change is what makes them most likely.
    Orders above half the rate do not take part.

    `samples`, shape (n, c); `rate` [Hz]
    `middles`, shape (w,): samples from the first one to the middles of the windows in which the speed is known
    `frequency` [Hz], shape (w,): the spindle's in each, to within a few hundredths of a turn over the window
    `teeth`: where the speed changes on purpose: of the cutter whose orders do not take part, since then they carry the structure's phase; 1
        where all do. 0 where the speed only wanders.
    """
    angle, mean, highest = _expected(samples.shape[0], rate, middles, frequency)
    centred = np.ascontiguousarray(samples - samples.mean(axis=0))
    # where the speed runs away from what windows tell, low orders say where the high ones' turns begin
    for orders in (2, 8) if teeth else ():
        angle = _told(centred, rate, angle, mean, min(orders, highest), teeth).rotation(rate, angle).angle
    return _told(centred, rate, angle, mean, highest, teeth).rotation(rate, angle)


def follow_on(samples: FloatArray, rotation: Rotation, highest: int) -> Rotation:
    """Return a rotation that is told by orders above half the sampling rate as well, where they stand folded back.

    Their phases turn faster than those of the orders below, and show errors of the angle that these do not.

    `samples`, shape (n, c)
    `rotation`: as the orders below half the rate tell it
    `highest`: highest order
    """
    centred = np.ascontiguousarray(samples - samples.mean(axis=0))
    told = _told(centred, rotation.rate, rotation.angle, to_hz(rotation.spindle_speed), highest, 0)
    return replace(told.rotation(rotation.rate, rotation.angle), evidence=rotation.evidence)


def follow_changes(samples: FloatArray, rate: float, frequency: float) -> Rotation | None:
    """Return the spindle's angle at each sample, as `follow` tells it about one speed; None where the record does not say that it changes.

    `samples`, shape (n, c); `rate` [Hz]
    `frequency` [Hz]: the spindle's, to within a few hundredths of a turn over the record
    """
    angle, mean, highest = _expected(samples.shape[0], rate, np.zeros(1), np.array([frequency]))
    told = _told(np.ascontiguousarray(samples - samples.mean(axis=0)), rate, angle, mean, highest, 0)
    return told.rotation(rate, angle) if told.evidence > _EVIDENT else None


def _expected(n: int, rate: float, middles: FloatArray, frequency: FloatArray) -> tuple[FloatArray, float, int]:
    """The spindle's angle at n samples by the speed in windows [rad], its mean frequency [Hz], and the highest order that is looked at."""
    at, mean = np.arange(n), float(frequency.mean())
    speed = np.full(n, mean)
    if middles.size > 1:
        speed = PchipInterpolator(middles, frequency)(np.clip(at, middles[0], middles[-1]))
    angle = 2.0 * np.pi / rate * np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    return angle, mean, max(min(int(0.45 * rate / float(frequency.max())), ORDERS), 1)


class _Told(NamedTuple):
    """What the orders tell of the angle in blocks: their middles [s], phase beyond the expected angle [rad], its information [1/rad^2],
    and the evidence that the speed changes; no more than was known where blocks are few."""

    time: FloatArray
    phase: FloatArray
    information: FloatArray
    evidence: float

    def rotation(self, rate: float, angle: FloatArray) -> Rotation:
        """The rotation, given the expected angle."""
        if self.time.size < _FEWEST_BLOCKS:
            return Rotation(rate, angle, np.array([0.0, (angle.size - 1) / rate]), np.ones(2))
        at = np.arange(angle.size) / rate
        spline = CubicSpline(self.time, self.phase, bc_type="natural")
        inside = np.clip(at, self.time[0], self.time[-1])
        # beyond the blocks' middles the speed goes on as it is there
        angle = angle + spline(inside) + spline(inside, 1) * (at - inside)
        return Rotation(rate, angle - angle[0], self.time, self.information, self.evidence)


def _told(samples: FloatArray, rate: float, angle: FloatArray, mean: float, highest: int, teeth: int) -> _Told:
    """What a spindle's orders tell beyond an angle that is about right; its mean frequency [Hz] sets the blocks."""
    n = samples.shape[0]
    length = min(round(max(_BLOCK_TURNS / mean, _SHORTEST_BLOCK) * rate), n)
    hop = max(length // 2, 1)
    starts = np.arange(0, n - length + 1, hop)
    window = hann(length)
    lines = angle_sums(samples, turned(angle), starts, 2.0 / window.sum() * window, highest)[:, 1:]
    order = np.arange(1, highest + 1)
    own = order % teeth != 0 if teeth > 1 else order > 0
    phase, information, evidence = _common_phase(lines[:, own], order[own], hop / rate)
    return _Told((starts + 0.5 * (length - 1)) / rate, phase, information, evidence if starts.size >= _FEWEST_BLOCKS else 0.0)


def _common_phase(lines: ComplexArray, order: np.ndarray, step: float) -> tuple[FloatArray, FloatArray, float]:
    """Angle [rad] that the lines of each block, shape (b, m, c) of orders (m,), have in common beyond the expected one, its information
    [1/rad^2], and the evidence that it is no straight line."""
    blocks, _, channels = lines.shape
    rows, own = np.ascontiguousarray(lines.reshape(blocks, -1).T), np.repeat(order, channels)
    phase = np.zeros(blocks)
    for reach in _AMPLITUDE_TIMES:
        density = None
        for _ in range(8):
            told, information = told_angles(rows, own, phase, reach / step)
            new, density, _ = _smoothed(phase + np.clip(told / information, -0.3, 0.3), information, step, density)
            moved, phase = float(np.max(np.abs(new - phase))), new
            if moved < 1e-3:
                break
    told, information = told_angles(rows, own, phase, np.inf)
    evidence = _smoothed(phase + told / information, information, step, None)[2]
    # what each block itself tells, not the record's mean in it
    return phase, told_angles(rows, own, phase, _AMPLITUDE_TIMES[0] / step)[1], evidence


def _smoothed(phase: FloatArray, information: FloatArray, step: float, density: float | None) -> tuple[FloatArray, float, float]:
    """Phases whose speed walks at random, the density of its steps (as told, or under which they are likeliest), and by how much they are
    likelier under it than under the least."""
    best, likeliest, least, chosen = phase, -np.inf, -np.inf, 0.0
    for each in _DENSITIES if density is None else (density,):
        smooth, likelihood = walked(phase, information, 1.0 / (each * step**3))
        least = max(least, likelihood) if each == _DENSITIES[0] else least
        if likelihood > likeliest:
            best, likeliest, chosen = smooth, likelihood, float(each)
    return best, chosen, likeliest - least
