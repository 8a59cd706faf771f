"""Kernels of engagement against slow twins; this test runs again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.toolpath._engagement_kernels import arcs_of, distance_at, radius_and_slope, slice_arcs
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.solid import ToolSolid

FLAT = ToolSolid.of(Cutter(2, 0.004), 0.02)


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
