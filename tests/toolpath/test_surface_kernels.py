"""Triangles into lines and lines into triangles; this test runs again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.toolpath._kernels import surface as kernels
from rcsa_ident.toolpath.dexel import GRIDS, DexelField, check_closed
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import made_by
from tests.oracles.halfspace import half_space


def box(low, high):
    """The twelve triangles of a block."""
    low, high = np.asarray(low), np.asarray(high)
    points = np.array([[(low, high)[(k >> a) & 1][a] for a in range(3)] for k in range(8)])
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return points, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])


def test_a_block_of_triangles_is_a_block():
    points, faces = box([0.001, 0.002, 0.0], [0.011, 0.009, 0.003])
    found, wanted = DexelField.from_mesh(points, faces, 0.8e-3), DexelField.block(points[0], points[7], 0.8e-3)
    assert found.shape == wanted.shape
    for ours, theirs in zip((*found.segs, *found.counts), (*wanted.segs, *wanted.counts), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-15)


def test_lines_through_corners_and_edges_go_in_and_out():
    """A tetrahedron whose edges and corners lie on the lattice's own lines."""
    points = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]]) * 1e-3
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    # cells of 4/5 mm: the middle node is on many of the slope's edges
    field = DexelField.from_mesh(points, faces, 0.8e-3)
    # five cells: what is left is of the second order
    assert field.volume == pytest.approx(4e-3**3 / 6.0 * (1.0 - 0.2**2), rel=1e-9)
    assert all(np.all(count <= 1) for count in field.counts)
    below, above = field.segs[2][1, 1, 0]
    assert (below, above) == pytest.approx((0.0, 4e-3 - 2 * 1.2e-3), abs=1e-12)


def test_bodies_that_overlap_are_one():
    one, two = box([0.0, 0.0, 0.0], [0.004, 0.004, 0.004]), box([0.002, 0.0, 0.0], [0.006, 0.004, 0.004])
    both = np.concatenate([one[0], two[0]]), np.concatenate([one[1], two[1] + 8])
    assert DexelField.from_mesh(*both, 0.5e-3).volume == pytest.approx(96e-9, rel=1e-9)


def test_a_surface_net_is_closed_and_faces_outwards():
    field = DexelField.block([0.0, 0.0, 0.0], [0.006, 0.005, 0.004], 0.9e-3)
    # a hole right through, two corners that touch, and a cave
    for m, n, low, high in ((2, 2, -1.0, 1.0), (3, 3, 0.002, 1.0), (5, 1, 0.001, 0.003)):
        seg, count = field.segs[2], field.counts[2]
        if low < 0.0:
            count[m, n] = 0
        elif high > 0.5:
            seg[m, n, 0, 1] = low
        else:
            seg[m, n, 0, 1], seg[m, n, 1], count[m, n] = low, (high, 0.004), 2
    points, faces = field.mesh()
    check_closed(points, faces)
    corners = points[faces]
    enclosed = np.sum(np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]) / 6.0
    assert enclosed == pytest.approx(field.volume, rel=0.15)
    assert np.all(points.min(axis=0) >= field.low - 1e-15)


def test_a_block_comes_back_with_its_edges():
    field = DexelField.block([0.0, 0.0, 0.0], [0.006, 0.005, 0.004], 0.5e-3)
    points, faces = field.mesh()
    back = DexelField.from_mesh(points, faces, 0.5e-3)
    assert 0.998 * field.volume < back.volume < field.volume
    assert np.allclose([back.low, back.high], [field.low, field.high], rtol=0.0, atol=1e-9)


def last_of(points, places, moves, reach, below):
    """The slow twin of sorted moves: every point asks every move, in the complex plane."""
    found = np.full(len(points), -1)
    for p, (x, y, z) in enumerate(points):
        for m in moves:
            one, two = complex(*places[m, :2]), complex(*places[m + 1, :2])
            way, there = two - one, complex(x, y)
            share = np.clip(((there - one) * way.conjugate()).real / abs(way) ** 2, 0.0, 1.0) if way else 0.0
            if z >= min(places[m, 2], places[m + 1, 2]) - below and abs(there - one - share * way) <= reach:
                found[p] = m
    return found


@pytest.mark.parametrize("reach", [0.3e-3, 3e-3, 30e-3])
def test_the_last_move_is_found_among_its_neighbours(reach):
    """Short and long moves, plunges and ones beyond the surface, with squares as large as the tool, as a share of the part, and one."""
    rng = np.random.default_rng(3)
    places = np.cumsum(rng.normal(0.0, 2e-3, (60, 3)), axis=0)
    places[20] = [0.05, -0.02, 0.0]
    places[41, :2] = places[40, :2]
    points = rng.uniform(-0.03, 0.03, (300, 3))
    # many near the moves, where the squares at the border hold some
    points[100:] *= 0.1
    points[100:] += places[rng.integers(60, size=200)]
    moves = np.delete(np.arange(59), [5, 58])
    found = made_by(points, ToolPath(places), moves, 0.9 * reach, 0.1 * reach)
    assert np.array_equal(found, last_of(points, places, moves, reach, 0.1 * reach))
    assert np.any(found < 0)
    assert np.any(found >= 0)


