"""Whether labels say something of a cut."""

from __future__ import annotations

import numpy as np

from rcsa_ident.stability.labels.coverage import Covered, covered, uncovered, unlabelled
from rcsa_ident.stability.labels.cut_margins import points_of
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict
from tests.stability.labels.test_tested_cuts import CUT


def cuts(*told):
    own = tuple(OwnConditions(strategy=strategy, edge_state=edges) for strategy, edges in told)
    return TestedCuts(np.full(len(own), 500.0), np.full(len(own), 1e-3), (Verdict.STABLE,) * len(own), own=own)


def test_direction_edges_and_distance():
    asked = cuts(("up", "new"), ("up", "new"), ("up", "new"), ("up", "worn"), ("down", "new"))
    labels = points_of(cuts(("up", "new")), CUT)
    found = covered(labels, frozenset({"new"}), asked, CUT, np.array([0.9, 0.4, 0.1, 0.9, 0.9]))
    assert found == (Covered.YES, Covered.PARTLY, Covered.NO, Covered.PARTLY, Covered.NO)
    assert uncovered(labels, asked, CUT, found) == (
        "no label was ever taken in down milling: the probability of 1 cut is what was believed before, or an even chance",
        "1 cut is far from every label: the probability is extrapolated",
    )
    assert uncovered(labels, cuts(("up", "new")), CUT, (Covered.YES,)) == ()


def test_a_question_that_differs_from_all_labels():
    points = np.array([[500.0, 0.05, 1.0], [600.0, 0.1, 1.0]])
    wide = OwnConditions(radial_immersion=0.2, strategy="up").process(CUT)
    assert unlabelled(points, wide) == ("the cut is 2.4 mm wide, labels are of widths from 0.6 to 1.2 mm: limits there are extrapolated",)
    down = OwnConditions(radial_immersion=0.1, strategy="down").process(CUT)
    (said,) = unlabelled(points, down)
    assert said.startswith("no label was ever taken in down milling")
    assert unlabelled(points, OwnConditions(radial_immersion=0.1, strategy="up").process(CUT)) == ()
    assert unlabelled(np.zeros((0, 3)), CUT) == ()
