"""An arm along a corner, under the forces of a slot: what it leaves without compensation and with it, and what is told where it ends."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.kinematics import tool_point_at
from rcsa_ident.machine.robot.motion import ArmUnderForce
from rcsa_ident.tool_holder.clamped import bending_at_rest
from rcsa_ident.toolpath.blending import FirstOrderLag, QuadraticBlend
from rcsa_ident.toolpath.compensation import Place
from rcsa_ident.toolpath.forces import ForceAlongPath, on_all_moves
from rcsa_ident.toolpath.path import RAPID, ToolPath
from rcsa_ident.workflows.paths.robot import IdealForce, Mirror, RobotPath, compensate
from rcsa_ident.workflows.paths.robot_compensation import ahead_of_forces as at_rest_ahead
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import robot

POSTURE = np.radians([0.0, 20.0, 30.0, 10.0, -40.0, 0.0])
FEED = 0.05
#: Along the two sides of the published corner [N].
SLOT = np.array([[-130.0, 58.0, 24.0], [108.0, 59.0, 39.0]])
BLEND = QuadraticBlend.leaving(1.6e-3, np.hypot(FEED, FEED))


@pytest.fixture(scope="module")
def assembly():
    return read_tooling(TOOLINGS / "S3-PG25-long.toml").assembly


def arm(play=True):
    model = robot("kr210")
    return FlexibleRobot(model if play else replace(model, joints=tuple(replace(j, backlash=0.0) for j in model.joints)))


def corner(assembly, side=0.1, step=2e-3):
    """A right angle in the plane across the tool, from where it is at the posture, in short moves."""
    tool = tool_point_at(robot("kr210"), POSTURE)
    axis = -tool.turn[:, 2]
    first = tool.turn[:, 0]
    second = np.cross(axis, first)
    tip = tool.offset - (assembly.stickout + assembly.holder_length) * axis
    places = np.array([tip, tip + side * first, tip + side * (first + second)])
    return ToolPath(places, axes=np.tile(axis, (3, 1)), feed=np.full(3, FEED)).resampled(step)


def slot(path):
    """The published forces, one after the other."""
    middle = 0.5 * path.times[-1]
    instants = np.array([0.0, middle - 1e-3, middle + 1e-3, path.times[-1]])
    return ForceAlongPath(instants, SLOT[[0, 0, 1, 1]]).low_passed()


def task_of(assembly, play=True, controller=BLEND, **further):
    path = corner(assembly)
    return RobotPath(arm(play), POSTURE, assembly, path, slot(path), controller, **further)


@pytest.mark.parametrize("method", [IdealForce(), Mirror()], ids=["ideal force", "mirror"])
@pytest.mark.parametrize("controller", [BLEND, FirstOrderLag(1.6e-3 / (0.509 * FEED))], ids=["blend", "lag"])
@pytest.mark.parametrize("play", [False, True], ids=["tight", "play"])
def test_straight_moves_are_put_right_and_the_corner_is_left(assembly, method, controller, play):
    """The published experiment: 0.36 mm to 0.15 mm on straight moves, the corner's 1.7 mm left to the controller."""
    task = task_of(assembly, play, controller)
    # whoever compensates knows each spring within a tenth
    model = task.robot.model
    stiffness = model.chain().stiffness
    others = [
        FlexibleRobot(model.with_springs(stiffness * np.random.default_rng(seed).uniform(0.9, 1.1, stiffness.size))) for seed in (1, 2)
    ]
    found = compensate(task, method, arms=others)
    assert 0.1e-3 < found.before.rms < 0.4e-3
    # what is left in the corner is the controller's own, with what gives way added to it before
    assert 1.3e-3 < found.controller.corner < 1.7e-3
    assert found.controller.rms < 5e-6
    assert 0.1e-3 < abs(found.before.corner - found.controller.corner) < 0.5e-3
    assert abs(found.after.corner - found.controller.corner) < 0.2 * found.controller.corner
    for left in (found.after, *found.draws):
        assert left.rms < 0.42 * found.before.rms
    # an exact model leaves next to nothing but beside the corner
    assert np.median(np.linalg.norm(found.after.across[found.after.straight], axis=1)) < 0.03 * found.before.rms
    assert set(found.became) == {Place.CORRECTED}
    assert found.limited == ()


