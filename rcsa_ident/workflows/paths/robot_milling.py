"""What carries a tool on a robot that mills: the arm's freedoms with play and weight, linear about a posture."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.inertia import gravity_torques
from rcsa_ident.machine.robot.kinematics import tool_point_at
from rcsa_ident.toolpath.march import Carrier


def feed_turn(robot: FlexibleRobot, posture: FloatArray, direction: FloatArray) -> float:
    """Return the angle from the tool's x to a direction in the base's axes, about the tool's axis [rad]."""
    x, y, _ = tool_point_at(robot.model, posture).turn.T
    return float(np.arctan2(y @ direction, x @ direction))


def arm_carrier(
    robot: FlexibleRobot, posture: FloatArray, turn: float = 0.0, lever: float = 0.0, play: bool = True, weight: bool = False
) -> Carrier:
    """Return an arm with a rigid tool as what carries its tip.

    `posture` [rad], shape (j,)
    `turn` [rad]: of the feed from the tool's x (`feed_turn`)
    `lever` [m]: from where the tool-holder sits to the tip
    `play`: with the drives' backlash
    `weight`: with the arm's own weight, less what the control takes out
    """
    model = robot.model
    chain = model.chain(robot.tilts)
    gaps, load = np.zeros((2, chain.mass.size))
    if play:
        gaps[chain.driven] = [joint.backlash for joint in model.joints]
    if weight:
        load = -gravity_torques(model, chain.angles(model.posture(posture)), robot.tilts)
        load[chain.driven[[joint.gravity_compensated for joint in model.joints]]] = 0.0
    return Carrier.at_tip(robot.at(posture, turn), lever, gaps, load)
