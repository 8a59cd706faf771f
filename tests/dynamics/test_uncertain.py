"""A receptance with its spread: deviations, draws, places, and straight lines between two of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.uncertain import WIDEST, AtNodes, Doubted, Mixed, UncertainReceptance, Variation

ROWS = (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y), Coordinate("flange", Dof.X))
OMEGA = 2.0 * np.pi * np.arange(100.0, 1000.0)


@dataclass
class Written:
    """A spread that is written down: blocks with their changes at all frequencies."""

    blocks: tuple
    guide: np.ndarray = None

    @property
    def covers(self):
        return frozenset(m for members, _ in self.blocks for m in members)

    def at(self, places):
        return tuple(Variation(members, change[:, places]) for members, change in self.blocks)

    def guides(self):
        return np.zeros((0, OMEGA.size), dtype=complex) if self.guide is None else self.guide


def resonance(hertz, damping=0.03):
    return 1.0 / (1.0 - (OMEGA / (2.0 * np.pi * hertz)) ** 2 + 2j * damping * OMEGA / (2.0 * np.pi * hertz))


def known(seed=1, blocks=(((0, 2), 4), ((1,), 3)), guide=None):
    rng = np.random.default_rng(seed)
    values = np.zeros((OMEGA.size, 3, 3), dtype=complex)
    for i, hertz in enumerate((300.0, 500.0, 420.0)):
        values[:, i, i] = resonance(hertz)
    values[:, 0, 2] = values[:, 2, 0] = 0.3 * resonance(380.0)
    changes = []
    for members, count in blocks:
        b = len(members)
        parts = rng.normal(size=(2, count, OMEGA.size, b, b))
        changes.append((members, 0.01 * (parts[0] + 1j * parts[1])))
    return UncertainReceptance(OMEGA, values, ROWS, ROWS, Written(tuple(changes), guide))


def test_the_spread_is_written_block_by_block():
    tip = known()
    (first, one), (_, other) = tip.variation.blocks
    spread = tip.spread
    assert spread.shape == (7, OMEGA.size, 3, 3)
    for i, row in enumerate(first):
        for j, col in enumerate(first):
            np.testing.assert_array_equal(spread[:4, :, row, col], one[:, :, i, j])
    np.testing.assert_array_equal(spread[4:, :, 1, 1], other[:, :, 0, 0])
    assert not np.any(spread[4:, :, :, [0, 2]])
    assert not np.any(spread[:4, :, 1])


def test_deviations_are_root_sums_of_squares_of_what_varies():
    tip = known()
    found = tip.deviation()
    assert set(found) == {(ROWS[i], ROWS[j]) for i, j in ((0, 0), (0, 2), (2, 0), (2, 2), (1, 1))}
    for (row, col), (real, imaginary) in found.items():
        entry = tip.spread[:, :, ROWS.index(row), ROWS.index(col)]
        np.testing.assert_allclose(real, np.sqrt(np.sum(entry.real**2, axis=0)), rtol=1e-12)
        np.testing.assert_allclose(imaginary, np.sqrt(np.sum(entry.imag**2, axis=0)), rtol=1e-12)


def test_draws_weigh_the_directions_of_each_block_draw_by_draw():
    """Rows of a block move together; blocks do not."""
    tip = known()
    drawn = tip.drawn(11, np.random.default_rng(4))
    rng = np.random.default_rng(4)
    weights = np.array([np.concatenate([rng.standard_normal(4), rng.standard_normal(3)]) for _ in range(11)])
    np.testing.assert_allclose(drawn, tip.values + np.einsum("dp,pnij->dnij", weights, tip.spread), rtol=0.0, atol=1e-13)
    # more draws begin with the same ones
    np.testing.assert_allclose(tip.drawn(20, np.random.default_rng(4))[:11], drawn, rtol=0.0, atol=1e-13)


def test_draws_scatter_as_the_deviations_say():
    tip = known().at_places(np.arange(0, OMEGA.size, 100))
    drawn = tip.drawn(4000, np.random.default_rng(2)) - tip.values
    for (row, col), (real, imaginary) in tip.deviation().items():
        entry = drawn[:, :, ROWS.index(row), ROWS.index(col)]
        # standard deviations of 4000 draws are good to a ninetieth
        np.testing.assert_allclose(entry.real.std(axis=0), real, rtol=0.06)
        np.testing.assert_allclose(entry.imag.std(axis=0), imaginary, rtol=0.06)


def test_places_of_places():
    tip = known()
    part = tip.at_places(np.arange(5, 500, 5))
    twice = part.at_places(np.array([3, 8, 9]))
    places = np.array([20, 45, 50])
    np.testing.assert_array_equal(twice.omega, OMEGA[places])
    np.testing.assert_array_equal(twice.values, tip.values[places])
    np.testing.assert_array_equal(twice.spread, tip.spread[:, places])
    assert twice.variation.covers == tip.variation.covers


def test_only_a_spread_of_all_rows_is_complete():
    assert known().complete
    assert not known(blocks=(((0, 2), 4),)).complete
    bare = UncertainReceptance(OMEGA, known().values, ROWS, ROWS)
    assert not bare.complete
    assert bare.thinned() is bare
    assert bare.spread.shape == (0, OMEGA.size, 3, 3)
    assert bare.deviation() == {}
    np.testing.assert_array_equal(bare.drawn(2, np.random.default_rng(0)), [bare.values, bare.values])
    assert "with its spread" in repr(known())
    assert "spread" not in repr(bare)


def test_between_two_spreads_lies_a_straight_line():
    one, other = known(1), known(2)
    mixed = UncertainReceptance(OMEGA, one.values, ROWS, ROWS, Mixed(one.variation, other.variation, 0.3))
    np.testing.assert_allclose(mixed.spread, 0.7 * one.spread + 0.3 * other.spread, rtol=0.0, atol=1e-15)
    assert mixed.complete
    ends = [UncertainReceptance(OMEGA, one.values, ROWS, ROWS, Mixed(one.variation, other.variation, share)) for share in (0.0, 1.0)]
    np.testing.assert_array_equal(ends[0].spread, one.spread)
    np.testing.assert_array_equal(ends[1].spread, other.spread)


def test_a_thinned_receptance_stands_close_at_its_resonances():
    tip = known()
    thin = tip.thinned()
    assert thin.omega.size < 0.6 * OMEGA.size
    places = np.searchsorted(OMEGA, thin.omega)
    np.testing.assert_array_equal(thin.values, tip.values[places])
    np.testing.assert_array_equal(thin.spread, tip.spread[:, places])
    gaps = np.diff(places)
    near = np.abs(thin.omega[1:] / (2.0 * np.pi) - 500.0) < 10.0
    assert gaps[near].max() <= 4
    assert gaps.max() > 0.5 * WIDEST


@pytest.mark.parametrize("place", [150, 700])
def test_where_a_rival_is_sharp_a_thinned_receptance_stands_close_too(place):
    """Its own curves say nothing of it: the spread's guides do."""
    sharp = resonance(OMEGA[place] / (2.0 * np.pi), 0.001)
    gaps = []
    for guide in (None, sharp[None]):
        places = np.searchsorted(OMEGA, known(guide=guide).thinned().omega)
        gaps.append(np.diff(places)[np.searchsorted(places, place) - 1])
    assert gaps[1] == 1
    assert gaps[0] > 1


