"""Cross FRF of a candidate and its gradient, many frequencies at a time; arrays and scalars only.

Scaled units as in `_kernels`. Frequencies are the innermost loop, real and imaginary parts apart: what the compiler puts into vector
registers. A sheet, (rows, 2, BLOCK), is small enough for the nearest cache. Its rows go by their numbers: a row cut out of it as an
array of its own would cost as much as the work on it.
"""

from __future__ import annotations

import numba
import numpy as np

#: Frequencies that are worked on together.
BLOCK = 64


@numba.njit(cache=True, error_model="numpy")
def cross_frf(omega_n, shapes, factor, softening, joint, sensors, points, holder):
    """Return motion per tip force, shape (n, o), what `cross_frf_gradient` needs of the way there, and the slope that the flange's
    sensor sees, shape (n,).

    B = psi^T (K - w^2 + i w factor factor^T)^-1 psi + R, K_ij = omega_i omega_j (delta_ij + sum over states of x softening_ij);
    output b (a row: the flange's own, or another place's, or what `shares` makes of them) answers g = b x with
    x = (A22 + K_joint^-1 + B)^-1 A21 e0. The flange's own row is [1 d] B, or on the holder's side of the joint [1 d] (B + K_joint^-1).
    A point of the tool-holder answers c + b x with b = -A_p2 and c its direct receptance, the machine's motion not being its own.

    Parameters
    ----------
    omega_n : (m,); factor : (m, m) lower triangular
    shapes : (m + 2, 2 + e) flange t, flange r, other places; psi, and behind it the residual: of the flange transposed, a lower
        triangular factor of R, of other places to the flange's t and r, as it is
    softening : (s m, m) symmetric, one below the other for each state that the stiffness changes with, or (0, 0)
    joint : (4,) k_t, k_r, c_t, c_r, or (6,) with the shares by which natural frequencies and damping differ where the spindle stands still
    sensors : shares (o, 1 + e), what of the flange's motion and of the other places' is in each output; and (2,) of the flange's sensor its
        distance d behind the joint, and 1 where it looks at the holder, else 0
    points : (n, 4 + s) omega, 1 for motions of the machine and 0 for those of the tool-holder, 1 where the spindle stands still, factor on
        the joint's stiffnesses, and x of each state
    holder : (n, 8) A22 tt, tr, rr, A21 e0 t, r, c and b of a point of the tool-holder (zeros for the machine's)

    What is kept, (blocks, m (2 + e) + 2 + 2 o, 2, BLOCK): real and imaginary parts of (K - w^2 + i w factor factor^T)^-1 psi by rows,
    of x and of y = (A22 + K_joint^-1 + B)^-1 b^T of each output.
    """
    m, n = omega_n.size, points.shape[0]
    shares, seen = sensors
    outputs, sides = shares.shape[0], 1 + shares.shape[1]
    values, turned = np.empty((n, outputs), dtype=np.complex128), np.empty(n, dtype=np.complex128)
    behind, front = seen
    kept = np.empty(((n + BLOCK - 1) // BLOCK, m * sides + 2 + 2 * outputs, 2, BLOCK))
    psi, residual = shapes[:m], shapes[m:].T
    states = softening.shape[0] // m if m else 0
    damping = factor @ factor.T
    static = residual.copy()
    static[0, 0], static[0, 1] = residual[0, 0] ** 2, residual[0, 0] * residual[1, 0]
    static[1, 0], static[1, 1] = static[0, 1], residual[1, 0] ** 2 + residual[1, 1] ** 2
    # of the matrix by rows, and of the right sides below it
    sheet = np.empty(((m + sides) * m, 2, BLOCK))
    squared, turn, soften, stiffer = np.empty(BLOCK), np.empty(BLOCK), np.empty((states, BLOCK)), np.empty(BLOCK)
    machine = np.empty((2 * sides, 2, BLOCK))
    for block in range(kept.shape[0]):
        first = block * BLOCK
        size = min(BLOCK, n - first)
        _speed_rows(points, joint, first, size, turn, soften, stiffer)
        for f in range(size):
            squared[f] = points[first + f, 0] ** 2
        for i in range(m):
            for j in range(i + 1):
                lost = damping[i, j]
                row = i * m + j
                for f in range(size):
                    sheet[row, 0, f] = 0.0
                for s in range(states):
                    bend = softening[s * m + i, j] * omega_n[i] * omega_n[j]
                    for f in range(size):
                        sheet[row, 0, f] += bend * soften[s, f]
                for f in range(size):
                    sheet[row, 1, f] = lost * turn[f]
            square, row = omega_n[i] ** 2, i * m + i
            for f in range(size):
                sheet[row, 0, f] += square * stiffer[f] - squared[f]
            for a in range(sides):
                row = (m + a) * m + i
                for f in range(size):
                    sheet[row, 0, f] = psi[i, a]
                    sheet[row, 1, f] = 0.0
        _factor_solve(sheet, m, sides, size)
        for i in range(m):
            for a in range(sides):
                for part in range(2):
                    for f in range(size):
                        kept[block, i * sides + a, part, f] = sheet[(m + a) * m + i, part, f]
        # motion of the flange and of other places per force along the flange's t and r
        for a in range(sides):
            for b in range(2):
                row = 2 * a + b
                for f in range(size):
                    machine[row, 0, f] = static[a, b]
                    machine[row, 1, f] = 0.0
                for i in range(m):
                    shape, answer = psi[i, a], (m + b) * m + i
                    for part in range(2):
                        for f in range(size):
                            machine[row, part, f] += shape * sheet[answer, part, f]
        for f in range(size):
            w, own, grip = points[first + f, 0], points[first + f, 1], points[first + f, 3]
            b_tt, b_tr, b_rr = _at(machine, 0, f), _at(machine, 1, f), _at(machine, 3, f)
            a_tt, a_tr, a_rr, a_t, a_r = (
                holder[first + f, 0],
                holder[first + f, 1],
                holder[first + f, 2],
                holder[first + f, 3],
                holder[first + f, 4],
            )
            gives_t, gives_r = _reciprocal(complex(grip * joint[0], w * joint[2])), _reciprocal(complex(grip * joint[1], w * joint[3]))
            e_tt = a_tt + gives_t + b_tt
            e_tr = a_tr + b_tr
            e_rr = a_rr + gives_r + b_rr
            inverse = _reciprocal(e_tt * e_rr - e_tr * e_tr)
            x0 = (e_rr * a_t - e_tr * a_r) * inverse
            x1 = (e_tt * a_r - e_tr * a_t) * inverse
            row = m * sides
            _keep(kept, block, row, f, x0)
            _keep(kept, block, row + 1, f, x1)
            r_r = b_rr + front * gives_r
            turned[first + f] = own * (b_tr * x0 + r_r * x1)
            f_t, f_r = b_tt + front * gives_t + behind * b_tr, b_tr + behind * r_r
            for o in range(outputs):
                flange = own * shares[o, 0]
                b_t, b_r = flange * f_t, flange * f_r
                for a in range(2, sides):
                    b_t += own * shares[o, a - 1] * _at(machine, 2 * a, f)
                    b_r += own * shares[o, a - 1] * _at(machine, 2 * a + 1, f)
                values[first + f, o] = 0.0
                if o == 0:
                    b_t += holder[first + f, 6]
                    b_r += holder[first + f, 7]
                    values[first + f, o] = holder[first + f, 5]
                values[first + f, o] += b_t * x0 + b_r * x1
                row += 2
                _keep(kept, block, row, f, (e_rr * b_t - e_tr * b_r) * inverse)
                _keep(kept, block, row + 1, f, (e_tt * b_r - e_tr * b_t) * inverse)
    return values, kept, turned


@numba.njit(cache=True, error_model="numpy")
def cross_frf_gradient(omega_n, factor, softening, joint, sensors, points, kept, weight, scale, out):
    """Fill `out` (q, 2 n o) with the change of all lines with each unknown: real parts, then imaginary parts.

    dg = db x - y^T (dB + dK_joint^-1) x of `cross_frf`; with p = (K - w^2 + i w factor factor^T)^-1 psi v and q likewise of x,
    v = the output's share of the flange - y, a change of psi moves it by v^T dpsi^T q + p^T dpsi x and one of the dynamic stiffness
    dZ by -p^T dZ q.

    Parameters
    ----------
    omega_n, factor, softening, joint, sensors, points : as in `cross_frf`; kept : what it has kept
    weight : (n, o) complex, by which each line's change is multiplied
    scale : (q,) by which that with each unknown is

    The rows: log omega_n (m), psi's first two columns by rows (2 m), factor's lower triangle by rows, B's tt, tr, rr (3),
    of each other place psi's column (m) and its residual (2), with six of the joint what standing still changes (2), the lower
    triangle of each state by rows, joint (4); where `out` has six more, A22's tt, tr, rr, A21 e0's t, r and c, where all points of the
    tool-holder are the tip: b = -A21 e0 changes with the latter two.
    """
    m, n = omega_n.size, points.shape[0]
    shares, seen = sensors
    outputs, sides = shares.shape[0], 1 + shares.shape[1]
    pairs = m * (m + 1) // 2
    states, stills = (softening.shape[0] // m if m else 0), joint.size == 6
    bend = np.empty((states, m, m))
    for s in range(states):
        for i in range(m):
            for j in range(m):
                bend[s, i, j] = softening[s * m + i, j] * omega_n[i] * omega_n[j]
    # the sheet's rows: what is kept comes first
    x = m * sides
    q = kept.shape[1]
    lq, kq, p, lp, kp, rest = q + m, q + 2 * m, q + 3 * m, q + 4 * m, q + 5 * m, q + 6 * m
    v = q + 7 * m
    y, moved = v + 2, v + 4
    away = moved + sides - 2
    none, unit, spare = away + 1, away + 2, away + 3
    flexible = away + 4
    still, sums = flexible + 4, flexible + 6
    sheet = np.zeros((sums + 2, 2, BLOCK))
    sheet[unit, 0] = 1.0
    turn, soften, stiffer = np.empty(BLOCK), np.empty((states, BLOCK)), np.empty(BLOCK)
    for block in range(kept.shape[0]):
        first = block * BLOCK
        size = min(BLOCK, n - first)
        for row in range(q):
            for part in range(2):
                for f in range(size):
                    sheet[row, part, f] = kept[block, row, part, f]
        _speed_rows(points, joint, first, size, turn, soften, stiffer)
        _flexibility_rows(points, joint, first, size, sheet, flexible, still)
        for i in range(m):
            _products(sheet, i * sides, x, i * sides + 1, x + 1, 1.0, q + i, size)
        _combine(factor, sheet, q, lq, size)
        _stiffness(omega_n, bend, soften, stiffer, sheet, q, kq, rest, size)
        for o in range(outputs):
            place = first * outputs + o, outputs, spare
            _output_rows(sheet, (x + 2 + 2 * o, v, y, moved, away), shares, o, seen[0], points, weight, first, size)
            for i in range(m):
                _products(sheet, i * sides, v, i * sides + 1, v + 1, 1.0, p + i, size)
                for a in range(2, sides):
                    _add_product(sheet, i * sides + a, moved + a - 2, p + i, size)
            _combine(factor, sheet, p, lp, size)
            _stiffness(omega_n, bend, soften, stiffer, sheet, p, kp, rest, size)
            for i in range(m):
                k = m + 2 * i
                _line(sheet, (p + i, kq + i, kp + i, q + i), -scale[i], out, i, place, size)
                _line(sheet, (v, q + i, p + i, x), scale[k], out, k, place, size)
                _line(sheet, (v + 1, q + i, p + i, x + 1), scale[k + 1], out, k + 1, place, size)
            k = 3 * m + pairs
            _line(sheet, (v, x, none, x), scale[k], out, k, place, size)
            _line(sheet, (v, x + 1, v + 1, x), scale[k + 1], out, k + 1, place, size)
            _line(sheet, (v + 1, x + 1, none, x), scale[k + 2], out, k + 2, place, size)
            k += 3
            for a in range(sides - 2):
                for i in range(m):
                    _line(sheet, (moved + a, q + i, none, x), scale[k], out, k, place, size)
                    k += 1
                for c in range(2):
                    _line(sheet, (moved + a, x + c, none, x), scale[k], out, k, place, size)
                    k += 1
            if stills:
                # all natural frequencies, and all of the damping, by a share
                for a in range(2):
                    _nothing(sheet, sums + a, size)
                for i in range(m):
                    _add_product(sheet, p + i, kq + i, sums, size)
                    _add_product(sheet, lp + i, lq + i, sums + 1, size)
                for a in range(2):
                    _line(sheet, (sums + a, still + a, none, x), scale[k], out, k, place, size)
                    k += 1
            for s in range(states):
                # the omegas' rows are done with it
                for i in range(m):
                    for part in range(2):
                        for f in range(size):
                            sheet[kp + i, part, f] = soften[s, f] * sheet[p + i, part, f]
                for i in range(m):
                    for j in range(i + 1):
                        share = -omega_n[i] * omega_n[j] * scale[k] * (0.5 if i == j else 1.0)
                        _line(sheet, (kp + i, q + j, kp + j, q + i), share, out, k, place, size)
                        k += 1
            # what moves with the holder moves with the joint's own flexibility, too
            felt, sign = (v, -1.0) if seen[1] == 1.0 else (y, 1.0)
            for a in range(2):
                _products(sheet, felt + a, x + a, none, x, sign, sums + a, size)
            for a in range(4):
                _line(sheet, (sums + a % 2, flexible + a, none, x), scale[k], out, k, place, size)
                k += 1
            if k < out.shape[0]:
                for a in range(2):
                    _products(sheet, y + a, x + a, none, x, 1.0, sums + a, size)
                _line(sheet, (sums, unit, none, x), -1.0, out, k, place, size)
                _line(sheet, (y, x + 1, y + 1, x), -1.0, out, k + 1, place, size)
                _line(sheet, (sums + 1, unit, none, x), -1.0, out, k + 2, place, size)
                _line(sheet, (y, unit, away, x), 1.0, out, k + 3, place, size)
                _line(sheet, (y + 1, unit, away, x + 1), 1.0, out, k + 4, place, size)
                _line(sheet, (none, x, away, unit), -1.0, out, k + 5, place, size)
            # -i w (factor)(factor)^T
            for i in range(m):
                _quarter_turn(sheet, p + i, turn, spare, size)
                _quarter_turn(sheet, lp + i, turn, spare, size)
            k = 3 * m
            for i in range(m):
                for j in range(i + 1):
                    _line(sheet, (p + i, lq + j, lp + j, q + i), scale[k], out, k, place, size)
                    k += 1


@numba.njit(cache=True, error_model="numpy")
def _factor_solve(sheet, m, sides, size):
    """Solve complex symmetric systems in place: L D L^T, lower triangle read, the right sides below it overwritten."""
    for j in range(m):
        own = j * m + j
        for f in range(size):
            real, imag = sheet[own, 0, f], sheet[own, 1, f]
            inverse = 1.0 / (real * real + imag * imag)
            sheet[own, 0, f] = real * inverse
            sheet[own, 1, f] = imag * -inverse
        for i in range(j + 1, m):
            # L stands above the diagonal
            ratio = j * m + i
            _product(sheet, i * m + j, own, ratio, size)
            for k in range(i, m + sides):
                _subtract_product(sheet, ratio, k * m + j, k * m + i, size)
    for k in range(m, m + sides):
        for j in range(m - 1, -1, -1):
            own, row = j * m + j, k * m + j
            for f in range(size):
                real = sheet[row, 0, f] * sheet[own, 0, f] - sheet[row, 1, f] * sheet[own, 1, f]
                sheet[row, 1, f] = sheet[row, 0, f] * sheet[own, 1, f] + sheet[row, 1, f] * sheet[own, 0, f]
                sheet[row, 0, f] = real
            for i in range(j + 1, m):
                _subtract_product(sheet, j * m + i, k * m + i, row, size)


@numba.njit(cache=True, error_model="numpy")
def _nothing(sheet, row, size):
    for part in range(2):
        for f in range(size):
            sheet[row, part, f] = 0.0


@numba.njit(cache=True, error_model="numpy")
def _product(sheet, a, b, row, size):
    for f in range(size):
        sheet[row, 0, f] = sheet[a, 0, f] * sheet[b, 0, f] - sheet[a, 1, f] * sheet[b, 1, f]
    for f in range(size):
        sheet[row, 1, f] = sheet[a, 0, f] * sheet[b, 1, f] + sheet[a, 1, f] * sheet[b, 0, f]


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
def _line(sheet, rows, scale, out, line, place, size):
    """Fill a row of `out` with scale (a b + c d), and the imaginary parts half of it further.

    `rows`: numbers of a, b, c and d; `place`: where it begins, the step to the next one, and a row of the sheet that is free
    """
    a, b, c, d = rows
    first, step, spare = place
    half = out.shape[1] // 2
    _products(sheet, a, b, c, d, scale, spare, size)
    for f in range(size):
        out[line, first + f * step] = sheet[spare, 0, f]
    for f in range(size):
        out[line, half + first + f * step] = sheet[spare, 1, f]


@numba.njit(cache=True, error_model="numpy")
def _combine(coefficients, sheet, rows, to, size):
    """Row j from `to` on = sum_i coefficients_ij row i from `rows` on."""
    for j in range(coefficients.shape[1]):
        _nothing(sheet, to + j, size)
        for i in range(coefficients.shape[0]):
            share = coefficients[i, j]
            if share != 0.0:
                for part in range(2):
                    for f in range(size):
                        sheet[to + j, part, f] += share * sheet[rows + i, part, f]


@numba.njit(cache=True, error_model="numpy")
def _stiffness(omega_n, bend, soften, stiffer, sheet, rows, to, rest, size):
    """Rows from `to` on = K times those from `rows` on."""
    for i in range(omega_n.size):
        square = omega_n[i] ** 2
        for part in range(2):
            for f in range(size):
                sheet[to + i, part, f] = square * stiffer[f] * sheet[rows + i, part, f]
    for s in range(bend.shape[0]):
        _combine(bend[s], sheet, rows, rest, size)
        for i in range(omega_n.size):
            for part in range(2):
                for f in range(size):
                    sheet[to + i, part, f] += soften[s, f] * sheet[rest + i, part, f]


@numba.njit(cache=True, error_model="numpy")
def _quarter_turn(sheet, row, turn, spare, size):
    """The row *= -i turn."""
    for f in range(size):
        sheet[spare, 0, f] = sheet[row, 0, f]
    for f in range(size):
        sheet[row, 0, f] = turn[f] * sheet[row, 1, f]
    for f in range(size):
        sheet[row, 1, f] = -turn[f] * sheet[spare, 0, f]


@numba.njit(cache=True, error_model="numpy")
def _speed_rows(points, joint, first, size, turn, soften, stiffer):
    """What stands before the damping, before what softens and before the stiffness: w, x and 1, or more where the spindle stands still."""
    for f in range(size):
        w, still = points[first + f, 0], points[first + f, 2]
        share = 1.0 + still * joint[4] if joint.size == 6 else 1.0
        stiffer[f] = share * share
        for s in range(soften.shape[0]):
            soften[s, f] = points[first + f, 4 + s] * stiffer[f]
        turn[f] = w * (1.0 + still * joint[5]) if joint.size == 6 else w


@numba.njit(cache=True, error_model="numpy")
def _output_rows(sheet, places, shares, o, behind, points, weight, first, size):
    """Of an output v and y, its shares of the other places and minus that of the tool-holder's own point, which is the first output's
    alone, times the lines' weights. `places`: rows of y without weight, and where these stand.
    """
    answer, v, y, moved, away = places
    direct = 1.0 if o == 0 else 0.0
    for f in range(size):
        own, by = points[first + f, 1], weight[first + f, o]
        for a in range(2):
            weighted = _at(sheet, answer + a, f) * by
            _put(sheet, y + a, f, weighted)
            _put(sheet, v + a, f, own * shares[o, 0] * (1.0 if a == 0 else behind) * by - weighted)
        for e in range(away - moved):
            _put(sheet, moved + e, f, own * shares[o, 1 + e] * by)
        _put(sheet, away, f, direct * (own - 1.0) * by)


@numba.njit(cache=True, error_model="numpy")
def _flexibility_rows(points, joint, first, size, sheet, flexible, still):
    """How the joint's flexibility falls with its stiffnesses and dampings; what standing still does to stiffness and damping."""
    for f in range(size):
        w, stands, grip = points[first + f, 0], points[first + f, 2], points[first + f, 3]
        for a in range(2):
            inverse = _reciprocal(complex(grip * joint[a], w * joint[2 + a]))
            inverse *= inverse
            _put(sheet, flexible + a, f, grip * inverse)
            _put(sheet, flexible + 2 + a, f, complex(0.0, w) * inverse)
        if joint.size == 6:
            _put(sheet, still, f, complex(-2.0 * stands / (1.0 + stands * joint[4]), 0.0))
            _put(sheet, still + 1, f, complex(0.0, -w * stands))


@numba.njit(cache=True, error_model="numpy")
def _reciprocal(z):
    scale = 1.0 / (z.real * z.real + z.imag * z.imag)
    return complex(z.real * scale, -z.imag * scale)


@numba.njit(cache=True, error_model="numpy")
def _at(sheet, row, f):
    return complex(sheet[row, 0, f], sheet[row, 1, f])


@numba.njit(cache=True, error_model="numpy")
def _put(sheet, row, f, z):
    sheet[row, 0, f], sheet[row, 1, f] = z.real, z.imag


@numba.njit(cache=True, error_model="numpy")
def _keep(kept, block, row, f, z):
    kept[block, row, 0, f], kept[block, row, 1, f] = z.real, z.imag
