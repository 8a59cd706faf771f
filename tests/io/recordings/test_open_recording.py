"""Files of the shapes that recorders write, made here; real ones in `tests/signals/test_real_recordings.py`."""

from __future__ import annotations

import tracemalloc

import h5py
import numpy as np
import pytest
import scipy.io

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.io.uff import UffAxis, UffFunction, write_uff
from rcsa_ident.signals.recording import Quantity
from tests.fixtures import hostile_matlab, hostile_tdms
from tests.fixtures.recording_formats import FORMATS, parquet

TIME = np.arange(400) / 2000.0
X, Y = 3.0 * np.sin(300.0 * TIME), 2.0 * np.cos(300.0 * TIME)


def table(columns, delimiter=",", form="{:.9f}"):
    return [delimiter.join(form.format(value) for value in row) for row in zip(*columns, strict=True)]


def written(folder, lines, name="record.csv", encoding="utf-8", end="\n"):
    path = folder / name
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


SHAPES = {
    "units in brackets": (["Time (s),Accel X (m/s^2),Accel Y (m/s^2)", *table([TIME, X, Y])], {}),
    "square brackets and g": (["t [ms];a_x [g];a_y [g]", *table([1e3 * TIME, X / 9.80665, Y / 9.80665], ";")], {}),
    "microseconds": (["Time (µs)\tX Axis (m/s²)\tY Axis (m/s²)", *table([1e6 * TIME, X, Y], "\t")], {}),
    "decimal comma": (["Zeit (s);X (m/s^2);Y (m/s^2)", *[line.replace(".", ",") for line in table([TIME, X, Y], ";")]], {}),
    "byte order mark": (["Time (s),X (m/s^2),Y (m/s^2)", *table([TIME, X, Y])], {"encoding": "utf-8-sig"}),
    "quotes": (['"Time (s)","X (m/s^2)","Y (m/s^2)"', *table([TIME, X, Y])], {}),
    "comments": (["# made by a recorder", "# on a Monday", "Time (s),X (m/s^2),Y (m/s^2)", *table([TIME, X, Y])], {}),
    "trailing blanks": ([line + " ," for line in ["Time (s),X (m/s^2),Y (m/s^2)", *table([TIME, X, Y])]], {}),
    "header again": (
        [
            line
            for part in (slice(0, 200), slice(200, 400))
            for line in ["Time (s),X (m/s^2),Y (m/s^2)", *table([TIME[part], X[part], Y[part]])]
        ],
        {},
    ),
    "windows line ends": (["Time (s),X (m/s^2),Y (m/s^2)", *table([TIME, X, Y])], {"end": "\r\n"}),
    "units below the names": (["Recorder,Version 2.5", "Sampling rate [Hz]:,2000", "Time,X,Y", "s,m/s^2,m/s^2", *table([TIME, X, Y])], {}),
    "rate above the table": (["Sampling rate [Hz]: 2000", "X (m/s^2),Y (m/s^2)", *table([X, Y])], {}),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_table_tells_itself(tmp_path, shape):
    lines, options = SHAPES[shape]
    opened = open_recording(written(tmp_path, lines, **options))
    assert opened.rate == pytest.approx(2000.0)
    quantity, channels, _ = opened.of()
    assert quantity is Quantity.ACCELERATION
    assert len(channels) == 2
    for channel, expected in zip(channels, (X, Y), strict=True):
        np.testing.assert_allclose(channel.samples, expected, atol=2e-8)


def test_times_that_jitter_by_less_than_a_sample_are_even(tmp_path):
    jitter = 1e-4 * np.random.default_rng(1).uniform(-1.0, 1.0, TIME.size)
    opened = open_recording(written(tmp_path, ["Time (s),X (m/s^2)", *table([TIME + jitter, X])]))
    assert opened.rate == pytest.approx(2000.0, rel=1e-3)
    np.testing.assert_allclose(opened.channels[0].samples, X, atol=1e-8)
    assert any("taken as even" in remark for remark in opened.remarks)


def test_a_table_without_names_has_its_time_in_front(tmp_path):
    opened = open_recording(written(tmp_path, table([TIME, X, Y], " "), "record.txt"))
    assert opened.rate == pytest.approx(2000.0)
    assert any("column 1" in remark for remark in opened.remarks)
    with pytest.raises(InputError, match="told: no unit"):
        opened.of()
    quantity, channels, _ = opened.of(Quantity.FORCE, ["column 2"])
    assert quantity is Quantity.FORCE
    np.testing.assert_allclose(channels[0].samples, X, atol=1e-8)


def test_what_does_not_move_and_what_is_no_motion_is_left_aside(tmp_path):
    lines = ["Time (s),X (m/s^2),Load (%),Fx [N],Indicator", *table([TIME, X, 0.0 * X, 10.0 * Y, np.abs(X)])]
    opened = open_recording(written(tmp_path, lines))
    assert [each.name for each in opened.channels] == ["X", "Fx", "Indicator"]
    assert [each.name for each in opened.of()[1]] == ["X"]
    assert [each.name for each in opened.of(Quantity.FORCE)[1]] == ["Fx"]
    with pytest.raises(InputError, match=r"X \[m/s\^2\]"):
        opened.of(Quantity.FORCE, ["X"])


def test_lost_samples_are_where_they_were(tmp_path):
    keep = np.ones(TIME.size, dtype=bool)
    keep[100:105] = False
    opened = open_recording(written(tmp_path, ["Time (s),X (m/s^2)", *table([TIME[keep], X[keep]])]))
    assert opened.channels[0].samples.size == TIME.size
    assert np.flatnonzero(np.isnan(opened.channels[0].samples)).tolist() == [100, 101, 102, 103, 104]


@pytest.mark.parametrize(
    ("lines", "field"),
    [
        (["X (m/s^2),Y (m/s^2)", *table([X, Y])], "sampling_rate_hz"),
        (["Time (parsec),X (m/s^2)", *table([TIME, X])], "unit of column Time"),
        (["only words", "and more"], "recording"),
        (["Time (s),X (m/s^2)", *table([TIME[::-1], X])], "column Time"),
        (["Time (s),X (m/s^2)", *table([TIME, X]), "0.2,abc"], "recording"),
    ],
)
def test_what_cannot_be_told_is_named(tmp_path, lines, field):
    with pytest.raises(InputError) as found:
        open_recording(written(tmp_path, lines))
    assert found.value.field == field
    assert "record.csv" in str(found.value)


@pytest.mark.parametrize("name", [name for name in FORMATS if name.startswith(("hdf5", "tdms", "uff", "mat", "parquet"))])
def test_formats_with_named_channels_list_them(tmp_path, name):
    """Without names, and without units or in volts: all channels, at the user's word for what they measure."""
    suffix, write, _, _ = FORMATS[name]
    path = tmp_path / f"record{suffix}"
    write(path, 2000.0, {"a": X, "b": Y})
    opened = open_recording(path)
    assert opened.rate == 2000.0
    with pytest.raises(InputError, match="no unit in the file"):
        opened.of()
    quantity, channels, _ = opened.of(Quantity.ACCELERATION, sensitivity=1.0)
    assert quantity is Quantity.ACCELERATION
    assert sorted(each.name for each in channels) == ["a", "b"]
    for each in channels:
        np.testing.assert_allclose(each.samples, {"a": X, "b": Y}[each.name], rtol=1e-6, atol=1e-6)
    assert [each.name for each in open_recording(path, ["b"]).channels] == ["b"]


def hdf5_with_units(path):
    write_hdf5(path, 2000.0, {"x": X / 9.80665, "y": Y / 9.80665, "temperature": X})
    with h5py.File(path, "r+") as file:
        file["x"].attrs["unit"], file["y"].attrs["units"] = "g", np.bytes_("g")
        # of another length, and no motion: in nobody's way
        file["keyphasor"] = np.arange(7.0)


def tdms_with_units(path):
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    step = {"wf_increment": 5e-4}
    with nptdms.TdmsWriter(str(path)) as writer:
        channels = [nptdms.ChannelObject("cut", k, v / 9.80665, step | {"unit_string": "g"}) for k, v in (("x", X), ("y", Y))]
        writer.write_segment([*channels, nptdms.ChannelObject("other", "torque", X[:50], step)])


def uff_with_units(path):
    axes = {"abscissa_axis": UffAxis(17, "s")}
    motions = [UffFunction(1, TIME, values, title=name, ordinate=UffAxis(12, "m/s^2"), **axes) for name, values in (("x", X), ("y", Y))]
    write_uff(path, [*motions, UffFunction(1, TIME, X, title="strain", ordinate=UffAxis(0, "mV"), **axes)])


def uff_of_equal_titles(path):
    """Two functions that differ in their place alone."""
    axes = {"abscissa_axis": UffAxis(17, "s"), "title": "x", "ordinate": UffAxis(12, "m/s^2")}
    write_uff(path, [UffFunction(1, TIME, values, response=(3, place), **axes) for place, values in ((1, X), (2, Y))])


def parquet_with_units(path):
    parquet(path, 2000.0, {"x (m/s^2)": X, "y [m/s^2]": Y, "torque (Nm)": X, "n (rpm)": np.full(TIME.size, 6000)})


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("r.h5", hdf5_with_units),
        ("r.tdms", tdms_with_units),
        ("r.uff", uff_with_units),
        ("s.uff", uff_of_equal_titles),
        ("r.parquet", parquet_with_units),
    ],
)
def test_units_that_the_file_tells_choose_the_channels(tmp_path, name, write):
    path = tmp_path / name
    write(path)
    quantity, channels, _ = open_recording(path).of()
    assert quantity is Quantity.ACCELERATION
    assert len(channels) == 2
    for each, expected in zip(channels, (X, Y), strict=True):
        np.testing.assert_allclose(each.samples, expected, rtol=1e-6, atol=1e-6)


