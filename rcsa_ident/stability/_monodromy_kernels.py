"""One period of a milling cut as a linear map, step by step; arrays and scalars only.

The structure moves exactly, p' = pole p + inputs F, y = 2 Re(outputs p) + constant F. Within a step F is a polynomial through
Gauss-Lobatto nodes, and its response is exact. What the teeth do stands in `_cut_kernels`: a cut is laid out there once, so that the
map is applied many times. Loops over scalars throughout: an operation on whole arrays takes compiling a second or more, each.
"""

from __future__ import annotations

import math

import numba
import numpy as np

#: Krylov vectors between two looks at the eigenvalues, at least and at most; all of them at most.
_FIRST, _EVERY, _MOST = 8, 3, 240
#: A mode that decays by less than this many nepers in a period may stand beside the largest multiplier.
_LASTS = 1.5


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
def responses(h, modes, table, decay, drive, seen, echo):
    """Write what a step of length h makes of a state and of forces at its nodes.

    Parameters
    ----------
    decay (q + 1, m), drive (q + 1, m, r) : at the step's end, of p, and of F at each node
    seen (2, q, r, m) : y and y' at nodes 1..q, real part of it times p
    echo (2, q, q + 1, r, r), zero before : y and y' at nodes 1..q of F at each node, without the constant
    """
    pole, outputs, inputs, _ = modes
    q, m, r = table.shape[1] - 1, pole.size, outputs.shape[0]
    moments = np.empty(q + 1, dtype=np.complex128)
    for k in range(m):
        decay[0, k] = 1.0
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
def _identity(matrix):
    """Write the identity."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 1.0 if i == j else 0.0


@numba.njit(cache=True)
def prepare(modes, layout, table, frozen):
    """Each element's responses, and each step's solution for the forces at its nodes.

    Returns
    -------
    decay, drive, seen, echo : as `responses`, echo with the constant, for elements whose steps have a length of their own
    same (e,) : the element where an element finds them
    first (n, r, r) : (1 - K R - C V)^-1 at points where the force has to be found anew, V the velocity that a force makes at once
    later (n, q r, q r) : the same for nodes 1..q of the step that starts at a point
    total (n, r, r), kinds : stiffness of all delays; 2 where velocities matter, which they do to process damping only, else 1
    """
    pole, outputs, inputs, constant = modes
    places, stiffness, damping = layout.places, layout.stiffness, layout.damping
    q, m, r = table.shape[1] - 1, pole.size, outputs.shape[0]
    count, points = places.shape[0], damping.shape[0]
    decay = np.empty((count, q + 1, m), dtype=np.complex128)
    drive = np.zeros((count, q + 1, m, r), dtype=np.complex128)
    seen = np.zeros((count, 2, q, r, m), dtype=np.complex128)
    echo = np.zeros((count, 2, q, q + 1, r, r))
    first, later = np.zeros((points, r, r)), np.zeros((points, q * r, q * r))
    total, kinds = np.zeros((points, r, r)), 1
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
    same, small, matrix = np.arange(count), np.empty((r, r)), np.empty((q * r, q * r))
    for e in range(count):
        if places[e, 3] < 0:
            for k in range(m):
                decay[e, q, k] = np.exp(pole[k] * places[e, 1])
            continue
        for other in range(e):
            if places[other, 3] >= 0 and abs(places[other, 1] - places[e, 1]) < 1e-12 * places[e, 1]:
                same[e] = same[other]
        own = same[e]
        if own == e:
            responses(places[e, 1], modes, table, decay[e], drive[e], seen[e], echo[e])
            for j in range(q):
                for a in range(r):
                    for b in range(r):
                        echo[e, 0, j, j + 1, a, b] += constant[a, b]
        for step in range(int(places[e, 2])):
            start = int(places[e, 3]) + step * q
            if step == 0 or frozen:
                for a in range(r):
                    for b in range(r):
                        value = 1.0 if a == b else 0.0
                        first[start, a, b] = value
                        for c in range(r):
                            value -= total[start, a, c] * constant[c, b] + damping[start, a, c] * jump[c, b]
                        small[a, b] = value
                _solve(small, first[start])
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
            _identity(later[start])
            _solve(matrix, later[start])
    return decay, drive, seen, echo, same, first, later, total, kinds


@numba.njit(cache=True)
def _earlier(motion, where, weight, point, delay, row):
    """What the tool did a delay before a point."""
    place = where[point, delay]
    if weight[point, delay, 0] == 1.0:
        return motion[place, row]
    value = 0.0
    for i in range(weight.shape[2]):
        value += weight[point, delay, i] * motion[place + i, row]
    return value


@numba.njit(cache=True)
def march(state, motion, force, modes, layout, table, frozen, prepared):
    """Move by one period. `motion` (2 n, r) holds y at all points, the last period's first; `force` (n, r) and the rest is written."""
    pole, outputs, constant = modes.pole, modes.outputs, modes.constant
    places, stiffness, damping, where, weight, _ = layout
    decay, drive, seen, echo, same, first, later, total, kinds = prepared
    q, m, r = table.shape[1] - 1, state.size, constant.shape[0]
    points, delays = damping.shape[0], stiffness.shape[1]
    free, right, pull = np.zeros((2, q, r)), np.empty(q * r), np.empty(r)
    for e in range(places.shape[0]):
        own = same[e]
        if places[e, 3] < 0:
            for k in range(m):
                state[k] *= decay[own, q, k]
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
                    for b in range(r if where[start, d] >= 0 else 0):
                        value = _earlier(motion, where, weight, start, d, b)
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
                    right[j * r + a] = 0.0
                    for kind in range(kinds):
                        y = 0.0
                        for k in range(m):
                            y += seen[own, kind, j, a, k].real * state[k].real - seen[own, kind, j, a, k].imag * state[k].imag
                        for b in range(r):
                            y += echo[own, kind, j, 0, a, b] * force[start, b]
                        free[kind, j, a] = y
                for d in range(delays):
                    for b in range(r if where[node, d] >= 0 else 0):
                        if frozen:
                            # what was there a delay ago changes linearly over the step
                            begin = _earlier(motion, where, weight, start, d, b)
                            end = _earlier(motion, where, weight, start + q, d, b)
                            value = begin + table[0, j + 1] * (end - begin)
                        else:
                            value = _earlier(motion, where, weight, node, d, b)
                        for a in range(r):
                            right[j * r + a] -= stiffness[node, d, a, b] * value
                for a in range(r):
                    for b in range(r):
                        right[j * r + a] += total[node, a, b] * free[0, j, b]
                        if kinds == 2:
                            right[j * r + a] += damping[node, a, b] * free[1, j, b]
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
                            value += echo[own, 0, j, i + 1, a, b] * force[start + i + 1, b]
                    motion[points + start + j + 1, a] = value
            for k in range(m):
                value = decay[own, q, k] * state[k]
                for i in range(q + 1):
                    for b in range(r):
                        value += drive[own, i, k, b] * force[start + i, b]
                state[k] = value


