"""What a structure does in one step of time, exactly: p' = pole p + inputs F, y = 2 Re(outputs p) + constant F; arrays and scalars only.

Within a step F is a polynomial through Gauss-Lobatto nodes. Loops over scalars throughout: an operation on whole arrays takes compiling a
second or more, each.
"""

from __future__ import annotations

import numba
import numpy as np

#: Rows have a multiple of these lengths, so that loops over them leave no remainder.
_LANES, _PAIRS, _ROWS = 16, 8, 4


@numba.njit(cache=True)
def _padded(count, multiple):
    """A count, rounded up."""
    return (count + multiple - 1) // multiple * multiple


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
def steps(modes, places, table):
    """What elements of steps make of a state and of forces; the last three are rows that `_monodromy_kernels.add_rows` adds up.

    Returns
    -------
    decay (e, q + 1, m), echo (e, 2, q, q + 1, r, r) : as `responses`, echo with the constant
    same (e,) : the element where an element finds its own
    free (2 e, ., .) : motion at nodes 1..q, behind all motions velocities, of each real part of p, imaginary part and force at the start
    moved (e, ., .) : motion at nodes 1..q of each force there
    driven (e, ., .) : real and imaginary parts of p at the end of each force
    """
    pole, outputs, _, constant = modes
    q, m, r, count = table.shape[1] - 1, pole.size, outputs.shape[0], places.shape[0]
    pairs, lanes = _padded(m, _PAIRS), _padded(q * r, _LANES)
    decay, drive = np.empty((count, q + 1, m), dtype=np.complex128), np.empty((q + 1, m, r), dtype=np.complex128)
    seen, echo, same = np.empty((2, q, r, m), dtype=np.complex128), np.zeros((count, 2, q, q + 1, r, r)), np.arange(count)
    free = np.zeros((2 * count, _padded(2 * pairs + r, _ROWS), lanes))
    moved = np.zeros((count, _padded(q * r, _ROWS), lanes))
    driven = np.zeros((count, _padded((q + 1) * r, _ROWS), 2 * pairs))
    for e in range(count):
        if places[e, 3] < 0:
            for k in range(m):
                decay[e, q, k] = np.exp(pole[k] * places[e, 1])
            continue
        for other in range(e):
            if places[other, 3] >= 0 and abs(places[other, 1] - places[e, 1]) < 1e-12 * places[e, 1]:
                same[e] = same[other]
        if same[e] != e:
            continue
        responses(places[e, 1], modes, table, decay[e], drive, seen, echo[e])
        for j in range(q):
            for a in range(r):
                for b in range(r):
                    echo[e, 0, j, j + 1, a, b] += constant[a, b]
                for kind in range(2):
                    for k in range(m):
                        free[kind * count + e, k, j * r + a] = seen[kind, j, a, k].real
                        free[kind * count + e, pairs + k, j * r + a] = -seen[kind, j, a, k].imag
                    for b in range(r):
                        free[kind * count + e, 2 * pairs + b, j * r + a] = echo[e, kind, j, 0, a, b]
                for i in range(q):
                    for b in range(r):
                        moved[e, i * r + b, j * r + a] = echo[e, 0, j, i + 1, a, b]
        for i in range(q + 1):
            for b in range(r):
                for k in range(m):
                    driven[e, i * r + b, k] = drive[i, k, b].real
                    driven[e, i * r + b, pairs + k] = drive[i, k, b].imag
    return decay, echo, same, free, moved, driven
