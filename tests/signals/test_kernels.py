"""The Fourier kernels against plain matrices; these tests run again without the compiler."""

import numba
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from rcsa_ident.signals import _kernels


def compiled_and_plain(name):
    kernel = getattr(_kernels, name)
    return [kernel, getattr(kernel, "py_func", kernel)]


def basis(highest, step, n):
    return np.exp(1j * np.outer(np.arange(n) - 0.5 * (n - 1), step * np.arange(highest + 1)))


@pytest.mark.parametrize("highest", [0, 1, 3, 4, 5, 17])
@pytest.mark.parametrize("kernel", compiled_and_plain("order_sums"))
def test_order_sums(kernel, highest):
    samples = np.random.default_rng(1).normal(size=(311, 3))
    found = kernel(samples, 0.031, highest)
    np.testing.assert_allclose(found, basis(highest, 0.031, 311).conj().T @ samples, atol=1e-11)


@pytest.mark.parametrize("reach", [0.2, 3.0, 17.4, np.inf])
@pytest.mark.parametrize("kernel", compiled_and_plain("told_angles"))
def test_told_angles(kernel, reach):
    rng = np.random.default_rng(4)
    order, blocks = np.array([1, 1, 3, 7, 7]), 40
    phase = 0.1 * rng.standard_normal(blocks)
    lines = rng.standard_normal((5, 1)) * np.exp(1j * order[:, None] * phase) + 0.1 * rng.standard_normal((5, blocks))
    told, information = kernel(lines, order, phase, reach)
    turned = lines * np.exp(-1j * order[:, None] * phase)
    near = np.abs(np.subtract.outer(np.arange(blocks), np.arange(blocks))) <= max(round(min(reach, blocks)), 1)
    near |= reach > 0.5 * blocks
    mean = turned @ near / near.sum(axis=0)
    noise = 0.5 * np.mean(np.abs(turned - mean) ** 2, axis=1, keepdims=True)
    np.testing.assert_allclose(information, np.sum(np.abs(mean) ** 2 * order[:, None] ** 2 / noise, axis=0), rtol=1e-10)
    np.testing.assert_allclose(
        told, np.sum(np.imag(np.conj(mean) * turned) * order[:, None] / noise, axis=0), atol=1e-9 * information.max()
    )


@pytest.mark.parametrize("price", [1e-6, 1.0, 1e9])
@pytest.mark.parametrize("n", [3, 4, 5, 40])
@pytest.mark.parametrize("kernel", compiled_and_plain("walked"))
def test_walked(kernel, n, price):
    rng = np.random.default_rng(5)
    values, information = rng.standard_normal(n), rng.uniform(0.5, 50.0, n)
    found, likelihood = kernel(values, information, price)
    second = np.diff(np.eye(n), 2, axis=0)
    np.testing.assert_allclose(found, np.linalg.solve(np.diag(information) + price * second.T @ second, information * values), atol=1e-7)
    # what is left of the values without a straight line has the covariance of both, theirs and that of the walk
    left = multivariate_normal(np.zeros(n - 2), second @ (second / information).T + np.eye(n - 2) / price).logpdf(second @ values)
    assert likelihood == pytest.approx(left + 0.5 * (n - 2) * np.log(2.0 * np.pi) - 0.5 * np.sum(np.log(information)), abs=1e-6)


@pytest.mark.parametrize("n", [5, 128, 311])
@pytest.mark.parametrize("kernel", compiled_and_plain("order_signal"))
def test_order_signal(kernel, n):
    rng = np.random.default_rng(2)
    amplitude = rng.normal(size=(12, 2)) + 1j * rng.normal(size=(12, 2))
    np.testing.assert_allclose(kernel(amplitude, 0.17, n), (basis(11, 0.17, n) @ amplitude).real, atol=1e-11)


