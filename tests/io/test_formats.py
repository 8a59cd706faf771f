"""What every format of recordings has to do: the same samples, the same verdicts, the same kind of refusal."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli import app
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.recordings.readers import READERS, read_recording
from rcsa_ident.signals.recording import Quantity, Sensor
from tests.fixtures.paths import SAMPLES
from tests.fixtures.recording_formats import FORMATS

SENSORS = (
    Sensor("flange_x", Quantity.DISPLACEMENT, Dof.X, 1.0e4),
    Sensor("fixture_y", Quantity.ACCELERATION, Dof.Y, 1.1094e-3),
    Sensor("trigger", Quantity.TRIGGER),
)


def cut(samples: int, seed: int = 3) -> dict[str, np.ndarray]:
    """Harmonics in noise and a trigger, within full scale."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / 51200.0
    tones = sum(np.cos(2.0 * np.pi * 533.3 * k * time + k) / k for k in range(1, 6))
    trigger = (np.mod(time * 133.3, 1.0) < 0.02).astype(float)
    channels = {"flange_x": 0.2 * tones, "fixture_y": 0.05 * tones, "trigger": 0.5 * trigger}
    return {name: (v + rng.normal(0.0, 1e-3, samples)).astype(np.float32) for name, v in channels.items()}


@pytest.fixture(scope="module")
def real_size(tmp_path_factory):
    """Four seconds of three channels at 51.2 kHz, and what HDF5 says of them."""
    path = tmp_path_factory.mktemp("native") / "cut.h5"
    channels = cut(204_800)
    write_hdf5(path, 51200.0, channels)
    return channels, read_recording(path, SENSORS)


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_a_recording_of_real_size_is_that_of_hdf5(tmp_path, real_size, name):
    channels, native = real_size
    suffix, write, relative, absolute = FORMATS[name]
    path = tmp_path / f"cut{suffix}"
    write(path, 51200.0, channels)
    found = read_recording(path, SENSORS)
    assert found.rate == 51200.0
    assert found.samples.shape == (204_800, 3)
    for i, sensor in enumerate(SENSORS):
        unit = 1.0 if sensor.quantity is Quantity.TRIGGER else sensor.sensitivity
        np.testing.assert_allclose(found.samples[:, i], native.samples[:, i], rtol=relative, atol=absolute * 1.0001 / unit)


@pytest.fixture(scope="module")
def few_cuts(tmp_path_factory):
    """Campaign text and the recordings of four cuts of the sample runs."""
    import h5py

    head, *cuts = (SAMPLES / "campaign.toml").read_text(encoding="utf-8").split("[[cuts]]")
    text = head + "".join("[[cuts]]" + one for one in cuts[::20])
    names = re.findall(r'"recordings/([\w-]+)\.h5"', text)
    recordings = {}
    for name in names:
        with h5py.File(SAMPLES / "recordings" / f"{name}.h5") as file:
            recordings[name] = {key: np.asarray(file[key]) for key in file}
    return text, recordings


def verdicts(folder: Path, few_cuts, name: str, full_scale: float = 1.0) -> list[dict]:
    text, recordings = few_cuts
    suffix, write, *_ = FORMATS[name]
    (folder / "recordings").mkdir(parents=True)
    shutil.copytree(SAMPLES / "toolings", folder / "toolings")
    for key, channels in recordings.items():
        write(folder / "recordings" / f"{key}{suffix}", 25600.0, {k: v / full_scale for k, v in channels.items()})
    text = re.sub(r"sensitivity = ([\d.e-]+)", lambda m: f"sensitivity = {float(m[1]) / full_scale!r}", text)
    (folder / "campaign.toml").write_text(text.replace(".h5", suffix).replace("sampling_rate_hz = 25600.0\n", ""), encoding="utf-8")
    ran = CliRunner().invoke(app, ["check", str(folder), "--json", "--processes", "1"])
    assert ran.exit_code == 0, ran.output
    return json.loads(ran.stdout)["recordings"]


@pytest.fixture(scope="module")
def native_verdicts(tmp_path_factory, few_cuts):
    rows = verdicts(tmp_path_factory.mktemp("verdicts") / "hdf5", few_cuts, "hdf5")
    assert len(rows) == 4
    assert all(row["usable"] for row in rows)
    return rows


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FORMATS if name != "hdf5"])
def test_a_verdict_does_not_depend_on_the_format(tmp_path, few_cuts, native_verdicts, name):
    # no scale of its own in WAV: the campaign's sensitivity carries it
    rows = verdicts(tmp_path / "campaign", few_cuts, name, 10.0 if name.startswith("wav") else 1.0)
    # rounding to 16 bits is noise of its own
    close = 0.2 if name == "wav-16" else 2e-3 if name == "wav-24" else 1e-4
    for row, native in zip(rows, native_verdicts, strict=True):
        for key, value in native.items():
            if isinstance(value, float):
                assert row[key] == pytest.approx(value, rel=close, abs=1e-12), key
            elif key in ("id", "usable", "verdict", "reasons", "tooling"):
                assert row[key] == value, key


