from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import Layout, ModalBlock, flange_layout
from tests.identification.models import machine_vector, remade, vector_of

LAYOUT = flange_layout(3)


@pytest.fixture(scope="module")
def theta():
    return machine_vector((600.0, 1400.0, 2600.0))


@pytest.fixture(scope="module")
def planted(few, theta):
    """Lines of the model itself without noise; their variance says 1e-6."""
    data, delay = remade(few.only(Dof.X), theta, LAYOUT, np.random.default_rng(3), noise=0.0)
    return data, delay


@pytest.fixture(scope="module")
def misfit(planted):
    return Misfit(planted[0], Priors(), (1e-3,))


@pytest.fixture(scope="module")
def start(theta):
    return theta + 0.03 * np.random.default_rng(5).standard_normal(theta.size)


@pytest.mark.slow
def test_finds_the_minimum_to_rounding(misfit, planted, theta, start):
    data, delay = planted
    found = refine(misfit, start, LAYOUT, np.zeros((len(data.cut_ids), 2)), 300, grid=32, tolerance=1e-6)
    assert found.converged
    # what is left of the cost are the priors, which no data can silence
    assert found.evaluation.chi2[0] < 1e-3 * misfit.points
    assert np.abs(found.evaluation.linear.gradient / np.sqrt(np.diag(found.evaluation.hessian))).max() < 1e-2
    assert found.cost <= misfit.evaluate(theta, LAYOUT, np.stack([delay, 0.0 * delay], axis=1)).cost
    miss = found.evaluation.nuisance[:, 0] - delay
    period = data.cut_prior.tooth_period
    assert np.abs(miss - period * np.round(miss / period)).max() < 1e-3 * period.min()


def test_says_when_steps_run_out(misfit, start):
    nuisance = np.zeros((len(misfit.data.cut_ids), 2))
    found = refine(misfit, start, LAYOUT, nuisance, 2, grid=32)
    assert not found.converged
    assert found.steps == 2
    none = refine(misfit, start, LAYOUT, nuisance, 0, grid=32)
    assert not none.converged
    np.testing.assert_array_equal(none.theta, start)


def test_never_raises_the_cost(misfit, theta):
    rng = np.random.default_rng(5)
    for size in (0.1, 1.0, 3.0):
        begin = theta + size * rng.standard_normal(theta.size)
        costs = []
        for steps in range(6):
            costs.append(refine(misfit, begin, LAYOUT, np.zeros((len(misfit.data.cut_ids), 2)), steps, grid=32).cost)
        assert np.all(np.diff(costs) <= 0.0), size
        assert costs[-1] < costs[0]


def test_no_numbers_is_not_converged(misfit, theta):
    begin = np.array(theta)
    begin[4] = np.nan
    found = refine(misfit, begin, LAYOUT, np.zeros((len(misfit.data.cut_ids), 2)), 5)
    assert not found.converged


def test_light_damping_is_raised_as_far_as_a_step_needs(misfit, theta):
    # many good steps take the damping to its least; one that overshoots must not pass for the end
    begin = theta + 0.03 * np.random.default_rng(4).standard_normal(theta.size)
    found = refine(misfit, begin, LAYOUT, np.zeros((len(misfit.data.cut_ids), 2)), 200, grid=32)
    assert np.abs(found.evaluation.linear.gradient / np.sqrt(np.diag(found.evaluation.hessian))).max() < 50.0


def test_everything_at_once_converges(rich):
    """Two axes and outputs, softening, scales of the forces, tooth angles: lines of the model itself, an honest cost."""
    layout = Layout((ModalBlock(3, 1, True), ModalBlock(2, 1, True)), len(rich.coefficient_spread), rich.clampings)
    truth = vector_of(layout, ((600.0, 1400.0, 2600.0), (900.0, 2100.0)))
    truth[layout.force] *= 0.05
    data, delay = remade(rich, truth, layout, np.random.default_rng(3), noise=1e-3)
    edge = delay - truth[layout.clamping][data.clamping] / data.spindle_speed
    data = replace(data, edge=np.column_stack([edge, data.edge[:, 1]]))
    everything = Misfit(data, Priors(), (1e-4, 1e-4))
    begin = truth + 0.02 * np.random.default_rng(5).standard_normal(truth.size)
    found = refine(everything, begin, layout, np.stack([delay, 0.0 * delay], axis=1), 300)
    assert found.converged
    assert sum(found.evaluation.chi2) < 1.1 * everything.points
    # frequencies and the tooth angles come back within what the Hessian promises
    std = np.sqrt(np.diag(np.linalg.inv(found.evaluation.hessian)))
    away = (found.theta - truth) / std
    for place in (layout.axis(0).start + np.arange(3), layout.axis(1).start + np.arange(2), np.r_[layout.clamping]):
        assert np.abs(away[place]).max() < 5.0
        assert np.all(std[place] < 0.02)
