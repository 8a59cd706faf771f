"""Kernels of engagement against slow twins; this test runs again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.toolpath._kernels import engagement as kernels
from rcsa_ident.toolpath._kernels.engagement import arcs_of, distance_at, leaning_arcs, radius_and_slope, slice_arcs
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.solid import ToolSolid
from tests.oracles.halfspace import TURN, arcs_in, half_space, ordered

FLAT = ToolSolid.of(Cutter(2, 0.004), 0.02)
WIDE = ToolSolid.of(Cutter(2, 0.008), 0.02)
BALL = ToolSolid.of(Cutter(2, 0.004, profile=Profile.ball(0.004)), 0.02, 1e-5)
LOLLIPOP = ToolSolid.of(Cutter(2, 0.004, profile=Profile.lollipop(0.004, 0.002)), 0.02, 1e-5)


def test_radius_and_slope_of_an_outline():
    solid = ToolSolid.of(Cutter(2, 0.004, profile=Profile.bull_nose(0.004, 0.001)), 0.02, 1e-6)
    for height in np.linspace(0.0, 0.0199, 30):
        radius, slope = radius_and_slope(solid.outline, height)
        assert radius == pytest.approx(solid.radius_at(height), abs=1e-15)
        assert slope == pytest.approx((solid.radius_at(height + 1e-9) - radius) / 1e-9, rel=1e-3, abs=1e-6)
    assert radius_and_slope(solid.outline, -1e-9)[0] == radius_and_slope(solid.outline, 0.021)[0] == -1.0


@pytest.mark.parametrize("seed", range(4))
def test_arcs_join_neighbours(seed):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(-np.pi, np.pi, 40))
    inside, facing = rng.random(40) < 0.7, np.sin(angle) > 0.0
    arcs, border = np.empty((30, 2)), np.empty((30, 4), dtype=np.int64)
    found = arcs_of(angle, inside, facing, np.array([0.0, np.pi]), arcs, border)
    held = np.zeros(40, dtype=bool)
    for low, high in arcs[:found]:
        held |= ((angle > low) & (angle < high)) | ((angle + 2.0 * np.pi > low) & (angle + 2.0 * np.pi < high))
    assert np.array_equal(held, inside & facing)
    assert np.all(np.diff(arcs[:found].ravel()) > 0.0)


def test_a_full_circle_is_one_arc():
    angle = np.linspace(-3.0, 3.0, 7)
    arcs, border = np.empty((2, 2)), np.empty((2, 4), dtype=np.int64)
    assert arcs_of(angle, np.ones(7, dtype=bool), np.ones(7, dtype=bool), np.full(2, np.nan), arcs, border) == 1
    assert arcs[0].tolist() == [0.0, 2.0 * np.pi]


def test_distances_from_a_block_and_a_slope():
    field = DexelField.block([0.0, 0.0, 0.0], [0.012, 0.012, 0.012], 1e-3)
    for x, wanted in ((0.0, 0.0), (0.0007, 0.0007), (-0.0004, -0.0004)):
        assert distance_at(field.segs, field.counts, field.lattice, x, 0.006, 0.006) == pytest.approx(wanted, abs=1e-12)
    # lines cut off along x + y + z = 9 mm
    normal = np.ones(3) / np.sqrt(3.0)
    for along, (seg, shape) in enumerate(zip(field.segs, field.counts, strict=True)):
        for m in range(shape.shape[0]):
            for n in range(shape.shape[1]):
                others = [(2, 1), (2, 0), (0, 1)][along]
                rest = 9e-3 - sum(field.lattice[0, a] + i * field.cell[a] for a, i in zip(others, (m, n), strict=True))
                seg[m, n, 0, 1] = min(max(rest, 1e-9), seg[m, n, 0, 1])
    point = np.array([0.0035, 0.003, 0.0024])
    wanted = (9e-3 - point.sum()) * normal[0]
    assert distance_at(field.segs, field.counts, field.lattice, *point) == pytest.approx(wanted, abs=1e-10)


def test_a_slice_beside_a_wall_is_the_closed_form():
    """A pass beside one that was cut: the wall crosses the circle at arccos(1 - ae / R), wherever it lies to the lattice."""
    field = DexelField.block([0.0, 0.0, 0.0], [0.010, 0.009, 0.002], 0.5e-3)
    centre, way, ae = np.array([0.0052, 0.0047]), np.array([np.cos(0.4), np.sin(0.4)]), 0.0011
    normal = np.array([-way[1], way[0]])
    for shift, end in ((-ae * normal, 0.01 * way), (0.0 * normal, 0.0 * way)):
        ends = np.array([centre + shift - 0.01 * way, centre + shift + end])
        Sweep(field, FLAT, ToolPath(np.column_stack([ends, [0.0005, 0.0005]]))).run()
    arcs, step = np.empty((4, 2)), 5e-5
    circle, cut_from = np.array([*(centre + step * way), 0.002]), np.array([*centre, 0.002])
    found = slice_arcs(field.segs, field.counts, field.lattice, 2, circle, cut_from, np.array([*way, 0.0]), 0.0, arcs)
    assert found == 1
    assert arcs[0] == pytest.approx([0.0, np.arccos(1.0 - ae / 0.002)], abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_slices_of_a_half_plane_in_front_are_the_closed_form(seed):
    """Any wall and any feed, up and down, of tools that widen or narrow upwards, in cells that are not square, by what was cut before."""
    rng = np.random.default_rng(seed)
    lattice = np.array([[0.0, 0.001, 0.0], [0.43e-3, 0.34e-3, 0.5e-3]])
    radius, step, compared = 0.0021, 5e-5, 0
    for _ in range(6):
        centre, way, side = rng.uniform([0.0040, 0.0050], [0.0055, 0.0065]), rng.uniform(0.0, TURN), rng.uniform(0.0, TURN)
        share, rise, slope = rng.uniform(-1.2, 1.2), rng.uniform(-1.4, 1.4), rng.uniform(-2.0, 2.0)
        steep, level = slope * np.sin(rise), np.cos(rise)
        frame = np.array([[np.cos(way), np.sin(way)], [-np.sin(way), np.cos(way)]])
        normal = np.array([np.sin(side), np.cos(side)]) @ frame
        here = centre + step * level * frame[0]
        cut_from = np.array([*centre, radius + steep * step])
        segs, counts = half_space(lattice, (23, 28, 3), [*normal, 0.0], normal @ here + share * radius, cut_from)
        expected = arcs_in(side, steep / level, share)
        gaps = np.diff(np.sort(expected.ravel() % TURN)) if expected.size else np.ones(1)
        # what lies between two lines is not seen
        if (
            np.any(gaps < 0.5)
            or np.any(np.diff(expected)[:, 0] < 0.5)
            or abs(abs(share) - 1.0) < 0.1
            or abs(abs(steep) - level) < 0.2 * level
        ):
            continue
        compared += 1
        arcs = np.empty((5, 2))
        found = slice_arcs(
            segs, counts, lattice, 1, np.array([*here, radius]), cut_from, np.array([*(level * frame[0]), np.sin(rise)]), slope, arcs
        )
        assert found == len(expected)
        assert ordered(arcs[:found]) == pytest.approx(expected, abs=1e-7)
    assert compared


def test_a_chip_beside_the_wall_cut_last_has_a_micrometre():
    radius = 0.002
    for thick, long, kept in ((0.99e-6, 0.0, 0), (1.01e-6, 0.0, 1), (0.99e-6, TURN, 1)):
        angle = abs(long - np.arccos(1.0 - thick / radius))
        arcs = np.array([[9.0, 9.0], [0.3, 0.3 + angle]])
        assert kernels._keep(arcs, 1, 0, True, radius) == kept
        assert arcs[0].tolist() == (arcs[1] if kept else np.full(2, 9.0)).tolist()
    # away from that wall any is kept
    assert kernels._keep(np.array([[0.3, 0.301]]), 0, 0, False, radius) == 1


@pytest.mark.parametrize("seed", range(4))
def test_leaning_arcs_in_a_half_space_are_the_closed_form(seed):
    rng = np.random.default_rng(seed)
    lattice, shape = np.array([[0.0, 0.001, -0.002], [0.45e-3, 0.4e-3, 0.5e-3]]), (24, 27, 21)
    centre, radius = np.array([0.0051, 0.0060, 0.0030]), 0.0022
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    offset = normal @ centre + rng.uniform(-0.6, 0.6) * radius
    segs, counts = half_space(lattice, shape, normal, offset)
    for _ in range(3):
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        across = normal @ frame[:, 0], normal @ frame[:, 1]
        rise, slope = rng.uniform(-1.4, 1.4), rng.uniform(-1.5, 1.5)
        steep, size = slope * np.tan(rise), np.hypot(*across)
        expected = arcs_in(np.arctan2(*across), steep, (offset - normal @ centre) / radius / size)
        arcs = np.empty((5, 2))
        found = leaning_arcs(segs, counts, lattice, centre, frame, radius, np.array([np.cos(rise), np.sin(rise)]), slope, arcs)
        assert found == len(expected)
        assert ordered(arcs[:found]) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_distances_from_any_plane(seed):
    """To the part that a line has in it which meets the plane farther than three cells away, and is not asked."""
    rng = np.random.default_rng(seed)
    lattice, shape = np.array([[0.0, 0.001, -0.002], [0.45e-3, 0.4e-3, 0.5e-3]]), (20, 22, 17)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    middle = lattice[0] + 0.5 * lattice[1] * shape
    segs, counts = half_space(lattice, shape, normal, normal @ middle)
    for away in (-2.2e-3, -0.3e-3, -0.1e-3, 0.0, 0.1e-3, 0.3e-3, 2.2e-3):
        point = middle + np.cross(normal, rng.normal(size=3)) * 5e-4 - away * normal
        reach = min(abs(away), 1e-3) + 6e-4
        left_out = np.sum((np.abs(normal) < reach / 1.5e-3) * normal**2)
        assert distance_at(segs, counts, lattice, *point) == pytest.approx(np.clip(away, -1e-3, 1e-3), abs=0.5 * left_out * reach + 1e-9)


def test_distances_beside_a_block():
    """Beside the lattice the distance is that along one axis, and no more than two of the largest cells."""
    lattice, shape = np.array([[0.0, 0.001, -0.002], [0.45e-3, 0.4e-3, 0.5e-3]]), (12, 13, 11)
    segs, counts = half_space(lattice, shape, np.array([0.0, 0.0, 1.0]), 1.0)
    low, high = lattice[0] - 0.5 * lattice[1], lattice[0] + (np.array(shape) - 0.5) * lattice[1]
    middle = 0.5 * (low + high)
    for axis in range(3):
        for away, wanted in ((0.3e-3, 0.3e-3), (0.6e-3, 0.6e-3), (3e-3, 1e-3), (-0.3e-3, -0.3e-3), (-0.6e-3, -0.6e-3), (-2e-3, -1e-3)):
            for beyond in (low[axis] - away, high[axis] + away):
                point = middle.copy()
                point[axis] = beyond
                assert distance_at(segs, counts, lattice, *point) == pytest.approx(-wanted, abs=1e-12)
    # at a corner the farther of the ways
    assert distance_at(segs, counts, lattice, *(low - [0.6e-3, 0.7e-3, 0.5e-3])) == pytest.approx(-0.7e-3, abs=0.1e-3)


#: A wall stands clear of the neck of the last one.
@pytest.mark.parametrize("seed", range(9))
def test_planes_of_an_upright_tool_beside_a_wall(seed):
    """All planes, or the first, the last and every so many between; the engagement ends with the material, the edge, or half way on."""
    rng = np.random.default_rng(seed)
    solid = (FLAT, BALL, LOLLIPOP)[seed % 3]
    field = DexelField.block([0.0, 0.0, 0.0], [0.012, 0.011, 0.0032], 0.35e-3)
    foot, top = rng.uniform(0.0, 0.0004), rng.uniform(0.0025, 0.0032)
    height = field.lattice[0, 2] + field.cell[2] * np.arange(field.shape[2])
    field.segs[2][:, :, 0] = foot, top
    for count in field.counts[:2]:
        count[(height < foot) | (height > top)] = 0
    turn, side, beside = rng.uniform(0.0, TURN), (-1) ** seed, rng.uniform(1.05e-3, 1.4e-3)
    way = np.array([np.cos(turn), np.sin(turn)])
    centre, left = rng.uniform(0.0052, 0.0058, 2), side * np.array([-way[1], way[0]])
    tip, most, edge = rng.uniform(-0.0015, 0.0012), (100, 4)[seed % 2], 0.0021 if seed > 5 else solid.edge
    z = height[(height >= max(foot, tip)) & (height <= min(top, tip + edge))] - tip
    every = max((z.size - 1) // (most - 1), 1)
    z = np.append(z[:-1:every], z[-1])
    radii = np.interp(z, solid.heights, solid.radii)
    # no arc that is too short for the lines
    while np.any(np.abs(radii / beside - 1.03) < 0.04):
        beside += 2e-5
    for tool, middle, height, stop in ((WIDE, centre + (beside - 0.004) * left, -0.001, 0.02), (solid, centre, tip, 0.0)):
        ends = np.array([middle - 0.02 * way, middle + stop * way])
        Sweep(field, tool, ToolPath(np.column_stack([ends, [height, height]]))).run()
    tips = np.array([[*centre, tip], [*(centre + 5e-5 * way), tip]])
    outline = np.stack([solid.heights, solid.radii])
    extent = np.array([max(foot - tip, 0.0), min(top - tip, edge)])
    if not seed % 2:
        # beyond the field there are no planes
        extent += [-9e-4, 9e-4 * (edge == solid.edge)]
    rows = np.empty((40, 3))
    found = kernels.engage_upright(field.segs, field.counts, field.lattice, tips, outline, edge, np.array([*way, 0.0]), most, rows, extent)
    cuts = z[radii > beside]
    assert rows[:found, 0] == pytest.approx(cuts)
    angle = np.arccos(beside / radii[radii > beside])
    wanted = np.stack([0.0 * angle, angle] if side > 0 else [np.pi - angle, np.pi + 0.0 * angle], axis=1)
    assert rows[:found, 1:] == pytest.approx(wanted, abs=1e-6)
    half = 0.5 * every * field.cell[2]
    below, above = z[0] == cuts[0], z[-1] == cuts[-1]
    assert extent[0] == pytest.approx(max(foot - tip, 0.0) if below else cuts[0] - half)
    assert extent[1] == pytest.approx(min(top - tip, edge) if above else cuts[-1] + half)


@pytest.mark.parametrize("seed", range(4))
def test_a_tool_that_leaves_a_block_by_any_side(seed):
    rng = np.random.default_rng(seed)
    lattice, shape = np.array([[0.0, 0.001, 0.0], [0.43e-3, 0.34e-3, 0.5e-3]]), np.array([23, 28, 3])
    low, high = lattice[0] - 0.5 * lattice[1], lattice[0] + (shape - 0.5) * lattice[1]
    axis, up = divmod(seed, 2)
    normal, radius = np.zeros(3), 0.002
    normal[axis] = 1.0 if up else -1.0
    compared = 0
    for _ in range(16):
        centre, turn, share = 0.5 * (low + high)[:2], rng.uniform(0.0, TURN), rng.uniform(-0.8, 0.8)
        way = np.array([np.cos(turn), np.sin(turn), 0.0])
        centre[axis] = (high if up else low)[axis] - normal[axis] * share * radius
        side = np.arctan2(normal[:2] @ way[:2], normal[1] * way[0] - normal[0] * way[1])
        segs, counts = half_space(lattice, shape, np.zeros(3), 1.0, [*centre, radius])
        # a third of the lines begin later and end earlier
        segs[2][rng.random(counts[2].shape) < 0.3] = [[-0.1e-3, 1.1e-3], [0.0, 0.0]]
        expected = arcs_in(side, 0.0, share)
        beside = np.abs(expected.ravel() - np.pi * np.round(expected.ravel() / np.pi))
        if np.any(np.diff(expected)[:, 0] < 0.6) or np.any((beside > 1e-9) & (beside < 0.3)):
            continue
        compared += 1
        tips = np.array([[*centre, -1e-3], [*(centre + 5e-5 * way[:2]), -1e-3]])
        rows, outline, extent = np.empty((9, 3)), np.array([[0.0, 0.02], [radius, radius]]), np.array([1e-3 - 0.25e-3, 2.2e-3])
        found = kernels.engage_upright(segs, counts, lattice, tips, outline, 0.02, way, 99, rows, extent)
        assert found == 3 * len(expected)
        for k, plane in enumerate(np.split(rows[:found], 3)):
            assert plane[:, 0] == pytest.approx(1e-3 + k * 0.5e-3)
            assert ordered(plane[:, 1:]) == pytest.approx(expected, abs=0.04)
        assert extent == pytest.approx([0.75e-3, 2.25e-3] if found else [np.inf, -np.inf])
    assert compared


def test_ribs_in_front_are_an_arc_each():
    lattice, radius = np.array([[0.0, 0.0, 0.0], [0.2e-3, 0.15e-3, 0.5e-3]]), 0.003
    ribs = 0.0052 + radius * np.cos([[3.0, 2.3], [1.9, 1.2], [0.8, 0.2]])
    segs, counts = half_space(lattice, (50, 70, 1), np.zeros(3), 1.0, [0.0047, 0.0052, radius])
    y = 0.15e-3 * np.arange(70)
    outside = ~np.any((y > ribs[:, :1]) & (y < ribs[:, 1:]), axis=0)
    counts[0][:, outside] = counts[2][:, outside] = 0
    along_y = np.zeros((1, 50, 9, 2))
    for n in range(50):
        pieces = [np.clip(rib, low, high) for rib in ribs for low, high in segs[1][0, n, : counts[1][0, n]]]
        pieces = [piece for piece in pieces if piece[1] > piece[0]]
        along_y[0, n, : len(pieces)], counts[1][0, n] = np.reshape(pieces, (-1, 2)), len(pieces)
    given = (segs[0], along_y, segs[2]), counts, lattice, 0, np.array([0.00475, 0.0052, radius]), np.array([0.0047, 0.0052, radius])
    wanted = [[0.2, 0.8], [1.2, 1.9], [2.3, 3.0]]
    for room in (4, 3, 2, 1):
        arcs = np.empty((room, 2))
        found = slice_arcs(*given, np.array([1.0, 0.0, 0.0]), 0.0, arcs)
        assert found == min(room, 3)
        assert arcs[:found] == pytest.approx(np.array(wanted[:found]), abs=1e-9)


def test_ends_beside_a_tool_on_the_border_of_the_lattice():
    """Far enough around it, lines are looked for one ring after the other; beyond the border there are none, whichever side it is."""
    lattice, arcs = np.array([[0.0, 0.001, 0.0], [1e-3, 0.8e-3, 1e-3]]), np.array([[0.0, TURN], [0.3, 0.4]])
    seg, count = np.tile([[-0.5, 0.5], [2.0, 3.0]], (7, 6, 1, 1)), np.full((7, 6), 2)
    for x, y in np.ndindex(9, 8):
        circle = np.array([(x - 1) * 1e-3, 0.001 + (y - 1) * 0.8e-3, 1e-3])
        for z, wanted in ((0.2, (-0.5, 0.5)), (2.5, (2.0, 3.0)), (1.0, (np.nan, np.nan))):
            ends = [kernels._end_beside(seg, count, lattice, z, circle, np.eye(2), arcs, 1, which) for which in range(2)]
            assert ends == pytest.approx(wanted, nan_ok=True)
