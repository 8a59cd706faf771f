"""A flange that was measured stands where an identified machine does: tooltip, lobes, advise, forces."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.curves.flanges import write_flange_machine
from rcsa_ident.io.curves.forces import read_forces_csv
from rcsa_ident.io.curves.tips import read_frf_csv, read_lobes_csv, write_frf_csv
from rcsa_ident.io.recordings.readers import write_recording
from tests.fixtures import by_hand
from tests.fixtures.flange_machine import decoupled_file, flange_machine, paper_cut
from tests.fixtures.paths import SAMPLES, TOOLINGS
from tests.fixtures.virtual_cut import relative_error

#: Of the workpiece that the result knows and a measurement does not.
CUT = ("--ktc-mpa", 902, "--krc", 0.26, "--kre-n-per-mm", 5)
SPEEDS = ("--speed-from", 6000, "--speed-to", 12000, "--speed-step", 100)


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


def answer_of(*arguments):
    return json.loads(run(*arguments, "--json").stdout.splitlines()[-1])


@pytest.fixture
def flange(tmp_path):
    return by_hand.flange_file(tmp_path / "FLANGE.csv")


def test_the_tip_is_that_of_the_machine_that_was_measured(tmp_path, result_file, tooling_file, flange):
    """At every frequency of the measurement, and from its first to its last where nobody says which."""
    curves = []
    for file, more in ((flange, ()), (result_file, ("--no-bands",))):
        result = run("tooltip", file, tooling_file, "--out", tmp_path / "F.csv", *more)
        curves.append(read_frf_csv(tmp_path / "F.csv"))
        assert ("suspect" in result.stderr) == (file is result_file)
    measured, identified = curves
    np.testing.assert_array_equal(measured.frequency, np.arange(100.0, 3001.0))
    for axis in "XY":
        np.testing.assert_allclose(measured.values[axis], identified.values[axis], rtol=1e-7)
    # nobody has said how well it was measured
    assert not measured.bands
    beyond = run("tooltip", flange, tooling_file, "--out", tmp_path / "G.csv", "--to", 3500, code=2)
    assert "100 to 3000 Hz, where the flange was measured" in beyond.stderr
    assert not (tmp_path / "G.csv").exists()


def test_curves_begin_where_the_measurement_begins(tmp_path, tooling_file, flange):
    head, *rows = flange.read_text(encoding="utf-8").splitlines()
    flange.write_text("\n".join([head, *rows[400:]]) + "\n", encoding="utf-8")
    run("tooltip", flange, tooling_file, "--out", tmp_path / "F.csv")
    assert read_frf_csv(tmp_path / "F.csv").frequency[0] == 500.0
    assert "500 to 3000 Hz" in run("tooltip", flange, tooling_file, "--out", tmp_path / "F.csv", "--from", 100, code=2).stderr


@pytest.mark.slow
def test_lobes_and_advice_are_those_of_the_machine_that_was_measured(tmp_path, result_file, tooling_file, flange):
    lobes, advice = [], []
    for name, file, more in (("a", flange, ()), ("b", result_file, ("--no-bands",))):
        common = (file, tooling_file, *CUT, *SPEEDS, *more)
        answer = answer_of("lobes", *common, "--out", tmp_path / f"{name}.csv")
        lobes.append((answer, read_lobes_csv(tmp_path / f"{name}.csv")))
        advice.append(answer_of("advise", *common, "--feed-per-tooth-mm", 0.1, "--cut", "9000:0.3")["toolings"][0])
    (told, measured), (_, identified) = lobes
    np.testing.assert_allclose(measured.limit, identified.limit, rtol=1e-6)
    np.testing.assert_allclose(measured.extra["recommended_depth_mm"], identified.extra["recommended_depth_mm"], rtol=1e-6)
    assert not any("suspect" in w for w in told["warnings"])
    for one, other in zip(advice[0]["highest_removal"], advice[1]["highest_removal"], strict=True):
        assert one["bound"] == other["bound"]
        for key in ("spindle_speed_rpm", "recommended_depth_mm", "limit_depth_mm", "removal_rate_cm3_per_min", "power_kw", "torque_nm"):
            # through modes that were fitted to either
            assert one[key] == pytest.approx(other[key], rel=2e-3)
    assert advice[0]["planned"][0]["margin"] == pytest.approx(advice[1]["planned"][0]["margin"], rel=5e-3)
    assert advice[0]["planned"][0]["probability"] is None


@pytest.fixture(scope="module")
def monitored(tmp_path_factory):
    """FLANGE.csv of the sample machine, its tooling with two teeth, a cut and an air cut."""
    folder, made = tmp_path_factory.mktemp("monitored"), paper_cut()
    write_flange_machine(folder / "FLANGE.csv", flange_machine())
    text = (TOOLINGS / "S2-PG25.toml").read_text(encoding="utf-8")
    (folder / "T.toml").write_text(text.replace("teeth = 4", "teeth = 2"), encoding="utf-8")
    for name, recording in (("cut.h5", made.cut), ("air.h5", made.air)):
        write_recording(folder / name, recording)
    return folder


@pytest.mark.slow
def test_forces_with_the_sensors_of_a_campaign(monitored):
    """The file holds the bare flange and the joint in front of it, behind which the sensor looks."""
    files = (monitored / "FLANGE.csv", monitored / "T.toml", monitored / "cut.h5")
    common = ("--air", monitored / "air.h5", "--speed-rpm", 12000, "--out", monitored / "F.csv")
    run("forces", *files, *common, "--sensors", SAMPLES)
    _, force, _ = read_forces_csv(monitored / "F.csv")
    made = paper_cut()
    assert np.all(relative_error(np.stack([force["X"], force["Y"]], axis=1), made.force, made.cut.rate) < 0.03)
    refused = run("forces", *files, *common, code=2)
    assert "--sensors CAMPAIGN" in refused.stderr


def test_forces_of_a_decoupled_flange_are_refused(monitored):
    """It holds the joint's compliance: the sensor would seem to look at the tool-holder, and C31 was 5 % off, without a word."""
    flange = decoupled_file(monitored / "DECOUPLED.csv")
    asked = (flange, monitored / "T.toml", monitored / "cut.h5", "--speed-rpm", 12000, "--sensors", SAMPLES, "--out", monitored / "D.csv")
    refused = run("forces", *asked, code=2)
    assert "DECOUPLED.csv: machine: found a flange that holds the compliance of its joint" in refused.stderr
    assert "a bare flange with its joint" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert json.loads(run("forces", *asked, "--json", code=2).stdout)["field"] == "machine"
    assert not (monitored / "D.csv").exists()


