"""Pictures of arms: parts stand where the kinematics put them, the page's geometry says the same, views are what they are called."""

from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.robot.kinematics import flange_at, posed, tool_point_at
from rcsa_ident.machine.robot.model import Frame, Joint, RobotModel
from rcsa_ident.report.robot_drawing import arm_svg
from rcsa_ident.report.robot_view import PartKind, View, arm_geometry, arm_parts, placed, reach_of
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import BENT, KR600, TABLE_7, robot

ARMS = [("tx200", TABLE_7), ("kr210", BENT), ("kr500", KR600)]
SVG = "{http://www.w3.org/2000/svg}"


def tool():
    return read_tooling(TOOLINGS / "S3-PG25-long.toml").assembly


def turned(axis, angle):
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew


@pytest.mark.parametrize(("name", "angles"), ARMS)
def test_limbs_run_from_joint_to_joint_and_the_tool_to_its_tip(name, angles):
    arm, assembly = robot(name), tool()
    parts = placed(arm, arm_parts(arm, assembly), angles)
    chain = posed(arm, angles)
    limbs = [part for part in parts if part.kind is PartKind.LIMB]
    assert [part.carrier for part in limbs] == [1, 2, 3, 4, 5, 6]
    ends = [*chain.origin[1:], flange_at(arm, angles).offset]
    for number, (limb, end) in enumerate(zip(limbs, ends, strict=True)):
        np.testing.assert_allclose(limb.points[-1], end, atol=1e-12)
        if number:
            # the first one begins within its joint's barrel
            np.testing.assert_allclose(limb.points[0], chain.origin[number], atol=1e-12)
    point = tool_point_at(arm, angles)
    tip = point.offset + (assembly.stickout + assembly.holder_length) * point.turn[:, 2]
    tools = [part for part in parts if part.kind is PartKind.TOOL]
    np.testing.assert_allclose(tools[0].points[0], tip, atol=1e-12)
    np.testing.assert_allclose(tools[-1].points[-1], point.offset, atol=1e-12)
    # one behind the other without a gap
    for one, other in pairwise(tools):
        np.testing.assert_allclose(one.points[-1], other.points[0], atol=1e-12)


@pytest.mark.parametrize(("name", "angles"), ARMS)
def test_links_leave_and_arrive_along_the_axes(name, angles):
    arm = robot(name)
    chain = posed(arm, angles)
    for part in placed(arm, arm_parts(arm), angles):
        if part.kind is not PartKind.LIMB or part.carrier in (1, 6) or len(part.points) < 3:
            continue
        arrives = part.points[-1] - part.points[-2]
        leaves = part.points[1] - part.points[0]
        along = [
            abs(step @ axis) / np.linalg.norm(step)
            for step, axis in ((leaves, chain.direction[part.carrier - 1]), (arrives, chain.direction[part.carrier]))
        ]
        assert max(along) > 1.0 - 1e-9


@pytest.mark.parametrize(("name", "angles"), ARMS)
def test_the_geometry_of_a_page_puts_everything_where_the_library_does(name, angles):
    arm, assembly = robot(name), tool()
    told = arm_geometry(arm, assembly)
    # what a page does: one joint after the other
    frames, here = [Frame()], Frame()
    for joint, angle in zip(told["joints"], angles, strict=True):
        turn = np.array(joint["turn"]) @ turned(joint["axis"], angle)
        here = here.then(Frame(turn, np.array(joint["offset_mm"])))
        frames.append(here)
    for found, part in zip(told["parts"], placed(arm, arm_parts(arm, assembly), angles), strict=True):
        frame = frames[found["carrier"]]
        np.testing.assert_allclose(np.array(found["points_mm"]) @ frame.turn.T + frame.offset, 1e3 * part.points, atol=1e-3)
        assert found["radius_mm"] == pytest.approx(1e3 * part.radius, abs=1e-4)
    point = tool_point_at(arm, angles)
    tip = point.offset + (assembly.stickout + assembly.holder_length) * point.turn[:, 2]
    np.testing.assert_allclose(here.point(np.array(told["tip_mm"])), 1e3 * tip, atol=1e-3)
    np.testing.assert_allclose(here.turn @ told["tool_axis"], point.turn[:, 2], atol=1e-9)
    assert [joint["limits_deg"] for joint in told["joints"]] == [
        pytest.approx(np.degrees(j.limits).tolist()) if np.isfinite(j.limits[0]) else None for j in arm.joints
    ]


