"""The virtual robot beside the robot that is identified: two multibodies that share nothing but their nouns."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.robot.carried_spindle import CarriedSpindle
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.model import Body
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.robot import VirtualRobot, arm_matrices, robot_rotor
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.fixtures.paths import MACHINES, TOOLINGS
from tests.fixtures.robots import TABLE_7, robot

ALL_TIPS = ("tip.x", "tip.y", "tip.z")


def virtual(stiff=False, lossless=False):
    spindle = replace(read_machine(MACHINES / "hpm.toml").spindle, gyroscopic=False)
    if lossless:
        spindle = replace(spindle, shaft=tuple(replace(s, material=replace(s.material, loss_factor=0.0)) for s in spindle.shaft))
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


PLANES = ("flange.x", "flange.x'", "flange.y", "flange.y'")
POSTURES = np.radians(
    [[-5.4, -12.3, 142.8, 124.4, 16.6, -133.6], [24.5, 29.5, 141.3, -24.7, -51.6, 4.4], [-28.7, 54.3, 53.2, 46.7, 111.3, -126.7]]
)


def held(made):
    """All modes of the spindle on a held housing, from the rotor's own matrices."""
    whole = rotor(made.spindle, None)
    freedoms, position = whole.mass.shape[0], made.spindle.housing.position
    housing = np.array([freedoms // 2 - 2, freedoms // 2 - 1, freedoms - 2, freedoms - 1])
    free = np.setdiff1d(np.arange(freedoms), housing)
    mass, damping, stiffness = (m.toarray() for m in (whole.mass, whole.damping, whole.stiffness))
    own = np.ix_(free, free)
    squares, shapes = scipy.linalg.eigh(stiffness[own], mass[own])
    ports = whole.ports[whole.port(*PLANES)][:, free]
    # the shaft follows a housing that moves slowly, as a rigid body: told by the springs alone
    follows = -np.linalg.solve(stiffness[own], stiffness[np.ix_(free, housing)])
    shift = np.kron(np.eye(2), [[1.0, position], [0.0, 1.0]])
    psi, pull = (ports @ shapes).T, shapes.T @ mass[own] @ follows @ shift
    viscous = shapes.T @ damping[own] @ shapes
    return CarriedSpindle(np.sqrt(squares), viscous, psi, pull, np.zeros((4, 4)))


def test_modes_on_a_held_housing_hold_at_every_posture():
    """Arm and carried spindle beside the full equations; modes that merely add to the arm would differ from posture to posture."""
    # viscous dampers alone: modes have no hysteretic ones
    made = virtual(lossless=True)
    spindle, arm = held(made), FlexibleRobot(made.drawn())
    # all that swings when the housing moves is the shaft
    weight = made.drawn().payload.mass - 32.0
    assert spindle.mass_along(0) == pytest.approx(weight, rel=1e-4)
    omega = 2.0 * np.pi * np.array([20.0, 100.0, 400.0, 700.0, 1000.0, 1300.0, 1700.0, 2200.0, 3000.0, 4000.0])
    added = []
    for posture in POSTURES:
        truth = frequency_response(robot_rotor(made, posture, None), omega, 0.0, PLANES, PLANES)
        found = PosedRobot(arm, posture, spindle=spindle).flange.receptance(omega).values[:, :4, :4]
        size = np.sqrt(np.abs(np.einsum("nii->ni", truth)))
        assert np.max(np.abs(found - truth) / (size[:, :, None] * size[:, None, :])) < 1e-4
        added.append(truth - arm.at(posture).receptance(omega).values[:, :4, :4])
    spread = np.max([np.abs(each - added[0]) / np.abs(added[0]) for each in added[1:]], axis=0)
    assert np.max(spread[omega > 2.0 * np.pi * 300.0][:, 0, 0]) > 0.1
