"""URDF: kinematics and masses come as they are written, and what cannot be an arm is refused by the name of its element."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.robots import read_robot, robot_keys, turn_of
from rcsa_ident.io.settings.urdf import read_urdf
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.machine.robot.flexible import FlexibleRobot, modes_of
from rcsa_ident.machine.robot.inertia import gravity_torques, mass_matrix
from rcsa_ident.machine.robot.kinematics import flange_at, posed
from rcsa_ident.machine.robot.model import Body, Frame
from tests.fixtures.robots import BENT, TABLE_7, robot
from tests.io.urdf_files import joint, link, urdf, urdf_of

ROD = Body(10.0, np.array([0.0, 0.0, 0.25]), np.diag([0.3, 0.3, 0.02]))
UP = Frame(offset=np.array([0.0, 0.0, 0.5]))
RING = (link("x"), link("y"), joint("r", "fixed", "x", "y"), joint("s", "fixed", "y", "x"))
TURNED = turn_of(np.array([0.4, -0.7, 1.9]))


def read(tmp_path, text, *arguments, **named):
    path = tmp_path / "ARM.urdf"
    path.write_text(text)
    return read_urdf(path, *(arguments or ([1e6],)), **named)


def two_links(*more, first="revolute", second="continuous", limits=(-1.0, 2.0), name="arm"):
    return urdf(
        link("base"), link("one", ROD), link("two", ROD),
        joint("A", first, "base", "one", UP, [0.0, 0.0, 2.0], limits),
        joint("B", second, "one", "two", UP, [0.0, 1.0, 0.0]),
        *more, name=name,
    )  # fmt: skip


@pytest.mark.parametrize(("name", "angles"), [("tx200", TABLE_7), ("kr210", BENT)])
def test_a_published_arm_comes_back(tmp_path, name, angles):
    arm = robot(name)
    stiffness = [j.stiffness for j in arm.joints]
    found, notes = read(tmp_path, urdf_of(arm, TURNED), stiffness, [j.damping for j in arm.joints])
    one, other = flange_at(arm, angles), flange_at(found, angles)
    np.testing.assert_allclose(other.offset, one.offset, atol=1e-12)
    np.testing.assert_allclose(other.turn, one.turn, atol=1e-12)
    expected, told = arm.chain(tilts=False), found.chain(tilts=False)
    for field in ("turn", "offset", "axis", "mass", "centre", "inertia", "stiffness", "damping"):
        np.testing.assert_allclose(getattr(told, field), getattr(expected, field), rtol=1e-12, atol=1e-12, err_msg=field)
    assert found.mass == pytest.approx(arm.mass, rel=1e-12)
    assert [j.name for j in found.joints] == [j.name for j in arm.joints]
    np.testing.assert_allclose([j.limits for j in found.joints], [j.limits for j in arm.joints], rtol=1e-12)
    np.testing.assert_allclose(gravity_torques(found, angles), gravity_torques(arm, angles, tilts=False), atol=1e-9)
    matrices = [mass_matrix(posed(each, angles)) for each in (found, arm)]
    np.testing.assert_allclose(*matrices, rtol=0.0, atol=1e-12 * np.max(matrices[1]))
    omega = [modes_of(FlexibleRobot(each, tilts=False).at(angles))[0] for each in (found, replace(arm, tool_point=Frame()))]
    np.testing.assert_allclose(*omega, rtol=1e-12)
    # what is said of the published masses is said again: nothing else
    assert all("inertia" in note for note in notes)


def test_a_file_of_it_reads_back(tmp_path):
    arm = robot("tx200")
    found, _ = read(tmp_path, urdf_of(arm, TURNED), [1e6])
    path = tmp_path / "ROBOT.toml"
    path.write_text(toml_of(robot_keys(found)))
    again = read_robot(path)
    np.testing.assert_allclose(flange_at(again, TABLE_7).offset, flange_at(arm, TABLE_7).offset, atol=1e-12)
    for field in ("mass", "centre", "inertia"):
        np.testing.assert_allclose(getattr(again.chain(), field), getattr(found.chain(), field), rtol=1e-12, atol=1e-12)


def test_what_is_left_out_has_its_default_and_axes_get_length_one(tmp_path):
    text = urdf(link("base"), link("one", ROD), joint("A", "continuous", "base", "one"))
    arm, notes = read(tmp_path, text)
    (only,) = arm.joints
    np.testing.assert_array_equal(only.axis, [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(only.frame.turn, np.eye(3))
    assert only.limits == (-np.inf, np.inf)
    assert only.damping == 0.0
    two, _ = read(tmp_path, two_links())
    np.testing.assert_array_equal(two.joints[0].axis, [0.0, 0.0, 1.0])
    assert two.joints[0].limits == (-1.0, 2.0)
    assert not notes


def test_an_inertia_off_the_diagonal_keeps_its_sign(tmp_path):
    # two points of 1 kg at (1, 1, 0) and (-1, -1, 0): xy of the tensor is -2
    body = '<link name="one"><inertial><mass value="2"/><inertia ixx="2" iyy="2" izz="4" ixy="-2" ixz="0" iyz="0"/></inertial></link>'
    arm, _ = read(tmp_path, urdf(link("base"), body, joint("A", "continuous", "base", "one")))
    assert arm.joints[0].body.inertia[0, 1] == -2.0
    # seen from axes at 45 degrees about z the points lie at 45 degrees: along the link's y
    turned = body.replace("<mass", '<origin rpy="0 0 0.7853981633974483"/><mass')
    arm, _ = read(tmp_path, urdf(link("base"), turned, joint("A", "continuous", "base", "one")))
    np.testing.assert_allclose(np.diag(arm.joints[0].body.inertia), [4.0, 0.0, 4.0], atol=1e-12)


def test_fixed_joints_hold_bodies_together(tmp_path):
    side = Frame(TURNED, np.array([0.2, 0.0, 0.1]))
    more = (link("box", ROD), link("lid", ROD), joint("f1", "fixed", "one", "box", side), joint("f2", "fixed", "box", "lid", UP))
    arm, notes = read(tmp_path, two_links(*more))
    expected = ROD.beside(ROD.seen_from(side)).beside(ROD.seen_from(side.then(UP)))
    found = arm.joints[0].body
    assert found.mass == 30.0
    np.testing.assert_allclose(found.centre, expected.centre, atol=1e-15)
    np.testing.assert_allclose(found.inertia, expected.inertia, atol=1e-14)
    assert not notes
    # before the first joint and behind the last one: base and flange
    lifted = urdf(
        link("world"), link("base", ROD), link("one", ROD), link("tool0"),
        joint("stand", "fixed", "world", "base", UP), joint("A", "revolute", "base", "one", UP, [0, 0, 1], (-1.0, 1.0)),
        joint("end", "fixed", "one", "tool0", side),
    )  # fmt: skip
    arm, _ = read(tmp_path, lifted)
    np.testing.assert_allclose(arm.joints[0].frame.offset, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(arm.flange.turn, TURNED, atol=1e-12)
    assert arm.base_mass == 10.0


def test_of_branches_one_is_chosen(tmp_path):
    finger = (link("finger", ROD), joint("grip", "prismatic", "two", "finger", UP, [1, 0, 0], (0.0, 0.1)))
    camera = (link("camera"), link("tool0"), joint("c", "fixed", "two", "camera"), joint("t", "fixed", "two", "tool0", UP))
    with pytest.raises(InputError, match='flange: found branches camera, tool0 behind link "two"'):
        read(tmp_path, two_links(*camera))
    arm, notes = read(tmp_path, two_links(*camera, *finger), flange="tool0")
    assert [j.name for j in arm.joints] == ["A", "B"]
    np.testing.assert_allclose(arm.flange.offset, [0.0, 0.0, 0.5])
    assert notes == ("left out with what they carry, since they do not lead to the flange: grip",)
    other = (link("head", ROD), joint("neck", "continuous", "one", "head", UP))
    with pytest.raises(InputError, match='branches B, neck behind link "one"'):
        read(tmp_path, two_links(*other))
    # in the middle of an arm, too
    short, notes = read(tmp_path, two_links(), flange="one")
    assert [j.name for j in short.joints] == ["A"]
    assert "left out" in notes[0]
    with pytest.raises(InputError, match="flange: found tip, allowed is one of base, one, two"):
        read(tmp_path, two_links(), flange="tip")


def test_a_declaration_in_utf_16_is_found(tmp_path):
    """Read as UTF-8 it has a zero behind every sign, which the reader of XML passes over."""
    path = tmp_path / "arm.urdf"
    path.write_bytes('<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"/>'.encode("utf-16-le"))
    with pytest.raises(InputError, match="a document type declaration"):
        read_urdf(path, [1e6])


def test_one_stiffness_for_all_or_one_a_joint(tmp_path):
    arm, _ = read(tmp_path, two_links(), [2e6, 1e6], [5.0])
    assert [j.stiffness for j in arm.joints] == [2e6, 1e6]
    assert [j.damping for j in arm.joints] == [5.0, 5.0]
    with pytest.raises(InputError, match="stiffness: found 3 numbers, allowed is one for all joints, or 2: of A, B"):
        read(tmp_path, two_links(), [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("<robot", r"URDF: found an XML error \(.*line 1"),
        ("<sdf/>", "URDF: found <sdf> as its root, allowed is <robot>"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"/>', "a document type declaration"),
        ('<robot name="a" xmlns:xacro="http://x"><xacro:arm/></robot>', "elements of xacro"),
        ('<robot name="a"/>', "URDF: found no <link>"),
        ('<robot><link name="a"/></robot>', "robot, name: found nothing"),
        (urdf(link("a"), link("a")), 'link "a": found two of them'),
        (urdf(link("a")), "URDF: found no <joint>"),
        (urdf(link("a"), link("b"), joint("j", "fixed", "a", "b")), "joints: found none that turns"),
        (urdf(link("a"), joint("j", "continuous", "a", "b")), 'joint "j", child: found b, allowed is a link of the file'),
        (two_links(first="prismatic"), 'joint "A", type: found prismatic, allowed is revolute, continuous or fixed'),
        (two_links(first="floating"), 'joint "A", type: found floating'),
        (two_links(limits=(1.0, 1.0)), r'joint "A", limit: found 1 to 1 rad'),
        (two_links(limits=None), r'joint "A": found no <limit>'),
        (two_links().replace("0.0 0.0 2.0", "0 0 0"), 'joint "A", axis: found 0 0 0, allowed is a direction'),
        (two_links().replace("0.0 0.0 2.0", "0 0"), 'joint "A", axis, xyz: found 0 0, allowed is three finite numbers'),
        (two_links().replace("0.0 0.0 2.0", "0 nan 1"), 'joint "A", axis, xyz: found 0 nan 1'),
        (two_links().replace('value="10.0"', 'value="heavy"', 1), 'inertial of link "one", mass, value: found heavy'),
        (two_links().replace('value="10.0"', 'value="-1"', 1), 'inertial of link "one", mass: found -1 kg'),
        (two_links().replace(' izz="0.02"', "", 1), 'inertial of link "one", inertia, izz: found nothing'),
        (two_links().replace('<child link="two"/>', ""), 'joint "B": found no <child>'),
        (two_links(joint("C", "continuous", "base", "two")), 'link "two": found behind B and C'),
        (two_links(link("x")), r"links: found 2 without a joint before them \['base', 'x'\]"),
        (two_links(*RING), r"links: found \['x', 'y'\] in a ring"),
        (two_links(link("x"), joint("m", "continuous", "two", "x", UP, [0, 0, 1], None, '<mimic joint="A"/>')), 'joint "m": found a mimic'),
        (two_links().replace("0.0 0.0 0.5", "0 0 500"), "origins of the joints: found 500 m in all, .* are these metres"),
    ],
)  # fmt: skip
def test_what_is_no_arm_is_refused_by_name(tmp_path, text, told):
    with pytest.raises(InputError, match=told) as refused:
        read(tmp_path, text)
    assert str(refused.value).startswith(str(tmp_path / "ARM.urdf"))


def test_other_encodings_are_refused(tmp_path):
    path = tmp_path / "ARM.urdf"
    path.write_bytes(two_links().encode("utf-16"))
    with pytest.raises(InputError, match="not UTF-8"):
        read_urdf(path, [1e6])


def test_masses_made_for_pictures_are_told(tmp_path):
    light = Body(1.0, np.zeros(3), np.eye(3))
    text = urdf(
        *(link(each, light) for each in ("base", "one", "two", "three")),
        *(joint(n, "continuous", a, b, UP) for n, a, b in (("A", "base", "one"), ("B", "one", "two"), ("C", "two", "three"))),
    )
    _, notes = read(tmp_path, text)
    assert any("link behind A: its mass is spread over 1.22 m about its centre, the whole arm reaches 1 m" in note for note in notes)
    assert any("all links have the same mass of 1 kg" in note for note in notes)
    far = Body(1.0, np.array([30.0, 0.0, 0.0]), 0.01 * np.eye(3))
    _, notes = read(tmp_path, two_links().replace("0.0 0.0 0.25", "30 0 0").replace(link("far", far), ""))
    assert any("its centre of mass lies 30 m from the joint" in note for note in notes)
    _, notes = read(tmp_path, urdf(link("base"), link("one"), joint("A", "continuous", "base", "one")))
    assert notes == ("link behind A: no mass is told",)
