"""Fourier sums at multiples of one frequency, runs of equal samples; arrays and scalars only."""

from __future__ import annotations

import math

import numba
import numpy as np

#: Samples whose rotations are kept at once.
_CHUNK = 128


@numba.njit(cache=True)
def order_sums(samples, step, highest):
    """Return sum_t samples[t] e^{-i m step t'} for m = 0..highest, t' from the middle of the samples.

    Shapes: samples (n, c) -> (highest + 1, c).
    """
    n, channels = samples.shape
    real = np.zeros((channels, highest + 1))
    imaginary = np.zeros((channels, highest + 1))
    cosine = np.ones(highest + 1)
    sine = np.zeros(highest + 1)
    middle = 0.5 * (n - 1)
    for t in range(n):
        first, second = math.cos(step * (t - middle)), math.sin(step * (t - middle))
        for m in range(1, min(4, highest) + 1):
            cosine[m] = cosine[m - 1] * first - sine[m - 1] * second
            sine[m] = cosine[m - 1] * second + sine[m - 1] * first
        # four powers at a time, so that they do not wait for each other
        for m in range(5, highest + 1):
            cosine[m] = cosine[m - 4] * cosine[4] - sine[m - 4] * sine[4]
            sine[m] = cosine[m - 4] * sine[4] + sine[m - 4] * cosine[4]
        for c in range(channels):
            x = samples[t, c]
            for m in range(highest + 1):
                real[c, m] += x * cosine[m]
            for m in range(highest + 1):
                imaginary[c, m] -= x * sine[m]
    return (real + 1j * imaginary).T.copy()


@numba.njit(cache=True)
def order_signal(amplitude, step, n):
    """Return Re sum_m amplitude[m] e^{i m step t'} with t' from the middle of n samples, shape (m + 1, c) -> (n, c)."""
    orders, channels = amplitude.shape
    values = np.zeros((channels, n))
    middle = 0.5 * (n - 1)
    for start in range(0, n, _CHUNK):
        size = min(_CHUNK, n - start)
        cosine, sine = np.empty(size), np.empty(size)
        for t in range(size):
            cosine[t] = math.cos(step * (start + t - middle))
            sine[t] = math.sin(step * (start + t - middle))
        power, quadrature = np.ones(size), np.zeros(size)
        for m in range(orders):
            for c in range(channels):
                a, b = amplitude[m, c].real, amplitude[m, c].imag
                out = values[c, start : start + size]
                for t in range(size):
                    out[t] += a * power[t] - b * quadrature[t]
            for t in range(size):
                turned = power[t] * cosine[t] - quadrature[t] * sine[t]
                quadrature[t] = power[t] * sine[t] + quadrature[t] * cosine[t]
                power[t] = turned
    return values.T.copy()


@numba.njit(cache=True)
def follow_runs(x, at, values, counts, lengths, levels, front):
    """Go on through a channel's samples, shape (n,), the first of which has the index `at`; the state begins with `NEW_VALUES` and zeros.

    State: values (low, next to it, high, next to it, the run's value, least jump, first); counts (lost, first lost, start and length of
    the run that goes on, samples at each of the four levels, runs and samples in runs of three at low and at high, distinct levels, longest
    run that has ended); lengths[k] runs of k samples, the last entry those that are longer; levels, the first distinct ones; front,
    shape (k, 3), (start, length, jump behind it) of long runs none of which is both shorter than an earlier one and followed by less.
    """
    last, length = values[4], counts[3]
    for t in range(x.size):
        value = x[t]
        if value == last:
            length += 1
            continue
        if not math.isfinite(value):
            if counts[0] == 0:
                counts[1] = at + t
            counts[0] += 1
            continue
        if length == 0:
            values[6] = value
        elif length == 1 and values[1] < last < values[3] and counts[12] == levels.size:
            # what nearly every sample of a fine signal is: a run of its own between the extremes
            lengths[1] += 1
            values[5] = min(values[5], abs(value - last))
            counts[13] = max(counts[13], 1)
        else:
            values[4], counts[3] = last, length
            end_run(abs(value - last), values, counts, lengths, levels, front)
        last, length, counts[2] = value, 1, at + t
    values[4], counts[3] = last, length


@numba.njit(cache=True)
def end_run(jump, values, counts, lengths, levels, front):
    """Count the run that goes on; `jump` is to the value behind it, below 0 where the record ends."""
    value, start, length = values[4], counts[2], counts[3]
    lengths[min(length, lengths.size - 1)] += 1
    _level(value, length, 1.0, values[0:2], counts[4:6], counts[8:10])
    _level(value, length, -1.0, values[2:4], counts[6:8], counts[10:12])
    known = False
    for k in range(counts[12]):
        known = known or levels[k] == value
    if not known and counts[12] < levels.size:
        levels[counts[12]] = value
        counts[12] += 1
    if jump < 0.0:
        return
    values[5] = min(values[5], jump)
    counts[13] = max(counts[13], length)
    if length < front[0, 1]:
        return
    place = 1
    while place < front.shape[0] and front[place, 1] > 0.0:
        if front[place, 1] >= length and front[place, 2] >= jump:
            return
        place += 1
    if place < front.shape[0]:
        front[place, 0], front[place, 1], front[place, 2] = start, length, jump


@numba.njit(cache=True)
def _level(value, length, sign, extremes, samples, runs):
    """Keep the lowest (sign 1) or highest (-1) value, the one next to it, how often they come, and runs of three at the extreme."""
    if sign * value < sign * extremes[0]:
        extremes[1], samples[1] = extremes[0], samples[0]
        extremes[0], samples[0] = value, 0
        runs[:] = 0
    if value == extremes[0]:
        samples[0] += length
        if length >= 3:
            runs[0] += 1
            runs[1] += length
    elif value == extremes[1]:
        samples[1] += length
    elif sign * value < sign * extremes[1]:
        extremes[1], samples[1] = value, length
