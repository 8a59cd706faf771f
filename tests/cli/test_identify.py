"""identify: warm start, speed bands, one answer on any number of processes, and what is refused before the long work."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.base.remarks import Remark
from rcsa_ident.cli import app
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.diagnostics import failed
from rcsa_ident.identification.result import IdentificationCode
from rcsa_ident.identification.status import Status
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.setups import read_campaign
from tests.fixtures import by_hand
from tests.fixtures.campaign import part_of_the_sample_runs
from tests.fixtures.kept import kept


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A result of the small campaign, found without a start."""
    path = tmp_path_factory.mktemp("first") / "RESULT.json"
    path.write_text(kept(_first), encoding="utf-8")
    return path


def _first():
    with TemporaryDirectory() as scratch:
        path = Path(scratch) / "RESULT.json"
        run("identify", part_of_the_sample_runs(Path(scratch) / "small", 4), "--out", path, "--processes", 1)
        return path.read_text(encoding="utf-8")


def without_covariance(data):
    for axis in data["axes"].values():
        del axis["covariance"]
    return data


def without_axes(data):
    return data | {"status": "failed", "axes": {}}


def published(data):
    return without_covariance(data) | {"method": "paper"}


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (without_covariance, ["axes.X", "found no covariance", "a result of the default method"]),
        (published, ["axes.X", "found no covariance", "a result of the default method"]),
        (without_axes, ["axes", "the identification has failed"]),
        (lambda data: {"seed": 1}, ["schema_version", "found nothing"]),
        (lambda data: [], ["content", "an empty list"]),
    ],
)  # fmt: skip
def test_a_start_that_is_none_is_refused_in_one_sentence(tmp_path, small_campaign, result_file, spoil, words):
    start = tmp_path / "START.json"
    start.write_text(json.dumps(spoil(json.loads(result_file.read_text(encoding="utf-8")))), encoding="utf-8")
    out = tmp_path / "OUT.json"
    result = run("identify", small_campaign, "--out", out, "--start", start, "--processes", 1, code=2)
    for word in [str(start), *words]:
        assert word in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--start", "{}/none.json"], "none.json: result: found no such file"),
        (["--start", "{}"], "found a folder"),
        (["--start", "{}/RESULT.json", "--method", "paper"], "--start: found --method paper"),
        (["--speed-bands", "2", "--method", "paper"], "--speed-bands: found --method paper"),
        (["--speed-bands", "4"], "at least 8 cuts with each tooling in each of 4 bands"),
    ],
)
def test_options_that_do_not_go_together(tmp_path, small_campaign, result_file, options, words):
    out = tmp_path / "OUT.json"
    options = [option.format(tmp_path) for option in options]
    result = run("identify", small_campaign, "--out", out, "--processes", 1, *options, code=2)
    assert words in result.stderr
    assert not out.exists()


@pytest.fixture(scope="module")
def warm(tmp_path_factory, small_campaign, first):
    """The same cuts from that result on, and what was printed."""
    path = tmp_path_factory.mktemp("warm") / "RESULT.json"
    return path, run("identify", small_campaign, "--out", path, "--start", first, "--processes", 1).stdout


@pytest.mark.slow
def test_two_processes_write_the_same_bytes(tmp_path, small_campaign, first, warm):
    run("identify", small_campaign, "--out", tmp_path / "two.json", "--start", first, "--processes", 2)
    assert (tmp_path / "two.json").read_bytes() == warm[0].read_bytes()


@pytest.mark.slow
def test_a_warm_start_says_the_same_of_a_tip(small_campaign, first, warm):
    assembly = read_campaign(small_campaign).toolings["S1-ER32"].assembly
    omega = 2.0 * np.pi * np.linspace(600.0, 4000.0, 100)
    again, cold = (machine_from_json(read_result(path), "").tip(assembly, omega, spread=False) for path in (warm[0], first))
    for tip in ("tip.x", "tip.y"):
        assert np.linalg.norm(again.between(tip, tip) - cold.between(tip, tip)) < 0.01 * np.linalg.norm(cold.between(tip, tip))
    assert read_result(warm[0])["started_from"] == "RESULT.json"
    assert "started_from" not in read_result(first)


@pytest.mark.slow
def test_modes_of_notes_are_those_of_the_result(warm):
    """To the hertz: their frequencies are those of the damped machine, not the undamped one that is searched for."""
    data = read_result(warm[0])
    outside = [note for note in data["notes"] if " lie outside the excited band" in note]
    told = {note.split(":")[0]: re.findall(r"\d+", note.split(" lie ")[0]) for note in outside}
    assert told
    for axis, frequencies in told.items():
        kept = [f"{mode['natural_frequency_hz']:.0f}" for mode in data["axes"][axis]["modes"]]
        assert set(frequencies) <= set(kept)


