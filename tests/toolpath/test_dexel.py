"""Volumes of fields of dexels and of what tools take out of them: closed forms, exact booleans, order and monotony."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.toolpath.dexel import DexelField, memory_of
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep, frame_of
from rcsa_ident.toolpath.solid import ToolSolid
from tests.toolpath.test_surface_kernels import box

manifold3d = pytest.importorskip("manifold3d")

R, HIGH = 0.005, np.array([0.06, 0.03, 0.012])
FLAT = ToolSolid.of(Cutter(2, 2 * R), 0.04)
BALL = ToolSolid.of(Cutter(2, 2 * R, profile=Profile.ball(2 * R)), 0.04)
BULL = ToolSolid.of(Cutter(2, 2 * R, profile=Profile.bull_nose(2 * R, 0.002)), 0.04)
TAPERED = ToolSolid.of(Cutter(2, 0.006, profile=Profile.tapered(0.006, np.radians(10.0), 0.001, 0.02)), 0.04)
LOLLIPOP = ToolSolid.of(Cutter(2, 2 * R, profile=Profile.lollipop(2 * R, 0.005)), 0.04)
#: k_d of 0.05.
CELL = 0.05 * R


def removed(solid, places, axes=None, cell=CELL):
    """Volume that a tool takes out of the block."""
    field = DexelField.block(np.zeros(3), HIGH, cell)
    before = field.volume
    Sweep(field, solid, ToolPath(np.array(places), axes=axes)).run()
    return before - field.volume


def boolean(solid, places, axes=None):
    """The same by exact booleans of fine polyhedra: on each move the hull of the tool at its two ends."""
    path, solid = ToolPath(np.array(places), axes=axes), solid.coarser(2e-7)
    section = np.stack([np.concatenate([[0.0], solid.radii, [0.0]]), np.concatenate([[0.0], solid.heights, [solid.length]])], axis=1)
    tool = manifold3d.Manifold.revolve(manifold3d.CrossSection([section]), 512)
    stock = manifold3d.Manifold.cube(HIGH)
    for k in range(len(path) - 1):
        ends = [tool.transform(np.column_stack([frame_of(path.axes[i]), path.places[i]])) for i in (k, k + 1)]
        stock -= manifold3d.Manifold.batch_hull(ends)
    return float(np.prod(HIGH) - stock.volume())


def test_a_block_has_its_own_volume():
    block = DexelField.block([0.001, -0.02, 0.0], [0.0443, 0.0171, 0.0099], 0.37e-3)
    assert block.volume == pytest.approx(0.0433 * 0.0371 * 0.0099, rel=1e-12)
    assert np.all(block.cell <= 0.37e-3)
    assert np.all(block.height_map() == 0.0099)
    assert block.memory == memory_of(block.high - block.low, 0.37e-3)


def segment_area(depth):
    return R**2 * np.arccos((R - depth) / R) - (R - depth) * np.sqrt(2.0 * R * depth - depth**2)


def lengths(field):
    """Of all lines along x, y, z together."""
    held = [np.arange(seg.shape[2]) < count[..., None] for seg, count in zip(field.segs, field.counts, strict=True)]
    return np.array([np.sum((seg[..., 1] - seg[..., 0])[each]) for seg, each in zip(field.segs, held, strict=True)])


def circle(radius, z):
    t = np.linspace(0.0, 2.0 * np.pi, 721)
    return np.stack([0.0303 + radius * np.cos(t), 0.0151 + radius * np.sin(t), np.full(t.size, z)], axis=1)


@pytest.mark.parametrize(
    ("solid", "places", "exact"),
    [
        (FLAT, [[-0.006, 0.0151, 0.0087], [0.066, 0.0151, 0.0087]], 0.06 * 2 * R * 0.0033),
        (FLAT, [[-0.006, 0.0013, 0.0104], [0.066, 0.0013, 0.0104]], 0.06 * (R + 0.0013) * 0.0016),
        (FLAT, [[0.0303, 0.0151, 0.02], [0.0303, 0.0151, 0.0087]], np.pi * R**2 * 0.0033),
        (BALL, [[-0.006, 0.0151, 0.0087], [0.066, 0.0151, 0.0087]], 0.06 * segment_area(0.0033)),
        (FLAT, circle(0.0071, 0.0087), np.pi * ((0.0071 + R) ** 2 - (0.0071 - R) ** 2) * 0.0033),
    ],
    ids=["slot", "shoulder", "plunge", "ball's groove", "circular pocket"],
)
def test_volumes_of_closed_forms(solid, places, exact):
    assert removed(solid, places) == pytest.approx(exact, rel=6e-4)


SIDEWAYS = np.tile([0.0, np.sin(0.25), np.cos(0.25)], (2, 1))
FORWARD = np.tile([np.sin(0.25), 0.0, np.cos(0.25)], (2, 1))


@pytest.mark.parametrize(
    ("solid", "places", "axes"),
    [
        (FLAT, [[-0.02, -0.0172, 0.0087], [0.06, 0.0437, 0.0087]], None),
        (FLAT, [[-0.006, 0.0151, 0.0123], [0.066, 0.0131, 0.0057]], None),
        (BALL, [[-0.006, 0.0151, 0.0057], [0.066, 0.0171, 0.0123]], None),
        (TAPERED, [[-0.006, 0.0151, 0.0123], [0.066, 0.0171, 0.0057]], None),
        (BULL, [[-0.006, 0.0151, 0.0087], [0.02, 0.0171, 0.0057], [0.03, -0.01, 0.006]], None),
        (FLAT, [[-0.006, 0.0151, 0.0093], [0.066, 0.0151, 0.0093]], SIDEWAYS),
        (BALL, [[-0.006, 0.0151, 0.0093], [0.066, 0.0151, 0.0093]], FORWARD),
    ],
    ids=["slanting", "ramp", "ball up a ramp", "tapered", "bull nose", "leaning sideways", "leaning forward"],
)
def test_volumes_of_exact_booleans(solid, places, axes):
    assert removed(solid, places, axes) == pytest.approx(boolean(solid, places, axes), rel=1e-3)


def test_an_undercut_leaves_material_above_it():
    field = DexelField.block(np.zeros(3), HIGH, CELL)
    Sweep(field, LOLLIPOP, ToolPath(np.array([[-0.006, 0.003, 0.001], [0.066, 0.003, 0.001]]))).run()
    line = field.segs[2][120, 30, : field.counts[2][120, 30]]
    y = field.lattice[0, 1] + 30 * field.cell[1]
    half = np.sqrt(R**2 - (y - 0.003) ** 2)
    assert line.ravel() == pytest.approx([0.0, 0.006 - half, 0.006 + half, 0.012], abs=1e-6)


def test_lines_get_room_when_they_need_it():
    """Slots one above the other, by a disc on a thin shank: more segments than a line has room for at first."""
    disc = ToolSolid(np.array([0.0, 1e-3, 1e-3, 0.03]), np.array([4e-3, 4e-3, 1e-3, 1e-3]), 1e-3)
    field = DexelField.block(np.zeros(3), HIGH, CELL)
    for height in (0.001, 0.004, 0.007, 0.010):
        sweep = Sweep(field, disc, ToolPath(np.array([[-0.01, 0.0, height], [0.07, 0.0, height]])))
        before = lengths(field)
        sweep.run()
        # nothing is counted twice where a move is taken up again
        assert sweep.told[0, :3] == pytest.approx(before - lengths(field))
    assert field.segs[2].shape[2] >= 5
    assert field.counts[2].max() == 5


@pytest.mark.slow
def test_leaning_tools_leave_no_ridges_along_the_lines():
    """Between the places into which a move is cut up nothing stays."""
    field = DexelField.block(np.zeros(3), HIGH, CELL)
    axes = np.array([[0.2, 0.1, 1.0], [-0.1, 0.2, 1.0]])
    Sweep(field, FLAT, ToolPath(np.array([[-0.01, 0.014, 0.008], [0.07, 0.016, 0.007]]), axes=axes)).run()
    assert max(int(count.max()) for count in field.counts) == 2


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.floats(0.0, 0.06), st.floats(0.0, 0.03), st.floats(0.004, 0.013)), min_size=2, max_size=5))
def test_material_only_gets_less_and_no_order_matters(places):
    moves = [np.array(pair) for pair in pairwise(places)]
    fields = []
    for order in (moves, moves[::-1]):
        field = DexelField.block(np.zeros(3), HIGH, 1e-3)
        volumes = [field.volume]
        for move in order:
            Sweep(field, FLAT, ToolPath(move)).run()
            volumes.append(field.volume)
        # what a cell's estimate is in doubt by where two surfaces meet in it
        assert np.all(np.diff(volumes) <= 5e-9)
        fields.append(field)
    for grid in range(3):
        many = fields[0].counts[grid]
        assert np.array_equal(many, fields[1].counts[grid])
        one, two = (field.segs[grid][:, :, : int(many.max())] for field in fields)
        held = np.arange(one.shape[2]) < many[..., None]
        assert one[held] == pytest.approx(two[held], abs=1e-12)


def test_a_copy_is_cut_on_its_own():
    block = DexelField.block(np.zeros(3), HIGH, 1e-3)
    other = block.copy()
    Sweep(other, FLAT, ToolPath(np.array([[0.0, 0.015, 0.006], [0.06, 0.015, 0.006]]))).run()
    assert block.volume == pytest.approx(np.prod(HIGH))
    assert other.volume < 0.9 * block.volume


@pytest.mark.parametrize("seed", [1, 2])
def test_a_surface_of_triangles_encloses_what_a_boolean_says(seed):
    rng = np.random.default_rng(seed)
    body = manifold3d.Manifold.cube([0.04, 0.03, 0.01])
    for _ in range(4):
        x, y, r = rng.uniform(0.0, 0.04), rng.uniform(0.0, 0.03), rng.uniform(0.003, 0.008)
        body -= manifold3d.Manifold.cylinder(0.02, r, r * rng.uniform(0.5, 1.0), 128).translate([x, y, -0.005])
        body += manifold3d.Manifold.sphere(r, 64).translate([y, x, 0.005])
    mesh = body.to_mesh64()
    field = DexelField.from_mesh(mesh.vert_properties[:, :3], mesh.tri_verts, 0.4e-3)
    assert field.volume == pytest.approx(body.volume(), rel=1e-3)
    points, faces = field.mesh()
    net = manifold3d.Manifold(manifold3d.Mesh64(points, faces.astype(np.uint64)))
    assert net.status() == manifold3d.Error.NoError
    assert net.volume() == pytest.approx(body.volume(), rel=2e-3)


def test_a_surface_has_as_many_triangles_as_may_be():
    """Coarser, and still closed around nearly as much."""
    field = DexelField.block(np.zeros(3), HIGH, CELL)
    Sweep(field, FLAT, ToolPath(np.array([[0.02, 0.015, 0.006], [0.04, 0.015, 0.006]]))).run()
    _, whole = field.mesh()
    for most in (20_000, 2_000, 12, 1):
        points, faces = field.mesh(most)
        assert 0 < len(faces) <= max(most, 12) < len(whole)
        if most >= 2_000:
            assert DexelField.from_mesh(points, faces, CELL).volume == pytest.approx(field.volume, rel=0.08)


def test_what_is_no_stock_is_refused():
    points, faces = box([0.0, 0.0, 0.0], [0.01, 0.01, 0.01])
    with pytest.raises(InputError, match="3 edges"):
        DexelField.from_mesh(points, faces[1:], 1e-3)
    with pytest.raises(InputError, match="counterclockwise"):
        DexelField.from_mesh(points, faces[:, ::-1], 1e-3)
    with pytest.raises(InputError, match="finite"):
        DexelField.from_mesh(np.where(points == 0.01, np.nan, points), faces, 1e-3)
    for tiny in (1e-200, 1e-320):
        with pytest.raises(InputError, match=r"cell: .*larger cells"):
            DexelField.block([0.0, 0.0, 0.0], [0.1, 0.1, 0.1], tiny)
        assert memory_of(np.array([0.1, 0.1, 0.1]), tiny) > 1e100
    with pytest.raises(InputError, match="larger cells"):
        DexelField.block([0.0, 0.0, 0.0], [1.0, 1.0, 1.0], 1e-5)
    with pytest.raises(InputError, match="above the first"):
        DexelField.block([0.0, 0.0, 0.0], [1.0, -1.0, 1.0], 1e-2)


def test_solids_of_cutters():
    assert FLAT.convex
    assert BALL.convex
    assert TAPERED.convex
    assert LOLLIPOP.rises_to_one_peak
    assert not LOLLIPOP.convex
    assert (FLAT.sharpest, round(1e3 * BALL.sharpest, 2), round(1e3 * BULL.sharpest, 2)) == (0.0, 5.0, 2.0)
    short = ToolSolid.of(Cutter(2, 2 * R), 0.012)
    assert (short.length, short.edge, short.radius) == (0.012, 0.012, R)
    with pytest.raises(InputError, match="outline"):
        ToolSolid(np.array([0.0, -1.0]), np.ones(2), 1.0)
