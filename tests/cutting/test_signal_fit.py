"""The whole-signal fit on forces sampled over the angle: an independent road to the lines that the fit uses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting import signal_fit
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_history
from rcsa_ident.cutting.force_record import ForceRecord
from rcsa_ident.cutting.signal_fit import Dynamometer, calibrate_signal, eccentric

TRUE = np.array([800e6, 240e6, 12e3, 9e3])
COEFFICIENTS = CuttingCoefficients(TRUE[0], TRUE[1] / TRUE[0], 0.0, TRUE[2], TRUE[3])
CUTTER = Cutter(4, 0.012, np.radians(30.0))
ECCENTRICITY = np.array([2.0e-6, -1.5e-6])
DOWN = Engagement(0.5 * np.pi, np.pi)
ORDERS = 33


@cache
def true_lines(cutter, feed, engagement, depth):
    """Of a sampled revolution with run-out."""
    truth = replace(cutter, runout=eccentric(cutter, ECCENTRICITY))
    angle = 2.0 * np.pi * np.arange(4096) / 4096
    force = force_history(truth, CuttingConditions(630.0, depth, feed, engagement), COEFFICIENTS, angle, slices=64)[:, :2]
    lines = np.fft.rfft(force, axis=0)[:ORDERS] / angle.size
    lines[1:] *= 2.0
    return lines


def record(
    feed, rng, noise=0.02, axes=((1, 0), (0, 1)), cutter=CUTTER, response=None, engagement=DOWN, clamping="a", scale=1.0, depth=4e-4
):
    """Lines of a sampled revolution, seen through sensors with noise; eight blocks that scatter as the noise says."""
    conditions = CuttingConditions(630.0, depth, feed, engagement)
    lines = scale * true_lines(cutter, feed, engagement, depth) @ np.array(axes, dtype=float).T
    start = 2.0 * np.pi * rng.random()
    order = np.arange(ORDERS)
    lines = lines * np.exp(1j * order * start)[:, None]
    if response is not None:
        lines = lines * response(order * conditions.spindle_speed)
    blocks = noise * np.sqrt(8.0) * (rng.normal(size=(8, ORDERS, 2)) + 1j * rng.normal(size=(8, ORDERS, 2)))
    blocks[:, 0] = blocks[:, 0].real
    mean = blocks.mean(axis=0)
    return ForceRecord(cutter, conditions, clamping, lines + mean, np.full((ORDERS, 2), noise**2), blocks - mean), start


def records(seed=1, feeds=(4e-5, 6e-5, 8e-5, 1e-4, 1.2e-4), **options):
    rng = np.random.default_rng(seed)
    made = [record(feed, rng, **options) for feed in feeds]
    return [m[0] for m in made], np.array([m[1] for m in made])


@pytest.mark.slow
def test_everything_comes_back():
    """Coefficients within their intervals, run-out to a twentieth of a micrometre, each record's tooth angle."""
    found = calibrate_signal(*(records()[:1]))
    starts = records()[1]
    assert np.all(np.abs(found.forces.value - TRUE) < np.maximum(found.forces.half_width, 2e-3 * TRUE))
    assert np.all(found.forces.half_width < [0.01 * TRUE[0], 0.02 * TRUE[1], 0.03 * TRUE[2], 0.03 * TRUE[3]])
    assert found.forces.misfit < 0.02
    assert not found.forces.reasons
    # a whole number of teeth and the run-out's angle go together
    turn = np.angle(np.exp(1j * (found.angle - starts)))
    teeth = np.round(turn / (0.5 * np.pi))
    np.testing.assert_allclose(turn, teeth * 0.5 * np.pi, atol=2e-3)
    assert np.ptp(teeth) in (0, 4) or np.ptp(np.mod(teeth, 4)) == 0
    shifted = np.roll(eccentric(CUTTER, ECCENTRICITY), int(teeth[0]))
    np.testing.assert_allclose(found.runout["a"], shifted, atol=5e-8)


@pytest.mark.slow
def test_a_resonance_of_the_dynamometer():
    """Two different resonances are found and undone; unknown to the fit they show as a misfit that is named."""
    true = Dynamometer(2, 1900.0, 0.04)
    unknowns = np.array([0.0, 0.0, np.log(1.2), np.log(0.8)])
    made, _ = records(response=lambda omega: true.response(omega, unknowns))
    found = calibrate_signal(made, Dynamometer(2, 2200.0, 0.03))
    np.testing.assert_allclose(found.forces.value, TRUE, rtol=0.01)
    np.testing.assert_allclose(found.sensor, [[1900.0, 0.04], [2280.0, 0.032]], rtol=0.02)
    blind = calibrate_signal(made, Dynamometer())
    assert blind.forces.misfit > 0.05
    assert np.all(blind.forces.half_width >= blind.forces.misfit * np.abs(blind.forces.value))
    assert any("remains unexplained" in reason for reason in blind.forces.reasons)


