"""Fourier sums at multiples of one frequency; arrays and scalars only."""

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
