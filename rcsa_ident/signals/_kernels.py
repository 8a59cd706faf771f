"""Fourier sums at multiples of one frequency, runs of equal samples; arrays and scalars only."""

from __future__ import annotations

import math

import numba
import numpy as np

#: Samples whose rotations are kept at once.
_CHUNK = 128


@numba.njit(cache=True)
def order_sums(samples, step, highest):
    """Return sum_t samples[t] e^{-i m step t'} for m = 0..highest, t' from the middle of the samples.

    Shapes: samples (n, c) -> (highest + 1, c).
    """
    n, channels = samples.shape
    real = np.zeros((channels, highest + 1))
    imaginary = np.zeros((channels, highest + 1))
    cosine = np.ones(highest + 1)
    sine = np.zeros(highest + 1)
    middle = 0.5 * (n - 1)
    for t in range(n):
        first, second = math.cos(step * (t - middle)), math.sin(step * (t - middle))
        for m in range(1, min(4, highest) + 1):
            cosine[m] = cosine[m - 1] * first - sine[m - 1] * second
            sine[m] = cosine[m - 1] * second + sine[m - 1] * first
        # four powers at a time, so that they do not wait for each other
        for m in range(5, highest + 1):
            cosine[m] = cosine[m - 4] * cosine[4] - sine[m - 4] * sine[4]
            sine[m] = cosine[m - 4] * sine[4] + sine[m - 4] * cosine[4]
        for c in range(channels):
            x = samples[t, c]
            for m in range(highest + 1):
                real[c, m] += x * cosine[m]
            for m in range(highest + 1):
                imaginary[c, m] -= x * sine[m]
    sums = np.empty((highest + 1, channels), dtype=np.complex128)
    for m in range(highest + 1):
        for c in range(channels):
            sums[m, c] = complex(real[c, m], imaginary[c, m])
    return sums


@numba.njit(cache=True, inline="always")
def turn_on(power, quadrature, cosine, sine):
    """Turn powers of an angle's cosine and sine on to the next order, in place."""
    for t in range(power.size):
        further = power[t] * cosine[t] - quadrature[t] * sine[t]
        quadrature[t] = power[t] * sine[t] + quadrature[t] * cosine[t]
        power[t] = further


@numba.njit(cache=True)
def order_signal(amplitude, step, n):
    """Return Re sum_m amplitude[m] e^{i m step t'} with t' from the middle of n samples, shape (m + 1, c) -> (n, c)."""
    orders, channels = amplitude.shape
    values = np.zeros((channels, n))
    middle = 0.5 * (n - 1)
    for start in range(0, n, _CHUNK):
        size = min(_CHUNK, n - start)
        cosine, sine = np.empty(size), np.empty(size)
        for t in range(size):
            cosine[t] = math.cos(step * (start + t - middle))
            sine[t] = math.sin(step * (start + t - middle))
        power, quadrature = np.ones(size), np.zeros(size)
        for m in range(orders):
            for c in range(channels):
                a, b = amplitude[m, c].real, amplitude[m, c].imag
                out = values[c, start : start + size]
                for t in range(size):
                    out[t] += a * power[t] - b * quadrature[t]
            turn_on(power, quadrature, cosine, sine)
    return values.T.copy()


@numba.njit(cache=True)
def follow_runs(x, at, values, counts, lengths, levels, front):
    """Go on through a channel's samples, shape (n,), the first of which has the index `at`; the state begins with `NEW_VALUES` and zeros.

    State: values (low, next to it, high, next to it, the run's value, least jump, first); counts (lost, first lost, start and length of
    the run that goes on, samples at each of the four levels, runs and samples in runs of three at low and at high, distinct levels, longest
    run that has ended); lengths[k] runs of k samples, the last entry those that are longer; levels, the first distinct ones; front,
    shape (k, 3), (start, length, jump behind it) of long runs none of which is both shorter than an earlier one and followed by less.
    """
    last, length = values[4], counts[3]
    for t in range(x.size):
        value = x[t]
        if value == last:
            length += 1
            continue
        if not math.isfinite(value):
            if counts[0] == 0:
                counts[1] = at + t
            counts[0] += 1
            continue
        if length == 0:
            values[6] = value
        elif length == 1 and values[1] < last < values[3] and counts[12] == levels.size:
            # what nearly every sample of a fine signal is: a run of its own between the extremes
            lengths[1] += 1
            values[5] = min(values[5], abs(value - last))
            counts[13] = max(counts[13], 1)
        else:
            values[4], counts[3] = last, length
            end_run(abs(value - last), values, counts, lengths, levels, front)
        last, length, counts[2] = value, 1, at + t
    values[4], counts[3] = last, length