def test_a_view_is_seen_from_where_its_angles_say():
    seen = View.from_angles(0.0, 0.0).seen(np.array([2.0, 3.0, 5.0]))
    np.testing.assert_allclose(seen, [3.0, 5.0, 2.0], atol=1e-12)
    above = View.from_angles(-90.0, 90.0).seen(np.array([2.0, 3.0, 5.0]))
    np.testing.assert_allclose(above, [2.0, 3.0, 5.0], atol=1e-12)
    axes = View.from_angles(-58.0, 22.0).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_link_between_axes_that_hardly_differ_is_drawn_straight():
    # their common normal is far away
    z = np.array([0.0, 0.0, 1.0])
    leaning = turned([1.0, 0.0, 0.0], 0.01)
    frame = Frame(leaning, np.array([0.5, 0.5, 0.0]))
    arm = RobotModel(
        "two", tuple(Joint(n, f, z, robot("tx200").joints[0].body, 1e6) for n, f in (("A", Frame()), ("B", frame))), Frame(offset=0.3 * z)
    )
    limb = next(part for part in arm_parts(arm) if part.kind is PartKind.LIMB and part.carrier == 1)
    assert len(limb.points) == 2
    assert reach_of(arm) == pytest.approx(0.3 + 0.5 * np.sqrt(2.0))


def test_arms_of_few_joints_and_of_axes_that_cross_are_drawn():
    z, y, body = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), robot("tx200").joints[0].body
    one = RobotModel("one", (Joint("A", Frame(), z, body, 1e6),))
    two = RobotModel("two", (*one.joints, Joint("B", Frame(), y, body, 1e6)), Frame(offset=0.5 * z))
    for arm in (one, two):
        svg = arm_svg(arm, np.full(len(arm.joints), 0.3), tool())
        assert words_of(svg)[0] == arm.name
        assert "nan" not in svg


def words_of(svg):
    return [each.text for each in ElementTree.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.parametrize(("name", "angles"), ARMS)
def test_a_picture_names_everything(name, angles):
    arm = robot(name)
    svg = arm_svg(arm, angles, tool())
    words = words_of(svg)
    assert words[0] == arm.name
    for joint in arm.joints:
        assert words.count(joint.name) == 2
    assert {"x", "y", "z"} <= set(words)
    place = ", ".join(f"{1e3 * v:.1f}" for v in tool_point_at(arm, angles).offset)
    assert f"tool point at {place} mm, base's axes" in words
    # every line lies on the paper
    root = ElementTree.fromstring(svg)
    left, top, width, height = map(float, root.get("viewBox").split())
    for group in root.findall(f"{SVG}g"):
        shift = float(group.get("transform").removeprefix("translate(").split()[0])
        for line in [*group.iter(f"{SVG}polygon"), *group.iter(f"{SVG}polyline")]:
            for pair in line.get("points").split():
                x, y = map(float, pair.split(","))
                assert left <= x + shift <= left + width
                assert top <= y <= top + height


def test_the_side_is_the_one_that_shows_more():
    assert "x to the right, z up" in words_of(arm_svg(robot("tx200"), TABLE_7))
    assert "y to the right, z up" in words_of(arm_svg(robot("kr500"), KR600))


def test_the_scale_is_true():
    root = ElementTree.fromstring(arm_svg(robot("tx200"), TABLE_7))
    bar = next(each for each in root.iter(f"{SVG}polyline") if each.get("class") == "bar")
    xs = [float(pair.split(",")[0]) for pair in bar.get("points").split()]
    assert max(xs) - min(xs) == pytest.approx(500.0, abs=0.02)
    assert any(text.startswith("500 mm") for text in words_of(arm_svg(robot("tx200"), TABLE_7)))


def test_a_path_is_drawn_with_its_ends_and_the_arm_lightly_there():
    path = np.linspace([0.9, -0.3, 0.5], [1.3, 0.3, 0.5], 5001)
    svg = arm_svg(robot("tx200"), TABLE_7, tool(), path, [TABLE_7, 0.9 * TABLE_7])
    words, root = words_of(svg), ElementTree.fromstring(svg)
    assert words.count("begin") == words.count("end") == 2
    assert len([g for g in root.iter(f"{SVG}g") if g.get("class") == "ghost"]) == 4
    drawn = [each for each in root.iter(f"{SVG}polyline") if each.get("class") == "path"]
    assert all(len(each.get("points").split()) <= 2501 for each in drawn)


def test_what_speaks_against_a_posture_is_written_on_it():
    beyond = np.radians([0.0, 130.0, 0.0, 0.0, 0.0, 0.0])
    assert any("J2 stands at 130.00°" in text for text in words_of(arm_svg(robot("tx200"), beyond)))


def test_an_arm_that_hangs_shows_where_weight_pulls_and_strange_names_stay_text():
    arm = replace(robot("tx200"), gravity=np.array([0.0, 0.0, 9.81]), name='<script>"&\x07')
    words = words_of(arm_svg(arm, TABLE_7))
    assert words.count("weight") == 2
    assert words[0] == '<script>"& '
    assert "weight" not in words_of(arm_svg(robot("tx200"), TABLE_7))
