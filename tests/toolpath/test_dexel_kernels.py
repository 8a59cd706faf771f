"""Kernels of material removal against slow twins; this test runs again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.toolpath._kernels.dexel import cone_on_line, cut, frustum_on_line, radius_at, span_at, widest_between
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.solid import ToolSolid
from tests.oracles.swept import along, depth_in_tool, points_on_lines

CHORD = 1e-5
FLAT = ToolSolid.of(Cutter(2, 0.004), 0.02)
BALL = ToolSolid.of(Cutter(2, 0.004, profile=Profile.ball(0.004)), 0.02, CHORD)
LOLLIPOP = ToolSolid.of(Cutter(2, 0.004, profile=Profile.lollipop(0.004, 0.002)), 0.02, CHORD)
SHORT = ToolSolid.of(Cutter(2, 0.004, profile=Profile.ball(0.004)), 0.0024, CHORD)
CONE = ToolSolid.of(Cutter(2, 0.004, profile=Profile.tapered(0.004, 0.5, 0.0005, 0.0023)), 0.0023, CHORD)
UP = np.array([[0.0, 0.0, 1.0]] * 2)
LEANING = np.array([[0.3, 0.1, 1.0], [0.1, -0.2, 1.0]])


def test_a_line_is_cut_like_a_set_of_points():
    rng = np.random.default_rng(3)
    places = np.linspace(0.0, 1.0, 2001)[:-1] + 0.25e-3
    for _ in range(50):
        seg, count = np.zeros((1, 1, 12, 2)), np.ones((1, 1), dtype=np.int16)
        seg[0, 0, 0] = 0.0, 1.0
        left = np.ones(places.size, dtype=bool)
        for _ in range(10):
            low = rng.uniform(-0.1, 1.0)
            high = low + rng.choice([0.02, 0.1, 0.4])
            before = left.copy()
            left &= ~((places > low) & (places < high))
            assert cut(seg, count, 0, 0, low, high) == pytest.approx(np.mean(before) - np.mean(left), abs=1e-2)
        held = seg[0, 0, : count[0, 0]]
        assert np.all(np.diff(held.ravel()) >= 0.0)
        inside = np.any((places[:, None] > held[:, 0]) & (places[:, None] < held[:, 1]), axis=1)
        assert np.array_equal(inside, left)


def test_a_line_without_room_stays_as_it_is():
    seg, count = np.zeros((1, 1, 1, 2)), np.ones((1, 1), dtype=np.int16)
    seg[0, 0, 0] = 0.0, 1.0
    assert cut(seg, count, 0, 0, 0.4, 0.6) == -1.0
    assert seg.ravel().tolist() == [0.0, 1.0]
    # at its ends it needs none
    assert cut(seg, count, 0, 0, 0.6, 1.2) == pytest.approx(0.4)


def test_radii_of_an_outline():
    outline, peak = LOLLIPOP.outline, LOLLIPOP.peak
    heights = np.linspace(0.0, outline[0, -1], 400)
    radii = np.interp(heights, *outline)
    assert [radius_at(outline, each) for each in heights] == pytest.approx(radii, abs=1e-12)
    assert radius_at(outline, -1e-9) == radius_at(outline, 0.021) == -1.0
    assert widest_between(outline, -1.0, 1.0) == outline[1].max()
    assert widest_between(outline, 0.0001, 0.0004) == pytest.approx(np.interp(0.0004, *outline))
    fine = np.linspace(0.0, outline[0, -1], 200001)
    for radius in (0.0003, 0.0009, 0.0014, 0.0019):
        wide = fine[np.interp(fine, *outline) >= radius]
        # from the neck up, a thin line meets the shank as well
        assert span_at(outline, peak, radius) == pytest.approx((wide[0], wide[-1]), abs=2e-7)


def test_a_disc_that_grows_sweeps_the_hull_of_its_ends():
    rng = np.random.default_rng(5)
    share = np.linspace(0.0, 1.0, 4001)
    for _ in range(40):
        a0, o0, a1, o1, o = rng.uniform(-1.0, 1.0, 5)
        r0, r1 = rng.uniform(0.0, 0.8, 2)
        half = (r0 + share * (r1 - r0)) ** 2 - (o - o0 - share * (o1 - o0)) ** 2
        low, high = cone_on_line(a0, o0, r0, a1, o1, r1, o)
        if not np.any(half > 0.0):
            assert not high - low > 0.02
            continue
        middle, half = (a0 + share * (a1 - a0))[half > 0.0], np.sqrt(half[half > 0.0])
        assert (low, high) == pytest.approx((np.min(middle - half), np.max(middle + half)), abs=2e-3)


def test_a_line_through_a_piece_of_a_cone():
    rng = np.random.default_rng(6)
    share = np.linspace(-4.0, 4.0, 20001)
    for k in range(60):
        start, way = rng.uniform(-1.0, 1.0, 3), rng.normal(size=3)
        way /= np.linalg.norm(way)
        if k % 3 == 0:
            way = np.array([0.0, 0.0, 1.0]) if k % 2 else np.array([1.0, 0.0, 0.0])
        r0, r1 = rng.uniform(0.1, 1.0, 2)
        r1 = r0 if k % 4 == 0 else r1
        x, y, z = start[:, None] + share * way[:, None]
        inside = (z >= 0.0) & (z <= 0.7) & (np.hypot(x, y) <= r0 + (r1 - r0) * z / 0.7)
        low, high = frustum_on_line(*start, *way, 0.0, r0, 0.7, r1)
        if np.any(inside):
            assert (low, high) == pytest.approx((share[inside][0], share[inside][-1]), abs=1e-3)
        else:
            assert high - low < 2e-3


@pytest.mark.parametrize("aside", [0.0, 0.3, -0.4])
def test_a_line_along_the_side_of_a_cone(aside):
    """The square of the way drops out where a line leans as the side does; through the apex all of it does."""
    share = np.linspace(-4.0, 4.0, 20001)
    for slope, sign in ((0.5, 1.0), (0.5, -1.0), (-0.5, 1.0)):
        way = np.array([abs(slope), 0.0, sign]) / np.hypot(slope, 1.0)
        for x in (-0.8, -0.3, 0.0, 0.45, 1.4):
            low, high = frustum_on_line(x, aside, 0.1, *way, 0.0, 0.6, 0.7, 0.6 + 0.7 * slope)
            place = np.array([x, aside, 0.1])[:, None] + share * way[:, None]
            inside = (place[2] >= 0.0) & (place[2] <= 0.7) & (np.hypot(place[0], place[1]) <= 0.6 + slope * place[2])
            if np.any(inside):
                assert (low, high) == pytest.approx((share[inside][0], share[inside][-1]), abs=1e-3)
            else:
                assert high - low < 2e-3


@pytest.mark.parametrize(
    ("solid", "move", "axes"),
    [
        (FLAT, [[0.001, 0.002, 0.003], [0.007, 0.0045, 0.003]], UP),
        (FLAT, [[0.001, 0.002, 0.005], [0.007, 0.0045, 0.002]], UP),
        (BALL, [[0.001, 0.002, 0.002], [0.007, 0.0025, 0.002]], UP),
        (BALL, [[0.001, 0.002, 0.002], [0.005, 0.0045, 0.004]], UP),
        (BALL, [[0.003, 0.002, 0.005], [0.003, 0.002, 0.001]], UP),
        (LOLLIPOP, [[0.001, 0.002, 0.001], [0.006, 0.002, 0.001]], UP),
        (LOLLIPOP, [[0.003, 0.002, 0.003], [0.003, 0.002, 0.001]], UP),
        (FLAT, [[0.006, 0.002, 0.003], [0.003, 0.001, 0.003], [-0.001, 0.004, 0.003]], UP),
        (SHORT, [[-0.001, -0.001, 0.0015], [0.006, 0.0045, 0.0005]], UP),
        (SHORT, [[0.007, -0.001, 0.0005], [0.001, 0.0045, 0.0015]], UP),
        (CONE, [[0.003, 0.001, 0.0026], [0.006, 0.0015, 0.0021]], UP),
        (FLAT, [[0.001, 0.002, 0.003], [0.004, 0.003, 0.003]], LEANING),
        (LOLLIPOP, [[0.001, 0.002, 0.001], [0.003, 0.003, 0.0015]], LEANING),
    ],
)
def test_what_is_left_is_what_no_place_of_the_tool_holds(solid, move, axes):
    """On all three grids, but for points nearer to the surface than steps and chords tell."""
    shift = np.array([0.013, 0.006, -0.021])
    move = np.array(move) + shift
    field = DexelField.block(shift, shift + np.array([0.008, 0.005, 0.004]), 0.7e-3)
    path = ToolPath(move, axes=axes[[0] * (len(move) - 1) + [1]])
    full = field.copy()
    tolerance = 5e-5
    sweep = Sweep(field, solid, path, tolerance=tolerance)
    sweep.run()
    changed = 0
    for grid in range(3):
        left = np.where(np.arange(field.segs[grid].shape[2]) < field.counts[grid][..., None], np.diff(field.segs[grid])[..., 0], 0.0).sum(
            axis=2
        )
        taken = np.diff(full.segs[grid])[..., 0].sum(axis=2) - left
        assert sweep.told[:, grid].sum() == pytest.approx(taken.sum())
        changed += np.count_nonzero(taken > 1e-12)
    assert sweep.updates >= changed
    tips = along(move, 300)
    ways = along(path.axes, 300)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    rng = np.random.default_rng(7)
    for grid in range(3):
        points, held = points_on_lines(field, grid, rng, 300)
        depth = depth_in_tool(points, tips, ways, solid.heights, solid.radii)
        # a point may be near to the surface along the axis, too
        raised = [depth_in_tool(points + shift * ways[0], tips, ways, solid.heights, solid.radii) for shift in (-2e-4, 2e-4)]
        sure = (np.sign(raised[0]) == np.sign(depth)) & (np.sign(raised[1]) == np.sign(depth)) & ~(np.abs(depth) < 2e-4)
        assert np.mean(sure) > 0.75
        assert np.array_equal(held[sure], depth[sure] < 0.0)