@numba.njit(cache=True)
def end_run(jump, values, counts, lengths, levels, front):
    """Count the run that goes on; `jump` is to the value behind it, below 0 where the record ends."""
    value, start, length = values[4], counts[2], counts[3]
    lengths[min(length, lengths.size - 1)] += 1
    _level(value, length, 1.0, values[0:2], counts[4:6], counts[8:10])
    _level(value, length, -1.0, values[2:4], counts[6:8], counts[10:12])
    known = False
    for k in range(counts[12]):
        known = known or levels[k] == value
    if not known and counts[12] < levels.size:
        levels[counts[12]] = value
        counts[12] += 1
    if jump < 0.0:
        return
    values[5] = min(values[5], jump)
    counts[13] = max(counts[13], length)
    if length < front[0, 1]:
        return
    place = 1
    while place < front.shape[0] and front[place, 1] > 0.0:
        if front[place, 1] >= length and front[place, 2] >= jump:
            return
        place += 1
    if place < front.shape[0]:
        front[place, 0], front[place, 1], front[place, 2] = start, length, jump


@numba.njit(cache=True)
def _level(value, length, sign, extremes, samples, runs):
    """Keep the lowest (sign 1) or highest (-1) value, the one next to it, how often they come, and runs of three at the extreme."""
    if sign * value < sign * extremes[0]:
        extremes[1], samples[1] = extremes[0], samples[0]
        extremes[0], samples[0] = value, 0
        runs[:] = 0
    if value == extremes[0]:
        samples[0] += length
        if length >= 3:
            runs[0] += 1
            runs[1] += length
    elif value == extremes[1]:
        samples[1] += length
    elif sign * value < sign * extremes[1]:
        extremes[1], samples[1] = value, length


@numba.njit(cache=True)
def turned(angle):
    """Return cosine and sine of an angle, shape (n,) -> (2, n): every order's are powers of them."""
    turn = np.empty((2, angle.size))
    for t in range(angle.size):
        turn[0, t], turn[1, t] = math.cos(angle[t]), math.sin(angle[t])
    return turn


@numba.njit(cache=True, fastmath={"reassoc", "contract"})
def angle_sums(samples, turn, starts, window, highest):
    """Return sum_t window[t] samples[s + t] e^{-i m angle[s + t]} of blocks that begin at `starts`, for m = 0..highest.

    Shapes: samples (n, c), `turned` angle (2, n), starts (b,), window (l,) -> (b, highest + 1, c).
    """
    blocks, length, channels = starts.size, window.size, samples.shape[1]
    sums = np.zeros((blocks, highest + 1, channels), dtype=np.complex128)
    size = min(_CHUNK, length)
    weighted = np.empty((channels, size))
    for b in range(blocks):
        for start in range(0, length, size):
            count, place = min(size, length - start), starts[b] + start
            cosine, sine = turn[0, place : place + count], turn[1, place : place + count]
            power, quadrature = np.ones(count), np.zeros(count)
            for t in range(count):
                for c in range(channels):
                    weighted[c, t] = window[start + t] * samples[place + t, c]
            for m in range(highest + 1):
                for c in range(channels):
                    row, real, imaginary = weighted[c], 0.0, 0.0
                    for t in range(count):
                        real += row[t] * power[t]
                        imaginary -= row[t] * quadrature[t]
                    sums[b, m, c] += complex(real, imaginary)
                turn_on(power, quadrature, cosine, sine)
    return sums


