"""One period of a milling cut as a linear map, step by step; arrays and scalars only.

The structure moves exactly, p' = pole p + inputs F, y = 2 Re(outputs p) + constant F. Teeth stand in *windows*: rows of

    offset, start, end, upper share, lower share, delay     (angles [rad], shares of the depth, place in the list of delays)

so that at the rotation theta a point at the height z of the edge is at phi = theta + offset - lag z and cuts for start <= phi < end;
copies of a window follow each other by `spacing`. F = sum K_d(theta) (y(theta) - y(theta - delay_d)) + C(theta) y'. The angles at which
a window opens or closes split the period into elements, elements into steps of at most a given length; within a step F is a
polynomial through Gauss-Lobatto nodes, and its response is exact.

`plan` holds the scalars: PERIOD, SPACING (angles), SPEED, DEPTH, LAG (angle per height), KT, KR, CT, CR (stiffness and damping per
depth, the latter times the cutting speed), RADIUS, SWING, SWINGS (amplitude and ratio of a varying speed), STEP, FROZEN, TOLERANCE, WAVES (whether the vector's
forces are wanted), then the delays (angles). `table` holds the nodes, their weights, and row by row the Lagrange polynomials' coefficients of s^k.
"""

from __future__ import annotations

import math

import numba
import numpy as np

PERIOD, SPACING, SPEED, DEPTH, LAG, KT, KR, CT, CR, RADIUS, SWING, SWINGS, STEP, FROZEN, TOLERANCE, WAVES, DELAYS = range(17)
_NARROW = 1e-7
#: Krylov vectors between two looks at the eigenvalues, at least and at most; all of them at most.
_FIRST, _EVERY, _MOST = 8, 3, 240


@numba.njit(cache=True)
def angle_at(time, plan):
    """Rotation after a time, from rest of the swing at 0."""
    mean = plan[SPEED]
    if plan[SWING] == 0.0:
        return mean * time
    swing = plan[SWINGS] * mean
    return mean * (time + plan[SWING] / swing * (1.0 - math.cos(swing * time)))


@numba.njit(cache=True)
def time_at(angle, plan):
    """The time of a rotation: Newton's method on a monotone function."""
    time = angle / plan[SPEED]
    if plan[SWING] == 0.0:
        return time
    swing = plan[SWINGS] * plan[SPEED]
    for _ in range(100):
        change = (angle_at(time, plan) - angle) / (plan[SPEED] * (1.0 + plan[SWING] * math.sin(swing * time)))
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
    near, far = plan[LAG] * plan[DEPTH] * upper, plan[LAG] * plan[DEPTH] * lower
    share, spacing = lower - upper, plan[SPACING]
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
        near, far = plan[LAG] * plan[DEPTH] * row[3], plan[LAG] * plan[DEPTH] * row[4]
        first = math.ceil((middle + row[0] - far - row[2]) / plan[SPACING] - 1e-12)
        if first * plan[SPACING] <= middle + row[0] - near - row[1]:
            return True
    return False


@numba.njit(cache=True)
def elements(rows, plan, degree):
    """Return start time, length of a step, steps, first point (-1 where nothing cuts) and start angle of each element."""
    period = plan[PERIOD]
    edges = np.empty(4 * rows.shape[0] * (int(period / plan[SPACING]) + 3) + 2)
    edges[0], edges[1], count = 0.0, period, 2
    for row in rows:
        near, far = plan[LAG] * plan[DEPTH] * row[3], plan[LAG] * plan[DEPTH] * row[4]
        for phi in (row[1], row[2]):
            for lag in (near, far):
                place = (phi + lag - row[0]) % plan[SPACING]
                while place < period - 1e-11:
                    if place > 1e-11:
                        edges[count] = place
                        count += 1
                    place += plan[SPACING]
                if far - near < _NARROW:
                    break
    edges = np.sort(edges[:count])
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
            steps = max(1, math.ceil((end - begin) / plan[STEP] - 1e-9))
            table[k, 1], table[k, 2], table[k, 3] = (end - begin) / steps, steps, point
            point += steps * degree + 1
        else:
            table[k, 1], table[k, 2], table[k, 3] = end - begin, 1, -1
    return table, point


