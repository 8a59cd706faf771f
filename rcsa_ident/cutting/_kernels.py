"""Which surface a tooth cuts into where teeth are offset from each other; arrays and scalars only."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def chip_pieces(moved, step, start, end, keep):
    """Return the pieces of arcs along which the chip is one moved sin(phi) + step, the smallest of all, and above zero.

    Parameters
    ----------
    moved, step : arrays (k, n)
        At each of n points of an edge, of the surfaces that k teeth ahead have left.
    start, end : arrays (n,)
        Angles between which the points cut.
    keep : array of bool (n,)
        Points that are looked at.

    Returns
    -------
    node, which : integer arrays (m,)
        Point and surface of each piece.
    first, last : arrays (m,)
        Angles between which it is cut.
    """
    count, points = moved.shape
    most = count * (count + 1) + 2
    angles = np.empty(most)
    node, which = np.empty(points * most, dtype=np.int64), np.empty(points * most, dtype=np.int64)
    first, last = np.empty(points * most), np.empty(points * most)
    found = 0
    for i in range(points):
        if not keep[i]:
            continue
        angles[0], angles[1], n = start[i], end[i], 2
        for a in range(count):
            # where a surface is met by nothing, and by each of the others
            for b in range(-1, a):
                steeper = moved[a, i] - (moved[b, i] if b >= 0 else 0.0)
                if steeper == 0.0:
                    continue
                sine = ((step[b, i] if b >= 0 else 0.0) - step[a, i]) / steeper
                if not -1.0 < sine < 1.0:
                    continue
                angle = math.asin(sine)
                for place in (angle, math.pi - angle):
                    if place < 0.0:
                        place += 2.0 * math.pi
                    if start[i] < place < end[i]:
                        angles[n] = place
                        n += 1
        for k in range(1, n):
            # few, and compiled at once; a library's sort is not
            value, place = angles[k], k
            while place > 0 and angles[place - 1] > value:
                angles[place] = angles[place - 1]
                place -= 1
            angles[place] = value
        for k in range(n - 1):
            if angles[k + 1] - angles[k] < 1e-12:
                continue
            sine = math.sin(0.5 * (angles[k] + angles[k + 1]))
            least, chip = 0, moved[0, i] * sine + step[0, i]
            for a in range(1, count):
                other = moved[a, i] * sine + step[a, i]
                if other < chip:
                    least, chip = a, other
            if chip <= 0.0:
                continue
            if found > 0 and node[found - 1] == i and which[found - 1] == least and last[found - 1] == angles[k]:
                last[found - 1] = angles[k + 1]
                continue
            node[found], which[found], first[found], last[found] = i, least, angles[k], angles[k + 1]
            found += 1
    return node[:found].copy(), which[:found].copy(), first[:found].copy(), last[:found].copy()