@numba.njit(cache=True, fastmath={"reassoc", "contract"})
def told_angles(lines, order, phase, reach):
    """Return what lines tell of an angle beyond `phase`, weighted by its information, and that [1/rad^2].

    Shapes: lines (k, b), order (k,), phase (b,) -> (b,), (b,).
    Each row holds one order's lines in blocks that follow each other; orders do not fall from row to row. A line's mean is that of the
    `reach` blocks to both sides of it, of all where the reach is longer than half of them; its variance is what lines differ from theirs.
    """
    rows, blocks = lines.shape
    everywhere = reach > 0.5 * blocks
    wide = 0 if everywhere else max(round(reach), 1)
    cosine, sine, power, quadrature = np.cos(phase), -np.sin(phase), np.ones(blocks), np.zeros(blocks)
    told, information = np.zeros(blocks), np.full(blocks, 1e-300)
    own, mean, total = np.empty((2, blocks)), np.empty((2, blocks)), np.zeros((2, blocks + 1))
    first, last, share = np.empty(blocks, np.int64), np.empty(blocks, np.int64), np.empty(blocks)
    for b in range(blocks):
        first[b], last[b] = (0, blocks) if everywhere else (max(b - wide, 0), min(b + wide + 1, blocks))
        share[b] = 1.0 / (last[b] - first[b])
    for k in range(rows):
        for _ in range(order[k] - (order[k - 1] if k else 0)):
            turn_on(power, quadrature, cosine, sine)
        for b in range(blocks):
            at = lines[k, b]
            own[0, b] = at.real * power[b] - at.imag * quadrature[b]
            own[1, b] = at.real * quadrature[b] + at.imag * power[b]
        for b in range(blocks):
            total[0, b + 1] = total[0, b] + own[0, b]
            total[1, b + 1] = total[1, b] + own[1, b]
        square = 0.0
        for b in range(blocks):
            mean[0, b] = (total[0, last[b]] - total[0, first[b]]) * share[b]
            mean[1, b] = (total[1, last[b]] - total[1, first[b]]) * share[b]
            square += (own[0, b] - mean[0, b]) ** 2 + (own[1, b] - mean[1, b]) ** 2
        weight = order[k] / (0.5 * square / blocks + 1e-300)
        for b in range(blocks):
            told[b] += weight * (mean[0, b] * own[1, b] - mean[1, b] * own[0, b])
            information[b] += weight * order[k] * (mean[0, b] ** 2 + mean[1, b] ** 2)
    return told, information


@numba.njit(cache=True)
def walked(values, information, price):
    """Return y, where sum(information (values - y)^2) + price sum(second differences of y)^2 is least, and the logarithm of that fit's
    likelihood, the values' own factor left out; not a number where rounding leaves nothing to solve.

    Shapes: values (n,), information (n,) -> (n,), (); n is 3 or more.
    """
    n = values.size
    # Cholesky's factor of five diagonals, its inverse first diagonal
    inverse, first, second, y = np.empty(n), np.zeros(n), np.zeros(n), np.empty(n)
    logarithms = 0.0
    for t in range(n):
        own = (t < n - 2) + 4.0 * (0 < t < n - 1) + (t > 1)
        pivot, right = price * own + information[t], information[t] * values[t]
        if t > 1:
            second[t] = price * inverse[t - 2]
            pivot -= second[t] * second[t]
            right -= second[t] * y[t - 2]
        if t > 0:
            beside = -2.0 * ((t < n - 1) + (t > 1))
            first[t] = (price * beside - second[t] * first[t - 1]) * inverse[t - 1]
            pivot -= first[t] * first[t]
            right -= first[t] * y[t - 1]
        pivot = math.sqrt(pivot) if pivot > 0.0 else math.nan
        inverse[t] = 1.0 / pivot
        logarithms += math.log(pivot)
        y[t] = right * inverse[t]
    for t in range(n - 1, -1, -1):
        if t < n - 1:
            y[t] -= first[t + 1] * y[t + 1]
        if t < n - 2:
            y[t] -= second[t + 2] * y[t + 2]
        y[t] *= inverse[t]
    cost = 0.0
    for t in range(n):
        off, bend = values[t] - y[t], y[t] - 2.0 * y[t - 1] + y[t - 2] if t > 1 else 0.0
        cost += information[t] * off * off + price * bend * bend
    return y, 0.5 * (n - 2) * math.log(price) - logarithms - 0.5 * cost


