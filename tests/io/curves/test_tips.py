"""FRF.csv and LOBES.csv."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.curves.tips import read_frf_csv, read_lobes_csv, write_frf_csv, write_lobes_csv

number = st.floats(-1e300, 1e300)


@settings(max_examples=40, deadline=None)
@given(
    rows=st.lists(st.tuples(st.floats(0.0, 1e5), number, number, number, number, number), min_size=1, max_size=10, unique_by=lambda r: r[0])
)
def test_frf_reads_back_exactly(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("frf") / "FRF.csv"
    f, a, b, c, d, band = np.array(sorted(rows)).T
    x, y = np.empty(f.size, complex), np.empty(f.size, complex)
    x.real, x.imag, y.real, y.imag = a, b, c, d
    write_frf_csv(path, f, {"Y": y, "X": x}, {"X_std": band})
    read = read_frf_csv(path)
    assert path.read_text().splitlines()[0] == "frequency_hz,X_re,X_im,Y_re,Y_im,X_std"
    np.testing.assert_array_equal(read.frequency, f)
    np.testing.assert_array_equal(read.values["X"], x)
    np.testing.assert_array_equal(read.values["Y"], y)
    np.testing.assert_array_equal(read.bands["X_std"], band)


def test_frf_of_one_axis(tmp_path):
    write_frf_csv(tmp_path / "F.csv", [1, 2], {"Y": [1j, 2]})
    assert (tmp_path / "F.csv").read_text() == "frequency_hz,Y_re,Y_im\n1.0,0.0,1.0\n2.0,2.0,0.0\n"
    read = read_frf_csv(tmp_path / "F.csv")
    assert list(read.values) == ["Y"]
    assert read.bands == {}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1.0], {}), "axes: found none"),
        (([1.0], {"W": [1.0]}), "axes: found W"),
        (([1.0, 1.0], {"X": [1.0, 1.0]}), "frequency_hz: found 1.0, allowed is increasing frequencies of 0 or more"),
        (([-1.0], {"X": [1.0]}), "frequency_hz: found -1.0"),
        (([1.0, 2.0], {"X": [1.0]}), "1-D arrays of one length"),
        (([], {"X": []}), "at least one row"),
        (([1.0, 2.0], {"X": [1.0, np.nan]}), "row 2: column X_re: found nan"),
        (([1.0], {"X": [1.0]}, {"X_re": [1.0]}), "column: found X_re"),
        (([1.0], {"X": [1.0]}, {"a,b": [1.0]}), "column: found a,b"),
        *((([1.0], {"X": [1.0]}, {f" {sign}1+1": [1.0]}), f"column: found  {re.escape(sign)}1.*allowed is a name") for sign in "=+-@"),
        (([1.0], {"X": [1.0]}, {"b": [np.inf]}), "column b: found inf"),
        *((([1.0], {"X": [1.0]}, {f" {sign}A1": [1.0]}), f"column: found  {re.escape(sign)}A1") for sign in "=+-@"),
    ],
)
def test_frf_that_is_not_written(tmp_path, arguments, words):
    with pytest.raises(InputError, match=words):
        write_frf_csv(tmp_path / "F.csv", *arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("frequency_hz,W_re\n1,2\n", "column X_re: found only frequency_hz, W_re"),
        ("f,X_re,X_im\n1,2,3\n", "column frequency_hz: found only"),
        ("frequency_hz,X_re\n1,2\n", "column X_im"),
        ("frequency_hz,X_re,X_im\n1,2,3\n1,2,3\n", "line 3: column frequency_hz: found 1, allowed is increasing frequencies of 0 or more"),
        ("frequency_hz,X_re,X_im\n-1,2,3\n", "line 2: column frequency_hz: found -1"),
        ("frequency_hz,X_re,X_im\n1,2,\n", "line 2: column X_im: found no finite number"),
        ("frequency_hz,X_re,X_im\n1,2,a\n", "line 2: column X_im: found a, allowed is a number"),
        ("frequency_hz,X_re,X_im,X_re\n1,2,3,4\n", "two columns of that name"),
        ("frequency_hz,X_re,X_im\n", "at least one line of numbers"),
    ],
)
def test_frf_that_is_not_read(tmp_path, text, words):
    path = tmp_path / "F.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_frf_csv(path)


def test_lobes_are_empty_where_stable(tmp_path):
    path = tmp_path / "LOBES.csv"
    write_lobes_csv(
        path, [5e3, 6e3, 7e3, 8e3], [0.1, np.inf, np.nan, 2], [810.5, 3, 4, np.nan], [3, 2, 1, 0], {"limit_std": [0.1, np.nan, 1, 2]}
    )
    assert path.read_text() == (
        "spindle_speed_rpm,limit_depth_mm,chatter_frequency_hz,lobe,limit_std\n"
        "5000.0,0.1,810.5,3,0.1\n6000.0,,,,\n7000.0,,,,1.0\n8000.0,2.0,,0,2.0\n"
    )
    read = read_lobes_csv(path)
    np.testing.assert_array_equal(read.limit, [0.1, np.nan, np.nan, 2.0])
    np.testing.assert_array_equal(read.chatter_frequency, [810.5, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(read.lobe, [3.0, np.nan, np.nan, 0.0])
    np.testing.assert_array_equal(read.extra["limit_std"], [0.1, np.nan, 1.0, 2.0])


@settings(max_examples=30, deadline=None)
@given(rows=st.lists(st.tuples(st.floats(1e-3, 1e6), st.floats(0, 1e3), st.floats(0, 1e5), st.integers(0, 99)), min_size=1, max_size=8))
def test_lobes_read_back_exactly(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("lobes") / "LOBES.csv"
    columns = list(np.array(rows, dtype=float).T)
    write_lobes_csv(path, *columns)
    for found, expected in zip(read_lobes_csv(path)[:4], columns, strict=True):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0.0], [1.0], [1.0], [1.0]), "spindle_speed_rpm: found 0.0, allowed is a number above 0"),
        (([np.nan], [1.0], [1.0], [1.0]), "column spindle_speed_rpm: found nan"),
        (([1.0], [-1.0], [1.0], [1.0]), "limit_depth_mm: found -1.0"),
        (([1.0], [1.0], [1.0], [1.5]), "lobe: found 1.5, allowed is whole numbers"),
        (([1.0], [1.0], [1.0, 2.0], [1.0]), "1-D arrays of one length"),
    ],
)
def test_lobes_that_are_not_written(tmp_path, arguments, words):
    with pytest.raises(InputError, match=words):
        write_lobes_csv(tmp_path / "L.csv", *arguments)
    assert list(tmp_path.iterdir()) == []


HEADER = "spindle_speed_rpm,limit_depth_mm,chatter_frequency_hz,lobe\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER + "0,1,2,3\n", "line 2: column spindle_speed_rpm: found 0"),
        (HEADER + ",1,2,3\n", "line 2: column spindle_speed_rpm: found nan"),
        (HEADER + "1,,2,\n", "line 2: column chatter_frequency_hz: found 2"),
        (HEADER + "1,-1,2,3\n", "line 2: column limit_depth_mm: found -1"),
        (HEADER + "1,inf,2,3\n", "line 2: column limit_depth_mm: found inf"),
        (HEADER + "1,1,2,0.5\n", "line 2: column lobe: found 0.5"),
        ("spindle_speed_rpm,limit\n1,2\n", "column limit_depth_mm: found only"),
    ],
)
def test_lobes_that_are_not_read(tmp_path, text, words):
    path = tmp_path / "L.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_lobes_csv(path)
