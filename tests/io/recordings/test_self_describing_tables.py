"""Recordings of a campaign whose text tells itself: a preamble with the rate, names, and units in a line of their own."""

from dataclasses import replace

import h5py
import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.signals.recording import Quantity, Sensor
from rcsa_ident.signals.verdict import RecordCode

SENSORS = tuple(Sensor(f"F{a}", Quantity.FORCE, a_) for a, a_ in (("x", Dof.X), ("y", Dof.Y), ("z", Dof.Z)))
N, RATE = 3000, 10000.0
FORCE = np.random.default_rng(1).normal(scale=80.0, size=(N, 3)).round(4)
PREAMBLE = ["DynoWare,Version 2.5", "Path:,D:\\data\\", "Date:, ", "Sampling rate [Hz]:,10000", "Cycles:,1"]


def table(delimiter=",", decimal=".", unit="N", scale=1.0, time=True, preamble=PREAMBLE, start=8.0):
    head = [line.replace(",", delimiter) for line in preamble]
    names, units = ["Fx", "Fy", "Fz"], [unit] * 3
    columns = FORCE * scale
    if time:
        names, units, columns = ["Time", *names], ["s", *units], np.column_stack([start + np.arange(N) / RATE, columns])
    rows = [delimiter.join(f"{value:.9g}" for value in row).replace(".", decimal) for row in columns]
    return "\n".join([*head, delimiter.join(names), delimiter.join(units), *rows]) + "\n"


