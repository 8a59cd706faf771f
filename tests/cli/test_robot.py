"""The robot's commands, on published arms, and what they say to bad input."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.curves.tips import read_frf_csv
from rcsa_ident.io.settings.robots import read_robot
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.robot.compliance import free_play, sag
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from tests.fixtures import moving_arm
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import ROBOTS, TABLE_7, robot

TX200, POSTURE = ROBOTS / "tx200.toml", "-11.71 20.78 -212.14 82.76 60.80 -166.96"
NEAR = "-11.71 20.78 147.86 82.76 60.80 -166.96"
TOOL = TOOLINGS / "S3-PG25-long.toml"
MATERIAL = ("--ktc-mpa", 660, "--krc", 0.38)


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_check_tells_what_the_files_page_says():
    found = run("robot", "check", TX200, "--posture", POSTURE, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert set(told) == {
        "name", "degrees_of_freedom", "mass_kg", "tcp_m", "tcp_axes", "natural_frequencies_hz", "damping_ratios", "gravity_torque_nm",
        "tcp_compliance_m_per_n", "sag_m", "play_m", "postures_deg", "warnings",
    }  # fmt: skip
    assert told["degrees_of_freedom"] == len(told["natural_frequencies_hz"]) == len(told["damping_ratios"]) == 18
    assert told["mass_kg"] == pytest.approx(1045.0)
    np.testing.assert_allclose(told["tcp_m"], [0.79399, 0.18472, 0.31632], atol=5e-6)
    np.testing.assert_allclose(np.array(told["tcp_axes"])[:, 2], [0.0, 0.0, -1.0], atol=4e-5)
    np.testing.assert_allclose(told["natural_frequencies_hz"][:3], [11.754, 13.651, 22.228], rtol=1e-4)
    np.testing.assert_allclose(told["gravity_torque_nm"], [0.0, -1112.42, -80.73, 28.14, 138.99, 0.0], atol=6e-3)
    np.testing.assert_allclose(np.diag(told["tcp_compliance_m_per_n"]) * 1e6, [1.908, 1.821, 0.737], atol=6e-4)
    np.testing.assert_allclose(told["sag_m"], sag(robot("tx200"), TABLE_7)[:3], rtol=1e-9)
    np.testing.assert_allclose(told["play_m"], free_play(robot("tx200"), TABLE_7)[:3], rtol=1e-9)
    assert len(told["postures_deg"]) == 8
    assert any(text.startswith("J3 stands at -212.14°") for text in told["warnings"])
    six = json.loads(run("robot", "check", TX200, "--posture", POSTURE, "--joints-only", "--json").stdout)
    np.testing.assert_allclose(six["natural_frequencies_hz"], [15.768, 25.056, 27.720, 33.561, 92.587, 138.708], rtol=1e-4)


def test_check_in_words():
    found = run("robot", "check", TX200, "--posture", POSTURE)
    assert found.exit_code == 0, found.output
    assert "tool at 794.0, 184.7, 316.3 mm of the base, pointing along 0.000, 0.000, -1.000" in found.output
    assert "torques against the arm's weight: 0, -1112, -81, 28, 139, 0 N m" in found.output
    assert "under it the tool moves by " in found.output
    assert "the joints' play lets it stand up to " in found.output
    assert found.output.count(" yes ") == 2
    bare = run("robot", "check", ROBOTS / "kr500.toml")
    assert bare.exit_code == 0, bare.output
    assert "no masses are known: no natural frequencies" in bare.output
    told = json.loads(run("robot", "check", ROBOTS / "kr500.toml", "--json").stdout)
    assert told["natural_frequencies_hz"] == told["gravity_torque_nm"] == told["sag_m"] == []
    assert told["play_m"] == [0.0, 0.0, 0.0]
    assert told["mass_kg"] is None


def test_tip_is_written_with_its_cross_terms(tmp_path):
    out, plot = tmp_path / "FRF.csv", tmp_path / "FRF.svg"
    found = run(
        "robot", "tip", TX200, TOOL, "--posture", POSTURE, "--from", 5, "--to", 200, "--step", 0.5, "--out", out, "--plot", plot, "--json"
    )
    assert found.exit_code == 0, found.output
    assert "frequency [Hz]" in plot.read_text(encoding="utf-8")
    told = json.loads(found.stdout)
    assert told["frequencies"] == 391
    header = out.read_text().splitlines()[0].split(",")
    assert {"XY_re", "XY_im", "YX_re", "YX_im"} <= set(header)
    curves = read_frf_csv(out)
    machine = PosedRobot(FlexibleRobot(robot("tx200")), TABLE_7, highest=2.0 * np.pi * 200.0)
    tip = machine.tip(read_tooling(TOOL), 2.0 * np.pi * curves.frequency)
    np.testing.assert_allclose(curves.values["X"], tip.between("tip.x", "tip.x"), rtol=1e-9)
    # the arm's own mode stands out far below the tool's
    assert 20.0 < told["peaks"]["X"]["frequency_hz"] < 25.0


@pytest.mark.slow
def test_lobes_at_a_posture(tmp_path):
    out, plot = tmp_path / "LOBES.csv", tmp_path / "LOBES.svg"
    speeds = ("--speed-from", 8000, "--speed-to", 14_000, "--speed-step", 500)
    found = run("robot", "lobes", TX200, TOOL, "--posture", POSTURE, *MATERIAL, *speeds, "--out", out, "--plot", plot, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    # what an arm allows at any speed is set by its own modes, the lobes by the tool's
    assert told["absolute_limit_mm"] < 0.1
    rows = rows_of(out)
    assert len(rows) == 13
    assert all(float(row["chatter_frequency_hz"]) > 1000.0 for row in rows)
    assert plot.stat().st_size > 1000
    turned = run("robot", "lobes", TX200, TOOL, "--posture", POSTURE, *MATERIAL, *speeds, "--feed-direction", "+y", "--out", out, "--json")
    assert turned.exit_code == 0, turned.output
    assert [float(r["limit_depth_mm"]) for r in rows_of(out)] != [float(r["limit_depth_mm"]) for r in rows]


def test_map_along_a_path(tmp_path):
    path, out = tmp_path / "PATH.csv", tmp_path / "MAP.csv"
    path.write_text("x_mm,y_mm,z_mm\n900,0,300\n950,0,300\n1100,100,300\n")
    speeds = ("--speed-from", 8000, "--speed-to", 9000, "--speed-step", 500)
    found = run("robot", "map", TX200, TOOL, "--posture", NEAR, "--path", path, *MATERIAL, *speeds, "--out", out, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    rows = rows_of(out)
    assert told["positions"] == len(told["postures_deg"]) == 3
    assert [(float(r["x_mm"]), float(r["spindle_speed_rpm"])) for r in rows[:4]] == [
        (900.0, 8000.0),
        (900.0, 8500.0),
        (900.0, 9000.0),
        (950.0, 8000.0),
    ]
    everywhere = min(float(r["limit_depth_mm"]) for r in rows if float(r["spindle_speed_rpm"]) == told["best_speed_rpm"])
    assert told["limit_everywhere_mm"] == pytest.approx(everywhere)
    # the same places from a program
    program = tmp_path / "PATH.nc"
    program.write_text("G21 G90 G0 X900 Y0 Z300\nG1 X950 F3000\nX1100 Y100\n")
    again = run("robot", "map", TX200, TOOL, "--posture", NEAR, "--path", program, *MATERIAL, *speeds, "--out", out, "--json")
    assert again.exit_code == 0, again.output
    assert rows_of(out) == rows


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("check", TX200, "--posture", "1 2 3"), "--posture: found 1 2 3, allowed is 6 angles with blanks between, one a joint"),
        (("check", TX200, "--posture", "1 2 3 4 5 x"), "--posture"),
        (("check", TX200, "--posture", "1 2 3 4 5 6000"), "within two turns"),
        (("check", "nowhere.toml"), "existing file"),
        (("tip", ROBOTS / "kr500.toml", TOOL, "--posture", "0 0 0 0 0 0", "--out", "F.csv"), "link masses"),
    ],
)
def test_bad_input_is_named(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = run("robot", *arguments)
    assert found.exit_code == 2
    assert message in found.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x_mm,y_mm,z_mm\n900,0,300\n9000,0,300\n", "place 2 of the path: found 9000, 0, 300 mm, allowed is one that the robot reaches"),
        ("x_mm,y_mm\n900,0\n", "column z_mm"),
        ("x_mm,y_mm,z_mm,i,j\n900,0,300,0,1\n", "column k"),
        ("x_mm,y_mm,z_mm\n900,,300\n", "column y_mm: found an empty cell"),
        ("x_mm,y_mm,z_mm\n900000,0,300\n", "are these millimetres"),
        ("x_mm,y_mm,z_mm,i,j,k\n900,0,300,0,0,0\n", "allowed is a direction"),
        ("x_mm,y_mm,z_mm,i,j,k\n900,0,300,-0.18964,-0.98185,0\n", "tool's axis at place 1"),
    ],
)
def test_a_bad_path_is_named(text, message, tmp_path):
    path, out = tmp_path / "PATH.csv", tmp_path / "MAP.csv"
    path.write_text(text)
    found = run("robot", "map", TX200, TOOL, "--posture", NEAR, "--path", path, *MATERIAL, "--out", out)
    assert found.exit_code == 2
    assert message in found.output
    assert not out.exists()


def written(record, path):
    """A record as CSV, the motors' own inertia taken out of the torques."""
    acceleration = np.gradient(np.gradient(record.motor, record.step, axis=1), record.step, axis=1)
    torque = record.torque - record.motor_inertia[:, None] * acceleration
    columns = {"time_s": np.arange(record.motor.shape[1]) * record.step}
    for what, unit, rows in (
        ("motor", "deg", np.degrees(record.motor)),
        ("joint", "deg", np.degrees(record.joint)),
        ("torque", "nm", torque),
    ):
        columns |= {f"{what}_{k + 1}_{unit}": row for k, row in enumerate(rows)}
    np.savetxt(path, np.array([*columns.values()]).T, delimiter=",", header=",".join(columns), comments="")
    return path


