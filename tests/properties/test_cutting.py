"""Laws of cutting forces and of the material that is taken out."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.solid import ToolSolid

ORDERS = np.arange(0, 21)
FORCES = CuttingCoefficients(9e8, 0.3, 0.1, 1.5e4, 2e4, 5e3)
SOLID = ToolSolid.of(Cutter(2, 0.01), 0.04)
BLOCK = np.array([0.06, 0.03, 0.012])
cuts = st.builds(
    lambda teeth, helix, entry, width, turn: (Cutter(teeth, 0.012, helix), Engagement(entry, entry + width * (np.pi - entry)), turn),
    st.integers(1, 6),
    st.floats(0.0, 0.9),
    st.floats(0.0, 2.8),
    st.floats(0.05, 1.0),
    st.floats(-3.0, 3.0),
)


def lines(cut, depth=1e-3, feed=1e-4, coefficients=FORCES):
    cutter, engagement, turn = cut
    return force_lines(cutter, CuttingConditions(900.0, depth, feed, engagement, turn), coefficients, ORDERS)


@settings(max_examples=25, deadline=None)
@given(cuts, st.floats(1e-4, 5e-3), st.floats(1e-4, 5e-3))
def test_two_depths_on_top_of_each_other_are_one(cut, lower, upper):
    """The upper part of a helix comes later by its lag: that is a turn of each line, and nothing else."""
    cutter = cut[0]
    lag = 2.0 * lower * np.tan(cutter.helix) / cutter.diameter
    expected = lines(cut, lower) + lines(cut, upper) * np.exp(-1j * ORDERS * lag)[:, None]
    np.testing.assert_allclose(lines(cut, lower + upper), expected, atol=1e-9 * np.abs(expected).max())


@settings(max_examples=25, deadline=None)
@given(cuts, st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_chip_and_edges_push_independently_of_each_other(cut, feed, edges):
    """Forces are linear in the feed and the edges' forces, each with its own coefficients."""
    chip = replace(FORCES, tangential_edge=0.0, radial_edge=0.0, axial_edge=0.0)
    names = [each.name for each in fields(FORCES) if each.name.endswith("_edge")]
    more = replace(FORCES, **{name: edges * getattr(FORCES, name) for name in names})
    of_chip = lines(cut, coefficients=chip)
    of_edges = lines(cut) - of_chip
    expected = feed * of_chip + edges * of_edges
    np.testing.assert_allclose(lines(cut, feed=feed * 1e-4, coefficients=more), expected, atol=1e-9 * np.abs(expected).max())


@settings(max_examples=25, deadline=None)
@given(cuts, st.integers(1, 5))
def test_lines_of_equal_teeth_are_those_of_one_that_stand_at_multiples_of_their_number(cut, times):
    """As many times the lines of one tooth, where the number of teeth divides the order; nothing elsewhere."""
    cutter, engagement, turn = cut
    one, many = (lines((Cutter(teeth, cutter.diameter, float(cutter.helix)), engagement, turn)) for teeth in (1, times))
    together = ORDERS % times == 0
    np.testing.assert_allclose(many[together], times * one[together], atol=1e-9 * times * np.abs(one).max())
    np.testing.assert_allclose(many[~together], 0.0, atol=1e-9 * times * np.abs(one).max())


places = st.tuples(st.floats(-0.01, 0.07), st.floats(-0.01, 0.04), st.floats(0.006, 0.011))


@settings(max_examples=8, deadline=None)
@given(places, places, st.lists(st.floats(0.05, 0.95), min_size=1, max_size=3, unique=True))
def test_a_move_may_be_told_in_pieces(start, end, shares):
    """Level moves: the same surface is left, and what the pieces take out adds up to what the whole takes."""
    first, last = np.array(start), np.array([*end[:2], start[2]])
    pieces = np.array([first, *(first + share * (last - first) for share in sorted(shares)), last])
    volumes = []
    for path in (np.array([first, last]), pieces):
        field = DexelField.block(np.zeros(3), BLOCK, 1e-3)
        before = field.volume
        for move in pairwise(path):
            Sweep(field, SOLID, ToolPath(np.array(move))).run()
        volumes.append((before, field.volume))
    (before, whole), (_, pieced) = volumes
    assert before == pytest.approx(np.prod(BLOCK), rel=1e-12)
    assert whole == pytest.approx(pieced, abs=1e-13)


@settings(max_examples=8, deadline=None)
@given(places, places)
def test_no_move_takes_more_than_its_tool_sweeps_nor_makes_material(start, end):
    path = np.array([start, [*end[:2], start[2]]])
    field = DexelField.block(np.zeros(3), BLOCK, 1e-3)
    before = field.volume
    Sweep(field, SOLID, ToolPath(path)).run()
    taken = before - field.volume
    depth = BLOCK[2] - start[2]
    swept = depth * (np.pi * 0.005**2 + 0.01 * np.linalg.norm(path[1] - path[0]))
    assert -1e-13 <= taken <= swept + 5e-9
    # whoever comes again finds nothing
    Sweep(field, SOLID, ToolPath(path[::-1].copy())).run()
    assert before - field.volume == pytest.approx(taken, abs=1e-13)