@numba.njit(cache=True)
def _exponential_moments(z, moments):
    """Integrals over u from 0 to 1 of e^{z (1 - u)} u^k, k = 0, 1, ...; returns e^z."""
    top = moments.size - 1
    whole = np.exp(z)
    if abs(z) > top + 1.0:
        moments[0] = (whole - 1.0) / z
        for k in range(1, top + 1):
            moments[k] = (k * moments[k - 1] - 1.0) / z
    else:
        term = 1.0 / (top + 1.0) + 0.0j
        total = term
        for n in range(1, 80):
            term *= z / (top + 1.0 + n)
            total += term
            if abs(term) < 1e-17 * abs(total):
                break
        moments[top] = total
        for k in range(top, 0, -1):
            moments[k - 1] = (z * moments[k] + 1.0) / k
    return whole


@numba.njit(cache=True)
def responses(h, pole, outputs, inputs, table):
    """What a step of length h makes of a state and of forces at its nodes.

    Returns
    -------
    decay (q + 1, m), drive (q + 1, m, r) : at the step's end, of p, and of F at each node
    seen (2, q, r, m) : y and y' at nodes 1..q, real part of it times p
    echo (2, q, q + 1, r, r) : y and y' at nodes 1..q of F at each node, without the constant
    """
    q, m, r = table.shape[1] - 1, pole.size, outputs.shape[0]
    decay = np.empty((q + 1, m), dtype=np.complex128)
    drive = np.empty((q + 1, m, r), dtype=np.complex128)
    seen = np.empty((2, q, r, m), dtype=np.complex128)
    echo = np.zeros((2, q, q + 1, r, r))
    moments = np.empty(q + 1, dtype=np.complex128)
    decay[0] = 1.0
    for k in range(m):
        for j in range(1, q + 1):
            x = table[0, j]
            decay[j, k] = _exponential_moments(pole[k] * h * x, moments)
            for a in range(r):
                seen[0, j - 1, a, k] = 2.0 * outputs[a, k] * decay[j, k]
                seen[1, j - 1, a, k] = pole[k] * seen[0, j - 1, a, k]
            for i in range(q + 1):
                weight, power = 0.0j, h * x
                for n in range(q + 1):
                    weight += table[2 + i, n] * power * moments[n]
                    power *= x
                for a in range(r):
                    for b in range(r):
                        part = 2.0 * outputs[a, k] * weight * inputs[k, b]
                        echo[0, j - 1, i, a, b] += part.real
                        echo[1, j - 1, i, a, b] += (pole[k] * part).real
                        if i == j:
                            echo[1, j - 1, i, a, b] += (2.0 * outputs[a, k] * inputs[k, b]).real
                if j == q:
                    for b in range(r):
                        drive[i, k, b] = weight * inputs[k, b]
    return decay, drive, seen, echo


@numba.njit(cache=True)
def _solve(matrix, right):
    """Gaussian elimination with pivots, in place; right : (n, k)."""
    n = matrix.shape[0]
    for i in range(n):
        best = i
        for j in range(i + 1, n):
            if abs(matrix[j, i]) > abs(matrix[best, i]):
                best = j
        if best != i:
            for k in range(n):
                matrix[i, k], matrix[best, k] = matrix[best, k], matrix[i, k]
            for k in range(right.shape[1]):
                right[i, k], right[best, k] = right[best, k], right[i, k]
        for j in range(i + 1, n):
            factor = matrix[j, i] / matrix[i, i]
            if factor != 0.0:
                for k in range(i + 1, n):
                    matrix[j, k] -= factor * matrix[i, k]
                for k in range(right.shape[1]):
                    right[j, k] -= factor * right[i, k]
    for i in range(n - 1, -1, -1):
        for k in range(right.shape[1]):
            value = right[i, k]
            for j in range(i + 1, n):
                value -= matrix[i, j] * right[j, k]
            right[i, k] = value / matrix[i, i]


