"""Cutting coefficients from forces: forces of another route (time histories), a tool that wears, coefficients that hide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_history
from rcsa_ident.observer.wear import wear_indicators

STEP = 1.0 / 25600.0
CUTTER = Cutter(2, 0.012, np.radians(30.0))
CONDITIONS = CuttingConditions(12000.0 * np.pi / 30.0 * 1.00037, 1e-3, 0.15e-3, Engagement.from_immersion(0.5, "down"), feed_angle=0.4)
SHARP = CuttingCoefficients(900e6, 0.3, tangential_edge=12e3, radial_edge=20e3)
TRUE = np.array([900e6, 270e6, 12e3, 20e3])
BAND = (2.0 * np.pi * 370.0, 2.0 * np.pi * 4300.0)
ANGLE = 0.7


def forces(coefficients=SHARP, count=6000, conditions=CONDITIONS, cutter=CUTTER, oversampling=8):
    """Without mean, below 8 kHz, from histories in time."""
    turn = np.arange(oversampling * count) * (conditions.spindle_speed * STEP / oversampling) + ANGLE
    fine = force_history(cutter, conditions, coefficients, turn, slices=32)[:, :2]
    low = sosfiltfilt(butter(8, 8000.0, fs=oversampling / STEP, output="sos"), fine, axis=0)[::oversampling]
    return low - low.mean(axis=0)


@pytest.fixture(scope="module")
def steady():
    return forces()


@pytest.mark.slow
def test_coefficients_and_angle_come_back(steady):
    found = wear_indicators(steady[200:], STEP, CUTTER, CONDITIONS, BAND, first=200)
    assert found.names == ("K_tc", "K_rc", "K_te", "K_re")
    assert found.separable
    assert found.angle == pytest.approx(ANGLE, abs=2e-3)
    np.testing.assert_allclose(found.coefficient.mean(axis=0), TRUE, rtol=0.03)
    assert found.misfit < 0.01
    assert found.time.size == int((6000 - 200) * STEP * CONDITIONS.spindle_speed / (2.0 * np.pi))


@pytest.mark.slow
def test_bands_tell_the_scatter_of_noise(steady):
    rng = np.random.default_rng(2)
    noisy = steady + 2.0 * rng.normal(size=steady.shape)
    found = wear_indicators(noisy[200:], STEP, CUTTER, CONDITIONS, BAND, first=200)
    scatter = np.std(found.coefficient, axis=0)
    np.testing.assert_allclose(np.median(found.standard_deviation, axis=0), scatter, rtol=0.35)
    # a slow walk knows more than one revolution
    assert np.all(found.tracked_deviation[20] < 0.8 * scatter)
    assert np.all(np.abs(found.tracked.mean(axis=0) - found.coefficient.mean(axis=0)) < scatter)


@pytest.mark.slow
def test_a_dulling_edge_shows_in_the_edge_coefficients():
    """K_te and K_re grow steadily, K_tc stays: the trend says so, and by how much."""
    sharp = forces()
    dull = forces(replace(SHARP, tangential_edge=24e3, radial_edge=50e3))
    share = (np.arange(6000) * STEP)[:, None] / (6000 * STEP)
    worn = (1.0 - share) * sharp + share * dull + 0.5 * np.random.default_rng(3).normal(size=sharp.shape)
    slope, std = wear_indicators(worn[200:], STEP, CUTTER, CONDITIONS, BAND, first=200).trend()
    per_second = 1.0 / (6000 * STEP)
    assert slope[2] == pytest.approx(12e3 * per_second, abs=4.0 * std[2] + 0.05 * 12e3 * per_second)
    assert slope[3] == pytest.approx(30e3 * per_second, abs=4.0 * std[3] + 0.05 * 30e3 * per_second)
    assert abs(slope[0]) < 4.0 * std[0] + 0.02 * 900e6 * per_second
    assert slope[3] > 5.0 * std[3]


@pytest.mark.slow
def test_one_harmonic_does_not_tell_four_coefficients(steady):
    narrow = wear_indicators(steady, STEP, CUTTER, CONDITIONS, (2.0 * np.pi * 370.0, 2.0 * np.pi * 500.0), angle=ANGLE)
    assert narrow.condition > wear_indicators(steady, STEP, CUTTER, CONDITIONS, BAND).condition
    # where all chips are nearly as thick as the feed is long, shearing and rubbing look alike
    thick = replace(CONDITIONS, engagement=Engagement(np.radians(86.0), np.radians(94.0)))
    straight = Cutter(2, 0.012)
    turn = np.arange(6000) * thick.spindle_speed * STEP + ANGLE
    force = force_history(straight, thick, CuttingCoefficients(900e6, 0.3), turn, slices=1)[:, :2]
    assert not wear_indicators(force, STEP, straight, thick, BAND, angle=ANGLE).separable
    apart = wear_indicators(force, STEP, straight, thick, BAND, angle=ANGLE, edges=False)
    assert apart.names == ("K_tc", "K_rc")
    assert apart.separable
    np.testing.assert_allclose(apart.coefficient.mean(axis=0), [900e6, 270e6], rtol=0.1)


@pytest.mark.slow
def test_linear_in_the_force(steady):
    one = wear_indicators(steady, STEP, CUTTER, CONDITIONS, BAND, angle=ANGLE)
    three = wear_indicators(3.0 * steady, STEP, CUTTER, CONDITIONS, BAND, angle=ANGLE)
    np.testing.assert_allclose(three.coefficient, 3.0 * one.coefficient, rtol=1e-9)
    np.testing.assert_allclose(three.standard_deviation, 3.0 * one.standard_deviation, rtol=1e-6)
    # the mean is not looked at
    lifted = wear_indicators(steady + np.array([100.0, -50.0]), STEP, CUTTER, CONDITIONS, BAND, angle=ANGLE)
    np.testing.assert_allclose(lifted.coefficient, one.coefficient, rtol=1e-6)


@pytest.mark.slow
def test_what_is_not_enough_is_refused(steady):
    with pytest.raises(InputError, match="revolutions"):
        wear_indicators(steady[:150], STEP, CUTTER, CONDITIONS, BAND)
    with pytest.raises(InputError, match="band"):
        wear_indicators(steady, STEP, CUTTER, CONDITIONS, (10.0, 20.0))
    with pytest.raises(InputError, match="two columns"):
        wear_indicators(steady[:, :1], STEP, CUTTER, CONDITIONS, BAND)
