"""Sums over poles; arrays and scalars only."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def pole_sum(omega, pole, residue):
    """Return sum_k residue[k] / (i omega - pole[k]), shapes (n,), (m,), (m, q) -> (n, q)."""
    n = omega.size
    m, q = residue.shape
    values = np.zeros((n, q), dtype=np.complex128)
    for i in range(n):
        for k in range(m):
            re = -pole[k].real
            im = omega[i] - pole[k].imag
            scale = 1.0 / (re * re + im * im)
            factor = complex(re * scale, -im * scale)
            for j in range(q):
                values[i, j] += residue[k, j] * factor
    return values
