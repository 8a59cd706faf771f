"""HDF5 recordings that are broken, or that reach for something outside of themselves."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from pathlib import Path

import h5py
import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.recordings.readers import read_recording, write_recording
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.fixtures.hostile_hdf5 import (
    DATA,
    bomb,
    damaged,
    endless_heap,
    external_link,
    external_link_beside,
    external_storage,
    foreign_filter,
    garbled_chunk,
    group,
    huge_chunks,
    inflating_chunk,
    list_of_rates,
    long_chunk,
    lzf_after_deflate,
    make,
    many_chunks,
    nested_heaps,
    never_written,
    own_rates,
    soft_link,
    terabytes,
    truncated,
    twice_deflated,
    unwritten,
    virtual,
    virtual_behind_a_user_block,
    virtual_of_many_dimensions,
)

X = Sensor("x", Quantity.TRIGGER)
Y = Sensor("y", Quantity.TRIGGER)


BROKEN: list[tuple[Callable[[Path], object], list[str]]] = [
    (external_link, ["channel x", "a link to another file", "in the file itself"]),
    (external_link_beside, ["channel z", "a link to another file"]),
    (soft_link, ["channel x", "a soft link"]),
    (external_storage, ["channel x", "samples in an external file"]),
    (virtual, ["recording", "a virtual dataset", "in the file itself"]),
    (virtual_behind_a_user_block, ["recording", "a virtual dataset"]),
    (virtual_of_many_dimensions, ["recording", "a virtual dataset"]),
    (terabytes, ["8e+06 MB of declared samples", "at most 2048 MB"]),
    (bomb, ["8000000 bytes declared", "200 times the file's size"]),
    (huge_chunks, ["channel x", "chunks of 268 MB", "at most 8 MB"]),
    (unwritten, ["channel x", "never written", "a complete channel"]),
    (never_written, ["channel x", "never written"]),
    (foreign_filter, ["channel x", "filter number 6", "deflate, shuffle, fletcher32, lzf"]),
    (twice_deflated, ["channel x", "a filter applied twice"]),
    (inflating_chunk, ["channel x", "inflates to more than declared", "256 bytes"]),
    (long_chunk, ["channel x", "a chunk larger than declared"]),
    (lzf_after_deflate, ["channel x", "a filter after deflate"]),
    (many_chunks, ["channel x", "200000 chunks", "at most 100000"]),
    (garbled_chunk, ["cannot be read", "a complete HDF5 file"]),
    (truncated, ["cannot be read (truncated file", "a complete HDF5 file"]),
    (damaged, ["cannot be read", "a complete HDF5 file"]),
    (endless_heap, ["cannot be read (a heap with an object of no size)"]),
    (nested_heaps, ["cannot be read (over 1000000 objects in heaps)"]),
    (group, ["channel x", "a group", "a dataset"]),
    (own_rates, ["sampling_rate_hz", "x: 51200, y: 25600", "one rate for all channels"]),
    (list_of_rates, ["sampling_rate_hz of the file", "shape (2,)", "one number"]),
    (lambda p: make(p, rate=None, x=DATA).close(), ["sampling_rate_hz", "found nothing", "the campaign's rate"]),
    (lambda p: make(p, rate=-1.0, x=DATA).close(), ["sampling_rate_hz of the file", "found -1.0", "greater than 0"]),
    (lambda p: make(p, rate="51200", x=DATA).close(), ["sampling_rate_hz of the file", "found a text", "one number"]),
    (lambda p: make(p, x=DATA, y=DATA[:60]).close(), ["different lengths (x: 64, y: 60)", "one length"]),
    (lambda p: make(p, x=DATA.reshape(8, 8)).close(), ["channel x", "shape (8, 8)", "1-D"]),
    (lambda p: make(p, x=DATA[:0]).close(), ["channel x", "shape (0,)", "at least one sample"]),
    (lambda p: make(p, x=np.array([b"a", b"b"])).close(), ["channel x", "values of type |S1", "real numbers"]),
    (lambda p: make(p, x=DATA * 1j).close(), ["channel x", "values of type complex64", "real numbers"]),
    (lambda p: make(p, flange_y=DATA).close(), ["channel x", "no such channel", "of the file: flange_y"]),
    (lambda p: p.write_bytes(b"time,x\n0,1\n"), ["cannot be read (file signature not found)"]),
    (lambda p: p.write_bytes(b""), ["an empty file"]),
    (lambda p: p.mkdir(), ["a folder", "an existing file"]),
    (lambda p: None, ["no such file", "an existing file"]),
]  # fmt: skip


@pytest.mark.parametrize(("write", "words"), BROKEN, ids=[f"{i}-{w[0][:24]}" for i, (_, w) in enumerate(BROKEN)])
def test_a_bad_file_is_answered_with_one_sentence(tmp_path, write, words):
    path = tmp_path / "cut.h5"
    write(path)
    both = any("y: " in word for word in words)
    with pytest.raises(InputError) as error:
        read_recording(path, (X, Y) if both else (X,))
    message = str(error.value)
    assert str(path) in message
    assert "\n" not in message
    for word in words:
        assert word in message


def test_nothing_outside_the_file_is_opened(tmp_path):
    """The link's target would be read if it were followed; a missing target would give another message."""
    for write in (external_link, external_storage, virtual):
        path = tmp_path / "cut.h5"
        write(path)
        path.with_name("other.h5").unlink(missing_ok=True)
        path.with_name("raw.bin").unlink(missing_ok=True)
        with pytest.raises(InputError, match="in the file itself"):
            read_recording(path, (X,))


