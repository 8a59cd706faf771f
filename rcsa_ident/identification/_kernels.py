"""Cross FRF of a candidate with its gradient, and each cut's delay; arrays and scalars only.

Scaled units: slopes are multiplied and moments divided by a lever, so that all receptances are in m/N. A symmetric 2 x 2
block is stored as its entries (tt, tr, rr).
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True, error_model="numpy")
def _factor_solve(matrix, right, columns):
    """Solve a complex symmetric system in place: L D L^T, lower triangle read, the first `columns` of `right` overwritten."""
    m = right.shape[0]
    for j in range(m):
        inverse = 1.0 / matrix[j, j]
        for i in range(j + 1, m):
            ratio = matrix[i, j] * inverse
            for k in range(i, m):
                matrix[k, i] -= ratio * matrix[k, j]
            for c in range(columns):
                right[i, c] -= ratio * right[j, c]
        # kept for the way back: the pivots are not needed otherwise
        matrix[j, j] = inverse
    for j in range(m - 1, -1, -1):
        inverse = matrix[j, j]
        for c in range(columns):
            total = right[j, c]
            for i in range(j + 1, m):
                total -= matrix[i, j] * right[i, c]
            right[j, c] = total * inverse


@numba.njit(cache=True, error_model="numpy")
def cross_frf(omega_n, shapes, factor, softening, joint, shares, points, holder, values, gradient):
    """Fill `values` (n, o) with motion per tip force and, if it has rows, `gradient` (n, o, p).

    B = psi^T (K - w^2 + i w factor factor^T)^-1 psi + R, K_ij = omega_i omega_j (delta_ij + x softening_ij);
    output b (a row: the flange's own, or another place's, or what `shares` makes of them) answers g = b x with
    x = (A22 + K_joint^-1 + B)^-1 A21 e0; dg = db x - y^T (dB + dK_joint^-1) x, y = (A22 + K_joint^-1 + B)^-1 b^T.
    A point of the tool-holder answers c + b x with b = -A_p2 and c its direct receptance, the machine's motion not being its own.

    Parameters
    ----------
    omega_n : (m,); factor : (m, m) lower triangular
    shapes : (m + 2, 2 + e) flange t, flange r, other places; psi, and behind it the residual: of the flange transposed, a lower
        triangular factor of R, of other places to the flange's t and r, as it is
    softening : (m, m) symmetric, or (0, 0) where nothing changes with speed
    joint : (4,) k_t, k_r, c_t, c_r, or (6,) with the shares by which natural frequencies and damping differ where the spindle stands still
    shares : (o, 1 + e) what of the flange's motion and of the other places' is in each output
    points : (n, 4) omega, x, 1 for motions of the machine and 0 for those of the tool-holder, 1 where the spindle stands still
    holder : (n, 8) A22 tt, tr, rr, A21 e0 t, r, c and b of a point of the tool-holder (zeros for the machine's)

    The gradient's columns: log omega_n (m), psi's first two columns by rows (2 m), factor's lower triangle by rows, B's tt, tr, rr (3),
    of each other place psi's column (m) and its residual (2), with six of the joint what standing still changes (2), with softening
    its lower triangle by rows, joint (4); where it has six more, A22's tt, tr, rr, A21 e0's t, r and c, where all points of the tool-holder
    are the tip: b = -A21 e0 changes with the latter two.
    """
    m = omega_n.size
    outputs, places = shares.shape[0], shares.shape[1] - 1
    psi, residual = shapes[:m], shapes[m:].T
    soft = softening.shape[0] > 0
    damping = factor @ factor.T
    stills = joint.size == 6
    r_tt = residual[0, 0] ** 2
    r_tr = residual[0, 0] * residual[1, 0]
    r_rr = residual[1, 0] ** 2 + residual[1, 1] ** 2
    stiffness = np.zeros((m, m))
    dynamic = np.empty((m, m), dtype=np.complex128)
    u = np.empty((m, 2 + places), dtype=np.complex128)
    s = np.empty((places, 2), dtype=np.complex128)
    p = np.empty(m, dtype=np.complex128)
    q = np.empty(m, dtype=np.complex128)
    lp = np.empty(m, dtype=np.complex128)
    lq = np.empty(m, dtype=np.complex128)
    for f in range(points.shape[0]):
        w, x, own, still = points[f]
        stiffer, slower = 1.0, 1.0
        if stills:
            stiffer, slower = (1.0 + still * joint[4]) ** 2, 1.0 + still * joint[5]
        for i in range(m):
            for j in range(i + 1):
                k_ij = omega_n[i] ** 2 if i == j else 0.0
                if soft:
                    k_ij += x * softening[i, j] * omega_n[i] * omega_n[j]
                k_ij *= stiffer
                stiffness[i, j] = k_ij
                stiffness[j, i] = k_ij
                dynamic[i, j] = complex(k_ij - (w * w if i == j else 0.0), w * slower * damping[i, j])
            for a in range(2 + places):
                u[i, a] = psi[i, a]
        _factor_solve(dynamic, u, 2 + places)
        b_tt, b_tr, b_rr = complex(r_tt, 0.0), complex(r_tr, 0.0), complex(r_rr, 0.0)
        for i in range(m):
            b_tt += psi[i, 0] * u[i, 0]
            b_tr += psi[i, 0] * u[i, 1]
            b_rr += psi[i, 1] * u[i, 1]
        for e in range(places):
            for a in range(2):
                s[e, a] = complex(residual[2 + e, a], 0.0)
                for i in range(m):
                    s[e, a] += psi[i, 2 + e] * u[i, a]
        k_t = 1.0 / complex(joint[0], w * joint[2])
        k_r = 1.0 / complex(joint[1], w * joint[3])
        e_tt, e_tr, e_rr = holder[f, 0] + k_t + b_tt, holder[f, 1] + b_tr, holder[f, 2] + k_r + b_rr
        inverse = 1.0 / (e_tt * e_rr - e_tr * e_tr)
        x0 = (e_rr * holder[f, 3] - e_tr * holder[f, 4]) * inverse
        x1 = (e_tt * holder[f, 4] - e_tr * holder[f, 3]) * inverse
        for i in range(m):
            q[i] = u[i, 0] * x0 + u[i, 1] * x1
        for o in range(outputs):
            flange = own * shares[o, 0]
            b_t, b_r = flange * b_tt, flange * b_tr
            for e in range(places):
                b_t += own * shares[o, 1 + e] * s[e, 0]
                b_r += own * shares[o, 1 + e] * s[e, 1]
            values[f, o] = 0.0
            if o == 0:
                b_t += holder[f, 6]
                b_r += holder[f, 7]
                values[f, o] = holder[f, 5]
            values[f, o] += b_t * x0 + b_r * x1
            if gradient.shape[0] == 0:
                continue
            y0 = (e_rr * b_t - e_tr * b_r) * inverse
            y1 = (e_tt * b_r - e_tr * b_t) * inverse
            v0, v1 = flange - y0, -y1
            for i in range(m):
                p[i] = u[i, 0] * v0 + u[i, 1] * v1
                for e in range(places):
                    p[i] += own * shares[o, 1 + e] * u[i, 2 + e]
            for j in range(m):
                sum_p, sum_q = complex(0.0, 0.0), complex(0.0, 0.0)
                for i in range(j, m):
                    sum_p += factor[i, j] * p[i]
                    sum_q += factor[i, j] * q[i]
                lp[j], lq[j] = sum_p, sum_q
            row = gradient[f, o]
            k = 3 * m
            for i in range(m):
                if soft:
                    kp, kq = complex(0.0, 0.0), complex(0.0, 0.0)
                    for j in range(m):
                        kp += stiffness[i, j] * p[j]
                        kq += stiffness[i, j] * q[j]
                    row[i] = -p[i] * kq - kp * q[i]
                else:
                    row[i] = -2.0 * stiffness[i, i] * p[i] * q[i]
                row[m + 2 * i] = v0 * q[i] + p[i] * x0
                row[m + 2 * i + 1] = v1 * q[i] + p[i] * x1
                for j in range(i + 1):
                    row[k] = complex(0.0, -w * slower) * (p[i] * lq[j] + lp[j] * q[i])
                    k += 1
            row[k] = v0 * x0
            row[k + 1] = v0 * x1 + v1 * x0
            row[k + 2] = v1 * x1
            k += 3
            for e in range(places):
                share = own * shares[o, 1 + e]
                for i in range(m):
                    row[k + i] = share * q[i]
                row[k + m] = share * x0
                row[k + m + 1] = share * x1
                k += m + 2
            if stills:
                # all natural frequencies, and all of the damping, by a share
                elastic, lost = complex(0.0, 0.0), complex(0.0, 0.0)
                for i in range(m):
                    lost += lp[i] * lq[i]
                    for j in range(m):
                        elastic += p[i] * stiffness[i, j] * q[j]
                row[k] = -2.0 * still / (1.0 + still * joint[4]) * elastic
                row[k + 1] = complex(0.0, -w * still) * lost
                k += 2
            if soft:
                for i in range(m):
                    scale = -x * stiffer * omega_n[i]
                    for j in range(i):
                        row[k] = scale * omega_n[j] * (p[i] * q[j] + p[j] * q[i])
                        k += 1
                    row[k] = scale * omega_n[i] * p[i] * q[i]
                    k += 1
            row[k] = y0 * x0 * k_t * k_t
            row[k + 1] = y1 * x1 * k_r * k_r
            row[k + 2] = complex(0.0, w) * row[k]
            row[k + 3] = complex(0.0, w) * row[k + 1]
            k += 4
            if k < row.size:
                row[k] = -y0 * x0
                row[k + 1] = -y0 * x1 - y1 * x0
                row[k + 2] = -y1 * x1
                # the first output alone holds the tool-holder's own motion
                away = 1.0 - own if o == 0 else 0.0
                row[k + 3] = y0 - away * x0
                row[k + 4] = y1 - away * x1
                row[k + 5] = away


@numba.njit(cache=True, error_model="numpy")
def fit_cuts(lines, weights, model, start, prior, nuisance, grid):
    """Fit each cut's delay and the angle to its air cut to the model, in place.

    Minimises sum w |(c - a e^{i m angle}) e^{i omega delay} - g|^2 + the priors' squares, for each cut apart: the delay from a
    grid over one tooth-passing period (and from where it stands), then damped Gauss-Newton steps of both.

    Parameters
    ----------
    lines : (n, 2) complex, c and a; weights : (n, 3): omega, order, w; model : (n,) g; in each cut orders ascend
    start : (k + 1,) first line of each cut
    prior : (k, 4): delay's mean and weight, angle's weight, tooth-passing period
    nuisance : (k, 2): delay, angle
    grid : number of delays tried; 0 keeps to the neighbourhood of the given ones
    """
    here = np.empty(6)
    there = np.empty(6)
    for cut in range(start.size - 1):
        first, last = start[cut], start[cut + 1]
        mean, delay_weight, period = prior[cut, 0], prior[cut, 1], prior[cut, 3]
        delay, angle = nuisance[cut]
        if grid > 0:
            best = _cut_misfit(lines, weights, model, first, last, delay, angle) + delay_weight * (delay - mean) ** 2
            for k in range(grid):
                trial = period * k / grid
                trial += period * np.round((mean - trial) / period) if delay_weight > 0.0 else 0.0
                value = _cut_misfit(lines, weights, model, first, last, trial, angle) + delay_weight * (trial - mean) ** 2
                if value < best:
                    best, delay = value, trial
        _cut_normal(lines, weights, model, first, last, prior[cut], delay, angle, here)
        damping = 0.0
        for _ in range(12):
            h00 = here[3] * (1.0 + damping)
            h11 = here[5] * (1.0 + damping)
            determinant = h00 * h11 - here[4] * here[4]
            if not determinant > 0.0:
                break
            step0 = -(h11 * here[1] - here[4] * here[2]) / determinant
            step1 = -(h00 * here[2] - here[4] * here[1]) / determinant
            _cut_normal(lines, weights, model, first, last, prior[cut], delay + step0, angle + step1, there)
            if there[0] <= here[0]:
                gained = here[0] - there[0]
                delay, angle = delay + step0, angle + step1
                here[:] = there
                damping *= 0.1
                if gained <= 1e-10 * here[0]:
                    break
            else:
                damping = max(10.0 * damping, 1e-2)
                if damping > 1e6:
                    break
        nuisance[cut, 0] = delay
        nuisance[cut, 1] = angle


@numba.njit(cache=True, error_model="numpy")
def _cut_misfit(lines, weights, model, first, last, delay, angle):
    total = 0.0
    turn, twist = complex(1.0, 0.0), complex(1.0, 0.0)
    step, twist_step = turn, twist
    order, gap = 0.0, 0.0
    for j in range(first, last):
        # harmonics stand at equal distances: one product takes the place of a sine and a cosine
        ahead = weights[j, 1] - order
        if ahead != 0.0:
            if ahead != gap:
                gap = ahead
                phase = gap * weights[j, 0] / weights[j, 1] * delay
                step = complex(math.cos(phase), math.sin(phase))
                twist_step = complex(math.cos(gap * angle), math.sin(gap * angle))
            order = weights[j, 1]
            turn *= step
            twist *= twist_step
        rest = (lines[j, 0] - lines[j, 1] * twist) * turn - model[j]
        total += weights[j, 2] * (rest.real**2 + rest.imag**2)
    return total


@numba.njit(cache=True, error_model="numpy")
def _cut_normal(lines, weights, model, first, last, prior, delay, angle, out):
    """Fill `out` with a cut's misfit and priors, half its gradient and its Gauss-Newton matrix: value, g0, g1, h00, h01, h11."""
    late = delay - prior[0]
    value = prior[1] * late**2 + prior[2] * angle**2
    g0, g1 = prior[1] * late, prior[2] * angle
    h00, h01, h11 = prior[1], 0.0, prior[2]
    turn, twist = complex(1.0, 0.0), complex(1.0, 0.0)
    step, twist_step = turn, twist
    order, gap = 0.0, 0.0
    for j in range(first, last):
        omega, weight = weights[j, 0], weights[j, 2]
        ahead = weights[j, 1] - order
        if ahead != 0.0:
            if ahead != gap:
                gap = ahead
                phase = gap * omega / weights[j, 1] * delay
                step = complex(math.cos(phase), math.sin(phase))
                twist_step = complex(math.cos(gap * angle), math.sin(gap * angle))
            order = weights[j, 1]
            turn *= step
            twist *= twist_step
        air = lines[j, 1] * twist
        measured = (lines[j, 0] - air) * turn
        air *= turn
        rest = measured - model[j]
        # d/d delay = i omega measured, d/d angle = -i order air
        d0 = complex(-omega * measured.imag, omega * measured.real)
        d1 = complex(order * air.imag, -order * air.real)
        value += weight * (rest.real**2 + rest.imag**2)
        g0 += weight * (d0.real * rest.real + d0.imag * rest.imag)
        g1 += weight * (d1.real * rest.real + d1.imag * rest.imag)
        h00 += weight * (d0.real**2 + d0.imag**2)
        h01 += weight * (d0.real * d1.real + d0.imag * d1.imag)
        h11 += weight * (d1.real**2 + d1.imag**2)
    out[0], out[1], out[2], out[3], out[4], out[5] = value, g0, g1, h00, h01, h11


@numba.njit(cache=True, error_model="numpy")
def whiten(gradient, extra, model, weight, chain, out):
    """Fill `out` (2 n, p + c) with the residual's real and imaginary rows: -sqrt(weight) (gradient chain, model extra).

    Parameters
    ----------
    gradient : (n, p or more) complex; extra : (n, c) complex, d log model / d unknown of the force
    model : (n,) complex; weight : (n,); chain : (p,)
    """
    n, p = gradient.shape[0], chain.size
    for f in range(n):
        scale = -math.sqrt(weight[f])
        for k in range(p):
            out[f, k] = scale * chain[k] * gradient[f, k].real
            out[n + f, k] = scale * chain[k] * gradient[f, k].imag
        for c in range(extra.shape[1]):
            value = scale * model[f] * extra[f, c]
            out[f, p + c] = value.real
            out[n + f, p + c] = value.imag


@numba.njit(cache=True, error_model="numpy")
def mix_cuts(jacobian, columns, cut, own, first, tail, inner, mixed):
    """Add the lines of one axis to the cuts' own matrices `inner` (k, 2, 2) and `mixed` (k, 2, p).

    Parameters
    ----------
    jacobian : (2 n, q) real over imaginary rows; its first `own` columns are the parameters from `first` on, the rest from `tail` on
    columns : (n, 2) complex, change of the lines with delay and angle of their cut; cut : (n,)
    """
    n = cut.size
    for f in range(n):
        k = cut[f]
        for i in range(2):
            real, imag = columns[f, i].real, columns[f, i].imag
            inner[k, i, 0] += real * columns[f, 0].real + imag * columns[f, 0].imag
            inner[k, i, 1] += real * columns[f, 1].real + imag * columns[f, 1].imag
            row = mixed[k, i]
            for c in range(own):
                row[first + c] += real * jacobian[f, c] + imag * jacobian[n + f, c]
            for c in range(own, jacobian.shape[1]):
                row[tail + c - own] += real * jacobian[f, c] + imag * jacobian[n + f, c]


@numba.njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "arcp", "nsz"})
def modal_cross_frf(modes, joint, omega, flange, tip, out):
    """Fill `out` (2, n) with real and imaginary part of the cross FRF of complex modes: the search's cheap candidate.

    Per mode the conjugate pair is one real fraction, (a + i w b) / (w_n^2 - w^2 + 2 i zeta w_n w), with one reciprocal per
    mode and frequency and the frequencies innermost, so that the loop runs in vector registers.

    Parameters
    ----------
    modes : (m, 8): w_n^2, 2 zeta w_n, then a and b of tt, tr, rr
    joint : (4,) k_t, k_r, c_t, c_r
    omega : (n,); flange : (6, n) real and imaginary parts of A22's tt, tr, rr; tip : (4, n) of A21's t, r
    """
    n = omega.size
    b = np.zeros((6, n))
    for k in range(modes.shape[0]):
        square, twice, a0, b0, a1, b1, a2, b2 = modes[k]
        for f in range(n):
            w = omega[f]
            real = square - w * w
            imag = twice * w
            scale = 1.0 / (real * real + imag * imag)
            u = real * scale
            v = imag * scale
            wu = w * u
            wv = w * v
            b[0, f] += a0 * u + b0 * wv
            b[1, f] += b0 * wu - a0 * v
            b[2, f] += a1 * u + b1 * wv
            b[3, f] += b1 * wu - a1 * v
            b[4, f] += a2 * u + b2 * wv
            b[5, f] += b2 * wu - a2 * v
    for f in range(n):
        w = omega[f]
        dt, dr = w * joint[2], w * joint[3]
        st, sr = 1.0 / (joint[0] ** 2 + dt * dt), 1.0 / (joint[1] ** 2 + dr * dr)
        e0r, e0i = flange[0, f] + b[0, f] + joint[0] * st, flange[1, f] + b[1, f] - dt * st
        e1r, e1i = flange[2, f] + b[2, f], flange[3, f] + b[3, f]
        e2r, e2i = flange[4, f] + b[4, f] + joint[1] * sr, flange[5, f] + b[5, f] - dr * sr
        det_r = e0r * e2r - e0i * e2i - e1r * e1r + e1i * e1i
        det_i = e0r * e2i + e0i * e2r - 2.0 * e1r * e1i
        scale = 1.0 / (det_r * det_r + det_i * det_i)
        # numerator of e0^T B E^-1 a: (b_tt e_rr - b_tr e_tr) a_t + (b_tr e_tt - b_tt e_tr) a_r
        ptr = b[0, f] * e2r - b[1, f] * e2i - b[2, f] * e1r + b[3, f] * e1i
        pti = b[0, f] * e2i + b[1, f] * e2r - b[2, f] * e1i - b[3, f] * e1r
        prr = b[2, f] * e0r - b[3, f] * e0i - b[0, f] * e1r + b[1, f] * e1i
        pri = b[2, f] * e0i + b[3, f] * e0r - b[0, f] * e1i - b[1, f] * e1r
        nr = ptr * tip[0, f] - pti * tip[1, f] + prr * tip[2, f] - pri * tip[3, f]
        ni = ptr * tip[1, f] + pti * tip[0, f] + prr * tip[3, f] + pri * tip[2, f]
        out[0, f] = (nr * det_r + ni * det_i) * scale
        out[1, f] = (ni * det_r - nr * det_i) * scale


