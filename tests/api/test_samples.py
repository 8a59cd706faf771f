"""Samples of an upload as they are kept: to the last bit, with room made for them first, and drawn with few points."""

from __future__ import annotations

import errno
import os
from datetime import UTC, datetime

import h5py
import numpy as np
import pytest

from api.reading.previews import envelope, spectrum
from api.reading.samples import blocks, length, read_normalised, write_normalised
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.channels import Signals
from rcsa_ident.io.recordings.readers import in_si
from rcsa_ident.signals.recording import Quantity, Sensor

SENSORS = (
    Sensor("a/b", Quantity.DISPLACEMENT, Dof.X, 1.0e4, delay=1e-5, bandwidth=1e4),
    Sensor(".", Quantity.ACCELERATION, Dof.Y, 1.1094e-3),
    Sensor("trigger", Quantity.TRIGGER, pulses_per_revolution=2, tooth_angle=0.5),
)


def no_space():
    raise OSError(errno.ENOSPC, "no space left on the device")


@pytest.mark.parametrize("kind", ["f4", "f8", "i2", "u1", "i8", "exact f8"])
def test_samples_stay_as_they_were_to_the_last_bit(tmp_path, kind):
    rng = np.random.default_rng(2)
    values = rng.standard_normal((3, 5000)) * 100.0
    if kind == "exact f8":
        values = values.astype("f4").astype("f8")
    signals = [each.astype(kind.split()[-1]) for each in values]
    if "f" in kind:
        signals[0][7], signals[0][8], signals[1][0] = np.nan, np.inf, -0.0
    path = tmp_path / "x.h5"
    write_normalised(path, 51200.0, signals, SENSORS)
    found = read_normalised(path)
    direct = in_si(51200.0, signals, SENSORS)
    assert found.sensors == SENSORS
    assert found.rate == 51200.0
    assert found.samples.tobytes() == direct.samples.tobytes()
    assert np.isnan(found.samples[[7, 8], 0]).all() == ("f" in kind)
    # half the size where nothing is lost by it
    assert path.stat().st_size < 3 * 5000 * (4 if kind in ("f4", "i2", "u1", "exact f8") else 8) + 20_000


def test_when_it_was_recorded_stays(tmp_path):
    at = datetime(2026, 1, 5, 8, tzinfo=UTC)
    for started in (None, at):
        write_normalised(tmp_path / "x.h5", 51200.0, Signals([np.ones(100)] * 3, started=started), SENSORS)
        assert read_normalised(tmp_path / "x.h5").started == started
        assert read_normalised(tmp_path / "x.h5", in_file=True).started == started


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="a system that allocates nothing in advance")
@pytest.mark.parametrize(("count", "rate"), [(1, 1000.0), (5000, 1000.0), (70_000, 1.0), (1_000_001, 51200.0), (100, 1e7)])
@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_room_for_samples_is_allocated_before_the_first_is_written(tmp_path, monkeypatch, count, rate, kind):
    path, allocated, allocate = tmp_path / "x.h5", [], os.posix_fallocate

    def noted(file, start, size):
        allocated.append(size)
        allocate(file, start, size)

    monkeypatch.setattr(os, "posix_fallocate", noted)
    values = np.random.default_rng(3).standard_normal(count).astype(kind)
    write_normalised(path, rate, [values] * len(SENSORS), SENSORS)
    with h5py.File(path) as file:
        written = file.id.get_filesize()
    # all of it, and nothing of what was too much stays
    assert allocated[0] >= path.stat().st_size == written
    monkeypatch.setattr(os, "posix_fallocate", lambda *_: no_space())
    with pytest.raises(OSError, match="no space left"):
        write_normalised(path, rate, [values] * len(SENSORS), SENSORS)


def test_samples_can_be_read_in_parts(tmp_path):
    path = tmp_path / "x.h5"
    signals = list(np.arange(3 * 2500.0).reshape(3, 2500))
    write_normalised(path, 1000.0, signals, SENSORS)
    assert length(path) == (1000.0, 2500)
    parts = list(blocks(path, 700))
    assert [start for start, _ in parts] == [0, 700, 1400, 2100]
    np.testing.assert_array_equal(np.concatenate([part.samples for _, part in parts]), read_normalised(path).samples)


def test_damaged_samples_are_noticed(tmp_path):
    path = tmp_path / "x.h5"
    write_normalised(path, 1000.0, [np.random.default_rng(1).standard_normal(5000) for _ in SENSORS], SENSORS)
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)
    with pytest.raises(InputError):
        read_normalised(path)
    for content in (b"", b"x" * 100):
        path.write_bytes(content)
        with pytest.raises(InputError, match="missing or damaged"):
            read_normalised(path)
    path.unlink()
    with pytest.raises(InputError, match="missing or damaged"):
        read_normalised(path)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "points"), [(1, 10), (9, 10), (10, 10), (11, 10), (2_500_000, 1000)])
def test_an_outline_holds_every_extreme(tmp_path, count, points):
    path = tmp_path / "x.h5"
    rng = np.random.default_rng(4)
    x = rng.standard_normal(count)
    write_normalised(path, 1000.0, [x], SENSORS[2:])
    found = envelope(path, points)
    low, high = (np.array(found["channels"]["trigger"][key]) for key in ("low", "high"))
    assert low.size == high.size == len(found["time_s"]) <= points
    width = -(-count // points)
    for k in {0, low.size // 2, low.size - 1}:
        part = x[k * width : (k + 1) * width]
        assert (low[k], high[k]) == (part.min(), part.max())
        assert found["time_s"][k] == pytest.approx(k * width / 1000.0)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 3, 1000, 51200])
def test_a_tone_stands_at_its_place_with_its_amplitude(tmp_path, count):
    path = tmp_path / "x.h5"
    time = np.arange(count) / 51200.0
    write_normalised(path, 51200.0, [0.25 * np.cos(2.0 * np.pi * 1600.0 * time) + 3.0], SENSORS[2:])
    found = spectrum(path, 6000.0, 500)
    amplitude = np.array(found["channels"]["trigger"]["amplitude"])
    assert amplitude.size <= 500
    if count >= 1000:
        strongest = int(np.argmax(amplitude))
        # between two of its frequencies the window loses 15 %
        assert 0.84 * 0.25 <= amplitude[strongest] <= 1.001 * 0.25
        assert found["frequency_hz"][strongest] == pytest.approx(1600.0, abs=60.0)
    assert found["harmonics_hz"][:2] == [100.0, 200.0]
    assert max(found["harmonics_hz"]) <= 25600.0
