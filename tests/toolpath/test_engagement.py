"""Engagement along paths: closed forms of arcs at any place of the lattice, ramps, plunges, leaning tools, volumes, chips."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import EngagementMap
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.engagement import chip_between_circles, chip_thickness, engagement_along
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.solid import ToolSolid
from tests.toolpath.test_surface_kernels import box

R, CELL = 0.005, 0.25e-3
FLAT = ToolSolid.of(Cutter(2, 2 * R), 0.04)
BALL = ToolSolid.of(Cutter(2, 2 * R, profile=Profile.ball(2 * R)), 0.04)


def beside_a_pass(solid, ae, angle, side, ap, seed, cell=CELL, turn=None):
    """Engagement in the middle of a block of a pass beside one that was cut before; all turned, where a turn is given."""
    rng = np.random.default_rng(seed)
    turn = np.eye(3) if turn is None else turn
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    centre = np.array([0.02, 0.02, 0.01 - ap]) + rng.uniform(-1e-3, 1e-3, 3) * [1.0, 1.0, 0.0]
    before = centre - side * ae * np.array([-way[1], way[0], 0.0])
    points, faces = box([0.0, 0.0, 0.0], [0.04, 0.04, 0.01])
    field = DexelField.from_mesh(points @ turn.T, faces, cell)
    axes = np.tile(turn[:, 2], (3, 1))
    Sweep(field, solid, ToolPath(np.array([before - 0.04 * way, before + 0.04 * way]) @ turn.T, axes=axes[:2])).run()
    places = np.array([centre - 0.008 * way, centre, centre + 1e-4 * way]) @ turn.T
    return engagement_along(Sweep(field, solid, ToolPath(places, axes=axes)))


def stepover(radius, ae, side):
    angle = np.arccos(np.clip(1.0 - ae / radius, -1.0, 1.0))
    return (0.0 * angle, angle) if side > 0 else (np.pi - angle, np.pi + 0.0 * angle)


@pytest.mark.parametrize("solid", [FLAT, BALL], ids=["flat", "ball"])
@pytest.mark.parametrize("seed", range(8))
def test_arcs_beside_a_straight_wall_are_exact(solid, seed):
    """However the wall lies to the lattice; the top of the material, too, which no plane of the lattice goes through."""
    rng = np.random.default_rng(100 + seed)
    ae, angle, side, ap = rng.uniform(3e-4, 9.7e-3), rng.uniform(0.0, 2.0 * np.pi), (-1) ** seed, rng.uniform(1.2e-3, 4e-3)
    if solid is BALL:
        ae, ap = 0.5 * ae, ap + 1e-3
    found = beside_a_pass(solid, ae, angle if seed > 1 else 0.0, side, ap, seed).at(1)
    radius = solid.radius_at(found.z)
    # near its tip a ball is narrower than the width of the cut
    wide = (radius > 0.501 * ae) & (found.z > found.z[0]) & (found.z < found.z[-1])
    assert np.count_nonzero(wide) >= 2
    start, end = stepover(radius[wide], ae, side)
    assert found.start[wide] == pytest.approx(start, abs=1e-6)
    assert found.end[wide] == pytest.approx(end, abs=1e-6)
    assert (found.z[0], found.z[-1]) == pytest.approx((0.0, ap), abs=1e-9)


def test_arcs_beside_a_curved_wall():
    """A ring around a circular pocket: two circles meet, to the second order of the cell."""
    inner, ae, centre = 0.0075, 0.0031, np.array([0.0251, 0.0247])
    turn = np.radians(np.arange(0.0, 360.25, 0.25))
    ring = [np.column_stack([centre + r * np.stack([np.cos(turn), np.sin(turn)], axis=1), np.full(turn.size, 0.0077)]) for r in (0.0, ae)]
    circle = inner * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    field = DexelField.block([0.0, 0.0, 0.0], [0.05, 0.05, 0.01], CELL)
    Sweep(field, FLAT, ToolPath(ring[0] * 1.0 + circle)).run()
    outer = inner + ae
    path = ToolPath(np.column_stack([centre + outer * np.stack([np.cos(turn), np.sin(turn)], axis=1), np.full(turn.size, 0.0077)])[:400])
    found = engagement_along(Sweep(field, FLAT, path))
    # counterclockwise the normal points to the middle; chords turn by half a step less than the circle
    start = np.arccos((outer**2 + R**2 - (inner + R) ** 2) / (2.0 * outer * R)) - np.radians(0.125)
    for move in range(100, 399, 20):
        each = found.at(move)
        assert each.start == pytest.approx(np.full(each.z.size, start), abs=np.radians(0.1))
        assert each.end == pytest.approx(np.full(each.z.size, np.pi), abs=1e-9)


def test_slots_islands_and_empty_passes():
    field = DexelField.block([0.0, 0.0, 0.0], [0.04, 0.03, 0.01], CELL)
    path = np.array([[-0.01, 0.015, 0.008], [0.02, 0.015, 0.008], [0.0201, 0.015, 0.008], [0.05, 0.015, 0.008]])
    found = engagement_along(Sweep(field, FLAT, ToolPath(path)))
    slot = found.at(1)
    assert np.degrees(slot.start) == pytest.approx(0.0, abs=1e-9)
    assert np.degrees(slot.end) == pytest.approx(180.0, abs=1e-9)
    assert found.volume.sum() == pytest.approx(2e-3 * 0.01 * 0.04, rel=1e-3)
    again = engagement_along(Sweep(field, FLAT, ToolPath(path)))
    assert again.at(1) is None
    assert again.volume.sum() == pytest.approx(0.0, abs=1e-15)
    # a wider tool over the same slot cuts on both of its sides
    wide = ToolSolid.of(Cutter(2, 0.016), 0.04)
    both = engagement_along(Sweep(field, wide, ToolPath(path))).at(1)
    side = np.arccos(0.005 / 0.008)
    assert both.z.size == 2 * np.unique(both.z).size
    first = both.z == both.z[2]
    assert both.start[first] == pytest.approx([0.0, np.pi - side], abs=1e-6)
    assert both.end[first] == pytest.approx([side, np.pi], abs=1e-6)


def test_a_ball_that_goes_down_cuts_behind_itself():
    field = DexelField.block([0.0, 0.0, 0.0], [0.04, 0.04, 0.01], CELL)
    path = np.array([[0.012, 0.02, 0.011], [0.02, 0.02, 0.007], [0.0202, 0.02, 0.0069]])
    found = engagement_along(Sweep(field, BALL, ToolPath(path)))
    own, rise = found.at(1), np.arctan2(-1.0, 2.0)
    assert own.feed_rise == pytest.approx(rise)
    # where the surface lies along the feed: sin(phi) = cot(kappa) tan(rise)
    z = np.unique(found.height[found.arcs_of(1)])[2:6]
    graze = np.arcsin(BALL.slope_at(z) * np.tan(rise))
    for height, angle in zip(z, graze, strict=True):
        here = own.z == height
        assert own.start[here] == pytest.approx([0.0, 2.0 * np.pi + angle], abs=1e-6)
        assert own.end[here] == pytest.approx([np.pi - angle, 2.0 * np.pi], abs=1e-6)
    assert found.volumes(BALL)[found.arcs_of(1)].sum() == pytest.approx(found.volume[1], rel=1e-9)


def test_a_plunge_is_engaged_all_round():
    field = DexelField.block([0.0, 0.0, 0.0], [0.04, 0.04, 0.01], CELL)
    path = np.array([[0.02, 0.02, 0.011], [0.02, 0.02, 0.008], [0.02, 0.02, 0.0079]])
    found = engagement_along(Sweep(field, BALL, ToolPath(path)))
    own = found.at(1)
    assert own.feed_rise == pytest.approx(-0.5 * np.pi)
    assert np.all(own.start == 0.0)
    assert own.end == pytest.approx(np.full(own.z.size, 2.0 * np.pi))
    assert found.volume == pytest.approx([np.pi * h**2 * (R - h / 3.0) - b for h, b in ((2e-3, 0.0), (2.1e-3, 5.4454e-8))], rel=5e-3)


@pytest.mark.parametrize("seed", range(3))
def test_leaning_tools_see_what_upright_ones_see(seed):
    """The same cut, all turned in space: within 2 degrees at a cell of 0.05 R."""
    turn = Rotation.from_rotvec(np.random.default_rng(seed).normal(size=3) * 0.4).as_matrix()
    ae, side, ap = (0.002, 0.005, 0.008)[seed], (-1) ** seed, 0.0023
    found = beside_a_pass(FLAT, ae, 0.3, side, ap, seed, turn=turn).at(1)
    start, end = stepover(R, ae, side)
    whole = (found.z > 2.0 * CELL) & (found.z < ap - 1.5 * CELL)
    assert found.start[whole] == pytest.approx(np.full(np.count_nonzero(whole), start), abs=np.radians(2.0))
    assert found.end[whole] == pytest.approx(np.full(np.count_nonzero(whole), end), abs=np.radians(2.0))
    assert found.z[-1] == pytest.approx(ap, abs=0.8 * CELL)


@pytest.mark.parametrize("side", [-1, 1])
def test_layers_between_two_planes_have_one_slice(side):
    """Thinner than a cell: known to half a cell across the feed, their height exactly."""
    ae, ap = 0.0035, 0.1e-3
    found = beside_a_pass(FLAT, ae, 1.1, side, ap, 4).at(1)
    start, end = stepover(R, ae, side)
    assert (found.z[0], found.z[-1]) == pytest.approx((0.0, ap), abs=1e-9)
    assert R * np.cos(found.start[0]) == pytest.approx(R * np.cos(start), abs=CELL)
    assert R * np.cos(found.end[0]) == pytest.approx(R * np.cos(end), abs=CELL)


def test_volumes_of_moves_add_up_and_follow_the_width():
    field = DexelField.block([0.0, 0.0, 0.0], [0.04, 0.03, 0.01], CELL)
    before = field.volume
    path = ToolPath(np.array([[-0.006, 0.0, 0.0085], [0.046, 0.0, 0.0085]])).resampled(2e-4)
    found = engagement_along(Sweep(field, FLAT, path))
    assert found.volume.sum() == pytest.approx(before - field.volume, rel=1e-12)
    steady = found.volume[100:180]
    assert steady == pytest.approx(np.full(80, 2e-4 * R * 1.5e-3), rel=0.03)
    arcs = found.volumes(FLAT)
    assert [arcs[found.arcs_of(k)].sum() for k in (110, 150)] == pytest.approx(found.volume[[110, 150]], rel=1e-9)


def test_a_map_is_an_engagement_for_forces():
    cutter = Cutter(2, 2 * R)
    found = beside_a_pass(FLAT, 0.005, 0.0, 1, 0.002, 1).at(1)
    assert isinstance(found, EngagementMap)
    process = MillingProcess(cutter, CuttingCoefficients(8e8, 0.3), found, feed_per_tooth=1e-4)
    order = np.arange(1, 4) * 2
    force, _ = force_and_slope(cutter, process.conditions(1000.0, 0.002), process.coefficients, order)
    plain = MillingProcess(cutter, process.coefficients, type(process.widest).from_immersion(0.5, "up"), feed_per_tooth=1e-4)
    wanted, _ = force_and_slope(cutter, plain.conditions(1000.0, 0.002), plain.coefficients, order)
    assert force == pytest.approx(wanted, rel=1e-3, abs=1e-3 * np.max(np.abs(wanted)))


def test_chips_between_two_circles():
    """h = f sin(phi) + f^2 cos^2(phi) / (2 R) + O(f^3 / R^2): of the second order of f / R."""
    angle = np.linspace(0.0, np.pi, 181)
    errors = []
    for feed in (4e-4, 2e-4, 1e-4):
        chip = chip_between_circles(np.array([-feed, 0.0]), R, angle)
        errors.append(np.max(np.abs(chip - feed * np.sin(angle))))
        assert errors[-1] <= feed**2 / R
        third = np.max(np.abs(chip - feed * np.sin(angle) - (feed * np.cos(angle)) ** 2 / (2.0 * R)))
        assert third < 0.6 * feed**3 / R**2
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.1)
    with pytest.raises(InputError, match="less than the radius"):
        chip_between_circles(np.array([0.006, 0.0]), R, angle)


def test_chips_of_any_feed():
    feed = np.array([1e-4, 0.0, -3e-5])
    assert chip_thickness(FLAT, feed, np.radians([0.0, 90.0]), np.array([1e-3])) == pytest.approx([0.0, 1e-4])
    # at 45 degrees of a ball's arc the way down counts as much as the way ahead
    height = R * (1.0 - np.sqrt(0.5))
    assert chip_thickness(BALL, feed, np.radians([90.0]), np.array([height])) == pytest.approx((1e-4 + 3e-5) * np.sqrt(0.5), rel=1e-2)
