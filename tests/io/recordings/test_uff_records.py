"""Time records in universal files: names, the rounded rate, starts, gaps."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.io.uff import UffAxis, UffFunction, read_uff, write_uff
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.fixtures.paths import SHARED

TIME = {"abscissa_axis": UffAxis(17, "s"), "ordinate": UffAxis(12, "m/s^2")}


def sensor(name: str) -> Sensor:
    return Sensor(name, Quantity.TRIGGER)


def record(title: str = "x", rate: float = 51200.0, start: float = 0.0, count: int = 100, **more) -> UffFunction:
    return UffFunction(1, start + np.arange(count) / rate, np.sin(np.arange(count)), title=title, **{**TIME, **more})


def write_even(path: Path, rate: float, binary: bool = False, count: int = 100) -> None:
    """Start and step in the header, as acquisition programs do whatever is lost by it."""
    write_uff(path, [record(rate=1.0, count=count)], binary)
    header(path, f"{1:10d}{0.0:13.5E}{1.0:13.5E}", f"{1:10d}{0.0:13.5E}{1.0 / rate:13.5E}")
    assert read_uff(path)[0].step == pytest.approx(1.0 / rate, rel=6e-6)


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("rate", [44100.0, 48000.0, 51200.0, 65536.0, 102400.0, 25641.0, 1.0e6, 204800.0])
def test_the_rate_is_the_one_that_was_meant(tmp_path, rate, binary):
    """1/51200 s is written as 1.95313E-05: 2.6 ppm off."""
    write_even(tmp_path / "cut.uff", rate, binary)
    assert read_recording(tmp_path / "cut.uff", (sensor("x"),)).rate == rate


@settings(max_examples=50, deadline=None)
@given(rate=st.floats(1.0, 1e6))
def test_the_campaigns_rate_counts_where_the_header_allows_it(tmp_path_factory, rate):
    path = tmp_path_factory.mktemp("uff") / "cut.uff"
    write_even(path, rate, count=50)
    assert read_recording(path, (sensor("x"),), rate).rate == rate
    # any other is not believed
    assert read_recording(path, (sensor("x"),), 1.1 * rate).rate == pytest.approx(rate, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("binary", [False, True])
def test_times_point_by_point(tmp_path, binary):
    """Six digits of a late time are coarser than half a step; their straight line is not."""
    rate, count = 51200.0, 102_400
    function = record(rate=rate, count=count, start=0.3)
    path = tmp_path / "cut.uff"
    write_uff(path, [function], binary)
    if read_uff(path)[0].step:
        pytest.fail("the abscissa was written as start and step")
    found = read_recording(path, (sensor("x"),))
    assert found.rate == rate
    np.testing.assert_allclose(found.samples[:, 0], function.values, rtol=1e-11)


def header(path: Path, old: str, new: str) -> None:
    raw = path.read_bytes()
    assert old.encode() in raw
    path.write_bytes(raw.replace(old.encode(), new.encode(), 1))


@pytest.mark.parametrize("name", ["flange_x", "Gap 7", "Relative", "7:-X"])
def test_a_channel_has_four_names(tmp_path, name):
    path = tmp_path / "cut.uff"
    write_uff(path, [record("flange_x", response=(7, -1)), record("other")])
    header(path, "NONE               7  -1", "Gap 7              7  -1")
    header(path, f"{12:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20s}", f"{12:10d}{0:5d}{0:5d}{0:5d} {'Relative':<20s}")
    np.testing.assert_allclose(read_recording(path, (sensor(name),)).samples[:, 0], np.sin(np.arange(100)), rtol=1e-11)


@pytest.mark.parametrize(
    ("functions", "words"),
    [
        ([record("x"), record("x")], "channel x: found 2 of that name"),
        ([record("z"), record("", response=(3, 2))], "channel x: found no such channel"),
        ([record("z"), record("", response=(3, 2))], "entity, label, title or place of one time response of the file: z, 3:+Y"),
        ([record("x", abscissa_axis=UffAxis(18, "Hz"))], "no time response"),
        ([UffFunction(4, np.arange(5.0), np.ones(5), title="x")], "no time response"),
        ([UffFunction(1, np.arange(5.0), 1j * np.ones(5), title="x", **TIME)], "no time response"),
        ([record("x", count=1)], "channel x: found 1 sample"),
        ([UffFunction(1, np.array([0.0, 1.0, 1.5, 7.0]), np.ones(4), title="x", **TIME)], "time "),
        ([UffFunction(1, np.array([0.0, 1.0, 2.0, 4.0, 5.0]), np.ones(5), title="x", **TIME)], "channel x: found 1 lost samples"),
        ([UffFunction(1, -np.arange(5.0), np.ones(5), title="x", **TIME)], "step of channel x: found -1.0"),
    ],
)  # fmt: skip
def test_what_is_no_recording_is_one_sentence(tmp_path, functions, words):
    path = tmp_path / "cut.uff"
    write_uff(path, functions)
    with pytest.raises(InputError) as caught:
        read_recording(path, (sensor("x"),))
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (record("y", rate=25600.0), "different rates (x: 51200, y: 25600)"),
        (record("y", count=60), "different lengths (x: 100, y: 60)"),
        (record("y", start=0.5), "start of channel y: found 0.5 s later"),
    ],
)
def test_channels_belong_together(tmp_path, second, words):
    path = tmp_path / "cut.uff"
    write_uff(path, [record("x"), second])
    with pytest.raises(InputError) as caught:
        read_recording(path, (sensor("x"), sensor("y")))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("name", "channel", "rate", "count", "first", "started"),
    [
        ("time_history.uff", "1x", 20000.0, 13, -3.81956, datetime(2020, 4, 30, 19, 12, 52)),
        ("time_history.uff", "1x : m/s²", 20000.0, 13, -3.81956, datetime(2020, 4, 30, 19, 12, 52)),
        ("sample_58b_binary.uff", "Mic 01", 65536.0, 79292, -0.01475526, datetime(2016, 4, 18, 13, 49, 58)),
    ],
)
def test_files_that_others_measured(name, channel, rate, count, first, started):
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"{name} is not beside the project")
    found = read_recording(path, (sensor(channel),))
    assert found.rate == rate
    assert found.samples.shape == (count, 1)
    assert found.samples[0, 0] == pytest.approx(first, rel=1e-6)
    assert found.started == started


@pytest.mark.parametrize(("line", "started"), [("05-Jan-26 08:30:59", datetime(2026, 1, 5, 8, 30, 59)), ("05-Foo-26 08:30:59", None)])
def test_a_date_among_the_id_lines_is_when_it_began(tmp_path, line, started):
    path = tmp_path / "cut.uff"
    write_uff(path, [record()])
    path.write_text(path.read_text().replace(f"{'NONE':<80s}", f"{line:<80s}", 1))
    assert read_recording(path, (sensor("x"),)).started == started


def test_a_spectrum_that_others_measured_is_no_recording():
    path = SHARED / "psd_58.uff"
    if not path.exists():
        pytest.skip("psd_58.uff is not beside the project")
    with pytest.raises(InputError, match="no time response"):
        read_recording(path, (sensor("Pilot 1"),))
