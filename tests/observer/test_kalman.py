"""Filter, fixed lag and smoother against filterpy and against the joint Gaussian of all states; laws that hold for all inputs."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.linalg
from filterpy.kalman import KalmanFilter as Plain
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.observer.force_model import AxisNoise, RandomWalk, TeethResonators, augmented
from rcsa_ident.observer.kalman import kalman_filter, riccati
from rcsa_ident.observer.transfer_function import SampledModes

STEP = 1e-3
PLANT = SampledModes(np.array([0.93 * np.exp(0.5j), 0.9 * np.exp(1.2j), 0.6]), np.array([2e-8 - 5e-8j, 1e-8 + 2e-8j, 1.5e-8]), 1e-8, STEP)
SHAKEN = SampledModes(np.array([0.9 * np.exp(0.3j)]), np.array([1e-9 - 2e-9j]), 1e-10, STEP)
WALK = RandomWalk(40.0, 30.0)
COMB = TeethResonators(WALK, np.array([200.0, 400.0]), np.array([90.0, 40.0]))


def model(force=COMB, **options):
    settings = {"acceleration": SHAKEN, "acceleration_noise": 3.0, "disturbance": [90.0], "disturbance_intensity": 2e-6}
    return one_axis(PLANT, AxisNoise(force, 5e-8, **(settings | options)))


def one_axis(plant, axis):
    return augmented(plant.pole_residue(), [axis], STEP)


def dense(model):
    """A, H, the force's row and Q of one axis."""
    a, (seen,), (force,), q = model.matrices()
    return a, seen, force, q


def run(kalman, measured, state=None):
    """The state after samples of one axis, and force, its walking part and innovation at them, shape (n, 3)."""
    state, result = kalman.run(kalman.init() if state is None else state, measured[:, None])
    return state, result[:, :, 0]


def smooth(kalman, result):
    return kalman.smooth(result[:, :, None])[:, 0]


def lagged(kalman, result, lag):
    """The force given `lag` samples more, shape (n - lag,)."""
    return result[: len(result) - lag, 0] + np.correlate(result[1:, 2], kalman.lag_weights(lag)[:, 0, 0])


def deviations(kalman, *settings, **options):
    return kalman.standard_deviation(*settings, **options)[:, 0]


@pytest.fixture(scope="module")
def kalman():
    return kalman_filter(model(), longest_settling=1000)


@pytest.fixture(scope="module")
def measured():
    """Of a force that the model does not know, 2200 samples."""
    rng, t = np.random.default_rng(3), np.arange(2200) * STEP
    force = 60.0 * (np.sin(200.0 * t) > 0.3) + 10.0 * np.sin(333.0 * t)
    return PLANT.run(PLANT.init(), force)[1] + 5e-8 * rng.normal(size=2200)


def plain_filter(kalman, measured):
    """A plain filterpy filter and its full record."""
    a, seen, force, q = dense(kalman.model)
    plain = Plain(dim_x=a.shape[0], dim_z=1)
    plain.F, plain.H, plain.Q, plain.R, plain.P = a, seen[None], q, np.eye(1), kalman.model.first_covariance()
    means, covariances, _, _ = plain.batch_filter(measured / kalman.model.noise[0])
    return plain, force, means, covariances


