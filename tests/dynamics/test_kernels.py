"""The kernels of dynamics against plain loops; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics import _kernels as kernels
from tests.oracles import naive


def test_pole_sum():
    rng = np.random.default_rng(3)
    pole = -rng.uniform(1.0, 50.0, 7) + 1j * rng.uniform(-2000.0, 2000.0, 7)
    residue = rng.normal(size=(7, 5)) + 1j * rng.normal(size=(7, 5))
    omega = np.linspace(1.0, 2500.0, 23)
    np.testing.assert_allclose(kernels.pole_sum(omega, pole, residue), naive.pole_sum(omega, pole, residue), rtol=1e-12)


def test_pole_sum_of_nothing():
    assert np.all(kernels.pole_sum(np.array([1.0, 2.0]), np.empty(0, complex), np.empty((0, 3), complex)) == 0.0)


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("half", [0, 1, 4])
def test_product_with_a_banded_matrix(half, kind):
    rng = np.random.default_rng(5)
    full = np.triu(np.tril(rng.normal(size=(9, 9)), half), -half).astype(kind)
    full *= 1.0 if kind is float else 1.0 - 0.3j
    band = np.zeros((2 * half + 1, 9), dtype=kind)
    for i in range(9):
        for j in range(9):
            if abs(i - j) <= half:
                band[half + i - j, j] = full[i, j]
    x = rng.normal(size=(9, 3))
    total = np.ones((9, 3), dtype=kind)
    kernels.add_banded(total, band, x)
    np.testing.assert_allclose(total, 1.0 + full @ x, rtol=0, atol=1e-13)


def test_independent_columns():
    rng = np.random.default_rng(4)
    full = rng.normal(size=(30, 4))
    columns = np.hstack([full, full @ rng.normal(size=(4, 6)) * 1e3, np.zeros((30, 1))])
    basis = kernels.independent_columns(np.asfortranarray(columns), 1e-9)
    assert basis.shape == (30, 4)
    np.testing.assert_allclose(basis.T @ basis, np.eye(4), atol=1e-14)
    np.testing.assert_allclose(basis @ (basis.T @ columns), columns, atol=1e-10)


def test_independent_columns_stay_orthogonal_where_they_are_almost_parallel():
    powers = np.linspace(0.0, 1.0, 60)[:, None] ** np.arange(14)
    basis = kernels.independent_columns(np.asfortranarray(powers), 1e-10)
    assert 9 <= basis.shape[1] <= 14
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-13)


def test_inner_product_and_removal():
    a, b = np.array([0.6, 0.8]), np.array([2.0, 1.0])
    assert kernels.dot(a, b) == pytest.approx(2.0)
    kernels.take_out(a, b)
    np.testing.assert_allclose(b, [0.8, -0.6])
