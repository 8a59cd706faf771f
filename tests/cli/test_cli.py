"""The commands as a user meets them: exit codes, sentences, files."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.io.curves.tips import read_frf_csv, read_lobes_csv, write_frf_csv
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.workflows.tool_change import tooltip
from tests.fixtures import by_hand
from tests.oracles import literature


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


@pytest.mark.slow
def test_help_names_every_command():
    text = run("--help").output
    for name in ("demo", "check", "identify", "tooltip", "lobes", "simulate", "warm"):
        assert name in text


@pytest.mark.slow
def test_help_imports_nothing_heavy():
    code = (
        "import sys; from rcsa_ident.cli import app\n"
        "try: app(['--help'])\nexcept SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'numba', 'pymoo', 'matplotlib', 'h5py'} & set(sys.modules)\n"
        "raise SystemExit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=dict(os.environ), check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_lobes_without_a_picture_import_nothing_that_draws(tmp_path, result_file, tooling_file):
    asked = ["lobes", str(result_file), str(tooling_file), "--out", str(tmp_path / "L.csv"), "--speed-from", "8000", "--speed-to", "8100"]
    code = (
        f"import sys; from rcsa_ident.cli import app\ntry: app({asked!r})\nexcept SystemExit: pass\n"
        "heavy = {'matplotlib', 'pymoo', 'scipy.signal', 'scipy.stats', 'h5py'} & set(sys.modules)\n"
        "raise SystemExit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=dict(os.environ), check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "L.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "{}/nowhere"], "found no such folder"),
        (["identify", "{}", "--out", "{}/R.json"], "campaign.toml"),
        (["identify", "{}", "--out", "{}/missing/R.json"], "existing folder"),
        (["tooltip", "{}/none.json", "{}/T1.toml", "--out", "{}/F.csv"], "none.json: result: found no such file"),
        (["tooltip", "{}/RESULT.json", "{}/T1.toml", "--out", "{}/F.csv", "--from", "0"], "--from"),
        (["tooltip", "{}/RESULT.json", "{}/T1.toml", "--out", "{}/F.csv", "--to", "50"], "--to"),
        (["lobes", "{}/T1.toml", "--out", "{}/L.csv"], "RESULT.json or FLANGE.csv, then TOOLING.toml"),
        (["lobes", "{}/RESULT.json", "{}/T1.toml", "--out", "{}/L.csv", "--immersion", "2"], "immersion"),
        (["lobes", "{}/RESULT.json", "{}/T1.toml", "--out", "{}/L.csv", "--entry-deg", "90"], "--exit-deg"),
        (["lobes", "{}/RESULT.json", "{}/T1.toml", "--out", "{}/L.csv", "--feed-direction", "north"], "--feed-direction"),
        (["lobes", "--frf", "X=tap.unv", "{}/T1.toml", "--out", "{}/L.csv", "--ktc-mpa", "900", "--krc", "0.3"], "tap.unv: FRF: found no"),
        (["lobes", "--frf", "{}/F.csv", "{}/T1.toml", "--out", "{}/L.csv"], "F.csv: FRF: found no such file"),
        (["simulate", "{}/none.toml", "--out", "{}/camp"], "none.toml"),
        (["demo", "--data", "{}/nowhere", "--out", "{}/report"], "found no such folder"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(tmp_path, result_file, arguments, words):
    result = run(*(a.format(tmp_path) for a in arguments), code=2)
    assert words in result.stderr
    sentences = [line for line in result.stderr.splitlines() if line and not line.startswith("warning: ")]
    assert len(sentences) == 1
    assert not list(tmp_path.glob("*.csv"))
    assert not list(tmp_path.glob("*.part"))


def test_bad_input_for_machines(tmp_path):
    result = run("check", tmp_path / "nowhere", "--json", code=2)
    assert json.loads(result.stdout)["field"] == "campaign"


def test_the_result_holds_what_later_commands_need(result_file):
    data = read_result(result_file)
    assert data["status"] == "suspect"
    assert data["campaign"] == {"name": "by hand", "cuts_used": 2, "cuts_left_out": [{"id": "T1-2", "reason": by_hand.LEFT_OUT[0][1]}]}
    assert data["band_hz"] == pytest.approx([600.0, 3000.0])
    assert data["sensors"]["trigger"] == {"quantity": "trigger", "pulses_per_revolution": 2, "tooth_angle_deg": pytest.approx(45.0)}
    assert data["sensors"]["flange_x"]["delay_s"] == 1e-5
    assert data["workpiece"]["radial_edge_n_per_mm"] == pytest.approx(5.0)
    # 1000 rad/s for 1 ms is a radian; 1100 rad/s for 2.5 ms is 157.56 degrees, 67.56 within a pitch of 90
    assert data["delays"]["T1-0"] == pytest.approx({"angle_deg": 57.29578, "std_deg": 0.0572958}, rel=1e-6)
    assert data["delays"]["T1-1"]["angle_deg"] == pytest.approx(67.5634, rel=1e-5)
    assert data["axes"]["X"]["model_error"] == 0.004
    machine = machine_from_json(data, str(result_file))
    for axis, part in by_hand.identification().axes.items():
        np.testing.assert_array_equal(machine.identified[axis].posterior.theta, part.posterior.theta)
        np.testing.assert_array_equal(machine.identified[axis].posterior.covariance, part.posterior.covariance)
        np.testing.assert_array_equal(machine.identified[axis].spindle.modes.phi, part.modes.phi)
        assert machine.identified[axis].joint == part.joint


def test_unknowns_that_do_not_fit_the_covariance_are_refused(tmp_path, result_file, tooling_file):
    data = json.loads(result_file.read_text(encoding="utf-8"))
    data["axes"]["Y"]["unknowns"].append(0.0)
    bad = tmp_path / "BAD.json"
    bad.write_text(json.dumps(data), encoding="utf-8")
    assert "axes.Y.unknowns" in run("tooltip", bad, tooling_file, "--out", tmp_path / "F.csv", code=2).stderr


@pytest.mark.slow
def test_tooltip_writes_the_coupled_receptance_with_bands(tmp_path, result_file, tooling_file):
    out = tmp_path / "FRF.csv"
    result = run("tooltip", result_file, tooling_file, "--out", out, "--from", 500, "--to", 2500, "--step", 20)
    assert "suspect" in result.stderr
    curves = read_frf_csv(out)
    np.testing.assert_allclose(curves.frequency, np.arange(500.0, 2501.0, 20.0))
    machine = machine_from_json(read_result(result_file), "")
    response = tooltip(machine, read_tooling(tooling_file), 2.0 * np.pi * curves.frequency).tip
    for axis in (Dof.X, Dof.Y):
        tip = Coordinate("tip", axis)
        np.testing.assert_allclose(curves.values[axis.upper()], response.between(str(tip), str(tip)), rtol=1e-12)
        real, imaginary = response.deviation()[tip, tip]
        assert np.all(real > 0.0)
        np.testing.assert_allclose(curves.bands[f"{axis.upper()}_re_std"], real, rtol=1e-12)
        np.testing.assert_allclose(curves.bands[f"{axis.upper()}_im_std"], imaginary, rtol=1e-12)


def test_tooltip_for_machines(tmp_path, result_file, tooling_file):
    result = run("tooltip", result_file, tooling_file, "--out", tmp_path / "F.csv", "--step", 20, "--no-bands", "--json")
    answer = json.loads(result.stdout)
    assert answer["peaks"]["X"]["magnitude"] > 0.0
    assert list(read_frf_csv(tmp_path / "F.csv").bands) == []


@pytest.mark.slow
def test_lobes_from_a_result_and_from_its_own_tip_agree(tmp_path, certain_file, tooling_file):
    speeds = ("--speed-from", 6000, "--speed-to", 12000, "--speed-step", 200)
    told = json.loads(run("lobes", certain_file, tooling_file, "--out", tmp_path / "a.csv", *speeds, "--json").stdout)
    run("tooltip", certain_file, tooling_file, "--out", tmp_path / "F.csv", "--no-bands")
    known = ("--ktc-mpa", 902, "--krc", 0.26)
    run("lobes", "--frf", tmp_path / "F.csv", tooling_file, "--out", tmp_path / "b.csv", *speeds, *known)
    run("lobes", "--frf", f"Y={tmp_path}/F.csv", "--frf", f"x={tmp_path}/F.csv", tooling_file, "--out", tmp_path / "c.csv", *speeds, *known)
    a, b, c = (read_lobes_csv(tmp_path / f"{name}.csv") for name in "abc")
    assert a.speed.size == 31
    np.testing.assert_allclose(a.limit, b.limit, rtol=1e-9)
    np.testing.assert_array_equal(b.limit, c.limit)
    # a preview has no band; where the recommended cuts are, it lies around the limit, up to a pocket's tip that every change makes lower
    assert "limit_depth_low_mm" not in a.extra
    low, limit, high = np.concatenate(
        [[each[f"limit_depth_{name}mm"] for name in ("low_", "", "high_")] for each in told["around"]], axis=1
    ).astype(float)
    assert np.all(low < high)
    assert np.mean((low <= limit) & (limit <= high)) > 0.8


@pytest.mark.slow
def test_lobes_from_modes_reproduce_the_published_table(tmp_path, tooling_file):
    case = literature.INSPERGER_STEPAN
    mode = "natural_frequency_hz = {}\ndamping_ratio = {}\nmodal_mass_kg = {}\n".format(
        case["natural_frequency_hz"], case["damping_ratio"], case["modal_mass"]
    )
    modes = tmp_path / "MODES.toml"
    modes.write_text(f"[[x]]\n{mode}[[y]]\n{mode}", encoding="utf-8")
    tooling = tmp_path / "two.toml"
    tooling.write_text(tooling_file.read_text(encoding="utf-8").replace("teeth = 4", "teeth = 2"), encoding="utf-8")
    for speed, limit in zip(literature.ZERO_ORDER_SLOT_RPM, literature.ZERO_ORDER_SLOT_LIMIT_MM, strict=True):
        run(
            "lobes", "--modes", modes, tooling, "--out", tmp_path / "L.csv", "--immersion", 1.0, "--ktc-mpa", 600.0, "--krc", 1.0 / 3.0,
            "--speed-from", speed, "--speed-to", speed, "--max-depth-mm", 1000.0,
        )  # fmt: skip
        assert read_lobes_csv(tmp_path / "L.csv").limit[0] == pytest.approx(limit, rel=3e-3)


@pytest.mark.slow
def test_lobes_leave_cells_empty_where_the_cut_is_stable(tmp_path, result_file, tooling_file):
    out = tmp_path / "L.csv"
    answer = run("lobes", result_file, tooling_file, "--out", out, "--max-depth-mm", 0.01, "--speed-step", 4000, "--json").stdout
    rows = list(csv.DictReader(out.read_text(encoding="utf-8").splitlines()))
    assert [row["spindle_speed_rpm"] for row in rows] == ["4000.0", "8000.0", "12000.0", "16000.0", "20000.0"]
    assert {row[key] for row in rows for key in ("limit_depth_mm", "chatter_frequency_hz", "lobe")} == {""}
    (best,) = json.loads(answer.splitlines()[-1])["best_speeds"]
    # how deep the search went recommends nothing
    assert best == {"spindle_speed_rpm": pytest.approx(12000.0), "limit_depth_mm": None, "recommended_depth_mm": None}
    said = run("lobes", result_file, tooling_file, "--out", out, "--max-depth-mm", 0.01, "--speed-step", 4000).stdout
    assert "at 12000 rev/min nothing up to 0.01 mm limits the cut, so no depth is recommended" in said
    assert "0.009" not in said.replace("0.01 mm", "")


def test_one_axis_alone_is_rigid_in_the_other(tmp_path, tooling_file):
    frequency = np.arange(300.0, 2000.0, 2.0)
    w, natural = 2.0 * np.pi * frequency, 2.0 * np.pi * 900.0
    write_frf_csv(tmp_path / "x.csv", frequency, {"X": 1.0 / (0.05 * (natural**2 - w**2 + 0.04j * natural * w))})
    known = ("--ktc-mpa", 900, "--krc", 0.3, "--speed-step", 1000, "--out", tmp_path / "L.csv")
    run("lobes", "--frf", tmp_path / "x.csv", tooling_file, *known)
    limit = read_lobes_csv(tmp_path / "L.csv").limit
    assert np.nanmin(limit) > 0.0
    assert "axis Y" in run("lobes", "--frf", f"Y={tmp_path}/x.csv", tooling_file, *known, code=2).stderr
    assert "twice" in run("lobes", "--frf", tmp_path / "x.csv", "--frf", f"X={tmp_path}/x.csv", tooling_file, *known, code=2).stderr