def test_identify_from_encoders(tmp_path):
    first, other = (written(moving_arm.record(name, seed), tmp_path / f"{name}.csv") for name, seed in (("A", 11), ("B", 12)))
    out = tmp_path / "FOUND.toml"
    found = run("robot", "identify", ROBOTS / "kr210.toml", first, "--check", other, "--out", out, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    np.testing.assert_allclose(told["stiffness_nm_per_rad"][:3], moving_arm.STIFFNESS[:3], rtol=0.2)
    assert told["delay_ms"] == pytest.approx(1e3 * moving_arm.LATE, abs=0.06)
    assert min(told["explained"]["B.csv"][:3]) > 0.95
    arm = read_robot(out)
    np.testing.assert_allclose([j.stiffness for j in arm.joints[:3]], told["stiffness_nm_per_rad"][:3], rtol=1e-5)
    # what was not told is as it was
    before = robot("kr210")
    left = [i for i in range(6) if told["stiffness_nm_per_rad"][i] is None]
    assert left
    assert [arm.joints[i].stiffness for i in left] == [before.joints[i].stiffness for i in left]
    assert len(told["warnings"]) == len(left)
    words = run("robot", "identify", ROBOTS / "kr210.toml", first, "--out", out)
    assert "after the motors'" in words.output
    refused = run("robot", "identify", ROBOTS / "kr210.toml", tmp_path, "--out", tmp_path / "no.toml")
    assert refused.exit_code == 2
    assert "campaign.toml" in refused.output
