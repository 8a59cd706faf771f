"""Zero-order limits of cuts whose mean stiffness is not proportional to the depth; arrays and scalars only.

With M(a) the mean stiffness at the depth a and v an eigenvalue of M(a) G(w), the boundary v (1 - e^{-i w tau}) = 1 is where 2 Re v = 1,
at w tau = pi + 2 arg v + 2 pi l. Eigenvalues stand in the order of their real parts, which change continuously with depth and frequency.
"""

from __future__ import annotations

import math

import numba
import numpy as np

#: Roots over the depth that are kept at each frequency and eigenvalue, steps to each of them, and depths that are passed at once.
_ROOTS, _STEPS, _STRIDE = 2, 30, 4
#: Largest change of the phase from one frequency to the next that is still the same eigenvalue's [rad].
_JUMP = 1.0


@numba.njit(cache=True)
def _cubic(matrix, values):
    """Write the eigenvalues of a 3 x 3 matrix: Cardano's roots of its characteristic polynomial."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    g, h, i = matrix[2, 0], matrix[2, 1], matrix[2, 2]
    third = (a + e + i) / 3.0
    a, e, i = a - third, e - third, i - third
    # of what is left the trace is zero: x^3 + p x - q = 0
    p = a * e + a * i + e * i - b * d - c * g - f * h
    q = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    root = np.sqrt(0.25 * q * q + p * p * p / 27.0)
    cube = 0.5 * q + root
    other = 0.5 * q - root
    if abs(other) > abs(cube):
        cube = other
    if abs(cube) == 0.0:
        values[0], values[1], values[2] = third, third, third
        return
    size, angle = abs(cube) ** (1.0 / 3.0), math.atan2(cube.imag, cube.real) / 3.0
    for k in range(3):
        turned = angle + 2.0 * math.pi * k / 3.0
        x = size * complex(math.cos(turned), math.sin(turned))
        values[k] = third + x - p / (3.0 * x)


@numba.njit(cache=True)
def _coefficients(matrix, polynomial, power, product):
    """Write the characteristic polynomial of a matrix, highest power first, by Faddeev and LeVerrier.

    Each coefficient is a sum of principal minors, so that directions may have units of their own.
    """
    r = matrix.shape[0]
    polynomial[0] = 1.0
    for a in range(r):
        for b in range(r):
            power[a, b] = matrix[a, b]
    for k in range(1, r + 1):
        trace = 0.0j
        for a in range(r):
            trace += power[a, a]
        polynomial[k] = -trace / k
        if k == r:
            return
        for a in range(r):
            power[a, a] += polynomial[k]
        for a in range(r):
            for b in range(r):
                value = 0.0j
                for c in range(r):
                    value += matrix[a, c] * power[c, b]
                product[a, b] = value
        for a in range(r):
            for b in range(r):
                power[a, b] = product[a, b]


@numba.njit(cache=True)
def _roots(polynomial, values):
    """Write the roots of a polynomial, all at once [ehrlich1967], from those that stand there; return whether they were found."""
    r = values.size
    for _ in range(_STEPS):
        largest, moved = 0.0, 0.0
        for i in range(r):
            x, value, slope = values[i], polynomial[0], 0.0j
            for k in range(1, r + 1):
                slope = slope * x + value
                value = value * x + polynomial[k]
            apart = 0.0j
            for j in range(r):
                if j != i:
                    distance = x - values[j]
                    if distance == 0.0:
                        return False
                    apart += 1.0 / distance
            divisor = slope - value * apart
            if divisor == 0.0:
                return False
            step = value / divisor
            values[i] = x - step
            largest, moved = max(largest, abs(values[i])), max(moved, abs(step))
        if not moved < np.inf:
            return False
        if moved <= 1e-13 * largest:
            return True
    return False


@numba.njit(cache=True)
def _many(matrix, values):
    """Write the eigenvalues of a matrix with more than three rows, by its polynomial; where roots meet, by LAPACK."""
    r = matrix.shape[0]
    polynomial, power, product = np.empty(r + 1, dtype=np.complex128), np.empty_like(matrix), np.empty_like(matrix)
    _coefficients(matrix, polynomial, power, product)
    if _roots(polynomial, values):
        return
    # on a circle that holds them all, and none of them on the real axis
    radius = 0.0
    for k in range(1, r + 1):
        radius = max(radius, abs(polynomial[k]) ** (1.0 / k))
    for k in range(r):
        angle = 2.0 * math.pi * (k + 0.3) / r
        values[k] = radius * complex(math.cos(angle), math.sin(angle))
    if not _roots(polynomial, values):
        found = np.linalg.eigvals(matrix)
        for k in range(found.size):
            values[k] = found[k]


@numba.njit(cache=True)
def eigenvalues(matrix, values):
    """Write the eigenvalues of a matrix, shape (r, r), in falling order of their real parts.

    Of more than three rows those that stand in `values` are where the search begins.
    """
    r = matrix.shape[0]
    if r == 2:
        half = 0.5 * (matrix[0, 0] + matrix[1, 1])
        root = np.sqrt(half * half - (matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]))
        values[0], values[1] = half + root, half - root
    elif r == 3:
        _cubic(matrix, values)
    else:
        _many(matrix, values)
    for k in range(1, r):
        value, place = values[k], k
        while place > 0 and values[place - 1].real < value.real:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value


@numba.njit(cache=True)
def _product(stiffness, tip, matrix):
    """Write stiffness tip."""
    r = tip.shape[0]
    for a in range(r):
        for b in range(r):
            value = 0.0j
            for c in range(r):
                value += stiffness[a, c] * tip[c, b]
            matrix[a, b] = value


@numba.njit(cache=True)
def _crossing(before, after, tip, k, below, above, scratch):
    """Return the share of a step between two stiffnesses at which 2 Re v = 1, and the eigenvalue v, the k-th, there."""
    matrix, between, tried = scratch
    r = tip.shape[0]
    low, high = 0.0, 1.0
    at_low, at_high = 2.0 * below.real - 1.0, 2.0 * above[k].real - 1.0
    share, value, side = 1.0, above[k], 0
    for _ in range(_STEPS):
        share = low - at_low * (high - low) / (at_high - at_low)
        for a in range(r):
            for b in range(r):
                between[a, b] = before[a, b] + share * (after[a, b] - before[a, b])
            tried[a] = above[a]
        _product(between, tip, matrix)
        eigenvalues(matrix, tried)
        value = tried[k]
        at = 2.0 * value.real - 1.0
        if abs(at) < 1e-9:
            break
        # regula falsi; an end that stays for a second time counts half
        if at * at_low > 0.0:
            low, at_low = share, at
            at_high *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            high, at_high = share, at
            at_low *= 0.5 if side == -1 else 1.0
            side = -1
    return share, value


@numba.njit(cache=True)
def boundaries(tips, depths, stiffness):
    """Return the depths at which 2 Re v = 1 and the phases pi + 2 arg v there, shapes (n, r, roots); not a number where there is none.

    Parameters
    ----------
    tips : complex array (n, r, r)
        Receptances, by frequency.
    depths : array (d,)
        Ascending.
    stiffness : array (d, r, r)
        Mean stiffness at each depth; on straight lines in between.
    """
    n, r, count = tips.shape[0], tips.shape[1], depths.size
    depth, phase = np.full((n, r, _ROOTS), np.nan), np.full((n, r, _ROOTS), np.nan)
    matrix, between = np.empty((r, r), dtype=np.complex128), np.empty((r, r))
    below, above, tried = np.zeros(r, dtype=np.complex128), np.zeros(r, dtype=np.complex128), np.zeros(r, dtype=np.complex128)
    found = np.empty(r, dtype=np.int64)
    for i in range(n):
        for k in range(r):
            below[k] = 0.0j
            found[k] = 0
        first = 0
        while first < count:
            # several steps at once; one by one where an eigenvalue has changed its side
            last = min(first + _STRIDE, count) - 1
            _product(stiffness[last], tips[i], matrix)
            eigenvalues(matrix, above)
            changed = False
            for k in range(r):
                changed = changed or (found[k] < _ROOTS and (2.0 * below[k].real - 1.0) * (2.0 * above[k].real - 1.0) < 0.0)
            if not changed:
                for k in range(r):
                    below[k] = above[k]
                first = last + 1
                continue
            for d in range(first, last + 1):
                _product(stiffness[d], tips[i], matrix)
                eigenvalues(matrix, above)
                before, start = stiffness[max(d - 1, 0)], depths[max(d - 1, 0)]
                if d == 0:
                    before, start = np.zeros_like(before), 0.0
                for k in range(r):
                    if found[k] < _ROOTS and (2.0 * below[k].real - 1.0) * (2.0 * above[k].real - 1.0) < 0.0:
                        share, value = _crossing(before, stiffness[d], tips[i], k, below[k], above, (matrix, between, tried))
                        depth[i, k, found[k]] = start + share * (depths[d] - start)
                        phase[i, k, found[k]] = math.pi + 2.0 * math.atan2(value.imag, value.real)
                        found[k] += 1
                for k in range(r):
                    below[k] = above[k]
            first = last + 1
    return depth, phase


@numba.njit(cache=True)
def lowest(omega, depth, phase, delays):
    """Return the lowest boundary at each delay [s], its frequency and its lobe; infinite, not a number and -1 where there is none.

    Parameters
    ----------
    omega : array (n,)
    depth, phase : arrays (n, r, roots)
        As `boundaries` returns them.
    delays : array (m,)
    """
    n, r, roots = depth.shape
    limit, place, lobe = np.full(delays.size, np.inf), np.full(delays.size, np.nan), np.full(delays.size, -1, dtype=np.int64)
    for m in range(delays.size):
        for i in range(n - 1):
            for k in range(r):
                for s in range(roots):
                    if not (depth[i, k, s] < np.inf and depth[i + 1, k, s] < np.inf):
                        continue
                    step = phase[i + 1, k, s] - phase[i, k, s]
                    if abs(step) > _JUMP:
                        continue
                    turns = (omega[i] * delays[m] - phase[i, k, s]) / (2.0 * math.pi)
                    after = (omega[i + 1] * delays[m] - phase[i + 1, k, s]) / (2.0 * math.pi)
                    whole = math.ceil(min(turns, after))
                    if whole > max(turns, after) or whole < 0:
                        continue
                    share = (whole - turns) / (after - turns) if after != turns else 0.0
                    value = depth[i, k, s] + share * (depth[i + 1, k, s] - depth[i, k, s])
                    if value < limit[m]:
                        limit[m], lobe[m] = value, whole
                        place[m] = omega[i] + share * (omega[i + 1] - omega[i])
    return limit, place, lobe


@numba.njit(cache=True)
def first_of_ladder(omega, tips, depths, stiffness, delays, spreads):
    """Return the first depth of a ladder at which a real eigenvalue of the loop with several delays is above 1, and its frequency.

    Parameters
    ----------
    omega, tips, depths, stiffness
        As in `boundaries`.
    delays, spreads : arrays (d, teeth)
        Of each tooth the mean delay up to each depth [s], and its change from the tip to there.
    """
    n, r = tips.shape[0], tips.shape[1]
    matrix, values, before = np.empty((r, r), dtype=np.complex128), np.zeros(r, dtype=np.complex128), np.empty(r, dtype=np.complex128)
    last, last_place = 0.0, 0.0
    for d in range(depths.size):
        best, place = 0.0, 0.0
        for i in range(n):
            w, factor = omega[i], 0.0j
            for j in range(delays.shape[1]):
                half = 0.5 * w * spreads[d, j]
                smear = math.sin(half) / half if abs(half) > 1e-6 else 1.0
                factor += 1.0 - smear * complex(math.cos(w * delays[d, j]), -math.sin(w * delays[d, j]))
            _product(stiffness[d], tips[i], matrix)
            eigenvalues(matrix, values)
            for k in range(r):
                values[k] *= factor / delays.shape[1]
            for k in range(r):
                if i == 0:
                    break
                # the loop's eigenvalue passes the real axis between the frequencies
                if values[k].imag * before[k].imag < 0.0:
                    share = before[k].imag / (before[k].imag - values[k].imag)
                    real = before[k].real + share * (values[k].real - before[k].real)
                    if real > best:
                        best, place = real, omega[i - 1] + share * (w - omega[i - 1])
            for k in range(r):
                before[k] = values[k]
        if best >= 1.0:
            share = (1.0 - last) / (best - last)
            start = depths[d - 1] if d > 0 else 0.0
            return start + share * (depths[d] - start), place if last_place == 0.0 else last_place + share * (place - last_place)
        last, last_place = best, place
    return np.inf, np.nan
