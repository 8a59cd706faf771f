"""The forces command: files in, FORCES.csv, pictures, wear table and summary out; errors in one sentence."""

from __future__ import annotations

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.forces import forces
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.curves.forces import read_forces_csv, sensors_of_result, write_forces_csv
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.results.parts import read_result, write_result
from tests.fixtures.flange_machine import BAND, flange_keys, paper_cut
from tests.fixtures.oblique_cut import oblique_cut, oblique_machine
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.virtual_cut import relative_error

app = typer.Typer()
app.command()(forces)


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """RESULT.json of the machine, TOOLING.toml with two teeth, both recordings."""
    folder, made = tmp_path_factory.mktemp("forces"), paper_cut()
    sensors = {s.name: {"quantity": str(s.quantity), "axis": s.axis.upper(), "sensitivity": s.sensitivity} for s in made.cut.sensors}
    write_result(
        folder / "RESULT.json",
        {
            "schema_version": 1, "status": "converged", "reasons": [], "seed": 1, "method": "default", "software": "by hand",
            "campaign": {"name": "by hand", "cuts_used": 0, "cuts_left_out": []}, "sensors": sensors,
            "workpiece": {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26},
            "band_hz": [w / (2.0 * np.pi) for w in BAND], "axes": flange_keys(),
        },
    )  # fmt: skip
    text = (TOOLINGS / "S2-PG25.toml").read_text(encoding="utf-8")
    (folder / "T.toml").write_text(text.replace("teeth = 4", "teeth = 2"), encoding="utf-8")
    for name, recording in (("cut.h5", made.cut), ("air.h5", made.air)):
        channels = {s.name: recording.samples[:, i] * s.sensitivity for i, s in enumerate(recording.sensors)}
        write_hdf5(folder / name, recording.rate, channels)
    return folder


def arguments(folder, *more):
    return (folder / "RESULT.json", folder / "T.toml", folder / "cut.h5", "--out", folder / "F.csv", "--speed-rpm", 12000, *more)


@pytest.mark.slow
def test_forces_of_a_recording(folder):
    result = run(*arguments(folder, "--air", folder / "air.h5"))
    time, force, deviation = read_forces_csv(folder / "F.csv")
    assert (folder / "F.csv").read_text(encoding="utf-8").splitlines()[0] == "time_s,Fx_n,Fy_n,Fx_std_n,Fy_std_n"
    made = paper_cut()
    # the observer's start is left out, of a short recording half
    half = made.cut.samples.shape[0] // 2
    np.testing.assert_allclose(time, made.cut.time[half:], atol=1e-12)
    assert f"left out: the first {time[0]:.3f} s" in result.stdout
    assert np.all(relative_error(np.stack([force["X"], force["Y"]], axis=1), made.force, made.cut.rate) < 0.04)
    assert all(np.all(each > 0.0) for each in deviation.values())
    assert "400 Hz, lies below the identified band" in result.stderr
    assert "written" in result.stdout


@pytest.mark.slow
def test_json_pictures_wear_and_smoothing(folder):
    result = run(
        *arguments(folder, "--air", folder / "air.h5", "--smooth", "--json", "--plot", folder / "F.png", "--wear", folder / "W.csv"),
        "--axial-depth-mm", 1, "--feed-mm", 0.15,
    )  # fmt: skip
    data = json.loads(result.stdout)
    assert data["smoothed"]
    assert data["observer"] == "resonators"
    assert data["spindle_speed_rpm"] == pytest.approx(paper_cut().spindle_speed * 30.0 / np.pi, rel=1e-6)
    assert data["axes"]["X"]["rms_n"] == pytest.approx(np.std(paper_cut().force[:, 0]), rel=0.05)
    low, high = data["axes"]["Y"]["usable_at_lines_hz"]
    assert low < 410.0
    assert high > 4000.0
    assert data["wear"]["coefficients"]["K_tc"]["mean"] == pytest.approx(902.0, rel=0.05)
    assert data["wear"]["separable"]
    assert any("400 Hz" in text for text in data["warnings"])
    for name in ("F.png", "F-observer.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    header, *rows = (folder / "W.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("time_s,K_tc_mpa,K_tc_std_mpa,K_tc_tracked_mpa")
    assert len(rows) == 39
    assert float(rows[0].split(",")[0]) > data["left_out_s"] > 0.1


@pytest.mark.slow
def test_the_papers_walk_lags(folder):
    data = json.loads(run(*arguments(folder, "--air", folder / "air.h5", "--observer", "random-walk", "--json")).stdout)
    assert data["axes"]["X"]["delay_s"] * 25600.0 == pytest.approx(5.3, abs=1.0)


@pytest.mark.slow
def test_the_mean_where_the_cut_is_interrupted(folder):
    data = json.loads(run(*arguments(folder, "--air", folder / "air.h5", "--idle-percent", 40, "--json")).stdout)
    _, force, _ = read_forces_csv(folder / "F.csv")
    for i, axis in enumerate("XY"):
        true = paper_cut().force[:, i]
        assert data["axes"][axis]["mean_n"] == pytest.approx(true.mean(), abs=0.05 * np.std(true) + 1.0)
        assert np.mean(force[axis][2000:]) == pytest.approx(true.mean(), abs=0.1 * np.std(true) + 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "text"),
    [
        (("--speed-rpm", "-3"), "--speed-rpm"),
        (("--bandwidth-hz", "0"), "--bandwidth-hz"),
        (("--bandwidth-hz", "100"), "harmonics in the band"),
        (("--plot", "F.gif"), "--plot"),
        (("--idle-percent", "120"), "--idle-percent: found 120 %"),
        (("--wear", "W.csv"), "--axial-depth-mm"),
        (("--out", "no/such/F.csv"), "--out"),
        (("--air", "nowhere.h5"), "nowhere.h5"),
        (("--speed-rpm", "7000"), "7000 rev/min, whose orders"),
    ],
)
def test_bad_input_is_told_in_a_sentence(folder, more, text, monkeypatch):
    monkeypatch.chdir(folder)
    result = run(*arguments(folder, *more), code=2)
    assert text in result.stderr
    assert result.stderr.count("found") == 1