def test_no_move_makes_nothing():
    path = ToolPath(np.zeros((2, 3)))
    assert made_by(np.zeros((0, 3)), path, np.arange(1), 0.01, 0.001).size == 0
    assert made_by(np.ones((3, 3)), path, np.arange(1), 0.01, 0.001).tolist() == [-1, -1, -1]
    assert made_by(np.zeros((3, 3)), path, np.arange(0), 0.01, 0.001).tolist() == [-1, -1, -1]


@pytest.mark.parametrize("grid", range(3))
def test_crossings_of_a_body_that_a_lattice_holds_half(grid):
    """A star of triangles around a point, against volumes of tetrahedra: which side of a line each edge passes."""
    rng = np.random.default_rng(grid)
    points, faces = box([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0])
    middles = points[faces].mean(axis=1)
    faces = np.array(
        [[*pair, 8 + k] for k, face in enumerate(faces) for pair in ((face[0], face[1]), (face[1], face[2]), (face[2], face[0]))]
    )
    points = np.concatenate([points, middles]) * rng.uniform(0.6, 1.4, 20)[:, None] + [0.3, -0.2, 0.5]
    origin, cell, shape = np.array([-0.4, -0.5, -0.3]), np.array([0.17, 0.23, 0.19]), np.array([6, 8, 7])
    along, p, q = GRIDS[grid]
    lines = shape[p] * shape[q]
    start = np.zeros(lines + 1, dtype=np.int64)
    given = points, faces, np.array(GRIDS[grid]), origin, cell, shape
    total = kernels.crossings(*given, start, np.empty(0), np.empty(0, dtype=np.int8))
    start = np.cumsum(start)
    place, sense = np.empty(total), np.empty(total, dtype=np.int8)
    assert kernels.crossings(*given, start, place, sense) == total == start[-1]
    corners = points[faces][:, :, [p, q, along]]
    for line in range(lines):
        foot = origin[[p, q]] + np.array(divmod(line, shape[q])) * cell[[p, q]]
        rest = corners[:, :, :2] - foot
        parts = np.stack([np.linalg.det(rest[:, [(k + 1) % 3, (k + 2) % 3]]) for k in range(3)], axis=1)
        met = np.all(parts > 0.0, axis=1) | np.all(parts < 0.0, axis=1)
        height = np.sum(parts * corners[:, :, 2], axis=1)[met] / parts[met].sum(axis=1)
        own = slice(start[line], start[line + 1])
        assert place[own] == pytest.approx(np.sort(height))
        # first in, then out, and so on
        assert sense[own].tolist() == [1, -1] * (height.size // 2)


@pytest.mark.parametrize("seed", range(3))
def test_slopes_and_volumes_of_a_half_space(seed):
    rng = np.random.default_rng(seed)
    lattice, shape = np.array([[0.003, -0.007, 0.001], [0.4e-3, 0.3e-3, 0.55e-3]]), (16, 21, 13)
    normal = rng.uniform(0.3, 1.0, 3) * rng.choice([-1.0, 1.0], 3)
    middle = lattice[0] + 0.5 * lattice[1] * (np.array(shape) - 1)
    segs, counts = half_space(lattice, shape, normal, normal @ middle)
    rest = 0.0
    for (a, b, d), seg, count in zip(GRIDS, segs, counts, strict=True):
        m, n = shape[b] // 2, shape[d] // 2
        which = 1 if normal[a] > 0.0 else 0
        found = kernels._slopes(seg, count, m, n, which, seg[m, n, 0, which], lattice[1, b], lattice[1, d])
        assert found == pytest.approx([-normal[b] / normal[a], -normal[d] / normal[a]])
        nodes, part = kernels.nodes_and_rest(seg, count, lattice[0, a], lattice[1, a], lattice[1, b], lattice[1, d])
        rest += part
    # a corner of the block that lies opposite is cut off alike
    assert (nodes + rest) * np.prod(lattice[1]) == pytest.approx(0.5 * np.prod(lattice[1] * shape), rel=2e-3)


def test_slopes_at_an_edge_are_those_of_the_flatter_side():
    heights = np.array([0.0, 1.0, 5.0, 5.2, 5.2])
    seg, count = np.zeros((5, 1, 2, 2)), np.ones((5, 1), dtype=np.int16)
    seg[:, 0, 0, 1] = heights
    for m, wanted in ((1, 1.0 / 0.5), (2, 0.2 / 0.5), (3, 0.1 / 0.5), (4, 0.0), (0, 1.0 / 0.5)):
        assert kernels._slopes(seg, count, m, 0, 1, heights[m], 0.5, 0.7) == pytest.approx((wanted, np.inf))
        assert kernels._slopes(seg.swapaxes(0, 1), count.T, 0, m, 1, heights[m], 0.7, 0.5) == pytest.approx((np.inf, wanted))


def test_ends_between_two_places():
    seg, count = np.array([[[[0.1, 0.4], [0.6, 0.8]]] * 2] * 2), np.full((2, 2), 2)
    for m, n in ((0, 0), (1, 1), (0, 1)):
        assert [kernels._between(seg, count, m, n, 0.5, 0.9, which) for which in range(2)] == [0.6, 0.8]
        assert [kernels._between(seg, count, m, n, 0.4, 0.5, which) for which in range(2)] == [0.45, 0.4]
    for m, n in ((-1, 0), (0, -1), (2, 0), (0, 2)):
        assert kernels._between(seg, count, m, n, 0.5, 0.9, 0) == 0.7
    count[0, 0] = 1
    assert kernels._between(seg, count, 0, 0, 0.5, 0.9, 0) == 0.7
