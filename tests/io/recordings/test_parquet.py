"""Parquet recordings: rates, types, and files that lie about what they unpack to."""

from __future__ import annotations

import struct
import tracemalloc

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings import parquet as reader
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.signals.recording import Quantity, Sensor

pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
pq = pytest.importorskip("pyarrow.parquet")
X = Sensor("x", Quantity.TRIGGER)
Y = Sensor("y", Quantity.TRIGGER)
VALUES = np.random.default_rng(4).normal(size=5000)


def write(path, metadata=None, columns=None, **options):
    pq.write_table(pyarrow.table(columns).replace_schema_metadata(metadata), path, **options)
    return path


@pytest.mark.parametrize("codec", ["none", "snappy", "gzip", "zstd", "lz4", "brotli"])
@pytest.mark.parametrize(
    "options", [{}, {"use_dictionary": False}, {"data_page_version": "2.0"}, {"row_group_size": 700, "data_page_size": 512}]
)
def test_layouts(tmp_path, codec, options):
    path = write(tmp_path / "cut.parquet", None, {"x": VALUES, "y": np.arange(5000) % 7}, compression=codec, **options)
    np.testing.assert_array_equal(read_recording(path, (Y, X), 100.0).samples, np.stack([np.arange(5000) % 7, VALUES], axis=1))


def test_byte_stream_split_and_small_types(tmp_path):
    single, whole = VALUES.astype("f4"), np.arange(5000, dtype="u1")
    path = write(tmp_path / "cut.parquet", None, {"x": single, "y": whole}, use_dictionary=False, use_byte_stream_split=["x"])
    np.testing.assert_array_equal(read_recording(path, (X, Y), 100.0).samples, np.stack([single, whole], axis=1))


@pytest.mark.parametrize(("name", "scale"), [("time_s", 1.0), ("time_ms", 1e3), ("Time_us", 1e6), ("t_ns", 1e9)])
def test_the_name_of_the_times_tells_their_unit(tmp_path, name, scale):
    """Before, a column time_ms was no time, and the campaign's rate counted."""
    path = write(tmp_path / "cut.parquet", None, {"x": VALUES, name: scale * np.arange(5000) / 25_600.0})
    found = read_recording(path, (X,), 51_200.0)
    assert found.rate == pytest.approx(25_600.0, rel=1e-9)
    np.testing.assert_array_equal(found.samples[:, 0], VALUES)


def test_where_the_rate_comes_from(tmp_path):
    path = tmp_path / "cut.parquet"
    assert read_recording(write(path, None, {"x": VALUES}), (X,), 1000.0).rate == 1000.0
    assert read_recording(write(path, {"sampling_rate_hz": "51200"}, {"x": VALUES}), (X,), 1000.0).rate == 51200.0
    time = np.delete(np.arange(5001) / 25600.0, 3000)
    found = read_recording(write(path, {"sampling_rate_hz": "51200"}, {"x": VALUES, "time": time}), (X,), 1000.0)
    assert found.rate == 25600.0
    assert np.flatnonzero(np.isnan(found.samples[:, 0])).tolist() == [3000]


def test_a_null_is_a_lost_sample_and_a_dot_belongs_to_a_name(tmp_path):
    columns = {"x": pyarrow.array([1.0, None, 3.0]), "y": pyarrow.array([1, 2, None]), "cut.x": [4.0, 5.0, 6.0]}
    path = write(tmp_path / "cut.parquet", None, columns)
    found = read_recording(path, (X, Y, Sensor("cut.x", Quantity.TRIGGER)), 1.0).samples
    np.testing.assert_array_equal(found, [[1, 1, 4], [np.nan, 2, 5], [3, np.nan, 6]])


@pytest.mark.parametrize(
    ("metadata", "columns", "words"),
    [
        (None, {"x": VALUES}, "sampling_rate_hz: found nothing, allowed is a column 'time' [s]"),
        ({"sampling_rate_hz": "fast"}, {"x": VALUES}, "sampling_rate_hz: found fast"),
        ({"sampling_rate_hz": "-1"}, {"x": VALUES}, "sampling_rate_hz: found -1"),
        ({"sampling_rate_hz": "nan"}, {"x": VALUES}, "sampling_rate_hz: found nan"),
        (None, {"x": ["a"]}, "column x: found values of type times, texts or decimals"),
        (None, {"x": [b"a"]}, "column x: found values of type BYTE_ARRAY"),
        (None, {"x": [True]}, "column x: found values of type BOOLEAN"),
        (None, {"x": np.array(["2026-11-21"], "datetime64[us]")}, "column x: found values of type times"),
        (None, {"x": [[1.0, 2.0]]}, "nested columns"),
        (None, {"x": [{"a": 1.0}]}, "nested columns"),
        (None, {"x": np.zeros(0)}, "0 rows"),
        (None, {"x": VALUES, "time": VALUES}, "column time row"),
        (None, {"x": VALUES, "time": VALUES, "Time_s": VALUES}, "one time column"),
        (None, {"y": VALUES}, "channel x: found no such channel"),
    ],
)
def test_what_is_no_recording_is_one_sentence(tmp_path, metadata, columns, words):
    path = write(tmp_path / "cut.parquet", metadata, columns)
    with pytest.raises(InputError) as caught:
        read_recording(path, (X,))
    assert words in str(caught.value)
    assert str(path) in str(caught.value)


