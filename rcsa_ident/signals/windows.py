"""The steady part of a cut: without entry into the material, exit, or anything in between."""

from __future__ import annotations

import numpy as np

from rcsa_ident.dynamics.arrays import FloatArray
from rcsa_ident.signals._kernels import order_sums

#: Share of the median tooth-passing amplitude by which a block may differ and still be steady.
STEADY_SHARE = 0.3


def steady_part(samples: FloatArray, rate: float, spindle_speed: float, teeth: int) -> slice:
    """Return the longest stretch in which the tooth-passing lines keep their amplitude.

    The record is cut into blocks of two revolutions; a block belongs to the steady part if the amplitude of its first
    three tooth-passing lines is within `STEADY_SHARE` of the median.

    Parameters
    ----------
    samples : array, shape (n, c)
    rate : float [Hz]
    spindle_speed : float [rad/s]
    """
    n = samples.shape[0]
    period = 2.0 * np.pi / spindle_speed * rate
    length = int(round(2.0 * period))
    blocks = n // length
    if blocks < 4:
        return slice(0, n)
    amplitude = np.empty(blocks)
    for b in range(blocks):
        part = samples[b * length : (b + 1) * length]
        highest = int(min(3 * teeth, 0.45 * period))
        sums = order_sums(part - part.mean(axis=0), spindle_speed / rate, highest)
        amplitude[b] = np.sqrt(np.sum(np.abs(sums[teeth::teeth]) ** 2))
    middle = np.median(amplitude)
    steady = np.abs(amplitude - middle) <= STEADY_SHARE * middle
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steady, [False]]).astype(int)))
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    first, last = int(starts[longest]), int(stops[longest])
    return slice(first * length, n if last == blocks else last * length)
