"""Fourier sums at multiples of one frequency; arrays and scalars only."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def order_sums(samples, step, highest, moments):
    """Return sum_t u^p samples[t] e^{-i m step t'} for p < moments, m = 0..highest.

    Time t' is counted from the middle of the samples and u = 2 t' / n runs over [-1, 1], so that the moments are well
    scaled. Shapes: samples (n, c) -> (moments, highest + 1, c).
    """
    n, channels = samples.shape
    sums = np.zeros((moments, highest + 1, channels), dtype=np.complex128)
    middle = 0.5 * (n - 1)
    for t in range(n):
        shifted = t - middle
        u = 2.0 * shifted / n
        rotation = complex(math.cos(step * shifted), -math.sin(step * shifted))
        factor = complex(1.0, 0.0)
        for m in range(highest + 1):
            weight = factor
            for p in range(moments):
                for c in range(channels):
                    sums[p, m, c] += weight * samples[t, c]
                weight = weight * u
            factor = factor * rotation
    return sums


@numba.njit(cache=True)
def order_signal(amplitude, step, n):
    """Return Re sum_m amplitude[m] e^{i m step t'} with t' from the middle of n samples, shape (m + 1, c) -> (n, c)."""
    orders, channels = amplitude.shape
    values = np.zeros((n, channels))
    middle = 0.5 * (n - 1)
    for t in range(n):
        shifted = t - middle
        rotation = complex(math.cos(step * shifted), math.sin(step * shifted))
        factor = complex(1.0, 0.0)
        for m in range(orders):
            for c in range(channels):
                values[t, c] += amplitude[m, c].real * factor.real - amplitude[m, c].imag * factor.imag
            factor = factor * rotation
    return values