@numba.njit(cache=True)
def coefficients(rows, shapes, plan, places, points, table):
    """Stiffness by delay (n, d, r, r), its sum's damping (n, r, r), and rotation and time of each point."""
    q, r, count = table.shape[1] - 1, shapes.shape[2], plan.size - DELAYS
    stiffness, damping = np.zeros((points, count, r, r)), np.zeros((points, r, r))
    angle, time = np.empty(points), np.empty(points)
    weights, pair = np.empty(4), np.empty((2, 2, 2))
    for e in range(places.shape[0]):
        if places[e, 3] < 0:
            continue
        h, steps, first = places[e, 1], int(places[e, 2]), int(places[e, 3])
        end = plan[PERIOD] if e + 1 == places.shape[0] else places[e + 1, 4]
        middle = 0.5 * (places[e, 4] + end)
        for i in range(steps * q + 1):
            point = first + i
            time[point] = places[e, 0] + h * (i // q + table[0, i % q])
            theta = places[e, 4] if i == 0 else end if i == steps * q else angle_at(time[point], plan)
            angle[point] = theta
            swing = plan[SWINGS] * plan[SPEED]
            speed = plan[SPEED] * (1.0 + plan[SWING] * math.sin(swing * time[point])) * plan[RADIUS]
            weights[0], weights[1] = plan[DEPTH] * plan[KT], plan[DEPTH] * plan[KR]
            weights[2], weights[3] = plan[DEPTH] * plan[CT] / speed, plan[DEPTH] * plan[CR] / speed
            for w in range(rows.shape[0]):
                pair[:] = 0.0
                add_window(theta, middle, rows[w], plan, weights, pair)
                d = int(rows[w, 5])
                for a in range(r):
                    for b in range(r):
                        for i1 in range(2):
                            for i2 in range(2):
                                both = shapes[w, i1, a] * shapes[w, i2, b]
                                stiffness[point, d, a, b] += both * pair[0, i1, i2]
                                damping[point, a, b] += both * pair[1, i1, i2]
    if plan[FROZEN] > 0.0:
        # each step with its means: a step's nodes are its own, so the shared ones are kept by the step that starts there
        for e in range(places.shape[0]):
            if places[e, 3] < 0:
                continue
            for step in range(int(places[e, 2])):
                first = int(places[e, 3]) + step * q
                for d in range(count):
                    mean = np.zeros((r, r))
                    for j in range(q + 1):
                        mean += table[1, j] * stiffness[first + j, d]
                    for j in range(q):
                        stiffness[first + j, d] = mean
                mean = np.zeros((r, r))
                for j in range(q + 1):
                    mean += table[1, j] * damping[first + j]
                for j in range(q):
                    damping[first + j] = mean
    return stiffness, damping, angle, time


@numba.njit(cache=True)
def lookups(plan, places, points, angle, time, table):
    """Where the points find what the tool did a delay ago: first point of a step (+ points, if in this period) and the weights there."""
    q, count = table.shape[1] - 1, plan.size - DELAYS
    where = np.zeros((points, count), dtype=np.int64)
    weight = np.zeros((points, count, q + 1))
    for p in range(points):
        starts = _starts(places, p)
        for d in range(count):
            back = angle[p] - plan[DELAYS + d]
            now = back > -1e-9
            if not now:
                back += plan[PERIOD]
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
    return where, weight


@numba.njit(cache=True)
def _starts(places, point):
    """Whether an element starts with this point."""
    return np.any(places[:, 3] == point)


@numba.njit(cache=True)
def prepare(pole, outputs, inputs, constant, stiffness, damping, places, frozen, table):
    """Each element's responses, and each step's solution for the forces at its nodes.

    Returns
    -------
    decay, drive, seen, echo : as `responses`, for each element
    first (n, r, r) : (1 - K R - C V)^-1 at points where the force has to be found anew, V the velocity that a force makes at once
    later (n, q r, q r) : the same for nodes 1..q of the step that starts at a point
    """
    q, m, r = table.shape[1] - 1, pole.size, outputs.shape[0]
    count, points = places.shape[0], damping.shape[0]
    decay = np.empty((count, q + 1, m), dtype=np.complex128)
    drive = np.zeros((count, q + 1, m, r), dtype=np.complex128)
    seen = np.zeros((count, 2, q, r, m), dtype=np.complex128)
    echo = np.zeros((count, 2, q, q + 1, r, r))
    first, later = np.zeros((points, r, r)), np.zeros((points, q * r, q * r))
    total = stiffness.sum(axis=1)
    jump = np.zeros((r, r))
    for a in range(r):
        for b in range(r):
            for k in range(m):
                jump[a, b] += (2.0 * outputs[a, k] * inputs[k, b]).real
    for e in range(count):
        if places[e, 3] < 0:
            decay[e, q] = np.exp(pole * places[e, 1])
            continue
        done = -1
        for other in range(e):
            if places[other, 3] >= 0 and abs(places[other, 1] - places[e, 1]) < 1e-12 * places[e, 1]:
                done = other
        if done >= 0:
            decay[e], drive[e], seen[e], echo[e] = decay[done], drive[done], seen[done], echo[done]
        else:
            decay[e], drive[e], seen[e], echo[e] = responses(places[e, 1], pole, outputs, inputs, table)
            for j in range(q):
                echo[e, 0, j, j + 1] += constant
        for step in range(int(places[e, 2])):
            start = int(places[e, 3]) + step * q
            if step == 0 or frozen:
                matrix = np.eye(r) - total[start] @ constant - damping[start] @ jump
                first[start] = np.eye(r)
                _solve(matrix, first[start])
            matrix = np.eye(q * r)
            for j in range(q):
                node = start if frozen else start + j + 1
                for i in range(q):
                    for a in range(r):
                        for b in range(r):
                            for c in range(r):
                                matrix[j * r + a, i * r + b] -= (
                                    total[node, a, c] * echo[e, 0, j, i + 1, c, b] + damping[node, a, c] * echo[e, 1, j, i + 1, c, b]
                                )
            later[start] = np.eye(q * r)
            _solve(matrix, later[start])
    return decay, drive, seen, echo, first, later, total


@numba.njit(cache=True)
def march(state, motion, force, pole, outputs, constant, stiffness, damping, places, frozen, table, where, weight, prepared):
    """Move by one period. `motion` (2 n, r) holds y at all points, the last period's first; `force` (n, r) and the rest is written."""
    decay, drive, seen, echo, first, later, total = prepared
    q, m, r = table.shape[1] - 1, state.size, constant.shape[0]
    points, delays = damping.shape[0], stiffness.shape[1]
    free, right, pull = np.empty((2, q, r)), np.empty(q * r), np.empty(r)
    for e in range(places.shape[0]):
        if places[e, 3] < 0:
            for k in range(m):
                state[k] *= decay[e, q, k]
            continue
        for step in range(int(places[e, 2])):
            start = int(places[e, 3]) + step * q
            if step == 0 or frozen:
                # the force at once: the cut has just changed
                for a in range(r):
                    free[0, 0, a], free[1, 0, a], pull[a] = 0.0, 0.0, 0.0
                    for k in range(m):
                        y = 2.0 * outputs[a, k] * state[k]
                        free[0, 0, a] += y.real
                        free[1, 0, a] += (pole[k] * y).real
                for d in range(delays):
                    for b in range(r):
                        value = 0.0
                        for i in range(q + 1):
                            value += weight[start, d, i] * motion[where[start, d] + i, b]
                        for a in range(r):
                            pull[a] -= stiffness[start, d, a, b] * value
                for a in range(r):
                    for b in range(r):
                        pull[a] += total[start, a, b] * free[0, 0, b] + damping[start, a, b] * free[1, 0, b]
                for a in range(r):
                    value = 0.0
                    for b in range(r):
                        value += first[start, a, b] * pull[b]
                    force[start, a] = value
                for a in range(r):
                    value = free[0, 0, a]
                    for b in range(r):
                        value += constant[a, b] * force[start, b]
                    motion[points + start, a] = value
            for j in range(q):
                node = start if frozen else start + j + 1
                for a in range(r):
                    y, v = 0.0, 0.0
                    for k in range(m):
                        p = state[k]
                        y += seen[e, 0, j, a, k].real * p.real - seen[e, 0, j, a, k].imag * p.imag
                        v += seen[e, 1, j, a, k].real * p.real - seen[e, 1, j, a, k].imag * p.imag
                    for b in range(r):
                        y += echo[e, 0, j, 0, a, b] * force[start, b]
                        v += echo[e, 1, j, 0, a, b] * force[start, b]
                    free[0, j, a], free[1, j, a], right[j * r + a] = y, v, 0.0
                for d in range(delays):
                    for b in range(r):
                        if frozen:
                            # what was there a delay ago changes linearly over the step
                            begin, end = 0.0, 0.0
                            for i in range(q + 1):
                                begin += weight[start, d, i] * motion[where[start, d] + i, b]
                                end += weight[start + q, d, i] * motion[where[start + q, d] + i, b]
                            value = begin + table[0, j + 1] * (end - begin)
                        else:
                            value = 0.0
                            for i in range(q + 1):
                                value += weight[node, d, i] * motion[where[node, d] + i, b]
                        for a in range(r):
                            right[j * r + a] -= stiffness[node, d, a, b] * value
                for a in range(r):
                    for b in range(r):
                        right[j * r + a] += total[node, a, b] * free[0, j, b] + damping[node, a, b] * free[1, j, b]
            for j in range(q):
                for a in range(r):
                    value = 0.0
                    for i in range(q * r):
                        value += later[start, j * r + a, i] * right[i]
                    force[start + j + 1, a] = value
            for j in range(q):
                for a in range(r):
                    value = free[0, j, a]
                    for i in range(q):
                        for b in range(r):
                            value += echo[e, 0, j, i + 1, a, b] * force[start + i + 1, b]
                    motion[points + start + j + 1, a] = value
            for k in range(m):
                value = decay[e, q, k] * state[k]
                for i in range(q + 1):
                    for b in range(r):
                        value += drive[e, i, k, b] * force[start + i, b]
                state[k] = value


@numba.njit(cache=True)
def largest_of_hessenberg(hessenberg):
    """The eigenvalue of largest magnitude of a small real Hessenberg matrix, and its unit vector.

    Shifted QR steps by Givens rotations in complex arithmetic, the vector by inverse iteration.
    """
    n = hessenberg.shape[0]
    a = hessenberg.astype(np.complex128)
    size = 0.0
    for i in range(n):
        for j in range(max(i - 1, 0), n):
            size = max(size, abs(a[i, j]))
    cosines, sines = np.empty(n), np.empty(n, dtype=np.complex128)
    value = 0.0j
    last, tries = n - 1, 0
    while last >= 0:
        start = last
        while start > 0 and abs(a[start, start - 1]) > 1e-15 * (abs(a[start, start]) + abs(a[start - 1, start - 1])) + 1e-300:
            start -= 1
        if start == last:
            if abs(a[last, last]) > abs(value):
                value = a[last, last]
            last, tries = last - 1, 0
            continue
        if tries > 60:
            break
        tries += 1
        # Wilkinson's shift; now and then another one, against cycles
        half = 0.5 * (a[last - 1, last - 1] - a[last, last])
        product = a[last - 1, last] * a[last, last - 1]
        root = np.sqrt(half * half + product)
        if half.real * root.real + half.imag * root.imag < 0.0:
            root = -root
        down = half + root
        shift = a[last, last] - (product / down if down != 0.0 else 0.0j)
        if tries % 11 == 10:
            shift += abs(a[last, last - 1])
        for k in range(start, last + 1):
            a[k, k] -= shift
        for k in range(start, last):
            x, y = a[k, k], a[k + 1, k]
            length = math.sqrt(abs(x) ** 2 + abs(y) ** 2)
            if length == 0.0:
                cosines[k], sines[k] = 1.0, 0.0j
                continue
            c = abs(x) / length
            turn = x / abs(x) if x != 0.0 else 1.0 + 0.0j
            s = turn * y.conjugate() / length
            cosines[k], sines[k] = c, s
            for j in range(k, last + 1):
                u, v = a[k, j], a[k + 1, j]
                a[k, j] = c * u + s * v
                a[k + 1, j] = c * v - s.conjugate() * u
        for k in range(start, last):
            c, s = cosines[k], sines[k]
            for i in range(start, min(k + 2, last) + 1):
                u, v = a[i, k], a[i, k + 1]
                a[i, k] = c * u + s.conjugate() * v
                a[i, k + 1] = c * v - s * u
        for k in range(start, last + 1):
            a[k, k] += shift
    shifted = hessenberg.astype(np.complex128)
    vector = np.ones((n, 1), dtype=np.complex128)
    for _ in range(2):
        shifted[:] = hessenberg
        for k in range(n):
            shifted[k, k] -= value * (1.0 + 1e-13) + 1e-15 * size
        _solve(shifted, vector)
        vector /= math.sqrt(np.sum(np.abs(vector) ** 2))
    return value, vector[:, 0]


@numba.njit(cache=True)
def multiplier(pole, outputs, inputs, constant, rows, shapes, plan, table, start):
    """The period map's eigenvalue of largest magnitude by Arnoldi's method without restarts.

    Parameters
    ----------
    start : array
        First Krylov vector, of any length: what it lacks is made up.

    Returns
    -------
    complex, float, int : eigenvalue, its residual as a share of it, Krylov vectors
    vector (complex) : state and motion that it belongs to
    force (complex), elements, time : at the points, of that vector
    """
    q, m, r = table.shape[1] - 1, pole.size, outputs.shape[0]
    frozen = plan[FROZEN] > 0.0
    places, points = elements(rows, plan, q)
    stiffness, damping, angle, time = coefficients(rows, shapes, plan, places, points, table)
    where, weight = lookups(plan, places, points, angle, time, table)
    prepared = prepare(pole, outputs, inputs, constant, stiffness, damping, places, frozen, table)
    kept = points
    for p in range(points):
        for d in range(plan.size - DELAYS):
            kept = min(kept, where[p, d])
    size = 2 * m + (points - kept) * r
    most = min(_MOST, size)
    basis, hessenberg = np.zeros((most + 1, size)), np.zeros((most + 1, most))
    motion, force, state = np.zeros((2 * points, r)), np.zeros((points, r)), np.empty(m, dtype=np.complex128)
    # a start without any symmetry: the golden ratio's multiples, beside what is known
    for i in range(size):
        basis[0, i] = 0.05 * ((i + 1) * 0.6180339887498949 % 1.0 - 0.5)
    norm = np.sqrt(np.sum(start**2))
    if start.size == size and norm > 0.0:
        basis[0] += start / norm
    basis[0] /= np.sqrt(np.sum(basis[0] ** 2))
    value, residual, used = 0.0j, 1.0, 0
    ritz = np.zeros(1, dtype=np.complex128)
    look = _FIRST
    for n in range(most):
        state[:] = basis[n, :m] + 1j * basis[n, m : 2 * m]
        motion[kept:points] = basis[n, 2 * m :].reshape(points - kept, r)
        march(state, motion, force, pole, outputs, constant, stiffness, damping, places, frozen, table, where, weight, prepared)
        after = basis[n + 1]
        after[:m], after[m : 2 * m] = state.real, state.imag
        after[2 * m :] = motion[points + kept :].reshape((points - kept) * r)
        for _ in range(2):
            # Gram-Schmidt, twice against rounding
            for i in range(n + 1):
                part = np.dot(basis[i], after)
                after -= part * basis[i]
                hessenberg[i, n] += part
        length = np.sqrt(np.sum(after**2))
        hessenberg[n + 1, n] = length
        used = n + 1
        ends = used == most or length < 1e-14 * np.sqrt(np.sum(hessenberg[:used, n] ** 2))
        if not ends:
            after /= length
        if used >= look or ends:
            look = used + _EVERY
            value, ritz = largest_of_hessenberg(hessenberg[:used, :used])
            residual = 0.0 if ends and used == size else length * abs(ritz[used - 1]) / max(abs(value), 1e-300)
            if residual < plan[TOLERANCE] or ends:
                break
    vector = np.zeros(size, dtype=np.complex128)
    for i in range(used):
        vector += ritz[i] * basis[i]
    waves = np.zeros((points, r), dtype=np.complex128)
    for part in range(2 if plan[WAVES] > 0.0 else 0):
        along = vector.real if part == 0 else vector.imag
        state[:] = along[:m] + 1j * along[m : 2 * m]
        motion[kept:points] = np.ascontiguousarray(along[2 * m :]).reshape(points - kept, r)
        march(state, motion, force, pole, outputs, constant, stiffness, damping, places, frozen, table, where, weight, prepared)
        waves += (1.0 if part == 0 else 1j) * force
    return value, residual, used, vector, waves, places, time
