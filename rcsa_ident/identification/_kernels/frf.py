"""Cross FRF of a candidate and its gradient, many frequencies at a time; arrays and scalars only.

Scaled units as in `_kernels`. Frequencies are the innermost loop, real and imaginary parts rows of their own: what the compiler puts
into vector registers. A loop fills one row alone, as more of them would have to be proven apart.
"""

from __future__ import annotations

import numba
import numpy as np

#: Frequencies that are worked on together.
BLOCK = 128


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
    # the right sides stand below the matrix
    matrix = np.empty((m + sides, m, 2, BLOCK))
    squared, turn, soften, stiffer = np.empty(BLOCK), np.empty(BLOCK), np.empty((states, BLOCK)), np.empty(BLOCK)
    machine = np.empty((sides, 2, 2, BLOCK))
    for block in range(kept.shape[0]):
        first = block * BLOCK
        size = min(BLOCK, n - first)
        _speed_rows(points, joint, first, size, turn, soften, stiffer)
        for f in range(size):
            squared[f] = points[first + f, 0] ** 2
        for i in range(m):
            for j in range(i + 1):
                lost = damping[i, j]
                real, imag = matrix[i, j, 0], matrix[i, j, 1]
                for f in range(size):
                    real[f] = 0.0
                for s in range(states):
                    bend, x = softening[s * m + i, j] * omega_n[i] * omega_n[j], soften[s]
                    for f in range(size):
                        real[f] += bend * x[f]
                for f in range(size):
                    imag[f] = lost * turn[f]
            square = omega_n[i] ** 2
            real = matrix[i, i, 0]
            for f in range(size):
                real[f] += square * stiffer[f] - squared[f]
            for a in range(sides):
                matrix[m + a, i, 0] = psi[i, a]
                matrix[m + a, i, 1] = 0.0
        _factor_solve(matrix, m, size)
        for i in range(m):
            for a in range(sides):
                kept[block, i * sides + a] = matrix[m + a, i]
        # motion of the flange and of other places per force along the flange's t and r
        for a in range(sides):
            for b in range(2):
                machine[a, b, 0] = static[a, b]
                machine[a, b, 1] = 0.0
                for part in range(2):
                    total = machine[a, b, part]
                    for i in range(m):
                        shape, answer = psi[i, a], matrix[m + b, i, part]
                        for f in range(size):
                            total[f] += shape * answer[f]
        for f in range(size):
            w, own, grip = points[first + f, 0], points[first + f, 1], points[first + f, 3]
            here = holder[first + f]
            b_tt, b_tr, b_rr = _at(machine[0, 0], f), _at(machine[0, 1], f), _at(machine[1, 1], f)
            gives_t, gives_r = _reciprocal(complex(grip * joint[0], w * joint[2])), _reciprocal(complex(grip * joint[1], w * joint[3]))
            e_tt = here[0] + gives_t + b_tt
            e_tr = here[1] + b_tr
            e_rr = here[2] + gives_r + b_rr
            inverse = _reciprocal(e_tt * e_rr - e_tr * e_tr)
            x0 = (e_rr * here[3] - e_tr * here[4]) * inverse
            x1 = (e_tt * here[4] - e_tr * here[3]) * inverse
            row = m * sides
            _put(kept[block, row], f, x0)
            _put(kept[block, row + 1], f, x1)
            r_r = b_rr + front * gives_r
            turned[first + f] = own * (b_tr * x0 + r_r * x1)
            f_t, f_r = b_tt + front * gives_t + behind * b_tr, b_tr + behind * r_r
            for o in range(outputs):
                flange = own * shares[o, 0]
                b_t, b_r = flange * f_t, flange * f_r
                for a in range(2, sides):
                    b_t += own * shares[o, a - 1] * _at(machine[a, 0], f)
                    b_r += own * shares[o, a - 1] * _at(machine[a, 1], f)
                values[first + f, o] = 0.0
                if o == 0:
                    b_t += here[6]
                    b_r += here[7]
                    values[first + f, o] = here[5]
                values[first + f, o] += b_t * x0 + b_r * x1
                row += 2
                _put(kept[block, row], f, (e_rr * b_t - e_tr * b_r) * inverse)
                _put(kept[block, row + 1], f, (e_tt * b_r - e_tr * b_t) * inverse)
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
    shape = (m, 2, BLOCK)
    q, lq, kq, p, lp, kp = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
    rest = np.empty(shape)
    v, y = np.empty((2, 2, BLOCK)), np.empty((2, 2, BLOCK))
    moved = np.empty((sides - 2, 2, BLOCK))
    spare, away, none, unit = np.empty((2, BLOCK)), np.empty((2, BLOCK)), np.zeros((2, BLOCK)), np.zeros((2, BLOCK))
    unit[0] = 1.0
    flexible, still, sums = np.empty((4, 2, BLOCK)), np.empty((2, 2, BLOCK)), np.empty((2, 2, BLOCK))
    turn, soften, stiffer = np.empty(BLOCK), np.empty((states, BLOCK)), np.empty(BLOCK)
    for block in range(kept.shape[0]):
        first = block * BLOCK
        size = min(BLOCK, n - first)
        here = kept[block]
        _speed_rows(points, joint, first, size, turn, soften, stiffer)
        _flexibility_rows(points, joint, first, size, flexible, still)
        x0, x1 = here[m * sides], here[m * sides + 1]
        for i in range(m):
            _products(here[i * sides], x0, here[i * sides + 1], x1, 1.0, q[i, 0], q[i, 1], size)
        _combine(factor, q, lq, size)
        _stiffness(omega_n, bend, soften, stiffer, q, kq, rest, size)
        for o in range(outputs):
            start = first * outputs + o
            _output_rows(
                here[m * sides + 2 + 2 * o :],
                shares[o],
                seen[0],
                points[first:],
                weight[first:, o],
                1.0 if o == 0 else 0.0,
                size,
                (v, y),
                moved,
                away,
            )
            for i in range(m):
                _products(here[i * sides], v[0], here[i * sides + 1], v[1], 1.0, p[i, 0], p[i, 1], size)
                for a in range(2, sides):
                    _add_product(here[i * sides + a], moved[a - 2], p[i], size)
            _combine(factor, p, lp, size)
            _stiffness(omega_n, bend, soften, stiffer, p, kp, rest, size)
            for i in range(m):
                k = m + 2 * i
                _line(p[i], kq[i], kp[i], q[i], -scale[i], out[i], start, outputs, spare, size)
                _line(v[0], q[i], p[i], x0, scale[k], out[k], start, outputs, spare, size)
                _line(v[1], q[i], p[i], x1, scale[k + 1], out[k + 1], start, outputs, spare, size)
            k = 3 * m + pairs
            _line(v[0], x0, none, x0, scale[k], out[k], start, outputs, spare, size)
            _line(v[0], x1, v[1], x0, scale[k + 1], out[k + 1], start, outputs, spare, size)
            _line(v[1], x1, none, x1, scale[k + 2], out[k + 2], start, outputs, spare, size)
            k += 3
            for a in range(sides - 2):
                for i in range(m):
                    _line(moved[a], q[i], none, x0, scale[k], out[k], start, outputs, spare, size)
                    k += 1
                for x in (x0, x1):
                    _line(moved[a], x, none, x0, scale[k], out[k], start, outputs, spare, size)
                    k += 1
            if stills:
                # all natural frequencies, and all of the damping, by a share
                sums[:] = 0.0
                for i in range(m):
                    _add_product(p[i], kq[i], sums[0], size)
                    _add_product(lp[i], lq[i], sums[1], size)
                for a in range(2):
                    _line(sums[a], still[a], none, x0, scale[k], out[k], start, outputs, spare, size)
                    k += 1
            for s in range(states):
                # the omegas' rows are done with it
                for i in range(m):
                    _times(p[i], soften[s], kp[i], size)
                for i in range(m):
                    for j in range(i + 1):
                        share = -omega_n[i] * omega_n[j] * scale[k] * (0.5 if i == j else 1.0)
                        _line(kp[i], q[j], kp[j], q[i], share, out[k], start, outputs, spare, size)
                        k += 1
            # what moves with the holder moves with the joint's own flexibility, too
            felt, sign = (v, -1.0) if seen[1] == 1.0 else (y, 1.0)
            _products(felt[0], x0, none, x0, sign, sums[0, 0], sums[0, 1], size)
            _products(felt[1], x1, none, x1, sign, sums[1, 0], sums[1, 1], size)
            for a in range(4):
                _line(sums[a % 2], flexible[a], none, x0, scale[k], out[k], start, outputs, spare, size)
                k += 1
            if k < out.shape[0]:
                _products(y[0], x0, none, x0, 1.0, sums[0, 0], sums[0, 1], size)
                _products(y[1], x1, none, x1, 1.0, sums[1, 0], sums[1, 1], size)
                _line(sums[0], unit, none, x0, -1.0, out[k], start, outputs, spare, size)
                _line(y[0], x1, y[1], x0, -1.0, out[k + 1], start, outputs, spare, size)
                _line(sums[1], unit, none, x0, -1.0, out[k + 2], start, outputs, spare, size)
                _line(y[0], unit, away, x0, 1.0, out[k + 3], start, outputs, spare, size)
                _line(y[1], unit, away, x1, 1.0, out[k + 4], start, outputs, spare, size)
                _line(none, x0, away, unit, -1.0, out[k + 5], start, outputs, spare, size)
            # -i w (factor)(factor)^T
            for i in range(m):
                _quarter_turn(p[i], turn, spare, size)
                _quarter_turn(lp[i], turn, spare, size)
            k = 3 * m
            for i in range(m):
                for j in range(i + 1):
                    _line(p[i], lq[j], lp[j], q[i], scale[k], out[k], start, outputs, spare, size)
                    k += 1


