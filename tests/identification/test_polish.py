import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.polish import polish
from rcsa_ident.identification.priors import Priors
from tests.identification.conftest import machine_vector, remade

ORDERS = (3,)


@pytest.fixture(scope="module")
def theta():
    return machine_vector((600.0, 1400.0, 2600.0))


@pytest.fixture(scope="module")
def planted(few, theta):
    """Lines of the model itself without noise; their variance says 1e-6."""
    data, delay = remade(few.only(Dof.X), theta, ORDERS, np.random.default_rng(3), noise=0.0)
    return data, delay


@pytest.fixture(scope="module")
def misfit(planted):
    return Misfit(planted[0], Priors(), (1e-3,))


@pytest.fixture(scope="module")
def start(theta):
    return theta + 0.03 * np.random.default_rng(5).standard_normal(theta.size)


def test_finds_the_minimum_to_rounding(misfit, planted, theta, start):
    data, delay = planted
    found = polish(misfit, start, ORDERS, np.zeros((len(data.cut_ids), 2)), 300, grid=32, tolerance=1e-6)
    assert found.converged
    # what is left of the cost are the priors, which no data can silence
    assert found.evaluation.chi2[0] < 1e-3 * misfit.points
    assert np.abs(found.evaluation.linear.gradient / np.sqrt(np.diag(found.evaluation.hessian))).max() < 1e-2
    assert found.cost <= misfit.evaluate(theta, ORDERS, np.stack([delay, 0.0 * delay], axis=1)).cost
    miss = found.evaluation.nuisance[:, 0] - delay
    period = data.cut_prior[:, 3]
    assert np.abs(miss - period * np.round(miss / period)).max() < 1e-3 * period.min()


def test_says_when_steps_run_out(misfit, start):
    nuisance = np.zeros((len(misfit.data.cut_ids), 2))
    found = polish(misfit, start, ORDERS, nuisance, 2, grid=32)
    assert not found.converged
    assert found.steps == 2
    none = polish(misfit, start, ORDERS, nuisance, 0, grid=32)
    assert not none.converged
    np.testing.assert_array_equal(none.theta, start)


def test_never_raises_the_cost(misfit, theta):
    rng = np.random.default_rng(5)
    for size in (0.1, 1.0, 3.0):
        begin = theta + size * rng.standard_normal(theta.size)
        costs = []
        for steps in range(6):
            costs.append(polish(misfit, begin, ORDERS, np.zeros((len(misfit.data.cut_ids), 2)), steps, grid=32).cost)
        assert np.all(np.diff(costs) <= 0.0), size
        assert costs[-1] < costs[0]


def test_no_numbers_is_not_converged(misfit, theta):
    begin = np.array(theta)
    begin[4] = np.nan
    found = polish(misfit, begin, ORDERS, np.zeros((len(misfit.data.cut_ids), 2)), 5)
    assert not found.converged


def test_light_damping_is_raised_as_far_as_a_step_needs(misfit, theta):
    # many good steps take the damping to its least; one that overshoots must not pass for the end
    begin = theta + 0.03 * np.random.default_rng(4).standard_normal(theta.size)
    found = polish(misfit, begin, ORDERS, np.zeros((len(misfit.data.cut_ids), 2)), 200, grid=32)
    assert np.abs(found.evaluation.linear.gradient / np.sqrt(np.diag(found.evaluation.hessian))).max() < 50.0
