"""Layers thinner than the distance between lines; this test runs again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.toolpath._layer_kernels import layer_arcs
from rcsa_ident.toolpath.dexel import DexelField


@pytest.mark.parametrize("side", [-1, 1])
def test_a_wall_in_a_thin_layer_is_known_to_half_a_cell(side):
    field = DexelField.block([0.0, 0.0, 0.0], [0.012, 0.012, 0.002], 0.5e-3)
    radius, wall, top = 0.004, 0.0012, 0.0011
    centre = np.array([0.0061, 0.0058, 0.5 * (0.001 + top)])
    seg = field.segs[2]
    for m in range(field.shape[0]):
        for n in range(field.shape[1]):
            x, y = field.lattice[0, :2] + np.array([m, n]) * field.cell[:2] - centre[:2]
            # behind the tool and beside the wall the layer is gone
            gone = (np.hypot(x, y) < radius) or x < 0.0 or (y - wall) * side < 0.0
            seg[m, n, 0, 1] = 0.001 if gone else top
    arcs = np.empty((4, 2))
    assert layer_arcs(seg, field.counts[2], field.lattice, centre, radius, np.array([1.0, 0.0]), arcs) == 1
    border = np.arccos(wall / radius)
    wanted = (0.0, border) if side > 0 else (border, np.pi)
    assert radius * np.cos(arcs[0]) == pytest.approx(radius * np.cos(wanted), abs=0.3e-3)
    assert layer_arcs(seg, field.counts[2], field.lattice, centre + [0.0, 0.0, 0.01], radius, np.array([1.0, 0.0]), arcs) == 0  # noqa: RUF005
