"""path compensate: an arm, an arm that cuts have told, and a machine; paths in and out, and what is refused."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.identification.arm.unknowns import PosedLayout, arm_priors
from rcsa_ident.identification.unknowns import prior_rows
from rcsa_ident.io.paths.gcode import read_gcode
from rcsa_ident.io.paths.tool_paths import read_tool_path
from rcsa_ident.io.settings.robots import robot_keys
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import ROBOTS, robot

KR210, TOOL = ROBOTS / "kr210.toml", TOOLINGS / "S3-PG25-long.toml"
NEAR = ("--posture", "0 20 30 0 40 0")
PROGRAM = """\
G21 G90 S8000 M3
G0 X1700 Y-20 Z900
G0 Z880
G1 X1740 F3000
G1 Y20
G0 Z900
"""


@pytest.fixture
def program(tmp_path):
    path = tmp_path / "PATH.nc"
    path.write_text(PROGRAM)
    return path


def run(*arguments):
    return CliRunner().invoke(app, ["path", "compensate", *map(str, arguments)])


def told(*arguments):
    found = run(*arguments, "--json")
    assert found.exit_code == 0, found.output
    return json.loads(found.stdout)


@pytest.mark.parametrize("method", ["ideal-force", "mirror"])
def test_an_arm_gets_a_program_and_its_joints(program, tmp_path, method):
    out, joints = tmp_path / "OUT.nc", tmp_path / "JOINTS.csv"
    forces = ("--forces", "-58 -130 35", "--method", method, "--blend-ms", 150)
    answer = told(KR210, TOOL, program, *forces, *NEAR, "--out", out, "--joints", joints)
    assert answer["status"] == "compensated"
    assert answer["limited"] == []
    assert answer["after"]["straight_rms_mm"] < 0.42 * answer["before"]["straight_rms_mm"]
    assert answer["before"]["straight_rms_mm"] > 0.2
    assert abs(answer["after"]["corner_mm"] - answer["controller"]["corner_mm"]) < 0.3 * answer["controller"]["corner_mm"]
    assert answer["band"] is None
    path = read_gcode(out)
    assert len(path) == answer["places"]
    # moves at a feed are cut up, rapid ones are not, and all keep their feed and speed
    assert np.sum(~path.cutting) == 2
    assert path.lengths[path.cutting].max() < 1.5e-3
    assert set((6e4 * path.feed[2:-1]).round(6)) == {3000.0}
    rows = list(csv.DictReader(joints.read_text().splitlines()))
    assert len(rows) == len(path)
    assert list(rows[0]) == ["time_s", *(f"q{k}_deg" for k in range(1, 7))]
    assert float(rows[-1]["time_s"]) == pytest.approx(1.6)
    # the same once more, in sentences
    said = run(KR210, TOOL, program, *forces, *NEAR, "--out", out)
    assert said.exit_code == 0
    assert "straight moves, rms" in said.stdout


def test_forces_over_time_stand_at_their_places(program, tmp_path):
    told_path = read_gcode(program)
    times = np.linspace(0.0, told_path.times[-1], 400)
    places = 1e3 * np.stack([np.interp(times, told_path.times[1:4], own) for own in told_path.places[1:4].T], axis=1)
    rows = np.column_stack([times, places, np.tile([-58.0, -130.0, 35.0], (400, 1))])
    header = "time_s,x_mm,y_mm,z_mm,force_x_n,force_y_n,force_z_n"
    file, out = tmp_path / "FORCES.csv", tmp_path / "OUT.csv"
    np.savetxt(file, rows, delimiter=",", header=header, comments="")
    answer = told(KR210, TOOL, program, "--forces", file, *NEAR, "--out", out)
    steady = told(KR210, TOOL, program, "--forces", "-58 -130 35", *NEAR, "--out", tmp_path / "OTHER.csv")
    assert answer["before"] == pytest.approx(steady["before"], rel=1e-6)
    np.testing.assert_allclose(read_tool_path(out).places, read_tool_path(tmp_path / "OTHER.csv").places, atol=1e-9)
    assert answer["warnings"] == steady["warnings"]
    np.savetxt(file, rows[:200], delimiter=",", header=header, comments="")
    short = told(KR210, TOOL, program, "--forces", file, *NEAR, "--out", out)
    assert "the forces end at 0.80 s, the path at 1.60 s" in short["warnings"][0]
    rows[:, 2] += 30.0
    np.savetxt(file, rows, delimiter=",", header=header, comments="")
    wrong = run(KR210, TOOL, program, "--forces", file, *NEAR, "--out", out)
    assert wrong.exit_code == 2
    assert "30.0 mm from the path" in wrong.output


def test_forces_may_turn_with_the_path(program, tmp_path):
    out = tmp_path / "OUT.csv"
    told(KR210, TOOL, program, "--forces", "-100 50 20", "--force-axes", "path", *NEAR, "--out", out)
    assert len(read_tool_path(out)) > 80


def test_a_program_keeps_what_its_machine_needs(tmp_path):
    program, out = tmp_path / "PATH.nc", tmp_path / "OUT.nc"
    program.write_text(PROGRAM.replace("G0 Z880\n", "T3 M6\nG43 H3 Z880\nM8\n") + "M9\nG91 G28 Z0\nM30\n")
    answer = told(KR210, TOOL, program, "--forces", "-58 -130 35", *NEAR, "--out", out)
    lines = out.read_text().splitlines()
    order = [lines.index(each) for each in ("M3 S8000", "M6 T3", "G43 H3", "M8", "M9", "M30")]
    assert order == sorted(order)
    assert any("G53 in line 10:" in each and "at 900 mm" in each for each in answer["warnings"])


def test_an_arm_without_masses_is_taken_at_rest(program, tmp_path):
    light = tmp_path / "LIGHT.toml"
    text = KR210.read_text()
    light.write_text(re.sub(r"\[joints\.link\]\nmass_kg.*\ncenter.*\ninertia.*\n", "", text))
    answer = told(light, TOOL, program, "--forces", "-58 -130 35", *NEAR, "--out", tmp_path / "OUT.nc")
    assert any("no masses" in each for each in answer["warnings"])
    assert answer["after"]["straight_rms_mm"] < 0.1 * answer["before"]["straight_rms_mm"]


def test_what_is_told_of_a_limit(program, tmp_path):
    out = tmp_path / "OUT.nc"
    answer = told(KR210, TOOL, program, "--forces", "-58 -130 35", *NEAR, "--largest-mm", 0.1, "--out", out)
    assert answer["status"] == "limited"
    assert answer["largest_correction_mm"] == pytest.approx(0.1)
    assert {each["status"].split(":")[0] for each in answer["limited"]} == {"saturated"}
    assert {each["line"] for each in answer["limited"]} <= {3, 4, 5}
    assert any("not corrected as asked" in each for each in answer["warnings"])


def robot_result(path, spread):
    """RESULT.json of the KR210 as its file has it, each spring's compliance known that well."""
    model = robot("kr210")
    springs = tuple(model.chain().stiffness.tolist())
    layout = PosedLayout(springs, len(model.joints))
    rows = prior_rows(layout, arm_priors(model))
    sizes = np.full(layout.size, 1e-6)
    sizes[layout.arm.parts["compliances"]] = spread
    content = {
        "kind": "identified robot",
        "schema_version": 1,
        "status": "converged",
        "robot": robot_keys(model),
        "tilts": True,
        "posterior": {
            "modes": 0,
            "springs_nm_per_rad": list(springs),
            "unknowns": rows.centre.tolist(),
            "believed_sd": rows.spread.tolist() if hasattr(rows, "spread") else [1.0] * layout.size,
            "matrix": np.diag(sizes**2).tolist(),
        },
    }
    path.write_text(json.dumps(content))
    return path


