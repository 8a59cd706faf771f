"""Where a tool that is about to move on stands in lines of material; arrays and scalars only.

Grids, lattice and outlines as in ``_dexel_kernels``. Angles are counted from the normal of the feed, towards the feed.
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def radius_and_slope(outline, height):
    """Return the radius at a height above the tip, and by how much it grows with the height; a radius below zero where the tool ends."""
    last = outline.shape[1] - 1
    if height < 0.0 or height > outline[0, last]:
        return -1.0, 0.0
    k = min(max(np.searchsorted(outline[0], height, side="right") - 1, 0), last - 1)
    rise = outline[0, k + 1] - outline[0, k]
    if rise <= 0.0:
        return outline[1, k], 0.0
    slope = (outline[1, k + 1] - outline[1, k]) / rise
    return outline[1, k] + slope * (height - outline[0, k]), slope


@numba.njit(cache=True)
def _holds(seg, count, m, n, place):
    """Whether a line has material at a place."""
    if m < 0 or n < 0 or m >= seg.shape[0] or n >= seg.shape[1]:
        return False
    for k in range(count[m, n]):
        if place < seg[m, n, k, 0]:
            return False
        if place < seg[m, n, k, 1]:
            return True
    return False


@numba.njit(cache=True)
def _wall(segs, counts, lattice, plane, x, y, cut_from, found):
    """Collect the two ends of lines in a plane that are nearest to a point and not on the circle cut last; return how many there are.

    `cut_from` is that circle's centre and radius; `found` takes x, y, and 1 where the line lies along x, of both.
    """
    origin, cell = lattice[0], lattice[1]
    i, j = math.floor((x - origin[0]) / cell[0]), math.floor((y - origin[1]) / cell[1])
    nearest, second, held = np.inf, np.inf, 0
    line, other = -1, -1
    for along in range(2):
        seg, count = segs[along], counts[along]
        base = j if along == 0 else i
        for n in range(max(base - 1, 0), min(base + 3, seg.shape[1])):
            across = origin[1 - along] + n * cell[1 - along]
            for s in range(count[plane, n]):
                for which in range(2):
                    end = seg[plane, n, s, which]
                    ex, ey = (end, across) if along == 0 else (across, end)
                    if math.sqrt((ex - cut_from[0]) ** 2 + (ey - cut_from[1]) ** 2) < cut_from[2] + 1e-8:
                        continue
                    away = math.sqrt((ex - x) ** 2 + (ey - y) ** 2)
                    mark = 2 * n + along
                    if away < nearest:
                        if line != mark:
                            second, other = nearest, line
                            found[1] = found[0]
                        nearest, line = away, mark
                        found[0, 0], found[0, 1], found[0, 2] = ex, ey, 1.0 - along
                    elif away < second and mark != line:
                        second, other = away, mark
                        found[1, 0], found[1, 1], found[1, 2] = ex, ey, 1.0 - along
    far = 3.0 * max(cell[0], cell[1])
    held = (1 if nearest < far else 0) + (1 if second < far and other >= 0 else 0)
    return held


@numba.njit(cache=True)
def _meets(px, py, dx, dy, radius, low, high, frame, slack):
    """Angle between two at which a straight line, from the circle's centre on, crosses the circle; nan where it does not there."""
    square = dx * dx + dy * dy
    if square == 0.0:
        return np.nan
    b = (px * dx + py * dy) / square
    inside = b * b - (px * px + py * py - radius * radius) / square
    if inside < 0.0:
        return np.nan
    best, off = np.nan, slack
    for sign in (-1.0, 1.0):
        t = -b + sign * math.sqrt(inside)
        x, y = px + t * dx, py + t * dy
        angle = math.atan2(x * frame[0, 0] + y * frame[0, 1], x * frame[1, 0] + y * frame[1, 1])
        # the turn that lies nearest to the two
        angle += 2.0 * math.pi * round((0.5 * (low + high) - angle) / (2.0 * math.pi))
        outside = max(low - angle, angle - high, 0.0)
        if outside <= off:
            best, off = min(max(angle, low), high), outside
    return best


