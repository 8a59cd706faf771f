"""A machine whose tool gives way: the static compliance of its tip, and a path that makes up for it."""

import numpy as np
import pytest

from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.robot.compliance import static_compliance
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.kinematics import tool_point_at
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.toolpath.compensation import Place
from rcsa_ident.toolpath.forces import ForceAlongPath, on_all_moves
from rcsa_ident.toolpath.path import RAPID, ToolPath
from rcsa_ident.workflows.paths.machine import compensate_machine, compliance_at_rest
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import TABLE_7, robot

PATH = ToolPath(
    np.array([[0, 0, 0.05], [0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0], [0.05, 0.05, 0.05]]), feed=[RAPID, RAPID, 0.05, 0.05, RAPID]
)
COMPLIANCE = np.array([[4e-7, 1e-7, 0.0], [1e-7, 5e-7, 0.0], [0.0, 0.0, 1e-8]])


def test_compliance_is_that_of_a_structure_at_rest():
    """Of an arm whose tip is known otherwise: what gives way where the tool-holder sits, lever and all, and the tool's own bending."""
    arm, tooling = FlexibleRobot(robot("tx200")), read_tooling(TOOLINGS / "S3-PG25-long.toml")
    found, drawn = compliance_at_rest(PosedRobot(arm, TABLE_7), tooling, 0, np.random.default_rng(1))
    assert drawn.shape == (0, 3, 3)
    length = tooling.assembly.stickout + tooling.assembly.holder_length
    own = static_compliance(arm.model, TABLE_7)
    turn = tool_point_at(arm.model, TABLE_7).turn
    x, y, z = (length * turn[:, 2]).tolist()
    lever = np.hstack([np.eye(3), np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])])
    spindle = turn @ np.diag([1.0, -1.0, -1.0])
    expected = spindle.T @ lever @ own @ lever.T @ spindle
    # the tool bends, too: across itself, and by less than a third of what the arm gives way
    extra = np.diag(found - expected) / np.diag(expected)
    assert np.all((extra > -1e-3) & (extra < [0.3, 0.3, 0.03])), extra


def test_what_gives_way_is_taken_off_and_what_is_not_known_stays():
    force = on_all_moves(PATH, np.array([-200.0, 100.0, 50.0]))
    other = 1.1 * COMPLIANCE
    found = compensate_machine(PATH, force, COMPLIANCE, other[None])
    pushed = COMPLIANCE @ [-200.0, 100.0, 50.0]
    np.testing.assert_allclose(found.correction[1:4], np.tile(-pushed, (3, 1)), atol=1e-18)
    np.testing.assert_array_equal(found.correction[[0, 4]], 0.0)
    assert found.after.rms < 1e-15
    assert found.draws[0].rms == pytest.approx(0.1 * found.before.rms)
    assert found.became == (Place.RAPID, Place.CORRECTED, Place.CORRECTED, Place.CORRECTED, Place.RAPID)
    assert found.limited == ()


def test_a_correction_ends_at_the_largest():
    force = ForceAlongPath(np.array([0.0, 2.0]), np.array([[0.0, 0.0, 0.0], [0.0, 400.0, 0.0]]))
    found = compensate_machine(PATH, force, COMPLIANCE, np.empty((0, 3, 3)), largest=1.5e-4)
    assert found.became[2] is Place.CORRECTED
    assert found.limited == (3,)
    assert np.linalg.norm(found.correction[3]) == pytest.approx(1.5e-4)
    assert found.after.largest > 1e-5
