"""Lines beside the spindle's orders: which stand out of the noise around them, and which are chatter with its sidebands.

Each channel is judged by itself, and each line against the noise beside it (`cfar`), at several widths, since chatter wanders. What
stands out is not yet chatter: bearings and mains do, too. For that speak how strong a line is, with those one tooth-passing frequency
apart, beside the orders of the same channel, and how many of these there are beside those that are there by chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import bdtrc

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals.sound.cfar import averages, stands_out
from rcsa_ident.signals.steady_part import hann

#: Probability that noise alone raises a line anywhere in a record, and the bins that lines may spread over.
FALSE_ALARM, _WIDTHS = 1e-3, (1, 4, 12)
#: Windows of the spectrum [s]: as fine as chatter stays where it is.
_WINDOW = 1.0
#: Share of the spindle's frequency around its multiples that belongs to the orders: what wanders cannot be told from it.
_OWN = 0.05
#: Windows with more than so many times the median's power hold a transient.
_TRANSIENT = 3.0
#: Share of the spindle's frequency by which a line may miss a whole multiple beside the strongest one: it wanders; and most multiples.
_FAMILY, _SIDES = 0.1, 24
#: Lines weaker than this share of the strongest are not named, and at most so many are.
_NAMED, _MOST = 0.03, 12
#: Mains [Hz], by what share they are off, and multiples of which some have to be there.
_MAINS, _OFF, _HUM = (50.0, 60.0), 2e-3, 12
#: Lines of a channel that may be chatter's strongest, sidebands of it to each side, and by how many bins these may be off.
_CENTRES, _BESIDE, _MISS = 4, 3, 2.0
#: Share of the record, and decades over the power of the orders, from which on a line beside the orders is chatter at least so probably,
#: with sidebands or without: forced vibration has none so strong.
_STRONG, _OVER_ORDERS, _AT_LEAST = 0.15, np.log10(0.25), 0.9
#: Logarithm of the odds of chatter: constant, and for each decade of its power over that of the orders, of that over the noise beside it,
#: and of the probability that its sidebands are there by chance, at most so many; as made-up records say (`benchmarks listening`).
_ODDS, _MOST_SIDES = np.array([-0.87, 4.25, 0.60, 0.82]), 4.0


@dataclass(frozen=True, slots=True, eq=False)
class OffOrders:
    """Lines of what the orders leave.

    `frequency` [Hz], shape (l,): the structure's first, then the strongest
    `share`: share of the record's power in the line that is most likely chatter, and in its sidebands
    `beside`, shape (k,): power of the lines that lie 1, 2, ..., k times the spindle's frequency beside it, to both sides
    `evidence`, shape (3,): decades: power of the line and its sidebands over that of the orders of the channel, of the line over the noise
        beside it, and the probability of its sidebands by chance
    `hum` [Hz]: mains whose multiples are there
    """

    frequency: FloatArray
    share: float
    beside: FloatArray
    evidence: FloatArray
    hum: float | None = None

    @property
    def probability(self) -> float:
        """That a cut with these lines chatters."""
        if not self.frequency.size:
            return 0.0
        strong = self.share > _STRONG and self.evidence[0] > _OVER_ORDERS
        return max(float(1.0 / (1.0 + np.exp(-log_odds(self.evidence)))), _AT_LEAST * strong)


def log_odds(evidence: FloatArray) -> float:
    """Return the logarithm of the odds of chatter, see `OffOrders.evidence`."""
    return float(_ODDS[0] + _ODDS[1:] @ evidence)


def off_orders(
    rest: FloatArray,
    forced: FloatArray,
    energy: float,
    rate: float,
    orders: FloatArray,
    band: float,
    twice_differentiated: bool,
    teeth: int | None,
) -> OffOrders:
    """Return the lines of what is left of a record when its orders are taken away.

    `rest`, shape (n, c)
    `forced`, shape (c,): mean square of the orders
    `energy`: mean square of the record itself, all channels together
    `rate` [Hz]
    `orders` [Hz], shape (m,): where the orders 1, 2, ... stand in the spectrum
    `band` [Hz]: highest frequency
    `twice_differentiated`: of accelerations the displacement says which line is the strongest
    `teeth`: as told, or heard
    """
    n, spindle = rest.shape[0], float(orders[0])
    length = min(round(_WINDOW * rate), n)
    window = hann(length)[:, None]
    starts = np.arange(0, n - length + 1, max(length // 2, 1))
    spectra = (np.fft.rfft(rest[s : s + length] * window, axis=0) for s in starts)
    power = np.array([each.real**2 + each.imag**2 for each in spectra])
    # the transients of an entry or a knock are in few windows, chatter is in most
    level = np.sum(power, axis=(1, 2))
    quiet = level <= _TRANSIENT * np.median(level)
    power = power[quiet].mean(axis=0) * (2.0 / (length * np.sum(window**2)))
    frequency, bin_hz = np.arange(power.shape[0]) * rate / length, rate / length
    # below half the rate what wanders belongs to the orders; those that are folded back stand where chatter may be
    reach = np.where(np.arange(orders.size) < 0.5 * rate / spindle - 1.0, max(_OWN * spindle, 1.5 * bin_hz), 1.5 * bin_hz)
    clear = np.all(np.abs(frequency[:, None] - orders) > reach, axis=1) & (frequency > 0.2 * spindle) & (frequency < band)
    excess, noise = _lines(power, clear, averages(int(quiet.sum())))
    hum, own = _hum(excess.max(axis=1, initial=0.0), frequency)
    judged = [_family(excess[:, c], noise[:, c], ~own & clear, frequency, spindle, teeth, forced[c]) for c in range(excess.shape[1])]
    families = [each for each in judged if each is not None]
    if not families:
        return OffOrders(np.zeros(0), 0.0, np.zeros(_SIDES), np.zeros(3), hum)
    strongest, evidence = max(families, key=lambda each: log_odds(each[1]))
    total = np.where(own, 0.0, excess.sum(axis=1))

    def kin(of: int) -> tuple[FloatArray, FloatArray]:
        off = (frequency - frequency[of]) / spindle
        return np.where(np.abs(off - np.round(off)) < _FAMILY, total, 0.0), np.abs(np.round(off)).astype(int)

    # a sideband has as many others beside it as the line itself
    strongest = int(np.argmax(kin(strongest)[0]))
    found = _peaks(total, frequency, max(round(0.1 * spindle / bin_hz), 2), frequency[strongest])
    if twice_differentiated:
        # of what is no weaker than a tenth of the strongest, the largest motion is the structure's
        line = np.array([total[np.abs(frequency - each) < 0.1 * spindle].sum() for each in found])
        first = max((k for k in range(len(found)) if line[k] > 0.1 * line[0]), key=lambda k: line[k] / found[k] ** 4)
        found.insert(0, found.pop(first))
    own_power, apart = kin(strongest)
    sides = np.bincount(np.minimum(apart, _SIDES + 1), own_power, _SIDES + 2)[1:-1]
    return OffOrders(np.array(found), float(own_power.sum()) / (energy + 1e-300), sides, evidence, hum)


def _lines(power: FloatArray, clear: np.ndarray, windows: float) -> tuple[FloatArray, FloatArray]:
    """Power of the lines above the noise beside them in each bin and channel, 0 where none stands out, and the noise."""
    own, trials = power[clear], max(clear.sum() * power.shape[1] * len(_WIDTHS), 1)
    excess, noise = np.zeros(power.shape), np.full(power.shape, 1e-300)
    for width in _WIDTHS:
        line, level = stands_out(own, windows, FALSE_ALARM / trials, width)
        # a cell that stands out is a line where its bins do
        spread = np.any([np.roll(line, shift, axis=0) for shift in range(-(width // 2), width - width // 2)], axis=0)
        excess[clear] = np.maximum(excess[clear], np.where(spread, np.maximum(own - level, 0.0), 0.0))
        if width == 1:
            noise[clear] = level
    return excess, noise


def _hum(excess: FloatArray, frequency: FloatArray) -> tuple[float | None, np.ndarray]:
    """The mains [Hz] of which lines are heard, if any, and the bins of their multiples."""
    heard: list[tuple[float, float, np.ndarray]] = []
    for mains in _MAINS:
        order = np.maximum(np.round(frequency / mains), 1.0)
        near = np.abs(frequency - order * mains) < np.maximum(1.5 * frequency[1], _OFF * order * mains)
        line = np.bincount(order[near].astype(int), excess[near], _HUM + 2)[1 : _HUM + 1]
        beside = np.bincount(order[~near].astype(int), excess[~near], _HUM + 2)[1 : _HUM + 1]
        # chatter beside a multiple is stronger than what it leaves there
        there = line > beside
        if there[0] or (there[1] and there.sum() > 1):
            heard.append((float(line.sum()), mains, near))
    if not heard:
        return None, np.zeros(frequency.size, dtype=bool)
    _, mains, near = max(heard, key=lambda each: each[0])
    return mains, near


def _family(
    excess: FloatArray, noise: FloatArray, there: np.ndarray, frequency: FloatArray, spindle: float, teeth: int | None, forced: float
) -> tuple[int, FloatArray] | None:
    """The bin of a channel's line that is most likely chatter's strongest, and its evidence; None where no line stands out."""
    line, bin_hz = np.where(there, excess, 0.0), frequency[1]
    if not line.any():
        return None
    reach = max(round(0.1 * spindle / bin_hz), 2)
    miss = max(_MISS * bin_hz, 0.02 * spindle)
    # how often a line is there that is looked for anywhere
    near = np.convolve(line > 0.0, np.ones(2 * round(miss / bin_hz) + 1), "same") > 0.0
    chance = float(np.clip(near[there].mean(), 0.01, 0.99))
    best: tuple[int, FloatArray] | None = None
    for hertz in _peaks(line, frequency, reach)[:_CENTRES]:
        at = round(hertz / bin_hz)
        ways = [teeth] if teeth is not None else list(range(2, 9))
        for count in ways:
            steps = np.array([k for k in range(-_BESIDE, _BESIDE + 1) if k])
            places = np.abs(hertz + steps * count * spindle)
            places = places[(places > 0.2 * spindle) & (places < frequency[-1])]
            hit = [np.abs(frequency - each) < miss for each in places]
            tried = [each for each in hit if there[each].any()]
            seen = sum(bool(line[each].any()) for each in tried)
            by_chance = float(bdtrc(seen - 1, len(tried), chance)) if seen else 1.0
            sides = min(-np.log10(min(by_chance * len(ways), 1.0)), _MOST_SIDES)
            power = line[max(at - reach, 0) : at + reach + 1].sum() + sum(line[each].sum() for each in tried)
            top = line[max(at - 2, 0) : at + 3].max()
            evidence = np.array([np.log10(power / (forced + 1e-300)), np.log10(top / (noise[at] + 1e-300)), max(sides, 0.0)])
            evidence = np.clip(evidence, [-4.0, 0.0, 0.0], [3.0, 4.0, _MOST_SIDES])
            if best is None or log_odds(evidence) > log_odds(best[1]):
                best = at, evidence
    return best


def _peaks(excess: FloatArray, frequency: FloatArray, reach: int, first: float | None = None) -> list[float]:
    """Lines [Hz], the first one as told, then the strongest: each takes what stands within a tenth of the spindle's frequency around it."""
    left, strongest = excess.copy(), 0.0
    found: list[float] = []
    while left.max(initial=0.0) > 0.0 and len(found) < _MOST:
        at = int(np.argmax(left)) if first is None or found else round(first / frequency[1])
        own, near = slice(max(at - reach, 0), at + reach + 1), slice(max(at - 2, 0), at + 3)
        power = float(left[own].sum())
        strongest = strongest or power
        if power < _NAMED * strongest or power == 0.0:
            break
        found.append(float(np.sum(frequency[near] * excess[near]) / (excess[near].sum() or 1.0)))
        left[own] = 0.0
    return found
