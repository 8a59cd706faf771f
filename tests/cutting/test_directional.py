"""Directional coefficients against sums over angles and the derivative of the force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.directional import mean_directional_matrix
from rcsa_ident.cutting.force import force_lines, tooth_force
from tests.oracles import naive

angles = st.tuples(st.floats(0.0, 3.1), st.floats(0.02, 3.1)).map(lambda p: Engagement(p[0], min(np.pi, p[0] + p[1])))


@settings(max_examples=20, deadline=None)
@given(engagement=angles, ratio=st.floats(-0.5, 2.0), teeth=st.integers(1, 8), feed=st.floats(-4.0, 4.0))
def test_mean_over_a_revolution(engagement, ratio, teeth, feed):
    found = mean_directional_matrix(teeth, engagement, CuttingCoefficients(1e9, ratio), feed)
    expected = naive.mean_directional_matrix(teeth, engagement.entry, engagement.exit, ratio, feed, samples=1500)
    np.testing.assert_allclose(found, expected, atol=1e-6 * teeth)


def test_slotting_by_hand():
    """N/4 [[-k, -1], [1, -k]]: feed and normal alike."""
    found = mean_directional_matrix(4, Engagement(0.0, np.pi), CuttingCoefficients(1e9, 0.3))
    np.testing.assert_allclose(found, [[-0.3, -1.0], [1.0, -0.3]], atol=1e-14)


@pytest.mark.parametrize("phi", [0.1, 1.0, 2.0, 3.0])
def test_derivative_of_the_force(phi):
    """A displacement X thickens the chip by X sin(phi) + Y cos(phi): F = K_tc [alpha] X."""
    coefficients = CuttingCoefficients(8e8, 0.27, 0.1, 2e4, 3e4)
    alpha = naive.directional_matrix(phi, 0.27)
    for move in (np.array([1e-6, 0.0]), np.array([0.0, 1e-6])):
        chips = 1e-4 + np.array([0.0, move @ [np.sin(phi), np.cos(phi)]])
        force = tooth_force(np.full(2, phi), chips, coefficients)[:, :2]
        np.testing.assert_allclose(force[1] - force[0], 8e8 * alpha @ move, rtol=1e-9)


@settings(max_examples=20, deadline=None)
@given(engagement=angles, ratio=st.floats(0.0, 1.0), feed=st.floats(-4.0, 4.0))
def test_mean_force_is_the_feed_times_the_matrix(engagement, ratio, feed):
    """The static chip is the regeneration of a tool displaced by one feed per tooth: F0 = a K_tc [alpha0] {h0, 0}."""
    coefficients = CuttingCoefficients(8e8, ratio)
    conditions = CuttingConditions(800.0, 1e-3, 1e-4, engagement, feed)
    mean = force_lines(Cutter(3, 0.012), conditions, coefficients, np.array([0]))[0]
    alpha = mean_directional_matrix(3, engagement, coefficients, feed)
    direction = np.array([np.cos(feed), np.sin(feed)])
    np.testing.assert_allclose(mean, 1e-3 * 8e8 * alpha @ direction * 1e-4, rtol=1e-9, atol=1e-9)


def test_engagement_of_up_and_down():
    down = Engagement.from_immersion(0.5, "down")
    assert (down.entry, down.exit) == (pytest.approx(np.pi / 2), pytest.approx(np.pi))
    for immersion in (0.05, 0.3, 1.0):
        up, down = (Engagement.from_immersion(immersion, s) for s in ("up", "down"))
        # the radial depth is what the arc spans across the feed
        for e in (up, down):
            assert (np.cos(e.entry) - np.cos(e.exit)) / 2.0 == pytest.approx(immersion)
        assert up.entry == pytest.approx(np.pi - down.exit)
        assert up.exit == pytest.approx(np.pi - down.entry)
