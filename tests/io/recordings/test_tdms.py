"""TDMS recordings: scalings, groups, times, files of National Instruments' own programs, and files that lie."""

from __future__ import annotations

import io
import struct
import tracemalloc
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings import tdms as reader
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.fixtures.hostile_tdms import BIG_ENDIAN, HOSTILE, INTERLEAVED, METADATA, NEW_LIST, RAW, channel, segment
from tests.fixtures.paths import SHARED
from tests.fixtures.recording_formats import tdms

nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
A = Sensor("a", Quantity.TRIGGER)
B = Sensor("b", Quantity.TRIGGER)
RAMP = np.arange(1000, dtype=np.int16)


def scaled(*scales: dict, raw: np.ndarray = RAMP, **more: object) -> dict:
    """Properties of a channel with scalings as LabVIEW writes them."""
    properties: dict[str, object] = {"wf_increment": 1.0 / 51200.0, "NI_Number_Of_Scales": len(scales), "NI_Scaling_Status": "unscaled"}
    for i, scale in enumerate(scales):
        properties[f"NI_Scale[{i}]_Scale_Type"] = scale["type"]
        properties |= {f"NI_Scale[{i}]_{scale['type']}_{key}": value for key, value in scale.items() if key != "type"}
    return properties | more


def write(path: Path, properties: dict, raw: np.ndarray = RAMP, group: dict | None = None, root: dict | None = None) -> None:
    objects = [nptdms.RootObject(root or {}), nptdms.GroupObject("g", group or {}), nptdms.ChannelObject("g", "a", raw, properties)]
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(objects)


LINEAR = {"type": "Linear", "Slope": 0.25, "Y_Intercept": -1.0, "Input_Source": 0xFFFFFFFF}
SQUARE = {
    "type": "Polynomial", "Coefficients_Size": 3, "Coefficients[0]": 1.0, "Coefficients[1]": 0.0, "Coefficients[2]": 2.0, "Input_Source": 0,
}  # fmt: skip


def test_scalings_are_applied_in_their_order(tmp_path):
    write(tmp_path / "cut.tdms", scaled(LINEAR, SQUARE))
    found = read_recording(tmp_path / "cut.tdms", (A,))
    np.testing.assert_allclose(found.samples[:, 0], 1.0 + 2.0 * (0.25 * RAMP - 1.0) ** 2)
    assert found.rate == 51200.0


def test_a_scaling_of_the_group_counts_and_one_already_done_does_not(tmp_path):
    path = tmp_path / "cut.tdms"
    write(path, {"wf_increment": 1e-3}, group=scaled(LINEAR))
    np.testing.assert_allclose(read_recording(path, (A,)).samples[:, 0], 0.25 * RAMP - 1.0)
    write(path, scaled({"type": "Secret"}, NI_Scaling_Status="scaled"))
    np.testing.assert_array_equal(read_recording(path, (A,)).samples[:, 0], RAMP)


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        (scaled({"type": "Secret"}), "channel a: found a scaling of type Secret, allowed is one of Linear"),
        (scaled(LINEAR | {"Input_Source": 0}), "scaling 0 of scaling 0, allowed is the input of a scaling before its output"),
        (scaled(LINEAR, LINEAR | {"Input_Source": 2}), "scaling 1 of scaling 2"),
        (scaled(LINEAR, NI_Number_Of_Scales=4_000_000_000), "4000000000 scalings, allowed is from 0 to 32"),
        (scaled(LINEAR, SQUARE | {"Coefficients_Size": 2_000_000_000}), "a scaling of 2000000000 values"),
        (
            scaled(LINEAR, *[{"type": "Add", "Left_Operand_Input_Source": i, "Right_Operand_Input_Source": i} for i in range(30)]),
            "30 sums of scalings",
        ),
        (scaled({"type": "Polynomial", "Coefficients_Size": 3, "Input_Source": 0xFFFFFFFF}), "one that cannot be read ("),
        ({"wf_increment": 0.0}, "wf_increment of channel a: found 0.0"),
        ({"wf_increment": float("nan")}, "wf_increment of channel a: found nan"),
        ({"wf_increment": 1e-320}, "wf_increment of channel a"),
        ({"wf_increment": "fast"}, "wf_increment of channel a: found fast"),
        ({"wf_increment": 1e-3, "wf_start_offset": float("inf")}, "wf_start_offset of channel a: found inf"),
        ({}, "sampling_rate_hz: found nothing, allowed is the property wf_increment"),
    ],
)
def test_properties_that_cannot_be_are_refused(tmp_path, properties, words):
    path = tmp_path / "cut.tdms"
    write(path, properties)
    with pytest.raises(InputError) as caught:
        read_recording(path, (A,))
    assert words in str(caught.value)


