"""Lines of a robot at postures, with their gradient; arrays and scalars only.

Scaled units as in `identification._kernels`: slopes are multiplied and moments divided by a lever, all receptances are in m/N.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np


class ArmArrays(NamedTuple):
    """An arm as the kernel reads it.

    mass (c, n, n) at each posture, the sum of G^T G over its bodies (c, b, 6, n); shapes (c, n, 6): what each freedom moves at the flange,
    t and r in X and in Y, along Z and about it; stiffness, damping (n,).
    """

    mass: np.ndarray
    bodies: np.ndarray
    shapes: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray


class SpindleArrays(NamedTuple):
    """The spindle on a clamped housing: omega_n (m,); psi (m, 4): flange t, r in X and in Y, against the housing; pull (m, 4): what the
    same motion of the housing pulls a mode with; factor (m, m) lower triangular; residual (4, 4) lower triangular factor; joint (4,): k_t,
    k_r, c_t, c_r.
    """

    omega_n: np.ndarray
    psi: np.ndarray
    pull: np.ndarray
    factor: np.ndarray
    residual: np.ndarray
    joint: np.ndarray


class PosedPoints(NamedTuple):
    """Points at which a cut's line is asked for: (p,) omega; (p,) posture; (p, 2) places of the line of X and of Y or -1; (p, 6, 6) A22
    and (p, 6, 3) A21 of the cut's tooling; (p, 3) complex forces in X, Y and Z.
    """

    omega: np.ndarray
    posture: np.ndarray
    place: np.ndarray
    flange: np.ndarray
    tip: np.ndarray
    force: np.ndarray


class LineArrays(NamedTuple):
    """What the kernel fills for one axis: (n, o, 3) displacement by the forces in X, Y and Z [m]; (n, o, q) its gradient, or (0, o, q);
    (n, o, 4) v and (n, 4) x, with which a change dB of the flange's receptance moves it by v^T dB x, or (0, o, 4) and (0, 4).
    """

    parts: np.ndarray
    gradient: np.ndarray
    felt: np.ndarray
    moved: np.ndarray


@numba.njit(cache=True, error_model="numpy")
def factorise(matrix):
    """Replace a square complex matrix by its factors L U without pivoting; the pivots' inverses stand on the diagonal.

    Z / (i omega) has a positive semidefinite Hermitian part: such matrices need no pivoting.
    """
    m = matrix.shape[0]
    for j in range(m):
        inverse = 1.0 / matrix[j, j]
        matrix[j, j] = inverse
        for i in range(j + 1, m):
            ratio = matrix[i, j] * inverse
            matrix[i, j] = ratio
            for k in range(j + 1, m):
                matrix[i, k] -= ratio * matrix[j, k]


@numba.njit(cache=True, error_model="numpy")
def solve(factors, right):
    """Solve L U x = right in place, all columns."""
    m, columns = right.shape
    for i in range(m):
        for k in range(i):
            ratio = factors[i, k]
            for c in range(columns):
                right[i, c] -= ratio * right[k, c]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            ratio = factors[i, k]
            for c in range(columns):
                right[i, c] -= ratio * right[k, c]
        inverse = factors[i, i]
        for c in range(columns):
            right[i, c] *= inverse


@numba.njit(cache=True, error_model="numpy")
def solve_transposed(factors, right):
    """Solve (L U)^T x = right in place, all columns."""
    m, columns = right.shape
    for i in range(m):
        inverse = factors[i, i]
        for c in range(columns):
            right[i, c] *= inverse
        for k in range(i + 1, m):
            ratio = factors[i, k]
            for c in range(columns):
                right[k, c] -= ratio * right[i, c]
    for i in range(m - 1, -1, -1):
        for k in range(i):
            ratio = factors[i, k]
            for c in range(columns):
                right[k, c] -= ratio * right[i, c]


@numba.njit(cache=True, error_model="numpy")
def _through(factor, p, q, lp, lq):
    """Write L^T p and L^T q of a lower triangular L into `lp` and `lq`."""
    m = factor.shape[0]
    for j in range(m):
        sum_p, sum_q = complex(0.0, 0.0), complex(0.0, 0.0)
        for i in range(j, m):
            sum_p += factor[i, j] * p[i]
            sum_q += factor[i, j] * q[i]
        lp[j], lq[j] = sum_p, sum_q


@numba.njit(cache=True, error_model="numpy")
def _lower(row, k, scale, ends, through):
    """Write the change of scale p^T L L^T q with the lower triangle of L by rows into `row` from k on; return where it ends.

    ends: p and q; through: L^T p and L^T q.
    """
    p, q = ends
    lp, lq = through
    for i in range(p.size):
        for j in range(i + 1):
            row[k] = scale * (p[i] * lq[j] + lp[j] * q[i])
            k += 1
    return k


@numba.njit(cache=True, error_model="numpy")
def posed_lines(arm, spindle, points, lines_x, lines_y):
    """Fill the lines of both axes: displacement of flange, or of gap and fixture, by each force, and its gradient.

    Arm and spindle are one system of n + m freedoms, Z = K - w^2 M + i w C with M = [[M(q), S P^T], [P S^T, 1]], C = [[C, 0], [0, L L^T]].
    The housing moves as S^T q, the flange as T^T = [S; Psi]^T of all of them, and gives way by R R^T more. With B = T^T Z^-1 T + R R^T and
    E = A22 + K_joint^-1 + B over six directions, an output of row b answers b x with x = E^-1 A21 F. With y = E^-T b^T, v = the row's share
    of the flange - y, p = Z^-1 (T v + the row's share of the housing), q = Z^-1 T x:
    d line = v^T dB x + p^T (dT x - dZ q) + v^T dT^T q - y^T dK_joint^-1 x.

    The gradient's columns: stiffness (n), damping (n), logarithms of the bodies' masses (b), log omega_n (m), psi by rows (4 m), pull by
    rows (4 m), factor's lower triangle by rows, residual's lower triangle by rows (10), joint (4).
    """
    omega_n, psi, pull, factor, residual, joint = spindle
    n, m, bodies = arm.stiffness.size, omega_n.size, arm.bodies.shape[1]
    linear = lines_x.gradient.shape[0] > 0 or lines_y.gradient.shape[0] > 0
    outputs = lines_x.parts.shape[1]
    damping = factor @ factor.T
    static = residual @ residual.T
    dynamic = np.empty((n + m, n + m), dtype=np.complex128)
    # what moves the flange's six directions, and behind them the housing along X and Y
    seen = np.zeros((n + m, 8))
    right = np.empty((n + m, 8), dtype=np.complex128)
    block = np.empty((8, 6), dtype=np.complex128)
    together = np.empty((6, 6), dtype=np.complex128)
    carried = np.empty((6, 3), dtype=np.complex128)
    x, v, b = np.empty((3, 6), dtype=np.complex128)
    rx, rv, hp, hq = np.empty((4, 4), dtype=np.complex128)
    column = np.empty((6, 1), dtype=np.complex128)
    y = column[:, 0]
    p, q = np.empty((2, n + m), dtype=np.complex128)
    lp, lq = np.empty((2, m), dtype=np.complex128)
    swung = np.empty((bodies, 6), dtype=np.complex128)
    seen[n:, :4] = psi
    for f in range(points.omega.size):
        w, c = points.omega[f], points.posture[f]
        shapes = arm.shapes[c]
        for i in range(n):
            for j in range(n):
                dynamic[i, j] = complex(-w * w * arm.mass[c, i, j], 0.0)
            dynamic[i, i] += complex(arm.stiffness[i], w * arm.damping[i])
            for a in range(6):
                seen[i, a] = shapes[i, a]
            seen[i, 6], seen[i, 7] = shapes[i, 0], shapes[i, 2]
            for j in range(m):
                pulled = 0.0
                for d in range(4):
                    pulled += shapes[i, d] * pull[j, d]
                dynamic[i, n + j] = dynamic[n + j, i] = complex(-w * w * pulled, 0.0)
        for i in range(m):
            for j in range(m):
                dynamic[n + i, n + j] = complex(omega_n[i] ** 2 - w * w if i == j else 0.0, w * damping[i, j])
        right[:] = seen
        factorise(dynamic)
        solve(dynamic, right)
        for a in range(8):
            for d in range(6):
                total = complex(static[a, d] if a < 4 and d < 4 else 0.0, 0.0)
                for i in range(n + m if a < 6 else n):
                    total += seen[i, a] * right[i, d]
                block[a, d] = total
        k_t, k_r = 1.0 / complex(joint[0], w * joint[2]), 1.0 / complex(joint[1], w * joint[3])
        for a in range(6):
            for d in range(6):
                together[a, d] = points.flange[f, a, d] + block[a, d]
            together[a, a] += k_t if a % 2 == 0 else k_r
            for d in range(3):
                carried[a, d] = points.tip[f, a, d]
        factorise(together)
        solve(together, carried)
        for a in range(6):
            x[a] = carried[a, 0] * points.force[f, 0] + carried[a, 1] * points.force[f, 1] + carried[a, 2] * points.force[f, 2]
        for i in range(n + m):
            total = complex(0.0, 0.0)
            for d in range(6):
                total += right[i, d] * x[d]
            q[i] = total
        if linear:
            for k in range(bodies):
                for d in range(6):
                    total = complex(0.0, 0.0)
                    for i in range(n):
                        total += arm.bodies[c, k, d, i] * q[i]
                    swung[k, d] = w * w * total
        for axis in range(2):
            place = points.place[f, axis]
            if place < 0:
                continue
            parts = lines_x.parts if axis == 0 else lines_y.parts
            gradient = lines_x.gradient if axis == 0 else lines_y.gradient
            felt = lines_x.felt if axis == 0 else lines_y.felt
            moved = lines_x.moved if axis == 0 else lines_y.moved
            for o in range(outputs):
                # share of flange and fixture in the output
                flange = 1.0 if o == 0 else 0.0
                fixture = 0.0 if outputs == 1 else 2.0 * o - 1.0
                for d in range(6):
                    b[d] = flange * block[2 * axis, d] + fixture * block[6 + axis, d]
                for side in range(3):
                    total = complex(0.0, 0.0)
                    for d in range(6):
                        total += b[d] * carried[d, side]
                    parts[place, o, side] = total * points.force[f, side]
                if not linear:
                    continue
                y[:] = b
                solve_transposed(together, column)
                v[:] = -y
                v[2 * axis] += flange
                for d in range(4):
                    felt[place, o, d] = v[d]
                    moved[place, d] = x[d]
                for i in range(n + m):
                    total = fixture * right[i, 6 + axis]
                    for d in range(6):
                        total += right[i, d] * v[d]
                    p[i] = total
                row = gradient[place, o]
                for i in range(n):
                    row[i] = -p[i] * q[i]
                    row[n + i] = complex(0.0, w) * row[i]
                for d in range(4):
                    sum_p, sum_q = complex(0.0, 0.0), complex(0.0, 0.0)
                    for i in range(n):
                        sum_p += shapes[i, d] * p[i]
                        sum_q += shapes[i, d] * q[i]
                    hp[d], hq[d] = w * w * sum_p, w * w * sum_q
                _through(factor, p[n:], q[n:], lp, lq)
                _through(residual, v, x, rv, rx)
                k = 2 * n
                for body in range(bodies):
                    total = complex(0.0, 0.0)
                    for d in range(6):
                        own = complex(0.0, 0.0)
                        for i in range(n):
                            own += arm.bodies[c, body, d, i] * p[i]
                        total += own * swung[body, d]
                    row[k] = total
                    k += 1
                for i in range(m):
                    row[k] = -2.0 * omega_n[i] ** 2 * p[n + i] * q[n + i]
                    k += 1
                for i in range(m):
                    for d in range(4):
                        row[k] = v[d] * q[n + i] + p[n + i] * x[d]
                        row[k + 4 * m] = hp[d] * q[n + i] + p[n + i] * hq[d]
                        k += 1
                k += 4 * m
                k = _lower(row, k, complex(0.0, -w), (p[n:], q[n:]), (lp, lq))
                k = _lower(row, k, complex(1.0, 0.0), (v[:4], x[:4]), (rv, rx))
                row[k] = (y[0] * x[0] + y[2] * x[2] + y[4] * x[4]) * k_t * k_t
                row[k + 1] = (y[1] * x[1] + y[3] * x[3] + y[5] * x[5]) * k_r * k_r
                row[k + 2] = complex(0.0, w) * row[k]
                row[k + 3] = complex(0.0, w) * row[k + 1]
