"""Frequencies that a receptance's spread is asked at in place of all."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rcsa_ident.dynamics.uncertain import CHANGE, GROWTH, WIDEST, nodes_of


@given(st.lists(st.complex_numbers(min_magnitude=0.1, max_magnitude=10.0), min_size=2, max_size=200))
def test_nodes_leave_nothing_out(values):
    """First and last are among them, none is farther than allowed, and where the curve jumps every line stands."""
    curve = np.array(values)
    nodes = nodes_of([curve])
    assert nodes[0] == 0
    assert nodes[-1] == curve.size - 1
    assert np.all(np.diff(nodes) >= 1)
    assert np.all(np.diff(nodes) <= WIDEST + 1)
    steep = np.abs(np.diff(curve)) / np.maximum(np.abs(curve[1:]), np.abs(curve[:-1])) >= CHANGE
    # between two steep lines there is a node at each end
    for k in np.flatnonzero(steep[:-1] & steep[1:]):
        assert k + 1 in nodes


def test_nodes_stand_close_on_both_sides_of_a_jump():
    """Distances shrink towards it and grow away from it, each by a share of what it is."""
    curve = np.ones(400, dtype=complex)
    curve[200:] = 3.0
    gaps = np.diff(nodes_of([curve]))
    nodes = nodes_of([curve])
    place = int(np.searchsorted(nodes, 200))
    before, behind = gaps[:place][::-1], gaps[place:]
    for side in (before, behind):
        assert np.all(side[:6] <= 2)
        assert side.max() >= WIDEST - 1
        far = np.concatenate([[0], np.cumsum(side)[:-1]])
        assert np.all(side <= 3 + 2 * GROWTH * far)
