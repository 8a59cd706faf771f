"""CSV recordings as spreadsheets and acquisition programs write them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.io import text_columns
from rcsa_ident.io.files import existing_file
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.io.time_base import Irregular, uniform
from rcsa_ident.signals.recording import Quantity, Sensor

A = Sensor("a", Quantity.TRIGGER)
B = Sensor("b", Quantity.TRIGGER)
EXPECTED = [[0.5, -1250.0], [1.5, 2.25], [2.5, 3.0]]

FORMATS = {
    "comma": "time,a,b\n0,0.5,-1.25e3\n0.01,1.5,2.25\n0.02,2.5,3\n",
    "semicolon": "time;a;b\n0;0.5;-1.25e3\n0.01;1.5;2.25\n0.02;2.5;3\n",
    "tab": "time\ta\tb\n0\t0.5\t-1.25e3\n0.01\t1.5\t2.25\n0.02\t2.5\t3\n",
    "german": "time;a;b\n0;0,5;-1,25e3\n0,01;1,5;2,25\n0,02;2,5;3\n",
    "german-tab": "time\ta\tb\n0\t0,5\t-1,25e3\n0,01\t1,5\t2,25\n0,02\t2,5\t3\n",
    "windows": "time,a,b\r\n0,0.5,-1.25e3\r\n0.01,1.5,2.25\r\n0.02,2.5,3\r\n",
    "bom-spaces-empty-lines": "\ufefftime , a, b\n0, 0.5, -1250\n\n0.01, 1.5, 2.25\n0.02, 2.5, 3\n\n",
    "comments-quotes": '# rig 4\n# Kanal\n"time","a","b"\n0,0.5,-1250\n0.01,1.5,2.25\n0.02,2.5,3',
    "other-columns": "clock,Time,b,note,a\n12:00,0,-1250,x,0.5\n12:01,0.01,2.25,ü,1.5\n12:02,0.02,3,,2.5\n",
}


def line_by_line(path, field, largest):
    """Blocks of a file: its header with the first line of numbers, then every line by itself, which the kernel reads where it is plain."""
    lines = existing_file(path, field, largest).read_bytes().splitlines(keepends=True)
    head = 2 + sum(line.startswith(b"#") for line in lines)
    yield b"".join(lines[:head])
    yield from lines[head:]


@pytest.fixture(params=["whole", "line by line"])
def parts(request, monkeypatch):
    if request.param == "line by line":
        monkeypatch.setattr(text_columns, "_blocks", line_by_line)


@pytest.mark.usefixtures("parts")
@pytest.mark.parametrize("text", FORMATS.values(), ids=FORMATS.keys())
def test_formats(tmp_path, text):
    path = tmp_path / "cut.csv"
    path.write_bytes(text.encode())
    recording = read_recording(path, (A, B), 1.0)
    assert recording.rate == 100.0
    assert recording.samples.tolist() == EXPECTED


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252"])
def test_encodings(tmp_path, encoding):
    path = tmp_path / "cut.csv"
    path.write_bytes("a;b;Kühlung\n0,5;-1250;1\n".encode(encoding))
    assert read_recording(path, (A, B), 100.0).samples.tolist() == EXPECTED[:1]


def test_empty_cells_are_lost_samples(tmp_path):
    path = tmp_path / "cut.csv"
    path.write_text("a,b\n1,\n,2\n")
    np.testing.assert_array_equal(read_recording(path, (A, B), 1.0).samples, [[1, np.nan], [np.nan, 2]])


@pytest.mark.parametrize("name", ["comma", "german", "windows"])
def test_a_long_table_takes_no_python_for_its_lines(tmp_path, monkeypatch, name):
    """But for the first part, and with decimal commas or points beside semicolons the one in which they stand first."""
    path = tmp_path / "cut.csv"
    head, *lines = FORMATS[name].splitlines(keepends=True)
    begin = lines[-1].index("2")
    path.write_bytes("".join([head, *lines, *(f"{lines[-1][: begin - 1]}{i:02d}{lines[-1][begin + 1 :]}" for i in range(3, 100))]).encode())
    monkeypatch.setattr(text_columns, "_PART", 200)
    read, by_hand = text_columns.TextTable.columns, []
    monkeypatch.setattr(text_columns.TextTable, "columns", lambda self, names: by_hand.extend(self.lines) or read(self, names))
    recording = read_recording(path, (A, B))
    assert recording.rate == 100.0
    assert recording.samples.tolist() == EXPECTED + 97 * EXPECTED[2:]
    assert 3 < len(by_hand) < 20


def test_gaps_become_lost_samples(tmp_path):
    path = tmp_path / "cut.csv"
    path.write_text("time,a\n" + "".join(f"{i / 51200:.7f},{i}\n" for i in range(40) if i not in (7, 20, 21, 22)))
    recording = read_recording(path, (A,))
    assert recording.rate == 51200.0
    samples = recording.samples[:, 0]
    assert np.flatnonzero(np.isnan(samples)).tolist() == [7, 20, 21, 22]
    kept = ~np.isnan(samples)
    assert samples[kept].tolist() == np.arange(40)[kept].tolist()


BROKEN = [
    ("a,b\n1,2\n3,x\n", ["line 3", "column b", "found x", "a number"]),
    ("a,b\n1,2\n3,1_000\n", ["line 3", "column b", "found 1_000"]),
    ("a,b\n1,2\n\n3\n", ["line 4", "1 cells", "2 cells as in the header", "comma"]),
    ("a;b\n1;2;3\n", ["line 2", "3 cells", "semicolon"]),
    ("a,b\n", ["1 lines", "at least one line of numbers"]),
    ("1.5,2\n1,2\n", ["header", "found 1.5", "column names"]),
    ("a,c\n1,2\n", ["channel b", "no such channel", "of the file: a, c"]),
    ("a,b,b\n1,2,3\n", ["channel b", "two columns of that name"]),
    ("time,time_s,a,b\n0,0,1,2\n", ["time", "one time column"]),
    ("a,b\n1,2\n", ["sampling_rate_hz", "found nothing", "a column 'time'"]),
    ("time,a,b\n0,1,2\n", ["line 2", "column time", "at least two times"]),
    ("time,a,b\n0,1,2\n,1,2\n2,1,2\n", ["line 3", "column time", "no number"]),
    ("time,a,b\n0,1,2\ninf,1,2\n2,1,2\n", ["line 3", "column time", "found inf"]),
    ("time,a,b\n0,1,2\n1,1,2\n1,1,2\n2,1,2\n", ["line 4", "column time", "1 after 1", "increasing times"]),
    (
        "time,a,b\n" + "".join(f"{i + 0.37 * (i > 5):.3f},1,2\n" for i in range(20)),
        ["line 8", "column time", "1.37 sampling intervals", "whole multiples of the sampling interval, 1"],
    ),
    ("time,a,b\n0,1,2\n1,1,2\n2,1,2\n1e9,1,2\n", ["line 5", "samples lost", "at most half of the samples"]),
    ("time,a,b\n0,1,2\n1,1,2\n2,1,2\n1e300,1,2\n", ["line 5", "samples lost", "at most half of the samples"]),
    ("a;b\n1.234,5;2\n", ["line 2", "one decimal sign"]),
    ("a;b\n1,5;2\n1.5;2\n", ["line 3", "found 1.5;2", "one decimal sign"]),
    ("a,b\n1\x002,2\n", ["binary data", "a text table"]),
    ("", ["an empty file"]),
]


@pytest.mark.usefixtures("parts")
@pytest.mark.parametrize(("text", "words"), BROKEN, ids=[f"{i}-{w[0]}" for i, (_, w) in enumerate(BROKEN)])
def test_a_bad_file_is_answered_with_one_sentence(tmp_path, text, words):
    path = tmp_path / "cut.csv"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_recording(path, (A, B))
    message = str(error.value)
    assert str(path) in message
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    rate=st.sampled_from([10.0, 1000.0, 25600.0, 48000.0, 51200.0, 102400.0]),
    decimals=st.integers(6, 12),
    start=st.floats(-1.0, 100.0),
    lost=st.sets(st.integers(1, 298), max_size=20),
)
def test_rounded_times_give_rate_and_places(rate, decimals, start, lost):
    if 10.0**-decimals > 0.2 / rate:
        decimals = 7
    places = np.array([i for i in range(300) if i not in lost])
    time = np.round(start + places / rate, decimals)
    found, index = uniform(time)
    assert index.tolist() == places.tolist()
    assert found == rate


def test_a_coarse_clock_is_taken_where_it_shows_no_gap():
    time = np.round(np.arange(7680) / 51200.0, 5)
    rate, index = uniform(time)
    assert rate == 51200.0
    assert index[-1] == 7679
    with pytest.raises(Irregular):
        uniform(np.delete(time, [2000, 2001, 2002]))


def test_a_rate_that_is_no_whole_number_is_kept():
    rate, _ = uniform(np.arange(1000) / 51234.5678)
    assert rate == pytest.approx(51234.5678, rel=1e-11)
    assert uniform(np.round(np.arange(1000) / 51234.5678, 7), 51234.5678)[0] == 51234.5678


def test_jitter_above_rounding_is_refused():
    time = np.arange(200) / 1000.0
    time[100] += 0.3e-3
    with pytest.raises(Irregular) as error:
        uniform(time)
    assert error.value.row == 100
