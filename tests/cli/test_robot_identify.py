"""robot identify from static tests; from encoders see `test_robot`."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.settings.robots import read_robot
from rcsa_ident.machine.robot.compliance import static_compliance
from tests.fixtures import pushed_arm
from tests.fixtures.robots import ROBOTS, robot

KR210 = ROBOTS / "kr210.toml"


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Two tables of tests of the KR210, the second at postures of its own."""
    folder = tmp_path_factory.mktemp("static")
    for name, postures, levels, seed in (
        ("A", pushed_arm.POSTURES, (750.0, 1500.0, -1500.0), 21),
        ("B", pushed_arm.POSTURES[::4] + 0.2, (1200.0,), 22),
    ):
        tests = pushed_arm.pushed(name, robot("kr210"), postures, levels, 3e-5, seed)
        columns = {f"q{k + 1}_deg": column for k, column in enumerate(np.degrees(tests.angles).T)}
        columns |= dict(zip(("fx_n", "fy_n", "fz_n"), tests.force.T, strict=False))
        columns |= dict(zip(("dx_mm", "dy_mm", "dz_mm"), 1e3 * tests.displacement.T, strict=True))
        np.savetxt(folder / f"{name}.csv", np.array([*columns.values()]).T, delimiter=",", header=",".join(columns), comments="")
    return folder


@pytest.mark.slow
def test_springs_from_static_tests(tables, tmp_path):
    out, truth = tmp_path / "FOUND.toml", robot("kr210")
    start = tmp_path / "START.toml"
    text = KR210.read_text().replace("stiffness_nm_per_rad = 5600000.0", "stiffness_nm_per_rad = 3500000.0")
    start.write_text(text)
    found = run("robot", "identify", start, tables / "A.csv", "--check", tables / "B.csv", "--out", out, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert told["springs"][:4] == ["A1", "A1 about x", "A1 about y", "A2"]
    assert told["told"][0]
    off = told["stiffness_nm_per_rad"][0] / 5.6e6 - 1.0
    assert abs(off) < 0.03 * told["stiffness_sd_percent"][0]
    assert told["backlash_rad"][0] == pytest.approx(6e-5, abs=3.0 * told["backlash_sd_rad"][0])
    assert told["noise_mm"] == pytest.approx(0.03, rel=0.3)
    assert told["noise_mrad"] is None
    assert set(told["explained"]) == {"A.csv", "B.csv"}
    assert told["explained"]["B.csv"] > 0.98
    untold = [name for name, known in zip(told["springs"], told["told"], strict=True) if not known]
    assert untold
    assert all(any(name in text for text in told["warnings"]) for name in untold)
    arm = read_robot(out)
    np.testing.assert_allclose(arm.chain().stiffness, told["stiffness_nm_per_rad"], rtol=1e-5)
    for posture in pushed_arm.POSTURES + 0.3:
        ours, theirs = (static_compliance(each, posture)[:3, :3] for each in (arm, truth))
        assert np.linalg.norm(ours - theirs) < 0.04 * np.linalg.norm(theirs)


def test_in_words(tables, tmp_path):
    found = run("robot", "identify", KR210, tables / "A.csv", "--out", tmp_path / "FOUND.toml")
    assert found.exit_code == 0, found.output
    assert "A1 about x" in found.output
    assert "of the squared displacements are explained" in found.output
    assert "the tests do not tell" in found.output


def test_an_arm_without_masses_is_said(tables, tmp_path):
    found = run("robot", "identify", ROBOTS / "kr500.toml", tables / "B.csv", "--out", tmp_path / "FOUND.toml", "--json")
    assert found.exit_code == 0, found.output
    assert any("no masses are known" in text for text in json.loads(found.stdout)["warnings"])


def test_motions_and_tests_do_not_go_together(tables, tmp_path):
    motion = tmp_path / "MOTION.csv"
    motion.write_text("time_s,motor_1_deg,joint_1_deg,torque_1_nm\n0,0,0,0\n1,0,0,0\n")
    found = run("robot", "identify", KR210, tables / "A.csv", motion, "--out", tmp_path / "FOUND.toml")
    assert found.exit_code == 2
    assert "found A.csv beside others, allowed is motions alone, or static tests alone" in found.output
    other = run("robot", "identify", KR210, tables / "A.csv", "--check", motion, "--out", tmp_path / "FOUND.toml")
    assert other.exit_code == 2
    assert "column q1_deg" in other.output
    assert not (tmp_path / "FOUND.toml").exists()