@pytest.mark.parametrize(
    "shape",
    [
        {},
        {"time": False},
        {"delimiter": ";", "decimal": ","},
        {"delimiter": "\t"},
        {"unit": "kN", "scale": 1e-3},
        {"unit": "lbf", "scale": 1.0 / 4.4482216152605},
        {"preamble": []},
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_a_preamble_and_units_are_read(tmp_path, shape, encoding):
    (tmp_path / "cut.csv").write_text(table(**shape), encoding=encoding)
    recording = read_recording(tmp_path / "cut.csv", SENSORS)
    assert recording.rate == pytest.approx(RATE, rel=1e-6)
    np.testing.assert_allclose(recording.samples, FORCE, rtol=1e-6, atol=1e-6)


def test_a_row_that_stands_above_the_table_by_itself_is_no_header_that_comes_again(tmp_path):
    """Found by fuzzing: all rows were taken for headers, and none was left."""
    path = tmp_path / "r.csv"
    path.write_text("name\n1\t2\n\nnote\n1\t2\n1\t2\n2\t3\n")
    found = open_recording(path, default_rate=1000.0)
    assert [channel.samples.tolist() for channel in found.channels] == [[1.0, 1.0, 2.0], [2.0, 2.0, 3.0]]


@pytest.mark.parametrize("time", [True, False])
def test_of_several_measuring_cycles_the_first_is_read(tmp_path, time):
    """As DynoWare exports them, one below the other, their times beginning anew; said, on a campaign's recording as well."""
    first = table(time=time)
    head, rows = first.split("\n", 5)[:5], "\n".join(first.split("\n")[5:])
    second = "\n".join(line.replace("1", "2") if i > 1 else line for i, line in enumerate(rows.split("\n")))
    text = "\n".join([*head[:-1], "Cycles:,2", "Cycle No:,1", rows + "Cycle No:,2", second])
    (tmp_path / "cut.csv").write_text(text)
    recording = read_recording(tmp_path / "cut.csv", SENSORS)
    np.testing.assert_allclose(recording.samples, FORCE, rtol=1e-6, atol=1e-6)
    assert [(note.code, str(note)) for note in recording.notes] == [(RecordCode.ASSUMED, "only the first of 2 measuring cycles was read")]
    opened = open_recording(tmp_path / "cut.csv")
    assert opened.channels[0].samples.size == N
    assert opened.remarks == ("only the first of 2 measuring cycles was read",)
    (tmp_path / "cut.csv").write_text(first)
    assert read_recording(tmp_path / "cut.csv", SENSORS).notes == ()


def test_a_table_of_one_line_of_names_tells_units_as_well(tmp_path):
    text = table(preamble=[]).replace("s,N,N,N\n", "")
    (tmp_path / "cut.csv").write_text(text.replace("Fx", "Fx [kN]"))
    found = read_recording(tmp_path / "cut.csv", SENSORS).samples
    np.testing.assert_allclose(found, FORCE * [1e3, 1.0, 1.0], rtol=1e-6, atol=1e-6)
    (tmp_path / "cut.csv").write_text(f"# made by hand\n{text}")
    np.testing.assert_allclose(read_recording(tmp_path / "cut.csv", SENSORS).samples, FORCE, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (table().replace("Fz", "Mz"), "Fz"),
        (table(time=False).replace("Sampling rate", "Something"), "sampling_rate_hz"),
        (table().replace("\ns,", "\nfurlongs,"), "furlongs"),
    ],
)
def test_what_is_not_told_is_asked_for(tmp_path, text, words):
    (tmp_path / "cut.csv").write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_recording(tmp_path / "cut.csv", SENSORS)
    assert "cut.csv" in str(caught.value)


def test_uneven_times_are_left_aside_for_a_rate_that_is_told(tmp_path):
    """Devices of a few dollars write when they come to it; a campaign's rate is no word about this file."""
    path = tmp_path / "tap.csv"
    path.write_text("time_s,acc (g)\n" + "".join(f"{t},{k % 3}\n" for k, t in enumerate((0.0, 0.003, 0.006, 0.011, 0.0119, 0.02))))
    opened = open_recording(path, (), 333.0)
    assert (opened.rate, opened.channels[0].samples.size) == (333.0, 6)
    assert any("column time_s are uneven and were left aside: the rate that was told counts, 333 Hz" in said for said in opened.remarks)
    for read in (lambda: open_recording(path), lambda: read_recording(path, (Sensor("acc", Quantity.ACCELERATION, Dof.X),), 333.0)):
        with pytest.raises(InputError, match="whole multiples of the sampling interval"):
            read()


def test_a_channel_that_stands_still_is_there(tmp_path):
    still = FORCE.copy()
    still[:, 2] = 0.0
    rows = "\n".join(",".join(f"{value:.6g}" for value in row) for row in still)
    (tmp_path / "cut.csv").write_text("\n".join([*PREAMBLE, "Fx,Fy,Fz", "N,N,N"]) + f"\n{rows}\n")
    recording = read_recording(tmp_path / "cut.csv", SENSORS)
    assert recording.samples.shape == (N, 3)
    assert not recording.samples[:, 2].any()


def with_sensitivity(value, quantity=Quantity.FORCE):
    return tuple(Sensor(f"F{a}", quantity, a_, value) for a, a_ in (("x", Dof.X), ("y", Dof.Y)))


@pytest.mark.parametrize(("unit", "scale"), [("V", 1e-3), ("mV", 1.0)])
def test_volts_have_a_sensitivity(tmp_path, unit, scale):
    (tmp_path / "cut.csv").write_text(table(unit=unit, scale=scale))
    recording = read_recording(tmp_path / "cut.csv", with_sensitivity(1e-3))
    np.testing.assert_allclose(recording.samples, FORCE[:, :2], rtol=1e-6, atol=1e-6)
    with pytest.raises(InputError, match=rf"sensitivity: found 1.0, allowed is the sensor's sensitivity .* the file is in {unit}"):
        read_recording(tmp_path / "cut.csv", with_sensitivity(1.0))


def test_what_the_sensors_say_may_not_contradict_the_file(tmp_path):
    (tmp_path / "cut.csv").write_text(table(unit="kN", scale=1e-3))
    with pytest.raises(InputError, match=r"sensors.Fx.sensitivity: found 0.001, allowed is 1.0: the file says kN"):
        read_recording(tmp_path / "cut.csv", with_sensitivity(1e-3))
    (tmp_path / "cut.csv").write_text(table(unit="um"))
    with pytest.raises(InputError, match=r"sensors.Fx.quantity: found force, allowed is displacement: the file's unit is um"):
        read_recording(tmp_path / "cut.csv", with_sensitivity(1.0))


def test_a_unit_that_nobody_knows_is_the_sensitivitys_business(tmp_path):
    (tmp_path / "cut.csv").write_text(table(unit="pC"))
    recording = read_recording(tmp_path / "cut.csv", with_sensitivity(2.0))
    np.testing.assert_allclose(recording.samples, 0.5 * FORCE[:, :2], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("kind", ["name of a MATLAB variable", "name of a column", "field of a column"])
def test_no_format_takes_an_unknown_unit_as_si(tmp_path, kind):
    """Formats without a place for units tell them by names; Parquet may by a field's metadata."""
    name, samples = "a (counts)", np.arange(50) % 7.0
    path = tmp_path / ("a.mat" if "MATLAB" in kind else "a.parquet")
    if "MATLAB" in kind:
        # as a structure of HDF5, whose names are free
        with h5py.File(path, "w", userblock_size=512) as file:
            file[name] = samples[None]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    else:
        name = name if "name" in kind else "a"
        field = pyarrow.field(name, pyarrow.float64(), metadata=None if "name" in kind else {"unit": "counts"})
        parquet.write_table(pyarrow.table([samples], schema=pyarrow.schema([field])), path)
    sensor = Sensor(name, Quantity.ACCELERATION, Dof.X)
    with pytest.raises(InputError, match=r"sensitivity: found 1.0, allowed is .*\[counts per SI unit\]"):
        read_recording(path, (sensor,), 1000.0)
    np.testing.assert_allclose(read_recording(path, (replace(sensor, sensitivity=2.0),), 1000.0).samples[:3, 0], [0.0, 0.5, 1.0])


def test_a_campaign_never_takes_an_unknown_unit_as_si(tmp_path):
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{k / 1000},{k % 7}" for k in range(50))
    path.write_text(f"lab 3\ntime,a\ns,furlong/s^2\n{rows}\n", encoding="utf-8")
    sensor = Sensor("a", Quantity.ACCELERATION, Dof.X)
    with pytest.raises(InputError, match=r"sensors.a.sensitivity: found 1.0, allowed is .*\[furlong/s\^2 per SI unit\]"):
        read_recording(path, (sensor,))
    found = read_recording(path, (replace(sensor, sensitivity=2.0),))
    np.testing.assert_allclose(found.samples[:3, 0], [0.0, 0.5, 1.0])
