"""tap on the command line: hits in, an FRF out that the other commands read."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.curves.frf_files import read_frfs
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


def told(path, force_unit, response_unit, force_factor=1.0, response_factor=1.0, derivative=2):
    """Hits with units in the names: samples are the SI ones over the factors."""
    force, response = hits(count=2, derivative=derivative)
    table = np.stack([np.arange(force.size) / RATE, force / force_factor, response / response_factor], axis=1)
    np.savetxt(path, table, delimiter=",", header=f"time (s),hammer ({force_unit}),tip ({response_unit})", comments="", fmt="%.9e")
    return path


@pytest.mark.parametrize(
    ("units", "factors", "derivative", "options"),
    [
        (("N", "mg"), (1.0, 9.80665e-3), 2, ()),
        (("kgf", "ft/s²"), (9.80665, 0.3048), 2, ()),
        (("mN", "mm/s/s"), (1e-3, 1e-3), 2, ()),
        (("N", "mm/s"), (1.0, 1e-3), 1, ()),
        (("lbf", "mil"), (4.4482216152605, 25.4e-6), 0, ()),
        # 2.3 mV/N, 10.2 mV per m/s²
        (("mV", "mV"), (1e-3 / 2.3e-3, 1e-3 / 10.2e-3), 2, ("--force-sensitivity", "2.3e-3", "--response-sensitivity", "0.0102")),
        (("counts", "m·s⁻²"), (0.5, 1.0), 2, ("--force-sensitivity", "2")),
    ],
)
def test_units_that_the_file_says_count(tmp_path, units, factors, derivative, options):
    path = told(tmp_path / "hits.csv", *units, *factors, derivative)
    found = run("tap", path, "--out", tmp_path / "tip.csv", "--json", *options)
    assert found.exit_code == 0, found.stderr
    assert not any("is assumed" in remark for remark in json.loads(found.stdout)["remarks"])
    (test,) = read_frfs(tmp_path / "tip.csv")
    inside = (test.frequency > 300.0) & (test.frequency < 3000.0)
    true = receptance(2.0 * np.pi * test.frequency[inside])
    assert np.linalg.norm(test.values[inside] - true) < 5e-3 * np.linalg.norm(true)


@pytest.mark.parametrize(
    ("units", "options", "words"),
    [
        (("N", "furlong"), (), "unit of channel tip: found furlong, allowed is a unit of the response, or response_sensitivity"),
        (("N", "mV"), (), "response_sensitivity [V per SI unit] told"),
        (("V", "g"), (), "unit of channel hammer: found V, allowed is a unit of the force, or force_sensitivity [V per SI unit] told"),
        (("Nm", "g"), (), "unit of channel hammer: found Nm"),
        (("N", "Pa"), (), "unit of channel tip: found Pa"),
        (("N", "g"), ("--response-sensitivity", "0.01"), "response_sensitivity: found 0.01, allowed is none: channel tip has the unit g"),
        (("N", "V"), ("--response-sensitivity", "0"), "response_sensitivity: found 0"),
    ],
)
def test_a_unit_that_says_nothing_of_it_is_never_si(tmp_path, units, options, words):
    path = told(tmp_path / "hits.csv", *units)
    found = run("tap", path, "--out", tmp_path / "tip.csv", *options)
    assert found.exit_code == 2
    assert words in " ".join(found.stderr.split())
    assert not (tmp_path / "tip.csv").exists()


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
