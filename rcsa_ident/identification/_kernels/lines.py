"""Each cut's delay, what lines weigh, and the cross FRF of complex modes; arrays and scalars only.

Scaled units: slopes are multiplied and moments divided by a lever, so that all receptances are in m/N. A symmetric 2 x 2
block is stored as its entries (tt, tr, rr).
"""

from __future__ import annotations

import math

import numba
import numpy as np


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
    overlap, turn, step = np.empty(grid), np.empty((2, grid)), np.empty((2, grid))
    for cut in range(start.size - 1):
        first, last = start[cut], start[cut + 1]
        mean, delay_weight, period = prior[cut, 0], prior[cut, 1], prior[cut, 3]
        delay, angle = nuisance[cut]
        if grid > 0:
            best = _cut_misfit(lines, weights, model, first, last, delay, angle) + delay_weight * (delay - mean) ** 2
            size = _grid_overlap(lines, weights, model, first, last, period / grid, angle, overlap, turn, step)
            for k in range(grid):
                trial = period * k / grid
                trial += period * np.round((mean - trial) / period) if delay_weight > 0.0 else 0.0
                value = size - 2.0 * overlap[k] + delay_weight * (trial - mean) ** 2
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
                for k in range(6):
                    here[k] = there[k]
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
def _grid_overlap(lines, weights, model, first, last, spacing, angle, overlap, turn, step):
    """Fill `overlap` with sum w Re(conj(g) h e^{i omega delay}) at delays `spacing` apart; return sum w (|h|^2 + |g|^2).

    h = c - a e^{i m angle}; |h e^{i omega delay} - g|^2 = |h|^2 + |g|^2 - 2 Re(conj(g) h e^{i omega delay}): a delay changes one product.
    """
    count, size = overlap.size, 0.0
    real, imag, ahead_real, ahead_imag = turn[0], turn[1], step[0], step[1]
    overlap[:], real[:], imag[:] = 0.0, 1.0, 0.0
    order, gap = 0.0, 0.0
    for j in range(first, last):
        ahead = weights[j, 1] - order
        if ahead != 0.0:
            if ahead != gap:
                gap = ahead
                phase = gap * weights[j, 0] / weights[j, 1] * spacing
                each, power = complex(math.cos(phase), math.sin(phase)), complex(1.0, 0.0)
                for k in range(count):
                    ahead_real[k], ahead_imag[k] = power.real, power.imag
                    power *= each
            order = weights[j, 1]
            for k in range(count):
                turned = real[k] * ahead_real[k] - imag[k] * ahead_imag[k]
                imag[k] = real[k] * ahead_imag[k] + imag[k] * ahead_real[k]
                real[k] = turned
        rest = lines[j, 0]
        if angle != 0.0:
            rest -= lines[j, 1] * complex(math.cos(order * angle), math.sin(order * angle))
        else:
            rest -= lines[j, 1]
        size += weights[j, 2] * (rest.real**2 + rest.imag**2 + model[j].real ** 2 + model[j].imag ** 2)
        both = weights[j, 2] * rest * model[j].conjugate()
        for k in range(count):
            overlap[k] += both.real * real[k] - both.imag * imag[k]
    return size


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
def turn_lines(lines, weights, cut, nuisance, turned):
    """Fill `turned` (n, 2) with the lines as they would be without their cut's delay, and with the air cut's part of them.

    Parameters
    ----------
    lines : (n, 2) complex, c and a; weights : (n, 3): omega, order, w; cut : (n,)
    nuisance : (k, 2): delay, angle
    """
    for f in range(cut.size):
        delay, angle = nuisance[cut[f]]
        phase = weights[f, 0] * delay
        back = complex(math.cos(phase), math.sin(phase))
        air = lines[f, 1] * back
        if angle != 0.0:
            phase = weights[f, 1] * angle
            air *= complex(math.cos(phase), math.sin(phase))
        turned[f, 0] = lines[f, 0] * back - air
        turned[f, 1] = air


@numba.njit(cache=True, error_model="numpy")
def whiten(gradient, extra, weight, chain, out):
    """Fill `out` (p + c, 2 n) with the residual's change: real, then imaginary parts of -sqrt(weight) (chain gradient, extra).

    Parameters
    ----------
    gradient : (n, p or more) complex; extra : (n, c) complex; weight : (n,); chain : (p,)
    """
    n, p = gradient.shape[0], chain.size
    for f in range(n):
        scale = -math.sqrt(weight[f])
        for k in range(p):
            out[k, f] = scale * chain[k] * gradient[f, k].real
            out[k, n + f] = scale * chain[k] * gradient[f, k].imag
        for c in range(extra.shape[1]):
            out[p + c, f] = scale * extra[f, c].real
            out[p + c, n + f] = scale * extra[f, c].imag


