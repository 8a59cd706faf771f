"""Lines beside the spindle's orders: how strong they are together, and which of them is the structure's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.signals.steady_part import hann

#: Power over the median beside it above which a bin belongs to a line.
_STANDS_OUT = 6.0
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


@dataclass(frozen=True, slots=True, eq=False)
class OffOrders:
    """Lines of what the orders leave.

    Parameters
    ----------
    frequency : array, shape (l,) [Hz]
        The strongest first.
    share : float
        Share of the record's power in the lines that lie whole multiples of the spindle's frequency beside the strongest one: chatter
        and its sidebands, not many lines of a machine.
    beside : array, shape (k,)
        Power of the lines that lie 1, 2, ..., k times the spindle's frequency beside it, to both sides.
    """

    frequency: FloatArray
    share: float
    beside: FloatArray


def off_orders(rest: FloatArray, energy: float, rate: float, orders: FloatArray, band: float, twice_differentiated: bool) -> OffOrders:
    """Return the lines of what is left of a record when its orders are taken away.

    Parameters
    ----------
    rest : array, shape (n, c)
    energy : float
        Mean square of the record itself, all channels together.
    rate : float [Hz]
    orders : array, shape (m,) [Hz]
        Where the orders 1, 2, ... stand in the spectrum.
    band : float [Hz]
        Highest frequency.
    twice_differentiated : bool
        Of accelerations the displacement says which line is the strongest.
    """
    n, spindle = rest.shape[0], float(orders[0])
    length = min(round(_WINDOW * rate), n)
    window = hann(length)[:, None]
    starts = np.arange(0, n - length + 1, max(length // 2, 1))
    spectra = (np.fft.rfft(rest[s : s + length] * window, axis=0) for s in starts)
    power = np.array([each.real**2 + each.imag**2 for each in spectra])
    # the transients of an entry or a knock are in few windows, chatter is in most
    level = np.sum(power, axis=(1, 2))
    power = power[level <= _TRANSIENT * np.median(level)].mean(axis=0) * (2.0 / (length * np.sum(window**2)))
    frequency = np.arange(power.shape[0]) * rate / length
    width = min(max(round(3.0 * spindle * length / rate), 16), power.shape[0])
    bands = power[: width * (power.shape[0] // width)].reshape(-1, width, power.shape[1])
    middles = (np.arange(bands.shape[0]) + 0.5) * width
    floor = np.stack([np.interp(np.arange(power.shape[0]), middles, level) for level in np.median(bands, axis=1).T], axis=1)
    # below half the rate what wanders belongs to the orders; those that are folded back stand where chatter may be
    reach = np.where(np.arange(orders.size) < 0.5 * rate / spindle - 1.0, max(_OWN * spindle, 1.5 * rate / length), 1.5 * rate / length)
    clear = np.all(np.abs(frequency[:, None] - orders) > reach, axis=1) & (frequency > 0.2 * spindle) & (frequency < band)
    excess = np.sum(np.where((power > _STANDS_OUT * floor) & clear[:, None], power - floor, 0.0), axis=1)
    if not excess.any():
        return OffOrders(np.zeros(0), 0.0, np.zeros(_SIDES))
    strongest = int(np.argmax(excess))
    found = _peaks(excess, frequency, max(round(0.1 * spindle * length / rate), 2))
    if twice_differentiated:
        # of what is no weaker than a tenth of the strongest, the largest motion is the structure's
        power = np.array([excess[np.abs(frequency - each) < 0.1 * spindle].sum() for each in found])
        first = max((k for k in range(len(found)) if power[k] > 0.1 * power[0]), key=lambda k: power[k] / found[k] ** 4)
        found.insert(0, found.pop(first))
    off = (frequency - frequency[strongest]) / spindle
    own = np.where(np.abs(off - np.round(off)) < _FAMILY, excess, 0.0)
    sides = np.bincount(np.minimum(np.abs(np.round(off)).astype(int), _SIDES + 1), own, _SIDES + 2)[1:-1]
    return OffOrders(np.array(found), float(own.sum()) / (energy + 1e-300), sides)


def _peaks(excess: FloatArray, frequency: FloatArray, reach: int) -> list[float]:
    """Lines [Hz], the strongest first: each takes what stands within a tenth of the spindle's frequency around it."""
    left, strongest = excess.copy(), 0.0
    found: list[float] = []
    while left.max(initial=0.0) > 0.0 and len(found) < _MOST:
        at = int(np.argmax(left))
        own, near = slice(max(at - reach, 0), at + reach + 1), slice(max(at - 2, 0), at + 3)
        power = float(left[own].sum())
        strongest = strongest or power
        if power < _NAMED * strongest:
            break
        found.append(float(np.sum(frequency[near] * excess[near]) / excess[near].sum()))
        left[own] = 0.0
    return found
