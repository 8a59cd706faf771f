"""MATLAB recordings, version 5 and 7.3: rates, shapes, classes, and files that lie."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.fixtures.hostile_matlab import HOSTILE, matrix, padded
from tests.fixtures.hostile_matlab import file as file_of
from tests.fixtures.paths import SHARED
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


TOLD = {
    "t": {"t": np.arange(4.0) / 25_600.0},
    "time in milliseconds": {"time_ms": 1e3 * np.arange(4.0) / 25_600.0},
    "dt": {"dt": 1.0 / 25_600.0},
    "an interval": {"SampleInterval": 1.0 / 25_600.0},
    "SampleRate": {"SampleRate": 25_600.0},
    "two that agree": {"sample_rate": 25_600.0, "Ts": 1.0 / 25_600.0},
    "no time, since it falls": {"t": np.array([3.0, 2.0, 1.0, 0.0]), "Fs": 25_600.0},
    "no rate, since it is a text": {"SampleRate": "high", "Fs": 25_600.0},
    "no interval, since it has many": {"dt": np.full(4, 0.1), "Fs": 25_600.0},
}


@both
@pytest.mark.parametrize("name", TOLD)
def test_names_that_programs_give_times_and_rates(tmp_path, newer, name):
    path = tmp_path / "cut.mat"
    save(path, newer, x=VALUES, **TOLD[name])
    found = read_recording(path, (X,), 51_200.0)
    assert found.rate == pytest.approx(25_600.0, rel=1e-12)
    np.testing.assert_array_equal(found.samples[:, 0], VALUES)
    assert [each.name for each in open_recording(path).channels] == ["x"]


@both
def test_a_rate_and_an_interval_that_disagree_are_refused(tmp_path, newer):
    save(tmp_path / "cut.mat", newer, x=VALUES, Fs=1000.0, dt=0.002)
    with pytest.raises(InputError, match="different rates"):
        read_recording(tmp_path / "cut.mat", (X,))


def save_nested(path: Path, newer: bool, **variables: object) -> None:
    """Structs as dictionaries, in 7.3 as groups."""
    if not newer:
        scipy.io.savemat(path, variables, do_compression=True)
        return

    def fill(group: h5py.Group, members: dict[str, object]) -> None:
        for name, value in members.items():
            if isinstance(value, dict):
                fill(group.create_group(name), value)
            else:
                group[name] = np.atleast_2d(np.asarray(value)).T

    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file, variables)
    with path.open("rb+") as raw:
        raw.write(b"MATLAB 7.3")


def signals(path: Path, *names: str, rate: float | None = None, time: str | None = None) -> tuple[float, list[list[float]]]:
    found = read_recording(path, tuple(Sensor(name, Quantity.TRIGGER) for name in names), rate, time=time)
    return found.rate, found.samples.T.tolist()


STEPS = np.arange(5.0)
TABLE = np.arange(10.0).reshape(2, 5)


@both
def test_rows_of_matrices_and_fields_of_structs(tmp_path, newer):
    path = tmp_path / "cut.mat"
    rig = {"time": STEPS / 100.0, "q": TABLE, "deep": {"x": STEPS + 7.0}}
    save_nested(path, newer, rig=rig, q=TABLE.T, Fs=20.0)
    assert signals(path, "rig.q(2)", "rig.q(1)") == (100.0, [TABLE[1].tolist(), TABLE[0].tolist()])
    assert signals(path, "q(2)") == (20.0, [TABLE[1].tolist()])
    # a struct without times of its own belongs to those around it
    assert signals(path, "rig.deep.x") == (100.0, [(STEPS + 7.0).tolist()])


@both
def test_cells_and_arrays_of_structs(tmp_path, newer):
    path = tmp_path / "cut.mat"
    if newer:
        save_nested(path, True, c=STEPS, Fs=20.0)
        with pytest.raises(InputError, match=r"channel c\{2\}: found no such channel"):
            signals(path, "c{2}")
        return
    many = np.array([(STEPS,), (STEPS + 1.0,)], dtype=[("x", object)])
    scipy.io.savemat(path, {"c": np.array([STEPS, "text", STEPS + 2.0], dtype=object), "s": many, "Fs": 20.0}, do_compression=True)
    assert signals(path, "c{3}", "s(2).x") == (20.0, [(STEPS + 2.0).tolist(), (STEPS + 1.0).tolist()])
    with pytest.raises(InputError, match=r"channel c\{2\}: found values of class char"):
        signals(path, "c{2}")


GRIDS = {"time_cont": STEPS / 100.0, "time_disc": STEPS + 1.0, "x": STEPS, "odd": np.ones((5, 5)), "cube": np.ones((2, 3, 5))}


@both
@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["rig.x"], "several vectors of times: rig.time_cont, rig.time_disc, allowed is one that tells the campaign's sampling_rate_hz"),
        (["rig.odd(1)"], "rig.odd of shape (5, 5), allowed is a matrix whose longer side is time"),
        (["rig.q(3)"], "number 3, allowed is rig.q(1) to rig.q(2)"),
        (["rig.q"], "shape (2, 5), allowed is a vector with at least one sample, or one of its signals: rig.q(1) to rig.q(2)"),
        (["rig.y"], "no such channel"),
        (["rig.x", "slow.x"], "several times or rates (rig.x: rig.time_cont, slow.x: slow.time)"),
    ],
)
def test_what_is_not_clear_is_refused_with_the_choice(tmp_path, newer, names, words):
    path = tmp_path / "cut.mat"
    save_nested(path, newer, rig={k: v for k, v in {**GRIDS, "q": TABLE}.items() if k != "cube"}, slow={"time": STEPS, "x": STEPS})
    with pytest.raises(InputError) as caught:
        signals(path, *names, rate=None if len(names) == 1 else 100.0)
    assert words in str(caught.value)


@both
def test_the_campaigns_rate_or_a_name_chooses_the_times(tmp_path, newer):
    path = tmp_path / "cut.mat"
    save_nested(path, newer, rig={k: v for k, v in GRIDS.items() if k != "cube"})
    assert signals(path, "rig.x", rate=100.0)[0] == 100.0
    assert signals(path, "rig.x", time="rig.time_disc")[0] == 1.0
    with pytest.raises(InputError, match=r"channel rig\.clock: found no such channel"):
        signals(path, "rig.x", time="rig.clock")
    (tmp_path / "cut.csv").write_text("x\n1\n")
    with pytest.raises(InputError, match="time: found t, allowed is nothing"):
        signals(tmp_path / "cut.csv", "x", rate=1.0, time="t")


@pytest.mark.slow
def test_damaged_structs_cost_a_sentence(tmp_path):
    path = tmp_path / "cut.mat"
    scipy.io.savemat(path, {"rig": {**GRIDS, "c": np.array([STEPS, "a"], dtype=object)}, "Fs": 1.0})
    raw, rng, sentences, read = path.read_bytes(), np.random.default_rng(4), [], 0
    for _ in range(2000):
        damaged = bytearray(raw)
        for place in rng.integers(128, len(raw), rng.integers(1, 4)):
            damaged[place] = rng.choice([0, 1, 0x7F, 0xFF, rng.integers(0, 256)])
        path.write_bytes(damaged)
        try:
            read += len(signals(path, "rig.x", "rig.c{1}", rate=100.0)[1]) == 2
        except InputError as error:
            sentences.append(str(error))
    assert read > 0
    assert len(sentences) > 300
    assert not [each for each in sentences if "\n" in each]


def test_a_struct_that_is_a_bomb_is_not_unpacked(tmp_path):
    scipy.io.savemat(tmp_path / "cut.mat", {"x": {"a": np.zeros(5_000_000)}}, do_compression=True)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="bytes declared in a file of"):
            signals(tmp_path / "cut.mat", "x.a", rate=1.0)
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()


def test_structs_in_structs_end(tmp_path):
    deep: object = STEPS
    for _ in range(30):
        deep = {"a": deep}
    scipy.io.savemat(tmp_path / "cut.mat", {"x": deep})
    with pytest.raises(InputError, match="structs in structs without end"):
        signals(tmp_path / "cut.mat", "x.a", rate=1.0)


def test_a_struct_without_fields_has_an_end(tmp_path):
    """It may say to be an array of billions of them (found by the fuzzer: 39 s for 3.3 kB)."""
    path = tmp_path / "cut.mat"
    scipy.io.savemat(path, {"x": {}, "Fs": 1.0})
    raw = path.read_bytes()
    shape, many = struct.pack("<ii", 1, 1), struct.pack("<ii", 2**31 - 1, 2**31 - 1)
    path.write_bytes(raw.replace(shape, many, 1))
    with pytest.raises(InputError, match=r"channel x\.a: found no such channel"):
        signals(path, "x.a", rate=1.0)


def test_the_robot_of_the_shared_files():
    """Motor angles of the KR300: 250 Hz by the times of its struct, an opaque variable beside."""
    path = SHARED / "robot_kr300" / "traj_A.mat"
    if not path.exists():
        pytest.skip("the shared files are not beside this checkout")
    rate, (angle, torque) = signals(path, "rec.act_pos_mot_deg(1)", "rec.act_torque_abs_nm(6)", rate=250.0)
    whole = scipy.io.loadmat(path, variable_names=["rec"], simplify_cells=True)["rec"]
    assert rate == pytest.approx(250.0, rel=1e-6)
    np.testing.assert_array_equal(angle, whole["act_pos_mot_deg"][0])
    np.testing.assert_array_equal(torque, whole["act_torque_abs_nm"][5])
    assert signals(path, "tau_g_all(2)", rate=100.0, time="time_data.time_cont")[0] == pytest.approx(250.0, rel=1e-6)


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


@pytest.mark.parametrize("newer", [False, True])
def test_a_timetable_is_refused_by_what_to_write(tmp_path, newer):
    """As MATLAB lays its objects out: name, system of types and class behind the flags; or an attribute of HDF5."""
    path = tmp_path / "r.mat"
    if newer:
        with h5py.File(path, "w", userblock_size=512) as file:
            file["TT"] = np.zeros((1, 6), np.uint32)
            file["TT"].attrs["MATLAB_class"] = np.bytes_("timetable")
    else:
        texts = b"".join(padded(1, text) for text in (b"TT", b"MCOS", b"timetable"))
        body = padded(6, struct.pack("<II", 17, 0)) + texts
        path.write_bytes(file_of(struct.pack("<II", 14, len(body)) + body))
    for read in (lambda: open_recording(path, (), 1000.0), lambda: signals(path, "TT", rate=1000.0)):
        with pytest.raises(
            InputError, match=r"channel TT: found values of class timetable, .* of a timetable TT write vectors: t = seconds"
        ):
            read()


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


def packed(values: np.ndarray) -> bytes:
    """A file of version 5 with one packed variable, as MATLAB's -v7."""
    from io import BytesIO

    raw = BytesIO()
    scipy.io.savemat(raw, {"x": values, "Fs": 1000.0}, do_compression=True)
    return raw.getvalue()