@numba.njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "arcp", "nsz"})
def best_grid_misfit(model, measured, weight, table, start, group, totals):
    """Add to `totals` the misfit of each cut at its best delay on a grid, by group (tooling).

    |h e^{i omega delay} - g|^2 = |h|^2 + |g|^2 - 2 Re(conj(g) h e^{i omega delay}).

    Parameters
    ----------
    model : (2, n); measured : (n,) |h|^2; weight : (n,)
    table : (d, 2, n): h e^{i omega delay} on the grid
    start : (k + 1,); group : (k,)
    """
    delays = table.shape[0]
    overlap = np.empty(delays)
    for cut in range(start.size - 1):
        first, last = start[cut], start[cut + 1]
        best = 0
        for d in range(delays):
            total = 0.0
            for f in range(first, last):
                total += weight[f] * (model[0, f] * table[d, 0, f] + model[1, f] * table[d, 1, f])
            overlap[d] = total
            if total > overlap[best]:
                best = d
        # the grid is fine enough for a parabola through the best delay and its neighbours; the period closes it
        before, after = overlap[best - 1], overlap[(best + 1) % delays]
        bend = 2.0 * overlap[best] - before - after
        top = overlap[best] + (after - before) ** 2 / (8.0 * bend) if bend > 0.0 else overlap[best]
        size = 0.0
        for f in range(first, last):
            size += weight[f] * (measured[f] + model[0, f] ** 2 + model[1, f] ** 2)
        totals[group[cut]] += max(size - 2.0 * top, 0.0)
