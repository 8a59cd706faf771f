"""The spindle's speed, found in a record that does not tell it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_hz
from rcsa_ident.signals._kernels import comb_scores, sideband_scores
from rcsa_ident.signals.sound.line_prominence import PADDED, WINDOW, LineGains
from rcsa_ident.signals.sound.order_lines import OrderLines, order_lines
from rcsa_ident.signals.sound.rotation import ORDERS, RAMP, Rotation, follow, speed_path
from rcsa_ident.signals.sound.speed_odds import log_odds, multiples

#: Length of the windows in which the speed is looked for [s]: fine enough for lines that lie close.
_LONG = 4.0
#: Share of the sampling rate above which a spindle's frequency is not told.
HIGHEST_SHARE = 0.4
#: Trial speeds stand this far apart, as a share, and candidates at least this far.
_STEP, APART = 1e-4, 0.015
#: Strong lines beside which others are looked for at the spacing of the spindle or of its teeth, and how many to each side: chatter has
#: them. Those at the spacing of two and more teeth are worth less, since they also stand at that of a slower spindle with more teeth.
_CENTRES, _SIDES = 3, 16
_WORTH = np.array([1.0] + [0.8] * 7)
#: Share of the best score that a candidate has to have, and most candidates.
_AS_GOOD, _MOST = 0.75, 6
#: Score above which lines at the multiples of one speed are no chance.
_A_SPEED = 7.0
#: Share of the lines' power that orders off a multiple may have, if the spindle turns at that multiple.
_ELSEWHERE = 5e-4
#: Explained share from which on weak lines between others are no chance.
_CLEAN = 0.5
#: Half width of a line in long windows [Hz], that of what it is compared with, how many times as strong it is, and the share that lines
#: between the multiples may have.
_OWN, _AROUND, _CLEAR, _BETWEEN = 0.5, 6.0, 20.0, 5e-3
#: A candidate belongs to the lines if it explains this share of what the best one explains.
_EXPLAINS = 0.8
#: Explained share above which short windows tell a path, and how much more it has to explain than a constant speed.
_TELLS, _CLEARLY = 0.1, 1.02
#: Explained share from which on a path that leads far is a ramp, and how much more it has to explain than any one speed.
_RAMP_EXPLAINS, _RAMP_CLEARLY = 0.3, 1.2
#: Revolutions in a window of the fit.
TURNS = 8.0
#: Probability below which a speed is not named.
_UNLIKELY = 1e-3
#: Samples in which candidates are compared, from the middle of a longer record.
_COMPARED = 1 << 17


@dataclass(frozen=True, slots=True, eq=False)
class FoundSpeed:
    """A speed and how it was found.

    `odds`: tuple of (float [Hz], float); frequencies that may be the spindle's and their probabilities, the likeliest first; those of the
        least probability left out
    """

    rotation: Rotation
    odds: tuple[tuple[float, float], ...] = ()


class _Fit(NamedTuple):
    """How a spindle turns that turns at about a frequency [Hz], its lines, and whether short windows followed it."""

    frequency: float
    rotation: Rotation
    lines: OrderLines
    followed: bool

    @property
    def explained(self) -> float:
        """Share of the variance that lines explain which keep their phase."""
        return float(self.lines.power.sum()) / (self.lines.energy + 1e-300)


def window_length(rate: float, frequency: float, samples: int) -> int:
    """Return the samples of a window of the fit: half a second, or a few revolutions of a slow spindle; at most what there are."""
    return min(round(max(WINDOW, TURNS / frequency) * rate), samples)


def find_rotation(samples: FloatArray, rate: float, lowest: float, highest: float, teeth: int | None = None) -> FoundSpeed | None:
    """Return how the spindle turns, found between two frequencies; None where nothing is heard of it.

    Long windows tell the candidates: frequencies at whose multiples, and at whose spacing beside the strongest lines, there are
    lines. Those that explain as much as the best one belong together; of these the highest of which all lines are multiples is the
    spindle's, or differs from it by a whole factor: which one, `log_odds` says.

    `samples`, shape (n, c): of a cut, or of a spindle that idles
    `rate` [Hz]; `lowest`, `highest` [Hz]
    `teeth`: as told
    """
    spare = max(samples.shape[0] - _COMPARED, 0) // 2
    middle = LineGains(samples[spare : samples.shape[0] - spare], rate)
    whole = LineGains(samples, rate) if spare else middle
    fits = [_fitted(middle, each) for each in _candidates(middle, lowest, highest)]
    ramp = _ramp(middle, lowest, highest)
    most = max((fit.explained for fit in fits), default=0.0)
    if ramp is not None and ramp.explained > max(_RAMP_EXPLAINS, _RAMP_CLEARLY * most):
        ramp = _ramp(whole, lowest, highest) if spare else ramp
        if ramp is not None:
            factor, odds = _whole_factor(whole, [ramp.rotation], lowest, highest, teeth)
            turned = replace(
                ramp.rotation, angle=float(factor) * ramp.rotation.angle, information=ramp.rotation.information / float(factor) ** 2
            )
            return FoundSpeed(turned, odds)
    if not fits:
        return None
    members = [fit for fit in fits if fit.explained >= _EXPLAINS * most] if most > _TELLS else fits[:1]
    best = min(members, key=lambda fit: fit.frequency)
    slowest = best.frequency
    times = _largest_multiple(best.lines.power, slowest, highest)
    while times > 1 and _between(middle, slowest, times) > _BETWEEN:
        times = next((part for part in range(times - 1, 1, -1) if times % part == 0), 1)
    frequency = times * slowest
    parts = _parts(middle, frequency, lowest) if most > _CLEAN else 1
    if parts > 1 and _shares(_fitted(middle, frequency / parts).lines.power, parts) > _BETWEEN:
        frequency /= parts
    known = {fit.frequency: fit for fit in fits}
    chosen = known[frequency] if frequency in known else _fitted(middle, frequency)
    # a member that the spindle's multiples do not hold explains as much by other lines
    others = [
        fit.rotation
        for fit in members
        if fit.frequency > frequency and abs(fit.frequency / frequency - round(fit.frequency / frequency)) > APART
    ]
    factor, odds = _whole_factor(middle, [chosen.rotation, *others], lowest, highest, teeth)
    frequency = odds[0][0]
    if factor == 1 and spare == 0:
        return FoundSpeed(chosen.rotation, odds)
    if spare and chosen.followed:
        # a constant speed that does not do for the middle does not for the whole
        return FoundSpeed(follow(samples, rate, *_path(whole, frequency)), odds)
    return FoundSpeed(_fitted(whole, frequency).rotation, odds)


def _whole_factor(
    heard: LineGains, found: Sequence[Rotation], lowest: float, highest: float, teeth: int | None
) -> tuple[Fraction, tuple[tuple[float, float], ...]]:
    """The factor between the first rotation found and the spindle, 0 where it is another, and frequencies [Hz] with probabilities."""
    slowest = max(lowest, TURNS * heard.rate / heard.samples.shape[0])
    odds: list[tuple[float, float, Fraction]] = []
    for place, rotation in enumerate(found):
        frequency = to_hz(rotation.spindle_speed)
        factors = [
            each for each in multiples(teeth) if each == 1 or slowest <= frequency * each <= min(highest, HIGHEST_SHARE * heard.rate)
        ]
        log = log_odds(heard.samples, heard.rate, rotation.angle, factors, teeth)
        odds += [
            (float(each), frequency * float(factor), Fraction(0) if place else factor) for each, factor in zip(log, factors, strict=True)
        ]
    # the number of teeth may speak against what was found; without it nothing but lines that others explain as well does
    first = odds[0][1] if teeth is None else max(odds, key=lambda each: each[0])[1]
    odds.sort(key=lambda each: (each[1] != first, -each[0]))
    apart = [each for i, each in enumerate(odds) if all(abs(np.log(each[1] / other[1])) > APART for other in odds[:i])]
    share = np.exp(np.array([each[0] for each in apart]) - max(each[0] for each in apart))
    share /= share.sum()
    return apart[0][2], tuple(
        (each[1], float(part)) for each, part in zip(apart, share, strict=True) if part > _UNLIKELY or each is apart[0]
    )


def _parts(heard: LineGains, frequency: float, lowest: float) -> int:
    """Least number by which a frequency is divided so that nearly all lines stand on multiples that stand between its own: what looks like
    the spindle may be the tooth passages. Lines of other origin may stand there by chance, but do not keep the spindle's phase."""
    shares = {parts: _between(heard, frequency / parts, parts) for parts in range(2, _MOST + 3) if frequency / parts >= lowest}
    most = max(shares.values(), default=0.0)
    return min(parts for parts in shares if shares[parts] > 0.9 * most) if most > _BETWEEN else 1


