"""Layers of dexels as columns: borders with the material on their left, what stands beside a line, and what lies over it."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.toolpath._kernels import wall as kernels
from rcsa_ident.toolpath.dexel import DexelField
from tests.oracles.halfspace import half_space

NOTHING = -1.0


def layer_of(field: DexelField, height: float) -> kernels.Layer:
    at = int((height - field.low[2]) / field.cell[2])
    lines = field.segs[0][at], field.counts[0][at], field.segs[1][at], field.counts[1][at], field.segs[2], field.counts[2]
    return kernels.Layer(*lines, field.lattice, height)


def block_with_hole() -> DexelField:
    """20 x 16 x 4 mm, and from 6 to 14, from 5.13 to 11 mm through all of it nothing."""
    field = DexelField.block([0.0, 0.0, 0.0], [0.020, 0.016, 0.004], cell=0.5e-3)
    x, y, z = field.lattice[0][:, None] + field.lattice[1][:, None] * np.arange(64)
    for axis, (rows, columns, low, high, wide) in enumerate([(z, y, 0.006, 0.014, None), (z, x, 0.00513, 0.011, None)]):
        del wide
        seg, count = field.segs[axis], field.counts[axis]
        inside = (columns > 0.00513) & (columns < 0.011) if axis == 0 else (columns > 0.006) & (columns < 0.014)
        for k in np.flatnonzero(inside[: seg.shape[1]]):
            seg[:, k, 1, 1] = seg[:, k, 0, 1]
            seg[:, k, 0, 1], seg[:, k, 1, 0] = low, high
            count[:, k] = 2
        del rows
    hole = np.ix_(
        (x[: field.shape[0]] > 0.006) & (x[: field.shape[0]] < 0.014), (y[: field.shape[1]] > 0.00513) & (y[: field.shape[1]] < 0.011)
    )
    field.counts[2][hole] = 0
    return field


def border(field: DexelField, height: float = 0.002) -> np.ndarray:
    layer, out = layer_of(field, height), np.empty((4096, 4))
    return out[: kernels.contour(layer, np.array([-1, 99, -1, 99]), out)]


def test_a_border_goes_around_with_the_material_on_its_left() -> None:
    field = block_with_hole()
    pieces = border(field)
    # the area by Green's formula: sharp corners are cut off by less than a cell's square
    area = 0.5 * np.sum(pieces[:, 0] * pieces[:, 3] - pieces[:, 2] * pieces[:, 1])
    assert area == pytest.approx(0.020 * 0.016 - 0.008 * 0.00587, abs=8 * 0.5 * 0.25e-3**2 * 2)
    # a closed line: as many pieces end at a point as begin there
    ends = np.round(np.concatenate([pieces[:, :2], pieces[:, 2:]]) * 1e9).astype(int)
    _, times = np.unique(ends, axis=0, return_counts=True)
    assert set(times.tolist()) == {2}
    assert kernels.contour(layer_of(field, 0.002), np.array([-1, 99, -1, 99]), np.empty((3, 4))) == len(pieces)


def test_columns_have_the_material_on_both_sides_of_a_line() -> None:
    field = block_with_hole()
    line = 0.008
    pieces = border(field) - [0.0, line, 0.0, line]
    spacing, count = 1e-4, 300
    x = -0.005 + spacing * np.arange(count)
    within = np.empty(count, dtype=np.bool_)
    kernels.inside(layer_of(field, 0.002), np.column_stack([x, np.full(count, line)]), within)
    tops, feet = np.empty((2, 2, count))
    kernels.columns(np.ascontiguousarray(pieces), within, -0.005, spacing, NOTHING, tops, feet)

    def at(place: float) -> tuple[list[float], list[float]]:
        i = round((place + 0.005) / spacing)
        return tops[:, i].round(9).tolist(), feet[:, i].round(9).tolist()

    # in the hole the material begins at its sides, elsewhere it is on the line; it ends where the block does
    assert at(0.010) == ([-0.00287, -0.003], [-0.008, -0.008])
    assert at(0.003) == ([0.0, 0.0], [-0.008, -0.008])
    assert at(-0.002) == ([NOTHING, NOTHING], [NOTHING, NOTHING])
    # what a window has no border of goes on
    kernels.columns(np.empty((0, 4)), within, -0.005, spacing, NOTHING, tops, feet)
    assert at(0.003) == ([0.0, 0.0], [NOTHING, NOTHING])
    assert at(0.010) == ([NOTHING, NOTHING], [NOTHING, NOTHING])


def test_what_lies_over_columns_takes_their_place() -> None:
    tops = np.full((2, 20), -0.002)
    pieces = np.array(
        [[0.00019, -0.0010125, 0.00061, -0.0004875], [0.00039, -0.0009025, 0.00081, -0.0007975], [0.00099, 0.0003, 0.00121, 0.0003]]
    )
    kernels.overlay(pieces, 0.0, 1e-4, NOTHING, tops)
    wanted = [-0.002, -0.002, -0.001, -0.000875, -0.00075, -0.000625, -0.0005, -0.000825, -0.0008, *[-0.002] * 11]
    assert tops[0] == pytest.approx(wanted)
    assert tops[1] == pytest.approx([*[-0.002] * 10, -0.0003, -0.0003, -0.0003, *[-0.002] * 7])


def wall_layer(seed: int) -> tuple[kernels.Layer, np.ndarray, float, np.ndarray, np.ndarray]:
    """A half plane in a block whose lattice begins anywhere: with its normal, how far it goes, and the block's corners."""
    rng = np.random.default_rng(seed)
    lattice, shape = np.array([[0.003, -0.007, 0.0], [0.4e-3, 0.3e-3, 0.5e-3]]), np.array([17, 22, 1])
    low, high = (lattice[0] - 0.5 * lattice[1])[:2], (lattice[0] + (shape - 0.5) * lattice[1])[:2]
    normal = rng.normal(size=2)
    offset = normal @ (low + rng.uniform(0.3, 0.7, 2) * (high - low))
    segs, counts = half_space(lattice, shape, [*normal, 0.0], offset)
    return kernels.Layer(segs[0][0], counts[0][0], segs[1][0], counts[1][0], segs[2], counts[2], lattice, 0.0), normal, offset, low, high


