"""ROBOT.toml there and back, and what is said of one that cannot be."""

import copy

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.robots import read_robot, robot_keys, robot_of, turn_of
from rcsa_ident.io.toml_text import keys_of_toml, read_toml, toml_of
from rcsa_ident.machine.robot.flexible import FlexibleRobot, modes_of
from rcsa_ident.machine.robot.kinematics import flange_at
from tests.fixtures.robots import ROBOTS, TABLE_7, robot


@pytest.fixture
def keys():
    return copy.deepcopy(read_toml(ROBOTS / "tx200.toml", "robot"))


@pytest.mark.parametrize("name", ["tx200", "kr210", "kr500"])
def test_there_and_back(name):
    arm = robot(name)
    again = robot_of(keys_of_toml(toml_of(robot_keys(arm)), "robot"), "again")
    assert robot_keys(again) == robot_keys(arm)
    rng = np.random.default_rng(1)
    for angles in rng.uniform(-3.0, 3.0, (5, 6)):
        np.testing.assert_allclose(flange_at(again, angles).offset, flange_at(arm, angles).offset, atol=1e-14)
    if arm.weighed:
        np.testing.assert_allclose(modes_of(FlexibleRobot(again).at(TABLE_7))[0], modes_of(FlexibleRobot(arm).at(TABLE_7))[0], rtol=1e-10)


def test_masses_as_printed():
    assert robot("tx200").mass == pytest.approx(1045.0)
    assert robot("kr210").mass == pytest.approx(1233.3, abs=0.05)
    assert not robot("kr500").weighed


def test_bodies_that_cannot_be_are_told():
    """As published: less inertia than a solid ball of steel of the same mass."""
    said = robot("tx200").warnings
    assert [text.split(":")[0] for text in said] == ["link behind J3", "link behind J5", "payload"]
    assert "1.54 kg m², a solid ball of steel of its 99 kg has 2.48" in said[0]


def test_moments_that_exceed_the_sum_of_the_others_are_told(keys):
    keys["joints"][1]["link"]["inertia_kg_m2"] = [36.0, 1.0, 6.0, 0.0, 0.0, 0.0]
    assert any(
        "link behind J2: no body has the principal moments of inertia 1, 6, 36 kg m²" in text for text in robot_of(keys, "f").warnings
    )


def test_turns_are_roll_pitch_yaw():
    np.testing.assert_array_equal(turn_of(np.radians([90.0, 0.0, 0.0])), [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    # about x first, then about the z that stands still
    np.testing.assert_array_equal(turn_of(np.radians([90.0, 0.0, 90.0])), [[0, 0, 1], [1, 0, 0], [0, 1, 0]])


def test_a_turn_on_end_comes_back(keys):
    keys["joints"][2]["turn_deg"] = [30.0, 90.0, 0.0]
    arm = robot_of(keys, "f")
    again = robot_of(robot_keys(arm), "f")
    np.testing.assert_allclose(again.joints[2].frame.turn, arm.joints[2].frame.turn, atol=1e-14)


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (("joints", 0, "stiffness_nm_per_rad"), -1.0, "joints[0].stiffness_nm_per_rad"),
        (("joints", 0, "stiffness_nm_per_rad"), 2.03e13, "joints[0].stiffness_nm_per_rad"),
        (("joints", 0, "axis"), [0.0, 0.0, 0.0], "joints[0].axis"),
        (("joints", 0, "axis"), [0.0, 1.0], "joints[0].axis: found a list of 2"),
        (("joints", 1, "limits_deg"), [120.0, -115.0], "joints[1].limits_deg"),
        (("joints", 1, "stifness_nm_per_rad"), 1.0, "did you mean stiffness_nm_per_rad"),
        (("joints", 2, "link", "mass_kg"), -3.0, "joints[2].link.mass_kg"),
        (("joints", 2, "link", "inertia_kg_m2"), [1.0, 2.0, 3.0], "joints[2].link.inertia_kg_m2"),
        (("joints", 3, "tilts", 0, "stiffness_nm_per_rad"), "stiff", "joints[3].tilts[0].stiffness_nm_per_rad"),
        (("joints", 4, "backlash_rad"), 15.0, "joints[4].backlash_rad"),
        (("robot", "gravity_m_per_s2"), [0.0, "down", 1.0], "robot.gravity_m_per_s2"),
        (("robot", "name"), "", "robot.name"),
        (("joints",), [], "joints"),
        (("payload", "weight_kg"), 3.0, "payload.weight_kg"),
    ],
)
def test_what_is_wrong_is_named(keys, place, value, message):
    here = keys
    for key in place[:-1]:
        here = here[key]
    here[place[-1]] = value
    with pytest.raises(InputError) as told:
        robot_of(keys, "arm.toml")
    assert message in str(told.value)
    assert "arm.toml" in str(told.value)


def test_lengths_in_metres_are_noticed(keys):
    for joint in keys["joints"]:
        joint["offset_mm"] = [1e-3 * v for v in joint["offset_mm"]]
    with pytest.raises(InputError, match="are these millimetres"):
        robot_of(keys, "arm.toml")


def test_a_file_that_is_not_there():
    with pytest.raises(InputError, match="existing file"):
        read_robot("nowhere.toml")
