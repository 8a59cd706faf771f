"""One filter for axes that feel each other: filterpy on the same matrices, closed forms, two filters where nothing is felt."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.rational import FitStatus, RationalFit
from rcsa_ident.observer.coupled_transfer import CoupledTransfer, coupled_transfer
from rcsa_ident.observer.force_model import AxisNoise, RandomWalk, TeethResonators, augmented
from rcsa_ident.observer.kalman import kalman_filter, riccati
from rcsa_ident.observer.margins import observer_margins
from rcsa_ident.observer.transfer_function import SampledModes, high_pass, warped

STEP, BAND = 1.0 / 20000.0, (2.0 * np.pi * 400.0, 2.0 * np.pi * 4000.0)
CORNER = 0.25 * BAND[0]
#: Two forces at orders of their own; the first axis has an accelerometer that is not quiet, the second an order that is not believed.
FORCES = (
    TeethResonators(RandomWalk(30.0, BAND[0]), 2.0 * np.pi * np.array([500.0, 1000.0]), np.array([400.0, 300.0])),
    TeethResonators(RandomWalk(40.0, BAND[0]), 2.0 * np.pi * np.array([500.0]), np.array([500.0])),
)


def machine(cross=0.3):
    """Modes at 900, 1500 and 2600 Hz whose left and right shapes differ."""
    pole = 2.0 * np.pi * np.array([900.0, 1500.0, 2600.0]) * np.array([-0.03 + 1j, -0.04 + 1j, -0.02 + 1j])
    left = np.array([[1.0, cross], [cross, 1.0], [1.0, -cross]])
    right = np.array([[1.0, -0.5j * cross], [cross, 1.0], [1.0, cross]])
    residue = left[:, :, None] * right[:, None, :] * (-1e-4j * np.array([2.0, 3.0, 1.0]))[:, None, None]
    return RationalFit(pole, residue, np.zeros((2, 2)), 0.0, 0.0, 6, FitStatus.CONVERGED)


def noises():
    filtered = SampledModes(np.array([0.8 + 0.3j]), np.array([1e-12 + 2e-12j]), 1e-12, STEP)
    first = AxisNoise(FORCES[0], 2e-9, filtered, 50.0)
    return first, AxisNoise(FORCES[1], 3e-9, disturbance=np.array([2.0 * np.pi * 200.0]), disturbance_intensity=1e-7)


@pytest.fixture(scope="module")
def transfer():
    return CoupledTransfer(machine(), STEP, BAND, np.zeros(2))


@pytest.fixture(scope="module")
def both(transfer):
    return kalman_filter(augmented(transfer.behind_high_pass(CORNER), noises(), STEP), 60)


@pytest.fixture(scope="module")
def measured():
    return 1e-7 * np.random.default_rng(5).normal(size=(400, 2))


def sampled_response(poles, omega):
    z = np.exp(1j * omega * STEP)[:, None]
    one = (poles.outputs / (z - poles.pole)[:, None, :]) @ poles.inputs
    two = (poles.outputs.conj() / (z - poles.pole.conj())[:, None, :]) @ poles.inputs.conj()
    return one + two + poles.constant


def test_the_sampled_plant_is_the_machine_behind_the_high_pass(transfer):
    """At every frequency, up to what is dropped with a residue's further parts: nothing here."""
    omega = 2.0 * np.pi * np.linspace(50.0, 8000.0, 200)
    expected = transfer.response(omega) * high_pass(CORNER, STEP).response(omega)[:, None, None]
    plant = transfer.behind_high_pass(CORNER)
    np.testing.assert_allclose(sampled_response(plant, omega), expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(np.linalg.norm(plant.inputs, axis=1), 1.0)
    # a pole has one shape, the high-pass two
    assert plant.pole.size == 5
    one = transfer.direct(1)
    np.testing.assert_allclose(one.response(omega), transfer.response(omega)[:, 1, 1])


def test_the_fit_keeps_what_is_not_reciprocal():
    """A C31 whose XY and YX differ, seen through two sensors that differ; and one that hardly couples asks for no further poles."""
    omega = 2.0 * np.pi * np.arange(100.0, 5200.0, 5.0)
    sensor = np.stack([np.exp(-2e-5j * omega), 1.0 / (1.0 + 1j * omega / 40000.0)], axis=1)
    shown = machine().response(warped(omega, STEP)) * sensor[:, :, None]
    found = coupled_transfer(omega, machine().response(warped(omega, STEP)), STEP, BAND, sensor)
    inside = (omega >= BAND[0]) & (omega <= BAND[1])
    error = np.linalg.norm((found.response(omega) - shown)[inside], axis=0)
    assert np.all(error < 3e-3 * np.linalg.norm(shown[inside], axis=0).max(axis=1)[:, None])
    assert np.all(found.flatness < 0.2)
    noise = 1e-13 * np.random.default_rng(1).normal(size=omega.size)
    bare = machine(0.0).response(warped(omega, STEP)) + noise[:, None, None] * (1.0 - np.eye(2))
    assert coupled_transfer(omega, bare, STEP, BAND, np.ones((omega.size, 2))).fit.order == 6
    with pytest.raises(InputError, match="band"):
        coupled_transfer(omega, bare, STEP, (1e6, 2e6), sensor)


def test_it_is_the_full_filter(both, measured):
    """Plain filterpy with the same matrices, step by step from the first one on."""
    from filterpy.kalman import KalmanFilter as Plain

    a, seen, rows, q = both.model.matrices()
    plain = Plain(dim_x=len(a), dim_z=2)
    plain.F, plain.H, plain.Q, plain.R, plain.P = a, seen, q, np.eye(2), both.model.first_covariance()
    _, found = both.run(both.init(), measured)
    for k in range(60):
        plain.predict()
        plain.update(measured[k] / both.model.noise)
        np.testing.assert_allclose(found[k, 0], rows @ plain.x[:, 0], rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(found[k, 2], plain.y[:, 0] * both.model.noise, rtol=1e-7, atol=1e-16)
    np.testing.assert_allclose(both.force_variance[59], np.diag(rows @ plain.P @ rows.T), rtol=1e-7)
    np.testing.assert_allclose(both.variance[59], plain.S * np.outer(both.model.noise, both.model.noise), rtol=1e-7)


def test_the_steady_gain_solves_the_riccati_equation(both):
    """A step of the covariance from the steady one leads back to it, and its gain is the last one."""
    a, seen, _, q = both.model.matrices()
    steady = riccati(a, seen, q)
    gain = steady @ seen.T @ np.linalg.inv(seen @ steady @ seen.T + np.eye(2))
    size = np.sqrt(np.diag(steady))
    again = a @ (steady - gain @ seen @ steady) @ a.T + q
    np.testing.assert_allclose(again / np.outer(size, size), steady / np.outer(size, size), atol=1e-9)
    last = both.gain[-1].transpose(2, 1, 0).reshape(-1, 2)[both.model.live] * both.model.noise
    np.testing.assert_allclose(last, gain, atol=1e-12 * np.abs(gain).max())
    assert np.all(np.abs(both.state_space().pole) < 1.0)


def test_axes_that_feel_nothing_of_each_other_have_their_own_filters(measured):
    """Forces, deviations and smoothed forces of two filters of one axis each."""
    fit, axes = machine(0.0), noises()
    transfer = CoupledTransfer(fit, STEP, BAND, np.zeros(2))
    together = kalman_filter(augmented(transfer.behind_high_pass(CORNER), axes, STEP), 60)
    _, found = together.run(together.init(), measured)
    smoothed = together.smooth(found)
    for i, each in enumerate(axes):
        own = kalman_filter(augmented(transfer.direct(i).behind_high_pass(CORNER).pole_residue(), [each], STEP), 60)
        _, alone = own.run(own.init(), measured[:, i : i + 1])
        np.testing.assert_allclose(found[:, :2, i], alone[:, :2, 0], atol=1e-6 * np.abs(alone[:, 0]).max())
        np.testing.assert_allclose(smoothed[:, i], own.smooth(alone)[:, 0], atol=1e-6 * np.abs(alone[:, 0]).max())
        for given in (False, True):
            expected = own.standard_deviation(300, given, 100)[:, 0]
            np.testing.assert_allclose(together.standard_deviation(300, given, 100)[:, i], expected, rtol=1e-5)


def test_the_smoother_is_the_lagged_weights_of_all_that_comes(both, measured):
    """Force plus weights times later innovations, and the deviation that goes with them."""
    _, found = both.run(both.init(), measured)
    smoothed = both.smooth(found)
    for k in (3, 30, 200):
        weight = both.lag_weights(len(measured) - 1 - k, k)
        expected = found[k, 0] + np.einsum("lfi,li->f", weight, found[k + 1 :, 2])
        np.testing.assert_allclose(smoothed[k], expected, rtol=1e-8, atol=1e-9)
    live, given = both.standard_deviation(400), both.standard_deviation(400, smoothed=True)
    assert np.all(given <= live)
    np.testing.assert_allclose(given[-1], live[-1])


def test_response_and_state_space_are_one(both, measured):
    omega = 2.0 * np.pi * np.array([450.0, 900.0, 2600.0])
    system = both.state_space()
    values = system.response(omega)
    np.testing.assert_allclose(np.hstack(both.response(omega)), values, rtol=1e-7)
    # with all that comes, the estimate of a walk has neither lag nor loss
    there = sampled_response(
        PoleResidue(both.model.decay[:5], both.model.observed[:, :5] / 2.0, both.model.inputs, both.model.through), omega
    )
    around = both.response(omega, 2000)[0] @ there
    assert np.max(np.abs(around - np.eye(2))) < np.max(np.abs(both.response(omega)[0] @ there - np.eye(2)))


def test_a_measurement_without_noise_is_refused(transfer):
    with pytest.raises(InputError, match="noise"):
        augmented(transfer.behind_high_pass(CORNER), [AxisNoise(FORCES[0], 0.0), AxisNoise(FORCES[1], 1e-9)], STEP)


def test_margins_are_those_of_one_axis(both):
    with pytest.raises(InputError, match="2 measurements that feel each other"):
        observer_margins(both)