@pytest.mark.parametrize("seed", range(4))
def test_the_border_of_a_half_plane_in_a_block(seed: int) -> None:
    layer, normal, offset, low, high = wall_layer(seed)
    out = np.empty((400, 4))
    pieces = out[: kernels.contour(layer, np.array([-5, 99, -5, 99]), out)]
    ends = np.concatenate([pieces[:, :2], pieces[:, 2:]])
    on_side = np.min(np.abs(np.concatenate([ends - low, ends - high], axis=1)), axis=1) < 1e-12
    assert np.all(on_side | (np.abs(ends @ normal - offset) < 1e-12))
    # closed, and around the same area as the corners of the half plane in the block, but for what corners of the border cut off
    assert sorted(map(tuple, pieces[:, :2].round(12))) == sorted(map(tuple, pieces[:, 2:].round(12)))
    grid = [low[k] + (np.arange(900) + 0.5) / 900 * (high[k] - low[k]) for k in range(2)]
    share = np.mean(grid[0][:, None] * normal[0] + grid[1] * normal[1] < offset)
    area = 0.5 * np.sum(pieces[:, 0] * pieces[:, 3] - pieces[:, 2] * pieces[:, 1])
    assert area == pytest.approx(share * np.prod(high - low), abs=5 * 0.5 * 0.4e-3 * 0.3e-3)
    # windows hold what all of it has in them
    parts = []
    for window in ([-9, 3, -9, 9], [-9, 3, 10, 99], [4, 60, -1, 9], [4, 16, 10, 21]):
        part = np.empty((400, 4))
        parts.append(part[: kernels.contour(layer, np.array(window), part)])
        middle = (0.5 * (parts[-1][:, :2] + parts[-1][:, 2:]) - layer.lattice[0, :2]) / layer.lattice[1, :2]
        assert np.all((middle >= [window[0] - 1e-9, window[2] - 1e-9]) & (middle <= [window[1] + 1 + 1e-9, window[3] + 1 + 1e-9]))
    assert sorted(map(tuple, np.concatenate(parts))) == sorted(map(tuple, pieces))
    # where a line along x does not say where it ends, half way
    layer.count_x[:] = 0
    again = out[: kernels.contour(layer, np.array([-5, 99, -5, 99]), out)]
    place = (np.concatenate([again[:, 0], again[:, 2]]) - layer.lattice[0, 0]) / layer.lattice[1, 0]
    assert np.all(np.abs(2.0 * place - np.round(2.0 * place)) < 1e-9)