@numba.njit(cache=True, error_model="numpy")
def _factor_solve(matrix, m, size):
    """Solve complex symmetric systems in place: L D L^T, lower triangle read, the right sides below it overwritten."""
    for j in range(m):
        p, q = matrix[j, j, 0], matrix[j, j, 1]
        for f in range(size):
            inverse = 1.0 / (p[f] * p[f] + q[f] * q[f])
            p[f] *= inverse
            q[f] *= -inverse
        for i in range(j + 1, m):
            # L stands above the diagonal
            a, b, real, imag = matrix[i, j, 0], matrix[i, j, 1], matrix[j, i, 0], matrix[j, i, 1]
            for f in range(size):
                real[f] = a[f] * p[f] - b[f] * q[f]
            for f in range(size):
                imag[f] = a[f] * q[f] + b[f] * p[f]
            for k in range(i, matrix.shape[0]):
                _subtract_product(matrix[j, i], matrix[k, j], matrix[k, i], size)
    for k in range(m, matrix.shape[0]):
        for j in range(m - 1, -1, -1):
            a, b, p, q = matrix[k, j, 0], matrix[k, j, 1], matrix[j, j, 0], matrix[j, j, 1]
            for f in range(size):
                real = a[f] * p[f] - b[f] * q[f]
                b[f] = a[f] * q[f] + b[f] * p[f]
                a[f] = real
            for i in range(j + 1, m):
                _subtract_product(matrix[j, i], matrix[k, i], matrix[k, j], size)


