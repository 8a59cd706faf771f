"""Zero-order lobes from the trace and determinant of [alpha0] G over frequency; arrays and scalars only.

With mu an eigenvalue of [alpha0] G, the stability boundary a K mu (1 - e^{-i w tau}) = 1 is the curve
a = 1 / (2 K Re mu), w tau = 2 psi + 2 pi l, psi = pi / 2 + arg mu, for Re mu > 0 and every whole l >= 0.
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def node_weights(omega):
    """Return barycentric weights of the nodes around each interval, shape (n - 1, 6): omega[k - 2] to omega[k + 3], fewer at the ends."""
    n = omega.size
    weights = np.zeros((n - 1, 6))
    for k in range(n - 1):
        first, last = max(k - 2, 0), min(k + 3, n - 1)
        # in intervals, so that no product leaves the range of numbers
        scale = 1.0 / (omega[k + 1] - omega[k])
        for i in range(first, last + 1):
            below = 1.0
            for j in range(first, last + 1):
                if j != i:
                    below *= (omega[i] - omega[j]) * scale
            weights[k, i - k + 2] = 1.0 / below
    return weights


@numba.njit(cache=True)
def between_nodes(omega, trace, determinant, weights, k, w):
    """Return trace and determinant at w in [omega[k], omega[k+1]], on the quintic through six nodes (fewer at the ends)."""
    total = 0.0
    t_real, t_imag, d_real, d_imag = 0.0, 0.0, 0.0, 0.0
    for i in range(max(k - 2, 0), min(k + 4, omega.size)):
        gap = w - omega[i]
        if gap == 0.0:
            return trace[i], determinant[i]
        share = weights[k, i - k + 2] / gap
        total += share
        # by parts: a product with a complex number would make the share complex first
        t_real += share * trace[i].real
        t_imag += share * trace[i].imag
        d_real += share * determinant[i].real
        d_imag += share * determinant[i].imag
    return complex(t_real / total, t_imag / total), complex(d_real / total, d_imag / total)


@numba.njit(cache=True)
def nearest_root(trace, determinant, guess):
    """Return the square root of the characteristic polynomial's discriminant / 4 on the side of `guess`."""
    root = np.sqrt(0.25 * trace * trace - determinant)
    if root.real * guess.real + root.imag * guess.imag < 0.0:
        root = -root
    return root


@numba.njit(cache=True)
def eigenvalue_at(omega, trace, determinant, weights, root, sign, k, w):
    """Return the eigenvalue on one branch at w in [omega[k], omega[k+1]]; root[k], root[k+1] tell the branch."""
    x = (w - omega[k]) / (omega[k + 1] - omega[k])
    t, d = between_nodes(omega, trace, determinant, weights, k, w)
    return 0.5 * t + sign * nearest_root(t, d, (1.0 - x) * root[k] + x * root[k + 1])


@numba.njit(cache=True)
def roots_along(trace, determinant):
    """Return the discriminant's root at each node, its sign continued from node to node, shape (n,)."""
    root = np.empty(trace.size, dtype=np.complex128)
    guess = 1.0 + 0.0j
    for k in range(trace.size):
        root[k] = nearest_root(trace[k], determinant[k], guess)
        if root[k] != 0.0:
            guess = root[k]
    return root


@numba.njit(cache=True)
def largest_real_part(omega, trace, determinant):
    """Return the largest Re mu over both branches and all frequencies, and its frequency."""
    root, weights = roots_along(trace, determinant), node_weights(omega)
    best, place = -np.inf, omega[0]
    for sign in (1.0, -1.0):
        peak = 0
        for k in range(omega.size):
            if (0.5 * trace[k] + sign * root[k]).real > (0.5 * trace[peak] + sign * root[peak]).real:
                peak = k
        top = (0.5 * trace[peak] + sign * root[peak]).real
        where = omega[peak]
        for k in range(max(peak - 1, 0), min(peak + 1, omega.size - 1)):
            low, high = omega[k], omega[k + 1]
            for _ in range(40):
                third = (high - low) / 3.0
                left = eigenvalue_at(omega, trace, determinant, weights, root, sign, k, low + third).real
                right = eigenvalue_at(omega, trace, determinant, weights, root, sign, k, high - third).real
                if left < right:
                    low += third
                else:
                    high -= third
                if max(left, right) > top:
                    top, where = max(left, right), 0.5 * (low + high)
        if top > best:
            best, place = top, where
    return best, place