def test_a_robot_that_cuts_have_told_has_a_band(program, tmp_path):
    out, forces = tmp_path / "OUT.nc", ("--forces", "-58 -130 35", *NEAR, "--no-weight")
    plain = told(KR210, TOOL, program, *forces, "--out", out)
    low, high = (
        told(robot_result(tmp_path / f"RESULT{k}.json", spread), TOOL, program, *forces, "--draws", 6, "--out", out)
        for k, spread in enumerate((1e-3, 0.1))
    )
    assert low["before"]["straight_rms_mm"] == pytest.approx(plain["before"]["straight_rms_mm"], rel=1e-3)
    assert low["band"]["draws"] == 6
    # what is known better leaves less
    assert np.ptp(low["band"]["straight_rms_mm"]) < 1e-3
    assert high["band"]["straight_rms_mm"][1] > low["band"]["straight_rms_mm"][1] + 2e-3
    assert high["band"]["straight_rms_mm"][1] < 0.42 * high["before"]["straight_rms_mm"]
    refused = run(tmp_path / "RESULT1.json", TOOL, program, *forces, "--joints-only", "--out", out)
    assert refused.exit_code == 2


def test_a_machine_is_compensated_by_what_its_tip_gives_way(program, result_file, tmp_path):
    out = tmp_path / "OUT.csv"
    answer = told(result_file, result_file.parent / "T1.toml", program, "--forces", "-300 200 0", "--draws", 8, "--out", out)
    assert answer["after"]["straight_rms_mm"] == pytest.approx(0.0, abs=1e-12)
    assert 1e-3 < answer["before"]["straight_rms_mm"] < 0.2
    assert answer["band"]["draws"] == 8
    assert answer["method"] == "mirror"
    # cuts from 300 Hz on tell little of what is at rest
    assert 1e-3 < answer["band"]["straight_rms_mm"][0] < answer["band"]["straight_rms_mm"][1] < 0.2
    assert any("along Z" in each for each in answer["warnings"])
    moved = read_tool_path(out).places[2] - read_gcode(program).places[1]
    # against the force
    assert moved[0] > 1e-6
    assert moved[1] < -1e-6
    assert moved[2] == 0.0


