"""Layers of dexels as columns: borders with the material on their left, what stands beside a line, and what lies over it."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.toolpath import _wall_kernels as kernels
from rcsa_ident.toolpath.dexel import DexelField

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