@numba.njit(cache=True, error_model="numpy")
def _subtract_product(a, b, out, size):
    p, q, c, d = a[0], a[1], b[0], b[1]
    real, imag = out[0], out[1]
    for f in range(size):
        real[f] -= p[f] * c[f] - q[f] * d[f]
    for f in range(size):
        imag[f] -= p[f] * d[f] + q[f] * c[f]


@numba.njit(cache=True, error_model="numpy")
def _add_product(a, b, out, size):
    p, q, c, d = a[0], a[1], b[0], b[1]
    real, imag = out[0], out[1]
    for f in range(size):
        real[f] += p[f] * c[f] - q[f] * d[f]
    for f in range(size):
        imag[f] += p[f] * d[f] + q[f] * c[f]


@numba.njit(cache=True, error_model="numpy")
def _products(a, b, c, d, scale, real, imag, size):
    """Fill scale (a b + c d)."""
    a_r, a_i, b_r, b_i, c_r, c_i, d_r, d_i = a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1]
    for f in range(size):
        real[f] = scale * (a_r[f] * b_r[f] - a_i[f] * b_i[f] + c_r[f] * d_r[f] - c_i[f] * d_i[f])
    for f in range(size):
        imag[f] = scale * (a_r[f] * b_i[f] + a_i[f] * b_r[f] + c_r[f] * d_i[f] + c_i[f] * d_r[f])


