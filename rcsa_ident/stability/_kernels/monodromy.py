"""One period of a milling cut as a linear map, step by step; arrays and scalars only.

What the structure does within a step stands in `_step_kernels`, what the teeth do in `_cut_kernels`: both are laid out there once, so that
the map is applied many times. Loops over scalars throughout: an operation on whole arrays takes compiling a second or more, each.
"""

from __future__ import annotations

import math

import numba
import numpy as np

#: Krylov vectors between two looks at the eigenvalues, at least and at most; all of them at most.
_FIRST, _EVERY, _MOST = 8, 3, 240
#: A mode that decays by less than this many nepers in a period may stand beside the largest multiplier.
_LASTS = 1.5


@numba.njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def add_rows(rows, place, factors, sums):
    """Add factors @ rows[place] to the sums, four rows at once."""
    for k in range(0, rows.shape[1], 4):
        a, b, c, d = factors[k], factors[k + 1], factors[k + 2], factors[k + 3]
        for x in range(rows.shape[2]):
            sums[x] += a * rows[place, k, x] + b * rows[place, k + 1, x] + c * rows[place, k + 2, x] + d * rows[place, k + 3, x]


@numba.njit(cache=True)
def _solve(matrix, right, least):
    """Gaussian elimination in place, right : (n, k); pivots smaller than `least` are taken for as much."""
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
        if abs(matrix[i, i]) < least:
            matrix[i, i] = least
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
def _identity(matrix):
    """Write the identity."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 1.0 if i == j else 0.0


@numba.njit(cache=True)
def prepare(modes, layout, frozen, steps):
    """Each step's solution for the forces at its nodes.

    Returns
    -------
    first (n, r, r) : (1 - K R - C V)^-1 at points where the force has to be found anew, V the velocity that a force makes at once
    later : the same for nodes 1..q of each step, in the order of the steps, as rows for `add_rows`
    total (n, r, r), kinds : stiffness of all delays; 2 where velocities matter, which they do to process damping only, else 1
    """
    pole, outputs, inputs, constant = modes
    places, stiffness, damping = layout.places, layout.stiffness, layout.damping
    _, echo, same, free, moved, _ = steps
    q, m, r, points = echo.shape[2], pole.size, outputs.shape[0], damping.shape[0]
    first, total, kinds, count = np.zeros((points, r, r)), np.zeros((points, r, r)), 1, 0
    for e in range(places.shape[0]):
        count += int(places[e, 2]) if places[e, 3] >= 0 else 0
    later = np.zeros((count, moved.shape[1], free.shape[2]))
    for point in range(points):
        for a in range(r):
            for b in range(r):
                for d in range(stiffness.shape[1]):
                    total[point, a, b] += stiffness[point, d, a, b]
                if damping[point, a, b] != 0.0:
                    kinds = 2
    jump = np.zeros((r, r))
    for a in range(r):
        for b in range(r):
            for k in range(m):
                jump[a, b] += (2.0 * outputs[a, k] * inputs[k, b]).real
    small, matrix, solution, number = np.empty((r, r)), np.empty((q * r, q * r)), np.empty((q * r, q * r)), 0
    for e in range(places.shape[0]):
        own = same[e]
        for step in range(int(places[e, 2]) if places[e, 3] >= 0 else 0):
            start = int(places[e, 3]) + step * q
            if step == 0 or frozen:
                for a in range(r):
                    for b in range(r):
                        value = 1.0 if a == b else 0.0
                        first[start, a, b] = value
                        for c in range(r):
                            value -= total[start, a, c] * constant[c, b] + damping[start, a, c] * jump[c, b]
                        small[a, b] = value
                _solve(small, first[start], 0.0)
            _identity(matrix)
            for j in range(q):
                node = start if frozen else start + j + 1
                for i in range(q):
                    for a in range(r):
                        for b in range(r):
                            for c in range(r):
                                matrix[j * r + a, i * r + b] -= (
                                    total[node, a, c] * echo[own, 0, j, i + 1, c, b] + damping[node, a, c] * echo[own, 1, j, i + 1, c, b]
                                )
            _identity(solution)
            _solve(matrix, solution, 0.0)
            for j in range(q * r):
                for i in range(q * r):
                    later[number, i, j] = solution[j, i]
            number += 1
    return first, later, total, kinds


@numba.njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _earlier(motion, where, weight, point, delay, past):
    """Write what the tool did a delay before a point."""
    place = where[point, delay]
    if weight[point, delay, 0] == 1.0:
        for b in range(past.size):
            past[b] = motion[place, b]
        return
    for b in range(past.size):
        past[b] = 0.0
    for i in range(weight.shape[2]):
        share = weight[point, delay, i]
        for b in range(past.size):
            past[b] += share * motion[place + i, b]


@numba.njit(cache=True)
def march(state, motion, force, modes, layout, table, frozen, steps, prepared):
    """Move by one period. `motion` (2 n, r) holds y at all points, the last period's first; `force` (n, r) and the rest is written."""
    pole, outputs, constant = modes.pole, modes.outputs, modes.constant
    places, stiffness, damping, where, weight, _ = layout
    (decay, _, same, free, moved, driven), (first, later, total, kinds) = steps, prepared
    q, m, r, count = table.shape[1] - 1, state.size, constant.shape[0], places.shape[0]
    points, delays, pairs = damping.shape[0], stiffness.shape[1], driven.shape[2] // 2
    # the state and the force at a step's start, the forces at all its nodes, and what nodes 1..q do without their forces
    known, forces, after = np.zeros(free.shape[1]), np.zeros(driven.shape[1]), np.zeros(2 * pairs)
    seen, right, found = np.zeros((2, free.shape[2])), np.zeros(later.shape[1]), np.zeros(later.shape[2])
    pull, past, number = np.empty(r), np.empty(r), 0
    for k in range(m):
        known[k], known[pairs + k] = state[k].real, state[k].imag
    for e in range(count):
        own = same[e]
        if places[e, 3] < 0:
            for k in range(m):
                turned = decay[own, q, k] * complex(known[k], known[pairs + k])
                known[k], known[pairs + k] = turned.real, turned.imag
            continue
        for step in range(int(places[e, 2])):
            start = int(places[e, 3]) + step * q
            if step == 0 or frozen:
                # the force at once: the cut has just changed
                for a in range(r):
                    seen[0, a], seen[1, a], pull[a] = 0.0, 0.0, 0.0
                    for k in range(m):
                        y = 2.0 * outputs[a, k] * complex(known[k], known[pairs + k])
                        seen[0, a] += y.real
                        seen[1, a] += (pole[k] * y).real
                for d in range(delays):
                    if where[start, d] < 0:
                        continue
                    _earlier(motion, where, weight, start, d, past)
                    for a in range(r):
                        for b in range(r):
                            pull[a] -= stiffness[start, d, a, b] * past[b]
                for a in range(r):
                    for b in range(r):
                        pull[a] += total[start, a, b] * seen[0, b] + damping[start, a, b] * seen[1, b]
                for a in range(r):
                    value = 0.0
                    for b in range(r):
                        value += first[start, a, b] * pull[b]
                    force[start, a] = value
                for a in range(r):
                    value = seen[0, a]
                    for b in range(r):
                        value += constant[a, b] * force[start, b]
                    motion[points + start, a] = value
            for a in range(r):
                known[2 * pairs + a] = force[start, a]
            for kind in range(kinds):
                seen[kind, :] = 0.0
                add_rows(free, kind * count + own, known, seen[kind])
            for j in range(q):
                node = start if frozen else start + j + 1
                for a in range(r):
                    value = 0.0
                    for b in range(r):
                        value += total[node, a, b] * seen[0, j * r + b]
                        if kinds == 2:
                            value += damping[node, a, b] * seen[1, j * r + b]
                    right[j * r + a] = value
                for d in range(delays):
                    if where[node, d] < 0:
                        continue
                    _earlier(motion, where, weight, node, d, past)
                    if frozen:
                        # what was there a delay ago changes linearly over the step
                        _earlier(motion, where, weight, start + q, d, pull)
                        for b in range(r):
                            past[b] += table[0, j + 1] * (pull[b] - past[b])
                    for a in range(r):
                        for b in range(r):
                            right[j * r + a] -= stiffness[node, d, a, b] * past[b]
            found[:] = 0.0
            add_rows(later, number, right, found)
            add_rows(moved, own, found, seen[0])
            for a in range(r):
                forces[a] = force[start, a]
                for j in range(q):
                    forces[(j + 1) * r + a] = force[start + j + 1, a] = found[j * r + a]
                    motion[points + start + j + 1, a] = seen[0, j * r + a]
            for k in range(m):
                turned = decay[own, q, k] * complex(known[k], known[pairs + k])
                after[k], after[pairs + k] = turned.real, turned.imag
            add_rows(driven, own, forces, after)
            for k in range(m):
                known[k], known[pairs + k] = after[k], after[pairs + k]
            number += 1
    for k in range(m):
        state[k] = complex(known[k], known[pairs + k])


