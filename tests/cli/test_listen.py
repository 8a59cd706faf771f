"""listen on the command line: one answer for people and one for machines."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from scipy.io import wavfile
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.recordings.hdf5 import write_hdf5

KEYS = {
    "spindle_speed_rpm", "spindle_speed_std_rpm", "speed_wander_percent", "ramp", "teeth", "explained_share", "verdict", "reasons",
    "chatter_frequencies_hz", "chatter_aliases_hz", "chatter_lines_hz", "suggested_speeds_rpm", "events",
    "other_speeds_rpm", "speed_probabilities", "chatter_probability",
}  # fmt: skip


@pytest.fixture
def sound(tmp_path):
    """Two seconds of a cut with four teeth at 6000 rev/min."""
    time, rng = np.arange(44100) / 22050.0, np.random.default_rng(1)
    orders = {1: 0.1, 4: 0.5, 8: 0.3, 12: 0.1}
    signal = sum(a * np.cos(2.0 * np.pi * 100.0 * m * time) for m, a in orders.items()) + 0.05 * rng.standard_normal(time.size)
    path = tmp_path / "sound.wav"
    wavfile.write(path, 22050, (16000.0 * signal).astype(np.int16))
    return path


def run(*arguments):
    return CliRunner().invoke(app, ["listen", *map(str, arguments)])


def test_the_answer_for_machines(sound):
    found = run(sound, "--json")
    assert found.exit_code == 0
    answer = json.loads(found.stdout)
    assert answer.keys() >= KEYS
    assert answer["verdict"] == "stable"
    assert answer["spindle_speed_rpm"] == pytest.approx(6000.0, abs=0.5)
    assert answer["teeth"] == 4
    assert answer["quantity"] == "sound"
    both = json.loads(run(sound, sound, "--json").stdout)
    assert [each["verdict"] for each in both["recordings"]] == ["stable", "stable"]


def test_the_answer_for_people_and_the_figure(sound, tmp_path):
    found = run(sound, "--plot", tmp_path / "figure.svg")
    assert found.exit_code == 0
    assert "stable at 6000.0 rev/min" in found.stdout
    text = (tmp_path / "figure.svg").read_text(encoding="utf-8")
    for words in ("time [s]", "frequency [Hz]", "order of the spindle", "tooth passing"):
        assert words in text


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--speeds-from", 5000), "--speeds-to"),
        (("--channel", "ch7"), "ch7"),
        (("--quantity", "force"), "a channel that measures force"),
        (("--plot", "nowhere/figure.png"), "no folder"),
        (("--speeds-from", 9000, "--speeds-to", 8000), "the lower one first"),
    ],
)
def test_what_is_wrong_is_said(sound, options, words):
    found = run(sound, *options)
    assert found.exit_code == 2
    assert words in found.stderr


def test_a_recorders_file_with_units_needs_no_setting(tmp_path):
    """Channels, quantity and rate as the file tells them; without a unit what is measured is asked for by its option."""
    time, rng = np.arange(12000) / 6000.0, np.random.default_rng(1)
    signal = sum(a * np.cos(2.0 * np.pi * 100.0 * m * time) for m, a in {1: 0.1, 4: 0.5, 8: 0.3}.items())
    path = tmp_path / "record.h5"
    write_hdf5(path, 6000.0, {name: signal + 0.05 * rng.standard_normal(time.size) for name in ("x", "y")})
    refused = run(path)
    assert refused.exit_code == 2
    assert "--quantity" in refused.output
    with h5py.File(path, "r+") as file:
        for name in ("x", "y"):
            file[name].attrs["unit"] = "mV"
    refused = run(path, "--quantity", "acceleration")
    assert refused.exit_code == 2
    said = " ".join(refused.stderr.split())
    assert "--sensitivity: found nothing, and channel x is in mV, allowed is the sensor's [V per SI unit]" in said
    assert run(path, "--quantity", "acceleration", "--sensitivity", 0.0102).exit_code == 0
    with h5py.File(path, "r+") as file:
        for name in ("x", "y"):
            file[name].attrs["unit"] = "g"
    answer = json.loads(run(path, "--json").stdout)
    assert (answer["quantity"], answer["channels"], answer["verdict"]) == ("acceleration", ["x", "y"], "stable")
    assert answer["spindle_speed_rpm"] == pytest.approx(6000.0, abs=0.5)