def test_without_an_increment_the_campaign_says_the_rate(tmp_path):
    write(tmp_path / "cut.tdms", {})
    assert read_recording(tmp_path / "cut.tdms", (A,), 12800.0).rate == 12800.0


@pytest.mark.parametrize(("kind", "words"), [("U", "values of type object"), ("M", "values of type")])
def test_texts_and_times_are_no_samples(tmp_path, kind, words):
    values = np.array(["a", "b"]) if kind == "U" else np.array(["2026-11-21", "2026-11-22"], dtype="datetime64[us]")
    write(tmp_path / "cut.tdms", {"wf_increment": 1.0}, values)
    with pytest.raises(InputError, match=words):
        read_recording(tmp_path / "cut.tdms", (A,))


def two_groups(path: Path, **second: object) -> None:
    stamps = {"wf_increment": 1e-3, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("one", "a", RAMP, stamps),
                nptdms.ChannelObject("two", "a", -RAMP, stamps | second),
                nptdms.ChannelObject("two", "b", 2 * RAMP, stamps | second),
            ]
        )


def test_a_name_in_two_groups_is_told_apart_by_the_group(tmp_path):
    path = tmp_path / "cut.tdms"
    two_groups(path)
    with pytest.raises(InputError, match=r"channel a: found no such channel, allowed is one channel of the file: one/a, two/a, b"):
        read_recording(path, (A,))
    sensors = (Sensor("two/a", Quantity.TRIGGER), Sensor("two/b", Quantity.TRIGGER), B)
    np.testing.assert_array_equal(read_recording(path, sensors).samples, np.stack([-RAMP, 2 * RAMP, 2 * RAMP], axis=1))


@pytest.mark.parametrize(
    ("second", "words"),
    [
        ({"wf_increment": 2e-3}, "different rates (one/a: 1000, b: 500)"),
        ({"wf_start_offset": 0.4}, "start of channel b: found 0.4 s later"),
        ({"wf_start_offset": 0.0004}, ""),
    ],
)
def test_channels_have_one_rate_and_one_start(tmp_path, second, words):
    path = tmp_path / "cut.tdms"
    two_groups(path, **second)
    sensors = (Sensor("one/a", Quantity.TRIGGER), B)
    if not words:
        assert read_recording(path, sensors).rate == 1000.0
        return
    with pytest.raises(InputError) as caught:
        read_recording(path, sensors)
    assert words in str(caught.value)


def test_channels_of_two_lengths_are_refused(tmp_path):
    path = tmp_path / "cut.tdms"
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject("g", "a", RAMP), nptdms.ChannelObject("g", "b", RAMP[:10])])
    with pytest.raises(InputError, match=r"different lengths \(a: 1000, b: 10\)"):
        read_recording(path, (A, B), 1.0)


@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders_and_layouts(tmp_path, order, interleaved):
    values = np.random.default_rng(2).normal(size=(2, 64))
    objects = channel(b"/'g'/'a'", 64, order) + channel(b"/'g'/'b'", 64, order)
    flags = METADATA | NEW_LIST | RAW | INTERLEAVED * interleaved | BIG_ENDIAN * (order == ">")
    data = (values.T if interleaved else values).astype(f"{order}f8").tobytes()
    # the second segment says nothing new
    again = b"TDSm" + struct.pack("<I", flags & ~(METADATA | NEW_LIST)) + struct.pack(f"{order}IQQ", 4713, len(data), 0) + data
    (tmp_path / "cut.tdms").write_bytes(segment(objects, 2, data, flags, order) + again)
    found = read_recording(tmp_path / "cut.tdms", (A, B), 1.0).samples
    np.testing.assert_array_equal(found, np.tile(values, 2).T)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_costs_one_sentence(tmp_path, name, capfd, monkeypatch):
    # memory is traced, which is slow
    monkeypatch.setattr("rcsa_ident.io.recordings.tdms.MOST_CHUNKS", 20_000)
    raw, words = HOSTILE[name]
    path = tmp_path / "cut.tdms"
    path.write_bytes(raw)
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            read_recording(path, (A,), 51200.0)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert peak < 30e6 + 3 * len(raw)
    # nor does the library talk
    assert capfd.readouterr() == ("", "")


