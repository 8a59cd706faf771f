"""Tested cuts beside a limit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm
from rcsa_ident.stability.labels.tested_cuts import Tally, TestedCuts, Verdict, tally


def test_four_cases_and_the_marginal_ones():
    words = ["stable"] * 3 + ["chatter"] * 4 + ["marginal"] * 3
    depth = np.array([1.0, 2.0, 4.0, 2.0, 3.0, 4.0, 5.0, 1.0, 3.5, 4.0]) * 1e-3
    cuts = TestedCuts(np.linspace(500.0, 900.0, 10), depth, tuple(Verdict(w) for w in words))
    found = tally(cuts, np.full(10, 3e-3))
    # at the limit counts as stable
    assert found == Tally(stable_stable=2, stable_chatter=2, chatter_stable=1, chatter_chatter=2, stable_marginal=1, chatter_marginal=2)
    assert found.decided == 7
    assert found.share_right == pytest.approx(4 / 7)
    assert tally(cuts, np.full(10, np.inf)).share_right == pytest.approx(3 / 7)


@given(st.lists(st.tuples(st.floats(1e-4, 1e-2), st.sampled_from(list(Verdict)), st.floats(1e-4, 1e-2)), min_size=1, max_size=30))
def test_every_cut_is_counted_once(rows):
    cuts = TestedCuts(np.full(len(rows), 500.0), np.array([r[0] for r in rows]), tuple(r[1] for r in rows))
    found = tally(cuts, np.array([r[2] for r in rows]))
    assert found.decided + found.stable_marginal + found.chatter_marginal == len(rows)
    right = sum((d <= limit) is (v is Verdict.STABLE) for d, v, limit in rows if v is not Verdict.MARGINAL)
    assert found.share_right == pytest.approx(right / found.decided) if found.decided else np.isnan(found.share_right)


@pytest.mark.parametrize(
    ("speed", "depth", "limit", "words"),
    [
        ([500.0], [0.0], [1.0], "axial_depth"),
        ([np.nan], [1.0], [1.0], "spindle_speed"),
        ([1.0], [1.0], [np.nan], "limit_depth"),
        ([1.0], [1.0], [], "limit_depth"),
    ],
)
def test_what_is_not_counted(speed, depth, limit, words):
    with pytest.raises(InputError, match=words):
        tally(TestedCuts(np.array(speed), np.array(depth), (Verdict.STABLE,)), np.array(limit))


def test_labels_that_contradict_each_other_are_named():
    speed = from_rpm(np.array([7200.0, 7200.0, 7200.0, 8000.0, 8000.0, 9000.0]))
    words = ("stable", "chatter", "stable", "stable", "chatter", "marginal")
    cuts = TestedCuts(speed, np.array([0.5, 1.0, 1.25, 1.0, 1.1, 1.0]) * 1e-3, tuple(map(Verdict, words)))
    (told,) = cuts.contradictions
    assert told == ("at 7200 rev/min a cut of 1.25 mm was stable and one of 1 mm chattered: the labels contradict each other")


def test_the_same_cut_of_two_tables_counts_once_and_twice_within_one():
    one = TestedCuts(np.array([500.0, 500.0]), np.array([1e-3, 1e-3]), (Verdict.STABLE, Verdict.STABLE))
    two = TestedCuts(np.array([500.0, 600.0]), np.array([1e-3, 1e-3]), (Verdict.STABLE, Verdict.CHATTER), np.array([np.nan, 4000.0]))
    both = one.joined(two)
    assert both.spindle_speed.tolist() == [500.0, 500.0, 600.0]
    assert both.chatter_frequency[2] == 4000.0
    assert len(TestedCuts.none().joined(one).verdict) == 2


def test_a_chatter_frequency_is_above_zero():
    with pytest.raises(InputError, match="chatter_frequency"):
        TestedCuts(np.array([500.0]), np.array([1e-3]), (Verdict.CHATTER,), np.array([0.0]))
