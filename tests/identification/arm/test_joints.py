"""Joints of an arm on the move: stiffness, delay, friction, and what a plain regression makes of the same records."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.arm.joints import JointRecord, fit_joints
from tests.fixtures import moving_arm


@pytest.fixture(scope="module")
def records():
    return moving_arm.record("A", 11), moving_arm.record("B", 12)


@pytest.fixture(scope="module")
def believed():
    """The arm as its file has it: stiffnesses up to a factor of two off."""
    arm = moving_arm.arm()
    off = (2.0, 0.5, 1.6, 0.6, 2.0, 0.5)
    return replace(arm, joints=tuple(replace(j, stiffness=f * j.stiffness) for j, f in zip(arm.joints, off, strict=True)))


def plain(record, i):
    """Slope of a regression of the motor-minus-joint angle on the torque, and the share that it explains."""
    twist, torque = record.motor[i] - record.joint[i], record.torque[i]
    slope, ahead = np.polyfit(torque, twist, 1)
    return 1.0 / slope, 1.0 - np.var(twist - slope * torque - ahead) / np.var(twist)


def test_stiffness_within_its_band(records, believed):
    found = fit_joints(believed, records)
    # ten newton metres at the last joint bend it by less than its encoder errs
    np.testing.assert_array_equal(found.told, [True] * 5 + [False])
    off = found.stiffness / moving_arm.STIFFNESS - 1.0
    assert np.all(np.abs(off[:5]) < 2.0 * found.stiffness_share[:5])
    assert np.all(np.abs(off[:3]) < 0.05)
    np.testing.assert_allclose(found.lost_motion, moving_arm.LOST, rtol=0.1)
    assert found.delay == pytest.approx(moving_arm.LATE, abs=4.0 * found.delay_spread)
    assert found.delay_spread < 1e-4
    # friction as fast as the joints move; where they creep it sticks, which the fit does not know
    there, told = (a[:3] + 0.2 * b[:3] for a, b in ((moving_arm.COULOMB, moving_arm.VISCOUS), (found.coulomb, found.viscous)))
    np.testing.assert_allclose(told, there, rtol=0.05)


def test_another_motion_is_explained(records, believed):
    first, other = records
    found = fit_joints(believed, [first])
    assert np.all(found.explained(other)[:3] > 0.95)
    assert np.all(found.explained(first)[:3] > 0.95)
    # a regression takes what is read late, and the friction, for a soft spring
    for i in range(2):
        stiffness, explained = plain(first, i)
        assert explained < 0.8
        assert stiffness < 0.7 * moving_arm.STIFFNESS[i]


def test_without_a_delay_none_is_found(believed):
    found = fit_joints(believed, [moving_arm.record("A", 13, late=0.0)])
    assert abs(found.delay) < 4.0 * found.delay_spread


def test_lengths_count_and_masses_do_not(records, believed):
    """Whatever the links weigh: the file's masses are not asked."""
    light = replace(believed, joints=tuple(replace(j, body=replace(j.body, mass=0.1 * j.body.mass)) for j in believed.joints))
    one, other = (fit_joints(arm, records[:1]) for arm in (believed, light))
    np.testing.assert_array_equal(one.stiffness, other.stiffness)


def test_a_joint_that_other_motors_turn_is_left_out(records, believed):
    first = records[0]
    joint = first.joint.copy()
    joint[4] += 0.3 * first.motor[3]
    found = fit_joints(believed, [replace(first, joint=joint)])
    assert np.isnan(found.stiffness[4])
    assert np.isnan(found.explained(first)[4])
    assert not found.told[4]
    assert found.told[1]


def test_a_stiff_joint_is_not_told(believed):
    """Nothing loads the first axis but its own acceleration: where that is slow, the records do not tell a spring."""
    slow = moving_arm.record("slow", 14)
    motor, joint = slow.motor.copy(), slow.joint.copy()
    motor[0] = joint[0] = 1e-3 * np.sin(np.arange(motor.shape[1]) * 1e-3)
    still = replace(slow, motor=motor, joint=joint)
    found = fit_joints(believed, [still])
    assert not found.told[0]
    assert np.isnan(found.stiffness[0])


def test_bad_records_are_named(records, believed):
    first = records[0]
    five = JointRecord("A", first.step, *(each[:5] for each in (first.motor, first.joint, first.torque, first.motor_inertia)))
    with pytest.raises(InputError, match="record A: found 5 joints, allowed is 6"):
        fit_joints(believed, [five])
    with pytest.raises(InputError, match="at least 2 s"):
        replace(first, motor=first.motor[:, :100], joint=first.joint[:, :100], torque=first.torque[:, :100])
    with pytest.raises(InputError, match="torque: values that are not finite"):
        replace(first, torque=first.torque * np.nan)
    with pytest.raises(InputError, match="no joint whose motor"):
        fit_joints(believed, [replace(first, joint=first.joint + np.sin(np.arange(first.joint.shape[1]) * 0.01))])
