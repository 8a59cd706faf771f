"""Postures along a path: the tool's tip is where it should be, its axis as told, and joints do not jump."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.kinematics import tool_point_at
from rcsa_ident.workflows.robot_postures import at_posture, following
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import robot


@pytest.fixture(scope="module")
def tooling():
    return read_tooling(TOOLINGS / "S3-PG25-long.toml")


def test_the_tip_follows_the_path(tooling):
    arm = robot("tx200")
    start = np.radians([-11.71, 20.78, 147.86, 82.76, 60.80, -166.96])
    tips = np.stack([np.linspace(0.8, 1.3, 40), np.linspace(-0.2, 0.3, 40), np.full(40, 0.3)], axis=1)
    tilt = np.linspace(0.0, 0.4, 40)
    axes = np.stack([np.sin(tilt), np.zeros(40), np.cos(tilt)], axis=1)
    found = following(arm, start, tips, axes, tooling.assembly)
    length = tooling.assembly.stickout + tooling.assembly.holder_length
    for tip, axis, posture in zip(tips, axes, found, strict=True):
        tool = tool_point_at(arm, posture)
        np.testing.assert_allclose(tool.turn[:, 2], -axis, atol=1e-9)
        np.testing.assert_allclose(tool.offset - length * axis, tip, atol=1e-9)
        assert arm.beyond_limits(posture) == ()
    assert np.max(np.abs(np.diff(found, axis=0))) < np.radians(6.0)


def test_a_place_out_of_reach_is_named(tooling):
    arm = robot("tx200")
    with pytest.raises(InputError, match="place 2 of the path"):
        following(arm, np.zeros(6), np.array([[1.0, 0.0, 0.5], [5.0, 0.0, 0.5]]), np.tile([0.0, 0.0, 1.0], (2, 1)), tooling.assembly)


def test_an_arm_of_another_kind_has_the_posture_that_was_asked_for():
    arm = robot("tx200")
    five = replace(arm, joints=arm.joints[:5])
    found = at_posture(FlexibleRobot(five), np.full(5, 0.3))
    np.testing.assert_array_equal(found.postures, [np.full(5, 0.3)])