@numba.njit(cache=True, error_model="numpy")
def force_rows(slope, lines, out):
    """Fill `out` (c, 2 n o) with the lines' change with each unknown of the force: real parts, then imaginary parts of lines slope.

    Parameters
    ----------
    slope : (n, c) complex, change of the force's logarithm; lines : (n, o) complex
    """
    n, outputs = lines.shape
    for c in range(slope.shape[1]):
        row = out[c]
        for f in range(n):
            for o in range(outputs):
                value = lines[f, o] * slope[f, c]
                row[f * outputs + o] = value.real
                row[(n + f) * outputs + o] = value.imag


@numba.njit(cache=True, error_model="numpy")
def mix_cuts(jacobian, columns, cut, own, first, tail, inner, mixed):
    """Add the lines of one axis to the cuts' own matrices `inner` (k, 2, 2) and `mixed` (k, 2, p).

    Parameters
    ----------
    jacobian : (q, 2 n) real and then imaginary parts; its first `own` rows are the parameters from `first` on, the rest from `tail` on
    columns : (n, 2) complex, change of the lines with delay and angle of their cut; cut : (n,), ascending
    """
    n = cut.size
    for f in range(n):
        k = cut[f]
        for i in range(2):
            real, imag = columns[f, i].real, columns[f, i].imag
            inner[k, i, 0] += real * columns[f, 0].real + imag * columns[f, 0].imag
            inner[k, i, 1] += real * columns[f, 1].real + imag * columns[f, 1].imag
    for c in range(jacobian.shape[0]):
        row, place = jacobian[c], first + c if c < own else tail + c - own
        f = 0
        while f < n:
            k = cut[f]
            delay, angle = 0.0, 0.0
            while f < n and cut[f] == k:
                real, imag = row[f], row[n + f]
                delay += columns[f, 0].real * real + columns[f, 0].imag * imag
                angle += columns[f, 1].real * real + columns[f, 1].imag * imag
                f += 1
            mixed[k, 0, place] += delay
            mixed[k, 1, place] += angle


@numba.njit(cache=True, error_model="numpy")
def sum_cuts(columns, cut, rest, sums):
    """Add to `sums` (k, 2) what the lines of each cut say of its delay and angle.

    Parameters
    ----------
    columns : (n, 2) complex, as in `mix_cuts`; cut : (n,); rest : (2 n,) residual, real and then imaginary parts
    """
    n = cut.size
    for f in range(n):
        for i in range(2):
            sums[cut[f], i] += columns[f, i].real * rest[f] + columns[f, i].imag * rest[n + f]


@numba.njit(cache=True, error_model="numpy")
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


@numba.njit(cache=True, error_model="numpy")
def best_grid_misfit(model, measured, weight, table, start, group, totals):
    """Add to `totals` the misfit of each cut at its best delay on a grid, by group (tooling).

    |h e^{i omega delay} - g|^2 = |h|^2 + |g|^2 - 2 Re(conj(g) h e^{i omega delay}).

    Parameters
    ----------
    model : (2, n); measured : (n,) |h|^2; weight : (n,)
    table : (n, 2, d): h e^{i omega delay} on the grid
    start : (k + 1,); group : (k,)
    """
    delays = table.shape[2]
    overlap = np.empty(delays)
    for cut in range(start.size - 1):
        first, last = start[cut], start[cut + 1]
        overlap[:] = 0.0
        for f in range(first, last):
            real, imag = weight[f] * model[0, f], weight[f] * model[1, f]
            for d in range(delays):
                overlap[d] += real * table[f, 0, d] + imag * table[f, 1, d]
        best = np.argmax(overlap)
        # the grid is fine enough for a parabola through the best delay and its neighbours; the period closes it
        before, after = overlap[best - 1], overlap[(best + 1) % delays]
        bend = 2.0 * overlap[best] - before - after
        top = overlap[best] + (after - before) ** 2 / (8.0 * bend) if bend > 0.0 else overlap[best]
        size = 0.0
        for f in range(first, last):
            size += weight[f] * (measured[f] + model[0, f] ** 2 + model[1, f] ** 2)
        totals[group[cut]] += max(size - 2.0 * top, 0.0)
