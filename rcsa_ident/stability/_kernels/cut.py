"""Which teeth stand where in a period of a milling cut, and what they push with; arrays and scalars only.

Pieces of edge stand in *windows*: rows of

    offset, start, end, near, far, delay, splits     (angles [rad], the delay's place in the list of delays, 1 or 0)

so that at the rotation theta a point of the edge that lags its tip by an angle between near and far is at phi = theta + offset - lag and
cuts for start <= phi < end; copies of a window follow each other by `spacing`. Of each stands a *form* beside it: what it pushes with, as
a sum of 1, cos, sin, cos 2 and sin 2 of phi. F = sum K_d(theta) (y(theta) - y(theta - delay_d)) + C(theta) y'. The angles at which a
window opens or closes split the period into elements, elements into steps of at most a given length, steps into Gauss-Lobatto nodes; of
a serrated edge's many narrow windows, which open and close gradually, they do not.

`table` holds the nodes, their weights, and row by row the Lagrange polynomials' coefficients of s^k.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

_NARROW = 1e-7


class CutPlan(NamedTuple):
    """A cut at a speed: what all its teeth share."""

    #: Angles [rad].
    period: float
    spacing: float
    #: Of the windows' lags and forces.
    share: float
    speed: float
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
    #: As `lookups`, shapes (n, d), below zero where nothing is pushed with that delay, and (n, d, q + 1).
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
def add_window(theta, middle, row, spacing, basis):
    """Add to `basis`, shape (5,), the sums over a window's copies of 1, cos, sin, cos 2, sin 2 at theta, means over its lags.

    They are those inside the element around `middle`; returns whether any copy cuts there.
    """
    offset, start, end, near, far = row[0], row[1], row[2], row[3], row[4]
    # copies whose edge stands between start and end somewhere
    first = math.ceil((middle + offset - far - end) / spacing - 1e-12)
    last = math.floor((middle + offset - near - start) / spacing + 1e-12)
    cuts = False
    for k in range(first, last + 1):
        turn = offset - k * spacing
        if far - near < _NARROW:
            lag = 0.5 * (near + far)
            if start <= middle + turn - lag < end:
                s, c = math.sin(theta + turn - lag), math.cos(theta + turn - lag)
                basis[0] += 1.0
                basis[1] += c
                basis[2] += s
                basis[3] += c * c - s * s
                basis[4] += 2.0 * s * c
                cuts = True
        else:
            high = min(max(theta + turn - near, start), end)
            low = min(max(theta + turn - far, start), end)
            over = 1.0 / (far - near)
            s, c, s_low, c_low = math.sin(high), math.cos(high), math.sin(low), math.cos(low)
            basis[0] += over * (high - low)
            basis[1] += over * (s - s_low)
            basis[2] += over * (c_low - c)
            basis[3] += over * (s * c - s_low * c_low)
            basis[4] += over * (s * s - s_low * s_low)
            cuts = True
    return cuts


@numba.njit(cache=True)
def _cuts(middle, rows, plan):
    """Whether any tooth is in the cut at this rotation."""
    for row in rows:
        if row[6] == 0.0:
            return True
        first = math.ceil((middle + row[0] - row[4] - row[2]) / plan.spacing - 1e-12)
        if first * plan.spacing <= middle + row[0] - row[3] - row[1]:
            return True
    return False


@numba.njit(cache=True)
def elements(rows, plan, degree):
    """Return start time, length of a step, steps, first point (-1 where nothing cuts) and start angle of each element."""
    period = plan.period
    edges = np.zeros(4 * rows.shape[0] * (int(period / plan.spacing) + 3) + 2)
    edges[1], count = period, 2
    for row in rows:
        if row[6] == 0.0:
            continue
        near, far = row[3], row[4]
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
    for k in range(2, count):
        # few, and compiled at once; a library's sort is not; none is below the first
        value, place = edges[k], k
        while edges[place - 1] > value:
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
def coefficients(rows, forms, rubbing, plan, places, points, table):
    """Stiffness by delay (n, d, r, r), its sum's damping (n, r, r), and rotation and time of each point.

    forms, rubbing : (w, 5, r, r), what each window pushes with, per displacement, and per velocity times the spindle's speed; rubbing has
    no window where nothing rubs.
    """
    q, r, count = table.shape[1] - 1, forms.shape[2], plan.delays.size
    stiffness, damping = np.zeros((points, count, r, r)), np.zeros((points, r, r))
    angle, time = np.empty(points), np.empty(points)
    basis, rubs = np.empty(5), rubbing.shape[0] > 0
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
            speed = plan.speed * (1.0 + plan.swing * math.sin(plan.swings * plan.speed * time[point]))
            for w in range(rows.shape[0]):
                for k in range(5):
                    basis[k] = 0.0
                if not add_window(theta, middle if rows[w, 6] > 0.0 else theta, rows[w], plan.spacing, basis):
                    continue
                d = int(rows[w, 5])
                for a in range(r):
                    for b in range(r):
                        pushed = 0.0
                        for k in range(5):
                            pushed += basis[k] * forms[w, k, a, b]
                        stiffness[point, d, a, b] += pushed
                        if rubs:
                            pushed = 0.0
                            for k in range(5):
                                pushed += basis[k] * rubbing[w, k, a, b]
                            damping[point, a, b] += pushed / speed
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
def lookups(plan, places, points, angle, time, table, stiffness):
    """Where the points find what the tool did a delay ago: first point of a step (+ points, if in this period) and the weights there.

    Where the first weight is 1 the point itself; -1 where the step of the point pushes nothing with that delay.
    """
    q, count, r = table.shape[1] - 1, plan.delays.size, stiffness.shape[2]
    where = np.full((points, count), -1, dtype=np.int64)
    weight = np.zeros((points, count, q + 1))
    starts = np.zeros(points, dtype=np.bool_)
    cutting, inside = np.empty(places.shape[0], dtype=np.int64), 0
    # of a place that two elements share, shorter than any element
    touch = 1e-10 / plan.speed
    for e in range(places.shape[0]):
        if places[e, 3] >= 0:
            starts[int(places[e, 3])] = True
            cutting[inside] = e
            inside += 1
    for e in range(places.shape[0]):
        if places[e, 3] < 0:
            continue
        for step in range(int(places[e, 2])):
            first = int(places[e, 3]) + step * q
            for d in range(count):
                pushes = False
                for p in range(first, first + q + 1):
                    for a in range(r):
                        for b in range(r):
                            pushes = pushes or stiffness[p, d, a, b] != 0.0
                if pushes:
                    for p in range(first, first + q + 1):
                        where[p, d] = 0
    for p in range(points):
        for d in range(count):
            if where[p, d] < 0:
                continue
            back = angle[p] - plan.delays[d]
            # the period's first instant belongs to the points that start there, to all others the last one's end
            now = back > (-1e-9 if starts[p] else 1e-9)
            if not now:
                back += plan.period
            then = time_at(back, plan)
            # the element in the cut that holds it, or comes nearest to it: those that begin before it and after it, in order of time
            low, high = 0, inside
            while low < high:
                half = (low + high) // 2
                if places[cutting[half], 0] <= then:
                    low = half + 1
                else:
                    high = half
            best, distance = -1, 1e300
            for k in range(max(low - 2, 0), min(low + 2, inside)):
                e = cutting[k]
                begin, length = places[e, 0], places[e, 1] * places[e, 2]
                apart = max(begin - then, then - begin - length, 0.0)
                # of two elements that touch there, a point that starts its own takes the one that starts
                if apart < distance - touch or (starts[p] and apart <= distance + touch):
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
def lay_out(rows, forms, rubbing, plan, table):
    """Lay a cut out over its period.

    Parameters
    ----------
    rows : array (w, 7)
        Windows.
    forms, rubbing : arrays (w, 5, r, r)
        What each pushes with, in the displacements that are kept; rubbing has none where nothing rubs.
    plan : CutPlan

    Returns
    -------
    CutLayout
    """
    rows, forms, rubbing = rows.copy(), forms.copy(), rubbing.copy()
    # loops: products of whole arrays take seconds to compile
    for w in range(rows.shape[0]):
        rows[w, 3] *= plan.share
        rows[w, 4] *= plan.share
    for pushes in (forms.ravel(), rubbing.ravel()):
        for k in range(pushes.size):
            pushes[k] *= plan.share
    places, points = elements(rows, plan, table.shape[1] - 1)
    stiffness, damping, angle, time = coefficients(rows, forms, rubbing, plan, places, points, table)
    where, weight = lookups(plan, places, points, angle, time, table, stiffness)
    return CutLayout(places, stiffness, damping, where, weight, time)
