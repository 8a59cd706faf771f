"""Postures to command so that an arm that gives way under forces on its tool ends where it should, at rest."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.machine.robot.compliance import at_rest, spring_twist
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.kinematics import posed, postures_of, tool_point_at
from rcsa_ident.machine.robot.model import Frame
from rcsa_ident.toolpath.compensation import ahead_of_force, mirrored


def reached(robot: FlexibleRobot, postures: FloatArray, forces: FloatArray) -> FloatArray:
    """Return where the tool point is under forces when the drives hold some postures, shape (k, 3) [m].

    `postures` [rad], shape (k, j)
    `forces` [N, N m], shape (k, 6): at the tool point in the base's axes: forces, then moments
    """
    model, tilts = robot.model, robot.tilts
    rests = (at_rest(model, q, force, tilts) for q, force in zip(postures, forces, strict=True))
    return np.array([posed(model, each, tilts).flange.then(model.tool_point).offset for each in rests])


def ahead_of_forces(robot: FlexibleRobot, postures: FloatArray, forces: FloatArray) -> FloatArray:
    """Return postures to command, shape (k, j) [rad], so that the tool is under forces where the given ones have it without.

    By the springs' answer to the ideal motion's torques (`toolpath.compensation.ahead_of_force`); what tilts is commanded through the
    place that it leads to, which the drives alone reach then.

    Raises `InputError` if no posture of the drives reaches such a place.
    """
    model, tilts = robot.model, robot.tilts
    full = np.array([model.chain(tilts).angles(model.posture(q)) for q in postures])
    tools = [posed(model, q, tilts) for q in full]
    motions = [chain.jacobian(chain.flange.point(model.tool_point.offset)) for chain in tools]
    torques = np.array([-motion.T @ force for motion, force in zip(motions, forces, strict=True)])
    flanges = ahead_of_force(full, torques, lambda torque: spring_twist(model, torque, tilts), lambda q: posed(model, q, tilts).flange)
    return np.array([_near(robot, flange, q) for flange, q in zip(flanges, postures, strict=True)])


def mirrored_postures(robot: FlexibleRobot, postures: FloatArray, forces: FloatArray, passes: int = 1) -> FloatArray:
    """Return postures to command, shape (k, j) [rad], by mirroring the tool's deviation (`toolpath.compensation.mirrored`).

    The tool keeps the direction that it has at the given postures.
    """
    model = robot.model
    tools = [tool_point_at(model, q) for q in postures]

    def sent(places: FloatArray) -> FloatArray:
        flanges = [Frame(tool.turn, place).then(model.tool_point.inverse) for tool, place in zip(tools, places, strict=True)]
        return np.array([_near(robot, flange, q) for flange, q in zip(flanges, postures, strict=True)])

    wanted = np.array([tool.offset for tool in tools])
    return sent(mirrored(wanted, lambda places: reached(robot, sent(places), forces), passes))


def _near(robot: FlexibleRobot, flange: Frame, posture: FloatArray) -> FloatArray:
    """The posture of the drives that brings the flange to a place, of several the nearest to another one."""
    ways = postures_of(robot.model, flange, within_limits=False, near=posture)
    if not len(ways):
        told = ", ".join(f"{1e3 * v:.1f}" for v in flange.offset)
        raise InputError("place of the flange", f"{told} mm", "one that the robot reaches")
    ways = ways + 2.0 * np.pi * np.round((posture - ways) / (2.0 * np.pi))
    return np.asarray(ways[np.argmin(np.max(np.abs(ways - posture), axis=1))])
