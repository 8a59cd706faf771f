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
