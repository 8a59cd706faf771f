"""Lines of a machine whose planes feel each other, and their gradient, many points at a time; arrays and scalars only.

Scaled units as in `identification._kernels`: slopes are multiplied and moments divided by a lever, all receptances are in m/N. Sheets and
their rows are those of `identification._kernels.frf`.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

#: Points that are worked on together.
BLOCK = 64


class MachineArrays(NamedTuple):
    """A machine as the kernel reads it.

    omega_n (m,); psi (m, 6): flange t, r in X and in Y, fixture x, y; factor (m, m) lower triangular; softening (m, m) or (0, 0);
    skew (m, m) or (0, 0); residual (4, 4) lower triangular factor; fixture_residual (2, 4); joint (4,): k_t, k_r, c_t, c_r;
    seen (2, 2): of X and Y, the flange sensor's distance behind the joint and 1 where it looks at the holder.
    """

    omega_n: np.ndarray
    psi: np.ndarray
    factor: np.ndarray
    softening: np.ndarray
    skew: np.ndarray
    residual: np.ndarray
    fixture_residual: np.ndarray
    joint: np.ndarray
    seen: np.ndarray


class PointArrays(NamedTuple):
    """Points at which a cut's line is asked for: (p,) omega, relative speed x, spindle speed; (p, 2) places of the line of X and of Y
    or -1; (p, 4, 4) A22 and (p, 4, 2) A21 of the cut's tooling; (p, 2) complex forces in X and Y.
    """

    omega: np.ndarray
    x: np.ndarray
    speed: np.ndarray
    place: np.ndarray
    flange: np.ndarray
    tip: np.ndarray
    force: np.ndarray


@numba.njit(cache=True, error_model="numpy")
def coupled_frf(machine, points, parts, slopes):
    """Fill displacement by each force of both axes' lines, and the slopes that the flange's sensors see; return what is kept of the way.

    B = Psi^T Z^-1 Psi + R R^T, Z = K - w^2 + i w (L L^T + W G), E = A22 + K_joint^-1 + B; an output of row b (what the flange's sensor
    sees, the fixture's, or their difference) answers b x with x = E^-1 A21 F.

    Parameters
    ----------
    parts : of X and Y, (n, o, 2) each: displacement by the forces in X and in Y [m]; slopes : of both, (n,)

    What is kept, (blocks, rows, 2, BLOCK): real and imaginary parts of Z^-1 Psi by rows, of Z^-T Psi by rows, of x (4) and of each axis'
    and output's y = E^-T b^T (4).
    """
    omega_n, psi, factor, softening, skew, residual, fixture_residual, joint, seen = machine
    m, n, outputs = omega_n.size, points.omega.size, parts[0].shape[1]
    # the fixture's two columns are felt where its motion is an output of its own
    sides = 6 if outputs == 2 else 4
    damping = factor @ factor.T
    static = np.vstack((residual @ residual.T, fixture_residual))
    # the sheet's rows: Z, Z^-1 Psi, Z^-T Psi, B, E, E^-1 A21, x, an output's b, 1 / K_joint, y
    right = m * m
    left = right + m * sides
    flange = left + m * sides
    together = flange + 4 * sides
    carried = together + 16
    x, b, gives, y = carried + 8, carried + 12, carried + 16, carried + 18
    sheet = np.zeros((y + 4, 2, BLOCK))
    kept = np.empty(((n + BLOCK - 1) // BLOCK, 2 * m * sides + 4 + 8 * outputs, 2, BLOCK))
    for block in range(kept.shape[0]):
        first = block * BLOCK
        size = min(BLOCK, n - first)
        for i in range(m):
            for j in range(m):
                row, lost = i * m + j, damping[i, j]
                turns = skew[i, j] if skew.shape[0] > 0 else 0.0
                bend = softening[i, j] * omega_n[i] * omega_n[j] if softening.shape[0] > 0 else 0.0
                square = omega_n[i] ** 2 if i == j else 0.0
                own = 1.0 if i == j else 0.0
                for f in range(size):
                    w = points.omega[first + f]
                    sheet[row, 0, f] = square - own * w * w + bend * points.x[first + f]
                for f in range(size):
                    sheet[row, 1, f] = points.omega[first + f] * (lost + turns * points.speed[first + f])
            for a in range(sides):
                _constant(sheet, right + i * sides + a, psi[i, a], size)
                _constant(sheet, left + i * sides + a, psi[i, a], size)
        _factorise(sheet, 0, m, size)
        if skew.shape[0] > 0:
            _solve_transposed(sheet, 0, m, left, sides, size)
        _solve(sheet, 0, m, right, sides, size)
        _keep(sheet, right, kept, block, 0, m * sides, size)
        # without gyroscopic coupling Z is symmetric
        _keep(sheet, left if skew.shape[0] > 0 else right, kept, block, m * sides, m * sides, size)
        for a in range(sides):
            for c in range(4):
                _constant(sheet, flange + 4 * a + c, static[a, c], size)
                for i in range(m):
                    _add_times(sheet, psi[i, a], right + i * sides + c, flange + 4 * a + c, size)
        for f in range(size):
            w = points.omega[first + f]
            for a in range(2):
                _put(sheet, gives + a, f, 1.0 / complex(joint[a], w * joint[2 + a]))
            for a in range(4):
                for c in range(4):
                    own = points.flange[first + f, a, c] + (_at(sheet, gives + a % 2, f) if a == c else 0.0)
                    _put(sheet, together + 4 * a + c, f, own + _at(sheet, flange + 4 * a + c, f))
                for side in range(2):
                    _put(sheet, carried + 2 * a + side, f, points.tip[first + f, a, side])
        _factorise(sheet, together, 4, size)
        _solve(sheet, together, 4, carried, 2, size)
        for f in range(size):
            for a in range(4):
                for side in range(2):
                    row = carried + 2 * a + side
                    _put(sheet, row, f, _at(sheet, row, f) * points.force[first + f, side])
                _put(sheet, x + a, f, _at(sheet, carried + 2 * a, f) + _at(sheet, carried + 2 * a + 1, f))
        _keep(sheet, x, kept, block, 2 * m * sides, 4, size)
        for axis in range(2):
            behind, front = seen[axis]
            _constant(sheet, y, 0.0, size)
            _add_product(sheet, gives + 1, x + 2 * axis + 1, y, size)
            for part in range(2):
                for f in range(size):
                    sheet[y, part, f] *= front
            for c in range(4):
                _add_product(sheet, flange + 4 * (2 * axis + 1) + c, x + c, y, size)
            for f in range(size):
                place = points.place[first + f, axis]
                if place >= 0:
                    slopes[axis][place] = _at(sheet, y, f)
            for o in range(outputs):
                for c in range(4):
                    _constant(sheet, b + c, 0.0, size)
                    if o == 0:
                        _add_times(sheet, 1.0, flange + 8 * axis + c, b + c, size)
                        _add_times(sheet, behind, flange + 8 * axis + 4 + c, b + c, size)
                    if outputs == 2:
                        _add_times(sheet, 2.0 * o - 1.0, flange + 16 + 4 * axis + c, b + c, size)
                if o == 0:
                    _add_times(sheet, front, gives, b + 2 * axis, size)
                    _add_times(sheet, front * behind, gives + 1, b + 2 * axis + 1, size)
                for side in range(2):
                    _constant(sheet, y, 0.0, size)
                    for c in range(4):
                        _add_product(sheet, b + c, carried + 2 * c + side, y, size)
                    for f in range(size):
                        place = points.place[first + f, axis]
                        if place >= 0:
                            parts[axis][place, o, side] = _at(sheet, y, f)
                for c in range(4):
                    for part in range(2):
                        for f in range(size):
                            sheet[y + c, part, f] = sheet[b + c, part, f]
                _solve_transposed(sheet, together, 4, y, 1, size)
                _keep(sheet, y, kept, block, 2 * m * sides + 4 + 4 * (outputs * axis + o), 4, size)
    return kept


@numba.njit(cache=True, error_model="numpy")
def coupled_frf_gradient(machine, points, axis, kept, weight, scale, out, pairs):
    """Fill `out` (q, 2 n o) with the change of an axis' lines with each unknown: real parts, then imaginary parts; and `pairs` with that
    with skew's entries above the diagonal by rows, where there is any.

    With v = the row's share of the flange - y of `coupled_frf`, p = Z^-T (Psi v + the row's share of the fixture) and q = Z^-1 Psi x:
    d line = v^T dB x + p^T (dPsi x - dZ q) - y^T dK_joint^-1 x.

    Parameters
    ----------
    machine, points, kept : as in `coupled_frf`, which has kept it; axis : 0 or 1
    weight : (n, o) complex, by which each line's change is multiplied; scale : (q,) by which that with each unknown is

    The rows: log omega_n (m), psi's first four columns by rows (4 m), factor's lower triangle by rows, B's upper triangle by rows (10),
    with two outputs of X and of Y psi's fixture column (m) and the fixture's residual (4), with softening its lower triangle by rows; and
    the last four, joint (4).
    """
    omega_n, _, factor, softening, skew, _, _, joint, seen = machine
    m, n, outputs = omega_n.size, points.omega.size, weight.shape[1]
    sides = 6 if outputs == 2 else 4
    soft, turns = softening.shape[0] > 0, skew.shape[0] > 0
    behind, front = seen[axis]
    # the sheet's rows: what is kept comes first
    left = m * sides
    x = 2 * left
    q = kept.shape[1]
    lq, kq, p, lp, kp = q + m, q + 2 * m, q + 3 * m, q + 4 * m, q + 5 * m
    away = q + 6 * m
    v = away + m
    y, flexible, share, none, spare = v + 4, v + 8, v + 12, v + 13, v + 14
    sheet = np.zeros((v + 15, 2, BLOCK))
    # lines of a block, and where they go
    own, at = np.empty(BLOCK, dtype=np.intp), np.empty(BLOCK, dtype=np.intp)
    for block in range(kept.shape[0]):
        first = block * BLOCK
        size = min(BLOCK, n - first)
        for row in range(q):
            for part in range(2):
                for f in range(size):
                    sheet[row, part, f] = kept[block, row, part, f]
        for i in range(m):
            _constant(sheet, q + i, 0.0, size)
            for c in range(4):
                _add_product(sheet, i * sides + c, x + c, q + i, size)
        _through(factor, sheet, q, lq, size)
        _stiffness(omega_n, softening, points, first, sheet, q, kq, size)
        count = 0
        for f in range(size):
            w = points.omega[first + f]
            for a in range(2):
                gives = 1.0 / complex(joint[a], w * joint[2 + a])
                _put(sheet, flexible + a, f, gives * gives)
                _put(sheet, flexible + 2 + a, f, complex(0.0, w) * gives * gives)
            if points.place[first + f, axis] >= 0:
                own[count] = f
                count += 1
        for o in range(outputs):
            flange = 1.0 if o == 0 else 0.0
            fixture = 0.0 if outputs == 1 else 2.0 * o - 1.0
            for f in range(size):
                place = points.place[first + f, axis]
                by = weight[place, o] if place >= 0 else complex(0.0, 0.0)
                for c in range(4):
                    answer = _at(sheet, x + 4 + 4 * (outputs * axis + o) + c, f) * by
                    mine = flange if c == 2 * axis else flange * behind if c == 2 * axis + 1 else 0.0
                    _put(sheet, v + c, f, mine * by - answer)
                    # what moves with the holder moves with the joint's own flexibility, too
                    _put(sheet, y + c, f, answer - front * mine * by)
                _put(sheet, share, f, fixture * by)
            for k in range(count):
                at[k] = points.place[first + own[k], axis] * outputs + o
            to = own[:count], at[:count], spare
            for i in range(m):
                _constant(sheet, p + i, 0.0, size)
                for c in range(4):
                    _add_product(sheet, left + i * sides + c, v + c, p + i, size)
                if outputs == 2:
                    _add_product(sheet, left + i * sides + 4 + axis, share, p + i, size)
            _through(factor, sheet, p, lp, size)
            _stiffness(omega_n, softening, points, first, sheet, p, kp, size)
            for i in range(m):
                _line(sheet, (p + i, kq + i, kp + i, q + i), -scale[i], out, i, to, size)
                for c in range(4):
                    k = m + 4 * i + c
                    _line(sheet, (v + c, q + i, p + i, x + c), scale[k], out, k, to, size)
            k = 5 * m + m * (m + 1) // 2
            for a in range(4):
                _line(sheet, (v + a, x + a, none, x), scale[k], out, k, to, size)
                k += 1
                for c in range(a + 1, 4):
                    _line(sheet, (v + a, x + c, v + c, x + a), scale[k], out, k, to, size)
                    k += 1
            if outputs == 2:
                for plane in range(2):
                    shared = share if plane == axis else none
                    for i in range(m):
                        _line(sheet, (shared, q + i, none, x), scale[k], out, k, to, size)
                        k += 1
                    for c in range(4):
                        _line(sheet, (shared, x + c, none, x), scale[k], out, k, to, size)
                        k += 1
            if soft:
                # the omegas' rows are done with it
                for i in range(m):
                    for part in range(2):
                        for f in range(size):
                            sheet[kp + i, part, f] = points.x[first + f] * sheet[p + i, part, f]
                for i in range(m):
                    for j in range(i + 1):
                        by = -omega_n[i] * omega_n[j] * scale[k] * (0.5 if i == j else 1.0)
                        _line(sheet, (kp + i, q + j, kp + j, q + i), by, out, k, to, size)
                        k += 1
            if turns:
                # -i w W (p_i q_j - p_j q_i)
                for i in range(m):
                    for f in range(size):
                        turn = points.omega[first + f] * points.speed[first + f]
                        sheet[kp + i, 0, f] = turn * sheet[p + i, 1, f]
                        sheet[kp + i, 1, f] = -turn * sheet[p + i, 0, f]
                    for part in range(2):
                        for f in range(size):
                            sheet[away + i, part, f] = -sheet[kp + i, part, f]
                row = 0
                for i in range(m):
                    for j in range(i + 1, m):
                        _line(sheet, (kp + i, q + j, away + j, q + i), 1.0, pairs, row, to, size)
                        row += 1
            k = out.shape[0] - 4
            for a in range(2):
                for c in range(2):
                    _products(sheet, y + c, x + c, y + 2 + c, x + 2 + c, 1.0, kp, size)
                    _line(sheet, (kp, flexible + 2 * a + c, none, x), scale[k], out, k, to, size)
                    k += 1
            # -i w (factor)(factor)^T
            for i in range(m):
                for row in (p + i, lp + i):
                    for f in range(size):
                        turned = points.omega[first + f] * sheet[row, 1, f]
                        sheet[row, 1, f] = -points.omega[first + f] * sheet[row, 0, f]
                        sheet[row, 0, f] = turned
            k = 5 * m
            for i in range(m):
                for j in range(i + 1):
                    _line(sheet, (p + i, lq + j, lp + j, q + i), scale[k], out, k, to, size)
                    k += 1


@numba.njit(cache=True, error_model="numpy")
def _factorise(sheet, first, m, size):
    """Replace complex matrices, by rows from `first` on, by their factors L U without pivoting; the pivots' inverses on the diagonal.

    Z / (i omega) has a positive semidefinite Hermitian part: such matrices need no pivoting.
    """
    for j in range(m):
        own = first + j * m + j
        for f in range(size):
            real, imag = sheet[own, 0, f], sheet[own, 1, f]
            inverse = 1.0 / (real * real + imag * imag)
            sheet[own, 0, f] = real * inverse
            sheet[own, 1, f] = imag * -inverse
        for i in range(j + 1, m):
            ratio = first + i * m + j
            _multiply(sheet, own, ratio, size)
            for k in range(j + 1, m):
                _subtract_product(sheet, ratio, first + j * m + k, first + i * m + k, size)


@numba.njit(cache=True, error_model="numpy")
def _solve(sheet, first, m, right, columns, size):
    """Solve L U x = right in place; all columns stand by rows from `right` on."""
    for c in range(columns):
        for i in range(m):
            for k in range(i):
                _subtract_product(sheet, first + i * m + k, right + k * columns + c, right + i * columns + c, size)
        for i in range(m - 1, -1, -1):
            for k in range(i + 1, m):
                _subtract_product(sheet, first + i * m + k, right + k * columns + c, right + i * columns + c, size)
            _multiply(sheet, first + i * m + i, right + i * columns + c, size)


@numba.njit(cache=True, error_model="numpy")
def _solve_transposed(sheet, first, m, right, columns, size):
    """Solve (L U)^T x = right in the same way."""
    for c in range(columns):
        for i in range(m):
            for k in range(i):
                _subtract_product(sheet, first + k * m + i, right + k * columns + c, right + i * columns + c, size)
            _multiply(sheet, first + i * m + i, right + i * columns + c, size)
        for i in range(m - 1, -1, -1):
            for k in range(i + 1, m):
                _subtract_product(sheet, first + k * m + i, right + k * columns + c, right + i * columns + c, size)


@numba.njit(cache=True, error_model="numpy")
def _constant(sheet, row, value, size):
    for f in range(size):
        sheet[row, 0, f] = value
        sheet[row, 1, f] = 0.0


@numba.njit(cache=True, error_model="numpy")
def _keep(sheet, row, kept, block, to, count, size):
    for i in range(count):
        for part in range(2):
            for f in range(size):
                kept[block, to + i, part, f] = sheet[row + i, part, f]


@numba.njit(cache=True, error_model="numpy")
def _add_times(sheet, share, a, row, size):
    for part in range(2):
        for f in range(size):
            sheet[row, part, f] += share * sheet[a, part, f]


@numba.njit(cache=True, error_model="numpy")
def _multiply(sheet, a, row, size):
    for f in range(size):
        real = sheet[row, 0, f] * sheet[a, 0, f] - sheet[row, 1, f] * sheet[a, 1, f]
        sheet[row, 1, f] = sheet[row, 0, f] * sheet[a, 1, f] + sheet[row, 1, f] * sheet[a, 0, f]
        sheet[row, 0, f] = real


@numba.njit(cache=True, error_model="numpy")
def _subtract_product(sheet, a, b, row, size):
    for f in range(size):
        sheet[row, 0, f] -= sheet[a, 0, f] * sheet[b, 0, f] - sheet[a, 1, f] * sheet[b, 1, f]
    for f in range(size):
        sheet[row, 1, f] -= sheet[a, 0, f] * sheet[b, 1, f] + sheet[a, 1, f] * sheet[b, 0, f]


@numba.njit(cache=True, error_model="numpy")
def _add_product(sheet, a, b, row, size):
    for f in range(size):
        sheet[row, 0, f] += sheet[a, 0, f] * sheet[b, 0, f] - sheet[a, 1, f] * sheet[b, 1, f]
    for f in range(size):
        sheet[row, 1, f] += sheet[a, 0, f] * sheet[b, 1, f] + sheet[a, 1, f] * sheet[b, 0, f]


@numba.njit(cache=True, error_model="numpy")
def _products(sheet, a, b, c, d, scale, row, size):
    """Fill a row with scale (a b + c d)."""
    for f in range(size):
        first = sheet[a, 0, f] * sheet[b, 0, f] - sheet[a, 1, f] * sheet[b, 1, f]
        sheet[row, 0, f] = scale * (first + sheet[c, 0, f] * sheet[d, 0, f] - sheet[c, 1, f] * sheet[d, 1, f])
    for f in range(size):
        first = sheet[a, 0, f] * sheet[b, 1, f] + sheet[a, 1, f] * sheet[b, 0, f]
        sheet[row, 1, f] = scale * (first + sheet[c, 0, f] * sheet[d, 1, f] + sheet[c, 1, f] * sheet[d, 0, f])


@numba.njit(cache=True, error_model="numpy")
def _line(sheet, rows, scale, out, line, to, size):
    """Fill a row of `out` with scale (a b + c d), and the imaginary parts half of it further.

    `rows`: numbers of a, b, c and d; `to`: points that count, their places, and a row of the sheet that is free
    """
    a, b, c, d = rows
    own, at, spare = to
    half = out.shape[1] // 2
    _products(sheet, a, b, c, d, scale, spare, size)
    for k in range(own.size):
        out[line, at[k]] = sheet[spare, 0, own[k]]
    for k in range(own.size):
        out[line, half + at[k]] = sheet[spare, 1, own[k]]


@numba.njit(cache=True, error_model="numpy")
def _through(factor, sheet, rows, to, size):
    """Rows from `to` on = factor^T times those from `rows` on, of a lower triangular one."""
    for j in range(factor.shape[0]):
        _constant(sheet, to + j, 0.0, size)
        for i in range(j, factor.shape[0]):
            _add_times(sheet, factor[i, j], rows + i, to + j, size)


@numba.njit(cache=True, error_model="numpy")
def _stiffness(omega_n, softening, points, first, sheet, rows, to, size):
    """Rows from `to` on = K times those from `rows` on."""
    for i in range(omega_n.size):
        _constant(sheet, to + i, 0.0, size)
        if softening.shape[0] > 0:
            for j in range(omega_n.size):
                _add_times(sheet, softening[i, j] * omega_n[i] * omega_n[j], rows + j, to + i, size)
        square = omega_n[i] ** 2
        for part in range(2):
            for f in range(size):
                sheet[to + i, part, f] = points.x[first + f] * sheet[to + i, part, f] + square * sheet[rows + i, part, f]


@numba.njit(cache=True, error_model="numpy")
def _at(sheet, row, f):
    return complex(sheet[row, 0, f], sheet[row, 1, f])


@numba.njit(cache=True, error_model="numpy")
def _put(sheet, row, f, z):
    sheet[row, 0, f], sheet[row, 1, f] = z.real, z.imag
