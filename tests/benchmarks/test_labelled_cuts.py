"""The labelled cuts that lie beside the project."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import labelled_cuts
from benchmarks.label_scores import Score
from benchmarks.labelled_cuts import CUTS, TRAINING, Pool, margins_of, read, scores_after, unseen
from rcsa_ident.stability.labels.label_posterior import LabelModel
from rcsa_ident.stability.labels.tested_cuts import Verdict
from tests.fixtures.paths import ROOT

needs_cuts = pytest.mark.skipif(not CUTS.exists(), reason="the labelled cuts are not beside the project")


@needs_cuts
def test_what_is_known_of_the_cuts():
    cuts, training = read(CUTS), read(TRAINING)
    assert (len(cuts.verdict), len(training.verdict), int(unseen(cuts, training).sum())) == (118, 40, 79)
    assert int(cuts.seen(Verdict.STABLE).sum()) == 82
    assert cuts.contradictions == training.contradictions == ()
    always = Score.of(np.full(118, 1.0 - 1e-9), cuts)
    assert (always.right, always.cuts) == (82, 118)


@needs_cuts
@pytest.mark.slow
def test_forty_labels_teach():
    """Of few draws of the prior: cuts of speeds that were never learnt are told better than before."""
    cuts, training, model = read(CUTS), read(TRAINING), LabelModel()
    z = np.random.default_rng(3).standard_normal((1500, 8))
    pool = Pool(z, cuts, margins_of(cuts)(z).margin)
    places = np.flatnonzero(np.isin(cuts.spindle_speed, training.spindle_speed))
    before, after = (scores_after(pool, learnt, model)[1] for learnt in (np.zeros(0, dtype=int), places))
    assert after.cuts < before.cuts == 118
    assert after.log_score > before.log_score + 0.05


def test_the_page_shows_the_cuts_figure():
    text = (ROOT / "docs" / "labelled_cuts.md").read_text(encoding="utf-8")
    assert "](labelled_cuts.png)" in text
    assert (ROOT / "docs" / "labelled_cuts.png").exists()
    assert labelled_cuts.PAGE == ROOT / "docs" / "labelled_cuts.md"