def test_what_nobody_has_measured_is_predicted(kalman, measured):
    """Powers of the transition matrix on the state, and nothing else."""
    state = run(kalman, measured)[0]
    a, _, force, _ = dense(kalman.model)
    x, expected = state.modes.T.ravel()[kalman.model.live], []
    for _ in range(50):
        x = a @ x
        expected.append(force @ x)
    after, found = kalman.predict(state, 50)
    np.testing.assert_allclose(found[:, 0, 0], expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_array_equal(found[:, 2], 0.0)
    np.testing.assert_allclose(after.modes.T.ravel()[kalman.model.live], x, atol=1e-9 * np.abs(x).max())
    assert after.count == state.count + 50


def test_agrees_with_filterpy(kalman, measured):
    """Through the settling phase and, with the gain that it leads to, for ever after."""
    _, force, means, covariances = plain_filter(kalman, measured)
    assert 100 < kalman.gain.shape[0] < 1000
    found = run(kalman, measured)[1][:, 0]
    size = np.abs(found).max()
    settled = kalman.gain.shape[0] - 1
    np.testing.assert_allclose(found[:settled], means[:settled, :, 0] @ force, atol=1e-9 * size)
    # the last gains differ by a millionth
    np.testing.assert_allclose(found, means[:, :, 0] @ force, atol=2e-6 * size)
    variance = np.einsum("i,nij,j->n", force, covariances, force)
    np.testing.assert_allclose(deviations(kalman, 2200) ** 2, variance, rtol=3e-5)


def test_steady_state_agrees_with_filterpys(kalman, measured):
    a, seen, force, _ = dense(kalman.model)
    plain = Plain(dim_x=a.shape[0], dim_z=1)
    plain.F, plain.H = a, seen[None]
    gain = kalman.gain[-1, 0].T.ravel()[kalman.model.live] * kalman.model.noise
    plain.K = gain[:, None]
    steady = kalman_filter(kalman.model, longest_settling=0)
    np.testing.assert_array_equal(steady.gain[-1], kalman.gain[-1])
    found = run(steady, measured)[1]
    for k, z in enumerate(measured / kalman.model.noise):
        plain.predict_steadystate()
        plain.update_steadystate(np.array([[z]]))
        assert found[k, 0] == pytest.approx(force @ plain.x[:, 0], abs=1e-9 * np.abs(found[:, 0]).max())


def test_smoother_agrees_with_filterpys(kalman, measured):
    plain, force, means, covariances = plain_filter(kalman, measured)
    theirs, spread, _, _ = plain.rts_smoother(means, covariances)
    result = run(kalman, measured)[1]
    found = smooth(kalman, result)
    # its inverse of the predicted covariance has no digits left while the plant is still at rest; the next test covers that
    later = slice(20, None)
    np.testing.assert_allclose(found[later], theirs[later, :, 0] @ force, atol=1e-5 * np.abs(found).max())
    variance = np.einsum("i,nij,j->n", force, spread, force)
    np.testing.assert_allclose(deviations(kalman, 2200, smoothed=True)[later], np.sqrt(variance[later]), rtol=1e-4)


def joint_gaussian(kalman, count):
    """Covariance of the forces and the measurements of a few samples, from the equations of motion alone."""
    a, seen, force, q = dense(kalman.model)
    n = a.shape[0]
    # x_k = sum over first state and all later noises, written out
    states, spread = np.zeros((count, n, (count + 1) * n)), scipy.linalg.block_diag(kalman.model.first_covariance(), *[q] * count)
    now = np.hstack([np.eye(n), np.zeros((n, count * n))])
    for k in range(count):
        now = a @ now
        now[:, (k + 1) * n : (k + 2) * n] += np.eye(n)
        states[k] = now
    f, z = states.transpose(0, 2, 1) @ force, states.transpose(0, 2, 1) @ seen
    return f @ spread @ f.T, f @ spread @ z.T, z @ spread @ z.T + np.eye(count)


def test_filter_lag_and_smoother_are_conditional_means(measured):
    """No recursion at all: the Gaussian of 25 forces and measurements, conditioned."""
    count, lag = 25, 6
    kalman, measured = kalman_filter(model(), longest_settling=40), measured[10 : 10 + count]
    own, both, seen = joint_gaussian(kalman, count)
    z = measured / kalman.model.noise
    result = run(kalman, measured)[1]
    smoothed = smooth(kalman, result)
    deviation, given_all = deviations(kalman, count), deviations(kalman, count, smoothed=True)
    size = np.abs(result[:, 0]).max()
    for k in range(count):
        for known, value, std in ((k + 1, result[k, 0], deviation[k]), (count, smoothed[k], given_all[k])):
            weight = np.linalg.solve(seen[:known, :known], both[k, :known])
            assert value == pytest.approx(weight @ z[:known], abs=1e-7 * size)
            assert std**2 == pytest.approx(own[k, k] - weight @ both[k, :known], rel=1e-6)
    for k in (0, 3, 10):
        weight = np.linalg.solve(seen[: k + lag + 1, : k + lag + 1], both[k, : k + lag + 1])
        later = kalman.lag_weights(lag, k)[:, 0, 0] @ result[k + 1 : k + lag + 1, 2]
        assert result[k, 0] + later == pytest.approx(weight @ z[: k + lag + 1], abs=1e-7 * size)


def test_variance_is_that_of_the_error():
    """Forces drawn from the model itself: errors as large as told, live and smoothed."""
    kalman, rng = kalman_filter(model(), longest_settling=300), np.random.default_rng(5)
    a, seen, force, q = dense(kalman.model)
    root = np.linalg.cholesky(q + 1e-14 * np.diag(np.diag(q) + 1e-6))
    errors = []
    for _ in range(30):
        x, f, z = np.zeros(a.shape[0]), [], []
        for _ in range(700):
            x = a @ x + root @ rng.normal(size=x.size)
            f.append(force @ x)
            z.append((seen @ x + rng.normal()) * kalman.model.noise[0])
        result = run(kalman, np.array(z))[1]
        errors.append([result[:, 0] - f, smooth(kalman, result) - f])
    scatter = np.sqrt(np.mean(np.array(errors)[:, :, 350:650] ** 2, axis=(0, 2)))
    told = [deviations(kalman, 700, smoothed)[500] for smoothed in (False, True)]
    np.testing.assert_allclose(scatter, told, rtol=0.08)
    assert told[1] < 0.9 * told[0]


def test_a_band_looks_as_far_ahead_as_it_is_told(kalman):
    """Who has more samples behind him than that has the band of the last one who has as many."""
    settled, longest = kalman.gain.shape[0], 100
    near, far = (deviations(kalman, settled + 300, True, **told) for told in ({"longest": longest}, {}))
    np.testing.assert_allclose(near[-longest - 1 :], far[-longest - 1 :], rtol=1e-12)
    np.testing.assert_array_equal(near[settled : -longest - 1], near[-longest - 1])


def test_a_long_lag_is_the_smoother(kalman, measured):
    settled = kalman.gain.shape[0]
    result = run(kalman, measured)[1]
    found = lagged(kalman, result, 900)
    np.testing.assert_allclose(found[settled:], smooth(kalman, result)[settled:-900], atol=2e-3 * np.abs(result[:, 0]).max())


@settings(max_examples=15, deadline=None)
@given(st.lists(st.integers(0, 600), max_size=6), st.integers(0, 2**31))
def test_any_blocks_give_the_same(cuts, seed):
    kalman = kalman_filter(model(), longest_settling=50)
    signal = 1e-6 * np.random.default_rng(seed).normal(size=600)
    state, parts = kalman.init(), []
    for block in np.split(signal, sorted(cuts)):
        state, part = run(kalman, block, state)
        parts.append(part)
    whole_state, whole = run(kalman, signal)
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    np.testing.assert_array_equal(state.modes, whole_state.modes)
    assert state.count == 600


@settings(max_examples=15, deadline=None)
@given(st.floats(-5.0, 5.0), st.integers(0, 2**31))
def test_superposition(factor, seed):
    kalman = kalman_filter(model(), longest_settling=30)
    one, two = 1e-6 * np.random.default_rng(seed).normal(size=(2, 200))

    def estimates(signal):
        result = run(kalman, signal)[1]
        return np.stack([result[:, 0], smooth(kalman, result)])

    expected = factor * estimates(one) + estimates(two)
    np.testing.assert_allclose(estimates(factor * one + two), expected, atol=1e-8 * np.abs(expected).max())


@settings(max_examples=40, deadline=None)
@given(
    st.floats(1.0, 1e4),
    st.floats(0.1, 300.0),
    st.lists(st.floats(20.0, 3000.0), min_size=1, max_size=4, unique=True),
    st.floats(1e-8, 1e-6),
)
def test_the_errors_dynamics_are_stable_and_the_riccati_equation_holds(intensity, leak, omega, noise):
    omega = np.array(sorted(omega))
    if np.any(np.diff(omega) < 5.0):
        omega = omega[:1]
    force = TeethResonators(RandomWalk(intensity, leak), omega, np.full(omega.size, 0.3 * intensity))
    kalman = kalman_filter(one_axis(PLANT, AxisNoise(force, noise)), longest_settling=0)
    assert kalman.state_space().stable
    a, seen, row, q = dense(kalman.model)
    predicted = riccati(a, seen[None], q)
    gain = predicted @ seen / (seen @ predicted @ seen + 1.0)
    again = a @ (predicted - np.outer(gain, seen @ predicted)) @ a.T + q
    size = np.sqrt(np.diag(predicted))
    np.testing.assert_allclose(again / np.outer(size, size), predicted / np.outer(size, size), atol=1e-6)
    assert 0.0 < kalman.force_variance[-1, 0] <= row @ predicted @ row * (1.0 + 1e-9)


def test_the_accelerometers_noise_reaches_the_measurement_through_its_filter():
    """Stationary variance of what it adds, against the filter's impulse response."""
    a, seen, _, q = dense(model())
    own = slice(10, 12)
    covariance = scipy.linalg.solve_discrete_lyapunov(a[own, own], q[own, own])
    found = seen[own] @ covariance @ seen[own] * model().noise[0] ** 2
    # the part that passes at once is white: it is in the measurement's noise
    later = SHAKEN.run(SHAKEN.init(), np.eye(1, 2000)[0])[1][1:]
    assert found == pytest.approx(3.0**2 * np.sum(later**2), rel=1e-9, abs=0.0)
    assert model().noise[0] == pytest.approx(np.hypot(5e-8, 3.0 * SHAKEN.through), rel=1e-12, abs=0.0)


def test_riccati_agrees_with_scipy():
    a, seen, _, q = dense(model())
    other = scipy.linalg.solve_discrete_are(a.T, seen[:, None], q, np.eye(1))
    np.testing.assert_allclose(riccati(a, seen[None], q), other, rtol=1e-5, atol=1e-9 * np.abs(other).max())


def test_a_force_that_the_displacement_does_not_show_is_refused():
    """A plant without static response and a walk that never forgets."""
    blind = SampledModes(np.array([0.5]), np.array([0.0]), 0.0, STEP)
    with pytest.raises(InputError, match="force model"):
        kalman_filter(one_axis(blind, AxisNoise(RandomWalk(10.0), 1e-8)))


def test_exported_in_the_steady_state(measured):
    """As state space, in frequency and in time, and as python-control's system."""
    kalman = kalman_filter(model(), longest_settling=0)
    system = kalman.state_space()
    omega = np.linspace(10.0, 3000.0, 50)
    np.testing.assert_allclose(system.response(omega)[:, :, 0].T, [each[:, 0, 0] for each in kalman.response(omega)], rtol=1e-9, atol=1e-9)
    found = control.forced_response(system.to_control(), inputs=measured).outputs
    force, _, innovation = run(kalman, measured)[1].T
    np.testing.assert_allclose(found[0], force, atol=1e-9 * np.abs(force).max())
    np.testing.assert_allclose(found[1], innovation, atol=1e-9 * np.abs(innovation).max())
    np.testing.assert_allclose(PLANT.state_space().response(omega)[:, 0, 0], PLANT.response(omega), rtol=1e-12)


@pytest.mark.parametrize("lag", [0, 5, 400])
def test_frequency_response_is_what_a_sine_does(kalman, lag):
    """Long after the start, amplitude and phase of the estimate; with a lag, the delay taken out."""
    steady = kalman_filter(kalman.model, longest_settling=0)
    omega = 2.0 * np.pi * np.array([12.0, 31.8, 77.0, 150.0, 321.0])
    response, innovation = (each[:, 0, 0] for each in steady.response(omega, lag))
    t = np.arange(12000) * STEP
    for k, w in enumerate(omega):
        columns = np.stack([np.cos(w * t), -np.sin(w * t)], axis=1)[8000:11000]
        result = run(steady, 1e-6 * np.cos(w * t))[1]
        force = lagged(steady, result, lag) if lag else result[:, 0]
        for series, value in ((force[8000:11000], response[k]), (result[8000:11000, 2], innovation[k])):
            cosine, sine = np.linalg.lstsq(columns, series, rcond=None)[0]
            assert complex(cosine, sine) == pytest.approx(1e-6 * value, rel=1e-4, abs=1e-9 * abs(1e-6 * response[k]) + 1e-14)


def test_an_oscillator_is_right_at_its_own_frequency(kalman):
    """Whatever the covariances: what is undamped has an infinite gain of the innovations, so the compensated response is 1."""
    steady = kalman_filter(model(disturbance=()), longest_settling=0)
    compensated = steady.response(COMB.omega)[0][:, 0, 0] * PLANT.response(COMB.omega)
    np.testing.assert_allclose(compensated, 1.0, atol=1e-6)
    between = np.array([300.0])
    assert abs(steady.response(between)[0][:, 0, 0] * PLANT.response(between) - 1.0) > 1e-3


def test_settings_are_checked():
    for wrong in (lambda: RandomWalk(0.0), lambda: RandomWalk(1.0, -1.0), lambda: TeethResonators(WALK, np.array([-1.0]), np.array([1.0]))):
        with pytest.raises(InputError):
            wrong()
    with pytest.raises(InputError, match="half the sampling rate"):
        one_axis(PLANT, AxisNoise(TeethResonators(WALK, np.array([4000.0]), np.array([1.0])), 1e-8))
    with pytest.raises(InputError, match="noise"):
        one_axis(PLANT, AxisNoise(WALK, 0.0))
