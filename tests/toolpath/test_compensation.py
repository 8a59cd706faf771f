"""What is commanded so that a machine that gives way ends where it should: a spring by hand, and published arms."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.machine.robot.compliance import at_rest, spring_torques, spring_twist, static_compliance
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.kinematics import tool_point_at
from rcsa_ident.toolpath.compensation import ahead_of_force, mirrored
from rcsa_ident.workflows.paths.robot_compensation import ahead_of_forces, mirrored_postures, reached
from tests.fixtures import pushed_arm
from tests.fixtures.robots import robot

POSTURE = np.radians([[0.0, 20.0, 30.0, 10.0, -40.0, 0.0]])
#: Of a slot in aluminium, and across [N].
FORCES = {"slot": np.array([[-58.0, -130.0, 35.0, 0.0, 0.0, 0.0]]), "across": np.array([[0.0, 100.0, 0.0, 0.0, 0.0, 0.0]])}


def arm(play):
    """The KR210, with or without its play."""
    model = robot("kr210")
    return FlexibleRobot(model if play else replace(model, joints=tuple(replace(j, backlash=0.0) for j in model.joints)))


def off(flexible, commanded, force):
    """How far the tool is from where it should be, shape (3,) [m]."""
    return reached(flexible, commanded, force)[0] - tool_point_at(flexible.model, POSTURE[0]).offset


def test_deviation_of_the_kr210_and_what_compensation_leaves_of_it():
    """Without weight; the figures were computed by others."""
    flexible = arm(play=False)
    np.testing.assert_allclose(1e3 * off(flexible, POSTURE, FORCES["slot"]), [-0.025, -0.387, 0.009], atol=6e-4)
    assert np.linalg.norm(off(flexible, POSTURE, FORCES["across"])) == pytest.approx(0.298e-3, abs=6e-7)
    for force in FORCES.values():
        assert np.max(np.abs(off(flexible, ahead_of_forces(flexible, POSTURE, force), force))) < 0.011e-6
        assert np.max(np.abs(off(flexible, mirrored_postures(flexible, POSTURE, force), force))) < 0.05e-6
        assert np.linalg.norm(off(flexible, mirrored_postures(flexible, POSTURE, force, passes=2), force)) < 1e-10


@pytest.mark.parametrize("force", FORCES.values(), ids=FORCES)
def test_play_is_taken_out_too(force):
    flexible, tight = arm(play=True), arm(play=False)
    # the play adds to what the springs give way
    assert np.linalg.norm(off(flexible, POSTURE, force)) > 1.2 * np.linalg.norm(off(tight, POSTURE, force))
    assert np.linalg.norm(off(flexible, ahead_of_forces(flexible, POSTURE, force), force)) < 0.015e-6
    assert np.linalg.norm(off(flexible, mirrored_postures(flexible, POSTURE, force), force)) < 0.12e-6
    # one that knows of no play leaves it
    left = off(flexible, ahead_of_forces(tight, POSTURE, force), force)
    assert np.linalg.norm(left) > 0.2 * np.linalg.norm(off(tight, POSTURE, force))


def test_springs_alone_are_commanded_where_nothing_tilts():
    """Drives alone: the posture itself is turned by tau/k, no place in between."""
    flexible, force = FlexibleRobot(arm(play=True).model, tilts=False), FORCES["slot"]
    commanded = ahead_of_forces(flexible, POSTURE, force)[0]
    torque = -pushed_torque(flexible.model, force[0])
    np.testing.assert_allclose(commanded - POSTURE[0], spring_twist(flexible.model, torque, tilts=False), atol=1e-9)


def pushed_torque(model, force):
    """What a force at the tool asks of the drives, by virtual work on differences of places."""
    step = 1e-6
    ends = [[tool_point_at(model, POSTURE[0] + sign * step * row).offset for sign in (1.0, -1.0)] for row in np.eye(6)]
    return np.array([(ahead - behind) @ force[:3] / (2.0 * step) for ahead, behind in ends])


def test_rest_is_that_of_virtual_work():
    """Beside an arm at rest by energy and finite turns, without weight."""
    model = arm(play=True).model
    light = replace(model, gravity=np.zeros(3))
    held = light.chain().angles(POSTURE[0])
    force = 10.0 * FORCES["slot"][0]
    expected, _ = pushed_arm.rest(light, held, force[:3], np.zeros(held.size))
    np.testing.assert_allclose(at_rest(light, POSTURE[0], force), expected, atol=1e-9)


def test_twist_and_torque_are_each_others_inverse():
    model = robot("kr210")
    torque = np.random.default_rng(2).normal(0.0, 500.0, model.freedoms())
    torque[[0, 3]] = 0.0
    turned = spring_twist(model, torque)
    np.testing.assert_allclose(spring_torques(model, turned, np.zeros(torque.size)), -torque, rtol=1e-12, atol=1e-9)
    assert turned[0] == turned[3] == 0.0
    # a force in the plane of the first axis asks nothing of it but rounding
    inward = np.append(tool_point_at(model, np.zeros(6)).offset * [100.0, 100.0, 0.0], np.zeros(3))
    assert at_rest(model, np.zeros(6), inward)[0] == pytest.approx(0.0, abs=1e-10)


def test_a_force_that_nothing_holds_is_named():
    soft = replace(robot("tx200"), joints=tuple(replace(j, stiffness=10.0, tilts=()) for j in robot("tx200").joints))
    with pytest.raises(InputError, match="one that the springs hold"):
        at_rest(soft, np.radians([0.0, 30.0, 60.0, 0.0, 30.0, 0.0]), np.array([0.0, 500.0, 0.0, 0.0, 0.0, 0.0]))


def test_small_forces_move_by_the_compliance():
    flexible, force = arm(play=False), 1e-2 * FORCES["slot"]
    plain = static_compliance(flexible.model, POSTURE[0])[:3] @ force[0]
    np.testing.assert_allclose(off(flexible, POSTURE, force), plain, rtol=1e-4, atol=1e-10)


def test_a_spring_by_hand():
    """A coordinate that gives way by its force over 1000 N/m, and by its square."""
    forces = np.array([[5.0], [-3.0], [0.0]])
    np.testing.assert_allclose(ahead_of_force(np.zeros((3, 1)), -forces, lambda t: t / 1e3, lambda q: q[0]), [-5e-3, 3e-3, 0.0])
    wanted = np.array([[0.1, 0.2, 0.3], [1.0, 0.0, 0.0]])

    def given_way(sent):
        return sent + 1e-2 * sent**2

    one, many = (np.abs(given_way(mirrored(wanted, given_way, passes)) - wanted).max() for passes in (1, 6))
    assert 1e-5 < one < 3e-4
    assert many < 1e-12
    with pytest.raises(InputError, match="passes"):
        mirrored(wanted, given_way, 0)
    with pytest.raises(InputError, match="torques"):
        ahead_of_force(np.zeros((3, 1)), np.zeros((2, 1)), lambda t: t, lambda q: q)
