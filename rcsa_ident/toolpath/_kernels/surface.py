"""Triangles into lines of material, lines of material into a surface, and the volume inside it; arrays and scalars only."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def _left_of(points, one, two, p, q, m, n):
    """Whether an edge is met by the ray from (m, n) along the first direction; the same for both triangles that share the edge."""
    if (points[one, q] > n) == (points[two, q] > n):
        return False
    # begin with the same end whichever triangle asks, so that rounding is the same
    if points[one, q] > points[two, q]:
        one, two = two, one
    share = (n - points[one, q]) / (points[two, q] - points[one, q])
    return m < points[one, p] + share * (points[two, p] - points[one, p])


@numba.njit(cache=True)
def crossings(points, faces, axes, origin, cell, shape, start, place, sense):
    """Find where the triangles of a closed surface cross the lines of a grid; return how many crossings there are.

    Parameters
    ----------
    points : array (v, 3)
    faces : array of int (f, 3)
        Counterclockwise from outside.
    axes : array of int (3,)
        Along which the lines lie, and the axes of the grid's two indices.
    origin, cell : arrays (3,)
    shape : array of int (3,)
    start : array of int (lines + 1,)
        Where the crossings of each line begin; of a first call, with an empty `place`, their numbers come out at 1 + line.
    place : array (c,)
    sense : array of int (c,)
        1 where the line goes into the material, -1 where it comes out.
    """
    along, p, q = axes[0], axes[1], axes[2]
    filled = 0
    here = start.copy()
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        low_p, high_p = min(points[a, p], points[b, p], points[c, p]), max(points[a, p], points[b, p], points[c, p])
        low_q, high_q = min(points[a, q], points[b, q], points[c, q]), max(points[a, q], points[b, q], points[c, q])
        up, uq = points[b, p] - points[a, p], points[b, q] - points[a, q]
        vp, vq = points[c, p] - points[a, p], points[c, q] - points[a, q]
        area = up * vq - uq * vp
        if area == 0.0:
            continue
        # (p, q) are as (x, y) seen against `along` where the three axes are in cyclic order
        turned = 1 if (p - along) % 3 == 1 else -1
        into = -1 if (area > 0.0) == (turned == 1) else 1
        first_m = max(math.ceil((low_p - origin[p]) / cell[p]), 0)
        last_m = min(math.floor((high_p - origin[p]) / cell[p]), shape[p] - 1)
        first_n = max(math.ceil((low_q - origin[q]) / cell[q]), 0)
        last_n = min(math.floor((high_q - origin[q]) / cell[q]), shape[q] - 1)
        for m in range(first_m, last_m + 1):
            x = origin[p] + m * cell[p]
            for n in range(first_n, last_n + 1):
                y = origin[q] + n * cell[q]
                inside = _left_of(points, a, b, p, q, x, y)
                inside ^= _left_of(points, b, c, p, q, x, y)
                inside ^= _left_of(points, c, a, p, q, x, y)
                if not inside:
                    continue
                line = m * shape[q] + n
                filled += 1
                if place.size == 0:
                    start[line + 1] += 1
                    continue
                s = ((x - points[a, p]) * vq - (y - points[a, q]) * vp) / area
                t = ((y - points[a, q]) * up - (x - points[a, p]) * uq) / area
                height = points[a, along] + s * (points[b, along] - points[a, along]) + t * (points[c, along] - points[a, along])
                k = here[line]
                # few on a line: they are put in order as they come
                while k > start[line] and place[k - 1] > height:
                    place[k], sense[k] = place[k - 1], sense[k - 1]
                    k -= 1
                place[k], sense[k] = height, into
                here[line] += 1
    return filled


@numba.njit(cache=True)
def segments_between(start, place, sense, seg, count):
    """Fill the segments of a grid from its crossings, material where more go in than come out; return the most that a line has."""
    most = 0
    columns = count.shape[1]
    for line in range(start.size - 1):
        m, n, depth, held, begin = line // columns, line % columns, 0, 0, 0.0
        for k in range(start[line], start[line + 1]):
            before, depth = depth, depth + sense[k]
            if before <= 0 < depth:
                begin = place[k]
            elif depth <= 0 < before and place[k] > begin:
                if held < seg.shape[2]:
                    seg[m, n, held, 0], seg[m, n, held, 1] = begin, place[k]
                held += 1
        count[m, n] = min(held, seg.shape[2])
        most = max(most, held)
    return most


@numba.njit(cache=True)
def occupied(seg, count, origin, cell, every, filled):
    """Mark the nodes that lie in the material of the lines along z, in an array (nx + 2, ny + 2, nz + 2) with a rim of none."""
    for m in range(filled.shape[0] - 2):
        for n in range(filled.shape[1] - 2):
            for k in range(count[m * every, n * every]):
                first = max(math.ceil((seg[m * every, n * every, k, 0] - origin) / (cell * every)), 0)
                last = min(math.floor((seg[m * every, n * every, k, 1] - origin) / (cell * every)), filled.shape[2] - 3)
                for z in range(first, last + 1):
                    filled[m + 1, n + 1, z + 1] = True


@numba.njit(cache=True)
def _to_nearest_end(seg, count, m, n, which, place):
    """Way from a place to the nearest end of this sense on a line; infinite where the line is not there or has none."""
    found = np.inf
    if 0 <= m < seg.shape[0] and 0 <= n < seg.shape[1]:
        for k in range(count[m, n]):
            way = seg[m, n, k, which] - place
            if abs(way) < abs(found):
                found = way
    return found


@numba.njit(cache=True)
def _slopes(seg, count, m, n, which, place, cell_one, cell_two):
    """Slopes of the surface at an end of a line, towards the lines beside along both indices of the grid; infinite where there are none.

    They are the mean of both sides where the surface is smooth, and that of the flatter side where it has an edge.
    """
    found = (0.0, 0.0)
    for index in range(2):
        one = 1 - index
        before = _to_nearest_end(seg, count, m - one, n - index, which, place)
        behind = _to_nearest_end(seg, count, m + one, n + index, which, place)
        cell = cell_one if index == 0 else cell_two
        if abs(abs(before) - abs(behind)) <= 0.5 * cell:
            slope = 0.5 * (behind - before) / cell
        else:
            slope = (-before if abs(before) < abs(behind) else behind) / cell
        found = (slope, found[1]) if index == 0 else (found[0], slope)
    return found


@numba.njit(cache=True)
def _between(seg, count, m, n, low, high, which):
    """Where the material of a line begins (0) or ends (1) between two places; half way where its grid knows of nothing."""
    if 0 <= m < seg.shape[0] and 0 <= n < seg.shape[1]:
        for k in range(count[m, n]):
            if low <= seg[m, n, k, which] <= high:
                return seg[m, n, k, which]
    return 0.5 * (low + high)


@numba.njit(cache=True)
def _nearest_to_planes(square, right, mean, low, step, vertex):
    """Find the point nearest to planes n . (x - p) = 0, by the sums of n n^T and n (n . (p - mean)); what they leave open is the mean's."""
    for a in range(3):
        square[a, a] += 0.05
    one, two, three = square[0], square[1], square[2]
    first, second, third = np.empty(3), np.empty(3), np.empty(3)
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        first[a] = two[b] * three[c] - two[c] * three[b]
        second[a] = three[b] * one[c] - three[c] * one[b]
        third[a] = one[b] * two[c] - one[c] * two[b]
    determinant = one[0] * first[0] + one[1] * first[1] + one[2] * first[2]
    for a in range(3):
        moved = mean[a] + (first[a] * right[0] + second[a] * right[1] + third[a] * right[2]) / determinant
        vertex[a] = min(max(moved, low[a]), low[a] + step[a])