def test_at_rest_it_is_the_static_method(assembly):
    """A slow straight move under a steady force: what is commanded is what the static method commands."""
    path = corner(assembly)
    slow = ToolPath(path.places[:5], axes=path.axes[:5], feed=np.full(5, 1e-3))
    force = on_all_moves(slow, SLOT[0])
    task = RobotPath(arm(play=False), POSTURE, assembly, slow, force, QuadraticBlend(0.2), weight=False, step=5e-3)
    found = compensate(task, IdealForce())
    pushed = np.concatenate([SLOT[0], np.zeros(3)])
    # the static method has its force where the tool-holder sits: the tool's lever is a moment there
    length = assembly.stickout + assembly.holder_length
    tool = tool_point_at(task.robot.model, task.postures[2])
    pushed[3:] = np.cross(length * tool.turn[:, 2], SLOT[0])
    commanded = at_rest_ahead(task.robot, task.postures[2:3], pushed[None])[0]
    np.testing.assert_allclose(task.arm.tip(commanded), found.path.places[2] + task.bent(task.stretches[0])[2], atol=2e-6)
    # the tool's direction is not commanded: what that leaves is of second order
    assert found.after.rms < 0.1e-6
    assert compensate(task, Mirror(2)).after.rms < 0.05e-6


def test_an_arm_at_rest_sinks_by_what_its_weight_asks(assembly):
    reach = assembly.stickout + assembly.holder_length
    model = robot("kr210")
    heavy = ArmUnderForce(arm(play=False), reach)
    rest = heavy.at_rest(POSTURE, SLOT[0])
    still = np.zeros(model.freedoms())
    gap = heavy.asked(rest, still, still, SLOT[0]) + model.chain().stiffness * (rest - model.chain().angles(POSTURE))
    np.testing.assert_allclose(gap, 0.0, atol=1e-6)
    # a control that takes the weight out leaves what tilts
    held = replace(model, joints=tuple(replace(j, gravity_compensated=True) for j in model.joints))
    taken = ArmUnderForce(FlexibleRobot(held), reach)
    sunk, left = (np.linalg.norm(each.tip(each.at_rest(POSTURE, np.zeros(3))) - each.tip(POSTURE)) for each in (heavy, taken))
    assert 1e-3 < sunk < 3e-3
    assert 0.1 * sunk < left < 0.9 * sunk
    light = ArmUnderForce(arm(play=False), reach, weight=False)
    np.testing.assert_allclose(light.at_rest(POSTURE, np.zeros(3))[model.chain().driven], POSTURE, atol=1e-15)


def test_the_weight_holds_the_play_of_joints_that_it_loads(assembly):
    """Axes 2 and 3 carry more than the slot asks: their play adds nothing while the arm has its weight."""
    force = SLOT[0]
    reach = assembly.stickout + assembly.holder_length

    def moved(weight, play):
        own = ArmUnderForce(arm(play), reach, weight)
        driven = own.robot.model.chain().driven
        return (own.at_rest(POSTURE, force) - own.at_rest(POSTURE, np.zeros(3)))[driven[1:3]]

    np.testing.assert_allclose(moved(True, True), moved(True, False), atol=1e-8)
    assert np.all(np.abs(moved(False, True) - moved(False, False)) > 2e-5)


def test_rapid_moves_are_neither_marched_through_nor_corrected(assembly):
    path = corner(assembly)
    up = 0.02 * path.axes[:1]
    places = np.concatenate([path.places[:1] + up, path.places, path.places[-1:] + up, path.places[:1] + up, path.places[:3]])
    axes = np.tile(path.axes[0], (len(places), 1))
    feed = np.concatenate([[np.nan, RAPID], np.full(len(path) - 1, FEED), [RAPID] * 3, [FEED] * 2])
    whole = ToolPath(places, axes=axes, feed=feed)
    task = RobotPath(arm(False), POSTURE, assembly, whole, on_all_moves(whole, SLOT[0]), BLEND)
    assert [(s.start, s.stop) for s in task.stretches] == [(1, 1 + len(path)), (3 + len(path), 6 + len(path))]
    found = compensate(task, IdealForce())
    rapid = [k for k, each in enumerate(found.became) if each is Place.RAPID]
    assert rapid == [0, 1 + len(path), 2 + len(path)]
    np.testing.assert_array_equal(found.correction[rapid], 0.0)
    assert np.linalg.norm(found.correction[1]) > 1e-4
    assert found.limited == ()


