"""Arms that give way: natural frequencies and compliances that others computed or printed, and the spindle coupled to a bare arm."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.structure import poles
from rcsa_ident.machine.robot.compliance import free_play, sag, spring_torques, static_compliance, twist_per_payload
from rcsa_ident.machine.robot.flexible import FlexibleRobot, modes_of
from rcsa_ident.machine.robot.inertia import gravity_torques, mass_matrix
from rcsa_ident.machine.robot.kinematics import flange_at, posed, postures_of, tool_point_at
from rcsa_ident.machine.robot.model import Frame
from tests.fixtures.robots import BENT, KR600, STRETCHED, TABLE_7, robot


def frequencies(name, posture, tilts=True):
    omega, ratio = modes_of(FlexibleRobot(robot(name), tilts).at(posture))
    return to_hz(omega), 100.0 * ratio


def test_natural_frequencies_of_the_tx200():
    hz, ratio = frequencies("tx200", TABLE_7, tilts=False)
    np.testing.assert_allclose(hz, [15.768, 25.056, 27.720, 33.561, 92.587, 138.708], rtol=1e-4)
    np.testing.assert_allclose(ratio, [0.97, 1.74, 1.78, 5.14, 11.6, 42.6], rtol=5e-3)
    hz, ratio = frequencies("tx200", TABLE_7)
    expected = [11.754, 13.651, 22.228, 23.584, 34.867, 55.334, 71.470, 85.669, 94.367, 134.740, 152.284, 210.36]
    np.testing.assert_allclose(hz[:12], expected, rtol=1e-4)
    np.testing.assert_allclose(ratio[:8], [0.72, 0.80, 1.68, 1.99, 4.48, 4.21, 4.81, 7.72], rtol=1e-2)


def test_natural_frequencies_without_the_spindle():
    for tilts, expected in (
        (False, [17.194, 29.135, 48.604, 175.85, 216.71, 1332.1]),
        (True, [12.170, 14.139, 31.041, 43.450, 65.389, 73.616]),
    ):
        omega, _ = modes_of(FlexibleRobot(robot("tx200"), tilts).bare(TABLE_7))
        np.testing.assert_allclose(to_hz(omega[:6]), expected, rtol=1e-4)


def test_natural_frequencies_of_the_kr210():
    """Without the springs across the axes the first modes are nowhere near those that were measured."""
    np.testing.assert_allclose(frequencies("kr210", BENT)[0][:8], [9.31, 10.99, 17.59, 18.77, 34.9, 45.7, 55.6, 56.3], rtol=1.5e-3)
    np.testing.assert_allclose(frequencies("kr210", np.zeros(6))[0][:8], [8.59, 9.40, 19.18, 21.28, 35.2, 45.1, 52.8, 56.4], rtol=1.5e-3)
    measured = np.array([8.4, 11.1, 16.9, 20.6])
    fitted = frequencies("kr210", np.radians([0.0, 80.0, -5.9, -1.4, 73.4, 0.0]))[0][:4]
    assert np.max(np.abs(fitted / measured - 1.0)) < 0.05
    assert np.max(np.abs(frequencies("kr210", BENT)[0][:4] / measured - 1.0)) < 0.12
    assert frequencies("kr210", BENT, tilts=False)[0][0] > 1.7 * measured[0]


def test_damping_of_the_tx200_goes_with_the_root_of_the_stiffness():
    arm = robot("tx200")
    ratio = np.array([j.damping / np.sqrt(j.stiffness) for j in arm.joints])
    np.testing.assert_allclose(ratio, 0.2690, atol=2e-4)


def test_static_compliance():
    """At the tool of the TX200; of the KR210 stretched out, where 100 N were measured to move it by 0.25 mm; at the flange of the KR600."""
    arm = robot("tx200")
    six = static_compliance(arm, TABLE_7, tilts=False)[:3, :3] * 1e6
    np.testing.assert_allclose(six, [[1.602, -0.388, 0.122], [-0.388, 1.216, 0.633], [0.122, 0.633, 0.567]], atol=6e-4)
    every = static_compliance(arm, TABLE_7)[:3, :3] * 1e6
    np.testing.assert_allclose(every, [[1.908, -0.341, 0.175], [-0.341, 1.821, 0.733], [0.175, 0.733, 0.737]], atol=6e-4)
    np.testing.assert_allclose(static_compliance(robot("kr210"), STRETCHED)[:3, :3].diagonal() * 1e6, [0.83, 2.73, 0.75], atol=6e-3)
    np.testing.assert_allclose(static_compliance(robot("kr500"), KR600)[:3, :3].diagonal() * 1e6, [0.634, 0.196, 0.613], atol=6e-4)


@pytest.mark.parametrize("tilts", [False, True])
def test_static_compliance_is_the_receptance_at_rest(tilts):
    arm = robot("tx200")
    still = FlexibleRobot(arm, tilts).at(TABLE_7).receptance(np.array([1e-3])).values[0].real
    tool = tool_point_at(arm, TABLE_7)
    # the spindle's axes: x of the tool, the two others turned around
    axes = tool.turn @ np.diag([1.0, -1.0, -1.0])
    base = static_compliance(arm, TABLE_7, tilts)
    np.testing.assert_allclose(still[np.ix_([0, 2, 4], [0, 2, 4])], axes.T @ base[:3, :3] @ axes, rtol=1e-7, atol=1e-15)
    turned = axes.T @ base[3:, 3:] @ axes
    # a slope in X is a turn about y, one in Y a turn about -x
    assert still[1, 1] == pytest.approx(turned[1, 1], rel=1e-7)
    assert still[3, 3] == pytest.approx(turned[0, 0], rel=1e-7)
    assert still[1, 3] == pytest.approx(-turned[1, 0], rel=1e-6)
    assert still[5, 5] == pytest.approx(turned[2, 2], rel=1e-7)


def test_sag_and_gravity():
    arm = robot("tx200")
    np.testing.assert_allclose(gravity_torques(arm, TABLE_7), [0.0, -1112.42, -80.73, 28.14, 138.99, 0.0], atol=6e-3)
    wrist = gravity_torques(replace(arm, payload=None), TABLE_7)[4]
    assert wrist == pytest.approx(8.783, abs=1e-3)
    free = replace(arm, joints=tuple(replace(j, gravity_compensated=False) for j in arm.joints))
    np.testing.assert_allclose(1e6 * sag(free, TABLE_7, tilts=False)[:3], [-110.0, -252.0, -312.0], atol=0.6)
    np.testing.assert_allclose(1e6 * sag(free, TABLE_7)[:3], [-137.0, -209.0, -809.0], atol=0.6)
    # the control takes out what the second, third and fifth drive sink; the fourth is left, 28 N m on 0.45 MN m/rad
    chain = posed(arm, TABLE_7)
    fourth = -gravity_torques(arm, TABLE_7)[3] / 0.45e6 * chain.jacobian(tool_point_at(arm, TABLE_7).offset)[:, 3]
    np.testing.assert_allclose(sag(arm, TABLE_7, tilts=False), fourth, atol=1e-9)


def test_twist_per_kilogram_of_the_payload():
    """By differences of the weight's torques."""
    arm = robot("tx200")
    heavier = replace(arm, payload=replace(arm.payload, mass=arm.payload.mass + 1.0))
    more = gravity_torques(heavier, TABLE_7) - gravity_torques(arm, TABLE_7)
    np.testing.assert_allclose(twist_per_payload(arm, TABLE_7), -more / posed(arm, TABLE_7).chain.stiffness, rtol=1e-9, atol=1e-18)


