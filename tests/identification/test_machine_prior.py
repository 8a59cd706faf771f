"""What earlier cuts have told as the prior of further ones: closed forms of the normal distribution."""

from types import SimpleNamespace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.assemble_result import WIDER
from rcsa_ident.identification.machine_prior import Gaussian, KnownMachine
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.tooling_update import FurtherFit
from rcsa_ident.identification.unknowns import JOINT, Layout, ModalBlock
from rcsa_ident.tool_holder.alteration import ALTERATIONS
from rcsa_ident.tool_holder.drawings import KnownToolings, RoughUnknown

ONE_MODE = ModalBlock(1)
CORE = ONE_MODE.size
#: Of X, Y, joint and two numbers of toolings.
SIZE = 2 * CORE + JOINT + 2
SEEN, UNSEEN = RoughUnknown("fluted_diameter", "EM12", "tool"), RoughUnknown("youngs_modulus", "EM16", "tool")


@pytest.fixture(scope="module")
def whole():
    """A covariance in which X and Y have in common what they have in common with joint and toolings, and no more."""
    rng = np.random.default_rng(1)
    shared = rng.standard_normal((JOINT + 2, JOINT + 2))
    shared = shared @ shared.T / JOINT + 0.1 * np.eye(JOINT + 2)
    links = 0.3 * rng.standard_normal((2 * CORE, JOINT + 2))
    own = np.zeros((2 * CORE, 2 * CORE))
    for axis in (slice(0, CORE), slice(CORE, 2 * CORE)):
        part = rng.standard_normal((CORE, CORE))
        own[axis, axis] = part @ part.T / CORE + 0.1 * np.eye(CORE)
    return np.block([[links @ shared @ links.T + own, links @ shared], [shared @ links.T, shared]])


@pytest.fixture(scope="module")
def machine(whole):
    toolings = slice(SIZE - 2, SIZE)
    posteriors = {}
    for axis, first in ((Dof.X, 0), (Dof.Y, CORE)):
        here = np.r_[first : first + CORE, 2 * CORE : 2 * CORE + JOINT]
        theta = np.linspace(0.0, 1.0, CORE + JOINT)
        theta[-JOINT:] = [21.0, 15.0, 7.0, 2.0]
        posteriors[axis] = Posterior(
            theta, whole[np.ix_(here, here)], ONE_MODE, (1000.0, 400.0), (), whole[here, toolings], whole[toolings, toolings]
        )
    known = KnownToolings((SEEN, UNSEEN), np.array([0.03, 0.02]), np.array([0.5, -1.0]), whole[toolings, toolings], ("T1",))
    return KnownMachine(posteriors, known)


@pytest.fixture(scope="module")
def data():
    """Further cuts of a tool whose file believes its diameter to 2 %, where the earlier ones' believed 3 %, and of an unknown gain."""
    axes = tuple(SimpleNamespace(axis=axis, still=np.zeros(0, dtype=bool)) for axis in (Dof.X, Dof.Y))
    weights = np.zeros((1, len(ALTERATIONS), 2))
    weights[0, ALTERATIONS.index("stickout"), 0] = weights[0, ALTERATIONS.index("fluted_diameter"), 1] = 1.0
    rough = SimpleNamespace(unknowns=(RoughUnknown("stickout", "new", "tooling"), SEEN), spread=np.array([5e-5, 0.02]), weights=weights)
    return SimpleNamespace(axes=axes, rough=rough, rough_place=slice(1, 3), coefficient_spread=(0.05, 1.0, 1.0))


def test_residuals_of_a_normal_distribution(whole):
    known = Gaussian(np.arange(SIZE, dtype=float), whole)
    theta = known.centre + np.random.default_rng(2).standard_normal(SIZE)
    away = theta - known.centre
    assert np.sum(known.residual(theta) ** 2) == pytest.approx(away @ np.linalg.inv(whole) @ away, rel=1e-9)
    assert known.log_volume == pytest.approx(-np.linalg.slogdet(whole)[1], rel=1e-12)
    step = 1e-3 * np.random.default_rng(3).standard_normal(SIZE)
    np.testing.assert_allclose(known.residual(theta + step) - known.residual(theta), known.jacobian @ step, rtol=1e-6, atol=1e-12)


def test_both_axes_are_put_together_by_what_they_share(machine, whole, data):
    np.testing.assert_allclose(machine.joint_covariance(data), whole, rtol=1e-9, atol=1e-12)


