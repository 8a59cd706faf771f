"""The virtual robot beside the robot that is identified: two multibodies that share nothing but their nouns."""

from dataclasses import replace

import numpy as np

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.io.machines import read_machine
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.model import Body
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.robot import VirtualRobot, arm_matrices, robot_rotor
from rcsa_ident.virtual.rotor import frequency_response
from tests.fixtures.paths import MACHINES, TOOLINGS
from tests.fixtures.robots import TABLE_7, robot

ALL_TIPS = ("tip.x", "tip.y", "tip.z")


def virtual(stiff=False):
    spindle = replace(read_machine(MACHINES / "hpm.toml").spindle, gyroscopic=False)
    if stiff:
        bearings = tuple(replace(b, stiffness=(1e13, 1e13), damping=(0.0, 0.0)) for b in spindle.bearings)
        spindle = replace(spindle, bearings=bearings)
    arm = robot("tx200")
    housing = Body(32.0, np.array([0.0, 0.0, -0.19]), np.diag([0.7, 0.7, 0.2])).seen_from(arm.tool_point)
    return VirtualRobot(replace(arm, payload=housing), spindle)


def test_its_multibody_is_the_other_ones():
    arm = robot("tx200")
    mass, damping, stiffness, hand = arm_matrices(arm, TABLE_7)
    other = FlexibleRobot(arm).at(TABLE_7)
    for here, there in ((mass, other.mass), (damping, other.damping), (stiffness, other.stiffness), (hand.T, other.ports)):
        np.testing.assert_allclose(here, there, atol=1e-11 * np.abs(there).max())


def test_a_rigid_spindle_is_a_payload():
    """What little is left is the shaft between its bearings, and the holder's stretch."""
    made, tooling = virtual(stiff=True), read_tooling(TOOLINGS / "S1-ER32.toml")
    joint = LumpedJoint(*(getattr(made.spindle.joint, name) for name in (
        "translational_stiffness", "rotational_stiffness", "translational_damping", "rotational_damping")))  # fmt: skip
    omega = 2.0 * np.pi * np.array([5.0, 9.0, 12.0, 15.0, 25.0])
    found = frequency_response(robot_rotor(made, TABLE_7, tooling.assembly), omega, 0.0, ALL_TIPS, ALL_TIPS)
    expected = PosedRobot(FlexibleRobot(made.drawn()), TABLE_7, joint=joint).tip(tooling, omega).values
    assert np.linalg.norm(found[:, :2, :2] - expected[:, :2, :2]) < 0.005 * np.linalg.norm(expected)
    # no force moves another place otherwise than the reverse
    np.testing.assert_allclose(found, found.transpose(0, 2, 1), atol=1e-9 * np.abs(found).max())


def test_few_poles_stand_for_it():
    whole = robot_rotor(virtual(), TABLE_7, read_tooling(TOOLINGS / "S1-ER32.toml").assembly)
    small = poles(reduced(whole, inputs=ALL_TIPS, planes=1), 0.0, ALL_TIPS)
    omega = 2.0 * np.pi * np.array([5.0, 12.0, 25.0, 80.0, 500.0, 900.0, 1500.0, 2000.0, 3000.0])
    full, few = frequency_response(whole, omega, 0.0, ALL_TIPS), small.response(omega)
    assert small.pole.size < 100 < whole.mass.shape[0]
    np.testing.assert_allclose(np.linalg.norm(few - full, axis=(1, 2)) / np.linalg.norm(full, axis=(1, 2)), 0.0, atol=4e-3)