def _between(heard: LineGains, frequency: float, times: int) -> float:
    """Share of the lines at multiples of a frequency that are no multiples of so many times it, as long windows show them: beside
    chatter, short ones do not tell weak lines."""
    length = _long(heard)
    power, order = heard.of(length)[1], np.arange(1, int(0.45 * heard.rate / frequency) + 1)
    hertz = PADDED * length / heard.rate
    own, around = max(round(_OWN * hertz), 2), round(_AROUND * hertz)
    line = np.zeros(order.size)
    for k, at in enumerate(np.round(order * frequency * hertz).astype(int)):
        top = float(power[max(at - own, 0) : at + own + 1].max())
        beside = np.concatenate([power[max(at - around, 0) : max(at - 2 * own, 0)], power[at + 2 * own + 1 : at + around + 1]])
        line[k] = top if top > _CLEAR * np.median(beside) else 0.0
    return _shares(np.concatenate([[0.0], line]), times)


def _ramp(heard: LineGains, lowest: float, highest: float) -> _Fit | None:
    """How a spindle turns whose speed changes on purpose, and its lines; None where no path leads far enough."""
    # a window holds a few revolutions, and is short beside the ramp
    samples, rate = heard.samples, heard.rate
    lowest, highest = max(lowest, RAMP.slowest), min(highest, 0.2 * rate)
    if highest < (1.0 + 2.0 * APART) * lowest:
        return None
    middles, path = speed_path(heard, lowest, highest, RAMP)
    if np.ptp(np.log(path)) < 2.0 * APART:
        return None
    gain = heard.of(RAMP.length(rate, lowest, samples.shape[0]))[0]
    place = path * 2.0 * (gain.shape[1] - 1) / rate

    def score(parts: int) -> float:
        return sum(float(comb_scores(row[None], at[None] / parts, ORDERS, False)[0, 0]) for row, at in zip(gain, place, strict=True))

    # what looks like the spindle may be the tooth passages
    scores = {parts: score(parts) for parts in range(1, _MOST + 1) if path.min() / parts >= lowest}
    parts = max(parts for parts in scores if scores[parts] >= _AS_GOOD * max(scores.values()))
    slowest = float(path.max()) / parts
    fit = _along(heard, middles, path / parts, slowest)
    times = _largest_multiple(fit.lines.power, slowest, highest)
    return fit if times == 1 else _along(heard, middles, times * path / parts, times * slowest)


