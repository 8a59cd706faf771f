"""The steady part of a cut: without entry into the material, exit, or anything in between."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.signals._kernels import order_sums
from rcsa_ident.signals.recording import BLOCK, LONGEST, Recording

#: Share of the median tooth-passing amplitude by which a block may differ and still be steady.
STEADY_SHARE = 0.3


def steady_part(samples: FloatArray, rate: float, spindle_speed: float, teeth: int) -> slice:
    """Return the longest stretch in which the tooth-passing lines keep their amplitude.

    The record is cut into blocks of two revolutions; a block belongs to the steady part if the amplitude of its first
    three tooth-passing lines is within `STEADY_SHARE` of the median, or no farther off than such blocks scatter anyway.
    The median is that of the blocks' energy, so that a cut is found in a record that is mostly air. A stretch that
    begins or ends within the record loses a block there, where entry or exit may reach into it.

    Parameters
    ----------
    samples : array, shape (n, c)
    rate : float [Hz]
    spindle_speed : float [rad/s]
    teeth : int
        1 for an air cut.
    """
    n = samples.shape[0]
    length = _block_length(rate, spindle_speed)
    blocks = n // length
    if blocks < 4:
        return slice(0, n)
    first, last = _longest(_block_amplitudes(samples[: blocks * length], length, spindle_speed / rate, teeth))
    begin = (first + 1) * length if first > 0 else 0
    return slice(begin, n if last == blocks else max((last - 1) * length, begin))


def steady_window(recording: Recording, columns: Sequence[int], spindle_speed: float, teeth: int) -> slice:
    """Return the `LONGEST` samples in the middle of a long recording's longest steady stretch, found block by block; all of a shorter one.

    Parameters
    ----------
    recording : Recording
    columns : sequence of int
        Channels of the displacements.
    spindle_speed : float [rad/s]
        About: blocks of two revolutions do not tell it to a hundredth.
    teeth : int
        1 for an air cut.
    """
    n = recording.samples.shape[0]
    length = _block_length(recording.rate, spindle_speed)
    if n <= LONGEST or n // length < 4:
        return slice(0, min(n, LONGEST))
    step = max(BLOCK // length, 1) * length
    parts = [
        _block_amplitudes(
            recording.samples[start : min(start + step, n // length * length)][:, columns], length, spindle_speed / recording.rate, teeth
        )
        for start in range(0, n // length * length, step)
    ]
    middle = sum(_longest(np.concatenate(parts))) * length // 2
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
    return int(starts[longest]), int(stops[longest])


def _block_amplitudes(samples: FloatArray, length: int, step: float, teeth: int) -> FloatArray:
    """Root of the power in the first three lines at multiples of `teeth` in each block of so many samples."""
    blocks, channels = samples.shape[0] // length, samples.shape[1]
    highest = int(min(3 * teeth, 0.45 * 2.0 * np.pi / step))
    parts = samples.reshape(blocks, length, channels)
    # a Hann window keeps drift and the lines between out
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(length) + 0.5) / length)
    parts = (parts - parts.mean(axis=1, keepdims=True)) * window[:, None]
    side_by_side = np.ascontiguousarray(parts.transpose(1, 0, 2)).reshape(length, blocks * channels)
    power = np.abs(order_sums(side_by_side, step, highest)[teeth::teeth]) ** 2
    return np.sqrt(power.reshape(-1, blocks, channels).sum(axis=(0, 2)))


def hann(n: int) -> FloatArray:
    """Return the periodic Hann window, shape (n,); SciPy's takes half a second to import."""
    return 0.5 - 0.5 * np.cos(2.0 * np.pi / n * np.arange(n))
