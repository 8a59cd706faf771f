"""Forces of any cutter: cylinders against closed forms, shapes against closed forms, sums over small parts, and conservation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.cutting.calibration import NAMES, TOGETHER, calibrate_mean_force, leaning, mean_force_matrix
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Block, CuttingConditions, Engagement, EngagementMap, Stepover
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_and_slope, force_history, force_lines, runout_force_lines, unit_lines
from rcsa_ident.cutting.forms import force_form, lines_of_rows, product_form
from rcsa_ident.cutting.power import spindle_load
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.rows import rows_of
from rcsa_ident.cutting.serration import Serration
from tests.oracles import cylinder_forces

DEG = np.pi / 180.0
SLOT = Engagement(0.0, np.pi)
COEFFICIENTS = CuttingCoefficients(1800e6, 650 / 1800, 300 / 1800, 20e3, 30e3, 3e3)
TRUE = np.array([1800e6, 650e6, 20e3, 30e3, 300e6, 3e3])
BALL = Cutter(2, 0.012, profile=Profile.ball(0.012))
#: Mean forces in x, y and z [N], torque [N m] and chip volume [m^3] a turn of a ball in a slot: closed forms, printed.
PRINTED = {
    0.0005: ((-23.3726, 67.4086, 84.2469), 0.133908, 0.2579882e-9),
    0.002: ((-93.5832, 208.2529, 167.5624), 0.807912, 1.9823885e-9),
    0.006: ((-284.5728, 552.0, 189.3127), 3.312, 9.0477868e-9),
}
SHAPES = {
    "bull nose": Cutter(4, 0.016, helix=35 * DEG, profile=Profile.bull_nose(0.016, 0.003)),
    "ball, unlike pitch": Cutter(3, 0.012, helix=30 * DEG, pitch=np.radians([110.0, 120.0, 130.0]), profile=Profile.ball(0.012)),
    "unlike helix": Cutter(4, 0.016, helix=np.radians([38.0, 41.0, 38.0, 41.0]), pitch=np.radians([84.0, 96.0, 84.0, 96.0])),
    "waves": Cutter(3, 0.016, helix=30 * DEG, serration=Serration(0.25e-3, 1.5e-3)),
    "face mill": Cutter(5, 0.063, profile=Profile.face(0.063, 45 * DEG, 0.006), runout=[0.0, 2e-5, -1e-5, 0.0, 3e-5]),
    "face mill, teeth too high": Cutter(3, 0.032, profile=Profile.face(0.032, 20 * DEG, 0.006), axial_runout=[0.0, 2e-5, -1e-5]),
    "tilted": Cutter(2, 0.012, helix=30 * DEG, tilt=2e-3),
}


def of_the_oracle(cutter, conditions, orders):
    engagement = conditions.engagement
    return cylinder_forces.unit_lines(
        cutter.pitch, cutter.runout, cutter.diameter, cutter.helix, conditions.axial_depth, conditions.feed_per_tooth,
        engagement.entry, engagement.exit, conditions.feed_angle, orders,
    )  # fmt: skip


@settings(deadline=None)
@given(
    st.integers(1, 6), st.integers(0, 2**31), st.floats(0.0, 0.8), st.floats(0.0, 2.8), st.floats(0.05, 3.1),
    st.sampled_from([0.0, 1e-6, 4e-5]), st.sampled_from([1e-6, 1e-5, 1e-4]),
)  # fmt: skip
def test_a_cylinder_has_the_lines_of_its_closed_forms(teeth, seed, helix, entry, width, offset, feed):
    rng = np.random.default_rng(seed)
    pitch = rng.uniform(0.6, 1.4, teeth)
    pitch = 2.0 * np.pi * pitch / pitch.sum() if rng.random() < 0.5 else None
    cutter = Cutter(teeth, 0.012, helix, pitch, offset * rng.normal(size=teeth))
    conditions = CuttingConditions(900.0, 2e-3, feed, Engagement(entry, min(entry + width, np.pi)), rng.uniform(0.0, 6.0))
    orders = np.arange(14)
    true = replace(cutter, runout=None)
    for each, found in ((true, unit_lines(cutter, conditions, orders)), (cutter, unit_lines(cutter, conditions, orders, runout=True))):
        size = np.abs(of_the_oracle(true, conditions, orders)).max(axis=(0, 1))
        assert np.all(np.abs(found[..., :4] - of_the_oracle(each, conditions, orders)) <= 1e-11 * size)
        if each is true:
            engagement = conditions.engagement
            told = (true.diameter, true.helix, 2e-3, feed, engagement.entry, engagement.exit, conditions.feed_angle, orders)
            assert np.all(np.abs(found[..., :4] - cylinder_forces.true_unit_lines(true.pitch, *told)) <= 1e-11 * size)
        # on a wall the axial coefficients push along z alone
        assert np.abs(found[..., 4:]).max() <= 1e-15 * size.max()


@pytest.mark.parametrize("depth", PRINTED)
def test_a_ball_in_a_slot_pushes_as_printed(depth):
    force, torque, volume = PRINTED[depth]
    conditions = CuttingConditions(900.0, depth, 0.08e-3, SLOT)
    assert unit_lines(BALL, conditions, np.array([0]), axial=True)[0].real @ TRUE == pytest.approx(force, abs=6e-5)
    assert force_lines(BALL, conditions, COEFFICIENTS, np.array([0]))[0].real == pytest.approx(force[:2], abs=6e-5)
    load = spindle_load(BALL, conditions, COEFFICIENTS)
    assert load.torque == pytest.approx(torque, abs=6e-7)
    assert load.removal_rate == pytest.approx(volume * 900.0 / (2.0 * np.pi), rel=1e-6)
    assert load.power == pytest.approx(load.torque * 900.0)


@pytest.mark.parametrize("engagement", [Block(-0.008, 0.002), Stepover(0.0015, "down"), Engagement(0.3, 2.6)])
@pytest.mark.parametrize("shape", ["bull nose", "unlike helix", "face mill"])
def test_lines_are_the_sums_of_those_of_rows(shape, engagement):
    """The same through the stability methods' forms, which share no line of algebra with the forces'."""
    cutter = SHAPES[shape]
    conditions = CuttingConditions(900.0, 2e-3, 1e-4, engagement)
    orders = np.arange(12)
    rows = rows_of(cutter, engagement, 2e-3, 1e-4)
    chip = np.zeros((rows.count, 1, 3))
    chip[:, 0, 0], chip[:, 0, 2] = rows.step * np.sin(rows.kappa), rows.feed * np.sin(rows.kappa)
    edges = lines_of_rows(rows, force_form(rows, 20e3, 30e3, 3e3, 3).transpose(0, 2, 1), orders)
    wanted = lines_of_rows(rows, product_form(force_form(rows, 1800e6, 650e6, 300e6, 3), chip)[..., 0], orders) + edges
    wanted = wanted.sum(axis=1) * np.where(orders == 0, 1.0, 2.0)[:, None]
    found = unit_lines(cutter, conditions, orders, runout=True, axial=True) @ TRUE
    assert np.abs(found - wanted).max() <= 1e-12 * np.abs(wanted).max()


@pytest.mark.parametrize("shape", list(SHAPES))
def test_lines_are_those_of_the_force_over_a_turn(shape):
    cutter = SHAPES[shape]
    engagement = Block(-0.4 * cutter.diameter, 0.1 * cutter.diameter)
    conditions = CuttingConditions(900.0, 2.2e-3, 8e-5, engagement, 0.7)
    angle = 2.0 * np.pi * (np.arange(3000) + 0.5) / 3000
    # waves about as finely as rows take them, 256 each
    history = force_history(cutter, conditions, COEFFICIENTS, angle, slices=380 if shape == "waves" else 150)
    orders = np.arange(10)
    sampled = np.where(orders == 0, 1.0, 2.0)[:, None] * (np.exp(-1j * np.outer(orders, angle)) @ history / angle.size)
    found = unit_lines(cutter, conditions, orders, runout=True, axial=True) @ TRUE
    found[:, 2] *= -1.0
    assert np.abs(found - sampled).max() <= 2e-3 * np.abs(sampled).max()
    assert np.allclose(runout_force_lines(cutter, conditions, COEFFICIENTS, orders), found[:, :2], rtol=1e-12)


def test_an_engagement_map_that_says_the_same_pushes_the_same():
    cutter, depth = SHAPES["bull nose"], 2e-3
    z = np.array([0.0, depth])
    same = EngagementMap(z, np.full(2, 0.4), np.full(2, 2.1))
    told, table = (
        force_lines(cutter, CuttingConditions(900.0, depth, 1e-4, e), COEFFICIENTS, np.arange(9)) for e in (Engagement(0.4, 2.1), same)
    )
    assert np.allclose(told, table, rtol=1e-10)


def test_a_feed_that_rises_takes_off_the_chip_what_it_climbs():
    """A 45 degree cone that is fed along its own line: nothing is cut at the front, all of it where the feed is level."""
    cutter = Cutter(1, 0.02, profile=Profile.face(0.02, 45 * DEG, 0.006))
    # where a chip is left by the rise: nearer to the sides the edge lifts off
    z, start, end = np.array([0.0, 1e-3]), np.full(2, 0.2), np.full(2, np.pi - 0.2)
    load = [
        spindle_load(cutter, CuttingConditions(900.0, 1e-3, 1e-4, EngagementMap(z, start, end, rise)), CuttingCoefficients(1e9, 0.3))
        for rise in (0.0, 0.1)
    ]
    # volume = feed times projected area: of the cone's strip along x and of its ring along z
    level = 1e-4 * np.trapezoid(2.0 * np.cos(0.2) * (0.01 + z), z)
    risen = np.cos(0.1) * level - np.sin(0.1) * 1e-4 * 0.5 * (np.pi - 0.4) * (0.011**2 - 0.010**2)
    assert load[0].removal_rate == pytest.approx(level * 900.0 / (2.0 * np.pi), rel=1e-9)
    assert load[1].removal_rate == pytest.approx(risen * 900.0 / (2.0 * np.pi), rel=1e-9)


def test_a_bull_noses_smaller_radius_comes_to_the_cylinder():
    conditions = CuttingConditions(900.0, 2e-3, 1e-4, Engagement.from_immersion(0.5, "down"))
    orders = 4 * np.arange(1, 6)
    wall = force_lines(Cutter(4, 0.012, 30 * DEG), conditions, COEFFICIENTS, orders)
    left = [
        np.abs(force_lines(Cutter(4, 0.012, 30 * DEG, profile=Profile.bull_nose(0.012, r)), conditions, COEFFICIENTS, orders) - wall).max()
        for r in (1e-4, 1e-5, 1e-6)
    ]
    # in proportion to the radius
    assert left[1] == pytest.approx(0.1 * left[0], rel=0.05)
    assert left[2] == pytest.approx(0.1 * left[1], rel=0.01)
    assert left[2] < 2e-3 * np.abs(wall).max()


def test_slopes_of_a_leaning_edge_are_those_of_its_force():
    cutter, orders = SHAPES["bull nose"], 4 * np.arange(1, 5)
    conditions = CuttingConditions(900.0, 2e-3, 1e-4, Stepover(0.004, "down"))
    force, slope = force_and_slope(cutter, conditions, COEFFICIENTS, orders)
    for k, name in enumerate(("tangential", "radial_ratio", "tangential_edge", "radial_edge")):
        changed = [
            force_lines(cutter, conditions, replace(COEFFICIENTS, **{name: getattr(COEFFICIENTS, name) * np.exp(s)}), orders)
            for s in (1e-4, -1e-4)
        ]
        assert np.abs(slope[:, :, k] * force - (changed[0] - changed[1]) / 2e-4).max() < 1e-7 * np.abs(force).max()


def cuts(depths, cutter=BALL, feeds=(4e-5, 8e-5, 1.2e-4)):
    return [(cutter, CuttingConditions(900.0, depth, feed, SLOT)) for depth in depths for feed in feeds]


def test_three_axes_tell_all_six_coefficients_of_a_ball():
    plan = cuts([0.001])
    found = calibrate_mean_force(plan, np.array([mean_force_matrix(*c) @ TRUE for c in plan]), runout=0.0)
    assert found.names == NAMES
    assert found.value == pytest.approx(TRUE, rel=1e-8)


def test_one_depth_in_x_and_y_tells_a_sum_and_two_depths_tell_them_apart():
    plan = cuts([0.001])
    one = calibrate_mean_force(plan, np.array([(mean_force_matrix(*c) @ TRUE)[:2] for c in plan]), runout=0.0)
    assert one.names == NAMES[:4]
    assert TOGETHER in one.notes
    # of a ball only K_rc I2 + K_ac I1 shows
    top = np.arccos(1.0 - 0.001 / 0.006)
    i1, i2 = 0.5 * np.sin(top) ** 2, 0.5 * top - 0.25 * np.sin(2.0 * top)
    assert one.of("K_tc")[0] == pytest.approx(1800e6, rel=1e-8)
    assert one.of("K_rc")[0] == pytest.approx(650e6 + 300e6 * i1 / i2, rel=1e-6)
    plan = cuts([0.0005, 0.005])
    both = calibrate_mean_force(plan, np.array([(mean_force_matrix(*c) @ TRUE)[:2] for c in plan]), runout=0.0)
    assert both.names == NAMES
    assert both.value == pytest.approx(TRUE, rel=1e-6)
    assert not both.notes


def test_a_cylinder_says_nothing_of_leaning_edges():
    cylinder = Cutter(4, 0.012, 0.5)
    plan = cuts([0.001], cylinder)
    found = calibrate_mean_force(plan, np.array([(mean_force_matrix(*c) @ TRUE)[:2] for c in plan]), runout=0.0)
    assert not found.notes
    assert found.names == NAMES[:4]
    assert not leaning(*plan[0])
    assert leaning(BALL, plan[0][1])
