"""The chip kernel against a plain search; this test runs again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.cutting._kernels import chip_pieces
from tests.oracles.naive import smallest_chip


def surfaces(rng, count, points):
    """Of teeth ahead, the farthest without a step; the arcs may go all the way around."""
    moved = np.cumsum(rng.uniform(0.05, 0.15, (count, points)), axis=0)
    step = rng.normal(0.0, 0.08, (count, points))
    step[-1] = 0.0
    return moved, step, rng.uniform(0.0, 1.0, points), rng.uniform(1.5, 2.0 * np.pi, points)


@pytest.mark.parametrize("seed", [11, 12, 13])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_chip_is_the_smallest_distance_to_the_surfaces_ahead(seed, count):
    moved, step, start, end = surfaces(np.random.default_rng(seed), count, 12)
    keep = np.arange(12) % 4 != 1
    node, which, first, last = chip_pieces(moved, step, start, end, keep)
    assert not np.any(node % 4 == 1)
    for i in np.flatnonzero(keep):
        own = np.flatnonzero(node == i)
        # one piece a surface between two of its ends, in the order of the angles
        assert np.all(first[own] < last[own])
        assert np.all(last[own][:-1] <= first[own][1:])
        together = last[own][:-1] == first[own][1:]
        assert np.all(which[own][:-1][together] != which[own][1:][together])
        ends = np.concatenate([first[own], last[own], [start[i], end[i]]])
        phi = np.linspace(start[i], end[i], 1201)
        # what a sample's surface is at an end may be the one or the other
        phi = phi[np.min(np.abs(phi[:, None] - ends), axis=1) > 1e-9]
        chip, surface = smallest_chip(moved[:, i], step[:, i], phi)
        found = np.full(phi.size, -1)
        for k in own:
            found[(phi > first[k]) & (phi < last[k])] = which[k]
        np.testing.assert_array_equal(found, np.where(chip > 0.0, surface, -1))


def test_nothing_is_told_of_points_that_are_left_out():
    moved, step, start, end = surfaces(np.random.default_rng(1), 3, 4)
    assert not any(part.size for part in chip_pieces(moved, step, start, end, np.zeros(4, dtype=bool)))


def test_surfaces_side_by_side_meet_nowhere_and_equal_ones_count_once():
    """Of two that are moved alike the nearer one is cut; of two that are the same, the first."""
    moved, step = np.array([[0.1], [0.1], [0.1]]), np.array([[0.02], [0.0], [0.0]])
    node, which, first, last = chip_pieces(moved, step, np.array([0.2]), np.array([3.0]), np.ones(1, dtype=bool))
    assert (node.tolist(), which.tolist(), first.tolist(), last.tolist()) == ([0], [1], [0.2], [3.0])


def test_a_surface_that_is_met_by_nothing_ends_where_its_chip_does():
    """One surface, offset inwards: its chip ends where 0.1 sin(phi) = 0.05, at 30 and at 150 degrees."""
    node, _, first, last = chip_pieces(np.array([[0.1]]), np.array([[-0.05]]), np.zeros(1), np.array([np.pi]), np.ones(1, dtype=bool))
    assert node.tolist() == [0]
    assert np.degrees([first[0], last[0]]) == pytest.approx([30.0, 150.0])
    # and, offset outwards, at 210 and at 330
    _, _, first, last = chip_pieces(np.array([[0.1]]), np.array([[0.05]]), np.zeros(1), np.array([2.0 * np.pi]), np.ones(1, dtype=bool))
    assert np.degrees([first[0], last[0], first[1], last[1]]) == pytest.approx([0.0, 210.0, 330.0, 360.0])


def test_where_three_surfaces_meet_none_has_an_empty_piece():
    moved = np.array([[0.1], [0.2], [0.3]])
    step = 0.15 - moved * np.sin(0.5)
    _, which, first, last = chip_pieces(moved, step, np.zeros(1), np.array([np.pi]), np.ones(1, dtype=bool))
    assert which.tolist() == [2, 0, 2]
    assert np.all(last - first > 0.1)


def test_a_tooth_that_is_not_moved_cuts_nothing():
    assert chip_pieces(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1), np.array([np.pi]), np.ones(1, dtype=bool))[0].size == 0