@pytest.mark.parametrize(
    ("further", "message"),
    [
        (("--forces", "1 2"), "--forces: found 1 2"),
        (("--forces", "1 2 x"), "--forces"),
        (("--forces", "1 2 3", "--out", "OUT.pdf"), ".nc"),
        (("--forces", "1 2 3", "--posture", "1 2"), "--posture"),
        (("--forces", "missing.csv"), "no such file"),
        (("--forces", "1 2 3", "--largest-mm", "0"), "--largest-mm"),
        (("--forces", "1 2 3", "--spacing-mm", "-1"), "--spacing-mm"),
        (("--forces", "1 2 3", "--cutoff-hz", "0"), "--cutoff-hz"),
        (("--forces", "1 2 3", "--blend-ms", "0"), "--blend-ms"),
        (("--forces", "1 2 3", "--lag-ms", "0"), "--lag-ms"),
        (("--forces", "missing.csv", "--force-axes", "path"), "--force-axes"),
    ],
)
def test_what_is_wrong_is_named(program, tmp_path, monkeypatch, further, message):
    monkeypatch.chdir(tmp_path)
    out = () if "--out" in further else ("--out", "OUT.nc")
    posture = () if "--posture" in further else NEAR
    found = run(KR210, TOOL, program, *posture, *out, *further)
    assert found.exit_code == 2, found.output
    assert message in found.output
    assert not (tmp_path / "OUT.nc").exists()


def test_arms_have_postures_and_machines_have_none(program, result_file, tmp_path):
    out, forces = ("--out", tmp_path / "OUT.nc"), ("--forces", "1 2 3")
    assert "--posture" in run(KR210, TOOL, program, *forces, *out).output
    tooling = result_file.parent / "T1.toml"
    assert "--posture" in run(result_file, tooling, program, *forces, *out, *NEAR).output
    for option in (
        ("--joints", tmp_path / "J.csv"),
        ("--method", "mirror"),
        ("--passes", 2),
        ("--blend-ms", 50),
        ("--lag-ms", 20),
        ("--no-weight",),
        ("--joints-only",),
    ):
        refused = run(result_file, tooling, program, *forces, *out, *option)
        assert refused.exit_code == 2, refused.output
        assert f"{option[0]}: found" in refused.output
        assert "a machine has no joints" in refused.output
    far = tmp_path / "FAR.nc"
    far.write_text("G0 X9000 Y0 Z0\nG1 X9010 F100\n")
    assert "reaches" in run(KR210, TOOL, far, *forces, *out, *NEAR).output
    untold = tmp_path / "UNTOLD.nc"
    untold.write_text("G0 X1700 Y0 Z900\nG1 X1710\n")
    assert "line 2" in run(KR210, TOOL, untold, *forces, *out, *NEAR).output
