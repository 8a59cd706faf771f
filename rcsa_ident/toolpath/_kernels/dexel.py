"""Lines of material that a moving tool shortens; arrays and scalars only.

A grid is ``seg[m, n, room, 2]``, where the segments of each line begin and end, in order, and ``count[m, n]``, how many there are. Lines
along x stand by (z, y), along y by (z, x), along z by (x, y); they go through the nodes of one lattice, ``origin + index * cell``.

A tool's outline is ``outline[2, p]``: heights above the tip, which never fall, and the radius at each.
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def cut(seg, count, m, n, low, high):
    """Take what lies between two places out of a line, and return the length that is taken; -1 where its segments have no room."""
    held = count[m, n]
    first = 0
    while first < held and seg[m, n, first, 1] <= low:
        first += 1
    if first == held or seg[m, n, first, 0] >= high:
        return 0.0
    taken = 0.0
    if seg[m, n, first, 0] < low:
        end = seg[m, n, first, 1]
        if end > high:
            if held == seg.shape[2]:
                return -1.0
            for k in range(held, first + 1, -1):
                seg[m, n, k, 0], seg[m, n, k, 1] = seg[m, n, k - 1, 0], seg[m, n, k - 1, 1]
            seg[m, n, first + 1, 0], seg[m, n, first + 1, 1] = high, end
            seg[m, n, first, 1] = low
            count[m, n] = held + 1
            return high - low
        seg[m, n, first, 1] = low
        taken += end - low
        first += 1
    last = first
    while last < held and seg[m, n, last, 1] <= high:
        taken += seg[m, n, last, 1] - seg[m, n, last, 0]
        last += 1
    if last < held and seg[m, n, last, 0] < high:
        taken += high - seg[m, n, last, 0]
        seg[m, n, last, 0] = high
    if last > first:
        for k in range(last, held):
            seg[m, n, k - last + first, 0], seg[m, n, k - last + first, 1] = seg[m, n, k, 0], seg[m, n, k, 1]
        count[m, n] = held - last + first
    return taken


@numba.njit(cache=True)
def radius_at(outline, height):
    """Return the radius at a height above the tip; below zero where the tool does not reach."""
    last = outline.shape[1] - 1
    if height < 0.0 or height > outline[0, last]:
        return -1.0
    a, b = 0, last
    while b - a > 1:
        middle = (a + b) // 2
        if outline[0, middle] <= height:
            a = middle
        else:
            b = middle
    rise = outline[0, b] - outline[0, a]
    if rise <= 0.0:
        return max(outline[1, a], outline[1, b])
    return outline[1, a] + (outline[1, b] - outline[1, a]) * (height - outline[0, a]) / rise


@numba.njit(cache=True)
def widest_between(outline, low, high):
    """Return the largest radius between two heights above the tip; below zero where the tool does not reach."""
    low, high = max(low, 0.0), min(high, outline[0, -1])
    if low > high:
        return -1.0
    found = radius_at(outline, low)
    if high > low:
        found = max(found, radius_at(outline, high))
        for k in range(outline.shape[1]):
            if low < outline[0, k] < high:
                found = max(found, outline[1, k])
    return found


@numba.njit(cache=True)
def span_at(outline, peak, radius):
    """Return between which heights the tool is wider than a radius; its outline rises to its peak and falls behind it.

    Parameters
    ----------
    peak : int
        The last point of the outline that has its largest radius.
    """
    last = outline.shape[1] - 1
    low = outline[0, 0]
    if radius > outline[1, 0]:
        a, b = 0, peak
        while b - a > 1:
            middle = (a + b) // 2
            if outline[1, middle] < radius:
                a = middle
            else:
                b = middle
        low = outline[0, a] + (outline[0, b] - outline[0, a]) * (radius - outline[1, a]) / (outline[1, b] - outline[1, a])
    if radius <= outline[1, last]:
        return low, outline[0, last]
    a, b = peak, last
    while b - a > 1:
        middle = (a + b) // 2
        if outline[1, middle] >= radius:
            a = middle
        else:
            b = middle
    return low, outline[0, a] + (outline[0, b] - outline[0, a]) * (outline[1, a] - radius) / (outline[1, a] - outline[1, b])


@numba.njit(cache=True)
def capsule_on_line(a0, o0, a1, o1, radius, o):
    """Return between which places of a line (o, along a) a disc has been that went from (a0, o0) to (a1, o1): a stadium."""
    low, high = np.inf, -np.inf
    for a, other in ((a0, o0), (a1, o1)):
        half = radius * radius - (o - other) ** 2
        if half > 0.0:
            half = math.sqrt(half)
            low, high = min(low, a - half), max(high, a + half)
    da, do = a1 - a0, o1 - o0
    length = math.sqrt(da * da + do * do)
    if length == 0.0:
        return low, high
    # between the discs: 0 <= (p - p0) . d <= length and |(p - p0) . n| <= radius
    da, do = da / length, do / length
    start, end = -np.inf, np.inf
    for slope, shift, least, most in ((da, (o - o0) * do, 0.0, length), (-do, (o - o0) * da, -radius, radius)):
        if slope != 0.0:
            one, two = a0 + (least - shift) / slope, a0 + (most - shift) / slope
            start, end = max(start, min(one, two)), min(end, max(one, two))
        elif not least <= shift <= most:
            return low, high
    if end > start:
        low, high = min(low, start), max(high, end)
    return low, high


@numba.njit(cache=True)
def _cut_across(seg, count, along, lattice, move, outline, been, told):
    """Shorten the lines along x or y by an upright tool on a level or a vertical move; return whether all had room.

    `been` says that the tool has cut where the move begins: lines that it meets no farther than there are left alone.
    """
    other = 1 - along
    origin, cell = lattice[0], lattice[1]
    bottom, top = min(move[0, 2], move[1, 2]), max(move[0, 2], move[1, 2])
    first = max(math.ceil((bottom - origin[2]) / cell[2]), 0)
    last = min(math.floor((top + outline[0, -1] - origin[2]) / cell[2]), seg.shape[0] - 1)
    left, right = min(move[0, other], move[1, other]), max(move[0, other], move[1, other])
    low, high = np.empty(seg.shape[1]), np.empty(seg.shape[1])
    begin, end, known = 0, -1, -1.0
    for k in range(first, last + 1):
        z = origin[2] + k * cell[2]
        radius = widest_between(outline, z - top, z - bottom)
        if radius <= 0.0:
            continue
        if radius != known:
            # a cylinder is the same in all planes
            known = radius
            begin = max(math.ceil((left - radius - origin[other]) / cell[other]), 0)
            end = min(math.floor((right + radius - origin[other]) / cell[other]), seg.shape[1] - 1)
            for n in range(begin, end + 1):
                o = origin[other] + n * cell[other]
                low[n], high[n] = capsule_on_line(move[0, along], move[0, other], move[1, along], move[1, other], radius, o)
                if been:
                    half = radius * radius - (o - move[0, other]) ** 2
                    half = math.sqrt(half) if half > 0.0 else -1.0
                    if half > 0.0 and move[0, along] - half <= low[n] and move[0, along] + half >= high[n]:
                        high[n] = -np.inf
        for n in range(begin, end + 1):
            if high[n] > low[n]:
                taken = cut(seg, count, k, n, low[n], high[n])
                if taken < 0.0:
                    return False
                told[along] += taken
                told[3] += 1.0
    return True


@numba.njit(cache=True)
def _cut_down(seg, count, lattice, move, outline, peak, been, told):
    """Shorten the lines along z by an upright tool on a level or a vertical move; return whether all had room.

    `been` says that the tool has cut where the move begins: what is nearest to the beginning needs no second cut.
    """
    origin, cell = lattice[0], lattice[1]
    bottom, top = min(move[0, 2], move[1, 2]), max(move[0, 2], move[1, 2])
    radius = outline[1, peak]
    x0, y0, dx, dy = move[0, 0], move[0, 1], move[1, 0] - move[0, 0], move[1, 1] - move[0, 1]
    square = dx * dx + dy * dy
    known = been and top == bottom
    floor = outline[1, 0]
    begin = max(math.ceil((min(x0, x0 + dx) - radius - origin[0]) / cell[0]), 0)
    end = min(math.floor((max(x0, x0 + dx) + radius - origin[0]) / cell[0]), seg.shape[0] - 1)
    for m in range(begin, end + 1):
        x = origin[0] + m * cell[0]
        low, high = capsule_on_line(y0, x0, y0 + dy, x0 + dx, radius, x)
        first = max(math.ceil((low - origin[1]) / cell[1]), 0) if high > low else 0
        last = min(math.floor((high - origin[1]) / cell[1]), seg.shape[1] - 1) if high > low else -1
        for n in range(first, last + 1):
            y = origin[1] + n * cell[1]
            way = (x - x0) * dx + (y - y0) * dy
            if known and (way <= 0.0 or (x - x0) ** 2 + (y - y0) ** 2 <= floor * floor):
                continue
            share = min(max(way / square, 0.0), 1.0) if square > 0.0 else 0.0
            distance = math.sqrt((x - x0 - share * dx) ** 2 + (y - y0 - share * dy) ** 2)
            if distance >= radius:
                continue
            lower, upper = span_at(outline, peak, distance)
            taken = cut(seg, count, m, n, bottom + lower, top + upper)
            if taken < 0.0:
                return False
            told[2] += taken
            told[3] += 1.0
    return True


@numba.njit(cache=True)
def cone_on_line(a0, o0, r0, a1, o1, r1, o):
    """Return between which places of a line (o, along a) a disc has been that grew evenly on its way: the hull of two discs."""
    low, high = np.inf, -np.inf
    for a, other, radius in ((a0, o0, r0), (a1, o1, r1)):
        half = radius * radius - (o - other) ** 2
        if half > 0.0:
            half = math.sqrt(half)
            low, high = min(low, a - half), max(high, a + half)
    da, do, growth = a1 - a0, o1 - o0, r1 - r0
    square = da * da + do * do
    if square <= growth * growth:
        return low, high
    # the discs' common tangents touch them at c + r n, where n . (c1 - c0) = -growth, on either side
    cosine, length = -growth / math.sqrt(square), math.sqrt(square)
    sine = math.sqrt(1.0 - cosine * cosine)
    ua, uo = da / length, do / length
    for side in (-1.0, 1.0):
        na, no = cosine * ua - side * sine * uo, cosine * uo + side * sine * ua
        one_o, two_o = o0 + r0 * no, o1 + r1 * no
        if min(one_o, two_o) <= o <= max(one_o, two_o) and one_o != two_o:
            share = (o - one_o) / (two_o - one_o)
            place = a0 + r0 * na + share * (a1 + r1 * na - a0 - r0 * na)
            low, high = min(low, place), max(high, place)
    return low, high


@numba.njit(cache=True)
def _ramp_across(seg, count, along, lattice, move, outline, told):
    """Shorten the lines along x or y by an upright tool on a ramp; return whether all had room.

    In each plane across the axis a disc moves that is as wide as the outline at the height that just passes: piece by piece of the outline
    it grows evenly.
    """
    other = 1 - along
    origin, cell = lattice[0], lattice[1]
    begin_z, rise = move[0, 2], move[1, 2] - move[0, 2]
    bottom, top = min(move[0, 2], move[1, 2]), max(move[0, 2], move[1, 2])
    first = max(math.ceil((bottom - origin[2]) / cell[2]), 0)
    last = min(math.floor((top + outline[0, -1] - origin[2]) / cell[2]), seg.shape[0] - 1)
    wa, wo = move[1, along] - move[0, along], move[1, other] - move[0, other]
    for k in range(first, last + 1):
        z = origin[2] + k * cell[2]
        lowest, highest = max(z - top, 0.0), min(z - bottom, outline[0, -1])
        widest = widest_between(outline, lowest, highest)
        if widest <= 0.0:
            continue
        left, right = min(move[0, other], move[1, other]), max(move[0, other], move[1, other])
        begin = max(math.ceil((left - widest - origin[other]) / cell[other]), 0)
        end = min(math.floor((right + widest - origin[other]) / cell[other]), seg.shape[1] - 1)
        for n in range(begin, end + 1):
            o = origin[other] + n * cell[other]
            low, high = np.inf, -np.inf
            for p in range(outline.shape[1] - 1):
                h0, h1 = max(outline[0, p], lowest), min(outline[0, p + 1], highest)
                if h1 < h0 or outline[0, p + 1] <= outline[0, p]:
                    continue
                slope = (outline[1, p + 1] - outline[1, p]) / (outline[0, p + 1] - outline[0, p])
                r0, r1 = outline[1, p] + slope * (h0 - outline[0, p]), outline[1, p] + slope * (h1 - outline[0, p])
                t0, t1 = (z - h0 - begin_z) / rise, (z - h1 - begin_z) / rise
                one, two = cone_on_line(
                    move[0, along] + t0 * wa, move[0, other] + t0 * wo, r0, move[0, along] + t1 * wa, move[0, other] + t1 * wo, r1, o
                )
                low, high = min(low, one), max(high, two)
            if high > low:
                taken = cut(seg, count, k, n, low, high)
                if taken < 0.0:
                    return False
                told[along] += taken
                told[3] += 1.0
    return True


@numba.njit(cache=True)
def _ramp_down(seg, count, lattice, move, outline, peak, told):
    """Shorten the lines along z by an upright convex tool on a ramp; return whether all had room."""
    origin, cell = lattice[0], lattice[1]
    radius, length = outline[1, peak], outline[0, -1]
    x0, y0, z0 = move[0, 0], move[0, 1], move[0, 2]
    dx, dy, dz = move[1, 0] - x0, move[1, 1] - y0, move[1, 2] - z0
    square = dx * dx + dy * dy
    begin = max(math.ceil((min(x0, x0 + dx) - radius - origin[0]) / cell[0]), 0)
    end = min(math.floor((max(x0, x0 + dx) + radius - origin[0]) / cell[0]), seg.shape[0] - 1)
    for m in range(begin, end + 1):
        x = origin[0] + m * cell[0]
        low, high = capsule_on_line(y0, x0, y0 + dy, x0 + dx, radius, x)
        first = max(math.ceil((low - origin[1]) / cell[1]), 0) if high > low else 0
        last = min(math.floor((high - origin[1]) / cell[1]), seg.shape[1] - 1) if high > low else -1
        for n in range(first, last + 1):
            y = origin[1] + n * cell[1]
            # the shares of the way between which the line is below or above the tool
            middle = ((x - x0) * dx + (y - y0) * dy) / square
            beside = (x - x0 - middle * dx) ** 2 + (y - y0 - middle * dy) ** 2
            if beside >= radius * radius:
                continue
            half = math.sqrt((radius * radius - beside) / square)
            one, two = max(middle - half, 0.0), min(middle + half, 1.0)
            if two <= one:
                continue
            upper = z0 + max(one * dz, two * dz) + length
            # how low the tool gets there is a convex function of the share
            golden = 0.6180339887498949
            while two - one > 1e-7:
                a, b = two - golden * (two - one), one + golden * (two - one)
                low_a, _ = span_at(outline, peak, min(math.sqrt(beside + (a - middle) ** 2 * square), radius))
                low_b, _ = span_at(outline, peak, min(math.sqrt(beside + (b - middle) ** 2 * square), radius))
                if low_a + a * dz <= low_b + b * dz:
                    two = b
                else:
                    one = a
            share = 0.5 * (one + two)
            lower, _ = span_at(outline, peak, min(math.sqrt(beside + (share - middle) ** 2 * square), radius))
            taken = cut(seg, count, m, n, z0 + lower + share * dz, upper)
            if taken < 0.0:
                return False
            told[2] += taken
            told[3] += 1.0
    return True


@numba.njit(cache=True)
def sweep_upright(segs, counts, lattice, places, moves, outline, peak, been, told):
    """Take out what an upright tool sweeps on straight moves, and return how many of them are done: all, or those before a lack of room.

    Parameters
    ----------
    segs, counts : tuples of three arrays
        The grids along x, y, z; shortened in place.
    lattice : array (2, 3)
        Origin and cell.
    places : array (k, 3)
        Of the tip; move i goes from place i to place i + 1.
    moves : array of int (2,)
        The first move and the one behind the last.
    outline : array (2, p)
        Its radius rises to one peak and falls behind it; where there are ramps, the tool is convex.
    peak : int
    been : bool
        Whether the tool has cut where the first move begins.
    told : array (k - 1, 4)
        Lengths taken along x, y, z and lines met, added to for each move.

    Notes
    -----
    In a plane across the axis a disc sweeps a stadium, or on a ramp a row of hulls of two discs; along the axis each line is cut by
    the part of the tool that gets lowest.
    """
    for i in range(moves[0], moves[1]):
        move = places[i : i + 2]
        level = move[0, 2] == move[1, 2]
        if level or (move[0, 0] == move[1, 0] and move[0, 1] == move[1, 1]):
            # a place in a tuple that is written as a number would be compiled for each number
            for along in range(2):
                if not _cut_across(segs[along], counts[along], along, lattice, move, outline, been and level, told[i]):
                    return i
            if not _cut_down(segs[2], counts[2], lattice, move, outline, peak, been and level, told[i]):
                return i
        else:
            for along in range(2):
                if not _ramp_across(segs[along], counts[along], along, lattice, move, outline, told[i]):
                    return i
            if not _ramp_down(segs[2], counts[2], lattice, move, outline, peak, told[i]):
                return i
        been = True
    return moves[1]


@numba.njit(cache=True)
def frustum_on_line(x, y, z, dx, dy, dz, z0, r0, z1, r1):
    """Return between which places of a line, from (x, y, z) along (dx, dy, dz), a piece of a cone about z lies."""
    start, end = -np.inf, np.inf
    if dz != 0.0:
        one, two = (z0 - z) / dz, (z1 - z) / dz
        start, end = min(one, two), max(one, two)
    elif not z0 <= z < z1:
        return np.inf, -np.inf
    slope = (r1 - r0) / (z1 - z0)
    radius = r0 + slope * (z - z0)
    a = dx * dx + dy * dy - (slope * dz) ** 2
    b = x * dx + y * dy - radius * slope * dz
    c = x * x + y * y - radius * radius
    if abs(a) < 1e-14:
        if abs(b) < 1e-300:
            return (start, end) if c < 0.0 else (np.inf, -np.inf)
        root = -0.5 * c / b
        return (start, min(end, root)) if b > 0.0 else (max(start, root), end)
    inside = b * b - a * c
    if inside <= 0.0:
        return (start, end) if a < 0.0 else (np.inf, -np.inf)
    inside = math.sqrt(inside)
    one, two = min((-b - inside) / a, (-b + inside) / a), max((-b - inside) / a, (-b + inside) / a)
    if a > 0.0:
        return max(start, one), min(end, two)
    # of the two rays one lies in the other half of the cone, behind its apex
    return (start, min(end, one)) if min(end, one) > start else (max(start, two), end)


@numba.njit(cache=True)
def _tool_on_line(frame, start, outline, along):
    """Return between which places a line lies in a tool, from a point on it beside the tip on; of a tool that is not convex the hull."""
    x = start[0] * frame[0, 0] + start[1] * frame[1, 0] + start[2] * frame[2, 0]
    y = start[0] * frame[0, 1] + start[1] * frame[1, 1] + start[2] * frame[2, 1]
    z = start[0] * frame[0, 2] + start[1] * frame[1, 2] + start[2] * frame[2, 2]
    dx, dy, dz = frame[along, 0], frame[along, 1], frame[along, 2]
    low, high = np.inf, -np.inf
    for k in range(outline.shape[1] - 1):
        if outline[0, k + 1] > outline[0, k]:
            one, two = frustum_on_line(x, y, z, dx, dy, dz, outline[0, k], outline[1, k], outline[0, k + 1], outline[1, k + 1])
            if two > one:
                low, high = min(low, one), max(high, two)
    return low, high


@numba.njit(cache=True)
def cut_leaning(seg, count, axes, lattice, frames, tips, outline, told):
    """Shorten the lines of a grid by a convex tool on a step so short that it hardly turns, and return whether all had room.

    A line that it meets at both ends of the step it meets everywhere between them.

    Parameters
    ----------
    axes : array of int (3,)
        Along which the lines lie, and the axes of the grid's two indices.
    frames : array (2, 3, 3)
        At both ends: two directions across the tool's axis, and the axis, as columns.
    tips : array (2, 3)
    outline : array (2, p)
        Convex, or one of its convex pieces.
    told : array (4,)
    """
    along, one, two = axes[0], axes[1], axes[2]
    origin, cell = lattice[0], lattice[1]
    box = np.empty((2, 2))
    box[:, 0], box[:, 1] = np.inf, -np.inf
    for end in range(2):
        for k in range(outline.shape[1]):
            for s, axis in enumerate((one, two)):
                # a disc reaches as far as its radius times the sine of the angle between its axis and the direction
                middle = tips[end, axis] + outline[0, k] * frames[end, axis, 2]
                reach = outline[1, k] * math.sqrt(max(1.0 - frames[end, axis, 2] ** 2, 0.0))
                box[s, 0], box[s, 1] = min(box[s, 0], middle - reach), max(box[s, 1], middle + reach)
    begin = max(math.ceil((box[0, 0] - origin[one]) / cell[one]), 0)
    end = min(math.floor((box[0, 1] - origin[one]) / cell[one]), seg.shape[0] - 1)
    first = max(math.ceil((box[1, 0] - origin[two]) / cell[two]), 0)
    last = min(math.floor((box[1, 1] - origin[two]) / cell[two]), seg.shape[1] - 1)
    far = 0.0
    for k in range(outline.shape[1]):
        far = max(far, outline[1, k])
    start = np.zeros(3)
    for m in range(begin, end + 1):
        for n in range(first, last + 1):
            if count[m, n] == 0:
                continue
            low, high = np.inf, -np.inf
            for pose in range(2):
                start[along] = -tips[pose, along]
                start[one] = origin[one] + m * cell[one] - tips[pose, one]
                start[two] = origin[two] + n * cell[two] - tips[pose, two]
                # the distance between the line and the tool's axis
                b, d = frames[pose, one, 2], frames[pose, two, 2]
                across = math.sqrt(b * b + d * d)
                if abs(start[one] * d - start[two] * b) < far * across or across < 1e-12:
                    near, away = _tool_on_line(frames[pose], start, outline, along)
                    low, high = min(low, near), max(high, away)
            if high > low:
                taken = cut(seg, count, m, n, low, high)
                if taken < 0.0:
                    return False
                told[along] += taken
                told[3] += 1.0
    return True