def test_a_neighbouring_index_file_is_not_read(tmp_path):
    path = tmp_path / "cut.tdms"
    tdms(path, 51200.0, {"a": np.arange(30.0)})
    path.with_name("cut.tdms_index").write_bytes(b"TDSh" + bytes(100))
    np.testing.assert_array_equal(read_recording(path, (A,)).samples[:, 0], np.arange(30.0))


@pytest.mark.parametrize(
    ("name", "channels", "rate"),
    [
        ("daq_raw.tdms", ["First  Channel", "Second Chan", "Seventh Cha"], 50000.0),
        ("daq_big_endian.tdms", ["Amplitude sweep", "Measured Data/Phase sweep"], 1000.0),
    ],
)
def test_files_of_labview(tmp_path, name, channels, rate):
    """Against the library's own way: all in memory, scaled as a whole."""
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"{name} is not beside the project")
    found = read_recording(path, tuple(Sensor(c, Quantity.TRIGGER) for c in channels))
    assert found.rate == rate
    with nptdms.TdmsFile.read(io.BytesIO(path.read_bytes())) as file:
        group = file.groups()[0]
        for i, channel_name in enumerate(channels):
            np.testing.assert_array_equal(found.samples[:, i], group[channel_name.split("/")[-1]][:])
    assert found.samples.std() > 0.1
    # cut off at any place it is refused
    raw = path.read_bytes()
    for length in (3, 20, 100, 1000, len(raw) // 2, len(raw) - 1):
        cut = tmp_path / "cut.tdms"
        cut.write_bytes(raw[:length])
        with pytest.raises(InputError):
            read_recording(cut, (Sensor(channels[0], Quantity.TRIGGER),))


def test_the_walk_agrees_with_the_library(tmp_path):
    path = tmp_path / "cut.tdms"
    write(path, scaled(LINEAR, SQUARE), group={"note": "rig 4"}, root={"when": np.datetime64("2026-11-21T12:00:00")})
    raw = path.read_bytes()
    metadata = struct.unpack_from("<Q", raw, 20)[0]
    paths, properties = reader._segment_paths(raw[28 : 28 + metadata], "<", len(raw), 10**6, "")
    assert paths == [b"/", b"/'g'", b"/'g'/'a'"]
    assert properties == 2 + len(scaled(LINEAR, SQUARE))


def test_a_text_of_the_file_stays_in_one_line(tmp_path):
    for properties in (scaled({"type": "Two\nlines"}), {"wf_increment": "two\nlines"}, scaled(LINEAR, NI_Number_Of_Scales="two\nlines")):
        write(tmp_path / "cut.tdms", properties)
        with pytest.raises(InputError) as caught:
            read_recording(tmp_path / "cut.tdms", (A,))
        assert "\n" not in str(caught.value)


def test_a_file_says_when_it_was_recorded(tmp_path):
    """`wf_start_time` is UTC; a clock that was never set says nothing."""
    at = np.datetime64("2026-01-05T08:00:00.25")
    tdms(tmp_path / "a.tdms", 1000.0, {"a": RAMP}, wf_start_time=at, wf_start_offset=0.5)
    assert read_recording(tmp_path / "a.tdms", (A,)).started == datetime(2026, 1, 5, 8, 0, 0, 750_000, tzinfo=UTC)
    tdms(tmp_path / "b.tdms", 1000.0, {"a": RAMP})
    assert read_recording(tmp_path / "b.tdms", (A,)).started is None
    tdms(tmp_path / "c.tdms", 1000.0, {"a": RAMP}, wf_start_time=np.datetime64("1904-01-01T00:00:00"))
    assert read_recording(tmp_path / "c.tdms", (A,)).started is None