@numba.njit(cache=True)
def _of_two(a, b, c, d):
    """The eigenvalue of [[a, b], [c, d]] of largest magnitude, of a pair the one above the real axis."""
    half, product = 0.5 * (a - d), b * c
    inner = half * half + product
    if inner < 0.0:
        return complex(d + half, math.sqrt(-inner))
    # the further one first: the difference of the other would lose digits
    far = half + math.copysign(math.sqrt(inner), half)
    one, other = d + far, d - product / far if far != 0.0 else d
    return complex(one if abs(one) > abs(other) else other, 0.0)


@numba.njit(cache=True)
def _largest_eigenvalue(a):
    """The eigenvalue of largest magnitude of a real Hessenberg matrix, which is overwritten: double-shift QR steps [francis1962]."""
    value, last, tries = 0.0j, a.shape[0] - 1, 0
    while last >= 0:
        start = last
        while start > 0 and abs(a[start, start - 1]) > 1e-15 * (abs(a[start, start]) + abs(a[start - 1, start - 1])) + 1e-300:
            start -= 1
        if start >= last - 1:
            found = complex(a[last, last], 0.0)
            if start < last:
                found = _of_two(a[start, start], a[start, last], a[last, start], a[last, last])
            if abs(found) > abs(value):
                value = found
            last, tries = start - 1, 0
            continue
        if tries > 60:
            break
        tries += 1
        # both eigenvalues of the last two rows as shifts; now and then others, against cycles
        total = a[last - 1, last - 1] + a[last, last]
        product = a[last - 1, last - 1] * a[last, last] - a[last, last - 1] * a[last - 1, last]
        if tries % 11 == 10:
            off = abs(a[last, last - 1]) + abs(a[last - 1, last - 2])
            total, product = 1.5 * off, off * off
        # the first column of the shifted square, then the bulge that it leaves below the diagonal
        first, below = a[start, start], a[start + 1, start]
        x = first * (first - total) + product + a[start, start + 1] * below
        y, z = below * (first + a[start + 1, start + 1] - total), below * a[start + 2, start + 1]
        for k in range(start, last):
            third = k + 2 if k < last - 1 else k + 1
            if k > start:
                x, y, z = a[k, k - 1], a[k + 1, k - 1], a[k + 2, k - 1] if third > k + 1 else 0.0
            size = max(abs(x), abs(y), abs(z))
            if size == 0.0:
                continue
            x, y, z = x / size, y / size, z / size
            length = math.copysign(math.sqrt(x * x + y * y + z * z), x)
            if k > start:
                a[k, k - 1], a[k + 1, k - 1] = -length * size, 0.0
                if third > k + 1:
                    a[third, k - 1] = 0.0
            # the reflection 1 - u (1, v, w), whose last entry is zero in the last step
            x += length
            u0, u1, u2, v, w = x / length, y / length, z / length, y / x, z / x
            for j in range(k, last + 1):
                part = a[k, j] + v * a[k + 1, j] + w * a[third, j]
                a[k, j] -= u0 * part
                a[k + 1, j] -= u1 * part
                a[third, j] -= u2 * part
            for i in range(start, min(k + 3, last) + 1):
                part = u0 * a[i, k] + u1 * a[i, k + 1] + u2 * a[i, third]
                a[i, k] -= part
                a[i, k + 1] -= v * part
                a[i, third] -= w * part
    return value