@numba.njit(cache=True, error_model="numpy")
def _line(a, b, c, d, scale, out, first, step, spare, size):
    """Fill scale (a b + c d) into `out` from `first` on, every `step`, and the imaginary parts half of it further."""
    half = out.size // 2
    if step == 1:
        _products(a, b, c, d, scale, out[first : first + size], out[half + first : half + first + size], size)
        return
    real, imag = spare[0], spare[1]
    _products(a, b, c, d, scale, real, imag, size)
    for f in range(size):
        out[first + f * step] = real[f]
    for f in range(size):
        out[half + first + f * step] = imag[f]


@numba.njit(cache=True, error_model="numpy")
def _combine(coefficients, rows, out, size):
    """out_j = sum_i coefficients_ij rows_i."""
    for j in range(coefficients.shape[1]):
        for part in range(2):
            total = out[j, part]
            total[:] = 0.0
            for i in range(coefficients.shape[0]):
                share, row = coefficients[i, j], rows[i, part]
                if share != 0.0:
                    for f in range(size):
                        total[f] += share * row[f]


@numba.njit(cache=True, error_model="numpy")
def _stiffness(omega_n, bend, soften, stiffer, rows, out, rest, size):
    """out = K rows."""
    for i in range(omega_n.size):
        square = omega_n[i] ** 2
        for part in range(2):
            row, total = rows[i, part], out[i, part]
            for f in range(size):
                total[f] = square * stiffer[f] * row[f]
    for s in range(bend.shape[0]):
        _combine(bend[s], rows, rest, size)
        x = soften[s]
        for i in range(omega_n.size):
            for part in range(2):
                more, total = rest[i, part], out[i, part]
                for f in range(size):
                    total[f] += x[f] * more[f]


@numba.njit(cache=True, error_model="numpy")
def _times(row, factor, out, size):
    for part in range(2):
        own, product = row[part], out[part]
        for f in range(size):
            product[f] = factor[f] * own[f]


@numba.njit(cache=True, error_model="numpy")
def _quarter_turn(row, turn, spare, size):
    """row *= -i turn."""
    real, imag, old = row[0], row[1], spare[0]
    for f in range(size):
        old[f] = real[f]
    for f in range(size):
        real[f] = turn[f] * imag[f]
    for f in range(size):
        imag[f] = -turn[f] * old[f]


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
def _output_rows(kept, shares, behind, points, weight, direct, size, answers, moved, away):
    """An output's v and y, its shares of the other places and minus that of the tool-holder's own point, which is the first output's
    alone, times the lines' weights.
    """
    v, y = answers
    for f in range(size):
        own, by = points[f, 1], weight[f]
        for a in range(2):
            answer = _at(kept[a], f) * by
            _put(y[a], f, answer)
            _put(v[a], f, own * shares[0] * (1.0 if a == 0 else behind) * by - answer)
        for e in range(moved.shape[0]):
            _put(moved[e], f, own * shares[1 + e] * by)
        _put(away, f, direct * (own - 1.0) * by)


@numba.njit(cache=True, error_model="numpy")
def _flexibility_rows(points, joint, first, size, flexible, still):
    """How the joint's flexibility falls with its stiffnesses and dampings; what standing still does to stiffness and damping."""
    for f in range(size):
        w, stands, grip = points[first + f, 0], points[first + f, 2], points[first + f, 3]
        for a in range(2):
            inverse = _reciprocal(complex(grip * joint[a], w * joint[2 + a]))
            inverse *= inverse
            _put(flexible[a], f, grip * inverse)
            _put(flexible[2 + a], f, complex(0.0, w) * inverse)
        if joint.size == 6:
            _put(still[0], f, complex(-2.0 * stands / (1.0 + stands * joint[4]), 0.0))
            _put(still[1], f, complex(0.0, -w * stands))


@numba.njit(cache=True, error_model="numpy")
def _reciprocal(z):
    scale = 1.0 / (z.real * z.real + z.imag * z.imag)
    return complex(z.real * scale, -z.imag * scale)


@numba.njit(cache=True, error_model="numpy")
def _at(row, f):
    return complex(row[0, f], row[1, f])


@numba.njit(cache=True, error_model="numpy")
def _put(row, f, z):
    row[0, f], row[1, f] = z.real, z.imag
