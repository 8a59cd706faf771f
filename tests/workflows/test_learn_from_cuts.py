"""Learning from labels as a use case: the same answer however it is computed, and softening."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.stability.labels.averaging import belief_in
from rcsa_ident.stability.labels.coverage import Covered
from rcsa_ident.stability.labels.label_posterior import Effort, LabelModel
from rcsa_ident.stability.labels.next_test import most_telling
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.learn_from_cuts import Believed, learn_from_cuts, next_tests
from tests.stability.labels.test_uncertain_tip import modes

TOOLING, CUT = BareCutter("T", Cutter(2, 0.012)), CutSpec()
EFFORT = Effort(120, 60, 1, 50)
CUTS = TestedCuts(from_rpm(np.array([8000.0, 8000.0])), np.array([0.4e-3, 0.9e-3]), (Verdict.STABLE, Verdict.CHATTER))


def believed(softening=0.0):
    prior = UncertainTip.independent(modes(), np.array([[0.07] * 2, [0.3] * 2, [0.25] * 2]), (0.1, 0.2), softening)
    return Believed(prior, CuttingCoefficients(9e8, 0.3))


def test_it_does_not_matter_how_draws_are_divided():
    """In one task or task by task from the end: the same draws."""

    def backwards(function, tasks):
        tasks = list(tasks)
        return [function(task) for task in tasks[::-1]][::-1]

    one, two = (learn_from_cuts(believed(), TOOLING, CUT, CUTS, ZeroOrder(), seed=3, effort=EFFORT, map=each) for each in (map, backwards))
    assert np.array_equal(one.posterior.z, two.posterior.z)
    assert np.array_equal(one.posterior.error, two.posterior.error)
    other = learn_from_cuts(believed(), TOOLING, CUT, CUTS, ZeroOrder(), seed=4, effort=EFFORT)
    assert not np.array_equal(one.posterior.z, other.posterior.z)


def test_the_median_of_the_draws_is_the_limit():
    learnt = learn_from_cuts(believed(), TOOLING, CUT, CUTS, ZeroOrder(), effort=EFFORT)
    process, speeds = CUT.process(TOOLING.cutter, learnt.workpiece), from_rpm(np.array([8000.0, 10_000.0, 12_000.0]))
    lobes = learnt.limits(process, speeds, 3e-3, 50)
    assert lobes.drawn.shape == (50, 3)
    ranked = np.sort(lobes.drawn, axis=0)
    assert np.all((lobes.limit_depth >= ranked[24]) & (lobes.limit_depth <= ranked[25]))
    # a cut as deep as the median is as likely stable as not, but for the boundary's own width
    here = TestedCuts(speeds[:1], lobes.limit_depth[:1], (Verdict.MARGINAL,))
    assert learnt.answers(process, here).stable[0] == pytest.approx(0.5, abs=0.1)


def test_coefficients_of_another_material_keep_what_the_labels_taught():
    """Twice the coefficients, half the limit of every draw."""
    learnt = learn_from_cuts(believed(), TOOLING, CUT, CUTS, ZeroOrder(), effort=EFFORT)
    speeds, twice = from_rpm(np.array([9000.0])), CutSpec(coefficients={"tangential": 18e8})
    one, half = (learnt.limits(cut.process(TOOLING.cutter, learnt.workpiece), speeds, 50e-3, 50).drawn for cut in (CUT, twice))
    assert half == pytest.approx(0.5 * one, rel=1e-6)


def test_softening_is_one_more_number_of_each_draw():
    learnt = learn_from_cuts(believed(1e-4), TOOLING, CUT, CUTS, ZeroOrder(), effort=EFFORT)
    assert learnt.posterior.z.shape[1] == believed().prior.size + 1


def test_next_tests_are_those_whose_labels_tell_most():
    learnt = learn_from_cuts(believed(), TOOLING, CUT, TestedCuts.none(), ZeroOrder(), LabelModel(), effort=EFFORT)
    process = CUT.process(TOOLING.cutter, learnt.workpiece)
    speed = from_rpm(np.array([8000.0, 8000.0, 8000.0, 9000.0]))
    among = TestedCuts(speed, np.array([0.01e-3, 0.5e-3, 40e-3, 0.7e-3]), (Verdict.MARGINAL,) * 4)
    found = next_tests(learnt, process, 2, among, speed, 1e-3)
    expected = most_telling(learnt.stable_by_draw(process, among), 2, np.random.default_rng(1))
    assert [f.axial_depth for f in found] == [among.axial_depth[k] for k in expected]
    assert {round(1e3 * f.axial_depth, 2) for f in found} == {0.5, 0.7}
    # candidates keep their conditions, and have the probability that `lobes --tests` gives
    taught = learn_from_cuts(believed(), TOOLING, CUT, CUTS, ZeroOrder(), effort=EFFORT)
    own = tuple(OwnConditions(radial_immersion=share) for share in (0.1, 0.5, 0.9, 0.2))
    other = TestedCuts(among.spindle_speed, among.axial_depth, among.verdict, own=own)
    one = next_tests(taught, process, 1, other, speed, 1e-3)[0]
    place = own.index(one.own)
    assert one.axial_depth == other.axial_depth[place]
    assert one.probability_stable == pytest.approx(taught.answers(process, other).stable[place])
    free = next_tests(learnt, process, 3, None, from_rpm(np.arange(8000.0, 9001.0, 500.0)), 3e-3)
    assert all(0.1 < f.probability_stable < 0.9 for f in free)


def test_answers_are_averages_where_labels_are_and_beliefs_where_there_are_none():
    """Cuts milled up are labelled: a cut milled down has the probability of before the first label, whatever was learnt."""
    up, down = OwnConditions(strategy="up"), OwnConditions(strategy="down")
    labels = TestedCuts(CUTS.spindle_speed, CUTS.axial_depth, CUTS.verdict, own=(up, up))
    learnt = learn_from_cuts(believed(), TOOLING, CUT, labels, ZeroOrder(), effort=EFFORT)
    process = CUT.process(TOOLING.cutter, learnt.workpiece)
    depth = np.array([0.9e-3, 0.9e-3])
    asked = TestedCuts(CUTS.spindle_speed, depth, (Verdict.MARGINAL,) * 2, own=(up, down))
    found = learnt.answers(process, asked)
    assert found.covered == (Covered.YES, Covered.NO)
    physics = learnt.stable_by_draw(process, asked).mean(axis=0)[0]
    without = learnt.process.told(learnt.process.features_of(asked, process))[0][0]
    weight = 1.0 - learnt.trust
    assert found.stable[0] == pytest.approx((1.0 - weight) * physics + weight * without)
    belief = belief_in(learnt.posterior.log_score_before, 2)
    fresh = learn_from_cuts(believed(), TOOLING, CUT, TestedCuts.none(), ZeroOrder(), effort=Effort(10, 0, 0, 2000))
    assert found.stable[1] == pytest.approx(0.5 + belief * (fresh.answers(process, asked).stable[1] - 0.5), abs=0.05)
    assert 0.1 < belief < 0.9
    assert 0.0 < learnt.trust < 1.0 == fresh.trust
