"""A tool that is carried by springs through walls of columns, instant by instant; arrays and scalars only."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

#: Passes of what acts at the ports, at most, and how many times farther than wanted they may end apart: a tooth that comes in or not,
#: as the tip stands, has no place between.
_PASSES, _JUMP = 100, 1e5


class Columns(NamedTuple):
    """Where the material ends, in columns at start + i spacing."""

    #: (2, levels, n) on top, of the material below the path and, mirrored at it, above; taken down.
    tops: np.ndarray
    #: (2, levels, n) on its other side.
    feet: np.ndarray
    start: float
    spacing: float


class Teeth(NamedTuple):
    """What cuts."""

    #: (teeth, levels, 4) radius, sine and cosine of the lean, width of edge.
    edges: np.ndarray
    #: (teeth, levels) by which each edge stays behind tooth 1.
    lags: np.ndarray
    #: (6,) force per area and per width: tangential, radial, axial, and of the edges.
    cut: np.ndarray


class Springs(NamedTuple):
    """What carries the tip with freedoms of its own."""

    #: (n, n) of M + h/2 D + h^2/4 K.
    inverse: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    load: np.ndarray
    #: (3, n) of the tip, and (3,) where it counts as on its path.
    motion: np.ndarray
    zero: np.ndarray
    play: np.ndarray


class Swings(NamedTuple):
    """What carries it besides: modes, stepped exactly."""

    #: (m,) by which a step turns and damps each.
    factor: np.ndarray
    #: (m,) gains of the force at its start and at its end.
    early: np.ndarray
    late: np.ndarray
    outputs: np.ndarray
    inputs: np.ndarray
    constant: np.ndarray


class Going(NamedTuple):
    """Where a march stands; gone on with."""

    #: (3, n) deflections, rates, accelerations.
    state: np.ndarray
    #: (m,) of the modes.
    swing: np.ndarray
    #: (3,) force at the last instant.
    force: np.ndarray
    #: (teeth, levels, k, 2) where each edge stood lately, as far as the upper wall does not know it yet.
    trail: np.ndarray
    #: (teeth, levels) how many of these.
    held: np.ndarray


@numba.njit(cache=True, error_model="numpy")
def chip(wall, foot, start, spacing, x, y, sine, cosine, radius):
    """Return how much of a ray from the tool's centre lies in the material before the edge [m]; 0 where the edge is in the air.

    wall, foot: where the material ends above and below in columns at start + i spacing, the top linear in between, shape (n,); (x, y): the
    centre; (sine, cosine): the ray's direction, with cosine < 0: it looks down on the wall; radius: of the edge.
    """
    at = (x + radius * sine - start) / spacing
    i = math.floor(at)
    if i < 0 or i >= wall.size - 1:
        return 0.0
    slope = (wall[i + 1] - wall[i]) / spacing
    edge = y + radius * cosine
    if wall[i] + slope * (at - i) * spacing <= edge or edge < foot[i]:
        return 0.0
    while True:
        # within a column the surface is a line: the ray crosses it, or leaves the column below it
        border = 0.0
        if sine != 0.0:
            border = max((start + (i if sine > 0.0 else i + 1) * spacing - x) / sine, 0.0)
        here = start + i * spacing
        if wall[i] + slope * (x + border * sine - here) - y - border * cosine <= 0.0:
            return radius - (y - wall[i] - slope * (x - here)) / (slope * sine - cosine)
        i += -1 if sine > 0.0 else 1
        if border == 0.0 or i < 0 or i >= wall.size - 1:
            return radius - border
        slope = (wall[i + 1] - wall[i]) / spacing


@numba.njit(cache=True, error_model="numpy")
def erase(wall, start, spacing, x0, y0, x1, y1):
    """Take off the wall what stands above an edge that goes from (x0, y0) to (x1, y1)."""
    if x1 < x0:
        x0, y0, x1, y1 = x1, y1, x0, y0
    first = max(math.ceil((x0 - start) / spacing), 0)
    last = min(math.floor((x1 - start) / spacing), wall.size - 1)
    rise = (y1 - y0) / (x1 - x0) if x1 > x0 else 0.0
    for i in range(first, last + 1):
        y = y0 + rise * (start + i * spacing - x0)
        if y < wall[i]:
            wall[i] = y


@numba.njit(cache=True, error_model="numpy")
def place_edge(walls, start, spacing, x, y, centre, swept, trail, held):
    """Let an edge go on to (x, y) and take both walls, shape (2, n), down to where it went: the upper one up to x = swept."""
    count = held[0]
    if count == trail.shape[0]:
        # longer than half a turn: what is oldest has been swept
        erase(walls[1], start, spacing, trail[0, 0], -trail[0, 1], trail[1, 0], -trail[1, 1])
        for i in range(1, count):
            trail[i - 1, 0], trail[i - 1, 1] = trail[i, 0], trail[i, 1]
        count -= 1
    trail[count, 0], trail[count, 1] = x, y
    if count > 0 and min(trail[count - 1, 1], y) < centre:
        erase(walls[0], start, spacing, trail[count - 1, 0], trail[count - 1, 1], x, y)
    done = 0
    while done < count and trail[done + 1, 0] <= swept:
        if max(trail[done, 1], trail[done + 1, 1]) > centre:
            erase(walls[1], start, spacing, trail[done, 0], -trail[done, 1], trail[done + 1, 0], -trail[done + 1, 1])
        done += 1
    for i in range(done, count + 1):
        trail[i - done, 0], trail[i - done, 1] = trail[i, 0], trail[i, 1]
    held[0] = count - done + 1


@numba.njit(cache=True, error_model="numpy")
def cut_force(columns, teeth, place, turned, chips, force):
    """Write the force on a tool into `force`: along feed, normal and axis, towards the spindle; and what each ray cuts into `chips`.

    place: of its centre, and by how much it is pushed up; turned: (teeth, levels, 2) sine and cosine of where each edge stands.
    """
    x, y, z = place
    edges, cut = teeth.edges, teeth.cut
    force[:] = 0.0
    for j in range(edges.shape[0]):
        for k in range(edges.shape[1]):
            s, c = turned[j, k, 0], turned[j, k, 1]
            lean, upright = edges[j, k, 2], edges[j, k, 1]
            radius = edges[j, k, 0] - z * lean / upright
            if c < 0.0:
                thick = chip(columns.tops[0, k], columns.feet[0, k], columns.start, columns.spacing, x, y, s, c, radius)
            else:
                thick = chip(columns.tops[1, k], columns.feet[1, k], columns.start, columns.spacing, x, -y, s, -c, radius)
            chips[j, k] = thick
            if thick <= 0.0:
                continue
            thick *= upright
            width = edges[j, k, 3]
            tangential = width * (cut[0] * thick + cut[3])
            radial = width * (cut[1] * thick + cut[4])
            axial = width * (cut[2] * thick + cut[5])
            inward = radial * upright + axial * lean
            force[0] -= c * tangential + s * inward
            force[1] += s * tangential - c * inward
            force[2] += radial * lean - axial * upright


@numba.njit(cache=True, error_model="numpy")
def march(springs, swings, going, teeth, columns, course, step, solved, forces, tips):
    """March through a course; return how many instants did not settle.

    course: (count, 3) angle of tooth 1, place along the feed and beside it; step: between instants; solved: by which ports may move in the
    last pass of an instant; forces, tips: (count, 3) to fill.
    """
    inverse, damping, stiffness, load, motion, zero, play = springs
    factor, early, late, outputs, inputs, constant = swings
    state, swing, before, trail, held = going
    edges, lags = teeth.edges, teeth.lags
    n, quarter, half = inverse.shape[0], 0.25 * step * step, 0.5 * step
    count, levels = lags.shape
    loose = np.flatnonzero(play)
    ports = 3 + loose.size
    # answers of deflections to the force on the tip, and to the springs that a play lets go
    drive = np.zeros((n, ports))
    for i in range(n):
        for d in range(3):
            drive[i, d] = motion[d, i]
    for p in range(loose.size):
        drive[loose[p], 3 + p] = stiffness[loose[p]]
    answer = inverse @ drive
    port, moves = np.zeros((ports, ports)), motion @ answer
    for b in range(ports):
        for a in range(3):
            port[a, b] = quarter * moves[a, b]
        for p in range(loose.size):
            port[3 + p, b] = quarter * answer[loose[p], b]
    for m in range(factor.size):
        for a in range(3):
            for b in range(3):
                port[a, b] += 2.0 * (outputs[a, m] * late[m] * inputs[m, b]).real
    for a in range(3):
        for b in range(3):
            port[a, b] += constant[a, b]
    turned, chips = np.empty((count, levels, 2)), np.zeros((count, levels))
    place, rate, gain, right = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    there, now, acts, force = np.empty(ports), np.empty(ports), np.zeros(ports), np.zeros(3)
    for d in range(3):
        acts[d] = force[d] = before[d]
    failed = 0
    for t in range(course.shape[0]):
        angle, x, y = course[t]
        for j in range(count):
            for k in range(levels):
                turned[j, k, 0] = math.sin(angle - lags[j, k])
                turned[j, k, 1] = math.cos(angle - lags[j, k])
        # where it would be without new accelerations
        for i in range(n):
            rate[i] = state[1, i] + half * state[2, i]
            place[i] = state[0, i] + step * state[1, i] + quarter * state[2, i]
        for i in range(n):
            right[i] = load[i] - stiffness[i] * place[i]
            for m in range(n):
                right[i] -= damping[i, m] * rate[m]
        for i in range(n):
            gain[i] = 0.0
            for m in range(n):
                gain[i] += inverse[i, m] * right[m]
        for d in range(3):
            there[d] = -zero[d]
            for m in range(n):
                there[d] += motion[d, m] * (place[m] + quarter * gain[m])
        for p in range(loose.size):
            there[3 + p] = place[loose[p]] + quarter * gain[loose[p]]
        for m in range(factor.size):
            pushed = inputs[m, 0] * acts[0] + inputs[m, 1] * acts[1] + inputs[m, 2] * acts[2]
            swing[m] = factor[m] * swing[m] + early[m] * pushed
            for d in range(3):
                there[d] += 2.0 * (outputs[d, m] * swing[m]).real
        # what acts at the ports depends on where they are
        for a in range(ports):
            now[a] = there[a]
            for b in range(ports):
                now[a] += port[a, b] * acts[b]
        moved = 0.0
        for _ in range(_PASSES):
            cut_force(columns, teeth, (x + now[0], y + now[1], now[2]), turned, chips, force)
            for d in range(3):
                acts[d] = force[d]
            for p in range(loose.size):
                room = play[loose[p]]
                acts[3 + p] = min(max(now[3 + p], -room), room)
            moved = 0.0
            for a in range(ports):
                new = there[a]
                for b in range(ports):
                    new += port[a, b] * acts[b]
                moved = max(moved, abs(new - now[a]))
                now[a] = new
            if moved <= solved:
                break
        if not moved <= _JUMP * solved:
            failed += 1
        for i in range(n):
            for b in range(ports):
                gain[i] += answer[i, b] * acts[b]
            state[2, i] = gain[i]
            state[1, i] = rate[i] + half * gain[i]
            state[0, i] = place[i] + quarter * gain[i]
        for m in range(factor.size):
            swing[m] += late[m] * (inputs[m, 0] * acts[0] + inputs[m, 1] * acts[1] + inputs[m, 2] * acts[2])
        for d in range(3):
            forces[t, d] = force[d]
            tips[t, d] = now[d]
        for j in range(count):
            for k in range(levels):
                radius = edges[j, k, 0] - now[2] * edges[j, k, 2] / edges[j, k, 1]
                # what the ray has not swept yet is not taken away: above the path an edge is ahead of its chip
                swept = x + now[0] + (radius - chips[j, k]) * turned[j, k, 0] if turned[j, k, 1] > 0.0 else np.inf
                ex, ey = x + now[0] + radius * turned[j, k, 0], y + now[1] + radius * turned[j, k, 1]
                place_edge(columns.tops[:, k], columns.start, columns.spacing, ex, ey, y + now[1], swept, trail[j, k], held[j : j + 1, k])
    for d in range(3):
        before[d] = force[d]
    return failed
