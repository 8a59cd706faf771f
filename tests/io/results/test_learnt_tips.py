"""LEARNT.json."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.io.results.learnt_tips import learnt_tip_of, read_learnt_tip, write_learnt_tip
from rcsa_ident.machine.learnt_tip import LearntTip
from rcsa_ident.stability.labels.label_posterior import LabelModel, LabelPosterior
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.stability.tip_modes import DIRECTIONS, TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.learn_from_cuts import learn_from_cuts
from tests.workflows.test_learn_from_cuts import CUT, EFFORT, TOOLING, believed


def test_a_mode_that_moves_along_z_is_read_back(tmp_path):
    """The residual compliance beside it has three rows, which were refused."""
    mode = normal_modes([4400.0], [0.03], 0.35 * np.array([[0.6, 0.64, 0.48]]), DIRECTIONS[:3])
    prior = UncertainTip.independent(TipModes.joined([mode.pole_residue()]), np.full((3, 1), 0.1), (0.1, 0.2))
    posterior = LabelPosterior(np.zeros((2, prior.size)), np.array([[900.0, 0.5, 0.0]]), np.zeros((2, 1)), 0.0, 2.0)
    cuts = TestedCuts(np.array([900.0]), np.array([1e-3]), (Verdict.STABLE,))
    learnt = LearntTip(prior, CuttingCoefficients(9e8, 0.3), ZeroOrder(), LabelModel(), cuts, posterior)
    write_learnt_tip(tmp_path / "L.json", learnt)
    found, omega = read_learnt_tip(tmp_path / "L.json"), np.array([10.0, 4400.0])
    np.testing.assert_allclose(found.prior.modes.response(omega), learnt.prior.modes.response(omega), rtol=1e-9)


def test_labels_without_physics_and_what_cuts_tell_are_read_back(tmp_path):
    """The same answers of cuts as before."""
    own = (OwnConditions(0.5e-3, None, "up", 0.1e-3, "worn", "monday", (Verdict.CHATTER,)), OwnConditions(strategy="down"))
    cuts = TestedCuts(np.array([900.0, 800.0]), np.array([1e-3, 2e-3]), (Verdict.STABLE, Verdict.CHATTER), own=own)
    learnt = learn_from_cuts(believed(), TOOLING, CUT, cuts, ZeroOrder(), effort=EFFORT)
    write_learnt_tip(tmp_path / "L.json", learnt)
    found = read_learnt_tip(tmp_path / "L.json")
    assert found.cuts.own == own
    assert found.trust == pytest.approx(learnt.trust)
    process = CUT.process(TOOLING.cutter, learnt.workpiece)
    again, first = (each.answers(process, cuts) for each in (found, learnt))
    assert again.stable == pytest.approx(first.stable, abs=1e-6)
    assert again.covered == first.covered


def test_a_file_of_before_is_refused(tmp_path):
    with pytest.raises(InputError, match="schema_version: found 1, allowed is 2"):
        learnt_tip_of({"schema_version": 1}, "L.json")