@numba.njit(cache=True)
def _border(segs, counts, lattice, plane, circle, cut_from, low, high, frame):
    """Angle between two neighbours on a circle, one of them in the material, at which it leaves the material.

    The wall is a straight line through the two nearest ends of lines on it, or square to the line that has the only one.
    """
    middle = 0.5 * (low + high)
    x = circle[2] * (math.sin(middle) * frame[0, 0] + math.cos(middle) * frame[1, 0])
    y = circle[2] * (math.sin(middle) * frame[0, 1] + math.cos(middle) * frame[1, 1])
    found = np.zeros((2, 3))
    held = _wall(segs, counts, lattice, plane, circle[0] + x, circle[1] + y, cut_from, found)
    px, py = found[0, 0] - circle[0], found[0, 1] - circle[1]
    slack = 0.25 * (high - low)
    if held == 2:
        angle = _meets(px, py, found[1, 0] - found[0, 0], found[1, 1] - found[0, 1], circle[2], low, high, frame, slack)
        if angle == angle:
            return angle
    if held >= 1:
        angle = _meets(px, py, 1.0 - found[0, 2], found[0, 2], circle[2], low, high, frame, slack)
        if angle == angle:
            return angle
    return middle


@numba.njit(cache=True)
def arcs_of(angle, inside, facing, graze, arcs, border):
    """Join points on a circle, in the order of their angles, to arcs in the material; return how many arcs there are.

    Parameters
    ----------
    angle : array (n,)
    inside, facing : arrays of bool (n,)
        In the material, and on the side that the feed moves into it.
    graze : array (2,)
        Angles at which the tool's surface lies along the feed; nan where it nowhere does.
    arcs : array (m, 2)
        Where each begins and ends; it ends beyond a turn where it goes through its beginning.
    border : array of int (m, 4)
        Points before and behind each beginning and each end; -1 where that is an angle of grazing, and known.
    """
    n, held = angle.size, 0
    cutting = inside & facing
    first = -1
    for k in range(n):
        if not cutting[k]:
            first = k
            break
    if first < 0:
        arcs[0, 0], arcs[0, 1] = 0.0, 2.0 * math.pi
        border[0] = -1
        return 1
    turn = 2.0 * math.pi
    for step in range(1, n + 1):
        k, before = (first + step) % n, (first + step - 1) % n
        if cutting[k] == cutting[before]:
            continue
        here = angle[k] + (turn if first + step >= n else 0.0)
        there = angle[before] + (turn if first + step - 1 >= n else 0.0)
        known = np.nan
        if facing[k] != facing[before]:
            for each in graze:
                for more in (0.0, turn):
                    if there - 1e-9 <= each + more <= here + 1e-9:
                        known = each + more
        side = 0 if cutting[k] else 1
        if held == arcs.shape[0]:
            return held
        arcs[held, side] = known if known == known else 0.5 * (here + there)
        border[held, 2 * side], border[held, 2 * side + 1] = (-1, -1) if known == known else (before, k)
        if side == 1:
            held += 1
    return held


@numba.njit(cache=True)
def level_frame(feed):
    """Return the direction of a move across an upright axis and its normal, as rows; x and y where it goes along the axis."""
    level = math.sqrt(feed[0] ** 2 + feed[1] ** 2)
    frame = np.eye(2)
    if level > 1e-9:
        frame[0, 0], frame[0, 1] = feed[0] / level, feed[1] / level
        frame[1, 0], frame[1, 1] = -frame[0, 1], frame[0, 0]
    return frame


@numba.njit(cache=True)
def _keep(arcs, k, kept, grazes, radius):
    """Move an arc up behind those kept; 0 where it is none: beside the wall that was cut last, a chip of less than a micrometre."""
    if grazes and radius * (1.0 - math.cos(min(arcs[k, 1] - arcs[k, 0], math.pi))) < 1e-6:
        return 0
    arcs[kept, 0], arcs[kept, 1] = arcs[k, 0], arcs[k, 1]
    return 1


