"""WAV recordings: full scale, names of tracks, layouts that recorders write, files that lie."""

from __future__ import annotations

import struct
import tracemalloc
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
import scipy.io.wavfile
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.fixtures.recording_formats import wav

FIRST = Sensor("ch1", Quantity.TRIGGER)
SECOND = Sensor("ch2", Quantity.TRIGGER)


@pytest.mark.parametrize(
    ("kind", "scale"), [("u1", 128.0), ("i2", 2.0**15), ("i4", 2.0**31), ("f4", 1.0), ("f8", 1.0)], ids=["8", "16", "32", "float", "double"]
)
def test_what_scipy_writes_has_full_scale_1(tmp_path, kind, scale):
    rng = np.random.default_rng(5)
    values = rng.uniform(-1.0, 1.0, (500, 2)) * scale
    whole = np.rint(values + 128.0 * (kind == "u1")).clip(0 if kind == "u1" else -scale, 255 if kind == "u1" else scale - 1)
    table = (whole if scale > 1.0 else values).astype(kind)
    scipy.io.wavfile.write(tmp_path / "cut.wav", 48000, table)
    found = read_recording(tmp_path / "cut.wav", (SECOND, FIRST))
    assert found.rate == 48000.0
    np.testing.assert_array_equal(found.samples, ((table.astype(float) - 128.0 * (kind == "u1")) / scale)[:, ::-1])


