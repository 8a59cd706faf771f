"""Rational fits beside implementations that others keep: vector fitting of network parameters, realization of an impulse response,
least-squares complex frequency."""

from __future__ import annotations

import warnings

import control
import numpy as np
import pytest
from sdypy import EMA
from skrf import Network
from skrf.vectorFitting import VectorFitting

from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.rational import rational_fit

FREQUENCY = np.array([180.0, 420.0, 650.0, 900.0, 1250.0, 1600.0, 2100.0, 2900.0])
ZETA = np.array([0.03, 0.04, 0.02, 0.05, 0.02, 0.03, 0.015, 0.01])
HERTZ = np.arange(100.0, 4301.0, 5.0)
OMEGA = 2.0 * np.pi * HERTZ
TIP = (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y))


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(3)
    psi = rng.choice([-1.0, 1.0], (8, 2)) * rng.uniform(0.5, 1.5, (8, 2))
    return normal_modes(2.0 * np.pi * FREQUENCY, ZETA, psi, TIP)


def vector_fitted(values):
    """Poles and response of the same order, both sides given the same values and weights."""
    scale = np.abs(values).max()
    fit = VectorFitting(Network(f=HERTZ, f_unit="hz", s=values / scale))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit.vector_fit(n_poles_real=0, n_poles_cmplx=8, fit_constant=True, fit_proportional=False)
    columns = [[scale * fit.get_model_response(i, j, HERTZ) for j in range(2)] for i in range(2)]
    return np.sort(np.abs(fit.poles)) / (2.0 * np.pi), np.moveaxis(np.array(columns), 2, 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_as_good_as_vector_fitting_of_others(model, seed):
    """Noise of 1e-4 of the largest peak: nobody finds better poles, or a nearer function, than ours."""
    true = model.receptance(OMEGA).values
    noise = 1e-4 * np.abs(true).max()
    rng = np.random.default_rng(seed)
    values = true + noise * (rng.standard_normal(true.shape) + 1j * rng.standard_normal(true.shape))
    fit = rational_fit(OMEGA, values, order=16, noise=noise)
    frequency, other = vector_fitted(values)
    error, others = (np.linalg.norm(v - true) for v in (fit.response(OMEGA), other))
    assert error < 1.05 * others
    own = np.sort(np.abs(fit.pole)) / (2.0 * np.pi)
    assert np.abs(own / FREQUENCY - 1.0).max() < 1.5 * np.abs(frequency / FREQUENCY - 1.0).max() + 1e-5


def test_the_same_poles_as_a_realization_of_the_impulse_response(model):
    rate = 20000.0
    impulse = np.einsum("im,mk,mj->ijk", model.phi.T, np.exp(model.pole[:, None] * np.arange(400) / rate), model.phi)
    found, _ = control.eigensys_realization(2.0 * impulse.real, 16, m=150, n=150, dt=1.0 / rate)
    poles = np.log(np.linalg.eigvals(found.A).astype(complex)) * rate
    realized = np.sort_complex(poles[poles.imag > 0.0])
    fit = rational_fit(OMEGA, model.receptance(OMEGA).values, order=16)
    np.testing.assert_allclose(np.sort_complex(fit.pole), realized, rtol=1e-6)


@pytest.mark.slow
def test_the_same_modes_as_the_least_squares_complex_frequency_method(model):
    """Told where the modes are, that of others finds them in receptances without noise; its lines begin at 0 Hz."""
    hertz = np.arange(0.0, HERTZ[-1] + 1.0, 5.0)
    values = model.receptance(2.0 * np.pi * hertz).values
    other = EMA.Model(values[:, :, 0].T, hertz, lower=50, upper=HERTZ[-1], pol_order_high=60, frf_form="receptance")
    other.get_poles(method="lscf", show_progress=False)
    other.select_closest_poles(list(FREQUENCY))
    pole = rational_fit(OMEGA, values[np.isin(hertz, HERTZ)], order=16).pole
    pole = pole[np.argsort(np.abs(pole))]
    np.testing.assert_allclose(np.abs(pole) / (2.0 * np.pi), other.nat_freq, rtol=3e-6)
    np.testing.assert_allclose(-pole.real / np.abs(pole), other.nat_xi, rtol=1e-3)
