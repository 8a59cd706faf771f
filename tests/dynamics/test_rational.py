"""Rational fits: recovery of known poles, order from the data, receptances of whole machines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.rational import FitStatus, fitted_poles, rational_fit
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.virtual.rotor import frequency_response, rotor

MACHINES = Path(__file__).parents[2] / "data" / "machines"
OMEGA = 2.0 * np.pi * np.arange(100.0, 4301.0, 5.0)
TIP = (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y))


def modal(frequency=(180.0, 900.0, 1500.0, 2900.0), zeta=(0.03, 0.05, 0.02, 0.01), residual=None):
    """Four modes in which both directions move."""
    psi = np.array([[0.3, 0.05], [1.0, -0.4], [0.3, 2.0], [-1.5, 1.0]])[: len(frequency)]
    return normal_modes(2.0 * np.pi * np.array(frequency), np.array(zeta), psi, TIP, residual)


def test_poles_residues_and_constant_of_a_modal_model_come_back():
    model = modal(residual=np.array([[2e-9, 1e-10], [1e-10, 3e-9]]))
    values = model.receptance(OMEGA).values
    fit = rational_fit(OMEGA, values, order=8)
    np.testing.assert_allclose(fit.pole, model.pole, rtol=1e-9)
    np.testing.assert_allclose(fit.residue, np.einsum("mp,mq->mpq", model.phi, model.phi), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(fit.constant, model.residual, rtol=1e-6)
    assert fit.order == 8
    assert fit.relative_error < 1e-10


def test_the_order_comes_out_of_the_data():
    fit = rational_fit(OMEGA, modal().receptance(OMEGA).values, tolerance=1e-6, constant=False)
    assert fit.status is FitStatus.CONVERGED
    assert fit.order == 8
    np.testing.assert_array_equal(fit.constant, 0.0)


def test_a_small_mode_is_found_among_many_lines_of_noise():
    """It hardly changes the rms: without it the misfit is 1.02 of the noise."""
    omega, rng = 2.0 * np.pi * np.arange(100.0, 4301.0), np.random.default_rng(1)
    values = modal().receptance(omega).values[:, 0, 0]
    small = normal_modes(2.0 * np.pi * np.array([2200.0]), np.array([0.005]), np.array([[0.1]]), TIP[:1]).receptance(omega).values[:, 0, 0]
    level = 0.3 * np.abs(small).max()
    noise = level * (rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size))
    assert np.sqrt(1.0 + np.mean(np.abs(small) ** 2) / (2.0 * level**2)) < 1.023
    without, fit = (rational_fit(omega, each + noise, noise=level) for each in (values, values + small))
    assert without.order < fit.order <= 12
    assert fit.status is FitStatus.CONVERGED
    nearest = fit.pole[np.argmin(np.abs(np.abs(fit.pole) - 2.0 * np.pi * 2200.0))]
    assert abs(nearest) == pytest.approx(2.0 * np.pi * 2200.0, rel=1e-3)
    assert -nearest.real / abs(nearest) == pytest.approx(0.005, rel=0.3)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(1, 5), st.integers(0, 2**31), st.integers(0, 2))
def test_any_stable_function_is_recovered(pairs, seed, real):
    """Pairs a tenth of the band apart at least, and overdamped poles between them."""
    rng = np.random.default_rng(seed)
    top = OMEGA.max()
    imaginary = top * (np.linspace(0.1, 0.9, pairs) + rng.uniform(-0.03, 0.03, pairs))
    pole = np.concatenate([-rng.uniform(0.01, 0.06, pairs) * imaginary + 1j * imaginary, -top * np.array([0.15, 0.6])[:real]])
    residue = np.concatenate([rng.normal(size=pairs) + 1j * rng.normal(size=pairs), rng.uniform(1.0, 2.0, real)])
    s = 1j * OMEGA[:, None]
    values = np.sum(residue / (s - pole) + residue.conj() / (s - pole.conj()), axis=1)
    fit = rational_fit(OMEGA, values, order=2 * pairs + real, constant=False)
    assert fit.relative_error < 1e-6
    assert fit.order == 2 * pairs + real
    assert np.all(fit.pole.real < 0.0)
    assert np.sum(fit.pole.imag == 0.0) == real
    np.testing.assert_allclose(fit.response(OMEGA)[:, 0, 0], values, rtol=1e-5, atol=1e-6 * np.abs(values).max())
    # the realisation has the same response, and only real numbers
    system = fit.state_space()
    assert system.order == fit.order
    assert system.stable
    np.testing.assert_allclose(system.response(OMEGA), fit.response(OMEGA), rtol=1e-9, atol=1e-12 * np.abs(values).max())


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 7))
def test_whatever_the_data_the_fit_is_stable_and_strictly_proper(seed, order):
    rng = np.random.default_rng(seed)
    omega = np.sort(rng.uniform(1.0, 100.0, 40))
    fit = rational_fit(omega, rng.normal(size=40) + 1j * rng.normal(size=40), order=order, constant=False)
    assert fit.state_space().stable
    np.testing.assert_array_equal(fit.constant, 0.0)
    far = fit.response(np.array([1e9, 2e9]))[:, 0, 0]
    assert abs(far[1]) < 0.6 * abs(far[0]) + 1e-300


def test_mirrored_poles_fit_what_a_stable_function_can():
    """An unstable pair: the stable fit keeps the frequency and what can be kept of the magnitude."""
    pole = 300.0 + 8000.0j
    values = 1.0 / (1j * OMEGA - pole) + 1.0 / (1j * OMEGA - pole.conjugate())
    fit = rational_fit(OMEGA, values, order=2)
    assert -2000.0 < fit.pole[0].real < -30.0
    assert fit.pole[0].imag == pytest.approx(8000.0, rel=0.1)


@pytest.mark.slow
def test_noise_leaves_the_order_and_widens_the_poles():
    """The misfit is that of the noise, and the poles lie where the Cramer-Rao bound puts them."""
    model = modal()
    values = model.receptance(OMEGA).values[:, :, :1]
    std = 2e-3 * np.abs(values) + 1e-11
    rng = np.random.default_rng(4)
    found = []
    for _ in range(12):
        noisy = values + std * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape))
        fit = rational_fit(OMEGA, noisy, noise=std, constant=False)
        assert fit.order == 8
        assert fit.error == pytest.approx(1.0, abs=0.05)
        found.append(fit.pole)
    # bound: the jacobian of the model in its real and imaginary parts of poles and residues
    residue = np.einsum("mp,mq->mpq", model.phi, model.phi)[:, :, :1].reshape(4, -1)
    s = 1j * OMEGA[:, None]
    columns = []
    for k in range(4):
        direct, mirrored = 1.0 / (s - model.pole[k]), 1.0 / (s - model.pole[k].conj())
        for unit in (1.0, 1j):
            columns.append(residue[k] * direct**2 * unit + residue[k].conj() * mirrored**2 * np.conj(unit))
        for e in range(2):
            for unit in (1.0, 1j):
                columns.append((direct * unit + mirrored * np.conj(unit)) * np.eye(2)[e])
    jacobian = (np.array(columns) / std[None, :, :, 0]).reshape(len(columns), -1)
    jacobian = np.concatenate([jacobian.real, jacobian.imag], axis=1)
    bound = np.sqrt(np.diag(np.linalg.inv(jacobian @ jacobian.T))).reshape(4, -1)[:, :2]
    error = np.array(found) - model.pole
    ratio = np.sqrt(np.mean(np.stack([error.real, error.imag], axis=-1) ** 2, axis=0)) / bound
    assert np.all(ratio < 1.8)
    assert np.all(ratio > 0.5)


def test_what_no_order_reaches_is_said():
    rng = np.random.default_rng(5)
    values = modal().receptance(OMEGA).values[:, 0, 0] * (1.0 + 0.05 * (rng.normal(size=OMEGA.size) + 1j * rng.normal(size=OMEGA.size)))
    fit = rational_fit(OMEGA, values, tolerance=1e-4, constant=False, highest_order=14)
    assert fit.status is FitStatus.TOLERANCE_NOT_MET
    assert 6 <= fit.order <= 10
    assert fit.error == pytest.approx(0.05 * np.sqrt(2.0), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("tooling", ["S1-ER32", "S2-PG25", "S3-PG25-long", "S4-shrink"])
def test_tip_and_cross_receptance_of_a_finite_element_machine(tooling):
    """100 to 4300 Hz, full equations with hysteretic damping: not rational, but nearly so."""
    machine = read_machine(MACHINES / "hpm.toml")
    model = rotor(machine.spindle, read_tooling(MACHINES / "toolings" / f"{tooling}.toml").assembly)
    omega = 2.0 * np.pi * np.arange(100.0, 4301.0, 10.0)
    values = frequency_response(model, omega, 1000.0, outputs=("tip.x", "flange.x"), inputs=("tip.x",))[:, :, 0]
    for column, constant in ((0, True), (1, False)):
        fit = rational_fit(omega, values[:, column], constant=constant)
        assert fit.status is FitStatus.CONVERGED
        assert fit.relative_error < 1e-3
        assert fit.order <= 24
        between = omega[:-1] + 0.5 * np.diff(omega)
        true = frequency_response(model, between[::7], 1000.0, outputs=("tip.x", "flange.x"), inputs=("tip.x",))[:, column, 0]
        # no pole hides between the frequencies
        np.testing.assert_allclose(fit.response(between[::7])[:, 0, 0], true, rtol=0.01, atol=1e-3 * np.abs(true).max())


def test_poles_of_the_coupling_chain():
    """A tooling on an identified machine, both planes: separate poles, shapes along the axes, error and order told."""
    tooling = read_tooling(MACHINES / "toolings" / "S1-ER32.toml")
    omega = 2.0 * np.pi * np.arange(100.0, 4301.0, 5.0)
    natural = 2.0 * np.pi * np.array([180.0, 998.0, 1820.0, 2330.0, 3970.0])
    psi = np.array([[0.08, 0.4], [0.15, 1.5], [0.25, 3.0], [0.2, 4.0], [0.15, 8.0]])
    joint = LumpedJoint(3e9, 6e6, 2e3, 10.0)
    flanges = tuple(
        normal_modes(shift * natural, np.full(5, 0.05), psi, plane("flange", axis)) for axis, shift in ((Dof.X, 1.0), (Dof.Y, 0.95))
    )
    values = FlangeMachine(flanges, (omega[0], omega[-1]), joint).tip(tooling, omega).values
    modes, error = fitted_poles(omega, values)
    found = modes.response(omega)
    assert error < 1e-3
    np.testing.assert_array_equal(found[:, 0, 1], 0.0)
    for i in (0, 1):
        assert np.linalg.norm(found[:, i, i] - values[:, i, i]) < 1e-3 * np.linalg.norm(values[:, i, i])
    # both planes have poles of their own: each shape lies along one axis
    assert np.all((modes.outputs[0] == 0.0) ^ (modes.outputs[1] == 0.0))
    system = modes.state_space()
    np.testing.assert_allclose(system.response(omega[::50]), found[::50], rtol=1e-9, atol=1e-18)


def test_coupled_planes_share_poles_and_modes_have_one_shape():
    values = modal().receptance(OMEGA).values
    modes = rational_fit(OMEGA, values, order=8, constant=False).modes()
    assert modes.pole.size == 4
    np.testing.assert_allclose(modes.response(OMEGA), values, rtol=1e-7, atol=1e-13)
    # a symmetric receptance: shapes of motion and of force are the same up to a factor
    ratio = modes.outputs[1] / modes.outputs[0]
    np.testing.assert_allclose(modes.inputs[:, 1] / modes.inputs[:, 0], ratio, rtol=1e-6)


def test_a_residue_of_full_rank_keeps_all_its_parts():
    """Two modes at one pole, one along each axis."""
    s = 1j * OMEGA[:, None, None]
    pole, residue = -200.0 + 6000.0j, np.diag([1.0 - 1.0j, 2.0 - 2.5j])
    values = residue / (s - pole) + residue.conj() / (s - np.conj(pole))
    values = values + np.array([[0.0, 1e-6], [1e-6, 0.0]])
    fit = rational_fit(OMEGA, values, order=2)
    modes = fit.modes()
    assert modes.pole.size == 2
    np.testing.assert_allclose(modes.response(OMEGA), values, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(fit.state_space().response(OMEGA[::20]), values[::20], rtol=1e-7, atol=1e-12)
    assert fit.modes(rank=1.0).pole.size == 1


@pytest.mark.parametrize(
    ("omega", "values", "options", "message"),
    [
        (OMEGA, np.ones(3), {}, "values"),
        (OMEGA, np.zeros(OMEGA.size), {}, "zero"),
        (OMEGA - OMEGA[0], np.ones(OMEGA.size), {}, "frequencies"),
        (OMEGA, np.full(OMEGA.size, np.nan), {}, "finite"),
        (OMEGA, np.ones(OMEGA.size), {"order": 0}, "order"),
        (OMEGA[:5], np.ones(5), {"order": 9}, "order"),
        (OMEGA, np.ones(OMEGA.size), {"noise": 0.0}, "noise"),
    ],
)
def test_what_cannot_be_fitted_is_refused(omega, values, options, message):
    with pytest.raises(InputError, match=message):
        rational_fit(omega, values, **options)


def test_nothing_moves_has_no_modes():
    with pytest.raises(InputError, match="zero"):
        fitted_poles(OMEGA, np.zeros((OMEGA.size, 2, 2)))


def test_no_pole_stands_far_above_the_band():
    # a joint that damps has a compliance that grows with frequency: only a real pole far above and a constant that cancels it fit that
    model = modal()
    joint = 1.5e-8 / (1.0 + 1j * OMEGA / (2.0 * np.pi * 400e3)) - 1.4e-8
    values = model.receptance(OMEGA).values + joint[:, None, None] * np.eye(2)
    freely, _ = fitted_poles(OMEGA, values, 1e-5)
    assert np.abs(freely.pole).max() > 20.0 * OMEGA[-1]
    damped, error = fitted_poles(OMEGA, values, 1e-5, 0.1)
    assert np.abs(damped.pole).max() < 20.0 * OMEGA[-1]
    assert error < 2e-3
    assert np.abs(freely.constant).max() > 1e-8
    assert np.abs(damped.constant).max() < 2e-9
