"""Which teeth stand where in a period of a milling cut, and what they push with; arrays and scalars only.

Teeth stand in *windows*: rows of

    offset, start, end, upper share, lower share, delay     (angles [rad], shares of the depth, place in the list of delays)

so that at the rotation theta a point at the height z of the edge is at phi = theta + offset - lag z and cuts for start <= phi < end;
copies of a window follow each other by `spacing`. F = sum K_d(theta) (y(theta) - y(theta - delay_d)) + C(theta) y'. The angles at which
a window opens or closes split the period into elements, elements into steps of at most a given length, steps into Gauss-Lobatto nodes.

`table` holds the nodes, their weights, and row by row the Lagrange polynomials' coefficients of s^k.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

_NARROW = 1e-7


class CutPlan(NamedTuple):
    """A cut at a speed and a depth: what all its teeth share."""

    #: Angles [rad].
    period: float
    spacing: float
    speed: float
    depth: float
    #: Angle by which the edge lags, per height.
    lag: float
    #: Stiffness per depth; damping per depth, times the cutting speed.
    k_tangential: float
    k_radial: float
    c_tangential: float
    c_radial: float
    radius: float
    #: Amplitude and ratio of a varying speed.
    swing: float
    swings: float
    #: Longest step [s].
    step: float
    #: Whether coefficients stand still within a step.
    frozen: bool
    #: Angles, shape (d,).
    delays: np.ndarray


class CutLayout(NamedTuple):
    """A cut over its period: e elements, n points, d delays, q + 1 nodes. Kernels of `_monodromy_kernels` take it, too: clear their
    cache where the order changes."""

    #: Shape (e, 5), as `elements`.
    places: np.ndarray
    #: At the points, by delay, shapes (n, d, r, r), (n, r, r).
    stiffness: np.ndarray
    damping: np.ndarray
    #: As `lookups`, shapes (n, d), (n, d, q + 1).
    where: np.ndarray
    weight: np.ndarray
    #: Shape (n,).
    time: np.ndarray


@numba.njit(cache=True)
def angle_at(time, plan):
    """Rotation after a time, from rest of the swing at 0."""
    mean = plan.speed
    if plan.swing == 0.0:
        return mean * time
    swing = plan.swings * mean
    return mean * (time + plan.swing / swing * (1.0 - math.cos(swing * time)))


@numba.njit(cache=True)
def time_at(angle, plan):
    """The time of a rotation: Newton's method on a monotone function."""
    time = angle / plan.speed
    if plan.swing == 0.0:
        return time
    swing = plan.swings * plan.speed
    for _ in range(100):
        change = (angle_at(time, plan) - angle) / (plan.speed * (1.0 + plan.swing * math.sin(swing * time)))
        # no further than half a swing: far from the root the slope says little
        change = min(max(change, -math.pi / swing), math.pi / swing)
        time -= change
        if abs(change) * swing < 1e-14:
            break
    return time


@numba.njit(cache=True)
def add_window(theta, middle, row, plan, weights, out):
    """Add a window's matrices (feed axes, per unit displacement and velocity) at theta, inside the element around `middle`.

    weights : (stiffness tangential, radial, damping tangential, radial); out : shape (2, 2, 2).
    """
    offset, start, end, upper, lower = row[0], row[1], row[2], row[3], row[4]
    near, far = plan.lag * plan.depth * upper, plan.lag * plan.depth * lower
    share, spacing = lower - upper, plan.spacing
    # copies whose edge stands between start and end somewhere along its height
    first = math.ceil((middle + offset - far - end) / spacing - 1e-12)
    last = math.floor((middle + offset - near - start) / spacing + 1e-12)
    for k in range(first, last + 1):
        turn = offset - k * spacing
        sc, ss, cc = 0.0, 0.0, 0.0
        if far - near < _NARROW:
            phi = theta + turn - 0.5 * (near + far)
            if start <= middle + turn - 0.5 * (near + far) < end:
                s, c = math.sin(phi), math.cos(phi)
                sc, ss, cc = s * c, s * s, c * c
        else:
            high = min(max(theta + turn - near, start), end)
            low = min(max(theta + turn - far, start), end)
            sines = math.sin(2.0 * high) - math.sin(2.0 * low)
            sc = -0.25 * (math.cos(2.0 * high) - math.cos(2.0 * low)) / (far - near)
            ss = (0.5 * (high - low) - 0.25 * sines) / (far - near)
            cc = (0.5 * (high - low) + 0.25 * sines) / (far - near)
        for i in range(2):
            t, r = share * weights[2 * i], share * weights[2 * i + 1]
            out[i, 0, 0] -= t * sc + r * ss
            out[i, 0, 1] -= t * cc + r * sc
            out[i, 1, 0] += t * ss - r * sc
            out[i, 1, 1] += t * sc - r * cc