def written(folder: Path, name: str, samples: int = 300) -> Path:
    suffix, write, *_ = FORMATS[name]
    path = folder / f"cut{suffix}"
    write(path, 51200.0, cut(samples))
    return path


def refusal(path: Path, *sensors: Sensor) -> str:
    """The one sentence that a reader answers with."""
    with pytest.raises(InputError) as caught:
        read_recording(path, sensors or SENSORS)
    text = str(caught.value)
    assert str(path) in text
    assert "\n" not in text
    return text


@pytest.mark.parametrize("name", FORMATS)
def test_a_missing_channel_lists_those_that_are_there(tmp_path, name):
    text = refusal(written(tmp_path, name), Sensor("flange_z", Quantity.TRIGGER))
    assert "channel flange_z: found no such channel" in text
    assert "flange_x" in text


@pytest.mark.parametrize("suffix", READERS)
@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "an empty file"), (b"\x80\x04\x95cos\nsystem\n", "found"), (b"\x1f\x8b\x08" + bytes(40), "found"), (bytes(5000), "found")],
    ids=["empty", "pickle", "gzip", "zeros"],
)
def test_what_is_no_recording_is_refused(tmp_path, suffix, content, words):
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(content)
    assert words in refusal(path)


@pytest.mark.parametrize("suffix", READERS)
def test_a_folder_and_nothing_are_refused(tmp_path, suffix):
    path = tmp_path / f"cut{suffix}"
    assert "no such file" in refusal(path)
    path.mkdir()
    assert "a folder" in refusal(path)


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "csv"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.99])
def test_a_file_that_is_cut_off_is_refused(tmp_path, name, share):
    """A text table may end at any line; all others know where they end."""
    path = written(tmp_path, name, 3000)
    raw = path.read_bytes()
    path.write_bytes(raw[: int(share * len(raw))])
    refusal(path)


@pytest.mark.parametrize("name", [name for name in FORMATS if name not in ("uff", "uff-binary", "wav-16", "wav-24", "csv")])
def test_lost_samples_are_nan(tmp_path, name):
    suffix, write, *_ = FORMATS[name]
    values = np.array([1.0, np.nan, np.inf, -np.inf, 0.25] * 10)
    path = tmp_path / f"cut{suffix}"
    write(path, 100.0, {"flange_x": values})
    assert np.isnan(read_recording(path, SENSORS[:1]).samples[:, 0]).tolist() == [False, True, True, True, False] * 10


def read_or_refused(path: Path) -> None:
    """Any other exception ends the test."""
    sentence = ""
    try:
        assert read_recording(path, SENSORS[:2], 51200.0).samples.shape[1] == 2
    except InputError as error:
        sentence = str(error)
    assert "\n" not in sentence


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_damage_never_raises_anything_else(tmp_path_factory, name, data):
    """Bytes replaced, cut out or put in: the recording is read or refused."""
    folder = tmp_path_factory.mktemp("damage")
    path = written(folder, name, 40)
    raw = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        # headers stand in front, in Parquet behind
        reach = min(len(raw), 700)
        place = data.draw(st.one_of(st.integers(0, reach - 1), st.integers(len(raw) - reach, len(raw) - 1)))
        length = data.draw(st.integers(0, 8))
        raw[place : place + length] = data.draw(st.binary(max_size=8))
    path.write_bytes(bytes(raw))
    read_or_refused(path)


@pytest.mark.parametrize("suffix", READERS)
@settings(max_examples=40, deadline=None)
@given(raw=st.binary(max_size=300))
def test_noise_never_raises_anything_else(tmp_path_factory, suffix, raw):
    path = tmp_path_factory.mktemp("noise") / f"cut{suffix}"
    heads = {".tdms": b"TDSm", ".wav": b"RIFF\0\0\0\0WAVE", ".parquet": b"PAR1", ".uff": b"    -1\n    58\n"}
    mat = bytes(124) + b"\x00\x01IM"
    path.write_bytes({**heads, ".mat": mat}.get(suffix, b"") + raw + (b"PAR1" if suffix == ".parquet" else b""))
    read_or_refused(path)


@pytest.mark.parametrize(("module", "suffix", "extra"), [("nptdms", ".tdms", "tdms"), ("pyarrow", ".parquet", "parquet")])
def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch, module, suffix, extra):
    path = written(tmp_path, extra)
    for name in [name for name in sys.modules if name.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    assert f'pip install "rcsa-ident[{extra}]"' in refusal(path)


def test_no_package_of_an_extra_is_loaded_before_its_format_is_met():
    extras = "('nptdms', 'pyarrow', 'scipy.io', 'soundfile')"
    code = f"import sys, rcsa_ident.io.recordings.readers; print([m for m in {extras} if m in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
