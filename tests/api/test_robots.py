"""Robots over REST: kept by their names, and at a posture and along a path what the library says of them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from api.schemas.robot_queries import MapQuery, PathQuery, PostureQuery
from api.schemas.robots import EXAMPLE, RobotKeys
from api.work.robots import MOST_LIMITS, MOST_PLACES, posed, posed_text, robot_from
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz
from rcsa_ident.io.curves.tips import read_frf_csv
from rcsa_ident.io.settings.robots import robot_keys
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from tests.api.in_process import BOTH, refused
from tests.fixtures import by_hand
from tests.fixtures.robots import ROBOTS, TABLE_7, robot
from tests.fixtures.service import example

TEXT = (ROBOTS / "tx200.toml").read_text(encoding="utf-8")
POSTURE = np.degrees(TABLE_7).tolist()
NEAR = [-11.71, 20.78, 110.0, 82.76, 60.80, -166.96]
CUT = {"immersion": 0.5, "ktc_mpa": 660.0, "krc": 0.38}
SPEEDS = {"from_rpm": 6000, "to_rpm": 12000, "step_rpm": 500}


@pytest.fixture
def tx200(client):
    client.write_robot("tx200", TEXT)
    return {"robot": "tx200", "posture_deg": POSTURE}


@BOTH
def test_a_robot_is_kept_listed_and_forgotten(client):
    made = client.write_robot("tx200", TEXT)
    assert client.robot_file("tx200") == TEXT
    assert client.robot("tx200") == made
    client.write_robot("two axes", EXAMPLE, why="to try it")
    second, first = client.robots()
    assert (first.name, first.label, first.joints, first.degrees_of_freedom) == ("tx200", "Stäubli TX200", 6, 18)
    assert first.mass_kg == pytest.approx(1045.0)
    assert (second.name, second.joints, second.warnings) == ("two axes", 2, [])
    assert client.send("GET", "/robots/tx200", headers={"If-None-Match": f'"{made.etag}"'}).status_code == 304
    refused(412, client.write_robot, "tx200", EXAMPLE, seen="x")
    changed = client.write_robot("tx200", EXAMPLE, seen=made.etag)
    assert changed.robot.robot.name == "two axes"
    assert client.usage().database.kinds["robots"] > 0
    refused(412, client.forget_robot, "tx200", seen=made.etag)
    client.forget_robot("tx200", seen=changed.etag)
    for call in (client.robot, client.forget_robot):
        refused(404, call, "tx200")
    trail = list(client.changes(kind="robot", name="tx200"))
    assert [each.action for each in trail] == ["deleted", "changed", "made"]
    # and is there again
    version = client.send("GET", "/robots/tx200/versions/1").json()
    assert version["robot"]["robot"]["name"] == "Stäubli TX200"
    assert version["differences"] == []
    assert client.send("POST", "/robots/tx200/versions/1/restore").status_code == 201
    assert client.robot_file("tx200") == TEXT
    again = client.send("GET", "/robots/tx200/versions/2").json()
    assert {"field": "robot.name", "old": "Stäubli TX200", "new": "two axes"} in again["differences"]
    assert refused(409, client.send, "POST", "/robots/tx200/versions/1/restore").detail.startswith("there is nothing to restore")


def test_the_keys_of_a_file_are_those_of_the_schema():
    for name in ("tx200", "kr210", "kr500"):
        keys = robot_keys(robot(name))
        kept = RobotKeys.model_validate_json(json.dumps(keys)).model_dump(exclude_unset=True, exclude_none=True)
        assert kept == keys


@pytest.mark.parametrize("model", [RobotKeys, PostureQuery, PathQuery, MapQuery])
def test_examples_are_what_they_show(model):
    for shown in model.model_json_schema()["examples"]:
        model.model_validate_json(json.dumps(shown))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"joints": []}, "joints"),
        ({"robot": {"name": ""}}, "robot.name"),
        ({"joints": [{**EXAMPLE["joints"][0], "axis": [0.0, 0.0, 0.0]}]}, "joints[0].axis"),
        ({"joints": [{**EXAMPLE["joints"][0], "stiffness_nm_per_rad": -1.0}]}, "joints[0].stiffness_nm_per_rad"),
        ({"joints": [{**EXAMPLE["joints"][0], "further": 1}]}, "joints.0.further"),
        ({"joints": [EXAMPLE["joints"][0]] * 13}, "joints"),
        ({"flange": {"offset_mm": [1.0, 2.0]}}, "flange.offset_mm"),
    ],
)
def test_what_is_no_robot_is_refused_by_its_field(client, change, field):
    problem = refused(422, client.write_robot, "R", {**EXAMPLE, **change})
    assert problem.errors[0].field == field


def test_masses_of_which_no_arm_is_made_are_refused(client):
    link = {"mass_kg": 1.0, "inertia_kg_m2": [-5.0, -5.0, -5.0, 0.0, 0.0, 0.0]}
    broken = {**EXAMPLE, "joints": [{**each, "link": link} for each in EXAMPLE["joints"]]}
    assert refused(422, client.write_robot, "R", broken).errors[0].field == "robot"
    huge = {
        **EXAMPLE,
        "joints": [{**each, "link": {"mass_kg": 1e300, "center_of_mass_mm": [1e300, 0.0, 0.0]}} for each in EXAMPLE["joints"]],
    }
    assert refused(422, client.write_robot, "R", huge).errors[0].field == "robot"


def test_toml_names_line_and_size_is_bounded(client):
    assert "line 1" in refused(422, client.write_robot, "R", "[robot").detail
    refused(413, client.write_robot, "R", TEXT + "#" * 100_000)
    joint = robot_keys(robot("tx200"))["joints"][0]
    with pytest.raises(InputError, match="tilts of J1: found 5"):
        robot_from({"robot": {"name": "x"}, "joints": [{**joint, "tilts": joint["tilts"][:1] * 5}]})


def test_a_posture_is_what_the_library_says(client, tx200):
    client.write_tooling("T1", by_hand.TOOLING)
    found = client.posture(tx200, tooling="T1")
    assert (found.name, found.degrees_of_freedom) == ("Stäubli TX200", 18)
    np.testing.assert_allclose(found.natural_frequencies_hz[:3], [11.754, 13.651, 22.228], rtol=1e-4)
    np.testing.assert_allclose(1e6 * np.diag(found.tcp_compliance_m_per_n), [1.908, 1.821, 0.737], atol=6e-4)
    np.testing.assert_allclose(found.tcp_m, [0.79399, 0.18472, 0.31632], atol=5e-6)
    assert len(found.postures_deg) == 8
    assert any("J3 stands at" in each for each in found.warnings)
    assert [joint.name for joint in found.drawing.joints] == ["J1", "J2", "J3", "J4", "J5", "J6"]
    assert {part.kind for part in found.drawing.parts} == {"base", "limb", "joint", "spindle", "tool"}
    bare = client.posture(tx200, drawing=False)
    assert bare.drawing is None
    six = client.posture({**tx200, "joints_only": True})
    assert six.natural_frequencies_hz[0] == pytest.approx(15.768, rel=1e-4)
    # without masses
    still = client.posture({"robot": robot_keys(robot("kr500")), "posture_deg": [0.0] * 6})
    assert (still.mass_kg, still.natural_frequencies_hz) == (None, [])


@pytest.mark.parametrize("posture", [[0.0] * 5, [0.0] * 7])
def test_a_posture_has_an_angle_for_each_joint(client, tx200, posture):
    problem = refused(422, client.posture, {**tx200, "posture_deg": posture})
    assert problem.errors[0].field == "posture_deg"
    assert "6 angles" in problem.errors[0].allowed
    assert refused(404, client.posture, {**tx200, "robot": "none"}).detail == "there is no such robot none"


def test_a_tip_on_a_robot_is_the_library_s(client, tx200, tmp_path):
    path = tmp_path / "FRF.csv"
    asked = {"from_hz": 5.0, "to_hz": 2000.0, "step_hz": 0.5}
    path.write_text(client.tooltip_file(tx200, example(), **asked), encoding="utf-8")
    found = read_frf_csv(path)
    machine = PosedRobot(FlexibleRobot(robot("tx200")), TABLE_7)
    expected = machine.tip(tooling_of(example(), "", "tooling"), from_hz(found.frequency), directions=machine.translations)
    for name in ("X", "Y", "Z"):
        np.testing.assert_allclose(found.values[name], expected.between(f"tip.{name.lower()}", f"tip.{name.lower()}"), rtol=1e-9)
    np.testing.assert_allclose(found.bands["XY_re"], expected.between("tip.x", "tip.y").real, rtol=1e-8, atol=1e-20)
    told = client.tooltip(tx200, example(), **asked)
    assert set(told.axes) == {"X", "Y", "Z"}
    assert "XY" in told.cross
    assert any("J3 stands at" in each for each in told.warnings)


def test_lobes_on_a_robot_follow_its_posture(client, tx200):
    client.write_tooling("T1", by_hand.TOOLING)
    here = client.lobes(tx200, "T1", cut=CUT, speeds=SPEEDS, bands=False, recommend=False)
    assert here.machine == "tx200"
    other = client.lobes({**tx200, "posture_deg": NEAR}, "T1", cut=CUT, speeds=SPEEDS, bands=False, recommend=False)
    one, two = here.toolings[0], other.toolings[0]
    assert one.spindle_speed_rpm == two.spindle_speed_rpm
    assert one.limit_depth_mm != two.limit_depth_mm
    # given as it is the same robot answers the same
    inline = client.lobes({**tx200, "robot": robot_keys(robot("tx200"))}, "T1", cut=CUT, speeds=SPEEDS, bands=False, recommend=False)
    assert inline.machine == "Stäubli TX200"
    np.testing.assert_allclose(np.array(inline.toolings[0].limit_depth_mm, float), np.array(one.limit_depth_mm, float), rtol=1e-9)
    assert client.advice(tx200, "T1", cut={**CUT, "feed_per_tooth_mm": 0.05}, speeds=SPEEDS).toolings[0].highest_removal
    assert refused(422, client.lobes, tx200, "T1", speeds=SPEEDS).errors[0].field.startswith("cut")


def test_one_of_machine_and_robot_is_asked_for(client, tx200, shop):
    _, machine = shop
    for body in ({}, {"machine": machine, "robot": tx200}):
        problem = refused(422, client.send, "POST", "/lobes", json={**body, "toolings": ["T1"], "speeds": SPEEDS})
        assert problem.errors[0].field == "machine"
        assert problem.errors[0].allowed.startswith("a machine, or a robot at a posture")


def test_a_map_has_a_limit_at_each_place(client, tx200):
    client.write_tooling("T1", by_hand.TOOLING)
    near = {**tx200, "posture_deg": NEAR}
    path = [[900.0 + 100.0 * k, -300.0 + 150.0 * k, 500.0] for k in range(4)]
    postures = client.along_path(near, "T1", path).postures_deg
    found = client.limit_map(near, "T1", path, cut=CUT, speeds=SPEEDS)
    assert found.postures_deg == postures
    assert np.shape(found.limit_depth_mm) == np.shape(found.chatter_frequency_hz) == (4, 13)
    # at each place the lobes of the posture there
    for posture, row in zip(postures, found.limit_depth_mm, strict=True):
        alone = client.lobes({**tx200, "posture_deg": posture}, "T1", cut=CUT, speeds=SPEEDS, bands=False, recommend=False).toolings[0]
        np.testing.assert_allclose(np.array(row, float), np.array(alone.limit_depth_mm, float), rtol=1e-9)
    worst = np.min([[np.inf if v is None else v for v in row] for row in found.limit_depth_mm], axis=0)
    assert found.limit_everywhere_mm == pytest.approx(worst.max())
    assert found.best_speed_rpm == found.spindle_speed_rpm[int(np.argmax(worst))]
    # told as axes, too
    upright = [[*row, 0.0, 0.0, 2.0] for row in path]
    np.testing.assert_allclose(client.along_path(near, "T1", upright).postures_deg, postures, atol=1e-9)


def test_what_no_robot_follows_is_refused_by_its_place(client, tx200):
    near = {**tx200, "posture_deg": NEAR}
    far = refused(422, client.along_path, near, example(), [[1000, 0, 500], [9000, 0, 500]])
    assert far.errors[0].field == "place 2 of the path"
    mixed = refused(422, client.along_path, near, example(), [[1000, 0, 500], [1000, 0, 500, 0, 0, 1]])
    assert mixed.errors[0].field == "places"
    none = refused(422, client.along_path, near, example(), [[1000, 0, 500, 0, 0, 0]])
    assert "row 1" in none.errors[0].found
    other = {"robot": EXAMPLE, "posture_deg": [0.0, 45.0]}
    assert refused(422, client.along_path, other, example(), [[1000, 0, 500]]).errors[0].field == "robot"
    assert refused(422, client.along_path, near, example(), [[1000, 0, 500]] * (MOST_PLACES + 1)).errors[0].field == "places"
    dear = {"cut": CUT, "speeds": {"from_rpm": 4000, "to_rpm": 20000, "step_rpm": 10}}
    assert str(MOST_LIMITS) in refused(422, client.limit_map, near, example(), [[1000, 0, 500]] * 100, **dear).errors[0].allowed
    slow = {"cut": CUT, "speeds": SPEEDS, "method": "semi-discretisation"}
    assert "s of work" in refused(422, client.limit_map, near, example(), [[1000, 0, 500]] * 300, **slow).errors[0].found


def test_a_path_file_is_read_as_the_commands_read_it(client):
    found = client.path_of("x_mm;y_mm;z_mm;i;j;k\n900,5;0;500;0;0;2\n")
    assert found.places == [[900.5, 0.0, 500.0, 0.0, 0.0, 1.0]]
    assert client.path_of("x_mm,y_mm,z_mm\n1,2,3\n").places == [[1.0, 2.0, 3.0, 0.0, 0.0, 1.0]]
    for text, field in (
        ("x_mm,y_mm\n1,2\n", "column z_mm"),
        ("x_mm,y_mm,z_mm\n1,2,x\n", "line 2, column z_mm"),
        ("x_mm,y_mm,z_mm\n", "path"),
    ):
        assert refused(422, client.path_of, text).errors[0].field == field
    many = "x_mm,y_mm,z_mm\n" + "1,2,3\n" * (MOST_PLACES + 1)
    assert refused(422, client.path_of, many).errors[0].allowed == f"at most {MOST_PLACES}"
    refused(413, client.path_of, "x" * 1_000_001)


def test_keys_guard_robots_and_groups_see_their_own(guarded_http):
    http, keys = guarded_http

    def send(method, path, key, **further):
        return http.request(method, f"/v1{path}", headers={"X-API-Key": keys[key], **further.pop("headers", {})}, **further).status_code

    toml = {"content": TEXT.encode(), "headers": {"Content-Type": "application/toml"}}
    assert send("PUT", "/robots/cell", "read", **toml) == 403
    assert send("PUT", "/robots/cell", "upload", **toml) == 201
    assert send("GET", "/robots/cell", "read") == 200
    body = {"robot": {"robot": "cell", "posture_deg": POSTURE}}
    assert send("POST", "/robots/posture", "read", json=body) == 403
    assert send("POST", "/robots/posture", "run", json=body) == 200
    assert send("GET", "/robots/cell", "other") == 404
    assert send("POST", "/robots/posture", "other", json=body) == 404


def test_published_robots_are_examples_and_stand_in_queries(client, tmp_path):
    published = client.posture({"robot": "tx200", "posture_deg": POSTURE})
    assert published.name == "Stäubli TX200"
    # one that is kept under that name comes before it
    client.write_robot("tx200", TEXT.replace("Stäubli TX200", "our own"))
    assert client.posture({"robot": "tx200", "posture_deg": POSTURE}).name == "our own"
    client.forget_robot("tx200")
    listed = {each.name: each for each in client.examples()}
    for name in ("tx200.toml", "kr210.toml", "kr500.toml"):
        assert listed[name].about.startswith("A robot")
        client.example(name, tmp_path / name)
        assert (tmp_path / name).read_text(encoding="utf-8") == (ROBOTS / name).read_text(encoding="utf-8")
        assert listed[name].size_bytes == (tmp_path / name).stat().st_size
        client.write_robot(name.removesuffix(".toml"), (tmp_path / name).read_text(encoding="utf-8"))


def test_a_robot_crosses_processes_as_text():
    keys = robot_keys(robot("tx200"))
    machine = posed(posed_text(keys, POSTURE, True))
    expected = PosedRobot(FlexibleRobot(robot("tx200"), tilts=False), TABLE_7)
    omega = from_hz(np.linspace(5.0, 500.0, 20))
    tool = tooling_of(example(), "", "tooling")
    np.testing.assert_allclose(machine.tip(tool, omega).values, expected.tip(tool, omega).values, rtol=1e-9)
    assert replace(machine, turn=0.0).remarks == expected.remarks