@numba.njit(cache=True)
def _cuts(middle, rows, plan):
    """Whether any tooth is in the cut at this rotation."""
    for row in rows:
        near, far = plan.lag * plan.depth * row[3], plan.lag * plan.depth * row[4]
        first = math.ceil((middle + row[0] - far - row[2]) / plan.spacing - 1e-12)
        if first * plan.spacing <= middle + row[0] - near - row[1]:
            return True
    return False


@numba.njit(cache=True)
def elements(rows, plan, degree):
    """Return start time, length of a step, steps, first point (-1 where nothing cuts) and start angle of each element."""
    period = plan.period
    edges = np.empty(4 * rows.shape[0] * (int(period / plan.spacing) + 3) + 2)
    edges[0], edges[1], count = 0.0, period, 2
    for row in rows:
        near, far = plan.lag * plan.depth * row[3], plan.lag * plan.depth * row[4]
        for phi in (row[1], row[2]):
            for lag in (near, far):
                place = (phi + lag - row[0]) % plan.spacing
                while place < period - 1e-11:
                    if place > 1e-11:
                        edges[count] = place
                        count += 1
                    place += plan.spacing
                if far - near < _NARROW:
                    break
    for k in range(1, count):
        # few, and compiled at once; a library's sort is not
        value, place = edges[k], k
        while place > 0 and edges[place - 1] > value:
            edges[place] = edges[place - 1]
            place -= 1
        edges[place] = value
    kept = np.empty(count)
    kept[0], n = edges[0], 1
    for k in range(1, count):
        if edges[k] - kept[n - 1] > 1e-9:
            kept[n] = edges[k]
            n += 1
    table = np.empty((n - 1, 5))
    point = 0
    for k in range(n - 1):
        begin, end = time_at(kept[k], plan), time_at(kept[k + 1], plan)
        table[k, 0], table[k, 4] = begin, kept[k]
        if _cuts(0.5 * (kept[k] + kept[k + 1]), rows, plan):
            steps = max(1, math.ceil((end - begin) / plan.step - 1e-9))
            table[k, 1], table[k, 2], table[k, 3] = (end - begin) / steps, steps, point
            point += steps * degree + 1
        else:
            table[k, 1], table[k, 2], table[k, 3] = end - begin, 1, -1
    return table, point