@numba.njit(cache=True)
def slice_arcs(segs, counts, lattice, plane, circle, cut_from, feed, slope, arcs):
    """Find the arcs of an upright tool's circle in a plane of the lattice that lie in the material in front; return how many.

    Parameters
    ----------
    segs, counts : tuples of three arrays
    lattice : array (2, 3)
    plane : int
        Index of the plane along z.
    circle, cut_from : arrays (3,)
        Centre and radius of the tool in this plane, a step ahead, and where it has cut.
    feed : array (3,)
        Direction of the move, of length 1.
    slope : float
        By which the radius grows with the height.
    arcs : array (m, 2)
        Takes where they begin and end.

    Notes
    -----
    The circle crosses the lines along x and y of the plane at places that are known exactly, and these are in the material or not.
    """
    origin, cell = lattice[0], lattice[1]
    level = math.sqrt(feed[0] ** 2 + feed[1] ** 2)
    frame = level_frame(feed)
    radius = circle[2]
    most = 2 * int(2.0 * radius / cell[0] + 2.0 * radius / cell[1] + 6.0)
    angle, inside = np.empty(most), np.empty(most, dtype=np.bool_)
    held = 0
    steep = slope * feed[2]
    graze = np.full(2, np.nan)
    if level > abs(steep):
        graze[0] = math.asin(steep / level)
        graze[1] = math.pi - graze[0]
        # the side that turns away is not looked at: a point on either side of it stands for all
        angle[0] = graze[0] - 1e-3
        angle[1] = graze[1] + 1e-3 - (2.0 * math.pi if graze[1] + 1e-3 > math.pi else 0.0)
        inside[0] = inside[1] = False
        held = 2
    elif steep > 0.0:
        return 0
    for along in range(2):
        other = 1 - along
        first, last = (
            math.ceil((circle[other] - radius - origin[other]) / cell[other]),
            math.floor((circle[other] + radius - origin[other]) / cell[other]),
        )
        for n in range(first, last + 1):
            across = origin[other] + n * cell[other] - circle[other]
            half = radius * radius - across * across
            if half <= 0.0:
                continue
            half = math.sqrt(half)
            for side in (-half, half):
                x, y = (side, across) if along == 0 else (across, side)
                if (x * frame[0, 0] + y * frame[0, 1]) / radius * level <= steep:
                    continue
                angle[held] = math.atan2(x * frame[0, 0] + y * frame[0, 1], x * frame[1, 0] + y * frame[1, 1])
                inside[held] = _holds(segs[along], counts[along], plane, n, circle[along] + side)
                held += 1
    if not np.any(inside[:held]):
        return 0
    order = np.argsort(angle[:held])
    angle, inside, facing = angle[order], inside[order], (order > 1) | (graze[0] != graze[0])
    border = np.empty((arcs.shape[0], 4), dtype=np.int64)
    found = arcs_of(angle, inside, facing, graze, arcs, border)
    kept = 0
    for k in range(found):
        for side in range(2):
            one, two = border[k, 2 * side], border[k, 2 * side + 1]
            if one < 0:
                continue
            low, high = angle[one], angle[two]
            if high < low:
                high += 2.0 * math.pi
            turns = 2.0 * math.pi * round((arcs[k, side] - 0.5 * (low + high)) / (2.0 * math.pi))
            arcs[k, side] = _border(segs, counts, lattice, plane, circle, cut_from, low, high, frame) + turns
        kept += _keep(arcs, k, kept, border[k, 0] < 0 or border[k, 2] < 0, radius)
    return kept


@numba.njit(cache=True)
def _along_line(seg, count, m, n, place):
    """Distance from a node to the nearest end of its line's material, below zero outside."""
    found = np.inf
    for k in range(count[m, n]):
        low, high = seg[m, n, k, 0], seg[m, n, k, 1]
        if low <= place <= high:
            return min(place - low, high - place)
        found = min(found, low - place if place < low else place - high)
    return -found


@numba.njit(cache=True)
def _node_distance(segs, counts, lattice, i, j, k):
    """Distance of a node from the surface, below zero outside: that of the plane through the three places where its lines cross it."""
    most = 2.0 * max(lattice[1, 0], lattice[1, 1], lattice[1, 2])
    beyond = 0.0
    for a, index, number in ((0, i, segs[1].shape[1]), (1, j, segs[0].shape[1]), (2, k, segs[0].shape[0])):
        over = max(-index, index - number + 1)
        beyond = max(beyond, (over - 0.5) * lattice[1, a])
    if beyond > 0.0:
        return -min(beyond, most)
    x = _along_line(segs[0], counts[0], k, j, lattice[0, 0] + i * lattice[1, 0])
    y = _along_line(segs[1], counts[1], k, i, lattice[0, 1] + j * lattice[1, 1])
    z = _along_line(segs[2], counts[2], i, j, lattice[0, 2] + k * lattice[1, 2])
    total = 0.0
    for each in (x, y, z):
        if each == 0.0:
            return 0.0
        # another surface, or one that runs along this line
        if abs(each) < 1.5 * most:
            total += 1.0 / (each * each)
    away = min(1.0 / math.sqrt(total), most) if total > 0.0 else most
    return away if z > 0.0 else -away


