"""tap on the command line: hits in, an FRF out that the other commands read."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.frf_files import read_frfs
from tests.signals.test_tap import RATE, hits, receptance


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture
def recorded(tmp_path):
    """Two hits as a text without names."""
    force, response = hits(count=2)
    path = tmp_path / "hits.txt"
    np.savetxt(path, np.stack([np.arange(force.size) / RATE, force, response], axis=1), fmt="%.9e")
    return path


@pytest.mark.parametrize("suffix", ["csv", "uff", "frf"])
def test_an_frf_that_is_read_again(recorded, tmp_path, suffix):
    out = tmp_path / f"tip.{suffix}"
    found = run("tap", recorded, "--out", out, "--axis", "Y", "--json")
    assert found.exit_code == 0, found.stderr
    answer = json.loads(found.stdout)
    assert (answer["used"], len(answer["hits"])) == (2, 2)
    assert any("column 2" in remark for remark in answer["remarks"])
    assert "column 3 has no unit: acceleration [m/s²] is assumed" in answer["remarks"]
    (test,) = read_frfs(out)
    inside = (test.frequency > 300.0) & (test.frequency < 3000.0)
    true = receptance(2.0 * np.pi * test.frequency[inside])
    assert np.linalg.norm(test.values[inside] - true) < 5e-3 * np.linalg.norm(true)


def test_a_figure_and_words_for_people(recorded, tmp_path):
    found = run("tap", recorded, "--out", tmp_path / "tip.csv", "--plot", tmp_path / "tip.svg")
    assert found.exit_code == 0
    assert "2 of 2 hits" in found.stdout
    assert "column 3 has no unit: acceleration [m/s²] is assumed" in found.stderr
    assert "coherence" in (tmp_path / "tip.svg").read_text(encoding="utf-8")


def test_samples_over_time_are_no_frf(recorded, tmp_path):
    found = run("lobes", "--frf", f"X={recorded}", "nowhere.toml", "--out", tmp_path / "lobes.csv")
    assert found.exit_code == 2
    with pytest.raises(Exception, match="read by tap"):
        read_frfs(recorded)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--out", "tip.txt"), ".csv, .uff"),
        (("--out", "tip.csv", "--force", "nobody"), "no such channel"),
        (("--out", "tip.csv", "--sensor-mass-g", "-1"), "0 or more"),
    ],
)
def test_what_is_wrong_is_said(recorded, options, words):
    found = run("tap", recorded, *options)
    assert found.exit_code == 2
    assert words in found.stderr
