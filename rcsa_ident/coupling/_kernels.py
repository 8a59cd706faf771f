"""The receptance at a tip with something behind the flange, for many things at once; arrays and scalars only.

C11 = A11 - A12 (A22 + W)^-1 A21 in one bending plane, with a 2 x 2 inverse in closed form. Receptances at the flange and W stand as
(translation, both, slope), and `carried` holds what A12 and A21 make of the three.
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