@numba.njit(cache=True)
def distance_at(segs, counts, lattice, x, y, z):
    """Return the distance of a point from the surface, below zero outside and no more than two cells: even between the nodes around."""
    fx, fy, fz = (x - lattice[0, 0]) / lattice[1, 0], (y - lattice[0, 1]) / lattice[1, 1], (z - lattice[0, 2]) / lattice[1, 2]
    i, j, k = math.floor(fx), math.floor(fy), math.floor(fz)
    fx, fy, fz = fx - i, fy - j, fz - k
    total = 0.0
    for c in range(8):
        a, b, d = c & 1, (c >> 1) & 1, c >> 2
        weight = (fx if a else 1.0 - fx) * (fy if b else 1.0 - fy) * (fz if d else 1.0 - fz)
        if weight > 0.0:
            total += weight * _node_distance(segs, counts, lattice, i + a, j + b, k + d)
    return total


@numba.njit(cache=True)
def leaning_arcs(segs, counts, lattice, centre, frame, radius, feed, slope, arcs):
    """Find the arcs of a tool's circle anywhere that lie in the material in front; return how many.

    Parameters
    ----------
    centre : array (3,)
    frame : array (3, 3)
        Its columns are the feed's direction across the axis, the normal, and the axis.
    radius : float
    feed : array (2,)
        Across the axis and along it, of length 1 together.
    slope : float
    arcs : array (m, 2)
    """
    cell = min(lattice[1, 0], lattice[1, 1], lattice[1, 2])
    number = min(max(int(4.0 * math.pi * radius / cell), 24), 1440)
    # not at the angles of grazing
    angle, away, steep = np.empty(number), np.empty(number), slope * feed[1]
    inside, facing, some = np.empty(number, dtype=np.bool_), np.empty(number, dtype=np.bool_), False
    for n in range(number):
        angle[n] = (n + 0.5) * (2.0 * math.pi / number) - math.pi
        sine, cosine = radius * math.sin(angle[n]), radius * math.cos(angle[n])
        away[n] = distance_at(
            segs,
            counts,
            lattice,
            centre[0] + sine * frame[0, 0] + cosine * frame[0, 1],
            centre[1] + sine * frame[1, 0] + cosine * frame[1, 1],
            centre[2] + sine * frame[2, 0] + cosine * frame[2, 1],
        )
        inside[n], facing[n] = away[n] > 0.0, math.sin(angle[n]) * feed[0] > steep
        some = some or inside[n]
    if not some:
        return 0
    graze = np.full(2, np.nan)
    if feed[0] > abs(steep):
        graze[0] = math.asin(steep / feed[0])
        graze[1] = math.pi - graze[0]
    border = np.empty((arcs.shape[0], 4), dtype=np.int64)
    found = arcs_of(angle, inside, facing, graze, arcs, border)
    step, kept = 2.0 * math.pi / number, 0
    for k in range(found):
        for side in range(2):
            one, two = border[k, 2 * side], border[k, 2 * side + 1]
            if one >= 0 and inside[one] != inside[two]:
                arcs[k, side] += step * (away[one] / (away[one] - away[two]) - 0.5)
        kept += _keep(arcs, k, kept, border[k, 0] < 0 or border[k, 2] < 0, radius)
    return kept


@numba.njit(cache=True)
def _write(arcs, found, height, rows, held):
    """Write arcs at a height as rows; return how many rows there are then."""
    for k in range(found):
        if held < rows.shape[0]:
            rows[held, 0], rows[held, 1], rows[held, 2] = height, arcs[k, 0], arcs[k, 1]
            held += 1
    return held


