"""One recording, and hits of a hammer, at the front door: what commands say, as nouns that show themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import wavfile

import rcsa_ident as ri
from tests.signals.test_tap import RATE, hits, receptance


@pytest.fixture
def sound(tmp_path):
    """Chatter at 1234.5 Hz of four teeth at 6000 rev/min, twice as loud as the cut."""
    time, rng = np.arange(66150) / 22050.0, np.random.default_rng(1)
    signal = 0.3 * sum(a * np.cos(2.0 * np.pi * 100.0 * m * time) for m, a in {1: 0.1, 4: 0.5, 8: 0.3}.items())
    signal += 0.4 * np.cos(2.0 * np.pi * 1234.5 * time) + 0.01 * rng.standard_normal(time.size)
    path = tmp_path / "cut.wav"
    wavfile.write(path, 22050, signal.astype(np.float32))
    return path


@pytest.fixture
def hammered(tmp_path):
    force, response = hits(count=2)
    path = tmp_path / "hits.csv"
    table = np.stack([np.arange(force.size) / RATE, force, response], axis=1)
    np.savetxt(path, table, delimiter=",", header="time (s),hammer (N),tip (m/s^2)", comments="", fmt="%.9e")
    return path


def test_listen(sound, tmp_path):
    heard = ri.listen(sound, teeth=4, speed=ri.rpm(6000))
    assert str(heard) == "chatter at 6000.0 rev/min"
    assert heard.chatter[0] == pytest.approx(1234.5, abs=0.5)
    assert heard.suggested_speeds[0] == pytest.approx(ri.rpm(60.0 * 1234.5 / 8), rel=1e-3)
    assert heard.record.name == "cut.wav"
    assert any("taken as sound" in reason for reason in heard.reasons)
    assert "1234" in heard.save(tmp_path / "heard.svg").read_text(encoding="utf-8")
    assert "<svg" in heard._repr_html_()
    assert len(heard.plot()) == 3


def test_listen_refuses_in_words(sound):
    with pytest.raises(ri.InputError, match="quantity: found loudness"):
        ri.listen(sound, quantity="loudness")
    with pytest.raises(ri.InputError, match="two speeds above 0"):
        ri.listen(sound, between=(ri.rpm(9000), ri.rpm(3000)))


@pytest.mark.parametrize("suffix", [".csv", ".frf", ".uff"])
def test_tap_is_read_again(hammered, tmp_path, suffix):
    found = ri.tap(hammered, axis="Y")
    assert str(found).startswith("receptance Y from 2 of 2 hits")
    again = ri.read_tap_tests(y=found.save(tmp_path / f"tip{suffix}"))
    inside = (again.omega > ri.hz(300.0)) & (again.omega < ri.hz(3000.0))
    true = receptance(again.omega[inside])
    assert np.linalg.norm(again.between("tip.y", "tip.y")[inside] - true) < 5e-3 * np.linalg.norm(true)


def test_tap_shows_itself_and_refuses_in_words(hammered):
    found = ri.tap(hammered)
    assert "<svg" in found._repr_html_()
    for options, words in ({"force": "nobody"}, "no such channel"), ({"estimator": "h9"}, "h1, h2, hv"), ({"axis": "Z"}, "X or Y"):
        with pytest.raises(ri.InputError, match=words):
            ri.tap(hammered, **options)