@numba.njit(cache=True)
def largest_of_hessenberg(hessenberg):
    """The eigenvalue of largest magnitude of a small real Hessenberg matrix, and its unit vector by inverse iteration."""
    n = hessenberg.shape[0]
    value, size = _largest_eigenvalue(hessenberg.copy()), 0.0
    a = np.empty((n, n), dtype=np.complex128)
    for i in range(n):
        for j in range(max(i - 1, 0), n):
            size = max(size, abs(hessenberg[i, j]))
    column, vector = np.empty((n, 1), dtype=np.complex128), np.empty(n, dtype=np.complex128)
    # without any symmetry, so that it is orthogonal to no eigenvector: ones are to (1, -1, 1, -1, ...)
    for i in range(n):
        column[i, 0] = 0.5 + (i + 1) * 0.6180339887498949 % 1.0
    for _ in range(2):
        for i in range(n):
            for j in range(n):
                a[i, j] = hessenberg[i, j]
            a[i, i] -= value * (1.0 + 1e-13) + 1e-15 * size
        # of an eigenvalue nothing may be left of a pivot
        _solve(a, column, 1e-16 * size)
        length = 0.0
        for i in range(n):
            length += column[i, 0].real ** 2 + column[i, 0].imag ** 2
        for i in range(n):
            column[i, 0] /= math.sqrt(length)
            vector[i] = column[i, 0]
    return value, vector


@numba.njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def orthogonalised(basis, count, vector, parts):
    """Take the parts along the first `count` rows of `basis` out of `vector`, in place; they are added to `parts`. Returns its length."""
    size = vector.size
    length = 0.0
    for k in range(size):
        length += vector[k] * vector[k]
    for _ in range(3):
        before = length
        for i in range(count):
            part = 0.0
            for k in range(size):
                part += basis[i, k] * vector[k]
            for k in range(size):
                vector[k] -= part * basis[i, k]
            parts[i] += part
        length = 0.0
        for k in range(size):
            length += vector[k] * vector[k]
        # once more where most of it was taken out: what is left would be rounding
        if length > 0.1 * before:
            break
    return math.sqrt(length)


