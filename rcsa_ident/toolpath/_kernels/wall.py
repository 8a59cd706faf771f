"""A layer of a field of dexels as columns beside a path; arrays and scalars only."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np


class Layer(NamedTuple):
    """Lines of a field at one height: along x and along y in the layer, and along z through it."""

    #: (ny, room, 2) and (ny,), (nx, room, 2) and (nx,), (nx, ny, room, 2) and (nx, ny).
    along_x: np.ndarray
    count_x: np.ndarray
    along_y: np.ndarray
    count_y: np.ndarray
    along_z: np.ndarray
    count_z: np.ndarray
    #: (2, 3) first node, and from node to node.
    lattice: np.ndarray
    height: float


@numba.njit(cache=True, error_model="numpy")
def _inside(line, count, place):
    within = False
    for s in range(count):
        within = within or line[s, 0] <= place <= line[s, 1]
    return within


@numba.njit(cache=True, error_model="numpy")
def _crossing(line, count, low, high):
    """Where a line enters or leaves the material between two places; half way where it does not say."""
    for s in range(count):
        for e in range(2):
            if low <= line[s, e] <= high:
                return line[s, e]
    return 0.5 * (low + high)


@numba.njit(cache=True, error_model="numpy")
def contour(layer, window, out):
    """Fill the border of the material in a layer, (m, 4): from where each piece goes to where, the material on its left; return how many.

    window: first and last node along x, along y; a ring of empty nodes is thought around the field.
    """
    nx, ny = layer.count_z.shape
    x0, y0 = layer.lattice[0, 0], layer.lattice[0, 1]
    dx, dy = layer.lattice[1, 0], layer.lattice[1, 1]
    found = 0
    ends = np.empty((4, 2))
    for i in range(max(window[0], -1), min(window[1], nx - 1) + 1):
        for j in range(max(window[2], -1), min(window[3], ny - 1) + 1):
            # corners counterclockwise: (i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)
            state = 0
            for c in range(4):
                a, b = i + (1 if c in (1, 2) else 0), j + (1 if c >= 2 else 0)
                here = 0 <= a < nx and 0 <= b < ny and _inside(layer.along_z[a, b], layer.count_z[a, b], layer.height)
                state |= (1 << c) if here else 0
            if state in (0, 15):
                continue
            cut = 0
            # from a side where the material ends, counterclockwise, to one where it begins
            begin = 0
            while not ((state >> begin) & 1 and not (state >> ((begin + 1) % 4)) & 1):
                begin += 1
            for turn in range(4):
                c = (begin + turn) % 4
                one, two = (state >> c) & 1, (state >> ((c + 1) % 4)) & 1
                if one == two:
                    continue
                # a side beside the field has two empty corners
                if c % 2 == 0:
                    row, low = j + c // 2, x0 + i * dx
                    ends[cut, 0], ends[cut, 1] = _crossing(layer.along_x[row], layer.count_x[row], low, low + dx), y0 + row * dy
                else:
                    row, low = i + (1 if c == 1 else 0), y0 + j * dy
                    ends[cut, 0], ends[cut, 1] = x0 + row * dx, _crossing(layer.along_y[row], layer.count_y[row], low, low + dy)
                cut += 1
            for p in range(0, cut, 2):
                if found < out.shape[0]:
                    out[found, 0], out[found, 1] = ends[p]
                    out[found, 2], out[found, 3] = ends[p + 1]
                found += 1
    return found


@numba.njit(cache=True, error_model="numpy")
def inside(layer, places, out):
    """Say of places, (n, 2), whether the node nearest to each is in the material."""
    nx, ny = layer.count_z.shape
    for p in range(places.shape[0]):
        i = round((places[p, 0] - layer.lattice[0, 0]) / layer.lattice[1, 0])
        j = round((places[p, 1] - layer.lattice[0, 1]) / layer.lattice[1, 1])
        out[p] = 0 <= i < nx and 0 <= j < ny and _inside(layer.along_z[i, j], layer.count_z[i, j], layer.height)


@numba.njit(cache=True, error_model="numpy")
def columns(pieces, within, start, spacing, nothing, tops, feet):
    """Fill columns, shape (2, n), with the material next to the line y = 0 on both sides: of pieces of its border, (m, 4), in their axes.

    within: (n,) of columns without a border whether they lie in the material; `nothing` where a side has none, and where what it has
    goes on beyond the border that is told.
    """
    n = tops.shape[1]
    count = np.zeros(n + 1, dtype=np.int64)
    for p in range(pieces.shape[0]):
        low, high = min(pieces[p, 0], pieces[p, 2]), max(pieces[p, 0], pieces[p, 2])
        for i in range(max(math.ceil((low - start) / spacing), 0), min(math.ceil((high - start) / spacing), n)):
            count[i + 1] += 1
    first = np.cumsum(count)
    held = np.zeros(n, dtype=np.int64)
    heights, below = np.empty(first[n]), np.empty(first[n], dtype=np.bool_)
    for p in range(pieces.shape[0]):
        xa, ya, xb, yb = pieces[p]
        low, high = min(xa, xb), max(xa, xb)
        for i in range(max(math.ceil((low - start) / spacing), 0), min(math.ceil((high - start) / spacing), n)):
            k = first[i] + held[i]
            heights[k] = ya + (yb - ya) * (start + i * spacing - xa) / (xb - xa)
            # the material is on the left of a piece
            below[k] = xb < xa
            held[i] += 1
    for i in range(n):
        order = np.argsort(heights[first[i] : first[i + 1]]) + first[i]
        under = 0
        while under < order.size and heights[order[under]] <= 0.0:
            under += 1
        middle = within[i]
        if under < order.size:
            middle = below[order[under]]
        elif under > 0:
            middle = not below[order[under - 1]]
        for side in range(2):
            # borders on this side, the nearest to the line first, as seen from there
            k, step, sign = (under - 1, -1, 1.0) if side == 0 else (under, 1, -1.0)
            tops[side, i], feet[side, i] = nothing, nothing
            if middle:
                tops[side, i] = 0.0
            elif 0 <= k < order.size:
                tops[side, i] = sign * heights[order[k]]
                k += step
            else:
                continue
            if 0 <= k < order.size:
                feet[side, i] = max(sign * heights[order[k]], nothing)


@numba.njit(cache=True, error_model="numpy")
def overlay(pieces, start, spacing, nothing, tops):
    """Set columns, shape (2, n), to the highest of the pieces over them, (m, 4); where there is none they stay."""
    n = tops.shape[1]
    best = np.full((2, n), nothing)
    for p in range(pieces.shape[0]):
        xa, ya, xb, yb = pieces[p]
        low, high = min(xa, xb), max(xa, xb)
        for i in range(max(math.ceil((low - start) / spacing), 0), min(math.floor((high - start) / spacing) + 1, n)):
            y = ya + (yb - ya) * ((start + i * spacing - xa) / (xb - xa) if xb != xa else 0.0)
            side = 0 if y < 0.0 else 1
            best[side, i] = max(best[side, i], -abs(y))
    for side in range(2):
        for i in range(n):
            if best[side, i] > nothing:
                tops[side, i] = best[side, i]
