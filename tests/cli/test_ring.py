"""ring on the command line: sounds in, a drawing out that is read again."""

from __future__ import annotations

import json

import pytest
import soundfile
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.setup.tooling import Tooling
from tests.fixtures.rung_tooling import rung_tooling


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture(scope="module")
def rung(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ring")
    return folder, *rung_tooling(folder)


@pytest.mark.slow
def test_a_drawing_is_corrected(rung):
    folder, grams, true = rung
    out = folder / "RUNG.toml"
    arguments = [folder / "DRAWN.toml", folder / "whole.wav", "--bare-tool", folder / "tool.wav", "--mass-g", grams, "--out", out]
    found = run("ring", *arguments, "--plot", folder / "ring.svg", "--json")
    assert found.exit_code == 0, found.stderr
    answer = json.loads(found.stdout)
    assert answer["status"] == "good"
    assert {row["is"] for row in answer["heard"]} >= {"bending 1", "bending 2"}
    change = next(row for row in answer["changes"] if row["what"] == "fluted diameter")
    assert change["before"] == pytest.approx(9.6)
    assert change["after"] == pytest.approx(1e3 * true.tool[0].diameter, abs=3.0 * change["after_std"])
    assert change["after_std"] < 0.3 * change["before_std"]
    again = read_tooling(out)
    assert isinstance(again, Tooling)
    assert (again.taper, again.name) == ("HSK-A63", "T")
    assert 1e3 * again.assembly.tool[0].diameter == pytest.approx(change["after"], rel=1e-9)
    assert again.spread.fluted_diameter == pytest.approx(change["after_std"] / change["after"], rel=1e-6)
    assert "bending 1" in (folder / "ring.svg").read_text(encoding="utf-8")
    words = run("ring", *arguments)
    assert "fluted diameter 9.60 ± 0.3 → 9.8" in words.stdout


@pytest.mark.parametrize("form", [(), ("--json",)], ids=["words", "json"])
def test_a_suspect_answer_is_written_and_ends_with_exit_code_3(rung, tmp_path, monkeypatch, form):
    monkeypatch.setattr("rcsa_ident.identification.ring.ringing.SUSPECT", 2.0)  # no probability is as high
    folder, _, _ = rung
    found = run("ring", folder / "DRAWN.toml", folder / "whole.wav", "--out", tmp_path / "R.toml", *form)
    assert (found.exit_code, (tmp_path / "R.toml").is_file()) == (3, True)
    assert "hardly go together" in found.stderr
    assert not form or json.loads(found.stdout)["status"] == "suspect"


def test_a_drawing_is_not_overwritten(rung):
    folder, _, _ = rung
    before = (folder / "DRAWN.toml").read_bytes()
    found = run("ring", folder / "DRAWN.toml", folder / "whole.wav", "--out", folder / "DRAWN.toml")
    assert (found.exit_code, (folder / "DRAWN.toml").read_bytes()) == (2, before)
    assert "not overwritten" in found.stderr


def test_lossy_sound_tells_frequencies_only(rung):
    folder, _, _ = rung
    samples, rate = soundfile.read(folder / "whole.wav")
    soundfile.write(folder / "whole.mp3", samples, rate)
    found = run("ring", folder / "DRAWN.toml", folder / "whole.mp3", "--out", folder / "lossy.toml", "--json")
    assert found.exit_code == 0, found.stderr
    answer = json.loads(found.stdout)
    assert any("lossy" in remark for remark in answer["remarks"])
    damping = next(row for row in answer["changes"] if row["key"] == "contact.translational_damping")
    assert damping["after_std"] / damping["after"] == pytest.approx(damping["before_std"] / damping["before"], rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "the sound of a hit, of the tooling or of the tool alone"),
        (("--mass-g", "1500"), "--mass-g: found 1500 g, allowed is near 1"),
        (("tool.wav",), "another one that rings"),
    ],
    ids=["nothing", "mass", "another tool"],
)
def test_what_cannot_be_is_one_sentence(rung, arguments, words):
    folder, _, _ = rung
    given = [folder / each if each.endswith(".wav") else each for each in arguments]
    found = run("ring", folder / "DRAWN.toml", *given, "--out", folder / "none.toml")
    assert found.exit_code == 2
    assert words in found.stderr
    assert not (folder / "none.toml").exists()
