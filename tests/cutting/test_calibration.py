"""Mean-force calibration: the textbook's slot, any engagement, edges, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.calibration import NAMES, ForceCalibration, calibrate_mean_force, mean_force_matrix, plausible
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_history, force_lines, runout_force_lines, unit_lines

CUTTER = Cutter(4, 0.012, np.radians(30.0))
SLOT = Engagement(0.0, np.pi)
TRUE = np.array([800e6, 240e6, 12e3, 9e3, 100e6, 2e3])
FEEDS = (4e-5, 6e-5, 8e-5, 1e-4, 1.2e-4)


def cuts(engagement=SLOT, feeds=FEEDS, cutter=CUTTER, depth=1e-3, feed_angle=0.0):
    return [(cutter, CuttingConditions(600.0, depth, f, engagement, feed_angle)) for f in feeds]


def test_slot_by_the_textbook():
    """F_x = -N a (K_rc c / 4 + K_re / pi), F_y = N a (K_tc c / 4 + K_te / pi), F_z = N a (K_ac c / pi + K_ae / 2)."""
    c, n, a = 1e-4, 4, 1e-3
    force = mean_force_matrix(*cuts(feeds=(c,))[0]) @ TRUE
    tc, rc, te, re, ac, ae = TRUE
    expected = [-n * a * (rc * c / 4 + re / np.pi), n * a * (tc * c / 4 + te / np.pi), n * a * (ac * c / np.pi + ae / 2)]
    np.testing.assert_allclose(force, expected, rtol=1e-12)


def test_the_matrix_is_the_mean_of_the_force_over_a_turn():
    cutter = Cutter(3, 0.01, 0.6, np.radians([110.0, 120.0, 130.0]))
    conditions = CuttingConditions(900.0, 2e-3, 8e-5, Engagement(0.4, 2.1), 0.7)
    coefficients = CuttingCoefficients(TRUE[0], TRUE[1] / TRUE[0], TRUE[4] / TRUE[0], TRUE[2], TRUE[3], TRUE[5])
    angle = (np.arange(20000) + 0.5) / 20000 * 2.0 * np.pi
    mean = force_history(cutter, conditions, coefficients, angle, slices=8).mean(axis=0)
    np.testing.assert_allclose(mean_force_matrix(cutter, conditions) @ TRUE, mean, rtol=2e-3)


@pytest.mark.parametrize("lines", [force_lines, runout_force_lines])
def test_lines_are_linear_in_the_coefficients(lines):
    cutter = Cutter(4, 0.012, 0.5, runout=[2e-6, 0.0, -2e-6, 0.0])
    conditions = CuttingConditions(600.0, 1e-3, 8e-5, Engagement(0.3, 2.6))
    orders = np.arange(25)
    whole = lines(cutter, conditions, CuttingCoefficients(TRUE[0], TRUE[1] / TRUE[0], TRUE[4] / TRUE[0], TRUE[2], TRUE[3], TRUE[5]), orders)
    np.testing.assert_allclose(
        unit_lines(cutter, conditions, orders, runout=lines is runout_force_lines) @ TRUE, whole, rtol=1e-9, atol=1e-9
    )


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    entry=st.floats(0.0, 2.5),
    width=st.floats(0.3, 3.1),
    turn=st.floats(-3.0, 3.0),
    tangential=st.floats(2e8, 3e9),
    ratio=st.floats(0.05, 0.9),
    edges=st.tuples(st.floats(1e3, 4e4), st.floats(1e3, 4e4)),
    axial=st.booleans(),
)
def test_exact_mean_forces_give_the_coefficients_back(entry, width, turn, tangential, ratio, edges, axial):
    """For any engagement and feed direction."""
    engagement = Engagement(entry, min(entry + width, np.pi))
    true = np.array([tangential, ratio * tangential, *edges, 0.2 * tangential, 1e3])
    plan = cuts(engagement, feed_angle=turn)
    count = 3 if axial else 2
    found = calibrate_mean_force(plan, np.array([(mean_force_matrix(*c) @ true)[:count] for c in plan]), runout=0.0)
    assert found.names == NAMES[: 2 * count]
    np.testing.assert_allclose(found.value, true[: 2 * count], rtol=1e-6)
    assert np.all(found.half_width <= 1e-4 * np.abs(found.value))
    assert found.misfit < 1e-9


def test_several_engagements_and_depths_together():
    plan = cuts() + cuts(Engagement(0.5 * np.pi, np.pi), depth=2e-3) + cuts(Engagement(0.0, 1.0), feed_angle=1.0)
    rng = np.random.default_rng(1)
    force = np.array([(mean_force_matrix(*c) @ TRUE) * (1.0 + 0.01 * rng.normal()) for c in plan])
    found = calibrate_mean_force(plan, force)
    assert np.all(np.abs(found.value - TRUE) < found.half_width * 1.5)
    assert np.all(found.half_width[:2] < 0.06 * TRUE[:2])


def test_an_edge_below_zero_is_none():
    true = np.array([800e6, 240e6, -1e3, 9e3])
    plan = cuts()
    found = calibrate_mean_force(plan, np.array([(mean_force_matrix(*c)[:2, :4] @ true) for c in plan]))
    assert found.of("K_te") == (0.0, 0.0)
    assert "K_te came out below zero" in found.notes[0]
    assert found.of("K_tc")[0] == pytest.approx(800e6, rel=0.05)
    assert found.coefficients.tangential_edge == 0.0


def test_unknown_runout_widens_the_edges():
    """Where chips run out to nothing an eccentric tooth loses its edge force, alike in all cuts."""
    down = cuts(Engagement(0.5 * np.pi, np.pi))
    eccentric = Cutter(4, 0.012, np.radians(30.0), runout=3e-6 * np.cos(CUTTER.tooth_angle - 0.4))
    coefficients = CuttingCoefficients(TRUE[0], TRUE[1] / TRUE[0], 0.0, TRUE[2], TRUE[3])
    force = np.array([runout_force_lines(eccentric, c, coefficients, np.array([0]))[0].real for _, c in down])
    found, blind = calibrate_mean_force(down, force), calibrate_mean_force(down, force, runout=0.0)
    off = np.abs(found.value - TRUE[:4])
    assert np.any(off > blind.half_width)
    assert np.all(off < 1.3 * found.half_width)


def test_coefficients_carry_the_intervals():
    found = ForceCalibration("mean", NAMES[:4], TRUE[:4], np.diag((0.01 * TRUE[:4]) ** 2), 1.96 * 0.01 * TRUE[:4], 0.0)
    c = found.coefficients
    assert (c.tangential, c.tangential_edge, c.radial_edge) == (TRUE[0], TRUE[2], TRUE[3])
    assert c.radial_ratio == pytest.approx(0.3)
    assert c.tangential_spread == pytest.approx(0.01, rel=1e-4)
    assert c.edge_spread == pytest.approx(0.01, rel=1e-4)
    # independent errors of both add up in the ratio
    assert c.ratio_spread == pytest.approx(0.01 * np.sqrt(2.0), rel=1e-4)
    together = np.outer(TRUE[:2], TRUE[:2]) * 1e-4
    covariance = np.diag((0.01 * TRUE[:4]) ** 2)
    covariance[:2, :2] = together
    alike = ForceCalibration("mean", NAMES[:4], TRUE[:4], covariance, 1.96 * 0.01 * TRUE[:4], 0.0)
    assert alike.coefficients.ratio_spread == pytest.approx(0.0, abs=1e-8)


def test_what_is_refused():
    plan = cuts()
    force = np.array([(mean_force_matrix(*c) @ TRUE)[:2] for c in plan])
    with pytest.raises(InputError, match="at least 3"):
        calibrate_mean_force(plan[:2], force[:2])
    same = cuts(feeds=(1e-4,) * 4)
    with pytest.raises(InputError, match="feeds per tooth"):
        calibrate_mean_force(same, np.array([(mean_force_matrix(*c) @ TRUE)[:2] for c in same]))


def test_a_force_with_the_wrong_sign_is_doubted():
    plan = cuts()
    found = calibrate_mean_force(plan, -np.array([(mean_force_matrix(*c) @ TRUE)[:2] for c in plan]))
    assert any("sign or axes" in reason for reason in found.reasons)
    assert plausible(NAMES[:2], TRUE[:2], 0.01 * TRUE[:2]) == ()
    assert "unusual" in plausible(NAMES[:2], np.array([1e8, 4e8]), np.array([1e6, 1e6]))[0]
