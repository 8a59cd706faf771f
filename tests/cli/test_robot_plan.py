"""robot plan: postures for tests that do not exist yet."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.machine.robot.kinematics import tool_point_at
from tests.fixtures.robots import ROBOTS, robot

TX200, BOX = ROBOTS / "tx200.toml", "500 -1000 300 1600 1000 1800"


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_the_published_plan(tmp_path):
    out = tmp_path / "POSTURES.csv"
    found = run("robot", "plan", TX200, "--tests", "payload", "--count", 1, "--box", BOX, "--out", out, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert told["information"][0][0] == pytest.approx(291.97, abs=5e-3)
    assert told["unknowns"] == ["payload mass"]
    assert told["sd_after"][0] == pytest.approx(291.97**-0.5, rel=1e-3)
    np.testing.assert_allclose(np.abs(told["tool_points_m"][0]), [1.6, 1.0, 1.13], atol=2e-3)
    row = rows_of(out)[0]
    np.testing.assert_allclose([float(row[f"q{k}_deg"]) for k in range(1, 7)], told["postures_deg"][0], atol=1e-4)
    assert float(row["x_mm"]) == pytest.approx(1600.0, abs=1e-3)
    assert told["warnings"] == []


@pytest.mark.slow
def test_static_tests_drawn_and_from_a_table(tmp_path):
    out, table = tmp_path / "POSTURES.csv", tmp_path / "GIVEN.csv"
    drawn = run("robot", "plan", TX200, "--count", 2, "--candidates", 12, "--box", BOX, "--seed", 3, "--out", out, "--json")
    assert drawn.exit_code == 0, drawn.output
    told = json.loads(drawn.stdout)
    assert len(told["unknowns"]) == len(told["sd_after"]) == 24
    assert max(told["sd_after"]) <= 1.0
    assert told["gain_nat"] > 10.0
    # out of those and the arm upright, the same two
    rows = out.read_text().splitlines()
    table.write_text("\n".join([rows[0], "0,0,0,0,0,0,0,0,0", *rows[1:]]) + "\n")
    chosen = run("robot", "plan", TX200, "--count", 2, "--candidates", table, "--box", BOX, "--out", out)
    assert chosen.exit_code == 0, chosen.output
    assert "J1 about x" in chosen.output
    assert [row.split(",")[:6] for row in out.read_text().splitlines()] == [row.split(",")[:6] for row in rows]
    arm = robot("tx200")
    for posture, place in zip(told["postures_deg"], told["tool_points_m"], strict=True):
        np.testing.assert_allclose(tool_point_at(arm, np.radians(posture)).offset, place, atol=1e-9)


def test_what_encoders_do_not_tell_is_said(tmp_path):
    found = run("robot", "plan", TX200, "--tests", "encoders", "--count", 1, "--candidates", 10, "--out", tmp_path / "P.csv", "--json")
    assert found.exit_code == 0, found.output
    warnings = json.loads(found.stdout)["warnings"]
    assert warnings[0].startswith("J1: these tests tell nothing of it")
    assert "no --box is given" in warnings[-1]


def test_natural_frequencies(tmp_path):
    out = tmp_path / "P.csv"
    found = run("robot", "plan", TX200, "--tests", "modes", "--count", 3, "--candidates", 3, "--box", BOX, "--out", out, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert len(told["unknowns"]) == 18
    assert len(rows_of(out)) == 3
    assert min(told["sd_after"]) < 0.1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--box", "1 2 3"), "--box: found 1 2 3, allowed is six lengths"),
        (("--box", "0 0 0 0 0 0"), "a lowest corner, then a highest one"),
        (("--box", "5000 0 0 6000 1 1"), "a box that the tool reaches"),
        (("--count", 5, "--candidates", 4), "count: found 5, allowed is 1 to 4"),
        (("--candidates", "NONE.csv"), "existing file"),
        (("--candidates", "BEYOND.csv"), "BEYOND.csv line 3: posture: found J2 stands at 150.00°"),
        (("--candidates", "BEYOND.csv", "--box", BOX), "line 3"),
        (("--tests", "payload", "--encoder-noise-urad", 0), "encoder noise"),
        (("--tests", "modes", "--frequency-noise-percent", 0), "frequency noise"),
    ],
)
def test_bad_input_is_named(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "BEYOND.csv").write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,0,0,0,0\n0,150,0,0,0,0\n")
    found = run("robot", "plan", TX200, *arguments, "--out", "P.csv")
    assert found.exit_code == 2
    assert message in found.output
    assert not (tmp_path / "P.csv").exists()


def test_a_table_with_nothing_in_the_box(tmp_path):
    (tmp_path / "UP.csv").write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,0,0,0,0\n")
    found = run("robot", "plan", TX200, "--candidates", tmp_path / "UP.csv", "--box", BOX, "--out", tmp_path / "P.csv")
    assert found.exit_code == 2
    assert "a box with one of the given postures' tools in it" in found.output
