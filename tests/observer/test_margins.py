"""Margins against closed forms, against the poles of the loop that they promise, and against the Riccati equation's own bound."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.observer.force_model import AxisNoise, RandomWalk, TeethResonators
from rcsa_ident.observer.kalman import kalman_filter
from rcsa_ident.observer.margins import loop_margins, observer_margins
from rcsa_ident.observer.tuning import PaperWalk, Resonators
from tests.observer.test_force import monitored
from tests.observer.test_kalman import COMB, PLANT, STEP, WALK, dense, model, one_axis


@pytest.mark.parametrize(("a", "b"), [(0.9, 0.6), (0.5, 1.2), (1.0, 0.1)])
def test_one_pole(a, b):
    """L = b / (z - a), S = (z - a) / (z - a + b): all of it in closed form, and the delay of an integrator."""
    found = loop_margins(StateSpace([[a]], [[b]], [[1.0]], [[0.0]], STEP))
    # z = -1 is where the loop is real and negative
    assert found.gain_increase == pytest.approx((1.0 + a) / b, rel=1e-9)
    assert found.gain_decrease == 0.0
    assert found.sensitivity_peak == pytest.approx((1.0 + a) / (1.0 + a - b), rel=1e-9)
    assert found.peak_frequency == pytest.approx(np.pi / STEP)
    assert found.disk == pytest.approx(2.0 * (1.0 + a - b) / (1.0 + a + b), rel=1e-9)
    # |z - a| = b
    turn = np.arccos((1.0 + a**2 - b**2) / (2.0 * a))
    phase = np.angle(-b / (np.exp(1j * turn) - a))
    assert found.phase == pytest.approx(phase, rel=1e-4)
    assert found.delay == pytest.approx(phase / turn * STEP, rel=1e-4)
    if a == 1.0:
        # k samples late an integrator is stable for b < 2 sin(pi / (4 k + 2))
        assert b == pytest.approx(2.0 * np.sin(np.pi / (4.0 * found.delay / STEP + 2.0)), rel=1e-4)


@pytest.mark.parametrize(
    "force", [WALK, COMB, TeethResonators(RandomWalk(40.0), np.array([150.0, 300.0, 450.0]), np.array([200.0, 90.0, 5.0]))]
)
def test_what_the_margins_promise_holds_for_the_poles(force):
    kalman = kalman_filter(model(force), longest_settling=0)
    loop, found = kalman.loop(), observer_margins(kalman)
    assert found.gain_decrease < 1.0 < found.gain_increase < np.inf

    def largest(factor):
        return np.max(np.abs(np.linalg.eigvals(loop.A - factor * loop.B @ loop.C)))

    for factor in (found.gain_decrease, found.gain_increase):
        if factor > 0.0:
            assert largest(factor) == pytest.approx(1.0, abs=1e-7)
    inside = np.geomspace(max(found.gain_decrease, 1e-3) * 1.001, found.gain_increase * 0.999, 20)
    assert all(largest(factor) < 1.0 for factor in inside)
    # the sensitivity is what the filter itself answers, and its peak the largest of it
    omega = np.linspace(1e-3, np.pi, 20_001) / STEP
    sensitivity = kalman.response(omega)[1][:, 0, 0]
    np.testing.assert_allclose(1.0 / (1.0 + loop.response(omega[::100])[:, 0, 0]), sensitivity[::100], rtol=1e-8)
    assert found.sensitivity_peak == pytest.approx(np.max(np.abs(sensitivity)), rel=1e-3)
    assert found.disk == pytest.approx(1.0 / np.max(np.abs(sensitivity - 0.5)), rel=1e-3)
    # the circles that belong to the peak and to the disk lie inside the margins
    assert found.gain_increase >= 1.0 / (1.0 - 1.0 / found.sensitivity_peak) * (1.0 - 1e-9)
    assert found.gain_increase >= (2.0 + found.disk) / (2.0 - found.disk) * (1.0 - 1e-9)
    assert found.phase >= 2.0 * np.arcsin(0.5 / found.sensitivity_peak) * (1.0 - 1e-4)


@pytest.mark.parametrize("force", [WALK, COMB])
def test_the_riccati_equation_bounds_the_peak(force):
    """(1 + L)(1 + L*) = (R + H Phi Q Phi* H*) / V: the return difference; where no process noise is seen the peak is sqrt(V / R)."""
    kalman = kalman_filter(one_axis(PLANT, AxisNoise(force, 5e-8)), longest_settling=0)
    a, seen, _, q = dense(kalman.model)
    omega = np.linspace(7.0, np.pi / STEP, 60)
    z = np.exp(1j * omega * STEP)
    through = np.array([np.linalg.solve((each * np.eye(len(a)) - a).T, seen) for each in z])
    noise = np.einsum("ni,ij,nj->n", through, q, through.conj()).real
    expected = (1.0 + noise) / (kalman.variance[-1, 0, 0] / kalman.model.noise[0] ** 2)
    np.testing.assert_allclose(np.abs(1.0 + kalman.loop().response(omega)[:, 0, 0]) ** 2, expected, rtol=1e-6)
    found = observer_margins(kalman)
    assert found.sensitivity_peak <= np.sqrt(kalman.variance[-1, 0, 0]) / kalman.model.noise[0] * (1.0 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "peak"), [(Resonators(), 3.63), (PaperWalk(), 8.89)])
def test_of_a_whole_observer(method, peak):
    """65 states, half of them oscillators without damping, at 25 600 samples a second; and the published walk, whose peak is the bound."""
    kalman = monitored(method).observer.filters[0]
    loop, found, bound = kalman.loop(), observer_margins(kalman), np.sqrt(kalman.variance[-1, 0, 0]) / kalman.model.noise[0]
    for factor in (found.gain_decrease, found.gain_increase):
        assert np.max(np.abs(np.linalg.eigvals(loop.A - factor * loop.B @ loop.C))) == pytest.approx(1.0, abs=1e-5)
    assert found.sensitivity_peak == pytest.approx(peak, abs=0.01)
    assert found.sensitivity_peak <= bound * (1.0 + 1e-9)
    if isinstance(method, PaperWalk):
        assert found.sensitivity_peak == pytest.approx(bound, rel=1e-6)


def test_a_loop_that_is_unstable_has_none():
    with pytest.raises(InputError, match=r"magnitude 1\.5"):
        loop_margins(StateSpace([[0.5]], [[2.0]], [[1.0]], [[0.0]], STEP))
