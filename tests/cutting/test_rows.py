"""Rows of edge: volumes, closed forms, chips of unlike teeth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import Block, Engagement, EngagementMap, Stepover, widest
from rcsa_ident.cutting.cutter import Cutter, HelixKind
from rcsa_ident.cutting.forms import exponential_form, force_form, lines_of_rows, mean_over_turn, normal_form, product_form
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.rows import rows_of
from rcsa_ident.cutting.serration import Serration
from rcsa_ident.cutting.teeth import deepest, lags
from tests.stability.tilted_ball import tilted_ball

DEG = np.pi / 180.0
SLOT = Engagement(0.0, np.pi)
#: Mean forces [N] and torque [N m], and chip volume per revolution [m^3], of a ball in a slot: closed forms, `cutters.md` 3 d.
BALL = {
    0.0005: ((-23.3726, 67.4086, 84.2469), 0.133908, 0.2579882e-9),
    0.002: ((-93.5832, 208.2529, 167.5624), 0.807912, 1.9823885e-9),
    0.006: ((-284.5728, 552.0, 189.3127), 3.312, 9.0477868e-9),
}


def volume(rows):
    """Chip volume per spacing [m^3]."""
    across = rows.feed * (np.cos(rows.start) - np.cos(rows.end)) + rows.step * (rows.end - rows.start)
    return float(np.sum(rows.width * np.sin(rows.kappa) * rows.r * across))


def chip_form(rows):
    """The chip across the edge as a sum of 1, cos and sin."""
    found = np.zeros((rows.count, 1, 3))
    found[:, 0, 0], found[:, 0, 2] = rows.step * np.sin(rows.kappa), rows.feed * np.sin(rows.kappa)
    return found


@pytest.mark.parametrize("depth", BALL)
def test_a_ball_in_a_slot_pushes_and_cuts_as_its_closed_form(depth):
    mean, torque, removed = BALL[depth]
    ball = Cutter(2, 0.012, profile=Profile.ball(0.012))
    rows = rows_of(ball, SLOT, depth, 0.08e-3, nodes=24)
    chips = mean_over_turn(rows, product_form(force_form(rows, 1800e6, 650e6, 300e6, 3), chip_form(rows))[..., 0])
    edges = mean_over_turn(rows, force_form(rows, 20e3, 30e3, 3e3, 3).transpose(0, 2, 1))
    assert chips + edges == pytest.approx(mean, abs=6e-5)
    assert 2 * volume(rows) == pytest.approx(removed, rel=1e-7)
    turned = 2 * (1800e6 * volume(rows) + 20e3 * np.sum(rows.width * rows.r * (rows.end - rows.start))) / (2.0 * np.pi)
    assert turned == pytest.approx(torque, abs=6e-7)


def test_the_mean_matrix_of_a_ball_in_a_slot_is_its_closed_form():
    rows = rows_of(Cutter(2, 0.012, profile=Profile.ball(0.012)), SLOT, 0.002, nodes=24)
    found = mean_over_turn(rows, product_form(force_form(rows, 1.0, 0.36, 0.17, 3), normal_form(rows, 3)))
    k_r, k_a, top = 0.36, 0.17, np.arccos(1.0 - 0.002 / 0.006)
    i0, i1, i4 = 1.0 - np.cos(top), 0.5 * np.sin(top) ** 2, np.sin(top)
    i2, i3 = 0.5 * top - 0.25 * np.sin(2.0 * top), 0.5 * top + 0.25 * np.sin(2.0 * top)
    across, along = -0.5 * np.pi * (k_r * i2 + k_a * i1), 0.5 * np.pi * i0
    wanted = np.array([[across, -along, 2.0 * (k_r * i1 + k_a * i3)], [along, across, -2.0 * i4],
                       [2.0 * (k_r * i2 - k_a * i1), 0.0, -np.pi * (k_r * i3 - k_a * i1)]])  # fmt: skip
    wanted[2, 0] = 2.0 * (k_r * i1 - k_a * i2)
    assert np.allclose(found, 2.0 * 0.006 / (2.0 * np.pi) * wanted, atol=2e-18)
    assert found[0, 0] * 1e3 == pytest.approx(-0.327516, abs=5e-7)


@pytest.mark.parametrize(
    "outline",
    [
        Profile.bull_nose(0.016, 0.003),
        Profile.face(0.063, 45 * DEG, 0.006),
        Profile.face(0.032, 12 * DEG, 0.006),
        Profile.face(0.063, 45 * DEG, 0.006, 0.0012),
        Profile.barrel(0.012, 0.048, 0.006, 0.001, 0.012),
    ],
)
@pytest.mark.parametrize("strategy", ["up", "down"])
def test_a_stepover_takes_feed_times_depth_times_width(outline, strategy):
    feed, depth, width = 0.1e-3, 0.002, 0.0015
    cutter = Cutter(3, 0.012, helix=30 * DEG, pitch=np.radians([110.0, 120.0, 130.0]), profile=outline)
    rows = rows_of(cutter, Stepover(width, strategy), depth, feed, nodes=40)
    assert volume(rows) == pytest.approx(3 * feed * depth * width, rel=1e-13)


def test_a_stepover_of_a_ball_leaves_a_cusp():
    cutter = Cutter(2, 0.012, profile=Profile.ball(0.012))
    rows = rows_of(cutter, Stepover(0.0015, "down"), 0.002, 0.1e-3, nodes=40)
    low = 0.006 - np.sqrt(0.006**2 - 0.00075**2)
    z = np.linspace(0.0, low, 200001)
    area = 0.0015 * (0.002 - low) + np.trapezoid(2.0 * np.sqrt(2.0 * 0.006 * z - z**2), z)
    assert 2 * volume(rows) == pytest.approx(2 * 0.1e-3 * area, rel=1e-7)
    assert 1.0 - area / (0.002 * 0.0015) == pytest.approx(0.0078, abs=1e-4)


def test_a_block_takes_the_strip_inside_the_outline():
    cutter = Cutter(4, 0.016, profile=Profile.bull_nose(0.016, 0.003))
    rows = rows_of(cutter, Block(-0.008, -0.0016), 0.002, 0.1e-3, nodes=40)
    z = np.linspace(0.0, 0.002, 200001)
    r = 0.005 + np.sqrt(np.maximum(0.003**2 - (0.003 - z) ** 2, 0.0))
    assert 4 * volume(rows) == pytest.approx(4 * 0.1e-3 * np.trapezoid(np.minimum(r, 0.008) - 0.0016, z), rel=1e-7)


def test_a_corner_that_meets_the_blocks_side_needs_few_nodes():
    # the side y = -6.5 mm cuts into the arc: what is engaged begins inside it, like a square root
    cutter, side = Cutter(4, 0.016, profile=Profile.bull_nose(0.016, 0.003)), Block(-0.008, -0.0065)
    exact = volume(rows_of(cutter, side, 0.002, 0.1e-3, nodes=200))
    assert volume(rows_of(cutter, side, 0.002, 0.1e-3)) == pytest.approx(exact, rel=1e-5)
    assert volume(rows_of(cutter, side, 0.002, 0.1e-3, nodes=16)) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize(("lead", "tilt"), [(15.0, 0.0), (-15.0, 0.0), (0.0, 15.0), (20.0, 10.0)])
def test_a_leaning_ball_takes_its_area_times_the_feed(lead, tilt):
    arcs, area = tilted_ball(0.005, 0.0005, 0.001, lead * DEG, tilt * DEG)
    assert area == pytest.approx(0.4916541e-6, rel=2e-5)
    cutter = Cutter(2, 0.010, profile=Profile.ball(0.010))
    rows = rows_of(cutter, arcs, float(arcs.z[-1]), 0.1e-3)
    assert 2 * volume(rows) == pytest.approx(2 * 0.1e-3 * area, rel=1e-3)


def test_arcs_of_a_leaning_ball_stand_where_they_should():
    arcs, _ = tilted_ball(0.005, 0.0005, 0.001, 20 * DEG, 10 * DEG)
    assert np.sin(arcs.feed_rise) == pytest.approx(0.34202, abs=1e-5)
    wanted = {25: (51.4, 77.8), 30: (39.1, 74.5), 35: (31.4, 69.9), 40: (25.7, 65.2), 45: (39.1, 60.9)}
    for kappa, angles in wanted.items():
        z = np.array([0.005 * (1.0 - np.cos(kappa * DEG))])
        found = np.degrees(arcs.arcs(0.005 * np.sin([kappa * DEG]), z))[0, 0]
        assert found == pytest.approx(angles, abs=0.2)


def test_the_form_of_the_normal_with_slopes_is_that_of_a_rigid_body():
    rng = np.random.default_rng(7)
    rows = rows_of(Cutter(2, 0.012, profile=Profile.ball(0.012)), SLOT, 0.004)
    normals, forces = normal_form(rows, 5), force_form(rows, 1.0, 0.3, 0.2, 5)
    products = product_form(forces, normals)
    for i in rng.integers(rows.count, size=6):
        phi, kappa, z, r = rng.uniform(0.0, np.pi), rows.kappa[i], rows.z[i], rows.r[i]
        s, c = np.sin(phi), np.cos(phi)
        n = np.array([np.sin(kappa) * s, np.sin(kappa) * c, -np.cos(kappa)])
        e = np.array([-c, s, 0.0]) - 0.3 * n + 0.2 * np.array([-np.cos(kappa) * s, -np.cos(kappa) * c, -np.sin(kappa)])
        # theta_y = x', theta_x = -y' turn the point (r sin phi, r cos phi, z)
        jacobian = np.array([[1, 0, 0, z, 0], [0, 1, 0, 0, z], [0, 0, 1, -r * s, -r * c]])
        basis = np.array([1.0, c, s, np.cos(2 * phi), np.sin(2 * phi)])
        assert normals[i] @ basis[:3] == pytest.approx(jacobian.T @ n, abs=1e-15)
        assert forces[i] @ basis[:3] == pytest.approx(jacobian.T @ e, abs=1e-15)
        assert np.allclose(np.tensordot(basis, products[i], 1), np.outer(jacobian.T @ e, jacobian.T @ n), atol=1e-15)
        q = np.exp(1j * phi * np.arange(-2, 3))
        assert np.allclose(np.tensordot(q, exponential_form(products)[i], 1), np.outer(jacobian.T @ e, jacobian.T @ n), atol=1e-15)


@pytest.mark.slow
def test_lines_are_those_of_the_force_over_the_rotation():
    cutter = Cutter(3, 0.016, helix=30 * DEG, pitch=np.radians([110.0, 120.0, 130.0]), profile=Profile.bull_nose(0.016, 0.003))
    rows = rows_of(cutter, Block(-0.008, 0.002), 0.0045, 0.1e-3)
    form = product_form(force_form(rows, 1.0, 0.3, 0.1, 3), chip_form(rows))[..., 0]
    orders = np.arange(0, 9)
    lines = lines_of_rows(rows, form, orders).sum(axis=1)
    theta = (np.arange(200000) + 0.5) / 200000 * 2.0 * np.pi
    total = np.zeros((theta.size, 3))
    for i in range(rows.count):
        # a wall's row is taken as many points
        many = 40 if rows.far[i] > rows.near[i] else 1
        for share in (np.arange(many) + 0.5) / many:
            phi = np.mod(theta + rows.angle[i] - rows.near[i] - share * (rows.far[i] - rows.near[i]), 2.0 * np.pi)
            basis = np.array([np.ones_like(phi), np.cos(phi), np.sin(phi), np.cos(2 * phi), np.sin(2 * phi)])
            inside = (phi >= rows.start[i]) & (phi < rows.end[i])
            total += (inside * rows.width[i] / many)[:, None] * (basis.T @ form[i])
    found = np.array([np.mean(total * np.exp(-1j * m * theta)[:, None], axis=0) for m in orders])
    assert np.allclose(lines, found, atol=2e-4 * np.abs(found).max())


def test_teeth_that_are_alike_have_the_lines_of_one_of_them_together():
    outline = Profile.ball(0.012)
    alike = rows_of(Cutter(3, 0.012, helix=20 * DEG, profile=outline), SLOT, 0.002, 0.1e-3)
    # the same teeth, told apart by a pitch that differs by less than anyone can measure
    each = rows_of(Cutter(3, 0.012, helix=20 * DEG, pitch=2 * np.pi / 3 + np.array([1e-8, 0, -1e-8]), profile=outline), SLOT, 0.002, 0.1e-3)
    orders = np.arange(-7, 8)
    one, three = (lines_of_rows(rows, normal_form(rows, 3).transpose(0, 2, 1), orders).sum(axis=1) for rows in (alike, each))
    assert np.allclose(one, three, atol=1e-7 * np.abs(three).max())


def test_constant_lead_and_constant_angle_agree_on_a_wall_and_not_on_a_ball():
    z = np.array([0.001, 0.004, 0.009])
    wall = Cutter(2, 0.012, helix=30 * DEG, helix_kind=HelixKind.ANGLE)
    assert lags(wall, z)[0] == pytest.approx(z * np.tan(30 * DEG) / 0.006, rel=1e-12)
    ball = Cutter(2, 0.012, helix=30 * DEG, helix_kind="angle", profile=Profile.ball(0.012))
    # the integral of d kappa / sin kappa is ln tan(kappa / 2)
    kappa = np.arccos(1.0 - z[:2] / 0.006)
    wanted = np.tan(30 * DEG) * np.log(np.tan(0.5 * kappa[1]) / np.tan(0.5 * kappa[0]))
    found = lags(ball, z[:2])[0]
    assert found[1] - found[0] == pytest.approx(wanted, rel=1e-4)


def test_waves_lengthen_the_edge_and_keep_the_chips_area():
    engagement = Engagement.from_immersion(0.5, "down")
    plain = Cutter(3, 0.016, helix=30 * DEG)
    wavy = Cutter(3, 0.016, helix=30 * DEG, serration=Serration(0.25e-3, 1.5e-3))
    feed = 0.08e-3
    rows, smooth = rows_of(wavy, engagement, 0.006, feed), rows_of(plain, engagement, 0.006, feed)
    # four whole waves take what the smooth edges take but for what three teeth in a row leave to the next one
    assert volume(rows) == pytest.approx(3 * volume(smooth), rel=1e-3)
    assert np.degrees(np.abs(rows.kappa - 0.5 * np.pi).max()) == pytest.approx(46.0, abs=0.5)
    assert set(np.round(np.degrees(rows.delay)).astype(int)) == {120, 240, 360}


@pytest.mark.parametrize("shape", ["sine", "circular", "trapezoid", "table"])
def test_a_waves_slope_is_that_of_its_offset(shape):
    table = np.array([0.0, 0.6, 1.0, 0.2, -1.0, -0.8]) if shape == "table" else None
    wave = Serration(0.2e-3, 2e-3, shape, table=table)
    z = np.linspace(0.0, 4e-3, 977)
    (above, _), (below, _), (offset, slope) = (wave.at(place, 0.2) for place in (z + 1e-8, z - 1e-8, z))
    smooth = np.abs(above - 2.0 * offset + below) < 1e-12
    assert smooth.mean() > 0.95
    assert np.allclose(((above - below) / 2e-8)[smooth], slope[smooth], atol=1e-4)
    assert np.ptp(offset) == pytest.approx(0.4e-3, rel=1e-3)
    assert offset[0] == pytest.approx(wave.at(z[:1] + 2e-3, 0.2)[0][0], abs=1e-15)


def test_a_ball_that_does_not_reach_the_block_has_no_rows():
    ball, beside = Cutter(2, 0.012, profile=Profile.ball(0.012)), Block(-0.006, -0.004)
    reached = 0.006 - np.sqrt(0.006**2 - 0.004**2)
    assert rows_of(ball, beside, 0.99 * reached).count == 0
    assert rows_of(ball, beside, 1.01 * reached).count > 0


def test_a_map_takes_no_chip_where_the_tooth_has_none():
    """Behind the tool, and where a tool that leans forward lifts its edge out of the feed."""
    ball = Cutter(2, 0.012, profile=Profile.ball(0.012))
    full = EngagementMap([0.0, 0.004], [0.0, 0.0], [2.0 * np.pi, 2.0 * np.pi])
    rows = rows_of(ball, full, 0.003, 0.1e-3, nodes=24)
    assert rows.end.max() <= np.pi + 1e-9
    assert volume(rows) == pytest.approx(volume(rows_of(ball, SLOT, 0.003, 0.1e-3, nodes=24)), rel=1e-9)
    leaning = rows_of(ball, EngagementMap([0.0, 0.004], [0.0, 0.0], [2.0 * np.pi] * 2, feed_rise=0.4), 0.003, 0.1e-3, nodes=24)
    middle = 0.5 * (leaning.start + leaning.end)
    assert np.all(leaning.feed * np.sin(middle) + leaning.step > 0.0)
    # where the edge lies flatter than the feed climbs nothing is cut
    assert leaning.kappa.min() > 0.4


def test_constant_angle_on_a_cylinder_is_one_row_as_of_constant_lead():
    lead, angle = (rows_of(Cutter(3, 0.012, helix=0.5, helix_kind=kind), SLOT, 0.004, 0.1e-3) for kind in ("lead", "angle"))
    assert lead.count == angle.count == 1
    assert angle.far == pytest.approx(lead.far)


@pytest.mark.parametrize(
    ("cutter", "meet"),
    [
        (Cutter(2, 0.012, helix=np.radians([0.0, 60.0])), 0.5 * 0.012 * np.pi / np.tan(60 * DEG)),
        (Cutter(2, 0.012, helix=np.radians([20.0, 60.0]), helix_kind="angle"), 0.006 * np.pi / (np.tan(60 * DEG) - np.tan(20 * DEG))),
    ],
)
def test_teeth_meet_where_they_should(cutter, meet):
    assert deepest(cutter) == pytest.approx(meet, rel=1e-4)
    assert rows_of(cutter, SLOT, deepest(cutter) * (1.0 - 1e-4), 0.1e-3).count > 0
    with pytest.raises(InputError, match="meet"):
        rows_of(cutter, SLOT, meet * (1.0 + 1e-3), 0.1e-3)


def test_an_engagement_map_takes_several_arcs_at_a_height_and_nothing_above():
    table = EngagementMap([0.0, 0.0, 0.002, 0.002], np.array([0.1, 2.0, 0.3, 2.2]), np.array([0.9, 2.6, 1.1, 3.0]))
    found = table.arcs(np.full(3, 0.006), np.array([0.0, 0.001, 0.003]))
    assert found[:, 0].tolist() == [[0.1, 0.9], [2.0, 2.6]]
    assert found[:, 1] == pytest.approx(np.array([[0.2, 1.0], [2.1, 2.8]]))
    assert not np.any(found[:, 2])


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: rows_of(Cutter(2, 0.010, profile=Profile.chamfer(0.010, 0.002, 45 * DEG)), SLOT, 0.005), "depth"),
        (lambda: rows_of(Cutter(2, 0.012, helix=np.radians([0.0, 60.0])), SLOT, 0.012), "helix"),
        (lambda: rows_of(Cutter(3, 0.012, serration=Serration(0.2e-3, 2e-3)), SLOT, 0.002), "feed_per_tooth"),
        (lambda: widest(Block(0.010, 0.012), Profile.ball(0.012), 0.006), "engagement"),
        (lambda: Block(0.001, 0.001), "y_from and y_to"),
        (lambda: Stepover(0.0, "down"), "width"),
        (lambda: Stepover(0.001, "left"), "strategy"),
        (lambda: EngagementMap([0.001, 0.0], [0.0, 0.0], [1.0, 1.0]), "engagement map heights"),
        (lambda: EngagementMap([0.0], [1.0], [0.5]), "engagement map angles"),
        (lambda: EngagementMap([0.0], [1.0, 2.0], [0.5]), "engagement map"),
        (lambda: Serration(0.0, 1e-3), "serration amplitude"),
        (lambda: Serration(2e-3, 1e-3), "serration"),
        (lambda: Serration(0.5e-3, 1e-3, "circular"), "serration amplitude"),
        (lambda: Serration(0.1e-3, 1e-3, "table"), "serration table"),
        (lambda: Cutter(2, 0.012, helix=np.radians([30.0, 85.0])), "helix"),
        (lambda: Cutter(2, 0.012, tilt=0.1), "tilt"),
        (lambda: Cutter(2, 0.012, helix_kind="steep"), "helix_kind"),
        (lambda: Cutter(2, 0.012, axial_runout=[0.0]), "axial_runout"),
        (lambda: Cutter(2, 0.012, serration=Serration(0.1e-3, 1e-3, shift=np.zeros(3))), "serration shift"),
    ],
)
def test_cuts_that_cannot_be_are_refused_by_name(build, field):
    with pytest.raises(InputError) as error:
        build()
    assert error.value.field == field


def pieces_of(cutter, engagement, feed):
    """Which surface each tooth of a cylinder cuts into: (tooth, start, end, teeth back); none where nothing cuts."""
    rows = rows_of(cutter, engagement, 1e-3, feed)
    tooth = np.argmin(np.abs(rows.angle[:, None] - cutter.tooth_angle), axis=1)
    ahead = [np.cumsum(np.roll(cutter.pitch, -j)) for j in tooth]
    back = [int(np.argmin(np.abs(each - delay))) + 1 for each, delay in zip(ahead, rows.delay, strict=True)]
    return list(zip(tooth.tolist(), rows.start.tolist(), rows.end.tolist(), back, strict=True))


@settings(max_examples=60, deadline=None)
@given(
    runout=st.lists(st.floats(-8e-5, 8e-5), min_size=2, max_size=5),
    feed=st.floats(1e-5, 2e-4),
    entry=st.floats(0.0, 2.0),
    width=st.floats(0.1, 1.1),
)
def test_teeth_that_run_out_cut_where_the_chip_is(runout, feed, entry, width):
    """Against the smallest distance to the surfaces of the teeth ahead, angle by angle."""
    n = len(runout)
    weights = 1.0 + 0.3 * np.cos(np.arange(n) * 1.7)
    cutter = Cutter(n, 0.012, pitch=2.0 * np.pi * weights / weights.sum(), runout=np.array(runout))
    engagement = Engagement(entry, min(entry + width, np.pi))
    pieces = pieces_of(cutter, engagement, feed)
    for phi in np.linspace(engagement.entry, engagement.exit, 57)[1:-1]:
        for j in range(n):
            distances, moved = [], 0.0
            for back in range(1, n + 1):
                moved += feed * n * cutter.pitch[(j + back - 1) % n] / (2.0 * np.pi)
                distances.append(moved * np.sin(phi) + runout[j] - runout[(j + back) % n])
            near = np.sort(distances)
            here = [p for p in pieces if p[0] == j and p[1] <= phi < p[2]]
            assert len(here) <= 1
            if abs(near[0]) < 1e-9 or near[1] - near[0] < 1e-9 or any(abs(phi - a) < 1e-6 for p in pieces for a in p[1:3]):
                continue
            assert bool(here) == (near[0] > 0.0)
            if here:
                assert here[0][3] == int(np.argmin(distances)) + 1