def test_what_ends_a_correction_is_told_place_by_place(assembly):
    task = task_of(assembly, play=False)
    found = compensate(task, IdealForce(), largest=0.1e-3)
    assert np.linalg.norm(found.correction, axis=1).max() <= 0.1e-3 * (1.0 + 1e-12)
    assert {found.became[k] for k in found.limited} == {Place.SATURATED}
    assert len(found.limited) > 80
    # a joint whose range ends where the path ends has none left for the correction
    turned = task.postures[:, 0]
    low, high = turned.min(), turned.max()
    edge = tuple(replace(j, limits=(low - 1e-9, high + 1e-9)) if k == 0 else j for k, j in enumerate(task.robot.model.joints))
    tight = RobotPath(FlexibleRobot(replace(task.robot.model, joints=edge)), POSTURE, assembly, task.path, task.force, BLEND)
    found = compensate(tight, IdealForce())
    beyond = [k for k, each in enumerate(found.became) if each is Place.JOINT_RANGE]
    assert 0 < len(beyond) < len(found.became)
    assert found.limited == tuple(beyond)
    np.testing.assert_array_equal(found.correction[beyond], 0.0)
    np.testing.assert_allclose(found.postures[beyond], tight.postures[beyond])
    _, became = task.sent_to(task.path.places + np.array([5.0, 0.0, 0.0]))
    assert set(became) == {Place.OUT_OF_REACH}


def test_what_cannot_be_is_refused(assembly):
    task = task_of(assembly)
    with pytest.raises(InputError, match="step"):
        replace(task, step=0.0)
    with pytest.raises(InputError, match="largest"):
        compensate(task, IdealForce(), largest=-1.0)
    with pytest.raises(InputError, match="one or more at a feed"):
        replace(task, path=ToolPath(task.path.places, axes=task.path.axes, feed=np.full(len(task.path), RAPID)))
    with pytest.raises(InputError, match="feed"):
        replace(task, path=ToolPath(task.path.places, axes=task.path.axes))
    with pytest.raises(InputError, match="without a rapid move"):
        compensate(replace(task, step=1e-6), IdealForce())
    with pytest.raises(InputError, match="places"):
        replace(task, path=task.path.resampled(1e-6))


def test_an_arm_without_masses_is_at_rest_at_each_place(assembly):
    """As the weightless arm that moves slowly."""
    model = arm(play=False).model
    bare = FlexibleRobot(replace(model, joints=tuple(replace(j, body=j.body.times(0.0)) for j in model.joints)))
    with pytest.raises(InputError, match="masses"):
        ArmUnderForce(bare, 0.1).along(np.tile(POSTURE, (3, 1)), np.zeros((3, 3)), 1e-3)
    task = task_of(assembly, play=False, weight=False)
    quick, still = (compensate(each, IdealForce()) for each in (task, replace(task, robot=bare)))
    far = quick.after.straight & (np.abs(task.path.times - 2.0) > 0.6) & (np.abs(task.path.times - 2.0) < 1.6)
    np.testing.assert_allclose(still.before.across[far], quick.before.across[far], atol=3e-6)
    assert still.after.rms < 0.02 * still.before.rms


def test_a_tool_that_bends_moves_its_tip(assembly):
    task = task_of(assembly, play=False, weight=False)
    stretch = task.stretches[0]
    bent = task.bent(stretch)
    axis = task.path.axes[0]
    np.testing.assert_allclose(bent @ axis, 0.0, atol=1e-18)
    across = SLOT[0] - axis * (axis @ SLOT[0])
    np.testing.assert_allclose(bent[5], bending_at_rest(assembly) * across, rtol=1e-6)
