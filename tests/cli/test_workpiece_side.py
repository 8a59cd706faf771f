"""Commands on a machine whose table gives way: what each says of it, and which of the two receptances it asks."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from rcsa_ident.cli import lobes
from rcsa_ident.cli.tables import show_identification
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.curves.tips import read_tip
from rcsa_ident.io.results.identifications import identification_to_json
from rcsa_ident.io.results.parts import write_result
from rcsa_ident.machine.workpiece_side import WorkpieceAxis, WorkpieceSide
from rcsa_ident.report.html import report_html
from rcsa_ident.signals.recording import Role
from tests.fixtures import by_hand

APP = typer.Typer(pretty_exceptions_enable=False)
APP.command("tooltip")(lobes.tooltip)
APP.command("lobes")(lobes.lobes)
X = WorkpieceAxis(
    "table_x", Role.TABLE, 2.0 * np.pi * np.array([500.0]), np.array([0.03]), np.array([4e5]), np.diag([1e-6, 1e-4, 1e-4]), 80, 1.1, 0.02
)
Y = WorkpieceAxis("table_y", Role.TABLE, np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 0)), 75, 0.9, 2e-3)
FOUND = replace(by_hand.identification(), workpiece_side=WorkpieceSide({Dof.X: X, Dof.Y: Y}))


def run(*arguments):
    result = CliRunner().invoke(APP, [str(a) for a in arguments])
    assert result.exit_code == 0, result.output + repr(result.exception)
    return result


@pytest.fixture
def result(tmp_path):
    write_result(tmp_path / "R.json", identification_to_json(FOUND, by_hand.campaign(tmp_path), []))
    return tmp_path / "R.json"


def test_a_tooltip_is_the_tools_and_the_sum_where_it_is_asked_for(result):
    """The sum's file gives lobes the limits of the result itself."""
    folder = result.parent
    plain = run("tooltip", result, folder / "T1.toml", "--from", 300, "--out", folder / "T.csv", "--no-bands")
    run("tooltip", result, folder / "T1.toml", "--from", 300, "--out", folder / "S.csv", "--no-bands", "--relative")
    assert "the tool's own tip receptance is without it" in " ".join(plain.output.split())
    own, relative = (read_tip(folder / name) for name in ("T.csv", "S.csv"))
    np.testing.assert_allclose((relative.values - own.values)[:, 0, 0], X.receptance(own.omega), rtol=1e-5)
    np.testing.assert_array_equal(relative.values[:, 1, 1], own.values[:, 1, 1])


def test_lobes_say_that_they_hold_for_both(result):
    out = result.parent / "L.csv"
    told = json.loads(run("lobes", result, result.parent / "T1.toml", "--out", out, "--no-bands", "--json").stdout.splitlines()[-1])
    assert FOUND.workpiece_side.words in told["warnings"]


def test_an_identification_shows_its_modes(capsys):
    show_identification(FOUND, {})
    shown = capsys.readouterr().out
    found = ("modes of the workpiece's side", "500.0", "0.4000", "X: table_x on the table, 80 lines, χ²/point 1.10")
    for words in (*found, "Y: table_y on the table, 75 lines, nothing above the noise"):
        assert words in shown


def test_a_report_shows_them(tmp_path):
    page = report_html(FOUND, by_hand.campaign(tmp_path), [])
    assert "Workpiece's side of the cut" in page.replace("&#39;", "'")
    assert "nothing above the noise" in page
    assert "Workpiece's side" not in report_html(by_hand.identification(), by_hand.campaign(tmp_path), []).replace("&#39;", "'")
