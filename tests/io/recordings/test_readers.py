"""Recordings in SI, whatever the format."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.recordings.readers import READERS, read_recording
from rcsa_ident.signals.recording import Quantity, Sensor

GAP = Sensor("flange_x", Quantity.DISPLACEMENT, Dof.X, 1.0e4)
FIXTURE = Sensor("fixture_x", Quantity.ACCELERATION, Dof.X, 1.1094e-3)
TRIGGER = Sensor("trigger", Quantity.TRIGGER, sensitivity=2.0)


@settings(max_examples=30, deadline=None)
@given(values=arrays(np.float32, st.integers(1, 20), elements=st.floats(-1e6, 1e6, width=32)), rate=st.floats(1.0, 1e6))
def test_hdf5_gives_back_what_was_written(tmp_path_factory, values, rate):
    path = tmp_path_factory.mktemp("h5") / "cut.h5"
    write_hdf5(path, rate, {"trigger": values, "flange_x": values})
    recording = read_recording(path, (GAP, TRIGGER))
    assert recording.rate == rate
    np.testing.assert_array_equal(recording.samples[:, 1], values)
    np.testing.assert_array_equal(recording.samples[:, 0], values.astype(float) / 1.0e4)


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_signals_are_divided_and_a_trigger_stays(tmp_path, suffix):
    path = tmp_path / f"cut{suffix}"
    volts = np.array([0.5, -1.0, 2.0])
    if suffix == ".h5":
        write_hdf5(path, 100.0, {"flange_x": volts, "fixture_x": volts, "trigger": volts, "other": volts})
    else:
        path.write_text("flange_x,fixture_x,trigger,other\n" + "".join(f"{v},{v},{v},?\n" for v in volts))
    recording = read_recording(path, (TRIGGER, GAP, FIXTURE), 100.0)
    np.testing.assert_array_equal(recording.samples[:, 0], volts)
    np.testing.assert_allclose(recording.samples[:, 1], volts / 1.0e4, rtol=1e-15)
    np.testing.assert_allclose(recording.samples[:, 2], volts / 1.1094e-3, rtol=1e-15)
    assert recording.sensors == (TRIGGER, GAP, FIXTURE)


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_lost_samples_are_nan(tmp_path, suffix):
    path = tmp_path / f"cut{suffix}"
    if suffix == ".h5":
        write_hdf5(path, 100.0, {"flange_x": [1.0, np.nan, np.inf, -np.inf, 2.0]})
    else:
        path.write_text("flange_x\n1\nnan\ninf\n-inf\n2\n")
    lost = np.isnan(read_recording(path, (GAP,), 100.0).samples[:, 0])
    assert lost.tolist() == [False, True, True, True, False]


def test_an_unknown_suffix_lists_the_formats(tmp_path):
    with pytest.raises(InputError, match=r"cut\.pkl: recording: found suffix '\.pkl', allowed is one of \.h5, \.hdf5, \.csv"):
        read_recording(tmp_path / "cut.pkl", (GAP,))


def test_no_sensor_no_recording(tmp_path):
    write_hdf5(tmp_path / "cut.h5", 100.0, {"x": [1.0]})
    with pytest.raises(InputError, match="sensors: found none"):
        read_recording(tmp_path / "cut.h5", ())


def test_formats_come_through_one_table(tmp_path, monkeypatch):
    monkeypatch.setitem(READERS, ".raw", lambda path, names, rate: (10.0, [np.ones(3)] * len(names)))
    assert read_recording(tmp_path / "cut.RAW", (TRIGGER,)).samples.tolist() == [[1.0]] * 3