@numba.njit(cache=True)
def _end_beside(seg, count, lattice, z, circle, frame, arcs, found, which):
    """Where the material ends above (1) or below (0) a plane, right in front of arcs in it; nan where no line stands there."""
    best = np.nan
    for reach in (0.3, 1.0, 1.7):
        radius = circle[2] + reach * max(lattice[1, 0], lattice[1, 1])
        for k in range(found):
            pieces = max(int((arcs[k, 1] - arcs[k, 0]) * circle[2] / lattice[1, 0]), 2)
            for piece in range(1, pieces):
                angle = arcs[k, 0] + (arcs[k, 1] - arcs[k, 0]) * piece / pieces
                sine, cosine = radius * math.sin(angle), radius * math.cos(angle)
                x, y = circle[0] + sine * frame[0, 0] + cosine * frame[1, 0], circle[1] + sine * frame[0, 1] + cosine * frame[1, 1]
                m, n = round((x - lattice[0, 0]) / lattice[1, 0]), round((y - lattice[0, 1]) / lattice[1, 1])
                if m < 0 or n < 0 or m >= seg.shape[0] or n >= seg.shape[1]:
                    continue
                for s in range(count[m, n]):
                    if seg[m, n, s, 0] <= z <= seg[m, n, s, 1]:
                        end = seg[m, n, s, which]
                        if best != best or (end > best) == (which == 1):
                            best = end
        if best == best:
            return best
    return best


@numba.njit(cache=True)
def engage_upright(segs, counts, lattice, tips, outline, edge, feed, most, rows, extent):
    """Find where an upright tool that is about to move stands in material, plane by plane of the lattice; return how many rows there are.

    Parameters
    ----------
    segs, counts : tuples of three arrays
    lattice : array (2, 3)
    tips : array (2, 3)
        Where the tool has cut, and a step ahead.
    outline : array (2, p)
    edge : float
        Height to which its edges reach.
    feed : array (3,)
        Direction of the move, of length 1.
    most : int
        Planes that are looked at, at most; of more, every so many.
    rows : array (m, 3)
        Takes height above the tip, and where an arc begins and ends.
    extent : array (2,)
        Between which heights above the tip there is material around the tool; takes those of what is engaged. Where no plane of the
        lattice lies between them, they stay, and -1 is returned.
    """
    low, high = extent
    arcs, last_arcs, held, planes = np.empty((16, 2)), np.empty((16, 2)), 0, 0
    top, beyond, last_found, last_radius = 0.0, 0.0, 0, 0.0
    circle, cut_from = np.empty(3), np.empty(3)
    frame = level_frame(feed)
    tip, cell = tips[1, 2], lattice[1, 2]
    first = max(math.ceil((tip + low - lattice[0, 2]) / cell), 0)
    last = min(math.floor((tip + high - lattice[0, 2]) / cell), segs[0].shape[0] - 1)
    every = max((last - first) // max(most - 1, 1), 1)
    k, step = first - every, every * cell
    while k < last:
        # the last plane is one of them
        k = min(k + every, last)
        z = lattice[0, 2] + k * cell
        radius, slope = radius_and_slope(outline, z - tip)
        if radius <= 0.0:
            continue
        if planes == 0:
            extent[0], extent[1] = np.inf, -np.inf
        planes += 1
        behind, _ = radius_and_slope(outline, z - tips[0, 2])
        circle[0], circle[1], circle[2] = tips[1, 0], tips[1, 1], radius
        cut_from[0], cut_from[1], cut_from[2] = tips[0, 0], tips[0, 1], behind
        found = slice_arcs(segs, counts, lattice, k, circle, cut_from, feed, slope, arcs)
        if found == 0:
            continue
        held = _write(arcs, found, z - tip, rows, held)
        # the plane beside has no arc: the material ends before it, or where its arcs do half way
        if z - tip < extent[0]:
            end = _end_beside(segs[2], counts[2], lattice, z, circle, frame, arcs, found, 0)
            extent[0] = (end if end > z - step else z - 0.5 * step) - tip if max(z - step, end) > tip else 0.0
        # behind the last plane there is none that says whether the arcs go on
        top, beyond, last_found, last_radius = z, z + step if k < last else np.inf, found, radius
        for each in range(found):
            last_arcs[each, 0], last_arcs[each, 1] = arcs[each, 0], arcs[each, 1]
    if held:
        circle[2] = last_radius
        end = _end_beside(segs[2], counts[2], lattice, top, circle, frame, last_arcs, last_found, 1)
        extent[1] = min((end if end < beyond else top + 0.5 * step) - tip, edge)
    return held if planes else -1
