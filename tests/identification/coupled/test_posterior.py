import pickle
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.identification.coupled.posterior import CoupledPosterior, CoupledUnknowns
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.unknowns import JOINT, CoupledLayout, unpack
from rcsa_ident.tool_holder.turning import turning_receptance
from tests.identification.coupled.models import coupled_vector, dense_receptance

LAYOUT = CoupledLayout(4, softening=True, skew=1, turning=1)
#: Middle of the campaign's speeds and half their range [rad/s].
SPEEDS = (1500.0, 600.0)
OMEGA = 2.0 * np.pi * np.linspace(500.0, 4000.0, 50)
SCALE = np.array([1.0, LEVER, 1.0, LEVER])


def unknowns(layout=LAYOUT, seed=1):
    return CoupledUnknowns(coupled_vector(layout, seed), layout)


def some_covariance(size, deviation=2e-3, seed=9):
    root = deviation * np.random.default_rng(seed).standard_normal((size, size))
    return root @ root.T / size


def posterior(rivals=(), layout=LAYOUT, deviation=2e-3):
    best = unknowns(layout)
    return CoupledPosterior(best, some_covariance(best.theta.size, deviation), SPEEDS, rivals)


@pytest.fixture(scope="module")
def tips(turned_shop):
    """The tip's 2 x 2 receptance of a tooling that turns with the machine, through the room of couplings."""
    holders = {speed: turning_receptance(turned_shop.held_out.assembly, OMEGA, speed) for speed in (SPEEDS[0], 2000.0)}

    def of(speed):
        def response(machine):
            return couple(holders[speed], machine.flange.receptance(OMEGA), machine.joint)["tip", "tip"][:, [0, 0, 2, 2], [0, 2, 0, 2]]

        return response

    return of


def deviation(changes):
    return np.sqrt(np.sum(np.abs(changes) ** 2, axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("speed", [None, 2000.0])
def test_spread_against_draws(tips, speed):
    """Direct and cross terms: where the response is straight over the posterior, its spread is that of the draws."""
    rng = np.random.default_rng(9)
    known = posterior()
    response = tips(SPEEDS[0] if speed is None else speed)
    value, changes = known.part(speed).response(response)
    draws = rng.multivariate_normal(known.best.theta, known.covariance, size=600)
    values = np.array([response(known.candidate(replace(known.best, theta=draw), speed)) for draw in draws])
    np.testing.assert_allclose(value, response(known.candidate(known.best, speed)), rtol=1e-12)
    ratio = deviation(changes) / np.std(values, axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=0.2)
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.05)


def test_directions_are_as_many_as_unknowns(tips):
    rows = posterior().part(None).response(tips(SPEEDS[0]))[1]
    assert rows.shape == (LAYOUT.size, OMEGA.size, 4)


def test_no_uncertainty_no_band(tips):
    rows = posterior(deviation=0.0).part(None).response(tips(SPEEDS[0]))[1]
    assert not np.any(rows)


def test_each_rival_adds_its_difference(tips):
    """Whatever its own number of modes and discs."""
    rivals = (unknowns(CoupledLayout(3), 2), unknowns(CoupledLayout(5, softening=True, skew=2, turning=1), 3), unknowns())
    with_rivals, alone = posterior(rivals), posterior()
    for speed in (None, 2000.0):
        response = tips(SPEEDS[0] if speed is None else speed)
        rows = with_rivals.part(speed).response(response)[1]
        np.testing.assert_allclose(rows[:-3], alone.part(speed).response(response)[1], rtol=1e-12)
        here = response(alone.candidate(alone.best, speed))
        for row, rival in zip(rows[-3:], rivals, strict=True):
            there = response(alone.candidate(rival, speed))
            np.testing.assert_allclose(row, there - here, rtol=1e-9, atol=1e-20)
        assert not np.any(rows[-1])


@pytest.mark.parametrize(
    ("speed", "x"), [(None, 0.0), (1500.0, 0.0), (900.0, -1.0), (1800.0, 0.5), (2100.0, 1.0), (4200.0, 1.0), (10.0, -1.0), (0.0, -1.0)]
)
@pytest.mark.parametrize("sense", [1, -1])
def test_machine_at_a_speed(speed, x, sense):
    """Softening stays at the nearest of the campaign's speeds, gyroscopic moments go on; passive anywhere."""
    layout = replace(LAYOUT, turning=sense)
    known = posterior(layout=layout)
    found = known.candidate(known.best, speed)
    turning = SPEEDS[0] if speed is None else speed
    expected = dense_receptance(unpack(known.best.theta, layout.block), OMEGA, x, turning)[:, :4]
    values = found.flange.receptance(OMEGA).values
    np.testing.assert_allclose(values * np.outer(SCALE, SCALE), expected, atol=1e-8 * np.abs(expected).max())
    # what tool-holders are told
    assert found.flange.speed == sense * turning
    assert found.joint.rotational_stiffness == pytest.approx(5e6)
    assert dissipation(OMEGA, values).min() > -1e-9
    assert known.turns


def test_a_campaign_at_one_speed_says_nothing_of_others():
    known = CoupledPosterior(unknowns(), np.eye(LAYOUT.size), (1500.0, 0.0))
    one, other = (known.candidate(known.best, speed).flange for speed in (None, 3000.0))
    np.testing.assert_array_equal(one.omega_n, other.omega_n)


def test_standing_modes_are_the_machine_that_does_not_turn():
    best = unknowns()
    expected = dense_receptance(unpack(best.theta, LAYOUT.block), OMEGA)[:, :4]
    found = best.standing().receptance(OMEGA).values * np.outer(SCALE, SCALE)
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


def test_another_process_works_it_out_for_itself(tips):
    part = posterior((unknowns(CoupledLayout(3), 2),)).part(2000.0)
    part.response(tips(2000.0))
    text = pickle.dumps(part)
    # no perturbed machine travels
    assert len(text) < 6 * 8 * LAYOUT.size**2
    for one, other in zip(part.response(tips(2000.0)), pickle.loads(text).response(tips(2000.0)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_what_does_not_belong_together_is_refused():
    best = unknowns()
    with pytest.raises(InputError, match=f"unknowns.*{best.theta.size - 1}.*{best.theta.size} for 4 modes and a joint"):
        CoupledUnknowns(best.theta[1:], LAYOUT)
    with pytest.raises(InputError, match=f"covariance.*{best.theta.size} unknowns"):
        CoupledPosterior(best, np.eye(best.theta.size - JOINT), SPEEDS)