def test_signals_of_a_matrix_and_what_is_none(tmp_path):
    path = tmp_path / "record.mat"
    scipy.io.savemat(path, {"q": np.stack([X, Y]), "Fs": 2000.0, "note": "rig 4", "rec": {"inside": X}})
    opened = open_recording(path)
    assert [each.name for each in opened.channels] == ["q(1)", "q(2)"]
    np.testing.assert_array_equal(opened.channels[1].samples, Y)
    scipy.io.savemat(path, {"rec": {"inside": X}, "Fs": 2000.0})
    with pytest.raises(InputError, match="names of channels"):
        open_recording(path)
    np.testing.assert_array_equal(open_recording(path, ["rec.inside"]).channels[0].samples, X)


@pytest.mark.parametrize("name", hostile_tdms.HOSTILE)
def test_a_hostile_tdms_file_is_listed_or_refused_in_one_sentence(tmp_path, name, capfd):
    path = tmp_path / "record.tdms"
    path.write_bytes(hostile_tdms.HOSTILE[name][0])
    _listed_or_refused(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", hostile_matlab.HOSTILE)
def test_a_hostile_matlab_file_is_listed_or_refused_in_one_sentence(tmp_path, name):
    path = tmp_path / "record.mat"
    path.write_bytes(hostile_matlab.HOSTILE[name][0]())
    _listed_or_refused(path)


def _listed_or_refused(path):
    """Whatever stands in a file, reading it as it tells itself ends as a recording of finite size or as a sentence."""
    tracemalloc.start()
    try:
        longest = max(each.samples.size for each in open_recording(path, (), 51200.0).channels)
        assert longest < 1 << 20
    except InputError as refused:
        assert str(refused).count("\n") == 0  # noqa: PT017
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 30e6 + 3 * path.stat().st_size


def test_a_rate_that_no_file_tells_is_asked_for(tmp_path):
    path = tmp_path / "record.mat"
    scipy.io.savemat(path, {"x": X})
    with pytest.raises(InputError, match=r"sampling_rate_hz: found nothing in the file, allowed is the rate \[Hz\], told"):
        open_recording(path)
    assert open_recording(path, default_rate=2000.0).rate == 2000.0


def test_a_format_that_nobody_knows(tmp_path):
    path = tmp_path / "record.xyz"
    path.write_bytes(b"1 2 3\n")
    with pytest.raises(InputError, match=r"suffix '\.xyz', allowed is one of .*\.csv.*\.parquet"):
        open_recording(path)
