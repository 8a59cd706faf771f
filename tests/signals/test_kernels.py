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
