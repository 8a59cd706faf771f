"""learn with a campaign or taps on the command line: what is written, refusals, and what contradicts."""

from __future__ import annotations

import json
import re

import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.toml_text import toml_of
from tests.fixtures import further_cuts
from tests.fixtures.campaign import part_of_the_sample_runs


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture(scope="module")
def one_cut(tmp_path_factory):
    """The first of the sample runs, of a tooling whose drawing is an honest one's."""
    folder = part_of_the_sample_runs(tmp_path_factory.mktemp("one"), 1000)
    for path in (folder / "toolings").glob("*.toml"):
        known, *_ = path.read_text(encoding="utf-8").partition("[spread]")
        path.write_text(known + "\n[spread]\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def name(one_cut):
    """File name of the tooling that cut."""
    text = (one_cut / "campaign.toml").read_text(encoding="utf-8")
    key = re.search(r'^tooling = "(.+)"$', text, flags=re.MULTILINE).group(1)
    return re.search(rf'^"?{key}"? = "toolings/(.+)"$', text, flags=re.MULTILINE).group(1)


@pytest.mark.slow
def test_a_cut_of_another_machine_contradicts_and_nothing_is_written(result_file, one_cut, tmp_path):
    found = run(
        "learn", result_file, one_cut, "--toolings", tmp_path / "out", "--machine", tmp_path / "NEW.json", "--json", "--processes", 1
    )
    assert found.exit_code == 3, found.output
    answer = json.loads(found.stdout)
    (tooling,) = answer["toolings"]
    assert tooling["file"] is None
    assert "no tooling near its drawing explains its cuts" in tooling["contradiction"]
    assert not list((tmp_path / "out").iterdir())
    assert not (tmp_path / "NEW.json").exists()


@pytest.mark.slow
def test_nothing_is_overwritten_silently(result_file, one_cut, name, tmp_path):
    (tmp_path / name).write_text("mine", encoding="utf-8")
    found = run("learn", result_file, one_cut, "--toolings", tmp_path, "--processes", 1)
    assert found.exit_code == 2
    assert "found a file that is there, allowed is a name that is free, or --overwrite" in found.stderr
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine"


@pytest.mark.slow
def test_an_exact_drawing_is_refused_before_the_fit(result_file, tmp_path):
    (tmp_path / "runs").mkdir()
    folder = part_of_the_sample_runs(tmp_path / "runs", 1000)
    found = run("learn", result_file, folder, "--toolings", tmp_path / "out", "--processes", 1)
    assert found.exit_code == 2
    assert "a table [spread] in its file" in found.stderr


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """RESULT.json of the sample machine, T7.toml, and what a hammer test of T7's tip and one of another tool's have shown."""
    folder = tmp_path_factory.mktemp("known")
    (folder / "RESULT.json").write_text(further_cuts.result_text(), encoding="utf-8")
    (folder / "T7.toml").write_text(toml_of(further_cuts.drawn()), encoding="utf-8")
    further_cuts.write_tap(folder / "tip.csv")
    further_cuts.write_tap(folder / "other.csv", "S1-ER32")
    return folder


def with_taps(known, *arguments, file="tip.csv"):
    taps = [part for axis in "XY" for part in ("--taps", f"{axis}={known / file}")]
    return run("learn", known / "RESULT.json", known / "T7.toml", *taps, *arguments)


@pytest.mark.slow
def test_a_tap_teaches_a_tooling_and_the_machine_once(known, tmp_path):
    out, new = tmp_path / "out", tmp_path / "NEW.json"
    found = with_taps(known, "--toolings", out, "--machine", new, "--json")
    assert found.exit_code == 0, found.output
    answer = json.loads(found.stdout)
    (tooling,) = answer["toolings"]
    assert (answer["status"], tooling["file"]) == ("converged", str(out / "T7.toml"))
    # its contact was drawn at 0.7 of what it is: nearer to that, and surer
    drawn, learnt = (read_tooling(path).assembly.contact.rotational_stiffness for path in (known / "T7.toml", out / "T7.toml"))
    true = drawn / further_cuts.SOFTER
    # how far a tap teaches hangs on how well the machine is known, and that on the valley of a search as small as this one
    assert abs(learnt - true) < 0.8 * abs(drawn - true)
    assert read_tooling(out / "T7.toml").spread.contact_stiffness < 0.35
    data = json.loads(new.read_text(encoding="utf-8"))
    assert data["taught_by"] == ["taps of T7"]
    assert len(data["taught_recordings"]) == 1
    # the same file under another name would count twice
    again = tmp_path / "renamed.csv"
    again.write_bytes((known / "tip.csv").read_bytes())
    second = run("learn", new, known / "T7.toml", "--taps", f"X={again}", "--toolings", tmp_path / "again")
    assert second.exit_code == 2
    assert "renamed.csv, which taught this machine already" in second.stderr.replace("\n", " ")


@pytest.mark.slow
def test_a_tap_of_another_tool_is_told_and_nothing_is_written(known, tmp_path):
    found = with_taps(known, "--toolings", tmp_path / "out", "--machine", tmp_path / "NEW.json", "--json", file="other.csv")
    assert found.exit_code == 3, found.output
    (tooling,) = json.loads(found.stdout)["toolings"]
    assert "its taps" in tooling["contradiction"]
    assert not list((tmp_path / "out").iterdir())
    assert not (tmp_path / "NEW.json").exists()


@pytest.mark.slow
def test_a_campaign_may_hold_taps_alone(known, tmp_path):
    folder = tmp_path / "tapped"
    folder.mkdir()
    keys = further_cuts.tapped("tip.csv") | {"toolings": {"T7": "T7.toml"}}
    (folder / "campaign.toml").write_text(toml_of(keys), encoding="utf-8")
    for name in ("T7.toml", "tip.csv"):
        (folder / name).write_bytes((known / name).read_bytes())
    found = run("learn", known / "RESULT.json", folder, "--toolings", tmp_path / "out", "--json", "--processes", 1)
    assert found.exit_code == 0, found.output
    alone = with_taps(known, "--toolings", tmp_path / "alone", "--json")
    assert json.loads(found.stdout)["toolings"][0]["learned"] == json.loads(alone.stdout)["toolings"][0]["learned"]


@pytest.mark.parametrize(
    ("taps", "options", "words"),
    [
        (["XY=tip.csv"], ["--toolings", "out"], "--taps: found no FRF of axis XY"),
        (["X=tip.csv"], ["--out", "L.json"], "--taps: found no --toolings"),
        (["X=none.csv"], ["--toolings", "out"], "none.csv"),
    ],
)
def test_taps_that_tell_nothing_are_refused(result_file, tmp_path, monkeypatch, taps, options, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "T7.toml").write_text(toml_of(further_cuts.drawn()), encoding="utf-8")
    text = "frequency_hz,X_re,X_im\n" + "".join(f"{f}.0,1e-7,-1e-8\n" for f in range(500, 600))
    (tmp_path / "tip.csv").write_text(text, encoding="utf-8")
    found = run("learn", result_file, "T7.toml", *(part for tap in taps for part in ("--taps", tap)), *options)
    assert found.exit_code == 2, found.output
    assert words in found.stderr.replace("\n", " ")
