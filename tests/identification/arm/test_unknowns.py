"""A robot's vector and the physics that it stands for."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.arm.posterior import RobotPosterior, RobotUnknowns
from rcsa_ident.identification.arm.spindle_starts import drawn, spindle_of
from rcsa_ident.identification.arm.unknowns import PosedLayout, arm_priors, chain, pack, share_of, stiffening, unknown_of, unpack
from rcsa_ident.identification.unknowns import prior_rows
from tests.fixtures.robots import robot

LAYOUT = PosedLayout(tuple(robot("tx200").chain().stiffness.tolist()), 7, 3, 2, 1)


def vector(seed=0, layout=LAYOUT):
    rng = np.random.default_rng(seed)
    return prior_rows(layout, arm_priors(robot("tx200")), (0.05,) * layout.coefficients).centre + 0.3 * rng.standard_normal(layout.size)


def test_unpacked_and_packed_again():
    theta = vector()
    np.testing.assert_allclose(pack(unpack(theta, LAYOUT), LAYOUT), theta[: LAYOUT.tail], atol=1e-12)


def test_compliances_stay_above_nothing_and_add_up_where_they_are_large():
    unknown = np.linspace(-3.0, 4.0, 50)
    share = share_of(unknown)
    assert np.all(share > 0.0)
    np.testing.assert_allclose(unknown_of(share), unknown, atol=1e-9)
    np.testing.assert_allclose(share[unknown > 2.0], unknown[unknown > 2.0], rtol=1e-3)
    # what is believed is the data sheet's own
    at_sheet = unpack(prior_rows(LAYOUT, arm_priors(robot("tx200")), (0.05, 0.05)).centre, LAYOUT)
    np.testing.assert_allclose(at_sheet.stiffness, LAYOUT.springs, rtol=1e-12)


def test_slopes_of_physics():
    theta, step = vector(1), 1e-6
    slopes, logs = chain(unpack(theta, LAYOUT), theta, LAYOUT), stiffening(theta, LAYOUT)
    first, parts = LAYOUT.arm.size, LAYOUT.spindle.parts
    for k in (*range(0, first + LAYOUT.modes, 5), first + parts["damping"].start, first + parts["residual"].start + 2):
        moved = theta.copy()
        moved[k] += step
        here, there = (unpack(each, LAYOUT) for each in (theta, moved))
        change = [
            (there.stiffness - here.stiffness), (there.damping - here.damping), (there.heavier - here.heavier),
            np.log(there.spindle.omega_n / here.spindle.omega_n), (there.spindle.factor - here.spindle.factor)[np.tril_indices(3)],
            (there.spindle.residual - here.spindle.residual)[np.tril_indices(4)],
        ]  # fmt: skip
        largest = max((c[np.argmax(np.abs(c))] for c in change), key=abs) / step
        assert largest == pytest.approx(slopes[k], rel=1e-4)
        if k < LAYOUT.arm.freedoms:
            assert np.log(there.stiffness[k] / here.stiffness[k]) / step == pytest.approx(logs[k], rel=1e-4)


def test_drawn_spindles_swing_no_more_than_they_weigh():
    """All modes together pull what a rigid shaft weighs; those up to 6 kHz less, and most of it."""
    for numbers in drawn(20, np.random.default_rng(2)):
        spindle, joint = spindle_of(numbers)
        assert np.all(np.diff(np.sort(spindle.omega_n)) >= 0.0)
        length, front, rear = numbers[:3]
        weight = 7850.0 * 0.25 * np.pi * (1.0 - 0.35**2) * length * (0.25 * front**2 + 0.75 * rear**2)
        for direction in (0, 2):
            pulled = np.sum(spindle.pull[:, direction] ** 2)
            # the step between both diameters lies between two elements
            assert 0.5 * weight < pulled < 1.1 * weight
        assert joint.shape == (2,)


def test_a_vector_of_another_size_is_refused():
    with pytest.raises(InputError, match="unknowns"):
        RobotUnknowns(vector()[:-1], LAYOUT)


def test_draws_scatter_as_the_covariance_has_it():
    model = robot("kr210")
    springs = tuple(model.chain().stiffness.tolist())
    layout = PosedLayout(springs, len(model.joints))
    centre = prior_rows(layout, arm_priors(model)).centre
    sizes = np.zeros(layout.size)
    sizes[layout.arm.parts["compliances"]], sizes[layout.arm.parts["masses"]] = 0.05, 0.02
    posterior = RobotPosterior(model, True, RobotUnknowns(centre, layout), np.diag(sizes**2), np.ones(layout.size))
    arms = posterior.draws(400, np.random.default_rng(3))
    compliance = np.array([springs / each.model.chain().stiffness for each in arms])
    # an unknown of one is a compliance of about one, which it moves by nearly as much
    np.testing.assert_allclose(compliance.mean(axis=0), 1.0, atol=0.01)
    np.testing.assert_allclose(compliance.std(axis=0), 0.05, rtol=0.15)
    masses = np.log([each.model.joints[2].body.mass / model.joints[2].body.mass for each in arms])
    assert masses.std() == pytest.approx(0.02, rel=0.15)
    again = posterior.draws(2, np.random.default_rng(3))
    np.testing.assert_array_equal(again[1].model.chain().stiffness, arms[1].model.chain().stiffness)
