"""identify and check with hammer tests: alone, and what cannot be done with them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import rcsa_ident as ri
from rcsa_ident.cli import app
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.fixtures.hit import OMEGA, write_hit
from tests.fixtures.paths import MACHINES


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture(scope="module")
def hit(tmp_path_factory):
    """The sample machine, hit at the tips of both toolings and in front of their flanges, X alone, without noise."""
    return write_hit(tmp_path_factory.mktemp("hit"))


@pytest.mark.slow
def test_check_tells_what_is_used(hit):
    found = run("check", hit)
    assert found.exit_code == 0, found.stderr
    assert found.stdout.count("hammer test ") == 4
    assert "lines from 200 to 3500 Hz are used" in found.stdout
    told = json.loads(run("check", hit, "--json").stdout)
    assert [test["id"].split()[-1] for test in told["hammer_tests"]] == ["tip", "v"] * 2
    assert all(test["lines"] <= 300 for test in told["hammer_tests"])


@pytest.mark.slow
def test_identify_tells_a_tool_that_was_never_hit(hit, tmp_path):
    out, page = tmp_path / "RESULT.json", tmp_path / "report.html"
    found = run("identify", hit, "--out", out, "--report", page)
    assert found.exit_code == 0, found.stderr
    assert "4 hammer tests" in found.stdout
    text = page.read_text(encoding="utf-8")
    assert "Hammer tests in X" in text
    assert "of 0 cuts" not in text
    assert "All 0 recordings" not in text
    data = json.loads(out.read_text())
    assert data["campaign"]["hammer_tests"] == list(data["axes"]["X"]["hammer_tests"])
    assert all(test["error"] < 0.01 and abs(test["gain"] - 1.0) < 0.02 for test in data["axes"]["X"]["hammer_tests"].values())
    assert "workpiece" not in data
    machine = read_machine(MACHINES / "hpm.toml")
    other = read_tooling(machine.truth_toolings[1])
    true = frequency_response(rotor(machine.spindle, other.assembly), OMEGA, 0.0, ("tip.x",), ("tip.x",))[:, 0, 0]
    tip = ri.read_result(out).machine.tip(other, OMEGA).between("tip.x", "tip.x")
    assert np.linalg.norm(tip - true) < 0.01 * np.linalg.norm(true)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("identify", "--out", "R.json", "--method", "paper"), "method: found paper, with hammer tests"),
        (("identify", "--out", "R.json", "--speed-bands", "2"), "cuts: found none of 0 usable"),
        (("calibrate", "--out", "W.toml"), "cuts: found none"),
    ],
)
def test_what_needs_cuts_says_so(hit, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    found = run(arguments[0], hit, *arguments[1:])
    assert found.exit_code == 2
    assert words in found.stderr.replace("\n", " ")


def test_a_curve_that_is_mostly_outside_its_band_is_named(hit, tmp_path):
    folder = tmp_path / "narrow"
    folder.mkdir()
    for path in hit.iterdir():
        (folder / path.name).write_text(path.read_text())
    setup = folder / "campaign.toml"
    setup.write_text(setup.read_text().replace('axis = "X"', 'axis = "X"\nfrom_hz = 3480', 1))
    found = run("check", folder)
    assert found.exit_code == 2
    assert "6 lines from 3480 to inf Hz, allowed is at least 20 lines in its band" in found.stderr.replace("\n", " ")