def test_notes_and_coefficients_are_printed_and_written(warm):
    data, printed = read_result(warm[0]), warm[1]
    assert "tangential coefficient: " in printed
    assert "times the campaign's" in printed
    assert "±" in printed
    for note in data["notes"]:
        assert f"note: {note}" in printed
    mode = data["axes"]["X"]["modes"][0]
    assert mode["natural_frequency_std_hz"] > 0.0
    assert data["coefficients"]["tangential coefficient"]["std"] > 0.0


@pytest.mark.slow
def test_a_method_sees_the_cuts_of_its_band_alone(tmp_path, small_campaign, monkeypatch):
    """The whole way through the command with a method that only counts, since the search itself has its own tests."""

    from rcsa_ident.identification import evidence

    seen = []

    class Counting:
        def __init__(self, start=None):
            self.start = start

        def run(self, data, seed, map, progress=None):
            seen.append((data.cut_ids, data.speed_range, self.start))
            return by_hand.identification()

    monkeypatch.setattr(evidence, "EvidenceSelection", Counting)
    out = tmp_path / "R.json"
    monkeypatch.setattr("rcsa_ident.workflows.speed_bands.FEWEST_CUTS", 4)
    # the ids of the hand-made answer are not the campaign's: only the bands' part of the file is of interest
    monkeypatch.setattr("rcsa_ident.io.results.identifications._delays", lambda *_: {})
    run("identify", small_campaign, "--out", out, "--speed-bands", 2, "--processes", 1, code=3)
    whole, *bands = seen
    assert whole[2] is None
    assert sorted(bands[0][0] + bands[1][0]) == sorted(whole[0])
    assert bands[0][1][0] < whole[1][0] < bands[1][1][0]
    assert all(set(start) == {Dof.X, Dof.Y} for _, _, start in bands)
    data = read_result(out)
    low, high = ([edge * np.pi / 30.0 for edge in band["speed_range_rpm"]] for band in data["speed_bands"])
    assert low[1] == pytest.approx(high[0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"reasons": (Remark(IdentificationCode.NOT_CONVERGED, "it was still gaining"),)}, 3),
        ({"reasons": (Remark(IdentificationCode.FEW_CUTS, "few cuts with a tooling that is called converged"),)}, 3),
        ({"status": Status.CONVERGED, "reasons": ()}, 0),
        (None, 3),
    ],
)
def test_the_exit_code_follows_the_status(tmp_path, small_campaign, monkeypatch, change, code):
    from rcsa_ident.identification import evidence

    class Found:
        def __init__(self, start=None):
            pass

        def run(self, data, seed, map, progress=None):
            return failed(data, seed, "default") if change is None else replace(by_hand.identification(), **change)

    monkeypatch.setattr(evidence, "EvidenceSelection", Found)
    monkeypatch.setattr("rcsa_ident.io.results.identifications._delays", lambda *_: {})
    out = tmp_path / "R.json"
    report = ["--report", tmp_path / "report.html"] if change is None else []
    said = run("identify", small_campaign, "--out", out, "--processes", 1, *report, code=code)
    # it is written, whatever it is worth
    data = read_result(out)
    assert data["status"] == ("failed" if change is None else "suspect" if code else "converged")
    assert bool(data["reasons"]) is bool(code)
    assert [f"the result is {data['status']}: {reason}" in said.stderr for reason in data["reasons"][:1]] == [True] * bool(code)
    assert (data["axes"] == {}) is (change is None)


@pytest.mark.slow
def test_check_tells_that_cuts_are_too_few_to_identify(tmp_path):
    campaign = part_of_the_sample_runs(tmp_path, 40)
    words = "Too few for an identification that can be relied on: it needs two toolings with 8 usable cuts each, better 20."
    assert f"warning: {words}" in run("check", campaign, "--processes", 1).stderr
    assert json.loads(run("check", campaign, "--processes", 1, "--json").stdout)["too_few"] == words


def test_check_warns_of_what_is_unusual_about_a_campaign(tmp_path):
    campaign = part_of_the_sample_runs(tmp_path, 40)
    for path in campaign.rglob("toolings/S1-ER32.toml"):
        path.write_text(
            path.read_text(encoding="utf-8").replace("inner_diameter_mm = 12.0", "inner_diameter_mm = 20.0", 1), encoding="utf-8"
        )
    found = run("check", campaign, "--processes", 1)
    words = "S1-ER32: holder.segments[0].inner_diameter_mm is 20 mm around a tool that is 12 mm thick there"
    assert f"warning: {words}" in found.stderr
    (told,) = json.loads(run("check", campaign, "--processes", 1, "--json").stdout)["warnings"]
    assert told.startswith(words)