def test_what_is_known_is_told_in_the_units_of_further_cuts(machine, whole, data):
    found = machine.prior(data, 0.05)
    size = SIZE - 2
    assert found.centre.size == size + 3
    # the new tool's stickout and the gain are known by themselves, its model's diameter by the earlier cuts
    np.testing.assert_allclose(np.diag(found.covariance)[size : size + 2], [0.05**2, 1.0])
    assert found.centre[size + 2] == pytest.approx(0.5 * 0.03 / 0.02)
    assert found.covariance[size + 2, size + 2] == pytest.approx(whole[-2, -2] * 1.5**2)
    np.testing.assert_allclose(found.covariance[:size, size + 2], 1.5 * whole[:size, -2])
    # another clamping: the joint's stiffnesses are known less well, its damping as well
    added = np.diag(found.covariance)[2 * CORE : size] - np.diag(whole)[2 * CORE : size]
    np.testing.assert_allclose(added, [0.05**2, 0.05**2, 0.0, 0.0], atol=1e-12)


def test_speeds_beyond_the_earlier_ones_are_their_ends(machine):
    np.testing.assert_allclose(machine.relative(np.array([500.0, 600.0, 1000.0, 1200.0, 2000.0])), [-1.0, -1.0, 0.0, 0.5, 1.0])


def test_an_axis_that_is_not_known_is_refused(machine, data):
    with pytest.raises(InputError, match="cuts that show Y, allowed is what the machine is known along: X"):
        KnownMachine({Dof.X: machine.posteriors[Dof.X]}).layout(data)


def test_a_machine_is_taught_as_if_all_unknowns_had_been_fitted(machine, whole, data):
    """Earlier toolings that further cuts do not ask for follow, as in a fit that holds them."""
    known, size = machine.prior(data, 0.0), SIZE - 2
    rng = np.random.default_rng(4)
    lines, step = rng.standard_normal((30, size + 3)), rng.standard_normal(size + 3)
    information = lines.T @ lines
    prior = known.jacobian.T @ known.jacobian
    theta = known.centre + np.linalg.solve(prior + information / WIDER**2, information @ step)
    layout = Layout((ONE_MODE, ONE_MODE), 3)
    solution = SimpleNamespace(theta=theta, layout=layout, evaluation=SimpleNamespace(hessian=prior + information))
    taught = FurtherFit(data, known, solution, None).machine(machine, ["new"])
    # the same with everything at once: machine, joint, both numbers of toolings, gain and stickout
    everything = np.zeros((SIZE + 2, SIZE + 2))
    everything[:SIZE, :SIZE] = whole
    everything[SIZE:, SIZE:] = np.diag([0.05**2, 1.0])
    seen = np.zeros((size + 3, SIZE + 2))
    seen[range(size), range(size)] = 1.0
    seen[size, SIZE], seen[size + 1, SIZE + 1], seen[size + 2, SIZE - 2] = 1.0, 1.0, 1.5
    covariance = np.linalg.inv(np.linalg.inv(everything) + seen.T @ information @ seen / WIDER**2)
    moved = covariance @ seen.T @ information @ step
    # of the new tooling itself: stickout and diameter, in units of what they were known to before
    both = np.zeros((SIZE + 2, 2))
    both[SIZE + 1, 0], both[SIZE - 2, 1] = 1.0, 1.0 / np.sqrt(whole[-2, -2])
    told = np.hstack([np.eye(SIZE + 2)[:, size:SIZE], both])
    expected = told.T @ covariance @ told
    np.testing.assert_allclose(taught.toolings.covariance, expected, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(taught.joint_covariance(data)[size:, size:], expected, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(taught.toolings.mean, np.concatenate([machine.toolings.mean + moved[size:SIZE], [0.0, 0.0]]), rtol=1e-7)
    assert taught.toolings.unknowns[2:] == (RoughUnknown("stickout", "new", "tooling"), RoughUnknown("fluted_diameter", "new", "tooling"))
    np.testing.assert_allclose(taught.toolings.spread[2:], [5e-5, 0.03 * np.sqrt(whole[-2, -2])])
    for axis, first in ((Dof.X, 0), (Dof.Y, CORE)):
        here = np.r_[first : first + CORE, 2 * CORE : size]
        own = taught.posteriors[axis]
        np.testing.assert_allclose(own.theta, machine.posteriors[axis].theta + moved[here], rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(own.covariance, covariance[np.ix_(here, here)], rtol=1e-6, atol=1e-9)
        cross = np.hstack([covariance[here, size:SIZE], covariance[here] @ both])
        np.testing.assert_allclose(own.tooling_cross, cross, rtol=1e-6, atol=1e-9)
    # taught again, what is known of it is what was learned the second time, once
    again = FurtherFit(data, known, solution, None).machine(taught, ["new"])
    assert again.toolings.unknowns == taught.toolings.unknowns