@pytest.mark.filterwarnings("ignore::scipy.io.wavfile.WavFileWarning")
@settings(max_examples=30, deadline=None)
@given(values=st.lists(st.integers(-(2**23), 2**23 - 1), min_size=1, max_size=30))
def test_24_bits_are_exact(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("wav") / "cut.wav"
    wav(path, 51200.0, {"x": np.array(values) / 2.0**23})
    np.testing.assert_array_equal(read_recording(path, (FIRST,)).samples[:, 0], np.array(values) / 2.0**23)
    # scipy keeps 24 bits left in 32
    np.testing.assert_array_equal(scipy.io.wavfile.read(path)[1] / 2.0**31, np.array(values) / 2.0**23)


def test_the_sensitivity_calibrates(tmp_path):
    """10 V of full scale over a gap sensor of 10 V/mm: full scale is a millimetre."""
    wav(tmp_path / "cut.wav", 51200.0, {"flange_x": np.array([0.5, -1.0])})
    gap = Sensor("flange_x", Quantity.DISPLACEMENT, Dof.X, 10.0e3 / 10.0)
    np.testing.assert_allclose(read_recording(tmp_path / "cut.wav", (gap,)).samples[:, 0], [0.5e-3, -1.0e-3], rtol=1e-15)


def chunk(name: bytes, data: bytes, size: int | None = None) -> bytes:
    return name + struct.pack("<I", len(data) if size is None else size) + data + b"\0" * (len(data) % 2)


def form(tag: int = 1, count: int = 1, rate: int = 48000, width: int = 2, bits: int = 16, more: bytes = b"") -> bytes:
    return chunk(b"fmt ", struct.pack("<HHIIHH", tag, count, rate, rate * count * width, count * width, bits) + more)


def riff(*chunks: bytes, head: bytes = b"RIFF") -> bytes:
    body = b"WAVE" + b"".join(chunks)
    return head + struct.pack("<I", len(body)) + body


SAMPLES = chunk(b"data", np.array([1, -2, 3, 16384], "<i2").tobytes())
EXTENSION = struct.pack("<HHIH", 22, 16, 0, 1) + bytes.fromhex("000000001000800000aa00389b71")


@pytest.mark.parametrize(
    "raw",
    [
        riff(form(), SAMPLES),
        riff(chunk(b"LIST", b"odd"), form(), chunk(b"junk", bytes(7)), SAMPLES, chunk(b"bext", bytes(11))),
        riff(form(0xFFFE, more=EXTENSION), SAMPLES),
        riff(chunk(b"ds64", struct.pack("<QQQI", 100, 8, 4, 0)), form(), SAMPLES.replace(b"\x08\0\0\0", b"\xff" * 4, 1), head=b"RF64"),
    ],
    ids=["plain", "other chunks", "extensible", "rf64"],
)
def test_layouts(tmp_path, raw):
    (tmp_path / "cut.wav").write_bytes(raw)
    np.testing.assert_array_equal(read_recording(tmp_path / "cut.wav", (FIRST,)).samples[:, 0] * 2**15, [1, -2, 3, 16384])


def test_big_endian(tmp_path):
    values = np.array([1, -2, 3, 16384])
    body = (
        b"WAVEfmt "
        + struct.pack(">IHHIIHH", 16, 1, 1, 48000, 96000, 2, 16)
        + b"data"
        + struct.pack(">I", 8)
        + values.astype(">i2").tobytes()
    )
    (tmp_path / "cut.wav").write_bytes(b"RIFX" + struct.pack(">I", len(body)) + body)
    np.testing.assert_array_equal(read_recording(tmp_path / "cut.wav", (FIRST,)).samples[:, 0] * 2**15, values)


@pytest.mark.parametrize(
    ("stamp", "started"),
    [
        (b"2026-01-0508:30:59", datetime(2026, 1, 5, 8, 30, 59)),
        (b"2026:01:0508-30-59", datetime(2026, 1, 5, 8, 30, 59)),
        (b"2026-13-0508:30:59", None),
        (bytes(18), None),
        (b"2026-01-05", None),
    ],
)
def test_a_broadcast_wave_tells_when_it_began(tmp_path, stamp, started):
    (tmp_path / "cut.wav").write_bytes(riff(form(), chunk(b"bext", bytes(320) + stamp), SAMPLES))
    assert read_recording(tmp_path / "cut.wav", (FIRST,)).started == started


@pytest.mark.parametrize(
    "names",
    [
        b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;">]><x>&b;</x>',
        b"<TRACK",
        b"<x><TRACK><INTERLEAVE_INDEX>99999999999999999999</INTERLEAVE_INDEX><NAME>a</NAME></TRACK></x>",
        b"<x><TRACK><INTERLEAVE_INDEX>\xc2\xb2</INTERLEAVE_INDEX></TRACK></x>",
        b"<x>" + bytes(70_000),
    ],
)
def test_odd_names_leave_the_numbers(tmp_path, names):
    (tmp_path / "cut.wav").write_bytes(riff(form(), chunk(b"iXML", names), SAMPLES))
    assert read_recording(tmp_path / "cut.wav", (FIRST,)).samples.shape == (4, 1)


def test_a_name_by_an_entity_is_none(tmp_path):
    names = b'<!DOCTYPE x [<!ENTITY n "gap">]><x><TRACK><INTERLEAVE_INDEX>1</INTERLEAVE_INDEX><NAME>&n;</NAME></TRACK></x>'
    for raw, known in ((names, False), (names[names.index(b"<x>") :].replace(b"&n;", b"gap"), True)):
        (tmp_path / "cut.wav").write_bytes(riff(form(), chunk(b"iXML", raw), SAMPLES))
        if known:
            assert read_recording(tmp_path / "cut.wav", (Sensor("gap", Quantity.TRIGGER),)).samples.shape == (4, 1)
            continue
        with pytest.raises(InputError, match=r"channel gap: found no such channel, allowed is one channel of the file: ch1"):
            read_recording(tmp_path / "cut.wav", (Sensor("gap", Quantity.TRIGGER),))


HOSTILE = {
    "gigabytes": (riff(form(), chunk(b"data", bytes(8), 2**30)), "8 bytes of samples of 1073741824: the file is cut off"),
    "rf64 of exabytes": (
        riff(chunk(b"ds64", struct.pack("<QQQI", 0, 2**60, 0, 0)), form(), chunk(b"data", bytes(8), 2**32 - 1), head=b"RF64"),
        "cut off",
    ),
    "no format": (riff(SAMPLES), "no chunk 'fmt'"),
    "no data": (riff(form()), "no chunk 'data'"),
    "no sample": (riff(form(), chunk(b"data", b"")), "0 bytes of samples"),
    "half a sample": (riff(form(), chunk(b"data", bytes(3))), "3 bytes of samples, allowed is whole samples of 1 channels"),
    "mp3 inside": (riff(form(85), SAMPLES), "format 85, 1 channels"),
    "no channel": (riff(form(count=0), SAMPLES), "0 channels"),
    "no rate": (riff(form(rate=0), SAMPLES), "sampling_rate_hz: found 0"),
    "17 bits in two bytes": (riff(form(bits=17), SAMPLES), "17 bits in 2 bytes"),
    "a short format": (riff(chunk(b"fmt ", bytes(8)), SAMPLES), "a chunk 'fmt' of 8 bytes"),
    "many chunks": (riff(*(chunk(f"{i:04x}".encode(), b"") for i in range(20_000))), "more than 10000 chunks"),
    "another kind": (b"RIFF\x04\0\0\0AVI ", "does not begin with RIFF and WAVE"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_costs_one_sentence(tmp_path: Path, name):
    raw, words = HOSTILE[name]
    (tmp_path / "cut.wav").write_bytes(raw)
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            read_recording(tmp_path / "cut.wav", (FIRST,))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert words in str(caught.value)
    assert peak < 10e6
