"""Whether labels say something of a cut."""

from __future__ import annotations

import numpy as np

from rcsa_ident.stability.labels.coverage import Covered, covered, uncovered
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict
from tests.stability.labels.test_tested_cuts import CUT


def cuts(*told):
    own = tuple(OwnConditions(strategy=strategy, edge_state=edges) for strategy, edges in told)
    return TestedCuts(np.full(len(own), 500.0), np.full(len(own), 1e-3), (Verdict.STABLE,) * len(own), own=own)


def test_direction_edges_and_distance():
    labels, asked = cuts(("up", "new")), cuts(("up", "new"), ("up", "new"), ("up", "new"), ("up", "worn"), ("down", "new"))
    found = covered(labels, asked, CUT, np.array([0.9, 0.4, 0.1, 0.9, 0.9]))
    assert found == (Covered.YES, Covered.PARTLY, Covered.NO, Covered.PARTLY, Covered.NO)
    assert uncovered(labels, asked, CUT, found) == (
        "no label was ever taken in down milling: of 1 cut the probability is what was believed before any label",
        "1 cut is far from every label: the probability is that of the learnt tip alone",
    )
    assert uncovered(labels, labels, CUT, (Covered.YES,)) == ()
