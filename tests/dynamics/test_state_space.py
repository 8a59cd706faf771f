"""State space: response, and the way through python-control, whose sampling is held against closed forms and a fine integration."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.integrate
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.state_space import StateSpace

OSCILLATOR = StateSpace([[0.0, 1.0], [-400.0, -2.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])


def random_system(seed, order=5, inputs=2, outputs=2):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(order, order))
    a -= (np.linalg.eigvals(a).real.max() + 0.3) * np.eye(order)
    return StateSpace(a, rng.normal(size=(order, inputs)), rng.normal(size=(outputs, order)), rng.normal(size=(outputs, inputs)))


def sampled(system, step, hold):
    """The system between samples, through python-control."""
    return StateSpace.from_control(system.to_control().sample(step, hold))


def test_response_of_an_oscillator():
    omega = np.array([1.0, 20.0, 55.0])
    np.testing.assert_allclose(OSCILLATOR.response(omega)[:, 0, 0], 1.0 / (400.0 - omega**2 + 2.0j * omega), rtol=1e-12)


def march(system, signal):
    x, result = np.zeros(system.order), []
    for u in signal:
        result.append(system.C @ x + system.D @ u)
        x = system.A @ x + system.B @ u
    return np.array(result)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("seed", [0, 1])
def test_sampling_is_exact_for_its_hold(hold, seed):
    """Against an adaptive integration with the input held as promised."""
    system, step, rng = random_system(seed), 0.2, np.random.default_rng(seed)
    signal = np.vstack([np.zeros((1, 2)), rng.normal(size=(12, 2))])
    x, expected = np.zeros(system.order), []
    for k, u in enumerate(signal):
        expected.append(system.C @ x + system.D @ u)
        after = signal[k + 1] if k + 1 < len(signal) else u

        def slope(t, state, u=u, after=after):
            value = u if hold == "zoh" else u + (after - u) * t / step
            return system.A @ state + system.B @ value

        x = scipy.integrate.solve_ivp(slope, (0.0, step), x, rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(march(sampled(system, step, hold), signal), expected, rtol=1e-8, atol=1e-9)


def test_first_order_hold_converges_twice_as_fast():
    """Error of the response at a fixed frequency: order 1 in the step for a held input (its delay), 2 for a ramp."""
    omega = np.array([13.0])
    true = OSCILLATOR.response(omega)
    for hold, order in (("zoh", 1), ("foh", 2)):
        error = [abs((sampled(OSCILLATOR, step, hold).response(omega) / true - 1.0).item()) for step in (4e-3, 2e-3)]
        assert np.log2(error[0] / error[1]) == pytest.approx(order, abs=0.05)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 8), st.sampled_from(["zoh", "foh"]))
def test_sampling_maps_poles_and_keeps_stability_and_the_static_gain(seed, order, hold):
    system = random_system(seed, order)
    found = sampled(system, 0.1, hold)
    np.testing.assert_allclose(np.sort_complex(found.pole), np.sort_complex(np.exp(0.1 * system.pole)), rtol=1e-6, atol=1e-9)
    assert found.stable
    assert system.stable
    static = system.D - system.C @ np.linalg.solve(system.A, system.B)
    np.testing.assert_allclose(found.response(np.zeros(1))[0].real, static, rtol=1e-7, atol=1e-7 * np.abs(static).max())


def test_python_control_there_and_back():
    other = OSCILLATOR.to_control(["tip.x"], ["tip.x"])
    held = other.sample(0.02)
    transfer = control.tf([2.0], [1.0, 2.0, 400.0])
    omega = np.array([3.0, 19.0])
    np.testing.assert_allclose(np.squeeze(other(1j * omega)), OSCILLATOR.response(omega)[:, 0, 0], rtol=1e-12)
    assert other.input_labels == other.output_labels == ["tip_x"]
    assert other.isctime(strict=True)
    back, again = StateSpace.from_control(other), StateSpace.from_control(held)
    assert (back.step, again.step, again.to_control().dt) == (0.0, 0.02, 0.02)
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(back, name), getattr(OSCILLATOR, name))
        np.testing.assert_array_equal(getattr(again.to_control(), name), getattr(held, name))
    np.testing.assert_allclose(StateSpace.from_control(transfer).response(omega), 2.0 * OSCILLATOR.response(omega), rtol=1e-12)
    with pytest.raises(InputError, match="time between samples"):
        StateSpace.from_control(control.ss(0.5, 1.0, 1.0, 0.0, True))


def test_shapes_are_checked():
    with pytest.raises(InputError, match="state space B"):
        StateSpace(np.eye(2), np.ones((3, 1)), np.ones((1, 2)), np.zeros((1, 1)))