def rotation_near(samples: FloatArray, rate: float, frequency: float) -> Rotation:
    """Return how a spindle turns that turns at about this frequency. `samples`, shape (n, c). `rate`, `frequency` [Hz]."""
    return _fitted(LineGains(samples, rate), frequency).rotation


def _along(heard: LineGains, middles: FloatArray, frequency: FloatArray, highest: float) -> _Fit:
    """How a spindle turns that turns as windows say, at most at a frequency [Hz], and the lines of its orders below half the rate."""
    samples, rate = heard.samples, heard.rate
    rotation = follow(samples, rate, middles, frequency)
    orders = min(max(int(0.48 * rate / highest), 1), 2 * ORDERS)
    lines = order_lines(samples, rotation.angle, window_length(rate, highest, samples.shape[0]), orders)
    return _Fit(highest, rotation, lines, middles.size > 1)


def _long(heard: LineGains) -> int:
    """Samples of the windows in which the speed is looked for."""
    return min(round(_LONG * heard.rate), heard.samples.shape[0])


def _candidates(heard: LineGains, lowest: float, highest: float) -> list[float]:
    """Frequencies [Hz] that lines speak for, the best first; none where that may be chance."""
    length = _long(heard)
    gains, power = heard.of(length)
    gain = gains.mean(axis=0)
    trial = np.exp(np.arange(np.log(lowest), np.log(min(highest, HIGHEST_SHARE * heard.rate)) + _STEP, _STEP))
    place = trial * PADDED * length / heard.rate
    score = comb_scores(gain[None], place, ORDERS, False)[0]
    score = score + np.max([sideband_scores(gain, place, float(centre), _SIDES, _WORTH) for centre in _strongest(power)], axis=0)
    found: list[int] = []
    for at in np.argsort(-score):
        if score[at] < max(_AS_GOOD * score.max(), _A_SPEED) or len(found) == _MOST:
            break
        if all(abs(np.log(trial[at] / trial[each])) > APART for each in found):
            found.append(int(at))
    return [float(trial[at]) for at in found]


def _strongest(power: FloatArray) -> list[int]:
    """Bins of the strongest lines."""
    left, found = power.copy(), []
    for _ in range(_CENTRES):
        found.append(int(np.argmax(left)))
        left[max(found[-1] - 40, 0) : found[-1] + 41] = 0.0
    return found


def _path(heard: LineGains, frequency: float) -> tuple[FloatArray, FloatArray]:
    """Path of a speed that is about this frequency [Hz] through short windows, see `speed_path`."""
    return speed_path(heard, (1.0 - APART) * frequency, (1.0 + APART) * frequency)


def _fitted(heard: LineGains, frequency: float) -> _Fit:
    """How a spindle turns that turns at about this frequency, and its lines.

    The path through short windows knows how it wanders; where they say too little, the speed is the one that long windows tell.
    """
    followed = _along(heard, *_path(heard, frequency), frequency)
    steady = _along(heard, np.array([0.5 * (heard.samples.shape[0] - 1)]), np.array([frequency]), frequency)
    return followed if followed.explained > max(_CLEARLY * steady.explained, _TELLS) else steady


def _shares(power: FloatArray, times: int) -> float:
    """Share of the power of the lines 0, 1, 2, ... that stands on no multiple of a number."""
    return float(power[np.arange(power.size) % times != 0].sum() / (power.sum() + 1e-300))


def _largest_multiple(power: FloatArray, frequency: float, highest: float) -> int:
    """Largest number of which all orders with a line are multiples, as far as the frequency stays below a highest one."""
    times = 1
    while True:
        for more in (2, 3, 5, 7):
            if times * more * frequency < 1.01 * highest and _shares(power, times * more) < _ELSEWHERE:
                times *= more
                break
        else:
            return times