@dataclass
class Counted(Written):
    """A spread that remembers how often it was asked."""

    asked: int = 0

    def at(self, places):
        self.asked += 1
        return super().at(places)


def test_a_spread_at_nodes_is_worked_out_there_once():
    tip, nodes = known(), np.arange(0, OMEGA.size, 7)
    spreads = [Counted(known(seed).variation.blocks) for seed in (1, 2)]
    ends = [AtNodes(each, nodes) for each in spreads]
    tips = [UncertainReceptance(OMEGA, tip.values, ROWS, ROWS, Mixed(*ends, share)) for share in (0.0, 0.4, 1.0)]
    for mixed, plain in zip(tips, [Mixed(*spreads, share) for share in (0.0, 0.4, 1.0)], strict=True):
        thin = mixed.thinned()
        np.testing.assert_array_equal(thin.omega, OMEGA[nodes])
        expected = UncertainReceptance(OMEGA, tip.values, ROWS, ROWS, plain).spread
        spreads[0].asked = spreads[1].asked = 0
        np.testing.assert_array_equal(thin.spread, expected[:, nodes])
        np.testing.assert_array_equal(mixed.at_places(nodes[3:9]).spread, expected[:, nodes[3:9]])
        assert spreads[0].asked <= 1
        # elsewhere it is asked as ever
        np.testing.assert_array_equal(mixed.at_places(nodes[:5] + 2).spread, expected[:, nodes[:5] + 2])
        assert mixed.complete
    other = Mixed(ends[0], AtNodes(spreads[1], nodes[1:]), 0.5)
    assert other.nodes is None
    assert Mixed(spreads[0], ends[1], 0.5).nodes is None
    np.testing.assert_array_equal(ends[0].guides(), spreads[0].guides())


@dataclass
class Shared:
    """One block of X and one of Y, two directions each, of which the last is the same one."""

    covers = frozenset((0, 1))

    def at(self, places):
        rng = np.random.default_rng(3)
        changes = rng.normal(size=(2, 2, OMEGA.size, 1, 1)) + 0j
        unknowns = [{Doubted.CONTACT: np.array([[0.6, 0.8]])}, {Doubted.CONTACT: np.array([[0.8, 0.6]])}]
        return tuple(Variation((i,), changes[i][:, places], 1, unknowns[i]) for i in range(2))

    def guides(self):
        return np.zeros((0, OMEGA.size), dtype=complex)


@pytest.mark.slow
def test_what_is_common_is_drawn_once_for_all_blocks():
    tip = UncertainReceptance(OMEGA, known().values, ROWS, ROWS, Shared())
    one, other = (part.change[:, :, 0, 0] for part in Shared().at(np.arange(OMEGA.size)))
    spread = tip.spread
    assert spread.shape == (3, OMEGA.size, 3, 3)
    np.testing.assert_array_equal(spread[[0, 2], :, 0, 0], one)
    np.testing.assert_array_equal(spread[[1, 2], :, 1, 1], other)
    np.testing.assert_array_equal(tip.unknowns()[Doubted.CONTACT], [[0.6, 0.0, 0.8], [0.0, 0.8, 0.6]])
    drawn = tip.drawn(4000, np.random.default_rng(2)) - tip.values
    x, y = drawn[:, 100, 0, 0].real, drawn[:, 100, 1, 1].real
    expected = np.real(one[1, 100] * other[1, 100])
    sizes = np.sqrt(np.sum(one[:, 100].real ** 2) * np.sum(other[:, 100].real ** 2))
    assert abs(np.mean(x * y) - expected) < 0.05 * sizes
    assert abs(expected) > 0.2 * sizes
