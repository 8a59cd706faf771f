"""The receptance at a tip with something behind the flange, for many things at once; arrays and scalars only.

C11 = A11 - A12 (A22 + W)^-1 A21 in one bending plane, with a 2 x 2 inverse in closed form. Receptances at the flange and W stand as
(translation, both, slope), and `carried` holds what A12 and A21 make of the three. Where bending planes feel each other the blocks stand
as they are, and neither A nor W need be symmetric.
"""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def tip_over(tip_tip, carried, translation, both, slope):
    """Return C11 at one frequency, with the three of A22 + W."""
    weighed = carried[0] * slope - carried[1] * both + carried[2] * translation
    determinant = translation * slope - both * both
    size = determinant.real * determinant.real + determinant.imag * determinant.imag
    return tip_tip - weighed * determinant.conjugate() * (1.0 / size)


@numba.njit(cache=True)
def tips_over(tip_tip, flange, carried, behind):
    """Return C11 for each W, shape (p, n).

    Parameters
    ----------
    tip_tip : complex array, shape (n,)
    flange, carried : complex arrays, shape (3, n)
    behind : complex array, shape (p, 3, n)
        W.
    """
    p, n = behind.shape[0], behind.shape[2]
    found = np.empty((p, n), dtype=np.complex128)
    for i in range(p):
        for j in range(n):
            translation, both, slope = behind[i, 0, j] + flange[0, j], behind[i, 1, j] + flange[1, j], behind[i, 2, j] + flange[2, j]
            found[i, j] = tip_over(tip_tip[j], (carried[0, j], carried[1, j], carried[2, j]), translation, both, slope)
    return found


@numba.njit(cache=True)
def tip_changes(tip_tip, flange, carried, ahead, behind, weight, places):
    """Return weight times the difference of C11 at both ends of each step of W, shape (p, k).

    Parameters
    ----------
    tip_tip : complex array, shape (k,)
    flange, carried : complex arrays, shape (3, k)
    ahead, behind : complex arrays, shape (n, p, 3)
        W at n frequencies: one after the other, as memory is read.
    weight : array, shape (p,)
    places : array of int, shape (k,)
        Those of the n that the others stand at.
    """
    found = np.empty((weight.size, places.size), dtype=np.complex128)
    for j in range(places.size):
        n, tip = places[j], tip_tip[j]
        here, there = (carried[0, j], carried[1, j], carried[2, j]), (flange[0, j], flange[1, j], flange[2, j])
        for i in range(weight.size):
            up = tip_over(tip, here, ahead[n, i, 0] + there[0], ahead[n, i, 1] + there[1], ahead[n, i, 2] + there[2])
            down = tip_over(tip, here, behind[n, i, 0] + there[0], behind[n, i, 1] + there[1], behind[n, i, 2] + there[2])
            found[i, j] = weight[i] * (up - down)
    return found


@numba.njit(cache=True)
def solve_small(matrix, right):
    """Solve matrix x = right in place, shapes (b, b), (b, a): x stands in `right`, and `matrix` is used up."""
    b, a = right.shape
    for k in range(b):
        best, size = k, 0.0
        for i in range(k, b):
            own = abs(matrix[i, k].real) + abs(matrix[i, k].imag)
            if own > size:
                best, size = i, own
        if best != k:
            for j in range(k, b):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            for j in range(a):
                right[k, j], right[best, j] = right[best, j], right[k, j]
        pivot = 1.0 / matrix[k, k]
        for i in range(k + 1, b):
            factor = matrix[i, k] * pivot
            for j in range(k + 1, b):
                matrix[i, j] -= factor * matrix[k, j]
            for j in range(a):
                right[i, j] -= factor * right[k, j]
    for k in range(b - 1, -1, -1):
        pivot = 1.0 / matrix[k, k]
        for j in range(a):
            total = right[k, j]
            for i in range(k + 1, b):
                total -= matrix[k, i] * right[i, j]
            right[k, j] = total * pivot


@numba.njit(cache=True)
def carried_over(back, flange, w, matrix, right):
    """Put (A22 + W)^-1 A21 at one frequency into `right`, shape (b, a)."""
    b, a = right.shape
    for i in range(b):
        for j in range(b):
            matrix[i, j] = flange[i, j] + w[i, j]
        for j in range(a):
            right[i, j] = back[i, j]
    solve_small(matrix, right)


@numba.njit(cache=True)
def tips_of_planes(tip_tip, forward, back, flange, behind):
    """Return C11 for each W where planes feel each other, shape (p, n, a, a).

    Parameters
    ----------
    tip_tip, forward, back, flange : complex arrays, shapes (n, a, a), (n, a, b), (n, b, a), (n, b, b)
        A11, A12, A21, A22.
    behind : complex array, shape (p, n, b, b)
        W.
    """
    p, n, a, b = behind.shape[0], behind.shape[1], tip_tip.shape[1], flange.shape[1]
    found = np.empty((p, n, a, a), dtype=np.complex128)
    matrix, right = np.empty((b, b), dtype=np.complex128), np.empty((b, a), dtype=np.complex128)
    for i in range(p):
        for k in range(n):
            carried_over(back[k], flange[k], behind[i, k], matrix, right)
            for r in range(a):
                for c in range(a):
                    total = tip_tip[k, r, c]
                    for j in range(b):
                        total -= forward[k, r, j] * right[j, c]
                    found[i, k, r, c] = total
    return found


@numba.njit(cache=True)
def changes_of_planes(forward, back, flange, ahead, behind, weight, places):
    """Return weight times the difference of C11 at both ends of each step of W, shape (p, k, a, a).

    Parameters
    ----------
    forward, back, flange : complex arrays, shapes (k, a, b), (k, b, a), (k, b, b)
        A12, A21, A22.
    ahead, behind : complex arrays, shape (p, n, b, b)
        W at n frequencies.
    weight : array, shape (p,)
    places : array of int, shape (k,)
        Those of the n that the others stand at.
    """
    p, a, b = weight.size, forward.shape[1], flange.shape[1]
    found = np.empty((p, places.size, a, a), dtype=np.complex128)
    matrix = np.empty((b, b), dtype=np.complex128)
    up, down = np.empty((b, a), dtype=np.complex128), np.empty((b, a), dtype=np.complex128)
    for i in range(p):
        for k in range(places.size):
            carried_over(back[k], flange[k], ahead[i, places[k]], matrix, up)
            carried_over(back[k], flange[k], behind[i, places[k]], matrix, down)
            for r in range(a):
                for c in range(a):
                    total = 0.0j
                    for j in range(b):
                        total += forward[k, r, j] * (down[j, c] - up[j, c])
                    found[i, k, r, c] = weight[i] * total
    return found