@numba.njit(cache=True)
def phase_steps(trace, root, sign):
    """Return mu, and psi at both ends of each interval, continuous within it (NaN where Re mu > 0 at neither end)."""
    n = trace.size
    mu = np.empty(n, dtype=np.complex128)
    start = np.full(n - 1, np.nan)
    end = np.full(n - 1, np.nan)
    for k in range(n):
        mu[k] = 0.5 * trace[k] + sign * root[k]
        # where one direction is rigid an eigenvalue is zero up to rounding
        if abs(mu[k]) < 1e-12 * abs(trace[k]):
            mu[k] = 0.0
    # a node with a positive real part ends one interval and starts the next at the same angle
    for k in range(n):
        if mu[k].real > 0.0:
            angle = math.atan2(mu[k].real, -mu[k].imag)
            if k > 0:
                end[k - 1] = angle
            if k < n - 1:
                start[k] = angle
    for k in range(n - 1):
        if (mu[k].real > 0.0) != (mu[k + 1].real > 0.0):
            step = mu[k + 1] * mu[k].conjugate()
            turn = math.atan2(step.imag, step.real)
            if mu[k].real > 0.0:
                end[k] = start[k] + turn
            else:
                start[k] = end[k] - turn
    return mu, start, end


@numba.njit(cache=True)
def envelope(omega, trace, determinant, stiffness, teeth, speeds):
    """Return limit depth, chatter frequency and lobe number at each speed: the lowest of all lobes of both branches.

    Parameters
    ----------
    omega : array, shape (n,) [rad/s], ascending, above 0
    trace, determinant : complex arrays, shape (n,), of [alpha0] G
    stiffness : float [N/m^2], K_tc
    teeth : int
    speeds : array, shape (m,) [rad/s], ascending, above 0
    """
    return lowest_lobes(omega, trace, determinant, node_weights(omega), stiffness, teeth, speeds)


@numba.njit(cache=True)
def envelopes(omega, x, y, alpha, stiffness, teeth, speeds):
    """Return the limit depths of many tips without cross receptances, shape (d, m), NaN where a tip is not finite.

    Parameters
    ----------
    x, y : complex arrays, shape (d, n)
        The tips' direct receptances.
    alpha : array, shape (d, 2, 2)
        [alpha0] of each.
    """
    weights = node_weights(omega)
    limits = np.full((x.shape[0], speeds.size), np.nan)
    trace, determinant = np.empty(omega.size, dtype=np.complex128), np.empty(omega.size, dtype=np.complex128)
    for i in range(x.shape[0]):
        along, across = alpha[i, 0, 0], alpha[i, 1, 1]
        turned = along * across - alpha[i, 0, 1] * alpha[i, 1, 0]
        size = 0.0
        for k in range(omega.size):
            trace[k] = along * x[i, k] + across * y[i, k]
            determinant[k] = turned * (x[i, k] * y[i, k])
            size += abs(trace[k].real) + abs(trace[k].imag) + abs(determinant[k].real) + abs(determinant[k].imag)
        if math.isfinite(size):
            limit = lowest_lobes(omega, trace, determinant, weights, stiffness, teeth, speeds)[0]
            for s in range(speeds.size):
                limits[i, s] = limit[s]
    return limits


