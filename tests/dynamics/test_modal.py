"""Modal models against the equations that they solve."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, PoleModel, damped_modes, normal_modes
from rcsa_ident.dynamics.receptance import dissipation
from tests.oracles import literature, naive

FLANGE = plane("flange")
W = np.linspace(100.0, 30000.0, 83)
RESIDUAL = np.array([[1e-9, 4e-9], [4e-9, 9e-8]])


def direct(omega_n, damping, psi, residual=0.0):
    """psi^T (Omega^2 + i w D - w^2)^-1 psi, one solution per frequency."""
    return (
        np.array([psi.T @ np.linalg.solve(np.diag(omega_n**2) + 1j * w * damping - w**2 * np.eye(omega_n.size), psi) for w in W]) + residual
    )


def test_normal_modes():
    omega_n, zeta = np.array([4000.0, 9000.0, 15000.0]), np.array([0.05, 0.2, 0.02])
    psi = np.array([[0.3, 4.0], [-0.2, 3.0], [0.5, -2.0]])
    model = normal_modes(omega_n, zeta, psi, FLANGE, RESIDUAL)
    expected = direct(omega_n, np.diag(2.0 * zeta * omega_n), psi, RESIDUAL)
    np.testing.assert_allclose(model.receptance(W).values, expected, rtol=1e-11)
    np.testing.assert_allclose(model.phi[0], psi[0] * np.exp(-0.25j * np.pi) / np.sqrt(2.0 * omega_n[0] * np.sqrt(1 - 0.05**2)))


def test_complex_modes_as_the_formula_is_written():
    table = literature.PUBLISHED_MODES["X"]
    omega_n, zeta = 2.0 * np.pi * table[:, 0], table[:, 1] / 100.0
    phi = 1e-4 * np.stack([table[:, 2] + 1j * table[:, 3], table[:, 4] + 1j * table[:, 5]], axis=1)
    model = ModalModel(omega_n, zeta, phi, np.zeros((2, 2)), FLANGE)
    pole = -zeta * omega_n + 1j * omega_n * np.sqrt(1.0 - zeta**2)
    np.testing.assert_allclose(model.pole, pole)
    residue = np.array([np.outer(p, p).ravel() for p in phi])
    expected = naive.pole_sum(W, np.concatenate([pole, pole.conj()]), np.concatenate([residue, residue.conj()]))
    np.testing.assert_allclose(model.receptance(W).values.reshape(W.size, 4), expected, rtol=1e-11)


@pytest.mark.parametrize("damping", [0.01, 0.3, 4.0])
def test_damped_modes(damping):
    """Light, heavy, and so heavy that poles are real."""
    omega_n = np.array([3000.0, 7000.0, 12000.0])
    factor = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [-0.4, 0.5, 1.2]]) * np.sqrt(damping * 5000.0)
    d = factor @ factor.T
    psi = np.array([[0.3, 4.0], [-0.2, 3.0], [0.5, -2.0]])
    model = damped_modes(omega_n, d, psi, RESIDUAL, FLANGE)
    np.testing.assert_allclose(model.receptance(W).values, direct(omega_n, d, psi, RESIDUAL), rtol=1e-9)
    assert np.any(model.zeta == 1.0) == (damping == 4.0)
    assert np.all(np.diff(model.omega_n) >= 0.0)
    assert np.min(dissipation(W, model.receptance(W).values)) > -1e-9


@pytest.mark.parametrize("excess", [0.0, 1e-14, -1e-14, 1e-9, -1e-9, -1e-6, 1e-3])
def test_critical_damping(excess):
    """A pair of poles that becomes two real ones has a single shape there."""
    omega_n, psi = np.array([5000.0, 9000.0]), np.array([[0.3, 4.0], [-0.2, 3.0]])
    d = np.diag([2.0 * (1.0 + excess) * 5000.0, 900.0])
    model = damped_modes(omega_n, d, psi, np.zeros((2, 2)), FLANGE)
    np.testing.assert_allclose(model.receptance(W).values, direct(omega_n, d, psi), rtol=2e-5)


def test_damped_modes_of_proportional_damping_are_the_normal_ones():
    omega_n, zeta = np.array([4000.0, 9000.0]), np.array([0.05, 0.2])
    psi = np.array([[0.3, 4.0], [-0.2, 3.0]])
    one = normal_modes(omega_n, zeta, psi, FLANGE)
    two = damped_modes(omega_n, np.diag(2.0 * zeta * omega_n), psi, np.zeros((2, 2)), FLANGE)
    np.testing.assert_allclose(two.omega_n, one.omega_n, rtol=1e-12)
    np.testing.assert_allclose(two.zeta, one.zeta, rtol=1e-10)
    np.testing.assert_allclose(np.abs(two.phi / one.phi), 1.0, rtol=1e-10)


@pytest.mark.parametrize("damping", [np.diag([300.0, 500.0]), np.array([[300.0, 100.0], [100.0, 300.0]]), np.diag([300.0, 300.0])])
def test_two_modes_at_one_frequency(damping):
    omega_n = np.array([5000.0, 5000.0])
    psi = np.array([[0.3, 4.0], [-0.2, 3.0]])
    model = damped_modes(omega_n, damping, psi, np.zeros((2, 2)), FLANGE)
    np.testing.assert_allclose(model.receptance(W).values, direct(omega_n, damping, psi), rtol=1e-8)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), modes=st.integers(1, 8), size=st.floats(0.0, 3.0))
def test_damped_modes_are_passive_and_exact(seed, modes, size):
    rng = np.random.default_rng(seed)
    omega_n = np.sort(rng.uniform(2000.0, 25000.0, modes))
    factor = np.tril(rng.normal(size=(modes, modes))) * np.sqrt(size * 1000.0) + np.diag(np.sqrt(0.02 * omega_n))
    psi = rng.normal(size=(modes, 2)) * [0.3, 4.0]
    model = damped_modes(omega_n, factor @ factor.T, psi, np.zeros((2, 2)), FLANGE)
    expected = direct(omega_n, factor @ factor.T, psi)
    np.testing.assert_allclose(model.receptance(W).values, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
    assert np.min(dissipation(W, expected)) > -1e-9


def test_pole_model_is_a_sum_over_poles():
    rng = np.random.default_rng(5)
    pole = np.array([-40.0 + 900.0j, -10.0 - 500.0j, -3000.0 + 0j])
    outputs, inputs = rng.normal(size=(2, 3)) + 1j, rng.normal(size=(3, 2)) - 0.5j
    model = PoleModel(pole, outputs, inputs, FLANGE)
    values = model.receptance(W).values
    expected = np.array([(outputs / (1j * w - pole)) @ inputs for w in W])
    np.testing.assert_allclose(values, expected, rtol=1e-12)
    np.testing.assert_array_equal(model.entries(W, ((1, 0), (0, 1))), [values[:, 1, 0], values[:, 0, 1]])


def test_refused():
    ok = {"omega_n": [1.0], "zeta": [0.1], "phi": [[1.0, 1.0]], "residual": np.zeros((2, 2)), "coordinates": plane("flange", Dof.Y)}
    for change, words in (
        ({"zeta": [0.0]}, "above 0"),
        ({"zeta": [1.1]}, "not above 1"),
        ({"zeta": [np.nan]}, "above 0"),
        ({"omega_n": [-1.0]}, "omega_n"),
        ({"phi": [[1.0]]}, "phi"),
        ({"residual": np.zeros((1, 1))}, "residual"),
    ):
        with pytest.raises(InputError, match=words):
            ModalModel(**{**ok, **change})
