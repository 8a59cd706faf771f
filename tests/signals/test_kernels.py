"""The Fourier kernels against plain matrices; these tests run again without the compiler."""

import numba
import numpy as np
import pytest

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