@numba.njit(cache=True)
def largest_of_hessenberg(hessenberg):
    """The eigenvalue of largest magnitude of a small real Hessenberg matrix, and its unit vector.

    Shifted QR steps by Givens rotations in complex arithmetic, the vector by inverse iteration.
    """
    n = hessenberg.shape[0]
    a = np.empty((n, n), dtype=np.complex128)
    size = 0.0
    for i in range(n):
        for j in range(n):
            a[i, j] = hessenberg[i, j]
            if j >= i - 1:
                size = max(size, abs(hessenberg[i, j]))
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
            # not zero, for y is not, and hypot loses no small numbers
            length = math.hypot(abs(x), abs(y))
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
    column, vector = np.ones((n, 1), dtype=np.complex128), np.empty(n, dtype=np.complex128)
    for _ in range(2):
        for i in range(n):
            for j in range(n):
                a[i, j] = hessenberg[i, j]
            a[i, i] -= value * (1.0 + 1e-13) + 1e-15 * size
        _solve(a, column)
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
def multiplier(modes, layout, table, frozen, tolerance, waves, start):
    """The period map's eigenvalue of largest magnitude by Arnoldi's method [arnoldi1951] without restarts.

    Parameters
    ----------
    modes, layout : `ModeArrays`, `CutLayout`
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
    prepared = prepare(modes, layout, table, frozen)
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
        march(state, motion, force, modes, layout, table, frozen, prepared)
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
        march(state, motion, force, modes, layout, table, frozen, prepared)
        for point in range(points):
            for a in range(r):
                forces[point, a] += (1.0 if part == 0 else 1j) * force[point, a]
    return value, residual, used, vector, forces
