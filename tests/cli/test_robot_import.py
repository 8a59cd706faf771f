"""robot import: ROBOT.toml from a URDF file, what is told of it, and what is asked for."""

import json

import numpy as np
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.settings.robots import read_robot
from rcsa_ident.machine.robot.kinematics import flange_at
from tests.fixtures.robots import TABLE_7, robot
from tests.io.urdf_files import urdf_of

SPRINGS = ("--stiffness-nm-per-rad", "2e6 6e6 3.5e6 9e5 7e5 2.6e5")


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


def test_import_writes_a_robot(tmp_path):
    source, out = tmp_path / "ARM.urdf", tmp_path / "ROBOT.toml"
    source.write_text(urdf_of(robot("tx200")))
    found = run("robot", "import", source, "--out", out, *SPRINGS, "--damping-nms-per-rad", 400, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert told["joints"] == ["J1", "J2", "J3", "J4", "J5", "J6"]
    assert abs(told["mass_kg"] - robot("tx200").mass) < 1e-9
    arm = read_robot(out)
    assert [j.stiffness for j in arm.joints] == [2e6, 6e6, 3.5e6, 9e5, 7e5, 2.6e5]
    assert {j.damping for j in arm.joints} == {400.0}
    np.testing.assert_allclose(flange_at(arm, TABLE_7).offset, flange_at(robot("tx200"), TABLE_7).offset, atol=1e-12)
    # what stands against its masses is a remark of the file
    assert all(f"# {warning}" in out.read_text() for warning in told["warnings"])
    checked = run("robot", "check", out, "--posture", "0 0 0 0 0 0", "--json")
    assert checked.exit_code == 0, checked.output


def test_import_asks_for_what_urdf_does_not_tell(tmp_path):
    source, out = tmp_path / "ARM.urdf", tmp_path / "ROBOT.toml"
    source.write_text(urdf_of(robot("tx200")))
    assert run("robot", "import", source, "--out", out).exit_code == 2
    for text in ("soft", "1e6 -1", "0", "nan"):
        refused = run("robot", "import", source, "--out", out, "--stiffness-nm-per-rad", text)
        assert refused.exit_code == 2
        assert "one number for all joints, or one a joint, above 0" in refused.output
    refused = run("robot", "import", source, "--out", out, "--stiffness-nm-per-rad", "1e6 2e6")
    assert refused.exit_code == 2
    assert "2 numbers" in refused.output
    assert not out.exists()
    undamped = run("robot", "import", source, "--out", out, *SPRINGS)
    assert undamped.exit_code == 0
    assert "no damping is told" in undamped.output
    assert "6 joints (J1, J2, J3, J4, J5, J6)" in undamped.output
