"""Tested cuts beside a limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, Tally, TestedCuts, Verdict, tally


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
    beside = "the labels contradict each other, or that depth is an island"
    assert told == f"at 7200 rev/min a cut of 1.25 mm was stable and one of 1 mm chattered: {beside}"
    # of another width they do not
    own = tuple(OwnConditions(radial_width=1e-3 * (1 + k)) for k in range(6))
    assert replace(cuts, own=own).contradictions == ()
    many = TestedCuts(np.repeat(np.arange(500.0, 506.0), 2), np.tile([1e-3, 2e-3], 6), (Verdict.CHATTER, Verdict.STABLE) * 6)
    assert len(many.contradictions) == 4
    assert "in 3 further conditions" in many.contradictions[3]


def test_what_labels_of_their_kind_cannot_teach():
    own = (OwnConditions(session="a", strategy="up"),) * 2
    cuts = TestedCuts(np.array([500.0, 600.0]), np.full(2, 1e-3), (Verdict.STABLE,) * 2, own=own)
    assert cuts.notes == (
        "every cut is labelled stable: limits are deeper than the cuts, by how much stays unknown",
        "all labels are of up milling: the other direction has no labels",
    )
    own = tuple(OwnConditions(session=each) for each in "aab")
    again = TestedCuts(np.full(3, 500.0), np.full(3, 1e-3), (Verdict.STABLE, Verdict.CHATTER, Verdict.CHATTER), own=own)
    assert again.notes == (
        "1 session of one cut: there the effect of the session cannot be separated from the cut",
        "1 cut repeated with another verdict: this counts as label noise",
    )
    assert TestedCuts.none().notes == ()


CUT = MillingProcess(Cutter(2, 0.012), CuttingCoefficients(9e8, 0.3), Engagement.from_immersion(0.5, "down"))


def test_a_cut_is_made_as_it_tells():
    own = OwnConditions(radial_width=1.2e-3, strategy="up", feed_per_tooth=0.1e-3)
    made = own.process(CUT)
    assert made.engagement == Engagement.from_immersion(0.1, "up")
    assert made.feed_per_tooth == 0.1e-3
    assert OwnConditions().process(CUT) is CUT
    assert OwnConditions(strategy="up").process(CUT).engagement == Engagement.from_immersion(0.5, "up")
    assert OwnConditions(radial_immersion=1.0).process(CUT).engagement == Engagement.from_immersion(1.0, "down")
    with pytest.raises(InputError, match=r"radial_width_mm: found 13, allowed is at most the cutter's diameter of 12 mm"):
        OwnConditions(radial_width=13e-3).process(CUT)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"radial_width": 0.0}, "radial_width"),
        ({"radial_width": 1e-3, "radial_immersion": 0.5}, "one of the two"),
        ({"radial_immersion": 1.2}, "share of the diameter"),
        ({"strategy": "sideways"}, "one of up, down"),
        ({"edge_state": "old"}, "one of new, worn"),
    ],
)
def test_what_no_cut_tells(given, words):
    with pytest.raises(InputError, match=words):
        OwnConditions(**given)


def test_cuts_that_are_made_alike():
    """Without run-out nothing hangs on the feed."""
    own = tuple(OwnConditions(strategy=s, feed_per_tooth=f) for s, f in (("up", 1e-4), ("", 1e-4), ("up", 2e-4), ("down", None)))
    cuts = TestedCuts(np.full(4, 500.0), np.full(4, 1e-3), (Verdict.STABLE,) * 4, own=own)
    assert [places.tolist() for places, _ in cuts.alike(CUT)] == [[0, 2], [1, 3]]
    run_out = replace(CUT, cutter=Cutter(2, 0.012, runout=np.array([0.0, 5e-6])), feed_per_tooth=1e-4)
    assert [places.tolist() for places, _ in cuts.alike(run_out)] == [[0], [1, 3], [2]]


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