@numba.njit(cache=True)
def lowest_lobes(omega, trace, determinant, weights, stiffness, teeth, speeds):
    """Return what `envelope` does; the nodes' weights are those of `node_weights`."""
    m = speeds.size
    limit = np.full(m, np.inf)
    chatter = np.full(m, np.nan)
    lobes = np.full(m, -1, dtype=np.int64)
    root = roots_along(trace, determinant)
    n = omega.size
    kept = np.empty(n - 1, dtype=np.int64)
    last_lobe = int(omega[n - 1] / (teeth * speeds[0])) + 1
    for sign in (1.0, -1.0):
        mu, start, end = phase_steps(trace, root, sign)
        # in scalars, as are all loops here: each array operation adds a second to what compiling takes
        count, least, most = 0, np.inf, -np.inf
        for k in range(n - 1):
            if not math.isnan(start[k]):
                kept[count] = k
                count += 1
                least, most = min(least, start[k], end[k]), max(most, start[k], end[k])
        if count == 0:
            continue
        lowest, highest = least / math.pi, most / math.pi
        for lobe in range(last_lobe + 1):
            j = 0
            # w = teeth speed (lobe + psi / pi) bounds the intervals that can lie in the range of speeds
            for p in range(first_ending_at(omega, kept, count, teeth * speeds[0] * (lobe + lowest)), count):
                k = kept[p]
                if omega[k] > teeth * speeds[m - 1] * (lobe + highest):
                    break
                # the speeds between the interval's ends: w tau / 2 = psi + pi l, tau = 2 pi / (teeth speed)
                first, second = start[k] + math.pi * lobe, end[k] + math.pi * lobe
                a = math.pi * omega[k] / (teeth * first) if first > 0.0 else np.inf
                b = math.pi * omega[k + 1] / (teeth * second) if second > 0.0 else np.inf
                low, high = min(a, b), max(a, b)
                if high < speeds[0] or low > speeds[m - 1]:
                    continue
                while j > 0 and speeds[j - 1] >= low:
                    j -= 1
                while j < m and speeds[j] < low:
                    j += 1
                # a peak of Re mu between the nodes may stand above them
                floor = 0.9 / (2.0 * stiffness * max(mu[k].real, mu[k + 1].real))
                i = j
                while i < m and speeds[i] <= high:
                    if floor < limit[i]:
                        half_delay = math.pi / (teeth * speeds[i])
                        f_low, f_high = first - omega[k] * half_delay, second - omega[k + 1] * half_delay
                        w, real = crossing(omega, trace, determinant, weights, root, sign, k, f_low, f_high, half_delay)
                        if real > 0.0 and 1.0 / (2.0 * stiffness * real) < limit[i]:
                            limit[i] = 1.0 / (2.0 * stiffness * real)
                            chatter[i] = w
                            lobes[i] = lobe
                    i += 1
    return limit, chatter, lobes


