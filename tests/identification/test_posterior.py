import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.posterior import MachineAxis, Posterior
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import JOINT, Layout, ModalBlock, flange_layout, unpack
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.tool_holder.model import tool_holder_receptance
from tests.identification.models import machine_vector, remade, vector_of
from tests.identification.test_unknowns import receptance

THREE = ModalBlock(3)
SOFT = ModalBlock(3, softening=True)
SPEEDS = (1500.0, 600.0)
OMEGA = 2.0 * np.pi * np.linspace(500.0, 4000.0, 60)


@pytest.fixture(scope="module")
def theta():
    return machine_vector((600.0, 1400.0, 2600.0))


@pytest.fixture(scope="module")
def soft():
    """A machine that changes by some percents over the campaign's speeds."""
    return vector_of(Layout((SOFT,)), ((600.0, 1400.0, 2600.0),))


@pytest.fixture(scope="module")
def tip(shop):
    holder = tool_holder_receptance(shop.held_out.assembly, OMEGA)

    def response(modes, joint):
        return couple(holder, modes.receptance(holder.omega), joint)["tip", "tip"][:, 0, 0]

    return response


def spread(posterior, tip, speed=None):
    """Changes of a tip's receptance along all independent directions, shape (p, n)."""
    return posterior.part(Dof.X, speed).response(lambda candidate: tip(candidate.flange, candidate.joint))[1]


def posterior_at(few, theta, noise):
    data, _ = remade(few.only(Dof.X), theta, flange_layout(3), np.random.default_rng(8), noise=noise)
    misfit = Misfit(data, Priors(), (1e-6,))
    solution = refine(misfit, theta, flange_layout(3), np.zeros((len(data.cut_ids), 2)), 100, grid=32)
    return Posterior(solution.theta, np.linalg.inv(solution.evaluation.hessian), THREE)


def some_covariance(size, deviation=2e-3, seed=9):
    root = deviation * np.random.default_rng(seed).standard_normal((size, size))
    return root @ root.T / size


def deviation(rows):
    return np.sqrt(np.sum(np.abs(rows) ** 2, axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("speed", [None, 2000.0])
def test_spread_against_draws(soft, tip, speed):
    # where the response is straight over the posterior, its spread is that of the draws
    rng = np.random.default_rng(9)
    posterior = Posterior(soft, some_covariance(soft.size), SOFT, SPEEDS)
    rows = spread(posterior, tip, speed)
    draws = rng.multivariate_normal(soft, posterior.covariance, size=600)
    values = np.array([tip(*posterior.machine(Dof.X, draw, speed)) for draw in draws])
    sampled = np.std(values, axis=0)
    np.testing.assert_allclose(deviation(rows), sampled, rtol=0.15)


@pytest.mark.slow
def test_bands_shrink_with_the_noise(few, theta, tip):
    loud, quiet = (deviation(spread(posterior_at(few, theta, noise), tip)) for noise in (1e-2, 1e-3))
    ratio = loud / quiet
    assert 2.0 < np.median(ratio) < 12.0
    assert np.all(ratio > 1.0)


def test_no_uncertainty_no_band(theta, tip):
    rows = spread(Posterior(theta, np.zeros((theta.size, theta.size)), THREE), tip)
    assert rows.shape == (1, 60)
    assert np.all(rows == 0.0)


def test_each_rival_adds_its_difference(theta, tip):
    """Of fewer modes and of more: what is not known of the number of modes belongs to the band."""
    rivals = (machine_vector((620.0, 2500.0)), machine_vector((600.0, 1400.0, 2600.0, 3100.0)), theta)
    covariance = some_covariance(theta.size)
    alone = Posterior(theta, covariance, THREE)
    rows = spread(Posterior(theta, covariance, THREE, rivals=rivals), tip)
    np.testing.assert_allclose(rows[:-3], spread(alone, tip), rtol=1e-12)
    here = tip(*alone.machine(Dof.X))
    for row, rival, modes in zip(rows[-3:], rivals, (2, 4, 3), strict=True):
        other = Posterior(rival, np.eye(rival.size), ModalBlock(modes))
        np.testing.assert_allclose(row, tip(*other.machine(Dof.X)) - here, rtol=1e-9, atol=1e-20)
    np.testing.assert_array_equal(rows[-1], 0.0)
    # a rival alone is a band, too
    only = spread(Posterior(theta, 0.0 * covariance, THREE, rivals=rivals[:1]), tip)
    np.testing.assert_allclose(only, rows[-3:-2], rtol=1e-12)


def test_rivals_change_with_speed_as_well(soft, tip):
    rival = vector_of(Layout((ModalBlock(2, softening=True),)), ((620.0, 2500.0),), seed=2)
    posterior = Posterior(soft, np.zeros((soft.size, soft.size)), SOFT, SPEEDS, (rival,))
    row = spread(posterior, tip, 2100.0)[0]
    other = Posterior(rival, np.eye(rival.size), ModalBlock(2, softening=True), SPEEDS)
    expected = tip(*other.machine(Dof.X, speed=2100.0)) - tip(*posterior.machine(Dof.X, speed=2100.0))
    np.testing.assert_allclose(row, expected, rtol=1e-9)


def test_machine_is_that_of_the_vector(theta):
    posterior = Posterior(theta, np.eye(theta.size), THREE)
    modes, joint = posterior.machine(Dof.Y)
    assert [str(c) for c in modes.coordinates] == ["flange.y", "flange.y'"]
    assert joint.rotational_stiffness == pytest.approx(5e6)
    np.testing.assert_allclose(modes.receptance(OMEGA).values, receptance(unpack(theta[:-JOINT], THREE), OMEGA)[:, :2, :2], rtol=1e-7)
    # one that does not change is the same at any speed
    np.testing.assert_array_equal(posterior.machine(Dof.Y, speed=1e4)[0].phi, modes.phi)


@pytest.mark.parametrize(
    ("speed", "x"), [(None, 0.0), (1500.0, 0.0), (900.0, -1.0), (1800.0, 0.5), (2100.0, 1.0), (5000.0, 1.0), (10.0, -1.0)]
)
def test_machine_at_a_speed(soft, speed, x):
    """Straight from the equations with the stiffness of that speed; outside the campaign the nearest speed answers."""
    posterior = Posterior(soft, np.eye(soft.size), SOFT, SPEEDS)
    found = posterior.machine(Dof.X, speed=speed)[0].receptance(OMEGA).values
    expected = receptance(unpack(soft[:-JOINT], SOFT), OMEGA, x)[:, :2, :2]
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()
    middle = posterior.machine(Dof.X)[0]
    axis = MachineAxis(Spindle(middle), posterior.machine(Dof.X)[1], posterior)
    np.testing.assert_array_equal(axis.at(Dof.X, speed)[0].phi, posterior.machine(Dof.X, speed=speed)[0].phi)
    assert MachineAxis(Spindle(middle), axis.joint).at(Dof.X, speed)[0] is middle


def test_a_covariance_of_another_size_is_refused(theta):
    with pytest.raises(InputError, match="covariance"):
        Posterior(theta, np.eye(theta.size - 1), THREE)
    with pytest.raises(InputError, match="3 modes and a joint"):
        Posterior(theta[1:], np.eye(theta.size - 1), THREE)
    posterior = Posterior(theta, np.eye(theta.size), THREE, rivals=(theta[1:],))
    with pytest.raises(InputError, match="whole number of modes"):
        posterior.machine(Dof.X, posterior.rivals[0])