def test_a_flipped_bit_is_never_read_as_numbers(tmp_path):
    """The checksum of a packed variable is compared: before, 16 of 400 such files were read, with values up to 5e298."""
    rng, path = np.random.default_rng(43), tmp_path / "cut.mat"
    values = np.rint(1e3 * rng.normal(size=2000)) / 1e3
    whole, sensor = packed(values), (Sensor("x", Quantity.TRIGGER),)
    refused = 0
    for place in rng.integers(128, len(whole), 400):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            found = read_recording(path, sensor)
        except InputError:
            refused += 1
        else:  # a bit that fills up a byte, or one of another variable
            assert np.array_equal(found.samples[:, 0], values)
    assert refused > 380


@pytest.mark.parametrize("behind", [b"\0" * 8, b"\1"])
def test_what_stands_behind_a_packed_variable_is_refused(tmp_path, behind):
    whole = packed(np.arange(100.0))
    size = struct.unpack_from("<I", whole, 132)[0]
    place = 136 + size
    longer = whole[:132] + struct.pack("<I", size + len(behind)) + whole[136:place] + behind + whole[place:]
    (tmp_path / "cut.mat").write_bytes(longer)
    with pytest.raises(InputError, match=r"more than the .* bytes that it declares"):
        read_recording(tmp_path / "cut.mat", (Sensor("x", Quantity.TRIGGER),))
