"""What a robot does at a posture, and along a path: description, postures that follow a tool's tip, and limits at each place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.machine.robot.compliance import free_play, sag, static_compliance
from rcsa_ident.machine.robot.flexible import FlexibleRobot, modes_of
from rcsa_ident.machine.robot.inertia import gravity_torques
from rcsa_ident.machine.robot.kinematics import flange_at, postures_of, tool_point_at
from rcsa_ident.machine.robot.model import Frame, RobotModel
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.workflows.tool_change import ToolChange

#: Sine of the angle below which the tool's x can not be kept: it would point along the tool.
_ALONG = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class RobotAtPosture:
    """What `robot check` tells.

    `tool_point`: where the tool-holder's flange sits, as seen from the base
    `natural_frequencies`, `damping_ratios` [rad/s, -], shape (n,): without damping, rising; empty where no masses are known
    `gravity_torques` [N m], shape (j,): that hold the arm; empty likewise
    `compliance` [m/N], shape (3, 3): at rest, at the tool point in the base's axes
    `sag` [m], shape (3,): how far the tool point sinks under the arm's weight, what the control takes out left out; empty where no masses
        are known
    `play` [m], shape (3,): how far it may stand from the middle along each of the base's axes within the joints' play
    `postures` [rad], shape (s, j): all that bring the flange to the same place, within the joints' limits or not; the posture alone where
        the arm is not of the kind of which they are known
    """

    tool_point: Frame
    natural_frequencies: FloatArray
    damping_ratios: FloatArray
    gravity_torques: FloatArray
    compliance: FloatArray
    sag: FloatArray
    play: FloatArray
    postures: FloatArray


def at_posture(robot: FlexibleRobot, angles: FloatArray) -> RobotAtPosture:
    """Return what a robot is at a posture. `angles` [rad], shape (j,)."""
    model, posture = robot.model, robot.model.posture(angles)
    frequencies = ratios = torque = sunk = np.zeros(0)
    if model.weighed:
        frequencies, ratios = modes_of(robot.at(posture))
        torque = gravity_torques(model, posture)
        sunk = sag(model, posture, robot.tilts)[:3]
    try:
        others = postures_of(model, flange_at(model, posture), within_limits=False)
    except InputError:
        others = posture[None]
    compliance = static_compliance(model, posture, robot.tilts)[:3, :3]
    play = free_play(model, posture)[:3]
    return RobotAtPosture(tool_point_at(model, posture), frequencies, ratios, torque, compliance, sunk, play, others)


def following(robot: RobotModel, start: FloatArray, tips: FloatArray, axes: FloatArray, assembly: ToolAssembly) -> FloatArray:
    """Return a posture for each place of a tool's tip, shape (k, 6) [rad]: of all that reach it the one that turns the joints least.

    `start` [rad], shape (6,): posture from which the first one is sought; the tool's x keeps its direction there as nearly as the axis
        allows
    `tips` [m], shape (k, 3): in the base's axes
    `axes`, shape (k, 3): unit vectors from the tip into the spindle
    `assembly`: the tool-holder that stands between tip and spindle
    Raises `InputError` if a place is out of reach, or within reach of no allowed posture; it says which place.
    """
    here, sideways, found = robot.posture(start), tool_point_at(robot, start).turn[:, 0], []
    for number, (tip, axis) in enumerate(zip(tips, axes, strict=True), start=1):
        if abs(axis @ sideways) > np.sqrt(1.0 - _ALONG**2):
            raise InputError(f"tool's axis at place {number}", axis.tolist(), "one across the x of the tool at the posture to begin from")
        ways = postures_of(robot, flange_for(robot, sideways, tip, axis, assembly), near=here)
        if not len(ways):
            told = ", ".join(f"{1e3 * v:.0f}" for v in tip)
            raise InputError(f"place {number} of the path", f"{told} mm", "one that the robot reaches within its limits")
        here = ways[np.argmin(np.max(np.abs(ways - here), axis=1))]
        found.append(here)
    return np.array(found)


def flange_for(robot: RobotModel, sideways: FloatArray, tip: FloatArray, axis: FloatArray, assembly: ToolAssembly) -> Frame:
    """Return where the flange must be for a tool's tip [m] and axis, shape (3,), the tool's x along `sideways` as nearly as may be."""
    x = sideways - axis * (axis @ sideways)
    x = x / np.linalg.norm(x)
    turn = np.stack([x, np.cross(-axis, x), -axis], axis=1)
    length = assembly.stickout + assembly.holder_length
    return Frame(turn, tip + length * axis).then(robot.tool_point.inverse)


def limits_along(
    change: ToolChange, postures: FloatArray, progress: Callable[[int, int], None] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the stability limit and the chatter frequency at each posture and speed, shapes (k, n) [m, rad/s].

    `change`: on a `PosedRobot`, whose posture does not count; speeds rising, each once. No band is computed.
    `postures` [rad], shape (k, j)
    `progress`: told how many are done, and of how many
    """
    machine = change.machine
    if not isinstance(machine, PosedRobot):
        raise InputError("machine", str(machine), "a robot")
    limits, chatter = (np.full((len(postures), change.speeds.size), np.inf) for _ in range(2))
    for k, posture in enumerate(postures):
        own = replace(change, machine=replace(machine, angles=posture), draws=0)
        lobes = own.limits()
        limits[k], chatter[k] = lobes.limit_depth, lobes.chatter_frequency
        if progress is not None:
            progress(k + 1, len(postures))
    return limits, chatter
