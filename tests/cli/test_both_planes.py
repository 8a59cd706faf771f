"""Commands on a machine whose planes feel each other: each uses the cross terms and the speed, and says so."""

from __future__ import annotations

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from rcsa_ident.base.units import to_rpm
from rcsa_ident.cli import compare, contact, decouple, export, identify, lobes, plan
from rcsa_ident.cli.tables import show_identification
from rcsa_ident.io.curves.tips import read_frf_csv, read_tip, write_frf_csv
from rcsa_ident.io.uff import read_uff
from rcsa_ident.workflows.identify import mode_deviations
from tests.fixtures import by_hand, coupled_by_hand

APP = typer.Typer(pretty_exceptions_enable=False)
for name, command in (
    ("tooltip", lobes.tooltip),
    ("export", export.export),
    ("compare", compare.compare),
    ("decouple", decouple.decouple),
    ("contact", contact.contact),
    ("identify", identify.identify),
    ("plan", plan.plan),
):
    APP.command(name)(command)
MIDDLE = to_rpm(by_hand.SPEEDS[0])
LINES = ("--from-hz", 400, "--to-hz", 2500, "--step-hz", 10)
OMEGA = 2.0 * np.pi * np.arange(400.0, 2501.0, 10.0)


def run(*arguments, code=0):
    result = CliRunner().invoke(APP, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


def answer_of(*arguments):
    return json.loads(run(*arguments, "--json").stdout.splitlines()[-1])


@pytest.fixture(params=[0, 1], ids=["oblique", "gyroscopic"])
def turning(request):
    return request.param


@pytest.fixture
def machine(turning):
    return coupled_by_hand.machine(turning)


@pytest.fixture
def result(tmp_path, turning):
    path = tmp_path / "R.json"
    path.write_text(coupled_by_hand.result_text(tmp_path, turning), encoding="utf-8")
    return path


def test_tooltip_writes_what_is_across_and_says_its_speed(tmp_path, result, machine, turning):
    common = ("tooltip", result, tmp_path / "T1.toml", "--out", tmp_path / "F.csv", "--from", 400, "--to", 2500, "--step", 10)
    text = run(*common, "--plot", tmp_path / "F.png").stdout
    assert (tmp_path / "F.png").read_bytes().startswith(b"\x89PNG")
    assert "XY: motion in X under a force in Y" in text
    assert ("9549 rev/min, the middle of the speeds that were cut" in text) is bool(turning)
    tip = machine.tip(by_hand.tooling(), OMEGA)
    np.testing.assert_allclose(read_tip(tmp_path / "F.csv").values, tip.values, rtol=1e-9, atol=1e-20)
    header = (tmp_path / "F.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {f"{name}_{part}{std}" for name in ("XY", "YX") for part in ("re", "im") for std in ("", "_std")} <= set(header)
    spread = read_frf_csv(tmp_path / "F.csv").bands["XY_re_std"]
    np.testing.assert_allclose(spread, tip.deviation()[tip.rows[0], tip.rows[1]][0], rtol=1e-9)
    told = answer_of(*common, "--speed-rpm", 7000)
    assert told["spindle_speed_rpm"] == (pytest.approx(7000.0) if turning else None)
    assert set(told["peaks"]) == {"X", "Y", "XY", "YX"}
    there = machine.at(7000.0 * np.pi / 30.0).tip(by_hand.tooling(), OMEGA, spread=False).values
    np.testing.assert_allclose(read_tip(tmp_path / "F.csv").values, there, rtol=1e-9, atol=1e-20)


def test_export_of_a_tip_has_its_cross_terms(tmp_path, result, machine, turning):
    common = ("export", result, "--tooling", tmp_path / "T1.toml", *LINES)
    told = answer_of(*common, "--out", tmp_path / "F.csv", "--to", "csv", "--speed", 7000)
    assert told["spindle_speed_rpm"] == (pytest.approx(7000.0) if turning else None)
    expected = machine.at(7000.0 * np.pi / 30.0).tip(by_hand.tooling(), OMEGA, spread=False)
    np.testing.assert_allclose(read_tip(tmp_path / "F.csv").values, expected.values, rtol=1e-6, atol=1e-15)
    text = run(*common, "--out", tmp_path / "F.uff").stdout
    assert (f"at {MIDDLE:.0f} rev/min" in text) is bool(turning)
    functions = read_uff(tmp_path / "F.uff")
    assert sorted((f.response[1], f.reference[1]) for f in functions) == [(1, 1), (1, 2), (2, 1), (2, 2)]
    across = next(f for f in functions if (f.response[1], f.reference[1]) == (1, 2))
    middle = machine.tip(by_hand.tooling(), OMEGA, spread=False)
    np.testing.assert_allclose(across.values, middle.between("tip.x", "tip.y"), rtol=1e-4, atol=1e-13)


def test_export_of_a_flange_names_every_entry(tmp_path, result, machine):
    run("export", result, *LINES, "--out", tmp_path / "F.json", "--to", "json")
    entries = json.loads((tmp_path / "F.json").read_text(encoding="utf-8"))["receptances"]
    assert set(entries) == {f"{a}{k}" for a in ("X", "Y", "XY", "YX") for k in ("", "_tM", "_rF", "_rM")}
    flange = machine.receptance(OMEGA)
    for name, row, col in (("XY", "flange.x", "flange.y"), ("YX_rF", "flange.y'", "flange.x"), ("X_tM", "flange.x", "flange.x'")):
        found = np.array(entries[name]["re"]) + 1j * np.array(entries[name]["im"])
        np.testing.assert_allclose(found, flange.between(row, col), rtol=1e-9, atol=1e-18)


def test_exported_modes_have_directions_and_say_that_nothing_turns(tmp_path, result, turning):
    told = run("export", result, "--what", "modes", "--out", tmp_path / "M.json", "--to", "json")
    assert ("spindle at standstill" in told.stderr) is bool(turning)
    data = json.loads((tmp_path / "M.json").read_text(encoding="utf-8"))
    assert [m["axis"] for m in data["modes"]] == ["XY"] * 4
    np.testing.assert_allclose([m["direction_deg"] for m in data["modes"]], np.degrees(coupled_by_hand.ANGLES), atol=0.1)
    assert {"phi_x_t_re", "phi_x_r_re", "phi_y_t_im", "phi_y_r_im"} <= set(data["modes"][0])
    assert np.array(data["residual_compliance"]["XY"]).shape == (4, 4)


def test_a_hammer_test_beside_it_says_so(tmp_path, result, machine, turning):
    values = machine.tip(by_hand.tooling(), OMEGA, spread=False)
    curves = {axis.upper(): values.between(f"tip.{axis}", f"tip.{axis}") for axis in "xy"}
    write_frf_csv(tmp_path / "H.csv", OMEGA / (2.0 * np.pi), curves)
    common = ("compare", result, tmp_path / "T1.toml", "--hammer", tmp_path / "H.csv")
    text = " ".join(run(*common).stdout.split())
    assert "X and Y of the machine feel each other" in text
    assert (f"identified at {MIDDLE:.0f} rev/min" in text) is bool(turning)
    told = answer_of(*common)
    assert all(row["relative_difference"] < 1e-6 for row in told["responses"])
    assert told["spindle_speed_rpm"] == (pytest.approx(MIDDLE) if turning else None)


def test_a_plan_for_it_alternates_the_feed(tmp_path, result):
    common = ("--toolings", tmp_path / "T1.toml", "--target", tmp_path / "T1.toml", "--out", tmp_path / "P.toml")
    speeds = ("--speed-from", 7000, "--speed-to", 13000, "--depths-mm", 0.2, "--margin", 1, "--cuts", 4)
    both = answer_of("plan", result, *common, *speeds)
    assert {cut["feed_direction"] for cut in both["cuts"]} == {"+X", "+Y"}
    one = answer_of("plan", result, *common, *speeds, "--feed-direction", "+X")
    assert {cut["feed_direction"] for cut in one["cuts"]} == {"+X"}
    assert both["cuts"][-1]["band_percent"]["T1"] < one["cuts"][-1]["band_percent"]["T1"]


def test_the_console_tells_one_table_of_modes(capsys, monkeypatch, turning):
    monkeypatch.setenv("COLUMNS", "160")
    found = coupled_by_hand.identification(turning)
    show_identification(found, mode_deviations(found))
    text = capsys.readouterr().out
    assert text.count("modes at the flange") == 1
    assert "X and Y together, spindle at standstill" in text
    assert "direction deg" in text
    assert text.count(coupled_by_hand.WORDS) == 1