def test_play_is_felt_on_both_sides_alike():
    arm = robot("tx200")
    twist = np.zeros(18)
    twist[[0, 3, 6]] = [5e-5, 1e-4, -1e-4]
    torque = spring_torques(arm, twist, np.zeros(18))
    np.testing.assert_allclose(torque[[0, 3, 6]], [0.0, -6.02e6 * 2.7e-5, 1.91e6 * 2.7e-5], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(spring_torques(arm, 0.0 * twist, np.ones(18))[[0, 1]], [-383.3, -1000.0])


def test_free_play_is_the_farthest_corner_of_all_plays():
    arm, corners = robot("tx200"), np.array(list(product((-1.0, 1.0), repeat=6)))
    motion = posed(arm, TABLE_7).jacobian(tool_point_at(arm, TABLE_7).offset)
    farthest = np.max(np.abs(corners * 7.3e-5 @ motion.T), axis=0)
    np.testing.assert_allclose(free_play(arm, TABLE_7), farthest, rtol=1e-12)
    # about a tenth of a millimetre, as others found of such plays
    assert 5e-5 < free_play(arm, TABLE_7)[:3].max() < 3e-4


@pytest.mark.parametrize("tilts", [False, True])
def test_the_bare_arm_with_the_spindle_coupled_is_the_arm_that_carries_it(tilts):
    """Rigidly, at the robot's flange: inv(inv(H) - w^2 M_b), against the equations with the payload in them, 1 to 500 Hz."""
    arm, omega = robot("tx200"), 2.0 * np.pi * np.linspace(1.0, 500.0, 200)
    found = FlexibleRobot(arm, tilts).bare(TABLE_7).receptance(omega)
    assert [str(c) for c in found.rows] == ["flange.x", "flange.x'", "flange.y", "flange.y'", "flange.z", "flange.z'"]
    # x, y, z and the turns about them: a slope in X is a turn about y, one in Y a turn about -x
    order, sign = [0, 2, 4, 3, 1, 5], np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    bare = found.values[:, order][:, :, order] * np.outer(sign, sign)
    body = arm.payload.seen_from(replace(flange_at(arm, TABLE_7), offset=np.zeros(3)))
    x, y, z = body.centre
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    mass = np.block([[body.mass * np.eye(3), -body.mass * skew], [body.mass * skew, body.inertia - body.mass * skew @ skew]])
    coupled = np.linalg.inv(np.linalg.inv(bare) - omega[:, None, None] ** 2 * mass)
    whole = posed(arm, TABLE_7, tilts)
    motion, w = whole.jacobian(whole.flange.offset), omega[:, None, None]
    stiffness, damping = np.diag(whole.chain.stiffness), np.diag(whole.chain.damping)
    dynamic = stiffness + 1j * w * damping - w**2 * mass_matrix(whole)
    direct = motion @ np.linalg.solve(dynamic, np.broadcast_to(motion.T, (omega.size, *motion.T.shape)))
    np.testing.assert_allclose(coupled, direct, atol=1e-12 * np.abs(direct).max())


def test_the_receptance_is_symmetric_and_passive():
    found = FlexibleRobot(robot("tx200")).at(TABLE_7).receptance(2.0 * np.pi * np.linspace(1.0, 300.0, 100)).values
    np.testing.assert_allclose(found, found.transpose(0, 2, 1), rtol=1e-9, atol=1e-18)
    assert np.max(np.linalg.eigvalsh(found.imag)[:, -1] / np.abs(found).max(axis=(1, 2))) < 1e-9


def test_peaks_at_the_tool_of_the_tx200():
    """In the base's axes: the tool's x points to -y, its y to -x."""
    omega = 2.0 * np.pi * np.arange(10.0, 40.0, 0.05)
    for tilts, peaks in ((False, {"x": (26.6, 25.05), "y": (24.6, 15.75), "z": (4.7, 27.65)}), (True, {"x": (27.5, 22.20)})):
        arm = robot("tx200")
        found = FlexibleRobot(arm, tilts).at(TABLE_7).receptance(omega).values[:, [0, 2, 4]][:, :, [0, 2, 4]]
        axes = tool_point_at(arm, TABLE_7).turn @ np.diag([1.0, -1.0, -1.0])
        base = np.abs(np.einsum("ai,nij,aj->na", axes, found, axes))
        for axis, (height, hz) in peaks.items():
            curve = base[:, "xyz".index(axis)]
            assert 1e6 * curve.max() == pytest.approx(height, abs=0.06)
            assert to_hz(omega[curve.argmax()]) == pytest.approx(hz, abs=0.051)


def test_along_a_straight_path_the_modes_move_by_half():
    arm = robot("tx200")
    flange, here, first = flange_at(arm, TABLE_7), TABLE_7, []
    for shift in np.linspace(0.0, 0.9, 31):
        there = Frame(flange.turn, flange.offset + np.array([shift, 0.0, 0.0]))
        ways = postures_of(arm, there, within_limits=False)
        ways = ways + 2.0 * np.pi * np.round((here - ways) / (2.0 * np.pi))
        here = ways[np.argmin(np.abs(ways - here).max(axis=1))]
        first.append(to_hz(modes_of(FlexibleRobot(arm, tilts=False).at(here))[0][:2]))
    np.testing.assert_allclose(first[0], [15.77, 25.06], atol=0.01)
    np.testing.assert_allclose(first[-1], [10.09, 18.88], atol=0.01)


def test_poles_are_those_of_the_structure():
    structure = FlexibleRobot(robot("tx200")).at(TABLE_7)
    omega = 2.0 * np.pi * np.linspace(2.0, 400.0, 50)
    exact = structure.receptance(omega).values
    found = poles(structure, 2.0 * np.pi * 500.0).receptance(omega).values
    np.testing.assert_allclose(found, exact, atol=1e-6 * np.abs(exact).max())


def test_turning_the_feed_turns_the_directions():
    arm = FlexibleRobot(robot("tx200"))
    omega = 2.0 * np.pi * np.array([20.0, 60.0])
    straight, turned = (arm.at(TABLE_7, turn).receptance(omega) for turn in (0.0, np.pi / 2.0))
    # the feed along what was the tool's y, which is minus the spindle's y
    np.testing.assert_allclose(turned.between("flange.x", "flange.x"), straight.between("flange.y", "flange.y"), rtol=1e-9)
    np.testing.assert_allclose(turned.between("flange.x", "flange.z"), -straight.between("flange.y", "flange.z"), rtol=1e-9)


def test_an_arm_without_masses_has_no_modes():
    with pytest.raises(InputError, match="link masses"):
        FlexibleRobot(robot("kr500")).at(np.zeros(6))