@pytest.mark.slow
def test_without_speed_and_trigger_the_speed_is_asked_for(folder):
    result = run(folder / "RESULT.json", folder / "T.toml", folder / "cut.h5", "--out", folder / "F.csv", code=2)
    assert "--speed-rpm: found none, and no trigger" in result.stderr


def test_forces_file_reads_back_exactly(tmp_path):
    rng = np.random.default_rng(1)
    time, force, deviation = np.arange(5) / 25600.0, {"Y": rng.normal(size=5)}, {"Y": rng.uniform(size=5)}
    write_forces_csv(tmp_path / "F.csv", time, force, deviation)
    found = read_forces_csv(tmp_path / "F.csv")
    np.testing.assert_array_equal(found[0], time)
    np.testing.assert_array_equal(found[1]["Y"], force["Y"])
    np.testing.assert_array_equal(found[2]["Y"], deviation["Y"])
    assert list(found[1]) == ["Y"]
    for wrong in ({}, {"Z": np.zeros(5)}, {"X": np.zeros(4)}, {"X": np.full(5, np.nan)}):
        with pytest.raises(InputError):
            write_forces_csv(tmp_path / "G.csv", time, wrong, {})
    (tmp_path / "H.csv").write_text("time_s,torque\n0.0,1.0\n", encoding="utf-8")
    with pytest.raises(InputError, match="Fx_n"):
        read_forces_csv(tmp_path / "H.csv")


@pytest.mark.slow
def test_sensors_of_a_result(folder):
    sensors = sensors_of_result(read_result(folder / "RESULT.json"), "r")
    assert [(s.name, s.axis) for s in sensors][:2] == [("flange_x", Dof.X), ("flange_y", Dof.Y)]
    assert sensors[2].sensitivity == pytest.approx(1.1094e-3)
    with pytest.raises(InputError, match="sensors"):
        sensors_of_result({"sensors": {}}, "r")


@pytest.mark.slow
def test_axes_that_feel_each_other(folder, tmp_path, monkeypatch):
    """Forces of both; with one axis' sensors alone it says what it takes for that axis' force. The machine is known, not identified."""
    sensors = oblique_cut().cut.sensors
    monkeypatch.setattr("rcsa_ident.cli.results.read_machine", lambda _: oblique_machine())
    monkeypatch.setattr("rcsa_ident.cli.forces._sensors", lambda *_: sensors)
    for name, recording in (("cut.h5", oblique_cut().cut), ("air.h5", oblique_cut().air)):
        channels = {s.name: recording.samples[:, i] * s.sensitivity for i, s in enumerate(recording.sensors)}
        write_hdf5(tmp_path / name, recording.rate, channels)
    asked = (folder / "RESULT.json", folder / "T.toml", tmp_path / "cut.h5", "--out", tmp_path / "F.csv", "--speed-rpm", 12000)
    data = json.loads(run(*asked, "--air", tmp_path / "air.h5", "--json", "--idle-percent", 40, "--plot", tmp_path / "F.png").stdout)
    assert data["axes"]["X"]["rms_n"] == pytest.approx(np.std(oblique_cut().force[:, 0]), rel=0.05)
    assert data["axes"]["X"]["order"] == data["axes"]["Y"]["order"]
    assert not any("feel each other" in text for text in data["warnings"])
    monkeypatch.setattr("rcsa_ident.cli.forces._sensors", lambda *_: sensors[::2])
    alone = run(*asked, "--air", tmp_path / "air.h5")
    assert "X and Y feel each other, and Y has no displacement sensor" in alone.stderr
    assert "Y: rms" not in alone.stdout