def test_places_are_as_their_nearest_nodes() -> None:
    layer, normal, offset, low, high = wall_layer(1)
    places = np.random.default_rng(0).uniform(low - 1e-3, high + 1e-3, (500, 2))
    node = layer.lattice[0, :2] + np.round((places - layer.lattice[0, :2]) / layer.lattice[1, :2]) * layer.lattice[1, :2]
    found = np.empty(500, dtype=np.bool_)
    kernels.inside(layer, places, found)
    assert np.array_equal(found, (node @ normal < offset) & np.all((places > low) & (places < high), axis=1))


@pytest.mark.parametrize("seed", range(6))
def test_columns_beside_islands(seed: int) -> None:
    """Islands of material around and beside a line, against points in them: crossings of a ray are counted."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0.0, 2.0 * np.pi, 14)[:-1]
    rings = [
        place + rng.uniform(0.3, 1.0, 13) * np.exp(1j * turn) for place in (rng.uniform(-0.6, 0.6) * 1j, 1.6 + 1.3j, 1.7 - 1.2j, 0.2 + 2.4j)
    ]
    begin, end = np.concatenate(rings), np.concatenate([np.roll(ring, -1) for ring in rings])
    pieces = np.stack([begin.real, begin.imag, end.real, end.imag], axis=1)
    start, spacing, n = -1.5, 0.0731, 63
    y = (np.arange(8000) + 0.5) * 5e-4
    tops, feet = np.empty((2, 2, n))
    within = rng.random(n) < 0.5
    kernels.columns(pieces, within, start, spacing, -3.0, tops, feet)
    for i in range(n):
        x = start + i * spacing
        across = (begin.real > x) != (end.real > x)
        height = (begin.imag + (x - begin.real) * (end.imag - begin.imag) / (end.real - begin.real))[across]
        for side, sign in enumerate((-1.0, 1.0)):
            inside = np.sum(height > sign * y[:, None], axis=1) % 2 == 1
            if not height.size:
                assert (tops[side, i], feet[side, i]) == ((0.0, -3.0) if within[i] else (-3.0, -3.0))
            elif not np.any(inside):
                assert (tops[side, i], feet[side, i]) == (-3.0, -3.0)
            else:
                top = np.argmax(inside)
                foot = top + np.argmin(inside[top:])
                assert tops[side, i] == pytest.approx(-y[top], abs=5e-4)
                assert feet[side, i] == pytest.approx(max(-y[foot], -3.0), abs=5e-4)


def test_the_highest_of_many_pieces_lies_over_a_column() -> None:
    rng = np.random.default_rng(3)
    pieces = np.concatenate([rng.uniform(0.3, 1.7, (40, 1)), rng.uniform(-0.9, 0.9, (40, 1))], axis=1)
    pieces = np.concatenate([pieces, pieces + rng.uniform(-0.2, 0.2, (40, 2))], axis=1)
    start, spacing, tops = 0.05, 0.0173, rng.uniform(-0.8, -0.3, (2, 90))
    wanted = tops.copy()
    x = start + spacing * np.arange(90)
    for side, sign in enumerate((-1.0, 1.0)):
        over = np.full(90, -np.inf)
        for xa, ya, xb, yb in pieces:
            there = (x >= min(xa, xb)) & (x <= max(xa, xb))
            y = ya + (yb - ya) * (x - xa) / (xb - xa)
            there &= sign * y > 0.0
            over[there] = np.maximum(over[there], -np.abs(y[there]))
        wanted[side] = np.where(over > NOTHING, over, wanted[side])
    kernels.overlay(pieces, start, spacing, NOTHING, tops)
    assert tops == pytest.approx(wanted, abs=1e-12)
