"""robot draw: an arm as a picture, and what is said to a path that nothing follows."""

import json
from xml.etree import ElementTree

import numpy as np
from typer.testing import CliRunner

from rcsa_ident.cli import app
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import ROBOTS

TX200, POSTURE = ROBOTS / "tx200.toml", "-11.71 20.78 110 82.76 60.80 -166.96"
TOOL = TOOLINGS / "S3-PG25-long.toml"


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


def test_draw_writes_a_picture(tmp_path):
    out = tmp_path / "ARM.svg"
    found = run("robot", "draw", TX200, "--posture", POSTURE, "--tooling", TOOL, "--out", out)
    assert found.exit_code == 0, found.output
    assert ElementTree.parse(out).getroot().find("{http://www.w3.org/2000/svg}title").text == "Stäubli TX200"


def test_draw_along_a_path(tmp_path):
    out, path = tmp_path / "ARM.svg", tmp_path / "PATH.csv"
    path.write_text("x_mm,y_mm,z_mm\n" + "\n".join(f"{900 + 40 * k},{-300 + 60 * k},500" for k in range(11)) + "\n")
    found = run("robot", "draw", TX200, "--posture", POSTURE, "--tooling", TOOL, "--path", path, "--out", out, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert np.shape(told["ends_deg"]) == (2, 6)
    assert told["warnings"] == []
    assert 'class="ghost"' in out.read_text()
    refused = run("robot", "draw", TX200, "--posture", POSTURE, "--path", path, "--out", out)
    assert refused.exit_code == 2
    assert "--tooling" in refused.output
    path.write_text("x_mm,y_mm,z_mm\n9000,0,500\n")
    refused = run("robot", "draw", TX200, "--posture", POSTURE, "--tooling", TOOL, "--path", path, "--out", out)
    assert refused.exit_code == 2
    assert "place 1 of the path" in refused.output
