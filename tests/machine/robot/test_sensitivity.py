"""Slopes of what a robot does, beside differences of what it does."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.machine.robot.compliance import static_compliance
from rcsa_ident.machine.robot.flexible import FlexibleRobot, modes_of
from rcsa_ident.machine.robot.inertia import mass_matrix, torques
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.robot.model import Frame
from rcsa_ident.machine.robot.sensitivity import (
    compliance_slopes,
    frequency_slopes,
    inertial_parameters,
    mass_slopes,
    receptance_slopes,
    regressor,
)
from tests.fixtures.robots import TABLE_7, robot

OMEGA = 2.0 * np.pi * np.array([3.0, 13.5, 22.0, 90.0, 400.0])


def changed(arm, i, factor, what="stiffness", tilts=True):
    """The arm with the spring or damper of one freedom of the chain changed."""
    joints, place = [], 0
    for joint in arm.joints:
        own = [joint, *(joint.tilts if tilts else ())]
        for k, each in enumerate(own):
            if place + k == i:
                own[k] = replace(each, **{what: factor * getattr(each, what)})
        place += len(own)
        joints.append(replace(own[0], tilts=tuple(own[1:])) if tilts else own[0])
    return replace(arm, joints=tuple(joints))


def heavier(arm, b, factor):
    """The arm with one body's mass and inertia changed; the payload comes behind the links."""

    def grown(body):
        return replace(body, mass=factor * body.mass, inertia=factor * body.inertia)

    if b == len(arm.joints):
        return replace(arm, payload=grown(arm.payload))
    joints = [replace(j, body=grown(j.body)) if k == b else j for k, j in enumerate(arm.joints)]
    return replace(arm, joints=tuple(joints))


def difference(of, value, step=1e-4):
    """Slope by differences of the fourth order, over a share of the parameter on both sides."""
    one, two = (of(1.0 + s) - of(1.0 - s) for s in (step, 2.0 * step))
    return (8.0 * one - two) / (12.0 * step * value)


@pytest.mark.parametrize("tilts", [False, True])
def test_static_compliance(tilts):
    arm = robot("tx200")
    slopes = compliance_slopes(arm, TABLE_7, tilts)
    stiffness = arm.chain(tilts).stiffness
    for i, k in enumerate(stiffness):
        by_hand = difference(lambda f, i=i: static_compliance(changed(arm, i, f, tilts=tilts), TABLE_7, tilts), k)
        np.testing.assert_allclose(slopes[i], by_hand, atol=1e-8 * np.abs(by_hand).max())
    # C is of degree -1 in all stiffnesses together
    np.testing.assert_allclose(np.tensordot(stiffness, slopes, 1), -static_compliance(arm, TABLE_7, tilts), rtol=1e-12, atol=1e-20)


@pytest.mark.parametrize("tilts", [False, True])
def test_receptance(tilts):
    arm = robot("tx200")
    slopes = receptance_slopes(FlexibleRobot(arm, tilts), TABLE_7, OMEGA, turn=0.3)

    def values(other):
        return FlexibleRobot(other, tilts).at(TABLE_7, 0.3).receptance(OMEGA).values

    chain = arm.chain(tilts)
    for what, found, size in (("stiffness", slopes.stiffness, chain.stiffness), ("damping", slopes.damping, chain.damping)):
        assert found.shape == (size.size, OMEGA.size, 6, 6)
        for i, value in enumerate(size):
            by_hand = difference(lambda f, i=i, what=what: values(changed(arm, i, f, what, tilts)), value)
            np.testing.assert_allclose(found[i], by_hand, atol=1e-6 * np.abs(by_hand).max())
    masses = [*(j.body.mass for j in arm.joints), arm.payload.mass]
    assert len(slopes.mass) == len(masses)
    for b, mass in enumerate(masses):
        by_hand = difference(lambda f, b=b: values(heavier(arm, b, f)), mass)
        np.testing.assert_allclose(slopes.mass[b], by_hand, atol=1e-6 * np.abs(by_hand).max())


