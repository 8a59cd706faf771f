"""The steady part of a cut: without entry into the material, exit, or anything in between."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals._kernels import order_sums
from rcsa_ident.signals.recording import BLOCK, LONGEST, Recording

#: Share of the median tooth-passing amplitude by which a block may differ and still be steady.
STEADY_SHARE = 0.3
#: The same at the stretch's own ends, and how many blocks are looked at there.
EDGE_SHARE, _EDGE_BLOCKS = 0.03, 3
#: Tooth-passing lines that are looked at, and how far one stands above its neighbours that is the cut's and not the flange's.
_LINES, _STAND_OUT = 6, 2.0
#: Power over its neighbours' from which on a line is wholly the cut's.
_CLEAREST = 100.0


def steady_part(samples: FloatArray, rate: float, spindle_speed: float, teeth: int) -> slice:
    """Return the longest stretch in which the tooth-passing lines keep their amplitude.

    The record is cut into blocks of two revolutions; a block belongs to the steady part if the amplitude of its
    tooth-passing lines is within `STEADY_SHARE` of the median, or no farther off than such blocks scatter anyway. Of the
    first six those count that stand above the orders beside them, for the flange's roundness is there in the air, too;
    where none does, the first three.
    The median is that of the blocks' energy, so that a cut is found in a record that is mostly air. A stretch that
    begins or ends within the record loses a block there, where entry or exit may reach into it.

    `samples`, shape (n, c); `rate` [Hz]; `spindle_speed` [rad/s]
    `teeth`: 1 for an air cut
    """
    n = samples.shape[0]
    length = _block_length(rate, spindle_speed)
    blocks = n // length
    if blocks < 4:
        return slice(0, n)
    first, last = _longest(_amplitude(_block_power(samples[: blocks * length], length, spindle_speed / rate, teeth), teeth))
    begin = (first + 1) * length if first > 0 else 0
    return slice(begin, n if last == blocks else max((last - 1) * length, begin))


def steady_window(recording: Recording, columns: Sequence[int], spindle_speed: float, teeth: int) -> slice:
    """Return the `LONGEST` samples in the middle of a long recording's longest steady stretch, found block by block; all of a shorter one.

    `columns`: channels of the displacements
    `spindle_speed` [rad/s]: about: blocks of two revolutions do not tell it to a hundredth
    `teeth`: 1 for an air cut
    """
    n = recording.samples.shape[0]
    length = _block_length(recording.rate, spindle_speed)
    if n <= LONGEST or n // length < 4:
        return slice(0, min(n, LONGEST))
    step = max(BLOCK // length, 1) * length
    parts = [
        _block_power(
            recording.samples[start : min(start + step, n // length * length)][:, columns], length, spindle_speed / recording.rate, teeth
        )
        for start in range(0, n // length * length, step)
    ]
    middle = sum(_longest(_amplitude(np.concatenate(parts), teeth))) * length // 2
    begin = min(max(middle - LONGEST // 2, 0), n - LONGEST)
    return slice(begin, begin + LONGEST)


def _block_length(rate: float, spindle_speed: float) -> int:
    """Samples of two revolutions."""
    return round(2.0 * (2.0 * np.pi / spindle_speed * rate))


def _longest(amplitude: FloatArray) -> tuple[int, int]:
    """First block of the longest stretch of steady ones, and the first behind it."""
    order = np.argsort(amplitude)
    energy = np.cumsum(amplitude[order] ** 2)
    middle = amplitude[order[np.searchsorted(energy, 0.5 * energy[-1])]]
    usual = np.median(np.abs(np.diff(amplitude[amplitude > 0.5 * middle]))) if np.sum(amplitude > 0.5 * middle) > 4 else 0.0
    steady = np.abs(amplitude - middle) <= max(STEADY_SHARE * middle, 6.0 * usual)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steady, [False]]).astype(int)))
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    first, last = int(starts[longest]), int(stops[longest])
    # where the stretch begins or ends in the record, what is left of entry and exit in it is less than what was looked for
    inside = amplitude[first:last]
    level, spread = np.median(inside), np.median(np.abs(np.diff(inside))) if inside.size > 4 else np.inf
    off = np.abs(inside - level) > max(EDGE_SHARE * level, 4.0 * spread)
    reach = min(_EDGE_BLOCKS, (last - first) // 4)
    begin = np.flatnonzero(off[:reach])[-1] + 1 if first > 0 and off[:reach].any() else 0
    end = np.flatnonzero(off[::-1][:reach])[-1] + 1 if last < amplitude.size and off[::-1][:reach].any() else 0
    return first + int(begin), last - int(end)


def _block_power(samples: FloatArray, length: int, step: float, teeth: int) -> FloatArray:
    """Power of the lines 0, 1, ... in each block of so many samples, all channels together, shape (blocks, orders)."""
    blocks, channels = samples.shape[0] // length, samples.shape[1]
    highest = int(min(_LINES * teeth + 1, 0.45 * 2.0 * np.pi / step))
    parts = samples.reshape(blocks, length, channels)
    # a Hann window keeps drift and the lines between out
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(length) + 0.5) / length)
    parts = (parts - parts.mean(axis=1, keepdims=True)) * window[:, None]
    side_by_side = np.ascontiguousarray(parts.transpose(1, 0, 2)).reshape(length, blocks * channels)
    power = np.abs(order_sums(side_by_side, step, highest)) ** 2
    return power.reshape(-1, blocks, channels).sum(axis=2).T


def _amplitude(power: FloatArray, teeth: int) -> FloatArray:
    """Root of the power in the lines of the teeth that are the cut's, shape (blocks,)."""
    mean = power.mean(axis=0)
    order = np.arange(teeth, power.shape[1], teeth)
    if teeth > 1:
        beside = np.maximum(mean[order - 1], mean[np.minimum(order + 1, power.shape[1] - 1)] * (order + 1 < power.shape[1]))
        clear = mean[order] / np.maximum(beside, 1e-300)
        own = order[clear > _STAND_OUT**2]
        # each counts by how clearly it is the cut's: a strong one may still be the flange's
        weight = np.minimum(clear[clear > _STAND_OUT**2], _CLEAREST) / mean[own]
    else:
        own, weight = order[:0], np.zeros(0)
    return np.sqrt(power[:, own] @ weight if own.size else power[:, order[:3]].sum(axis=1))


def hann(n: int) -> FloatArray:
    """Return the periodic Hann window, shape (n,); SciPy's takes half a second to import."""
    return 0.5 - 0.5 * np.cos(2.0 * np.pi / n * np.arange(n))