def test_they_are_adjoint():
    rng = np.random.default_rng(3)
    x, a = rng.normal(size=(500, 2)), rng.normal(size=(20, 2)) + 1j * rng.normal(size=(20, 2))
    left = np.sum(_kernels.order_signal(a, 0.05, 500) * x)
    right = np.sum((a * _kernels.order_sums(x, 0.05, 19).conj()).real)
    assert left == pytest.approx(right, rel=1e-12)


def test_long_sums_keep_their_digits():
    # one order after the other is summed: without the compiler, a tenth of them takes its time
    order = 20 if numba.config.DISABLE_JIT else 200
    step, n = 2.0 * np.pi * 40.0 / 20000.0, 20000
    samples = np.cos(order * step * (np.arange(n) - 0.5 * (n - 1)))[:, None]
    found = _kernels.order_sums(samples, step, order + order // 10)[:, 0] / n
    assert abs(found[order] - 0.5) < 1e-10
    assert np.abs(np.delete(found, order)).max() < 1e-10


@pytest.mark.parametrize("kernel", compiled_and_plain("follow_runs"))
def test_runs_go_on_across_blocks(kernel):
    x = np.array([1.0, 1.0, 1.0, 2.0, 3.0, 3.0, np.nan, 3.0, 0.5, 4.0, 4.0, 4.0, 2.0])
    values = np.array([np.inf, np.inf, -np.inf, -np.inf, np.nan, np.inf, np.nan])
    counts, lengths, levels, front = np.zeros(14, dtype=np.int64), np.zeros(8, dtype=np.int64), np.zeros(3), np.zeros((4, 3))
    front[0, 1] = 3.0
    for start in range(0, x.size, 5):
        kernel(x[start : start + 5], start, values, counts, lengths, levels, front)
    _kernels.end_run(-1.0, values, counts, lengths, levels, front)
    # low and the level next to it, high and the level next to it, the last value, the least jump and the first value
    np.testing.assert_array_equal(values, [0.5, 1.0, 4.0, 3.0, 2.0, 1.0, 1.0])
    # one lost sample, the seventh; the last run; samples at the levels; runs of three at the extremes; levels; the longest that ended
    np.testing.assert_array_equal(counts, [1, 6, 12, 1, 1, 3, 3, 3, 0, 0, 1, 3, 3, 3])
    np.testing.assert_array_equal(lengths, [0, 3, 0, 3, 0, 0, 0, 0])
    # the last run of three is as long as the one before and followed by less
    np.testing.assert_array_equal(front[1:4], [[0.0, 3.0, 1.0], [4.0, 3.0, 2.5], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize("kernel", compiled_and_plain("follow_runs"))
def test_runs_of_a_fine_signal(kernel):
    """Nearly every sample is a run of its own; some stand still for two to twelve."""
    rng = np.random.default_rng(8)
    length = np.where(rng.random(200) < 0.1, rng.integers(2, 13, 200), 1)
    level = rng.normal(size=200)
    x = np.repeat(level, length)
    values = np.array([np.inf, np.inf, -np.inf, -np.inf, np.nan, np.inf, np.nan])
    counts, lengths, levels, front = np.zeros(14, dtype=np.int64), np.zeros(8, dtype=np.int64), np.zeros(5), np.zeros((9, 3))
    for start in range(0, x.size, 37):
        kernel(x[start : start + 37], start, values, counts, lengths, levels, front)
    _kernels.end_run(-1.0, values, counts, lengths, levels, front)
    np.testing.assert_array_equal(lengths, np.bincount(np.minimum(length, 7), minlength=8))
    order = np.sort(level)
    np.testing.assert_array_equal(values, [order[0], order[1], order[-1], order[-2], level[-1], np.abs(np.diff(level)).min(), level[0]])
    assert counts[12] == 5
    assert counts[13] == length.max()
    np.testing.assert_array_equal(np.sort(levels), np.sort(level[:5]))


def turning(n):
    """An angle that speeds up."""
    t = np.arange(n)
    return 0.05 * t + 2e-5 * t**2


@pytest.mark.parametrize("highest", [0, 3, 9])
@pytest.mark.parametrize("length", [31, 128, 150])
@pytest.mark.parametrize("kernel", compiled_and_plain("angle_sums"))
def test_angle_sums(kernel, length, highest):
    rng = np.random.default_rng(4)
    samples, angle, window, starts = rng.normal(size=(240, 2)), turning(240), rng.uniform(size=length), np.array([0, 17, 59])
    found = kernel(samples, _kernels.turned(angle), starts, window, highest)
    for block, s in zip(found, starts, strict=True):
        phase = np.exp(-1j * np.outer(np.arange(highest + 1), angle[s : s + length]))
        np.testing.assert_allclose(block, phase @ (window[:, None] * samples[s : s + length]), atol=1e-11)


@pytest.mark.parametrize("kernel", compiled_and_plain("angle_signal"))
def test_angle_signal(kernel):
    rng = np.random.default_rng(5)
    amplitude, angle = rng.normal(size=(2, 6, 2)) + 1j * rng.normal(size=(2, 6, 2)), turning(300)
    found = kernel(amplitude, _kernels.turned(angle), 150)
    for w in range(2):
        phase = np.exp(1j * np.outer(angle[150 * w : 150 * (w + 1)], np.arange(6)))
        np.testing.assert_allclose(found[150 * w : 150 * (w + 1)], (phase @ amplitude[w]).real, atol=1e-11)


def teeth_of_a_comb(gain, place, most, folded):
    """What a comb gains, order by order."""
    bins, total, best, used = gain.size, 0.0, 0.0, []
    for m in range(1, most + 1):
        at = m * place
        if at > bins - 2 and not folded:
            break
        if folded:
            at = abs((at + bins - 1) % (2 * (bins - 1)) - (bins - 1))
        if not 2.0 <= at <= bins - 3 or (folded and any(abs(each - at) < 8.0 for each in used)):
            continue
        used.append(at)
        total += np.interp(at, np.arange(bins), gain)
        best = max(best, total)
    return best


@pytest.mark.parametrize("folded", [False, True])
@pytest.mark.parametrize("kernel", compiled_and_plain("comb_scores"))
def test_comb_scores(kernel, folded):
    gain, place = np.random.default_rng(6).normal(size=(3, 120)), np.array([2.0, 7.3, 19.9, 33.3, 58.25, 70.2, 117.0])
    expected = [[teeth_of_a_comb(row, each, 12, folded) for each in place] for row in gain]
    np.testing.assert_allclose(kernel(gain, place, 12, folded), expected, atol=1e-12)


@pytest.mark.parametrize("kernel", compiled_and_plain("sideband_scores"))
def test_sideband_scores(kernel):
    gain, place = np.random.default_rng(7).normal(size=200), np.array([6.7, 23.1])
    for each, found in zip(place, kernel(gain, place, 90.0, 5, np.array([1.0, 0.5, 0.9])), strict=True):
        both = []
        for times in (1, 2, 3):
            sides = []
            for sign in (-1, 1):
                at = 90.0 + sign * np.arange(1, 6) * times * each
                values = np.interp(at[(at >= 2.0) & (at <= 197.0)], np.arange(200), gain)
                sides.append(np.cumsum(values).max(initial=0.0))
            both.append({1: 1.0, 2: 0.5, 3: 0.9}[times] * sum(sides))
        assert found == pytest.approx(max(both))


@pytest.mark.parametrize("kernel", compiled_and_plain("best_path"))
def test_best_path_is_the_best_of_all(kernel):
    scores = np.random.default_rng(8).normal(size=(4, 5))
    path, total = kernel(scores, 2, 0.3)

    def value(trial):
        return scores[range(4), trial].sum() - 0.3 * np.sum(np.diff(trial) ** 2)

    every = [np.array(trial) for trial in np.ndindex(5, 5, 5, 5) if np.abs(np.diff(trial)).max() <= 2]
    best = max(every, key=value)
    np.testing.assert_array_equal(path, best)
    assert total.max() == pytest.approx(value(best))
