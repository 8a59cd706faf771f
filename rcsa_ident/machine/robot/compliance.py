"""How far a robot gives way under a force that stands still, and what its joints' springs answer."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.machine.robot.inertia import gravity_torques
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.robot.model import RobotModel

#: Torque that holds a drive's play on its side [N m]: friction leaves it anywhere below.
PLAY_HELD = 10.0
#: Steps to rest, and how far the last one may turn [rad].
_STEPS, _RESTING = 50, 1e-13


def static_compliance(robot: RobotModel, angles: FloatArray, tilts: bool = True) -> FloatArray:
    """Return J K^-1 J^T at the tool's place, in the base's axes, shape (6, 6) [m/N, rad/N, m/(N m), rad/(N m)].

    `angles` [rad], shape (j,): of the joints
    `tilts`: with the springs across the joints' axes
    """
    chain = posed(robot, angles, tilts)
    motion = chain.jacobian(chain.flange.point(robot.tool_point.offset))
    return (motion / chain.chain.stiffness) @ motion.T


def sag(robot: RobotModel, angles: FloatArray, tilts: bool = True, payload: bool = True) -> FloatArray:
    """Return how far the tool's place sinks under the arm's weight, translations and rotations in the base's axes, shape (6,) [m, rad].

    To first order in the angles, with what the control takes out left out; springs across the axes are never taken out.
    """
    chain = posed(robot, angles, tilts, payload)
    bent = -gravity_torques(robot, _all(robot, angles, tilts), tilts, payload) / chain.chain.stiffness
    bent[chain.chain.driven[[j.gravity_compensated for j in robot.joints]]] = 0.0
    return chain.jacobian(chain.flange.point(robot.tool_point.offset)) @ bent


def free_play(robot: RobotModel, angles: FloatArray) -> FloatArray:
    """Return how far the tool's place may stand from the middle where all plays lie on the worst side, shape (6,) [m, rad].

    Translations and rotations along the base's axes, |J| s: what no force on the tool is asked for.
    """
    chain = posed(robot, angles)
    return np.abs(chain.jacobian(chain.flange.point(robot.tool_point.offset))) @ np.array([joint.backlash for joint in robot.joints])


def twist_per_payload(robot: RobotModel, angles: FloatArray) -> FloatArray:
    """Return how far each drive's spring gives way for every kilogram that the payload weighs more, shape (j,) [rad/kg].

    At the payload's centre, J^T g / k, in the sense of `sag`: how well a posture tells the payload's mass from the joints' encoders.

    Raises `InputError` if the robot carries none.
    """
    if robot.payload is None:
        raise InputError("payload", "none", "a robot that carries one")
    chain = posed(robot, angles)
    return (robot.gravity @ chain.jacobian(chain.flange.point(robot.payload.centre))[:3]) / chain.chain.stiffness


def spring_torques(robot: RobotModel, twist: FloatArray, rate: FloatArray, tilts: bool = True) -> FloatArray:
    """Return the torques of all springs and dampers on the links, shape (n,) [N m].

    `twist` [rad], shape (n,): how far each freedom stands from where its drive holds it; within the play on both sides a drive's spring
        feels nothing
    `rate` [rad/s], shape (n,)
    """
    chain = robot.chain(tilts)
    play = np.zeros(chain.mass.size)
    play[chain.driven] = [j.backlash for j in robot.joints]
    felt = np.sign(twist) * np.maximum(np.abs(twist) - play, 0.0)
    return frozen(-chain.stiffness * felt - chain.damping * np.asarray(rate, dtype=float))


def spring_twist(robot: RobotModel, torque: FloatArray, tilts: bool = True) -> FloatArray:
    """Return how far springs are turned that give torques, shape (n,) [rad]: tau/k, and a drive's play to the torque's side.

    The other way around of `spring_torques` at rest, which holds -torque then; below `PLAY_HELD` a drive's play lies in the middle.

    `torque` [N m], shape (n,)
    """
    chain = robot.chain(tilts)
    given = np.asarray(torque, dtype=float)
    turned, driving = given / chain.stiffness, given[chain.driven]
    turned[chain.driven] += np.array([j.backlash for j in robot.joints]) * np.sign(driving) * (np.abs(driving) > PLAY_HELD)
    return turned


def at_rest(robot: RobotModel, angles: FloatArray, force: FloatArray, tilts: bool = True) -> FloatArray:
    """Return all angles at which the springs hold a force at the tool's place, shape (n,) [rad], the arm's weight left aside.

    `angles` [rad], shape (j,): that the drives hold
    `force` [N, N m], shape (6,): in the base's axes, wherever the tool gives way to
    Raises `InputError` if nothing holds it: a force that turns the arm further than its springs turn it back.
    """
    held = _all(robot, angles, tilts)
    there = held
    for _ in range(_STEPS):
        chain = posed(robot, there, tilts)
        before, there = there, held + spring_twist(robot, chain.jacobian(chain.flange.point(robot.tool_point.offset)).T @ force, tilts)
        if np.max(np.abs(there - before)) < _RESTING:
            return there
    raise InputError("force", np.asarray(force).tolist(), "one that the springs hold [N, N m]")


def _all(robot: RobotModel, angles: FloatArray, tilts: bool) -> FloatArray:
    return robot.chain(tilts).angles(robot.posture(angles))