@pytest.mark.slow
def test_a_resonance_is_asked_for_by_itself():
    """Where stiff sensors leave too much; where they do not, nothing is added. Tooth angles begin from told coefficients."""
    true = Dynamometer(2, 1900.0, 0.04)
    made, _ = records(response=lambda omega: true.response(omega, np.zeros(4)))
    found = calibrate_signal(made, start=0.9 * TRUE)
    np.testing.assert_allclose(found.forces.value, TRUE, rtol=0.01)
    np.testing.assert_allclose(found.sensor, [[1900.0, 0.04]] * 2, rtol=0.02)
    assert calibrate_signal(records()[0], start=0.9 * TRUE).sensor.size == 0


@pytest.mark.slow
def test_a_bandwidth():
    true = Dynamometer(1, 1500.0)
    made, _ = records(response=lambda omega: true.response(omega, np.array([0.0, 0.1])))
    found = calibrate_signal(made, Dynamometer(1, 3000.0))
    np.testing.assert_allclose(found.sensor[:, 0], [1500.0, 1500.0 * np.exp(0.1)], rtol=0.02)
    np.testing.assert_allclose(found.forces.value, TRUE, rtol=0.01)


@pytest.mark.slow
def test_the_helix():
    told = replace(CUTTER, helix=np.radians(30.0))
    made = [replace(r, cutter=replace(told, helix=np.radians(38.0))) for r in records(depth=3e-3)[0]]
    found = calibrate_signal(made, free_helix=True)
    assert np.degrees(found.helix) == pytest.approx(30.0, abs=0.5)
    np.testing.assert_allclose(found.forces.value, TRUE, rtol=0.01)
    assert calibrate_signal(made).helix is None


@pytest.mark.slow
def test_unequal_pitch_and_two_clampings():
    cutter = Cutter(3, 0.012, np.radians(30.0), np.radians([112.0, 120.0, 128.0]))
    one, _ = records(cutter=cutter, feeds=(5e-5, 8e-5))
    two, _ = records(2, cutter=cutter, feeds=(6e-5, 1e-4, 1.2e-4), clamping="b", engagement=Engagement(0.0, 1.8))
    found = calibrate_signal([*one, *two])
    assert set(found.runout) == {"a", "b"}
    np.testing.assert_allclose(found.forces.value, TRUE, rtol=0.01)


@pytest.mark.slow
def test_slopes_by_differences():
    """The whole Jacobian, priors included, against differences of the residual."""
    problem = signal_fit._Problem(records()[0][:3], Dynamometer(2, 2500.0), True, runout=True)
    problem.model_error, problem.scale = 0.01, TRUE
    rng = np.random.default_rng(3)
    theta = np.concatenate([[1.0, 0.9, 1.1, 1.0], rng.random(3), ECCENTRICITY, [0.55], 0.1 * rng.normal(size=4)])
    slope = problem.jacobian(theta)
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = 1e-9 if problem.ecc.start <= k < problem.ecc.stop else 1e-6
        numeric = (problem.residual(theta + step) - problem.residual(theta - step)) / (2.0 * step[k])
        # run-out's slopes are one-sided and bend where a tooth leaves the material
        share = 1e-3 if problem.ecc.start <= k < problem.ecc.stop else 1e-4
        np.testing.assert_allclose(slope[:, k], numeric, rtol=1e-3, atol=share * np.abs(numeric).max())


@pytest.mark.slow
def test_intervals_see_what_differs_between_cuts():
    """A cut's depth that is off by 2 % shows in no record's own noise."""
    rng = np.random.default_rng(7)
    made = [record(f, rng, scale=1.0 + 0.02 * rng.normal())[0] for f in (4e-5, 6e-5, 8e-5, 1e-4, 1.2e-4)]
    found = calibrate_signal(made)
    assert np.all(found.cut_half_width[:2] > 3.0 * found.noise_half_width[:2])
    np.testing.assert_array_equal(found.forces.half_width, np.maximum(found.cut_half_width, found.noise_half_width))
    few = calibrate_signal(made[:3])
    assert np.all(np.isinf(few.cut_half_width))
    np.testing.assert_array_equal(few.forces.half_width, few.noise_half_width)
    assert any("too few to estimate their scatter" in note for note in few.forces.notes)


@pytest.mark.slow
def test_noise_width_is_the_estimates_scatter():
    """Over seeds, with all cuts alike, estimates scatter as the records' own noise says."""
    found = [calibrate_signal(records(seed, noise=0.05, feeds=(5e-5, 8e-5, 1.1e-4))[0]) for seed in range(14)]
    scatter = np.std([f.forces.value for f in found], axis=0, ddof=1)
    width = np.mean([f.noise_half_width for f in found], axis=0) / 1.98
    np.testing.assert_allclose(scatter, width, rtol=0.5)


@pytest.mark.slow
def test_no_records():
    with pytest.raises(InputError, match="at least one record"):
        calibrate_signal([])
    made = records()[0][0]
    with pytest.raises(InputError, match="belong together"):
        replace(made, variance=made.variance[:-1])
