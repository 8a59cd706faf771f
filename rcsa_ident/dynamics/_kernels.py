"""Sums over poles, and bases; arrays and scalars only."""

from __future__ import annotations

import math

import numba
import numpy as np

#: Frequencies side by side: the innermost loop, which runs in vector registers.
LANES = 64


@numba.njit(cache=True, error_model="numpy")
def pole_sum(omega, pole, residue):
    """Return sum_k residue[k] / (i omega - pole[k]), shapes (n,), (m,), (m, q) -> (n, q)."""
    n = omega.size
    m, q = residue.shape
    values = np.empty((n, q), dtype=np.complex128)
    width = min(LANES, n)
    real, imag = np.empty((q, width)), np.empty((q, width))
    u, v, here = np.empty(width), np.empty(width), np.zeros(width)
    for first in range(0, n, LANES):
        count = min(LANES, n - first)
        for f in range(count):
            here[f] = omega[first + f]
        real[:], imag[:] = 0.0, 0.0
        for k in range(m):
            damped, shift = -pole[k].real, pole[k].imag
            for f in range(width):
                away = here[f] - shift
                scale = 1.0 / (damped * damped + away * away)
                u[f] = damped * scale
                v[f] = -away * scale
            for j in range(q):
                a, b = residue[k, j].real, residue[k, j].imag
                r, i = real[j], imag[j]
                for f in range(width):
                    r[f] += a * u[f] - b * v[f]
                for f in range(width):
                    i[f] += a * v[f] + b * u[f]
        for f in range(count):
            for j in range(q):
                values[first + f, j] = complex(real[j, f], imag[j, f])
    return values


@numba.njit(cache=True)
def add_banded(total, band, x):
    """Add to `total`, in place, the product of a banded matrix with x, shapes (d, k), (2 h + 1, d), (d, k).

    Entry (i, j) of the matrix is band[h + i - j, j].
    """
    half, d = band.shape[0] // 2, band.shape[1]
    for i in range(d):
        for j in range(max(i - half, 0), min(i + half + 1, d)):
            factor = band[half + i - j, j]
            if factor != 0.0:
                for c in range(x.shape[1]):
                    total[i, c] += factor * x[j, c]


@numba.njit(cache=True)
def independent_columns(columns, tolerance):
    """Return an orthonormal basis of the columns, shape (d, m) -> (d, k), largest remainder first.

    Columns are taken at unit length; the basis ends where no remainder is longer than `tolerance`.
    """
    d, m = columns.shape
    most = min(d, m)
    rest, size = np.empty((m, d)), np.empty(m)
    for j in range(m):
        for i in range(d):
            rest[j, i] = columns[i, j]
        length = math.sqrt(dot(rest[j], rest[j]))
        if length > 0.0:
            shrink(rest[j], length)
        size[j] = dot(rest[j], rest[j])
    basis = np.empty((most, d))
    found = most
    for k in range(most):
        best = 0
        for j in range(1, m):
            if size[j] > size[best]:
                best = j
        if math.sqrt(size[best]) <= tolerance:
            found = k
            break
        for i in range(d):
            basis[k, i] = rest[best, i]
        shrink(basis[k], math.sqrt(size[best]))
        # what the subtractions have lost to rounding is taken out again
        for i in range(k):
            take_out(basis[i], basis[k])
        shrink(basis[k], math.sqrt(dot(basis[k], basis[k])))
        for j in range(m):
            take_out(basis[k], rest[j])
            size[j] = dot(rest[j], rest[j])
    answer = np.empty((d, found))
    for k in range(found):
        for i in range(d):
            answer[i, k] = basis[k, i]
    return answer


@numba.njit(cache=True)
def shrink(vector, length):
    """Divide a vector by a length, in place."""
    for i in range(vector.size):
        vector[i] /= length


@numba.njit(cache=True)
def dot(a, b):
    """Return the inner product of two real vectors."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@numba.njit(cache=True)
def take_out(direction, vector):
    """Subtract from `vector`, in place, its part along the unit vector `direction`."""
    share = dot(direction, vector)
    for i in range(vector.size):
        vector[i] -= share * direction[i]