def bomb(path):
    """Zeros without end, in a page of few bytes."""
    write(path, None, {"x": np.zeros(20_000_000)}, use_dictionary=False, compression="zstd", data_page_size=2**30, row_group_size=2**30)


def repeated(path):
    """A million times the same number: few bytes by the dictionary's run lengths."""
    write(path, None, {"x": np.zeros(30_000_000)}, row_group_size=2**30)


def described(path):
    raw = path.read_bytes()
    footer = struct.unpack_from("<I", raw, len(raw) - 8)[0]
    groups = reader._structs(reader._struct(raw, len(raw) - 8 - footer)[0], 4)
    return [column[3, 12] for column in reader._structs(groups[0], 1)]


@pytest.mark.parametrize(("make", "words"), [(bomb, "times the file's size"), (repeated, "times the file's size")])
def test_a_bomb_is_refused_before_it_unpacks(tmp_path, make, words):
    path = tmp_path / "cut.parquet"
    make(path)
    assert path.stat().st_size < 1e6
    pool = pyarrow.default_memory_pool()
    before = pool.max_memory()
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            read_recording(path, (X,), 1.0)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert words in str(caught.value)
    assert peak < 5e6
    assert pool.max_memory() == before


def varint(value: int) -> bytes:
    value = value << 1
    found = b""
    while value > 0x7F:
        found, value = found + bytes([value & 0x7F | 0x80]), value >> 7
    return found + bytes([value])


def page(full: int, packed: int) -> bytes:
    """A page's header with the two sizes, and as many bytes as it says."""
    return b"\x15\x00\x15" + varint(full) + b"\x15" + varint(packed) + b"\x00"


@pytest.mark.parametrize(
    ("raw", "sizes"),
    [(page(100, 5) + bytes(5), [100]), (page(2**31 - 1, 0) + page(7, 3) + bytes(3), [2**31 - 1, 7])],
)
def test_sizes_of_pages_are_read_from_their_headers(raw, sizes):
    chunk = {(9, 6): 4, (7, 6): len(raw)}
    assert reader._page_sizes(b"PAR1" + raw + bytes(8), chunk, "") == sizes


@pytest.mark.parametrize(
    ("raw", "chunk", "words"),
    [
        (page(100, 50) + bytes(5), {}, "a page of 50 bytes that unpack to 100"),
        (page(100, 5) + bytes(5), {(7, 6): 10**9}, "pages inside of a file"),
        (page(100, 5) + bytes(5), {(9, 6): 10**9}, "pages inside of a file"),
        (page(100, 5) + bytes(5), {(9, 6): -4}, "pages inside of a file"),
        (page(100, 5) + bytes(5), {(11, 6): 1}, "pages inside of a file"),
    ],
)
def test_pages_that_lie_are_refused(raw, chunk, words):
    with pytest.raises(InputError) as caught:
        reader._page_sizes(b"PAR1" + raw + bytes(8), {(9, 6): 4, (7, 6): len(raw)} | chunk, "")
    assert words in str(caught.value)


@pytest.mark.parametrize(("size", "words"), [(2**31 - 1, "pages of up to 2.15e+03 MB"), (100_000_000, "pages of up to 100 MB")])
def test_a_page_that_unpacks_to_too_much_is_refused(tmp_path, size, words):
    """The header of the first page is replaced by one that says more; what stands in the description stays."""
    path = write(tmp_path / "cut.parquet", None, {"x": VALUES}, use_dictionary=False)
    raw = bytearray(path.read_bytes())
    place = described(path)[0][9, 6]
    _, data = reader._struct(bytes(raw), place)
    head = reader._struct(bytes(raw), place)[0]
    old = b"\x15" + varint(head[2, 5])
    new = b"\x15" + varint(size)
    at = bytes(raw).index(old, place)
    # the chunk keeps its length: bytes of the page make room
    raw[at : at + len(old)] = new
    del raw[data + 10 : data + 10 + len(new) - len(old)]
    packed = raw.index(b"\x15" + varint(head[3, 5]), at)
    raw[packed : packed + 1 + len(varint(head[3, 5]))] = b"\x15" + varint(head[3, 5] - (len(new) - len(old)))
    path.write_bytes(raw)
    with pytest.raises(InputError) as caught:
        read_recording(path, (X,), 1.0)
    assert words in str(caught.value)


def test_the_description_has_a_limit(tmp_path):
    path = write(tmp_path / "cut.parquet", {"note": "x" * 3_000_000}, {"x": VALUES})
    with pytest.raises(InputError, match=r"a description of [0-9]+ bytes, allowed is at most 2 MB"):
        read_recording(path, (X,), 1.0)


def test_an_extension_of_the_schema_stays_asleep(tmp_path):
    """A type that asks for a class of its own is read as the numbers below it."""
    field = pyarrow.field(
        "x", pyarrow.float64(), metadata={"ARROW:extension:name": "arrow.py_extension_type", "ARROW:extension:metadata": b"\x80\x04"}
    )
    table = pyarrow.table([pyarrow.array(VALUES)], schema=pyarrow.schema([field]))
    pq.write_table(table, tmp_path / "cut.parquet")
    np.testing.assert_array_equal(read_recording(tmp_path / "cut.parquet", (X,), 1.0).samples[:, 0], VALUES)
