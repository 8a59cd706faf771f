import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.search import SearchSettings, _by_frequency, explore, starts
from rcsa_ident.identification.unknowns import DAMPING_UNIT, JOINT, flange_layout, lower_triangle
from tests.identification.models import machine_vector, remade

SMALL = SearchSettings(modes=4, population=4, generations=3, steps=3)
BAND = (500.0, 4200.0)


@pytest.fixture(scope="module")
def misfit(few):
    data, _ = remade(few.only(Dof.X), machine_vector((600.0, 1400.0, 2600.0)), flange_layout(3), np.random.default_rng(7))
    return Misfit(data, Priors(), (0.3,))


def test_population_comes_sorted_and_told(misfit):
    told = []
    found = explore(misfit, SMALL, BAND, np.random.default_rng(1), lambda stage, cost, solution: told.append((stage, cost, solution)))
    costs = [s.cost for s in found]
    assert costs == sorted(costs)
    assert 1 <= len(found) <= SMALL.population
    assert len(told) == SMALL.population * SMALL.generations
    assert {stage for stage, _, _ in told} == {"search"}
    assert min(cost for _, cost, _ in told) == costs[0]
    assert min(cost for _, cost, _ in told[: SMALL.population]) > costs[0]  # a generation later it is better
    assert all(s.layout == flange_layout(4) and s.theta.size == flange_layout(4).size for s in found)
    assert all(solution.cost == cost for _, cost, solution in told)


def test_same_seed_same_population(misfit):
    state = np.random.get_state()[1].copy()  # noqa: NPY002 - it must not be touched
    one, two, other = (explore(misfit, SMALL, BAND, np.random.default_rng(seed)) for seed in (2, 2, 3))
    np.testing.assert_array_equal(state, np.random.get_state()[1])  # noqa: NPY002
    assert [s.theta.tobytes() for s in one] == [s.theta.tobytes() for s in two]
    assert [s.cost for s in one] != [s.cost for s in other]


def test_global_generator_has_no_say(misfit):
    np.random.seed(1)  # noqa: NPY002
    one = explore(misfit, SMALL, BAND, np.random.default_rng(2))
    np.random.seed(2)  # noqa: NPY002
    two = explore(misfit, SMALL, BAND, np.random.default_rng(2))
    assert [s.theta.tobytes() for s in one] == [s.theta.tobytes() for s in two]


def test_starts_spread_over_the_band(misfit):
    modes = 6
    theta = starts(50, modes, BAND, misfit, np.random.default_rng(1))
    frequency = np.exp(theta[:, :modes]) / (2.0 * np.pi)
    assert theta.shape == (50, flange_layout(modes).size)
    assert np.all(np.diff(frequency, axis=1) >= 0.0)
    # one stands for what lies below the band, one for what lies above it
    assert np.all(frequency[:, 0] < BAND[0])
    assert np.all(frequency[:, -1] > BAND[1])
    inside = frequency[:, 1:-1]
    assert BAND[0] <= inside.min() < 1.3 * BAND[0]
    assert 0.95 * BAND[1] < inside.max() <= 1.08 * BAND[1]
    rows, _, diagonal = lower_triangle(modes)
    lower = theta[:, 3 * modes : flange_layout(modes).axes[0].core - 3]
    np.testing.assert_array_equal(lower[:, ~diagonal], 0.0)
    damping = (DAMPING_UNIT * np.exp(lower[:, diagonal])) ** 2 / (2.0 * np.exp(theta[:, rows[diagonal]]))
    assert damping.min() > 0.02
    assert damping.max() < 0.2
    np.testing.assert_allclose(np.exp(theta[:, -JOINT:]), [misfit.priors.joint] * 50)


def test_sorting_by_frequency_is_the_same_machine(misfit):
    theta = machine_vector((2600.0, 600.0, 1400.0), seed=3)
    turned = _by_frequency(theta, flange_layout(3))
    nuisance = np.zeros((len(misfit.data.cut_ids), 2))
    models = [misfit.evaluate(v, flange_layout(3), nuisance).models[0] for v in (theta, turned)]
    np.testing.assert_allclose(models[0], models[1], rtol=1e-9)
    assert np.all(np.diff(turned[:3]) > 0.0)
    np.testing.assert_array_equal(_by_frequency(turned, flange_layout(3)), turned)


def test_damping_lost_to_rounding_stops_nothing(misfit):
    theta = machine_vector((2600.0, 600.0, 1400.0), seed=3)
    theta[9:15] = [-30.0, 2.0, -40.0, 2.0, 0.0, -50.0]
    assert np.all(np.isfinite(_by_frequency(theta, flange_layout(3))))