@numba.njit(cache=True)
def _length(vector):
    """Euclidean length of a real vector."""
    total = 0.0
    for i in range(vector.size):
        total += vector[i] * vector[i]
    return math.sqrt(total)


@numba.njit(cache=True)
def _unpack(vector, state, motion, kept):
    """Write a Krylov vector into the state and into the last period's motion from the point `kept` on."""
    m, r = state.size, motion.shape[1]
    for k in range(m):
        state[k] = complex(vector[k], vector[m + k])
    for i in range((motion.shape[0] // 2 - kept) * r):
        motion[kept + i // r, i % r] = vector[2 * m + i]


@numba.njit(cache=True)
def multiplier(modes, layout, table, frozen, steps, tolerance, waves, start):
    """The period map's eigenvalue of largest magnitude by Arnoldi's method [arnoldi1951] without restarts.

    Parameters
    ----------
    modes, layout, steps : `ModeArrays`, `CutLayout`, and what `_step_kernels.steps` makes of their elements
    frozen : constant coefficients within a step
    tolerance : residual of the eigenvalue, as a share of it, at which the search ends
    waves : whether the vector's forces are wanted
    start : first Krylov vector, of any length: what it lacks is made up

    Returns
    -------
    complex, float, int : eigenvalue, its residual as a share of it, Krylov vectors
    vector (complex) : state and motion that it belongs to
    force (complex) : at the points, of that vector
    """
    pole, places, where = modes.pole, layout.places, layout.where
    m, r, points = pole.size, modes.outputs.shape[0], layout.damping.shape[0]
    prepared = prepare(modes, layout, frozen, steps)
    kept = points
    for place in where.ravel():
        # below zero where nothing is looked up
        kept = min(kept, place if place >= 0 else points)
    size = 2 * m + (points - kept) * r
    most = min(_MOST, size)
    basis, hessenberg = np.zeros((most + 1, size)), np.zeros((most + 1, most))
    motion, force, state = np.zeros((2 * points, r)), np.zeros((points, r)), np.empty(m, dtype=np.complex128)
    norm = _length(start) if start.size == size else 0.0
    # a start without any symmetry: the golden ratio's multiples, beside what is known
    for i in range(size):
        basis[0, i] = 0.5 * ((i + 1) * 0.6180339887498949 % 1.0 - 0.5) + (start[i] / norm if norm > 0.0 else 0.0)
    norm = _length(basis[0])
    for i in range(size):
        basis[0, i] /= norm
    value, residual, used = 0.0j, 1.0, 0
    ritz = np.zeros(1, dtype=np.complex128)
    # as many eigenvalues as the structure itself has near the largest: fewer vectors may hide one of them
    duration = places[-1, 0] + places[-1, 1] * places[-1, 2]
    look, slowest = _FIRST, pole.real.max()
    for k in range(m):
        if pole[k].real * duration > -_LASTS and (pole[k].real - slowest) * duration > -0.5 * _LASTS:
            look += 2
    for n in range(most):
        _unpack(basis[n], state, motion, kept)
        march(state, motion, force, modes, layout, table, frozen, steps, prepared)
        after = basis[n + 1]
        for k in range(m):
            after[k], after[m + k] = state[k].real, state[k].imag
        for point in range(points - kept):
            for a in range(r):
                after[2 * m + point * r + a] = motion[points + kept + point, a]
        length = orthogonalised(basis, n + 1, after, hessenberg[:, n])
        hessenberg[n + 1, n] = length
        used = n + 1
        ends = used == most or length < 1e-14 * _length(hessenberg[:used, n])
        if not ends:
            for i in range(size):
                after[i] /= length
        if used >= look or ends:
            look = used + _EVERY
            value, ritz = largest_of_hessenberg(hessenberg[:used, :used])
            residual = 0.0 if ends and used == size else length * abs(ritz[used - 1]) / max(abs(value), 1e-300)
            if residual < tolerance or ends:
                break
    vector, along = np.zeros(size, dtype=np.complex128), np.empty(size)
    for i in range(used):
        for k in range(size):
            vector[k] += ritz[i] * basis[i, k]
    forces = np.zeros((points, r), dtype=np.complex128)
    for part in range(2 if waves else 0):
        for i in range(size):
            along[i] = vector[i].real if part == 0 else vector[i].imag
        _unpack(along, state, motion, kept)
        march(state, motion, force, modes, layout, table, frozen, steps, prepared)
        for point in range(points):
            for a in range(r):
                forces[point, a] += (1.0 if part == 0 else 1j) * force[point, a]
    return value, residual, used, vector, forces
