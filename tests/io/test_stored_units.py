"""Units that a binary recording says of its channels: a campaign's sensor agrees with them, or is refused."""

from __future__ import annotations

from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.readers import read_cut, read_recording
from rcsa_ident.io.uff import UffAxis, UffFunction, write_uff
from rcsa_ident.signals.recording import Quantity, Sensor

RATE = 1000.0
SAMPLES = np.sin(np.arange(400) / 3.0)


def hdf5(path, unit):
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate_hz"] = RATE
        file["a"] = SAMPLES
        file["a"].attrs["unit"] = unit
    return path


def uff(path, unit):
    axes = {"abscissa_axis": UffAxis(17, "s"), "ordinate": UffAxis(12, unit)}
    write_uff(path, [UffFunction(1, np.arange(SAMPLES.size) / RATE, SAMPLES, title="a", **axes)])
    return path


def tdms(path, unit):
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    stamps = {"wf_increment": 1.0 / RATE, "wf_start_offset": 0.0, "unit_string": unit}
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject("g", "a", SAMPLES, stamps)])
    return path


WRITERS = {".h5": hdf5, ".uff": uff, ".tdms": tdms}


def sensor(quantity=Quantity.ACCELERATION, sensitivity=1.0):
    return Sensor("a", quantity, Dof.X, sensitivity=sensitivity)


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_unit_that_is_not_si_asks_for_its_sensitivity(tmp_path, suffix):
    path = WRITERS[suffix](tmp_path / f"r{suffix}", "g")
    with pytest.raises(InputError, match=r"sensors.a.sensitivity: found 1.0, allowed is 0.101972 \[g per SI unit\]: the file is in g"):
        read_recording(path, (sensor(),))
    found = read_recording(path, (sensor(sensitivity=1.0 / 9.80665),))
    np.testing.assert_allclose(found.samples[:, 0], 9.80665 * SAMPLES, rtol=1e-6)
    with pytest.raises(InputError, match=r"sensors.a.quantity: found displacement, allowed is acceleration: the file's unit is g"):
        read_recording(path, (sensor(Quantity.DISPLACEMENT),))


@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize("unit", ["mV", "counts", "furlong"])
def test_a_unit_that_says_nothing_of_it_asks_for_its_sensitivity(tmp_path, suffix, unit):
    path = WRITERS[suffix](tmp_path / f"r{suffix}", unit)
    with pytest.raises(InputError, match=rf"sensors.a.sensitivity: found 1.0, allowed is the sensor's sensitivity \[{unit} per SI unit\]"):
        read_recording(path, (sensor(),))
    np.testing.assert_allclose(read_recording(path, (sensor(sensitivity=4.0),)).samples[:, 0], SAMPLES / 4.0, rtol=1e-6)


@pytest.mark.parametrize(("suffix", "unit"), [(".h5", "m·s⁻²"), (".tdms", "m·s⁻²"), (".uff", "m/s/s"), (".h5", ""), (".uff", "NONE")])
def test_si_needs_none(tmp_path, suffix, unit):
    path = WRITERS[suffix](tmp_path / f"r{suffix}", unit)
    np.testing.assert_allclose(read_recording(path, (sensor(),)).samples[:, 0], SAMPLES, rtol=1e-6)


def test_a_long_recording_that_stays_in_its_file_is_looked_at_too(tmp_path, monkeypatch):
    monkeypatch.setattr("rcsa_ident.io.recordings.hdf5.LONGEST", 100)
    path = hdf5(tmp_path / "r.h5", "g")
    with pytest.raises(InputError, match="the file is in g"):
        read_cut((sensor(),), None, SimpleNamespace(recording=path, air=None))
