import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.order import drop_modes, evidence, exchange_modes, model_error
from rcsa_ident.identification.parameters import axis_size, pack, unpack, without_mode
from rcsa_ident.identification.polish import polish
from rcsa_ident.identification.priors import Priors
from tests.identification.conftest import machine_vector, remade


@pytest.fixture(scope="module")
def theta():
    return machine_vector((600.0, 1400.0, 2600.0))


def with_two_more(theta, rng):
    """The same machine with two modes of hardly any shape at 1000 and 3500 Hz."""
    m, n = 3, 5
    part, joint = theta[:-4], theta[-4:]
    more = np.zeros(axis_size(n))
    more[:n] = [*part[:m], *np.log(2.0 * np.pi * np.array([1000.0, 3500.0]))]
    more[n : 3 * n] = [*part[m : 3 * m], *(0.05 * rng.standard_normal(4))]
    rows, cols = np.tril_indices(n)
    lower = np.where(rows == cols, np.log(0.1 * np.exp(more[:n]))[rows] / 2.0 - np.log(30.0), 0.0)
    lower[: m * (m + 1) // 2] = part[3 * m : -3]
    more[3 * n :] = [*lower, *part[-3:]]
    return np.concatenate([more, joint])


def test_evidence_prefers_the_true_number_of_modes(few, theta):
    rng = np.random.default_rng(6)
    data, _ = remade(few.only(Dof.X), theta, (3,), rng, noise=5e-3)
    misfit = Misfit(data, Priors(), (5e-4,))
    full = polish(misfit, with_two_more(theta, rng), (5,), np.zeros((len(data.cut_ids), 2)), 80, grid=32)
    seen = []
    best = drop_modes(full, misfit, lambda stage, value: seen.append((stage, value)))
    assert best.orders == (3,)
    assert [stage for stage, _ in seen] == ["4 modes", "3 modes", "2 modes"]
    assert dict(seen)["3 modes"] == pytest.approx(evidence(best, misfit))
    assert dict(seen)["3 modes"] < min(dict(seen)["4 modes"], dict(seen)["2 modes"], evidence(full, misfit))
    frequency = np.sort(np.exp(best.theta[:3])) / (2.0 * np.pi)
    np.testing.assert_allclose(frequency, [600.0, 1400.0, 2600.0], rtol=0.02)


def test_exchange_brings_back_a_mode_that_the_search_has_missed(few, theta):
    rng = np.random.default_rng(8)
    data, _ = remade(few.only(Dof.X), theta, (3,), rng, noise=5e-3)
    misfit = Misfit(data, Priors(), (5e-4,))
    nuisance = np.zeros((len(data.cut_ids), 2))
    right = polish(misfit, theta, (3,), nuisance, 100, grid=32)
    kept = without_mode(unpack(theta[:-4], 3), 1)
    poor = polish(misfit, np.concatenate([pack(kept), theta[-4:]]), (2,), nuisance, 60, grid=32)
    assert evidence(poor, misfit) > evidence(right, misfit) + 100.0
    found = exchange_modes(poor, misfit, (530.0, 4300.0))
    assert found.orders == (3,)
    assert evidence(found, misfit) == pytest.approx(evidence(right, misfit), abs=3.0)


def test_exchange_leaves_the_right_model_alone(few, theta):
    data, _ = remade(few.only(Dof.X), theta, (3,), np.random.default_rng(9), noise=5e-3)
    misfit = Misfit(data, Priors(), (5e-4,))
    right = polish(misfit, theta, (3,), np.zeros((len(data.cut_ids), 2)), 100, grid=32)
    found = exchange_modes(right, misfit, (530.0, 4300.0))
    assert found.orders == (3,)
    assert evidence(found, misfit) <= evidence(right, misfit)


def test_evidence_of_a_linear_model_is_exact(few, theta):
    # in the priors' own unknowns alone, without data: cost 0 + log det ratio 0
    data = few.only(Dof.X)
    solution = polish(Misfit(data, Priors(), (1e6,)), theta, (3,), np.zeros((len(data.cut_ids), 2)), 50)
    value = evidence(solution, Misfit(data, Priors(), (1e6,)))
    assert value == pytest.approx(0.0, abs=1e-2)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_model_error_recovers_a_planted_scatter(shop, theta, seed):
    rng = np.random.default_rng(seed)
    every = shop.prepare(shop.measurements(rng, axes=(Dof.X,))[0])
    data, _ = remade(every, theta, (3,), rng, noise=2e-3, scatter=1e-2)
    misfit = Misfit(data, Priors(), (1e-2,))
    solution = polish(misfit, theta, (3,), np.zeros((len(data.cut_ids), 2)), 60, grid=32)
    assert model_error(solution, misfit)[0] == pytest.approx(1e-2, rel=0.2)


def test_model_error_has_a_floor(few, theta):
    data, _ = remade(few.only(Dof.X), theta, (3,), np.random.default_rng(4), noise=0.0)
    misfit = Misfit(data, Priors(), (1e-3,))
    solution = polish(misfit, theta, (3,), np.zeros((len(data.cut_ids), 2)), 60, grid=32)
    assert model_error(solution, misfit) == (5e-4,)
