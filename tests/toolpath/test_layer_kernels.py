"""Layers thinner than the distance between lines; this test runs again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.toolpath._kernels.layer import layer_arcs, material_ahead
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


#: Heights and radii of outlines: a ball, a dovetail that narrows upwards, a disc on a thin shank.
OUTLINES = {
    "ball": np.array([[0.0, 0.0006, 0.0018, 0.004, 0.012], [0.0, 0.0022, 0.0034, 0.004, 0.004]]),
    "dovetail": np.array([[0.0, 0.005, 0.012], [0.004, 0.0016, 0.0016]]),
    "disc": np.array([[0.0, 0.002, 0.002, 0.012], [0.005, 0.005, 0.001, 0.001]]),
}


def heights_of_material(seg, count, lattice, tip, outline, edge):
    """All heights of a fine scale at which a line has material and the outline, wider by a cell, reaches it."""
    beside = max(lattice[1, :2])
    height = (np.arange(8000) + 0.5) * edge / 8000
    wide = np.interp(height, outline[0], outline[1])
    met = np.zeros(height.size, dtype=bool)
    for m in range(seg.shape[0]):
        for n in range(seg.shape[1]):
            away = np.hypot(*(lattice[0, :2] + lattice[1, :2] * [m, n] - tip[:2]))
            if away >= outline[1].max() + beside:
                continue
            reached = wide > max(away - beside, 0.0)
            for low, high in seg[m, n, : count[m, n]]:
                met |= reached & (height + tip[2] > low) & (height + tip[2] < high)
    return height[met]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", OUTLINES)
def test_material_ahead_is_what_a_plain_search_finds(kind, seed):
    """Lines with gaps at any heights, a tool that stands anywhere, also half beside the block."""
    rng = np.random.default_rng(seed)
    lattice = np.array([[0.0014, -0.0018, 0.0], [[0.8e-3, 0.6e-3, 0.4e-3], [0.5e-3, 0.7e-3, 0.9e-3]][seed % 2]])
    shape = (19, 17)
    seg, count = np.sort(rng.uniform(0.0, 0.01, (*shape, 4)), axis=2).reshape(*shape, 2, 2), rng.integers(0, 3, shape)
    # little of it, so that the range has ends inside of the edge
    count[rng.random(count.shape) < 0.96] = 0
    ranges = 0
    for _ in range(6):
        tip = np.array([rng.uniform(-0.003, 0.018), rng.uniform(-0.006, 0.012), rng.uniform(-0.003, 0.008)])
        edge = rng.uniform(0.003, 0.011)
        low, high = material_ahead(seg, count, lattice, tip, OUTLINES[kind], edge)
        expected = heights_of_material(seg, count, lattice, tip, OUTLINES[kind], edge)
        if expected.size == 0:
            # what the scale steps over is no range to speak of
            assert high - low < 2e-5
            continue
        ranges += 1
        assert [low, high] == pytest.approx([expected[0], expected[-1]], abs=2.0 * edge / 8000)
    assert ranges


@pytest.mark.parametrize("turn", [0.0, 1.1, -2.3])
def test_arcs_in_front_of_a_slot_in_a_layer(turn):
    """Two walls beside a slot that the tool goes along: two arcs, whichever way the feed goes, in cells that are not square."""
    radius, half = 0.006, 0.0025
    feed = np.array([np.cos(turn), np.sin(turn)])
    lattice = np.array([[-0.012, -0.0125, 0.0], [0.4e-3, 0.3e-3, 0.4e-3]])
    centre = np.array([0.0002, -0.0003, 0.001])
    seg, count = np.zeros((61, 84, 2, 2)), np.ones((61, 84), dtype=int)
    x, y = (lattice[0, k] + lattice[1, k] * np.arange(n) - centre[k] for k, n in ((0, 61), (1, 84)))
    along = x[:, None] * feed[0] + y * feed[1]
    across = y * feed[0] - x[:, None] * feed[1]
    gone = (np.hypot(x[:, None], y) < radius) | (along < 0.0) | (np.abs(across) < half)
    # a second piece of material above, where nothing is cut
    seg[:, :, 0] = np.where(gone[..., None], [0.0, 0.0005], [0.0, 0.002])
    seg[:, :, 1], count[:] = [0.003, 0.004], 2
    arcs = np.empty((4, 2))
    assert layer_arcs(seg, count, lattice, centre, radius, feed, arcs) == 2
    border = np.arccos(half / radius)
    expected = radius * np.cos([[0.0, border], [np.pi - border, np.pi]])
    assert radius * np.cos(arcs[:2]) == pytest.approx(expected, abs=0.3e-3)
    # without room for the second one, the first is told
    assert layer_arcs(seg, count, lattice, centre, radius, feed, arcs[:1]) == 1


def arcs_by_lines(held, lattice, centre, radius, feed):
    """Every line of a lattice is asked, in the complex plane; where the circle meets it, and half way to its neighbours."""
    place = (
        lattice[0, 0] + lattice[1, 0] * np.arange(held.shape[0])[:, None] + 1j * (lattice[0, 1] + lattice[1, 1] * np.arange(held.shape[1]))
    )
    place = (place - complex(*centre[:2])) * complex(*feed).conjugate() / radius
    wide = max(lattice[1, :2]) / radius
    with np.errstate(invalid="ignore"):
        way = place.real - np.sqrt(1.0 - place.imag**2)
    met = (way > 0.0) & (way <= 1.5 * wide)
    angle, held = np.arccos(place.imag[met]), held[met]
    order = np.argsort(angle)
    angle, held = angle[order], held[order]
    middles = np.concatenate([[0.0], 0.5 * (angle[1:] + angle[:-1]), [np.pi]])
    found = []
    for start, stop in zip(middles[:-1][held], middles[1:][held], strict=True):
        if found and start - found[-1][1] < wide / max(np.sin(start), 0.2):
            found[-1][1] = stop
        else:
            found.append([start, stop])
    return np.reshape(found, (-1, 2))


@pytest.mark.parametrize("seed", range(6))
def test_arcs_of_a_layer_are_those_of_all_its_lines(seed):
    """A tool anywhere over a small field, half beside it, too, with ribs that turn with it."""
    rng = np.random.default_rng(seed)
    lattice = np.array([[0.001, -0.002, 0.0], [[0.4e-3, 0.3e-3, 0.5e-3], [0.25e-3, 0.35e-3, 0.2e-3]][seed % 2]])
    shape, radius, numbers = np.array([24, 21]), 0.003, set()
    for _ in range(6):
        corner = lattice[0, :2] + lattice[1, :2] * (shape - 1)
        centre = np.array([*rng.uniform(lattice[0, :2] - 0.002, corner + 0.002), 0.001])
        turn, period = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(1e3, 6e3)
        feed = np.array([np.cos(turn), np.sin(turn)])
        x, y = (lattice[0, k] + lattice[1, k] * np.arange(shape[k]) - centre[k] for k in range(2))
        held = np.sin(period * (y * feed[0] - x[:, None] * feed[1]) + rng.uniform(0.0, 6.0)) > -0.3
        # below what is looked at all have material, above it none
        seg, count = np.zeros((*shape, 2, 2)), np.where(held, 2, 1)
        seg[:, :, 0], seg[:, :, 1] = [0.0, 0.0008], [0.0009, 0.0012]
        arcs = np.empty((20, 2))
        found = layer_arcs(seg, count, lattice, centre, radius, feed, arcs)
        numbers.add(found)
        assert arcs[:found] == pytest.approx(arcs_by_lines(held, lattice, centre, radius, feed), abs=1e-12)
    assert len(numbers) > 1
