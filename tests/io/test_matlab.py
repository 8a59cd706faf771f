"""MATLAB recordings, version 5 and 7.3: rates, shapes, classes, and files that lie."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from rcsa_ident.errors import InputError
from rcsa_ident.io.recordings import read_recording
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.fixtures.hostile_matlab import HOSTILE, matrix
from tests.fixtures.recording_formats import mat73

X = Sensor("x", Quantity.TRIGGER)
Y = Sensor("y", Quantity.TRIGGER)
VALUES = np.array([1.5, -2.0, 3.0, 4.0])


def save(path: Path, newer: bool, **variables: object) -> None:
    """As MATLAB saves them: -v7 or -v7.3."""
    if not newer:
        scipy.io.savemat(path, variables, do_compression=True)
        return
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            array = np.asarray(value)
            if array.dtype.kind == "U":
                file[name] = np.array([[ord(c)] for c in str(value)], dtype=np.uint16)
                file[name].attrs["MATLAB_class"] = np.bytes_("char")
            else:
                file[name] = np.atleast_2d(array).T
    with path.open("rb+") as raw:
        raw.write(b"MATLAB 7.3")


both = pytest.mark.parametrize("newer", [False, True], ids=["5", "7.3"])


@both
@pytest.mark.parametrize("kind", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
@pytest.mark.parametrize("column", [False, True])
def test_all_classes_and_both_directions(tmp_path, newer, kind, column):
    values = np.array([1, 2, 100, 3]).astype(kind)
    save(tmp_path / "cut.mat", newer, x=values[:, None] if column else values[None, :], Fs=25600)
    found = read_recording(tmp_path / "cut.mat", (X,))
    assert found.rate == 25600.0
    np.testing.assert_array_equal(found.samples[:, 0], [1, 2, 100, 3])


@both
def test_where_the_rate_comes_from(tmp_path, newer):
    path = tmp_path / "cut.mat"
    save(path, newer, x=VALUES)
    assert read_recording(path, (X,), 1000.0).rate == 1000.0
    save(path, newer, x=VALUES, sampling_rate_hz=51200.0)
    assert read_recording(path, (X,), 1000.0).rate == 51200.0
    save(path, newer, x=VALUES, time=np.array([0.0, 1.0, 3.0, 4.0]) / 200.0, Fs=50.0)
    found = read_recording(path, (X,), 1000.0)
    assert found.rate == 200.0
    np.testing.assert_array_equal(found.samples[:, 0], [1.5, -2.0, np.nan, 3.0, 4.0])


BROKEN = [
    ({"x": VALUES}, "sampling_rate_hz: found nothing, allowed is a vector 'time' [s], a number"),
    ({"x": VALUES, "Fs": -1.0}, "variable Fs: found -1.0"),
    ({"x": VALUES, "Fs": float("nan")}, "variable Fs: found nan"),
    ({"x": VALUES, "Fs": [1.0, 2.0]}, "variable Fs: found 2 numbers"),
    ({"x": VALUES, "Fs": 1.0, "fs": 2.0}, "different rates (Fs, fs)"),
    ({"x": VALUES, "time": [0.0, 1.0]}, "different lengths (time: 2, x: 4)"),
    ({"x": VALUES, "time": [0.0, 1.0, 1.0, 2.0]}, "time(3): found 1 after 1"),
    ({"x": VALUES, "time": [0.0, float("inf"), 1.0, 2.0]}, "time(2): found inf"),
    ({"x": VALUES, "y": VALUES[:2], "Fs": 1.0}, "different lengths (x: 4, y: 2)"),
    ({"x": np.ones((3, 3)), "Fs": 1.0}, "channel x: found shape (3, 3), allowed is a vector"),
    ({"x": VALUES * 1j, "Fs": 1.0}, "channel x: found values of"),
    ({"x": "text", "Fs": 1.0}, "channel x: found values of class char"),
    ({"z": VALUES, "Fs": 1.0}, "channel x: found no such channel"),
]


@both
@pytest.mark.parametrize(("variables", "words"), BROKEN)
def test_what_is_no_recording_is_one_sentence(tmp_path, newer, variables, words):
    path = tmp_path / "cut.mat"
    save(path, newer, **variables)
    with pytest.raises(InputError) as caught:
        read_recording(path, (X, Y) if "y" in variables else (X,))
    assert words in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    "value", [{"a": 1.0}, np.array([[1.0, "a"]], dtype=object), scipy.sparse.eye_array(3)], ids=["struct", "cell", "sparse"]
)
def test_other_classes_of_version_5(tmp_path, value):
    scipy.io.savemat(tmp_path / "cut.mat", {"x": value, "y": VALUES, "Fs": 1.0})
    with pytest.raises(InputError, match=r"channel x: found values of class (struct|cell|sparse), allowed is real numbers"):
        read_recording(tmp_path / "cut.mat", (X,))
    # beside it a channel is read all the same
    np.testing.assert_array_equal(read_recording(tmp_path / "cut.mat", (Y,)).samples[:, 0], VALUES)


def test_version_4_says_how_to_save(tmp_path):
    scipy.io.savemat(tmp_path / "cut.mat", {"x": VALUES}, format="4")
    with pytest.raises(InputError, match=r"without the header of version 5, allowed is .* \(save with -v7 or -v7\.3\)"):
        read_recording(tmp_path / "cut.mat", (X,), 1.0)


def test_a_truth_and_big_endian(tmp_path):
    scipy.io.savemat(tmp_path / "cut.mat", {"x": np.array([True, False, True])})
    np.testing.assert_array_equal(read_recording(tmp_path / "cut.mat", (X,), 1.0).samples[:, 0], [1.0, 0.0, 1.0])
    element = matrix(b"x", (1, 3), np.array([1.0, 2.0, 3.0], ">f8").tobytes(), order=">")
    (tmp_path / "cut.mat").write_bytes(bytes(124) + struct.pack(">H", 0x0100) + b"MI" + element)
    np.testing.assert_array_equal(read_recording(tmp_path / "cut.mat", (X,), 1.0).samples[:, 0], [1.0, 2.0, 3.0])


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_costs_one_sentence(tmp_path, name):
    make, words = HOSTILE[name]
    raw = make()
    (tmp_path / "cut.mat").write_bytes(raw)
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            read_recording(tmp_path / "cut.mat", (X,), 1.0)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert peak < 5e6 + 3 * len(raw)


def hostile_link(path: Path) -> None:
    with h5py.File(path, "r+") as handle:
        del handle["x"]
        handle["x"] = h5py.ExternalLink("/etc/passwd", "/x")


def hostile_storage(path: Path) -> None:
    path.with_name("raw.bin").write_bytes(bytes(32))
    with h5py.File(path, "r+") as handle:
        del handle["x"]
        handle.create_dataset("x", (1, 4), "f8", external=[(str(path.with_name("raw.bin")), 0, 32)])


def hostile_size(path: Path) -> None:
    with h5py.File(path, "r+") as handle:
        del handle["x"]
        handle.create_dataset("x", (1, 10**12), "f8", chunks=(1, 1024))


def hostile_bomb(path: Path) -> None:
    with h5py.File(path, "r+") as handle:
        del handle["x"]
        handle.create_dataset("x", data=np.zeros((1, 10**6)), chunks=(1, 10**6), compression="gzip", compression_opts=9)


def hostile_hole(path: Path) -> None:
    with h5py.File(path, "r+") as handle:
        del handle["x"]
        handle.create_dataset("x", (1, 2000), "f8", chunks=(1, 1000))[0, :1000] = 1.0


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (hostile_link, "a link to another file"),
        (hostile_storage, "samples in an external file"),
        (hostile_size, "MB of declared samples"),
        (hostile_bomb, "times the file's size"),
        (hostile_hole, "never written"),
    ],
)
def test_version_73_is_guarded_as_hdf5(tmp_path, spoil, words):
    path = tmp_path / "cut.mat"
    mat73(path, 51200.0, {"x": VALUES})
    spoil(path)
    with pytest.raises(InputError) as caught:
        read_recording(path, (X,))
    assert words in str(caught.value)