@numba.njit(cache=True)
def coefficients(rows, shapes, plan, places, points, table):
    """Stiffness by delay (n, d, r, r), its sum's damping (n, r, r), and rotation and time of each point."""
    q, r, count = table.shape[1] - 1, shapes.shape[2], plan.delays.size
    stiffness, damping = np.zeros((points, count, r, r)), np.zeros((points, r, r))
    angle, time = np.empty(points), np.empty(points)
    weights, pair = np.empty(4), np.empty((2, 2, 2))
    for e in range(places.shape[0]):
        if places[e, 3] < 0:
            continue
        h, steps, first = places[e, 1], int(places[e, 2]), int(places[e, 3])
        end = plan.period if e + 1 == places.shape[0] else places[e + 1, 4]
        middle = 0.5 * (places[e, 4] + end)
        for i in range(steps * q + 1):
            point = first + i
            time[point] = places[e, 0] + h * (i // q + table[0, i % q])
            theta = places[e, 4] if i == 0 else end if i == steps * q else angle_at(time[point], plan)
            angle[point] = theta
            swing = plan.swings * plan.speed
            speed = plan.speed * (1.0 + plan.swing * math.sin(swing * time[point])) * plan.radius
            weights[0], weights[1] = plan.depth * plan.k_tangential, plan.depth * plan.k_radial
            weights[2], weights[3] = plan.depth * plan.c_tangential / speed, plan.depth * plan.c_radial / speed
            for w in range(rows.shape[0]):
                for i1 in range(2):
                    for i2 in range(2):
                        pair[0, i1, i2] = pair[1, i1, i2] = 0.0
                add_window(theta, middle, rows[w], plan, weights, pair)
                d = int(rows[w, 5])
                for a in range(r):
                    for b in range(r):
                        for i1 in range(2):
                            for i2 in range(2):
                                both = shapes[w, i1, a] * shapes[w, i2, b]
                                stiffness[point, d, a, b] += both * pair[0, i1, i2]
                                damping[point, a, b] += both * pair[1, i1, i2]
    if plan.frozen:
        # each step with its means: a step's nodes are its own, so the shared ones are kept by the step that starts there
        for e in range(places.shape[0]):
            if places[e, 3] < 0:
                continue
            for step in range(int(places[e, 2])):
                first = int(places[e, 3]) + step * q
                for a in range(r):
                    for b in range(r):
                        for d in range(count):
                            mean = 0.0
                            for j in range(q + 1):
                                mean += table[1, j] * stiffness[first + j, d, a, b]
                            for j in range(q):
                                stiffness[first + j, d, a, b] = mean
                        mean = 0.0
                        for j in range(q + 1):
                            mean += table[1, j] * damping[first + j, a, b]
                        for j in range(q):
                            damping[first + j, a, b] = mean
    return stiffness, damping, angle, time


@numba.njit(cache=True)
def lookups(plan, places, points, angle, time, table):
    """Where the points find what the tool did a delay ago: first point of a step (+ points, if in this period) and the weights there.

    Where the first weight is 1 the point itself.
    """
    q, count = table.shape[1] - 1, plan.delays.size
    where = np.zeros((points, count), dtype=np.int64)
    weight = np.zeros((points, count, q + 1))
    for p in range(points):
        starts = _starts(places, p)
        for d in range(count):
            back = angle[p] - plan.delays[d]
            # the period's first instant belongs to the points that start there, to all others the last one's end
            now = back > (-1e-9 if starts else 1e-9)
            if not now:
                back += plan.period
            then = time_at(back, plan)
            # the element in the cut that holds it, or comes nearest to it
            best, distance = -1, 1e300
            for e in range(places.shape[0]):
                if places[e, 3] < 0:
                    continue
                begin, length = places[e, 0], places[e, 1] * places[e, 2]
                apart = max(begin - then, then - begin - length, 0.0)
                # of two elements that touch there, a point that starts its own takes the one that starts
                if apart < distance - 1e-12 * length or (starts and apart <= distance + 1e-12 * length):
                    best, distance = e, min(apart, distance)
            h, steps, first = places[best, 1], int(places[best, 2]), int(places[best, 3])
            x = min(max((then - places[best, 0]) / h, 0.0), float(steps))
            step = min(int(x + 1e-9), steps - 1)
            x -= step
            where[p, d] = first + step * q + (points if now else 0)
            for j in range(q + 1):
                value = 1.0
                for i in range(q + 1):
                    if i != j:
                        value *= (x - table[0, i]) / (table[0, j] - table[0, i])
                weight[p, d, j] = value
            # mostly a point stands there already: it alone counts
            there = 0
            for j in range(1, q + 1):
                if weight[p, d, j] > weight[p, d, there]:
                    there = j
            if abs(weight[p, d, there] - 1.0) < 1e-9:
                where[p, d] += there
                for j in range(q + 1):
                    weight[p, d, j] = 1.0 if j == 0 else 0.0
    return where, weight


@numba.njit(cache=True)
def _starts(places, point):
    """Whether an element starts with this point."""
    found = False
    for e in range(places.shape[0]):
        found = found or places[e, 3] == point
    return found


@numba.njit(cache=True)
def lay_out(rows, shapes, plan, table):
    """Lay a cut out over its period.

    Parameters
    ----------
    rows : array (w, 6)
        Windows.
    shapes : array (w, 2, r)
        How the displacements that are kept move the edge there, in feed and normal direction.
    plan : CutPlan

    Returns
    -------
    CutLayout
    """
    places, points = elements(rows, plan, table.shape[1] - 1)
    stiffness, damping, angle, time = coefficients(rows, shapes, plan, places, points, table)
    where, weight = lookups(plan, places, points, angle, time, table)
    return CutLayout(places, stiffness, damping, where, weight, time)
