"""Universal files: written, read back, read by others, and refused with their line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.uff import ACCELERATION, EXCITATION_FORCE, FRF, UffAxis, UffFunction, read_uff, write_uff
from tests.fixtures.paths import SHARED

EVEN = np.arange(100.0, 140.0, 0.78125)
UNEVEN = np.geomspace(10.0, 5000.0, 37)


def function(x=EVEN, kind=FRF, seed=1, **more):
    rng = np.random.default_rng(seed)
    values = (rng.standard_normal(x.size) + 1j * rng.standard_normal(x.size)) * 10.0 ** rng.uniform(-9, 2, x.size)
    axes = {"ordinate": UffAxis(ACCELERATION, "m/s^2"), "denominator": UffAxis(EXCITATION_FORCE, "N")}
    return UffFunction(kind, x, values, (3, -1), (4, 2), **{**axes, **more})


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("x", [EVEN, UNEVEN], ids=["even", "uneven"])
def test_what_is_written_reads_back(tmp_path, x, binary):
    path = tmp_path / "F.uff"
    first, second = function(x, title="tip X / tip X"), UffFunction(1, x, np.sin(x))
    write_uff(path, [first, second], binary)
    a, b = read_uff(path)
    for found, given_ in ((a, first), (b, second)):
        np.testing.assert_allclose(found.abscissa, given_.abscissa, rtol=5.1e-6 if x is UNEVEN and not binary else 1e-12)
        np.testing.assert_allclose(found.values, given_.values, rtol=0.0 if binary else 1e-11)
        assert np.iscomplexobj(found.values) == np.iscomplexobj(given_.values)
    assert (a.kind, a.response, a.reference, a.title) == (FRF, (3, -1), (4, 2), "tip X / tip X")
    assert (a.ordinate, a.denominator) == (UffAxis(ACCELERATION, "m/s^2"), UffAxis(EXCITATION_FORCE, "N"))
    assert a.factors == (1.0, 1.0)
    assert (b.kind, b.title, b.ordinate) == (1, "", UffAxis())


@settings(max_examples=30, deadline=None)
@given(st.lists(st.complex_numbers(max_magnitude=1e50, allow_nan=False), min_size=1, max_size=9), st.booleans())
def test_any_numbers_come_back(tmp_path_factory, numbers, binary):
    path = tmp_path_factory.mktemp("uff") / "F.uff"
    values = np.array(numbers)
    write_uff(path, [UffFunction(FRF, np.arange(1.0, values.size + 1.0), values)], binary)
    read = read_uff(path)[0].values
    np.testing.assert_allclose(read.real, values.real, rtol=1e-12, atol=1e-99)
    np.testing.assert_allclose(read.imag, values.imag, rtol=1e-12, atol=1e-99)


@pytest.mark.parametrize("x", [EVEN, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("binary", [False, True])
def test_another_package_opens_what_is_written(tmp_path, x, binary):
    pyuff = pytest.importorskip("pyuff", reason="pyuff is not installed")
    path = tmp_path / "F.uff"
    given_ = function(x)
    write_uff(path, [given_], binary)
    read = next(s for s in pyuff.UFF(str(path)).read_sets() if s["type"] == 58)
    np.testing.assert_allclose(read["x"], given_.abscissa, rtol=5.1e-6)
    np.testing.assert_allclose(read["data"], given_.values, rtol=1e-11)
    assert (read["func_type"], read["rsp_node"], read["rsp_dir"], read["ref_node"], read["ref_dir"]) == (4, 3, -1, 4, 2)
    assert (read["ordinate_spec_data_type"], read["orddenom_spec_data_type"]) == (ACCELERATION, EXCITATION_FORCE)
    assert read["ordinate_axis_units_lab"].strip() == "m/s^2"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("even", [0, 1])
def test_what_another_package_writes_is_read(tmp_path, even, binary):
    pyuff = pytest.importorskip("pyuff", reason="pyuff is not installed")
    path = tmp_path / "F.uff"
    x = EVEN if even else UNEVEN
    given_ = function(x)
    one = {
        "type": 58, "func_type": 4, "rsp_node": 3, "rsp_dir": -1, "ref_node": 4, "ref_dir": 2, "data": given_.values, "x": x,
        "abscissa_spacing": even, "binary": binary, "id1": "test", "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13,
    }  # fmt: skip
    for _ in range(2):
        pyuff.UFF(str(path)).write_sets([dict(one)], "add")
    sets = read_uff(path)
    assert len(sets) == 2
    for found in sets:
        np.testing.assert_allclose(found.abscissa, x, rtol=5.1e-6)
        np.testing.assert_allclose(found.values, given_.values, rtol=1e-11)
        assert (found.kind, found.response, found.reference) == (4, (3, -1), (4, 2))


@pytest.mark.parametrize("name", ["sample_58b_binary.uff", "psd_58.uff", "time_history.uff"])
def test_files_that_others_measured(name):
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"{name} is not beside the project")
    pyuff = pytest.importorskip("pyuff", reason="pyuff is not installed")
    sets = pyuff.UFF(str(path)).read_sets()
    sets = [sets] if isinstance(sets, dict) else sets
    found = read_uff(path)
    assert len(found) == len(sets)
    for own, other in zip(found, sets, strict=True):
        assert own.kind == other["func_type"]
        np.testing.assert_allclose(own.abscissa, other["x"][: own.abscissa.size])
        np.testing.assert_allclose(own.values, other["data"][: own.values.size])
    # none of them is an FRF, and the label says what is on the axis
    assert {f.abscissa_axis.unit.lower() for f in found} <= {"hz", "s"}


def text_of(tmp_path, binary=False):
    path = tmp_path / "F.uff"
    write_uff(path, [function()], binary)
    return path, path.read_bytes()


def lines_from(raw, number, new):
    lines = raw.split(b"\n")
    lines[number - 1] = new
    return b"\n".join(lines)


def test_neighbours_without_a_blank_and_fortran_exponents(tmp_path):
    path, raw = text_of(tmp_path)
    before = read_uff(path)[0].values
    squeezed = raw.replace(b" -", b"-").replace(b"\n-1\n", b"\n    -1\n").replace(b"   -1\n", b"    -1\n").replace(b"E-0", b"D-0")
    # what stands in the header keeps its columns
    head = b"\n".join(raw.split(b"\n")[:20])
    path.write_bytes(head + b"\n" + b"\n".join(squeezed.split(b"\n")[20:]))
    np.testing.assert_array_equal(read_uff(path)[0].values, before)
    path.write_bytes(raw.replace(b"\n", b"\r\n"))
    np.testing.assert_array_equal(read_uff(path)[0].values, before)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda raw: raw[: len(raw) // 2], "allowed is -1 at the end of the dataset"),
        (lambda raw: raw.replace(b"    -1\n    58\n", b"    -1\n    15\n"), "found no dataset 58"),
        (lambda raw: lines_from(raw, 22, b"1.0 zwei 3.0"), "F.uff line 22: data: found 1.0 zwei 3.0, allowed is numbers"),
        (lambda raw: lines_from(raw, 22, b"1.0 2.0"), "numbers, allowed is 104 for 52 points"),
        (lambda raw: lines_from(raw, 15, b"         9        52         1"), "line 15: ordinate data type: found 9"),
        (lambda raw: lines_from(raw, 15, b"         6        5x         1"), "line 15: points: found 5x"),
        (lambda raw: lines_from(raw, 15, b"         6         0         1"), "line 15: number of points: found 0"),
        (lambda raw: raw.replace(b"    -1", b"      ", 1), "line 2: universal file: found 164, allowed is -1"),
        (lambda raw: b"nonsense\n" + raw, "line 1: universal file: found nonsense"),
        (lambda raw: b"    -1\n    58\nx\n    -1\n", "line 4: dataset 58: found its end"),
        (lambda raw: b"    -1\n", "the end of the file"),
        (lambda raw: lines_from(raw, 4, b" two words"), "dataset 164: found no factors"),
    ],
)
def test_a_damaged_file_is_one_sentence(tmp_path, damage, words):
    path, raw = text_of(tmp_path)
    path.write_bytes(damage(raw))
    with pytest.raises(InputError) as caught:
        read_uff(path)
    assert words in str(caught.value)
    assert "F.uff" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda raw: raw[:-60], "points of 16 bytes, then -1"),
        (lambda raw: raw.replace(b"58b     1     2", b"58b     3     2"), "byte order 3"),
        (lambda raw: raw.replace(b"58b     1     2", b"58b     1     3"), "format 3"),
        (lambda raw: raw.replace(b"58b     1     2          11", b"58b     1     2          12"), "12 lines of text"),
    ],
)
def test_a_damaged_binary_file_is_one_sentence(tmp_path, damage, words):
    path, raw = text_of(tmp_path, binary=True)
    path.write_bytes(damage(raw))
    with pytest.raises(InputError, match=words):
        read_uff(path)


def test_big_endian_single_precision_with_a_short_abscissa(tmp_path):
    path, raw = text_of(tmp_path, binary=True)
    head = raw[: raw.index(b"    58b")].decode()
    text = raw[raw.index(b"    58b") :].split(b"\n", 12)[:12]
    text[0] = text[0].replace(b"58b     1", b"58b     2")
    table = np.zeros(5, dtype=[("x", ">f4"), ("re", ">f8"), ("im", ">f8")])
    table["x"], table["re"], table["im"] = np.arange(5.0) * 0.5, np.arange(5.0), -np.arange(5.0) / 3.0
    text[7] = f"{6:10d}{5:10d}{0:10d}{0.0:13.5E}{0.0:13.5E}{0.0:13.5E}".encode()
    path.write_bytes(head.encode() + b"\n".join(text) + b"\n" + table.tobytes() + b"\n    -1\n")
    found = read_uff(path)[0]
    np.testing.assert_array_equal(found.abscissa, np.arange(5.0) * 0.5)
    np.testing.assert_array_equal(found.values, np.arange(5.0) - 1j * np.arange(5.0) / 3.0)


def test_units_of_a_file_are_kept(tmp_path):
    path, raw = text_of(tmp_path)
    millimetres = raw.replace(f"{1.0:25.17E}{1.0:25.17E}".encode(), f"{1000.0:25.17E}{1.0:25.17E}".encode().replace(b"E", b"D"), 1)
    path.write_bytes(millimetres)
    assert read_uff(path)[0].factors == (1000.0, 1.0)