@numba.njit(cache=True, fastmath={"reassoc", "contract"})
def angle_signal(amplitude, turn, length):
    """Return Re sum_m amplitude[w, m] e^{i m angle[t]} over windows of `length` samples that follow each other.

    Shapes: amplitude (w, m + 1, c), `turned` angle (2, n) -> (w length, c).
    """
    windows, orders, channels = amplitude.shape
    values = np.zeros((windows * length, channels))
    size = min(_CHUNK, length)
    out = np.empty((channels, size))
    for w in range(windows):
        for start in range(w * length, (w + 1) * length, size):
            count = min(size, (w + 1) * length - start)
            cosine, sine = turn[0, start : start + count], turn[1, start : start + count]
            power, quadrature = np.ones(count), np.zeros(count)
            out[:] = 0.0
            for m in range(orders):
                for c in range(channels):
                    a, b = amplitude[w, m, c].real, amplitude[w, m, c].imag
                    for t in range(count):
                        out[c, t] += a * power[t] - b * quadrature[t]
                turn_on(power, quadrature, cosine, sine)
            for c in range(channels):
                for t in range(count):
                    values[start + t, c] = out[c, t]
    return values


@numba.njit(cache=True)
def comb_scores(gain, place, most, folded):
    """Return what lines at the multiples of each trial frequency gain together, as far up as they gain, shapes (w, b), (f,) -> (w, f).

    `gain` is what a line in a bin is worth, of bins from 0 to half the sampling rate; `place` the trial frequencies in bins. At most
    `most` multiples count; those above half the rate only where they are looked for folded back, and each bin once.
    """
    windows, bins = gain.shape
    scores = np.zeros((windows, place.size))
    used = np.empty(most)
    for f in range(place.size):
        for w in range(windows):
            total, count = 0.0, 0
            for m in range(1, most + 1):
                at = m * place[f]
                if at > bins - 2:
                    if not folded:
                        break
                    at = at % (2.0 * (bins - 1))
                    if at > bins - 1:
                        at = 2.0 * (bins - 1) - at
                if at < 2.0 or at > bins - 3:
                    continue
                if folded:
                    known = False
                    for k in range(count):
                        known = known or abs(used[k] - at) < 8.0
                    if known:
                        continue
                    used[count] = at
                    count += 1
                low = int(at)
                share = at - low
                total += (1.0 - share) * gain[w, low] + share * gain[w, low + 1]
                scores[w, f] = max(scores[w, f], total)
    return scores


@numba.njit(cache=True)
def sideband_scores(gain, place, centre, most, worth):
    """Return what lines to both sides of a bin gain together, as far as they gain, shapes (b,), (f,) -> (f,).

    Their spacing is 1, 2, ... times each trial frequency, of which the best one counts; `worth`, shape (t,), is what each is multiplied by.
    """
    scores = np.zeros(place.size)
    for f in range(place.size):
        for times in range(1, worth.size + 1):
            both = 0.0
            for sign in (-1.0, 1.0):
                total, best = 0.0, 0.0
                for k in range(1, most + 1):
                    at = centre + sign * k * times * place[f]
                    if at < 2.0 or at > gain.size - 3:
                        break
                    low = int(at)
                    share = at - low
                    total += (1.0 - share) * gain[low] + share * gain[low + 1]
                    best = max(best, total)
                both += best
            scores[f] = max(scores[f], worth[times - 1] * both)
    return scores


@numba.njit(cache=True)
def best_path(scores, reach, price):
    """Return the path over the windows with the largest sum of scores less `price` times the squares of its steps, and all ends' sums.

    Shapes: scores (w, f) -> (w,), (f,). A step is at most `reach` places.
    """
    windows, places = scores.shape
    total = scores[0].copy()
    back = np.zeros((windows, places), dtype=np.int32)
    for w in range(1, windows):
        new = np.empty(places)
        for f in range(places):
            best, came = -np.inf, f
            for g in range(max(f - reach, 0), min(f + reach, places - 1) + 1):
                value = total[g] - price * (g - f) ** 2
                if value > best:
                    best, came = value, g
            new[f], back[w, f] = best + scores[w, f], came
        total = new
    path = np.empty(windows, dtype=np.int64)
    path[-1] = np.argmax(total)
    for w in range(windows - 1, 0, -1):
        path[w - 1] = back[w, path[w]]
    return path, total
