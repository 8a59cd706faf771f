"""Force lines against sampled revolutions and laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import REFERENCE_RUNOUT, SLOPES, force_and_slope, force_history, force_lines, runout_force_lines

COEFFICIENTS = CuttingCoefficients(9.02e8, 0.26, 0.1, 1.5e4, 2.0e4, 5e3)
HALF = CuttingConditions(1250.0, 2e-3, 1e-4, Engagement.from_immersion(0.5, "down"), 0.7)
ORDERS = np.arange(0, 25)


def sampled_lines(cutter, conditions, coefficients, orders, samples=20000, slices=40):
    """Midpoint sums over a revolution and the depth, tooth by tooth: what the definition says."""
    angle = 2.0 * np.pi * (np.arange(samples) + 0.5) / samples
    history = force_history(cutter, conditions, coefficients, angle, slices=slices)[:, :2]
    lines = np.exp(-1j * np.outer(orders, angle)) @ history / samples
    return np.where(orders[:, None] == 0, 1.0, 2.0) * lines


CUTTERS = {
    "straight": Cutter(4, 0.012),
    "one tooth": Cutter(1, 0.02),
    "helix": Cutter(4, 0.012, helix=np.radians(30.0)),
    "pitch": Cutter(4, 0.012, helix=np.radians(38.0), pitch=np.radians([83.0, 97.0, 88.0, 92.0])),
}
RUNOUT = {
    "small": Cutter(4, 0.012, runout=np.array([0.0, 6e-6, -4e-6, 1e-6])),
    "a tooth misses": Cutter(4, 0.012, helix=np.radians(30.0), runout=np.array([0.0, 1.3e-4, 0.0, 0.0])),
    "pitch": Cutter(3, 0.012, pitch=np.radians([110.0, 130.0, 120.0]), runout=np.array([2e-5, -3e-5, 5e-5])),
}
CUTS = {
    "half down": HALF,
    "slot": CuttingConditions(800.0, 1e-3, 5e-5, Engagement(0.0, np.pi), -2.0),
    "thin up": CuttingConditions(800.0, 6e-3, 8e-5, Engagement.from_immersion(0.07, "up")),
}


@pytest.mark.slow
@pytest.mark.parametrize("cut", list(CUTS))
@pytest.mark.parametrize("name", list(CUTTERS))
def test_lines_of_a_sampled_revolution(name, cut):
    cutter, conditions = CUTTERS[name], CUTS[cut]
    found = force_lines(cutter, conditions, COEFFICIENTS, ORDERS)
    expected = sampled_lines(cutter, conditions, COEFFICIENTS, ORDERS)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(found).max())


@pytest.mark.slow
@pytest.mark.parametrize("cut", list(CUTS))
@pytest.mark.parametrize("name", list(RUNOUT))
def test_lines_with_runout(name, cut):
    cutter, conditions = RUNOUT[name], CUTS[cut]
    found = runout_force_lines(cutter, conditions, COEFFICIENTS, ORDERS)
    expected = sampled_lines(cutter, conditions, COEFFICIENTS, ORDERS)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(found).max())
    plain = force_lines(cutter, conditions, COEFFICIENTS, ORDERS)
    assert np.max(np.abs(found - plain)) > 1e-2 * np.abs(plain).max()


@settings(max_examples=20, deadline=None)
@given(
    teeth=st.integers(1, 6),
    helix=st.floats(0.0, 1.0),
    feed=st.floats(1e-6, 1e-3),
    angle=st.floats(-4.0, 4.0),
    entry=st.floats(0.0, 3.0),
    arc=st.floats(0.05, 3.0),
    offset=st.floats(-1e-4, 1e-4),
)
def test_no_runout_is_equal_runout_is_force_lines(teeth, helix, feed, angle, entry, arc, offset):
    conditions = CuttingConditions(900.0, 3e-3, feed, Engagement(entry, min(np.pi, entry + arc)), angle)
    plain = Cutter(teeth, 0.01, helix)
    expected = force_lines(plain, conditions, COEFFICIENTS, ORDERS)
    for runout in (np.zeros(teeth), np.full(teeth, offset)):
        found = runout_force_lines(Cutter(teeth, 0.01, helix, runout=runout), conditions, COEFFICIENTS, ORDERS)
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.slow
def test_the_series_is_the_force():
    """Summed up to a high order, away from the jumps."""
    orders = np.arange(0, 4000)
    angle = np.radians([7.0, 50.0, 60.0, 75.0])
    series = np.real(np.exp(1j * np.outer(angle, orders)) @ force_lines(CUTTERS["pitch"], HALF, COEFFICIENTS, orders))
    history = force_history(CUTTERS["pitch"], HALF, COEFFICIENTS, angle, slices=4000)[:, :2]
    np.testing.assert_allclose(series, history, atol=2e-3 * np.abs(history).max())


@pytest.mark.parametrize("edges", [False, True])
def test_mean_force_in_closed_form(edges):
    """Slot of N teeth: F_x = -N a / 4 K_r c, F_y = +N a / 4 K_t c, and edges -N a / pi K_re, +N a / pi K_te."""
    coefficients = CuttingCoefficients(9e8, 0.3, 0.0, 2e4 if edges else 0.0, 3e4 if edges else 0.0)
    slot = CuttingConditions(800.0, 1.5e-3, 8e-5, Engagement(0.0, np.pi))
    mean = force_lines(Cutter(3, 0.012, 0.5), slot, coefficients, np.array([0]))[0]
    per_tooth = 3 * 1.5e-3
    expected = per_tooth * np.array([-0.25 * 9e8 * 0.3 * 8e-5, 0.25 * 9e8 * 8e-5])
    if edges:
        expected += per_tooth / np.pi * np.array([-3e4, 2e4])
    np.testing.assert_allclose(mean, expected, rtol=1e-12)


def test_equal_teeth_make_tooth_passing_lines_only():
    lines = force_lines(CUTTERS["helix"], HALF, COEFFICIENTS, ORDERS)
    others = lines[ORDERS % 4 != 0]
    assert np.max(np.abs(others)) < 1e-12 * np.abs(lines).max()
    assert np.min(np.abs(force_lines(CUTTERS["pitch"], HALF, COEFFICIENTS, np.arange(1, 4)))) > 1e-4 * np.abs(lines).max()


@settings(max_examples=20, deadline=None)
@given(turn=st.floats(-6.0, 6.0), depth=st.floats(1e-5, 1e-2))
def test_force_turns_with_the_feed_and_grows_with_the_depth(turn, depth):
    def lines(angle, axial):
        conditions = CuttingConditions(900.0, axial, 1e-4, HALF.engagement, angle)
        return force_lines(CUTTERS["straight"], conditions, COEFFICIENTS, ORDERS)

    c, s = np.cos(turn), np.sin(turn)
    straight = lines(0.0, 1e-3)
    np.testing.assert_allclose(lines(turn, depth), depth / 1e-3 * straight @ np.array([[c, s], [-s, c]]), atol=1e-9 * depth * 1e6)


def test_power_of_the_edges_and_the_chip_is_the_torque_times_the_speed():
    """Tangential forces alone make torque: mean torque from the chip area and the arc, per revolution."""
    coefficients = CuttingCoefficients(9e8, 0.3, 0.0, 2e4, 3e4)
    entry, exit_ = HALF.engagement.entry, HALF.engagement.exit
    phi = entry + (exit_ - entry) * (np.arange(4000) + 0.5) / 4000
    angle = phi[:, None] * np.ones(1)
    history = force_history(Cutter(1, 0.012), CuttingConditions(900.0, 1e-3, 1e-4, HALF.engagement), coefficients, angle[:, 0], slices=1)
    tangential = -np.cos(phi) * history[:, 0] + np.sin(phi) * history[:, 1]
    work = np.mean(tangential) * (exit_ - entry) * 0.006
    removed = 1e-3 * 1e-4 * (np.cos(entry) - np.cos(exit_)) * 0.006
    assert work == pytest.approx(9e8 * removed + 2e4 * 1e-3 * (exit_ - entry) * 0.006, rel=1e-6)


def test_one_deep_tooth_takes_the_whole_feed():
    """Run-out so large that one tooth cuts alone: it takes the feed of all."""
    alone = Cutter(4, 0.012, runout=np.array([0.0, 1e-3, 0.0, 0.0]))
    conditions = CuttingConditions(900.0, 1e-3, 5e-5, Engagement(0.3, 2.8))
    one = CuttingConditions(900.0, 1e-3, 2e-4, Engagement(0.3, 2.8))
    found = runout_force_lines(alone, conditions, COEFFICIENTS, ORDERS)
    single = force_lines(Cutter(1, 0.012), one, COEFFICIENTS, ORDERS)
    np.testing.assert_allclose(found, single * np.exp(1j * ORDERS * np.pi / 2.0)[:, None], atol=1e-9 * np.abs(single).max())


NAMES = ("tangential", "radial_ratio", "tangential_edge", "radial_edge")


def test_order_of_the_slopes():
    assert SLOPES == ("tangential coefficient", "radial ratio", "tangential edge force", "radial edge force", "run-out")


@pytest.mark.parametrize("cut", list(CUTS))
@pytest.mark.parametrize("name", list(CUTTERS))
def test_slopes_against_differences(name, cut):
    """d log F / d log coefficient, one at a time, of the force as it is defined."""
    cutter, conditions = CUTTERS[name], CUTS[cut]
    orders = cutter.teeth * np.arange(0, 7)
    force, slope = force_and_slope(cutter, conditions, COEFFICIENTS, orders)
    np.testing.assert_allclose(force, force_lines(cutter, conditions, COEFFICIENTS, orders), rtol=1e-12)
    assert slope.shape == (7, 2, len(SLOPES))
    for k, field in enumerate(NAMES):
        step = 1e-4
        ahead, behind = (
            force_lines(cutter, conditions, replace(COEFFICIENTS, **{field: getattr(COEFFICIENTS, field) * np.exp(s)}), orders)
            for s in (step, -step)
        )
        expected = (ahead - behind) / (2.0 * step)
        np.testing.assert_allclose(slope[:, :, k] * force, expected, atol=1e-7 * np.abs(force).max())


def test_tangential_coefficient_carries_the_radial_one():
    """k_rc is a ratio: without edges K_tc scales the whole force."""
    force, slope = force_and_slope(CUTTERS["straight"], HALF, CuttingCoefficients(9e8, 0.3), 4 * np.arange(1, 5))
    np.testing.assert_allclose(slope[:, :, 0], 1.0, rtol=1e-12)
    np.testing.assert_array_equal(slope[:, :, 2:4], 0.0)
    assert np.all(np.isfinite(force))


@pytest.mark.parametrize("name", list(CUTTERS))
def test_run_outs_slope_is_a_secant_to_a_tilted_cutter(name):
    """Tooth by tooth: an axis off the spindle's by the reference, between two teeth."""
    cutter = CUTTERS[name]
    orders = cutter.teeth * np.arange(0, 7)
    force, slope = force_and_slope(cutter, HALF, COEFFICIENTS, orders)
    offset = REFERENCE_RUNOUT * np.cos(cutter.tooth_angle - cutter.pitch[0] / 8.0)
    eccentric = replace(cutter, runout=offset)
    expected = runout_force_lines(eccentric, HALF, COEFFICIENTS, orders) - force
    np.testing.assert_allclose(slope[:, :, 4] * force, expected, atol=1e-10 * np.abs(force).max())
    sampled = sampled_lines(eccentric, HALF, COEFFICIENTS, orders, 5000) - sampled_lines(cutter, HALF, COEFFICIENTS, orders, 5000)
    np.testing.assert_allclose(slope[:, :, 4] * force, sampled, atol=1e-3 * np.abs(force).max())


