"""Cross FRF of a candidate with its gradient, and each cut's delay; arrays and scalars only.

Scaled units: slopes are multiplied and moments divided by a lever, so that all receptances are in m/N. A symmetric 2 x 2
block is stored as its entries (tt, tr, rr).
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True, error_model="numpy")
def _factor_solve(matrix, right):
    """Solve a complex symmetric system in place: L D L^T, lower triangle read, `right` (m, 2) overwritten."""
    m = right.shape[0]
    for j in range(m):
        inverse = 1.0 / matrix[j, j]
        for i in range(j + 1, m):
            ratio = matrix[i, j] * inverse
            for k in range(i, m):
                matrix[k, i] -= ratio * matrix[k, j]
            right[i, 0] -= ratio * right[j, 0]
            right[i, 1] -= ratio * right[j, 1]
    for j in range(m - 1, -1, -1):
        first, second = right[j, 0], right[j, 1]
        for i in range(j + 1, m):
            first -= matrix[i, j] * right[i, 0]
            second -= matrix[i, j] * right[i, 1]
        right[j, 0] = first / matrix[j, j]
        right[j, 1] = second / matrix[j, j]


@numba.njit(cache=True, error_model="numpy")
def cross_frf(stiffness, psi, factor, residual, joint, omega, flange, tip, values, gradient):
    """Fill `values` (n,) with the flange motion per tip force and, if it has rows, `gradient` (n, p).

    B = psi^T (diag(stiffness) - w^2 + i w factor factor^T)^-1 psi + residual residual^T,
    g = e0^T B x with x = (A22 + K^-1 + B)^-1 A21 e0; dg = v^T dB x - y^T dK^-1 x, y = (A22 + K^-1 + B)^-1 B e0, v = e0 - y.

    Parameters
    ----------
    stiffness : (m,) squares of the natural frequencies
    psi : (m, 2); factor : (m, m) lower triangular; residual : (2, 2) lower triangular
    joint : (4,) k_t, k_r, c_t, c_r
    omega : (n,); flange : (n, 3) A22; tip : (n, 2) A21 e0

    The gradient's columns: stiffness (m), psi (2 m), factor's lower triangle by rows, residual's (3), joint (4).
    """
    m = stiffness.size
    damping = factor @ factor.T
    r_tt = residual[0, 0] ** 2
    r_tr = residual[0, 0] * residual[1, 0]
    r_rr = residual[1, 0] ** 2 + residual[1, 1] ** 2
    dynamic = np.empty((m, m), dtype=np.complex128)
    u = np.empty((m, 2), dtype=np.complex128)
    p = np.empty(m, dtype=np.complex128)
    q = np.empty(m, dtype=np.complex128)
    lp = np.empty(m, dtype=np.complex128)
    lq = np.empty(m, dtype=np.complex128)
    for f in range(omega.size):
        w = omega[f]
        for i in range(m):
            for j in range(i + 1):
                dynamic[i, j] = complex(0.0, w * damping[i, j])
            dynamic[i, i] += stiffness[i] - w * w
            u[i, 0] = psi[i, 0]
            u[i, 1] = psi[i, 1]
        _factor_solve(dynamic, u)
        b_tt, b_tr, b_rr = complex(r_tt, 0.0), complex(r_tr, 0.0), complex(r_rr, 0.0)
        for i in range(m):
            b_tt += psi[i, 0] * u[i, 0]
            b_tr += psi[i, 0] * u[i, 1]
            b_rr += psi[i, 1] * u[i, 1]
        k_t = 1.0 / complex(joint[0], w * joint[2])
        k_r = 1.0 / complex(joint[1], w * joint[3])
        e_tt, e_tr, e_rr = flange[f, 0] + k_t + b_tt, flange[f, 1] + b_tr, flange[f, 2] + k_r + b_rr
        inverse = 1.0 / (e_tt * e_rr - e_tr * e_tr)
        x0 = (e_rr * tip[f, 0] - e_tr * tip[f, 1]) * inverse
        x1 = (e_tt * tip[f, 1] - e_tr * tip[f, 0]) * inverse
        values[f] = b_tt * x0 + b_tr * x1
        if gradient.shape[0] == 0:
            continue
        y0 = (e_rr * b_tt - e_tr * b_tr) * inverse
        y1 = (e_tt * b_tr - e_tr * b_tt) * inverse
        v0, v1 = 1.0 - y0, -y1
        for i in range(m):
            p[i] = u[i, 0] * v0 + u[i, 1] * v1
            q[i] = u[i, 0] * x0 + u[i, 1] * x1
        for j in range(m):
            sum_p, sum_q = complex(0.0, 0.0), complex(0.0, 0.0)
            for i in range(j, m):
                sum_p += factor[i, j] * p[i]
                sum_q += factor[i, j] * q[i]
            lp[j], lq[j] = sum_p, sum_q
        row = gradient[f]
        k = 3 * m
        for i in range(m):
            row[i] = -p[i] * q[i]
            row[m + 2 * i] = v0 * q[i] + p[i] * x0
            row[m + 2 * i + 1] = v1 * q[i] + p[i] * x1
            for j in range(i + 1):
                row[k] = complex(0.0, -w) * (p[i] * lq[j] + lp[j] * q[i])
                k += 1
        mixed = v0 * x1 + v1 * x0
        row[k] = 2.0 * residual[0, 0] * v0 * x0 + residual[1, 0] * mixed
        row[k + 1] = residual[0, 0] * mixed + 2.0 * residual[1, 0] * v1 * x1
        row[k + 2] = 2.0 * residual[1, 1] * v1 * x1
        row[k + 3] = y0 * x0 * k_t * k_t
        row[k + 4] = y1 * x1 * k_r * k_r
        row[k + 5] = complex(0.0, w) * row[k + 3]
        row[k + 6] = complex(0.0, w) * row[k + 4]


@numba.njit(cache=True, error_model="numpy")
def fit_cuts(lines, weights, model, start, prior, nuisance, grid):
    """Fit each cut's delay and the angle to its air cut to the model, in place.

    Minimises sum w |(c - a e^{i m angle}) e^{i omega delay} - g|^2 + the priors' squares, for each cut apart: the delay from a
    grid over one tooth-passing period (and from where it stands), then damped Gauss-Newton steps of both.

    Parameters
    ----------
    lines : (n, 2) complex, c and a; weights : (n, 3): omega, order, w; model : (n,) g
    start : (k + 1,) first line of each cut
    prior : (k, 4): delay's mean and weight, angle's weight, tooth-passing period
    nuisance : (k, 2): delay, angle
    grid : number of delays tried; 0 keeps to the neighbourhood of the given ones
    """
    for cut in range(start.size - 1):
        first, last = start[cut], start[cut + 1]
        mean, delay_weight, angle_weight, period = prior[cut]
        angle = nuisance[cut, 1]
        best = _cut_misfit(lines, weights, model, first, last, nuisance[cut, 0], angle)
        best += delay_weight * (nuisance[cut, 0] - mean) ** 2
        delay = nuisance[cut, 0]
        for k in range(grid):
            trial = period * k / grid
            trial += period * np.round((mean - trial) / period) if delay_weight > 0.0 else 0.0
            value = _cut_misfit(lines, weights, model, first, last, trial, angle) + delay_weight * (trial - mean) ** 2
            if value < best:
                best, delay = value, trial
        best += angle_weight * angle**2
        damping = 0.0
        for _ in range(12):
            g0 = delay_weight * (delay - mean)
            g1 = angle_weight * angle
            h00, h01, h11 = delay_weight, 0.0, angle_weight
            for j in range(first, last):
                omega, order, weight = weights[j]
                rotation = complex(math.cos(omega * delay), math.sin(omega * delay))
                turned = lines[j, 1] * complex(math.cos(order * angle), math.sin(order * angle))
                measured = (lines[j, 0] - turned) * rotation
                rest = measured - model[j]
                d0 = complex(0.0, omega) * measured
                d1 = complex(0.0, -order) * turned * rotation
                g0 += weight * (d0.real * rest.real + d0.imag * rest.imag)
                g1 += weight * (d1.real * rest.real + d1.imag * rest.imag)
                h00 += weight * (d0.real**2 + d0.imag**2)
                h01 += weight * (d0.real * d1.real + d0.imag * d1.imag)
                h11 += weight * (d1.real**2 + d1.imag**2)
            h00 *= 1.0 + damping
            h11 *= 1.0 + damping
            determinant = h00 * h11 - h01 * h01
            if not determinant > 0.0:
                break
            step0 = -(h11 * g0 - h01 * g1) / determinant
            step1 = -(h00 * g1 - h01 * g0) / determinant
            value = _cut_misfit(lines, weights, model, first, last, delay + step0, angle + step1)
            value += delay_weight * (delay + step0 - mean) ** 2 + angle_weight * (angle + step1) ** 2
            if value <= best:
                gained = best - value
                delay, angle, best = delay + step0, angle + step1, value
                damping *= 0.1
                if gained <= 1e-10 * best:
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
    for j in range(first, last):
        omega, order, weight = weights[j]
        rotation = complex(math.cos(omega * delay), math.sin(omega * delay))
        turned = lines[j, 1] * complex(math.cos(order * angle), math.sin(order * angle))
        rest = (lines[j, 0] - turned) * rotation - model[j]
        total += weight * (rest.real**2 + rest.imag**2)
    return total


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
