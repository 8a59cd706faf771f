"""Averages of physics and of labels without it."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.stability.labels.stacking import groups_of, log_score, stable_share, trust_in
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict

S, M, C = Verdict.STABLE, Verdict.MARGINAL, Verdict.CHATTER


def test_the_weight_is_that_of_the_evidence():
    """Odds of four to one, and a factor e for four of the logarithm of both ratios together."""
    assert trust_in(0.0, 0.0) == pytest.approx(0.8)
    assert trust_in(3.0, 1.0) == pytest.approx(4.0 * np.e / (1.0 + 4.0 * np.e))
    assert trust_in(-100.0, 0.0) < 1e-9


def test_votes_are_shares():
    own = (OwnConditions(further=(C,)), OwnConditions(), OwnConditions(further=(M, M)))
    cuts = TestedCuts(np.full(3, 500.0), np.full(3, 1e-3), (S, C, S), own=own)
    assert stable_share(cuts) == pytest.approx([0.5, 0.0, 2.0 / 3.0])
    assert log_score(np.array([0.5, 0.25, 0.5]), np.array([1.0, 0.0, 0.5])) == pytest.approx(np.log([0.5, 0.75, 0.5]).mean())


def test_sessions_are_left_out_together_and_speeds_where_none_are_told():
    speed = np.repeat([500.0, 600.0, 700.0], 2)
    own = tuple(OwnConditions(session=s) for s in "ababab")
    cuts = TestedCuts(speed, np.full(6, 1e-3), (S,) * 6, own=own)
    assert [each.tolist() for each in groups_of(cuts)] == [[0, 2, 4], [1, 3, 5]]
    assert [each.tolist() for each in groups_of(TestedCuts(speed, np.full(6, 1e-3), (S,) * 6))] == [[0, 1], [2, 3], [4, 5]]
    many = groups_of(TestedCuts(np.linspace(500.0, 900.0, 40), np.full(40, 1e-3), (S,) * 40))
    assert [each.size for each in many] == [5] * 8
    assert groups_of(TestedCuts.none()) == []
