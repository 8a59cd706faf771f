import numpy as np
import pytest

from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.polish import polish
from rcsa_ident.identification.posterior import Posterior, spread
from rcsa_ident.identification.priors import Priors
from rcsa_ident.tool_holder.model import tool_holder_receptance
from tests.identification.conftest import machine_vector, remade


@pytest.fixture(scope="module")
def theta():
    return machine_vector((600.0, 1400.0, 2600.0))


@pytest.fixture(scope="module")
def tip(shop):
    holder = tool_holder_receptance(shop.held_out.assembly, 2.0 * np.pi * np.linspace(500.0, 4000.0, 60))

    def response(modes, joint):
        return couple(holder, modes.receptance(holder.omega), joint)["tip", "tip"][:, 0, 0]

    return response


def posterior_at(few, theta, noise):
    data, _ = remade(few.only(Dof.X), theta, (3,), np.random.default_rng(8), noise=noise)
    misfit = Misfit(data, Priors(), (1e-6,))
    solution = polish(misfit, theta, (3,), np.zeros((len(data.cut_ids), 2)), 100, grid=32)
    return Posterior(solution.theta, np.linalg.inv(solution.evaluation.hessian))


def deviation(rows):
    return np.sqrt(np.sum(np.abs(rows) ** 2, axis=0))


def test_spread_against_draws(theta, tip):
    # where the response is straight over the posterior, its spread is that of the draws
    rng = np.random.default_rng(9)
    root = 2e-3 * rng.standard_normal((theta.size, theta.size))
    posterior = Posterior(theta, root @ root.T / theta.size)
    rows = spread(posterior, Dof.X, tip)
    draws = rng.multivariate_normal(theta, posterior.covariance, size=600)
    values = np.array([tip(*posterior.machine(Dof.X, draw)) for draw in draws])
    sampled = np.std(values, axis=0)
    np.testing.assert_allclose(deviation(rows), sampled, rtol=0.15)


def test_bands_shrink_with_the_noise(few, theta, tip):
    loud, quiet = (deviation(spread(posterior_at(few, theta, noise), Dof.X, tip)) for noise in (1e-2, 1e-3))
    ratio = loud / quiet
    assert 2.0 < np.median(ratio) < 12.0
    assert np.all(ratio > 1.0)


def test_no_uncertainty_no_band(theta, tip):
    rows = spread(Posterior(theta, np.zeros((theta.size, theta.size))), Dof.X, tip)
    assert rows.shape == (1, 60)
    assert np.all(rows == 0.0)


def test_machine_is_that_of_the_vector(theta):
    posterior = Posterior(theta, np.eye(theta.size))
    modes, joint = posterior.machine(Dof.Y)
    assert posterior.order == 3
    assert [str(c) for c in modes.coordinates] == ["flange.y", "flange.y'"]
    assert joint.rotational_stiffness == pytest.approx(5e6)


def test_a_covariance_of_another_size_is_refused(theta):
    with pytest.raises(InputError, match="covariance"):
        Posterior(theta, np.eye(theta.size - 1))
    with pytest.raises(InputError, match="whole number of modes"):
        _ = Posterior(theta[1:], np.eye(theta.size - 1)).order
