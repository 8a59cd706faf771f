"""Places and postures of published arms: data sheets, printed poses, and the way there and back."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.robots import turn_of
from rcsa_ident.machine.robot.kinematics import flange_at, postures_of, tool_point_at
from rcsa_ident.machine.robot.model import Frame, turned_within
from tests.fixtures.robots import KR600, TABLE_7, robot

#: Denavit-Hartenberg rows of the TX200 as printed: d, a [m], alpha [deg]; the last d from its table 1.
DENAVIT_HARTENBERG = [(0.642, 0.25, -90), (0.0, 0.95, 0), (0.0, 0.0, 90), (0.8, 0.0, -90), (0.0, 0.0, 90), (0.194, 0.0, 0)]


def by_rows(angles):
    frame = Frame()
    for (d, a, alpha), angle in zip(DENAVIT_HARTENBERG, angles, strict=True):
        about_z = Frame(turn_of(np.array([0.0, 0.0, angle])), np.array([0.0, 0.0, d]))
        frame = frame.then(about_z).then(Frame(turn_of(np.array([np.radians(alpha), 0.0, 0.0])), np.array([a, 0.0, 0.0])))
    return frame


def test_both_printed_tables_of_the_tx200_say_the_same():
    arm, rng = robot("tx200"), np.random.default_rng(1)
    for angles in rng.uniform(-np.pi, np.pi, (1000, 6)):
        ours, theirs = flange_at(arm, angles), by_rows(angles + np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]))
        np.testing.assert_allclose(ours.offset, theirs.offset, atol=1e-12)
        np.testing.assert_allclose(ours.turn, theirs.turn, atol=1e-12)


def test_the_printed_posture_holds_the_tool_upright():
    tool = tool_point_at(robot("tx200"), TABLE_7)
    np.testing.assert_allclose(tool.offset, [0.79399, 0.18472, 0.31632], atol=5e-6)
    np.testing.assert_allclose(tool.turn, [[-0.18964, -0.98185, 0.0], [-0.98185, 0.18964, 0.0], [0.0, 0.0, -1.0]], atol=4e-5)


def test_the_kr500_stretches_as_its_data_sheet_says():
    arm = robot("kr500")
    np.testing.assert_allclose(flange_at(arm, np.zeros(6)).offset, [3.115, 0.0, 0.990], atol=1e-12)
    # the milling posture of a published study: the spindle's axis lies level, its flange's x stands upright
    turn = flange_at(arm, KR600).turn
    assert abs(turn[2, 2]) < np.sin(np.radians(0.1))
    assert abs(turn[2, 0]) > np.cos(np.radians(1.0))


@pytest.mark.parametrize("name", ["tx200", "kr210", "kr500"])
def test_all_postures_bring_the_flange_back(name):
    arm, rng = robot(name), np.random.default_rng(2)
    counts = []
    for angles in rng.uniform(-np.pi, np.pi, (200, 6)):
        flange = flange_at(arm, angles)
        found = postures_of(arm, flange, within_limits=False)
        counts.append(len(found))
        assert min(np.abs(np.angle(np.exp(1j * (each - angles)))).max() for each in found) < 1e-6
        for each in found:
            there = flange_at(arm, each)
            np.testing.assert_allclose(there.offset, flange.offset, atol=1e-9)
            np.testing.assert_allclose(there.turn, flange.turn, atol=1e-9)
        distinct = np.array([[np.abs(np.angle(np.exp(1j * (a - b)))).max() for b in found] for a in found])
        assert np.all(distinct + np.eye(len(found)) > 1e-6)
    assert set(counts) <= {2, 4, 8}
    assert max(counts) == 8


def test_eight_postures_of_the_printed_pose():
    arm = robot("tx200")
    found = np.degrees(postures_of(arm, flange_at(arm, TABLE_7), within_limits=False))
    printed = [
        (-11.71, 20.78, 147.86, 82.76, 60.80, -166.96),
        (-11.71, 20.78, 147.86, -97.24, -60.80, 13.04),
        (-11.71, 135.499, -147.86, 97.793, 119.069, 14.176),
        (-11.71, 135.499, -147.86, -82.207, -119.069, -165.824),
        (168.29, -132.395, 110.908, -101.246, 118.004, -24.508),
        (168.29, -132.395, 110.908, 78.754, -118.004, 155.492),
        (168.29, -35.681, -110.908, -108.224, 65.741, -142.848),
        (168.29, -35.681, -110.908, 71.776, -65.741, 37.152),
    ]
    assert len(found) == 8
    for each in printed:
        assert np.min(np.abs(found - each).max(axis=1)) < 1e-3
    # its own third angle is beyond the limit; of the eight two are inside all limits, both backwards
    allowed = np.degrees(postures_of(arm, flange_at(arm, TABLE_7)))
    np.testing.assert_allclose(allowed[:, 0], 168.29, atol=1e-3)
    assert len(allowed) == 2
    (said,) = arm.beyond_limits(TABLE_7)
    assert said == "J3 stands at -212.14°, its limits are -140° and 145°"


def test_whole_turns_that_limits_leave_are_those_nearest_to_a_posture():
    """The fourth joint may turn by 270°: on a path through 200° it does not jump to -160°."""
    arm = robot("tx200")
    angles = np.radians([10.0, 20.0, 100.0, 200.0, 60.0, -230.0])
    flange = flange_at(arm, angles)
    assert min(np.abs(each - angles).max() for each in postures_of(arm, flange, near=angles)) < 1e-9
    folded = np.radians([10.0, 20.0, 100.0, -160.0, 60.0, 130.0])
    assert min(np.abs(each - folded).max() for each in postures_of(arm, flange)) < 1e-9


def test_a_place_out_of_reach_has_no_posture():
    assert postures_of(robot("tx200"), Frame(offset=np.array([3.0, 0.0, 0.0]))).shape == (0, 6)


def test_an_arm_of_another_kind_is_refused():
    arm = robot("tx200")
    bent = replace(arm.joints[4], frame=Frame(offset=np.array([0.05, 0.0, 0.6])))
    other = replace(arm, joints=(*arm.joints[:4], bent, arm.joints[5]))
    with pytest.raises(InputError, match="last three axes cross"):
        postures_of(other, Frame())
    with pytest.raises(InputError, match="found 5 joints"):
        postures_of(replace(arm, joints=arm.joints[:5]), Frame())


def test_whole_turns_bring_an_angle_within_limits():
    assert turned_within(np.radians(200.0), (-np.pi, np.pi)) == pytest.approx(np.radians(-160.0))
    assert turned_within(np.radians(200.0), (0.0, 2.0 * np.pi)) == pytest.approx(np.radians(200.0))
    assert np.isnan(turned_within(np.radians(170.0), (-1.0, 1.0)))
    assert turned_within(np.radians(-160.0), np.radians((-270.0, 270.0)), np.radians(190.0)) == pytest.approx(np.radians(200.0))


def test_springs_by_name_and_in_the_chains_order():
    arm = robot("kr210")
    names = arm.spring_names()
    assert names[:4] == ("A1", "A1 about x", "A1 about y", "A2")
    assert arm.spring_names(tilts=False) == ("A1", "A2", "A3", "A4", "A5", "A6")
    softer = arm.with_springs(0.5 * arm.chain().stiffness)
    np.testing.assert_array_equal(softer.chain().stiffness, 0.5 * arm.chain().stiffness)
    drives = arm.with_springs(np.arange(1.0, 7.0), tilts=False)
    np.testing.assert_array_equal(drives.chain(tilts=False).stiffness, np.arange(1.0, 7.0))
    assert drives.joints[0].tilts == arm.joints[0].tilts
