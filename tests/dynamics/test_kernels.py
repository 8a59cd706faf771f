"""The kernels of dynamics against plain loops; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics import _kernels as kernels
from tests.oracles import naive


@pytest.mark.parametrize("count", [1, 23, kernels.LANES, 2 * kernels.LANES + 7])
def test_pole_sum(count):
    rng = np.random.default_rng(3)
    pole = -rng.uniform(1.0, 50.0, 7) + 1j * rng.uniform(-2000.0, 2000.0, 7)
    residue = rng.normal(size=(7, 5)) + 1j * rng.normal(size=(7, 5))
    omega = np.linspace(1.0, 2500.0, count)
    np.testing.assert_allclose(kernels.pole_sum(omega, pole, residue), naive.pole_sum(omega, pole, residue), rtol=1e-12)


def test_pole_sum_of_nothing():
    assert np.all(kernels.pole_sum(np.array([1.0, 2.0]), np.empty(0, complex), np.empty((0, 3), complex)) == 0.0)


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("half", [0, 1, 4])
def test_product_with_a_banded_matrix(half, kind):
    rng = np.random.default_rng(5)
    # ones, as those of a connection, among others
    full = np.triu(np.tril(np.where(np.arange(9) % 3 == 0, 1.0, rng.normal(size=(9, 9))), half), -half).astype(kind)
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


def test_a_basis_ends_where_nothing_longer_than_the_tolerance_is_left():
    """Columns at unit length, of which one stands across the other by a two-thousandth; a zero one never counts."""
    columns = np.asfortranarray([[0.0, 3.0, 2.0], [0.0, 0.0, 1e-3]])
    basis = kernels.independent_columns(columns, 1e-9)
    np.testing.assert_allclose(basis @ basis.T, np.eye(2), atol=1e-14)
    assert kernels.independent_columns(columns, 1e-2).shape == (2, 1)
    assert kernels.independent_columns(1e-3 * columns, 1e-2).shape == (2, 1)
    assert kernels.independent_columns(1e-3 * columns, 1e-4).shape == (2, 2)
    np.testing.assert_allclose(kernels.independent_columns(np.array([[3.0], [4.0]]), 1e-9), [[0.6], [0.8]], rtol=1e-14)
    assert kernels.independent_columns(np.zeros((4, 2)), 0.0).shape == (4, 0)


def test_the_longest_remainder_comes_first():
    """Behind the first axis the third column stands farther across than the second, and is taken before it."""
    rest = np.array([[1.0, 1.0, 1.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.2]])
    basis = kernels.independent_columns(np.asfortranarray(np.hstack([rest[:, :1] * (1.0 + 1e-9), rest[:, 1:]])), 0.15)
    first = np.abs(basis[:, 0])
    taken = [k for k in range(3) if np.allclose(first, np.abs(rest[:, k]) / np.linalg.norm(rest[:, k]))]
    across = rest / np.linalg.norm(rest, axis=0)
    across = across - np.outer(basis[:, 0], basis[:, 0] @ across)
    longest = across[:, np.argmax(np.linalg.norm(across, axis=0))]
    assert len(taken) == 1
    np.testing.assert_allclose(np.abs(basis[:, 1]), np.abs(longest) / np.linalg.norm(longest), atol=1e-12)


def test_no_more_vectors_than_dimensions():
    columns = np.random.default_rng(6).normal(size=(3, 8))
    basis = kernels.independent_columns(np.asfortranarray(columns), 0.0)
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-14)


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
