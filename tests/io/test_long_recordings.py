"""Recordings that are too long for the memory: judged from their files, as they are from memory, and never read in larger parts."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.recordings.readers import StoredSamples, in_si, read_cut, read_recording, read_signals
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import measure_cut
from rcsa_ident.signals.recording import LONGEST, Quantity, Recording, Sensor
from rcsa_ident.signals.steady import steady_record
from tests.fixtures.recording_formats import FORMATS

pytestmark = pytest.mark.slow
RATE, SPEED = 20000.0, 2.0 * np.pi * 133.37
SENSORS = (
    Sensor("flange_x", Quantity.DISPLACEMENT, Dof.X, 1.0e4),
    Sensor("fixture_y", Quantity.ACCELERATION, Dof.Y, 1.1094e-3),
    Sensor("trigger", Quantity.TRIGGER, tooth_angle=0.3),
)
CONDITIONS = CuttingConditions(2.0 * np.pi * 133.3, 1e-3, 1e-4, Engagement.from_immersion(0.5, "down"))


def signal(samples, cutting=slice(None)):
    """Run-out everywhere, teeth while the tool cuts, and a pulse in every turn."""
    rng = np.random.default_rng(1)
    angle = SPEED / RATE * np.arange(samples)
    teeth = np.zeros(samples)
    teeth[cutting] = sum(0.03 / k * np.cos(4 * k * angle[cutting] + k) for k in range(1, 5))
    noise = 1e-4 * rng.standard_normal((2, samples))
    trigger = (np.mod(angle, 2.0 * np.pi) < 0.3).astype(float)
    channels = {"flange_x": 0.02 * np.cos(angle) + teeth + noise[0], "fixture_y": 0.01 * np.cos(angle) + noise[1], "trigger": 0.5 * trigger}
    return {name: values.astype(np.float32) for name, values in channels.items()}


def measured(recording):
    return measure_cut("cut", "tool", recording, None, Cutter(4, 0.012), CONDITIONS, CuttingCoefficients(9e8, 0.3))


class Watched(StoredSamples):
    """Samples that say how many of them were asked for at once."""

    largest = 0

    def __getitem__(self, part):
        found = super().__getitem__(part)
        self.largest = max(self.largest, found.shape[0])
        return found


@pytest.fixture(scope="module")
def long():
    return signal(LONGEST + 150_000)


@pytest.mark.parametrize("name", ["hdf5", "wav-float", "wav-24", "tdms", "parquet", "csv"])
def test_parts_of_a_file_are_what_was_written(tmp_path, long, name):
    suffix, write, relative, absolute = FORMATS[name]
    path = tmp_path / f"long{suffix}"
    write(path, RATE, long)
    rate, found = read_signals(path, list(long), RATE)
    assert rate == RATE
    for values, channel in zip(long.values(), found, strict=True):
        assert not isinstance(channel, np.ndarray)
        for part in (slice(0, 10), slice(LONGEST - 5, LONGEST + 7), slice(values.size - 3, None), slice(5, 5)):
            np.testing.assert_allclose(channel[part], values[part], relative, absolute)


def test_a_verdict_from_the_file_is_that_from_memory(tmp_path, long):
    path = tmp_path / "long.h5"
    write_hdf5(path, RATE, long)
    stored, _ = read_cut(SENSORS, None, Cut("cut", "tool", CONDITIONS, path))
    watched = Watched(*read_signals(path, list(long)), SENSORS)
    found = measured(Recording(RATE, watched, SENSORS))
    assert 0 < watched.largest <= LONGEST
    whole = measured(read_recording(path, SENSORS))
    assert isinstance(stored.samples, StoredSamples)
    assert found.verdict.usable
    assert found.verdict == whole.verdict
    np.testing.assert_array_equal(found.measurement.axes[Dof.X].receptance, whole.measurement.axes[Dof.X].receptance)
    assert found.measurement.delay == whole.measurement.delay


def test_a_long_recording_is_looked_at_where_it_cuts():
    # a third of it is air in front of the cut
    samples = LONGEST + 900_000
    channels = signal(samples, slice(800_000, samples))
    recording = in_si(RATE, list(channels.values()), SENSORS)
    found = measured(recording)
    assert found.verdict.usable
    (note,) = (str(note) for note in found.verdict.notes if note.code == "long")
    first, last = (float(word) for word in note.split("from ")[1].split(" s are")[0].split(" to "))
    assert first >= 40.0
    assert last - first == pytest.approx(LONGEST / RATE, rel=1e-3)
    # who goes through all of it asks for all of it
    every = steady_record(recording, (Dof.X,), CONDITIONS.spindle_speed, 1000.0, 4, whole=True)
    assert (every.window, every.part.stop) == (slice(0, samples), samples)
    # lines and trigger tell of the same moment, the record's start
    later = measured(Recording(RATE, recording.samples[800_000:1_000_000], SENSORS))
    turned = []
    for each in (found.measurement, later.measurement):
        line = each.axes[Dof.X]
        turned.append((line.receptance * np.exp(1j * line.omega * each.delay))[:4])
    np.testing.assert_allclose(turned[0], turned[1], rtol=0.02)


def test_what_needs_all_samples_at_once_says_how_many_it_takes(tmp_path):
    channels = [np.broadcast_to(np.float32(1.0), 30_000_000)] * 3
    with pytest.raises(InputError, match="720 MB of samples, allowed is at most 512 MB where all of them are needed at once"):
        in_si(RATE, channels, SENSORS)
