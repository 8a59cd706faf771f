"""Between which heights a tool has material around it, and where it stands in a thin layer; arrays and scalars only."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def material_ahead(seg, count, lattice, tip, outline, edge):
    """Return between which heights above its tip an upright tool has material within a cell of its edges.

    Thin chips stand between the lines: what is beside them tells of them. Where there is none, the first height is above the second.
    """
    origin, cell = lattice[0], lattice[1]
    beside = max(cell[0], cell[1])
    radius = 0.0
    for p in range(outline.shape[1]):
        radius = max(radius, outline[1, p])
    radius += beside
    low, high = np.inf, -np.inf
    first = max(math.ceil((tip[0] - radius - origin[0]) / cell[0]), 0)
    last = min(math.floor((tip[0] + radius - origin[0]) / cell[0]), seg.shape[0] - 1)
    begin = max(math.ceil((tip[1] - radius - origin[1]) / cell[1]), 0)
    end = min(math.floor((tip[1] + radius - origin[1]) / cell[1]), seg.shape[1] - 1)
    for m in range(first, last + 1):
        for n in range(begin, end + 1):
            away = math.sqrt((origin[0] + m * cell[0] - tip[0]) ** 2 + (origin[1] + n * cell[1] - tip[1]) ** 2)
            if away >= radius:
                continue
            away = max(away - beside, 0.0)
            for s in range(count[m, n]):
                start, stop = max(seg[m, n, s, 0] - tip[2], 0.0), min(seg[m, n, s, 1] - tip[2], edge)
                # what the range holds already needs no look at the outline
                if stop <= start or (start >= low and stop <= high):
                    continue
                for p in range(outline.shape[1] - 1):
                    z0, z1, r0, r1 = outline[0, p], outline[0, p + 1], outline[1, p], outline[1, p + 1]
                    # where this piece of the outline is wider than the line is away
                    if r0 <= away and r1 <= away:
                        continue
                    if r0 < away:
                        z0 += (z1 - z0) * (away - r0) / (r1 - r0)
                    elif r1 < away:
                        z1 -= (z1 - z0) * (away - r1) / (r0 - r1)
                    if min(z1, stop) > max(z0, start):
                        low, high = min(low, max(z0, start)), max(high, min(z1, stop))
    return low, high


@numba.njit(cache=True)
def layer_arcs(seg, count, lattice, centre, radius, feed, arcs):
    """Find the arcs of an upright tool's circle in front of which the lines along z have material; return how many.

    No line along x or y tells where such a layer ends beside. Each line along z that the circle meets within its next cell and a half of
    way stands for the angle at which it meets it, so that an arc is known to half of what lies between two lines across the feed.

    Parameters
    ----------
    seg : array (m, n, room, 2)
    count : array of int (m, n)
    lattice : array (2, 3)
    centre : array (3,)
        Of the circle, in the middle of the layer.
    radius : float
    feed : array (2,)
        Direction of the move across the axis, of length 1.
    arcs : array (m, 2)
    """
    origin, cell = lattice[0], lattice[1]
    wide = max(cell[0], cell[1])
    reach = 1.5 * wide
    first = max(math.ceil((centre[0] - radius - reach - origin[0]) / cell[0]), 0)
    last = min(math.floor((centre[0] + radius + reach - origin[0]) / cell[0]), seg.shape[0] - 1)
    begin = max(math.ceil((centre[1] - radius - reach - origin[1]) / cell[1]), 0)
    end = min(math.floor((centre[1] + radius + reach - origin[1]) / cell[1]), seg.shape[1] - 1)
    most = max(last - first + 1, 0) * max(end - begin + 1, 0)
    angle, inside, held = np.empty(most), np.empty(most, dtype=np.bool_), 0
    for m in range(first, last + 1):
        for n in range(begin, end + 1):
            x, y = origin[0] + m * cell[0] - centre[0], origin[1] + n * cell[1] - centre[1]
            along, across = x * feed[0] + y * feed[1], y * feed[0] - x * feed[1]
            if abs(across) >= radius:
                continue
            way = along - math.sqrt(radius * radius - across * across)
            if not 0.0 < way <= reach:
                continue
            angle[held], inside[held] = math.acos(across / radius), False
            for k in range(count[m, n]):
                inside[held] |= seg[m, n, k, 0] < centre[2] < seg[m, n, k, 1]
            held += 1
    order = np.argsort(angle[:held])
    angle, inside = angle[order], inside[order]
    found = 0
    for k in range(held):
        if not inside[k]:
            continue
        start = 0.5 * (angle[k - 1] + angle[k]) if k else 0.0
        stop = 0.5 * (angle[k] + angle[k + 1]) if k + 1 < held else math.pi
        # lines farther ahead say where a wall is a little earlier or later: what is nearer than a cell is one arc
        gap = wide / (radius * max(math.sin(start), 0.2))
        if found and start - arcs[found - 1, 1] < gap:
            arcs[found - 1, 1] = stop
        elif found < arcs.shape[0]:
            arcs[found, 0], arcs[found, 1] = start, stop
            found += 1
    return found