def test_no_force_no_slope():
    """A slot cut by four equal teeth has a constant force: its other lines are nothing, and nothing changes them by a share."""
    still = CuttingConditions(800.0, 0.0, 5e-5, Engagement(0.0, np.pi))
    force, slope = force_and_slope(CUTTERS["straight"], still, COEFFICIENTS, ORDERS)
    np.testing.assert_array_equal(force, 0.0)
    np.testing.assert_array_equal(slope, 0.0)


def test_axial_force_of_the_history():
    history = force_history(Cutter(1, 0.012), HALF, COEFFICIENTS, np.array([0.75 * np.pi, 0.2]), slices=1)
    assert history[0, 2] == pytest.approx(2e-3 * (9.02e7 * 1e-4 * np.sin(0.75 * np.pi) + 5e3))
    assert np.all(history[1] == 0.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Cutter(0, 0.01), "teeth"),
        (lambda: Cutter(2.5, 0.01), "teeth"),
        (lambda: Cutter(2, 0.01, helix=1.5), "helix"),
        (lambda: Cutter(2, 0.01, pitch=np.array([1.0, 2.0])), "full turn"),
        (lambda: Cutter(2, 0.01, pitch=np.array([np.nan, 2.0])), "full turn"),
        (lambda: Cutter(2, 0.01, runout=np.zeros(3)), "runout"),
        (lambda: Cutter(2, 0.01, runout=np.array([0.0, np.inf])), "runout"),
        (lambda: Engagement(1.0, 0.5), "exit"),
        (lambda: Engagement(0.0, 3.2), "180"),
        (lambda: Engagement.from_immersion(0.5, "sideways"), "up or down"),
        (lambda: Engagement.from_immersion(1.5, "up"), "not above 1"),
        (lambda: CuttingConditions(0.0, 1e-3, 1e-4, HALF.engagement), "spindle_speed"),
        (lambda: CuttingCoefficients(9e8, 7.0), "radial_ratio"),
        (lambda: CuttingCoefficients(9e8, 0.3, np.nan), "axial_ratio"),
        (lambda: CuttingCoefficients(9e8, 0.3, tangential_spread=-0.1), "tangential_spread"),
        (lambda: CuttingCoefficients(9e8, 0.3, ratio_spread=1.5), "ratio_spread"),
        (lambda: CuttingCoefficients(9e8, 0.3, edge_spread=np.nan), "edge_spread"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()