def test_own_attribute_wins_and_campaign_is_last(tmp_path):
    path = tmp_path / "cut.h5"
    with make(path, rate=1000.0, x=DATA) as file:
        file["x"].attrs["sampling_rate_hz"] = 2000
    assert read_recording(path, (X,), 3000.0).rate == 2000.0
    make(path, rate=1000.0, x=DATA).close()
    assert read_recording(path, (X,), 3000.0).rate == 1000.0
    make(path, rate=None, x=DATA).close()
    assert read_recording(path, (X,), 3000.0).rate == 3000.0


@pytest.mark.parametrize("options", [{"compression": "gzip", "shuffle": True}, {"compression": "lzf"}, {"fletcher32": True}])
def test_usual_filters_are_read(tmp_path, options):
    path = tmp_path / "cut.hdf5"
    noise = np.random.default_rng(2).normal(size=5000).astype(np.float32)
    with make(path) as file:
        file.create_dataset("x", data=noise, chunks=(1000,), **options)
    np.testing.assert_array_equal(read_recording(path, (X,)).samples[:, 0], noise)


@pytest.mark.parametrize("kind", ["i2", "i4", "u1", ">f4", "f8", "f2", "?"])
def test_any_real_type_is_read(tmp_path, kind):
    path = tmp_path / "cut.h5"
    values = np.array([0, 1, 1, 0, 1]).astype(kind)
    make(path, x=values).close()
    np.testing.assert_array_equal(read_recording(path, (X,)).samples[:, 0], values.astype(float))


def test_same_recording_same_bytes(tmp_path):
    for name in ("a.h5", "b.h5"):
        write_hdf5(tmp_path / name, 51200.0, {"x": DATA, "y": DATA})
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["x"].dtype == np.float32
        assert file["x"].chunks is None


@pytest.mark.parametrize(
    ("rate", "channels", "words"),
    [
        (0.0, {"x": DATA}, "sampling_rate_hz"),
        (1.0, {}, "channels: found none"),
        (1.0, {"x": DATA, "y": DATA[1:]}, "one length"),
        (1.0, {"x": DATA.reshape(8, 8)}, "one length"),
        (1.0, {"a/b": DATA}, "a name without '/'"),
    ],
)
def test_what_cannot_be_read_is_not_written(tmp_path, rate, channels, words):
    with pytest.raises(InputError, match=words):
        write_hdf5(tmp_path / "a.h5", rate, channels)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("attribute", "moment"),
    [
        ("2026-01-05T08:00:30.250", datetime(2026, 1, 5, 8, 0, 30, 250_000)),
        ("2026-01-05T08:00:30+01:00", datetime(2026, 1, 5, 8, 0, 30, tzinfo=timezone(timedelta(hours=1)))),
        # what others call so
        ("2026-01-05", None),
        ("yes", None),
        (np.array([1.0, 2.0]), None),
        ("2026-01-05T08:00:30" + 60 * "0", None),
    ],
)
def test_a_file_says_when_it_was_recorded(tmp_path, attribute, moment):
    path, sensor = tmp_path / "a.h5", Sensor("a", Quantity.TRIGGER)
    write_hdf5(path, 1000.0, {"a": np.ones(10)})
    assert read_recording(path, (sensor,)).started is None
    with h5py.File(path, "r+") as file:
        file.attrs["started"] = attribute
    found = read_recording(path, (sensor,))
    assert found.started == moment
    write_recording(tmp_path / "b.h5", found)
    assert read_recording(tmp_path / "b.h5", (sensor,)).started == moment