@numba.njit(cache=True)
def first_ending_at(omega, kept, count, value):
    """Return the place of the first of the ascending intervals `kept` that ends at `value` or above it; `count` where none does."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if omega[kept[middle] + 1] < value:
            low = middle + 1
        else:
            high = middle
    return low


@numba.njit(cache=True)
def crossing(omega, trace, determinant, weights, root, sign, k, f_low, f_high, half_delay):
    """Return the w in interval k where f = psi + pi l - w tau / 2 is zero, and Re mu there; f_low, f_high stand at the interval's ends.

    Re mu is NaN where f has no zero but a jump: both eigenvalues come so close between two nodes that they change places.
    """
    first = 0.5 * trace[k] + sign * root[k]
    a, fa, b, fb = omega[k], f_low, omega[k + 1], f_high
    if fa * fb > 0.0 or fa == fb:
        # up to rounding it lies at one of the ends
        return (a, first.real) if abs(fa) < abs(fb) else (b, (0.5 * trace[k + 1] + sign * root[k + 1]).real)
    at, f, real = a, fa, first.real
    w = (fa * b - fb * a) / (fa - fb)
    for step in range(40):
        at_before, f_before, real_before = at, f, real
        at = w
        mu = eigenvalue_at(omega, trace, determinant, weights, root, sign, k, at)
        real = mu.real
        turn = mu * first.conjugate()
        f = f_low + math.atan2(turn.imag, turn.real) - (at - omega[k]) * half_delay
        if abs(f) < 1e-8 and f != f_before:
            # the rest along the chord, beside which the error is as small as the product of both values of f
            share = f / (f - f_before)
            return at - share * (at - at_before), real - share * (real - real_before)
        # the inverse parabola through three points, or the middle where it leaves the two between which f changes sign
        guess = np.nan
        if fa != f and fb != f:
            guess = a * fb * f / ((fa - fb) * (fa - f)) + b * fa * f / ((fb - fa) * (fb - f)) + at * fa * fb / ((f - fa) * (f - fb))
        if f * fb > 0.0:
            b, fb = at, f
        else:
            a, fa = at, f
        w = guess if a < guess < b and step < 8 else 0.5 * (a + b)
    return at, np.nan


@numba.njit(cache=True)
def delay_factor(pitch, speed, w):
    """Return the mean over the teeth of 1 - e^{-i w pitch / speed}."""
    total = 0.0 + 0.0j
    for p in pitch:
        angle = w * p / speed
        total += complex(1.0 - math.cos(angle), math.sin(angle))
    return total / pitch.size


@numba.njit(cache=True)
def pitch_envelope(omega, trace, determinant, stiffness, pitch, speeds):
    """Return what `envelope` does for any pitch, by a walk along the frequencies at each speed.

    Both factors of a K mu W = 1, W the mean of 1 - e^{-i w tau_j}, are followed; Im(mu W) changes sign on the boundary. Where it comes
    nearest to zero it may do so twice within one step.
    The lobe number is the whole waves in the mean delay.
    """
    m = speeds.size
    limit = np.full(m, np.inf)
    chatter = np.full(m, np.nan)
    lobes = np.full(m, -1, dtype=np.int64)
    root, weights = roots_along(trace, determinant), node_weights(omega)
    longest = pitch.max()
    # places around which a sign changes: interval, its two ends, Im at the first
    found = np.empty((2, 4))
    for i in range(m):
        for sign in (1.0, -1.0):
            a, z, interval = omega[0], omega[0], 0
            fa = delay_factor(pitch, speeds[i], a) * (0.5 * trace[0] + sign * root[0])
            fz = fa
            for k in range(omega.size - 1):
                apart = omega[k + 1] - omega[k]
                parts = 1 + int(apart * longest / speeds[i] / 0.3)
                for part in range(parts):
                    b = omega[k] + apart * (part + 1) / parts
                    if parts == 1:
                        fb = delay_factor(pitch, speeds[i], b) * (0.5 * trace[k + 1] + sign * root[k + 1])
                    else:
                        fb = delay_factor(pitch, speeds[i], b) * eigenvalue_at(omega, trace, determinant, weights, root, sign, k, b)
                    highest, changes = max(fa.real, fb.real, fz.real), 0
                    if highest > 0.0 and 0.9 / (stiffness * highest) < limit[i]:
                        if fa.imag * fb.imag <= 0.0:
                            found[0, 0], found[0, 1], found[0, 2], found[0, 3] = k, a, b, fa.imag
                            changes = 1
                        elif fz.imag * fa.imag > 0.0 and abs(fa.imag) < abs(fz.imag) and abs(fa.imag) <= abs(fb.imag):
                            # next to zero there, and perhaps beyond it: at the vertex of the parabola through all three
                            to_z, to_b = (a - z) * (fa.imag - fb.imag), (a - b) * (fa.imag - fz.imag)
                            v = a - 0.5 * ((a - z) * to_z - (a - b) * to_b) / (to_z - to_b)
                            within = k if v > a else interval
                            fv = delay_factor(pitch, speeds[i], v) * eigenvalue_at(
                                omega, trace, determinant, weights, root, sign, within, v
                            )
                            if fv.imag * fa.imag < 0.0:
                                found[:, 0] = within
                                found[0, 1], found[0, 2], found[0, 3] = z if v < a else a, v, fa.imag
                                found[1, 1], found[1, 2], found[1, 3] = v, a if v < a else b, fv.imag
                                changes = 2
                    for each in range(changes):
                        within, low, high, from_low = int(found[each, 0]), found[each, 1], found[each, 2], found[each, 3]
                        w, f = low, fa
                        for _ in range(50):
                            w = 0.5 * (low + high)
                            f = delay_factor(pitch, speeds[i], w) * eigenvalue_at(omega, trace, determinant, weights, root, sign, within, w)
                            if f.imag * from_low > 0.0:
                                low = w
                            else:
                                high = w
                        if f.real > 0.0 and 1.0 / (stiffness * f.real) < limit[i]:
                            limit[i] = 1.0 / (stiffness * f.real)
                            chatter[i] = w
                            lobes[i] = int(w / speeds[i] / pitch.size)
                    z, fz, interval, a, fa = a, fa, k, b, fb
    return limit, chatter, lobes


@numba.njit(cache=True)
def receptance_at(omega, values, w):
    """Return the entries of a receptance at any frequencies, shape (m, q), from those at `omega`, shape (n, q).

    Quintics through six nodes between the nodes; below the lowest the real part as it is there and the imaginary part in
    proportion to the frequency; zero above the highest; the conjugate at negative frequencies.
    """
    n, q = values.shape
    result = np.zeros((w.size, q), dtype=np.complex128)
    weight = np.empty(6)
    for i in range(w.size):
        place = abs(w[i])
        if place > omega[n - 1]:
            continue
        if place < omega[0]:
            for j in range(q):
                result[i, j] = complex(values[0, j].real, values[0, j].imag * place / omega[0])
        else:
            k = min(np.searchsorted(omega, place), n - 1)
            first = max(min(k - 3, n - 6), 0)
            last = min(first + 5, n - 1)
            for a in range(first, last + 1):
                above, below = 1.0, 1.0
                for b in range(first, last + 1):
                    if b != a:
                        above *= place - omega[b]
                        below *= omega[a] - omega[b]
                weight[a - first] = above / below
            for j in range(q):
                for a in range(first, last + 1):
                    result[i, j] += weight[a - first] * values[a, j]
        if w[i] < 0.0:
            for j in range(q):
                result[i, j] = result[i, j].conjugate()
    return result