def test_mass_matrix_is_the_sum_of_its_slopes():
    arm = robot("kr210")
    masses = np.array([j.body.mass for j in arm.joints])
    whole = mass_matrix(posed(arm, TABLE_7, tilts=True))
    np.testing.assert_allclose(np.tensordot(masses, mass_slopes(arm, TABLE_7), 1), whole, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("tilts", [False, True])
def test_natural_frequencies(tilts):
    arm = robot("tx200")
    stiffer, more = frequency_slopes(FlexibleRobot(arm, tilts), TABLE_7)

    def omega(other):
        return modes_of(FlexibleRobot(other, tilts).at(TABLE_7))[0]

    # an eigenvalue is as exact as the largest one allows, 1.6e4 rad/s: larger steps than a resonance would bear
    for i, k in enumerate(arm.chain(tilts).stiffness):
        by_hand = difference(lambda f, i=i: omega(changed(arm, i, f, tilts=tilts)), k, 1e-3)
        np.testing.assert_allclose(k * stiffer[:, i], k * by_hand, atol=2e-5)
    masses = [*(j.body.mass for j in arm.joints), arm.payload.mass]
    for b, mass in enumerate(masses):
        by_hand = difference(lambda f, b=b: omega(heavier(arm, b, f)), mass, 1e-3)
        np.testing.assert_allclose(mass * more[:, b], mass * by_hand, atol=2e-5)
    # all springs stiffer by a share: frequencies higher by half of it, and lower by half of it with all masses
    np.testing.assert_allclose(stiffer @ arm.chain(tilts).stiffness, 0.5 * omega(arm), rtol=1e-9)
    np.testing.assert_allclose(more @ masses, -0.5 * omega(arm), rtol=1e-9)


@pytest.mark.parametrize("tilts", [False, True])
@pytest.mark.parametrize("name", ["tx200", "kr210"])
def test_torques_are_linear_in_what_the_bodies_weigh(name, tilts):
    arm, rng = robot(name), np.random.default_rng(5)
    n = arm.freedoms(tilts)
    bodies = [j.body for j in arm.joints]
    if arm.payload is not None:
        bodies[-1] = bodies[-1].beside(arm.payload.seen_from(arm.flange))
    weights = inertial_parameters(tuple(bodies))
    for _ in range(20):
        chain = posed(arm, rng.uniform(-3.0, 3.0, n), tilts)
        rate, acceleration = rng.normal(0.0, 1.0, n), rng.normal(0.0, 3.0, n)
        asked = torques(chain, rate, acceleration, arm.gravity)
        matrix = regressor(chain, rate, acceleration, arm.gravity)
        assert matrix.shape == (n, 10 * len(arm.joints))
        np.testing.assert_allclose(matrix @ weights, asked, rtol=1e-12, atol=1e-12 * np.abs(asked).max())


def test_the_regressor_is_the_slope_of_the_torques():
    """Mass and first moment of a link by differences; its frame's origin stays where it is."""
    arm, rng = robot("tx200"), np.random.default_rng(6)
    rate, acceleration = rng.normal(0.0, 1.0, 6), rng.normal(0.0, 3.0, 6)
    matrix = regressor(posed(arm, TABLE_7), rate, acceleration, arm.gravity)

    def asked(joints):
        return torques(posed(replace(arm, joints=tuple(joints)), TABLE_7), rate, acceleration, arm.gravity)

    own = arm.joints[2].body
    for axis in range(3):
        # two bodies of opposite mass on both sides of the origin are a first moment and nothing else
        arm_of = 0.2 * np.eye(3)[axis]
        far, near = (replace(own, mass=1.0, centre=sign * arm_of, inertia=np.zeros((3, 3))) for sign in (1.0, -1.0))
        both = [asked([*arm.joints[:2], replace(arm.joints[2], body=own.beside(each)), *arm.joints[3:]]) for each in (far, near)]
        np.testing.assert_allclose((both[0] - both[1]) / 0.4, matrix[:, 21 + axis], rtol=1e-9, atol=1e-9)
    point = replace(own, mass=1.0, centre=np.zeros(3), inertia=np.zeros((3, 3)))
    more = asked([*arm.joints[:2], replace(arm.joints[2], body=own.beside(point)), *arm.joints[3:]]) - asked(arm.joints)
    np.testing.assert_allclose(more, matrix[:, 20], rtol=1e-9, atol=1e-9)


def test_a_body_without_mass_is_a_point_when_it_gets_one():
    arm = replace(robot("tx200"), payload=None)
    bare = replace(arm, joints=(*arm.joints[:5], replace(arm.joints[5], body=replace(arm.joints[5].body, mass=0.0))))
    chain = posed(bare, TABLE_7)
    motion = chain.jacobian(Frame(chain.rotation[-1], chain.origin[-1]).point(bare.joints[5].body.centre))[:3]
    np.testing.assert_allclose(mass_slopes(bare, TABLE_7, tilts=False)[-1], motion.T @ motion, rtol=1e-12, atol=1e-12)