@numba.njit(cache=True)
def surface_net(segs, counts, lattice, every, filled, vertices, faces):
    """Find the surface between nodes inside and outside the material; return how many vertices and triangles it has.

    Each cube of eight nodes that are not alike has a vertex, nearest to the planes in which its edges leave the material [ju2002], and each
    edge that leaves it a quadrangle between the vertices of the four cubes around it. A first call with no room in `vertices` and `faces`
    counts.

    Parameters
    ----------
    segs, counts : tuples of three arrays
    lattice : array (2, 3)
    every : int
        Nodes are every so many lines apart.
    filled : array of bool (nx + 2, ny + 2, nz + 2)
    vertices : array (v, 3)
    faces : array of int (f, 3)
    """
    nx, ny, nz = filled.shape
    # vertex of each cube in the layer below and in this one
    below, here = np.full((ny, nz), -1, dtype=np.int64), np.full((ny, nz), -1, dtype=np.int64)
    points, triangles = 0, 0
    write = vertices.shape[0] > 0
    step = every * lattice[1]
    corner, mean, node = np.empty(3), np.empty(3), np.empty(3, dtype=np.int64)
    points_of, normals, square, right = np.empty((12, 3)), np.empty((12, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(nx - 1):
        below, here = here, below
        here[:] = -1
        for j in range(ny - 1):
            for k in range(nz - 1):
                total = 0
                for c in range(8):
                    total += filled[i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2)]
                if total == 0 or total == 8:
                    continue
                here[j, k] = points
                points += 1
                if not write:
                    continue
                mean[:], edges = 0.0, 0
                for a in range(3):
                    corner[a] = lattice[0, a] + ((i, j, k)[a] - 1) * step[a]
                for a in range(3):
                    b, d = (2, 1) if a == 0 else ((2, 0) if a == 1 else (0, 1))
                    for s in range(4):
                        node[0], node[1], node[2] = i, j, k
                        node[b] += s & 1
                        node[d] += s >> 1
                        inside = filled[node[0], node[1], node[2]]
                        node[a] += 1
                        if inside == filled[node[0], node[1], node[2]]:
                            continue
                        m, n, which = (node[b] - 1) * every, (node[d] - 1) * every, 1 if inside else 0
                        point = points_of[edges]
                        for c in range(3):
                            point[c] = lattice[0, c] + (node[c] - 1) * step[c]
                        point[a] = _between(segs[a], counts[a], m, n, corner[a], corner[a] + step[a], which)
                        mean += point
                        normal = normals[edges]
                        slopes = _slopes(segs[a], counts[a], m, n, which, point[a], lattice[1, b], lattice[1, d])
                        size = math.sqrt(1.0 + slopes[0] ** 2 + slopes[1] ** 2)
                        # a surface that no line beside knows has no direction
                        normal[:] = 0.0
                        if size < 1e6:
                            normal[a], normal[b], normal[d] = 1.0 / size, -slopes[0] / size, -slopes[1] / size
                        edges += 1
                mean /= edges
                square[:], right[:] = 0.0, 0.0
                for e in range(edges):
                    off = np.dot(normals[e], points_of[e] - mean)
                    for c in range(3):
                        right[c] += normals[e, c] * off
                        for f in range(3):
                            square[c, f] += normals[e, c] * normals[e, f]
                _nearest_to_planes(square, right, mean, corner, step, vertices[here[j, k]])
        for j in range(ny - 1):
            for k in range(nz - 1):
                # the edges of three directions from the node (i, j, k), inside the lattice: four cubes around each
                inside = filled[i, j, k]
                for a in range(3):
                    if a == 0:
                        if j == 0 or k == 0 or inside == filled[i + 1, j, k]:
                            continue
                        ring = (here[j - 1, k - 1], here[j, k - 1], here[j, k], here[j - 1, k])
                    elif a == 1:
                        if i == 0 or k == 0 or inside == filled[i, j + 1, k]:
                            continue
                        ring = (below[j, k - 1], below[j, k], here[j, k], here[j, k - 1])
                    else:
                        if i == 0 or j == 0 or inside == filled[i, j, k + 1]:
                            continue
                        ring = (below[j - 1, k], here[j - 1, k], here[j, k], below[j, k])
                    if write:
                        one, two = (1, 3) if inside else (3, 1)
                        faces[triangles, 0], faces[triangles, 1], faces[triangles, 2] = ring[0], ring[one], ring[2]
                        faces[triangles + 1, 0], faces[triangles + 1, 1], faces[triangles + 1, 2] = ring[0], ring[2], ring[two]
                    triangles += 2
    return points, triangles


@numba.njit(cache=True)
def nodes_and_rest(seg, count, origin, cell, cell_one, cell_two):
    """Return how many nodes lie in the material of a grid, and what the surface encloses beside their cells, in cells.

    What lies between a line's last node in the material and its end is known exactly, less the half of a cell that counts with the node.
    Each part of the surface is seen by all grids; how much each grid's word counts is the square of the cosine between its lines and the
    surface's normal, which the ends of the lines beside tell. The three words together have the weight 1.
    """
    nodes, rest = 0, 0.0
    for m in range(seg.shape[0]):
        for n in range(seg.shape[1]):
            for k in range(count[m, n]):
                low, high = (seg[m, n, k, 0] - origin) / cell, (seg[m, n, k, 1] - origin) / cell
                first, last = math.ceil(low), math.floor(high)
                nodes += int(last - first) + 1
                for which in range(2):
                    beyond = (high - last if which == 1 else first - low) - 0.5
                    place = seg[m, n, k, which]
                    one, two = _slopes(seg, count, m, n, which, place, cell_one, cell_two)
                    rest += beyond / (1.0 + one * one + two * two)
    return nodes, rest


@numba.njit(cache=True, error_model="numpy")
def _beside(x, y, one, two):
    """Square of the distance, seen from above, between a point and the move from one place to another."""
    dx, dy = two[0] - one[0], two[1] - one[1]
    length = dx * dx + dy * dy
    share = min(max(((x - one[0]) * dx + (y - one[1]) * dy) / length, 0.0), 1.0) if length > 0.0 else 0.0
    return (x - one[0] - share * dx) ** 2 + (y - one[1] - share * dy) ** 2


@numba.njit(cache=True, error_model="numpy")
def moves_by_square(places, moves, reach, low, side, shape, start, held):
    """Sort moves into the squares, seen from above, that hold a point within `reach` of them.

    Parameters
    ----------
    places : array (k, 3)
        Move m goes from m to m + 1.
    moves : array of int (n,)
        Ascending; those of a square stay so.
    low : array (2,)
        Corner of the first square.
    shape : array of int (2,)
    start : array of int (squares + 1,)
        Where the moves of each square begin; of a first call, with an empty `held`, their numbers come out at 1 + square.
    held : array of int (h,)
    """
    # a little more than half of a square's diagonal, and than the tool reaches, so that no rounding leaves a move out
    wide, half = reach + 1e-4 * side, 0.70711 * side
    room = start.copy()
    for m in moves:
        one, two = places[m], places[m + 1]
        first_x = max(0, math.floor((min(one[0], two[0]) - wide - low[0]) / side))
        first_y = max(0, math.floor((min(one[1], two[1]) - wide - low[1]) / side))
        last_x = min(shape[0] - 1, math.floor((max(one[0], two[0]) + wide - low[0]) / side))
        last_y = min(shape[1] - 1, math.floor((max(one[1], two[1]) + wide - low[1]) / side))
        for i in range(first_x, last_x + 1):
            for j in range(first_y, last_y + 1):
                if _beside(low[0] + (i + 0.5) * side, low[1] + (j + 0.5) * side, one, two) <= (wide + half) ** 2:
                    square = i * shape[1] + j
                    if held.size:
                        held[room[square]] = m
                        room[square] += 1
                    else:
                        start[square + 1] += 1


@numba.njit(cache=True, error_model="numpy")
def last_move(points, places, reach, below, low, side, shape, start, held, out):
    """Fill the last move whose upright tool came as near to each point as `reach` beside its axis, and no higher than `below`.

    points: (v, 3); the moves are `held` by the squares that the points lie in, as `moves_by_square` sorts them; out: (v,) kept where
    there is none.
    """
    for p in range(points.shape[0]):
        x, y, z = points[p]
        i, j = min(int((x - low[0]) / side), shape[0] - 1), min(int((y - low[1]) / side), shape[1] - 1)
        square = i * shape[1] + j
        for n in range(start[square + 1] - 1, start[square] - 1, -1):
            one, two = places[held[n]], places[held[n] + 1]
            if z >= min(one[2], two[2]) - below and _beside(x, y, one, two) <= reach * reach:
                out[p] = held[n]
                break