def test_a_hammer_test_behind_the_joint_does_not_stand_beside_a_decoupled_flange(monitored):
    flange, frequency = decoupled_file(monitored / "DECOUPLED.csv"), np.arange(600.0, 4000.0, 5.0)
    write_frf_csv(monitored / "tap.csv", frequency, {"X": 1e-8 / (1.0 + 0.1j * frequency / 1000.0)})
    for place in ("cross", "spindle"):
        refused = run("compare", flange, monitored / "T.toml", "--hammer", f"{place}={monitored / 'tap.csv'}", code=2)
        assert "a flange that holds the compliance of its joint" in refused.stderr.replace("\n", " ")
    run("compare", flange, monitored / "T.toml", "--hammer", f"tip={monitored / 'tap.csv'}")


def test_a_flange_measured_too_coarsely_is_said(tmp_path, tooling_file, flange):
    """Where whatever else speaks against a machine is said: warnings of the answer, and lines of the console."""
    head, *rows = flange.read_text(encoding="utf-8").splitlines()
    flange.write_text("\n".join([head, *rows[::60]]) + "\n", encoding="utf-8")
    asked = ("lobes", flange, tooling_file, *CUT, *SPEEDS, "--out", tmp_path / "L.csv")
    for axis in "XY":
        assert any(w.startswith(f"{axis}: flange measured too coarsely") for w in answer_of(*asked)["warnings"])
        assert f"{axis}: flange measured too coarsely" in run(*asked).stderr.replace("\n", " ")
    tip = run("tooltip", flange, tooling_file, "--out", tmp_path / "F.csv")
    assert "flange measured too coarsely" in tip.stderr.replace("\n", " ")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("X_tM_re", "X_tm_re"), "FLANGE.csv: column X_tM_re: found nothing"),
        (lambda text: text.replace("\n101.0,", "\n99.0,"), "FLANGE.csv"),
        (lambda text: text.replace("\n101.0,", "\nalmost,"), "line 3"),
        (lambda text: "frequency_hz,speed\n1,2\n", "no columns X_tF_re or Y_tF_re"),
        (lambda text: "\n".join(text.splitlines()[:3]) + "\n", "at least four"),
        (lambda text: "", "FLANGE.csv"),
    ],
)
def test_a_broken_flange_is_told_in_a_sentence(tmp_path, tooling_file, flange, change, words):
    flange.write_text(change(flange.read_text(encoding="utf-8")), encoding="utf-8")
    for command in ("tooltip", "lobes"):
        result = run(command, flange, tooling_file, "--out", tmp_path / "O.csv", *(CUT if command == "lobes" else ()), code=2)
        assert words in result.stderr
        assert len(result.stderr.splitlines()) == 1
        assert not (tmp_path / "O.csv").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "--ktc-mpa: found nothing"),
        (("--krc", 0.26), "--ktc-mpa: found nothing"),
        (("--ktc-mpa", 902), "--krc: found nothing"),
        (("--ktc-mpa", -1, "--krc", 0.26), "--ktc-mpa: found -1 MPa"),
        (("--ktc-mpa", "nan", "--krc", 0.26), "--ktc-mpa: found nan"),
        ((*CUT, "--runout-um", "1,2,3"), "--runout-um: found 3 numbers, allowed is 4, one for each tooth (in um)"),
        ((*CUT, "--runout-um", "1,a,3,4"), "--runout-um: found"),
        ((*CUT, "--runout-um", "10,0,0,0", "--method", "full-discretisation"), "--feed-per-tooth-mm: found nothing"),
        (("--material", "cheese"), "material: found"),
    ],
)
def test_errors_of_the_cut_keep_the_name_of_the_option(tmp_path, tooling_file, flange, options, words):
    """A measured flange knows no workpiece: what cuts has to be said."""
    for command, more in (("lobes", ("--out", tmp_path / "L.csv")), ("advise", ("--feed-per-tooth-mm", 0.1))):
        if command == "advise" and "--method" in options:
            continue
        result = run(command, flange, tooling_file, *more, *options, code=2)
        assert words in result.stderr
        assert len(result.stderr.splitlines()) == 1
        told = json.loads(run(command, flange, tooling_file, *more, *options, "--json", code=2).stdout)
        assert told["field"] == words.split(":")[0]
