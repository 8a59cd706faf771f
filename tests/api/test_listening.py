"""What one recording says, and hits of a hammer, over REST: the same nouns as the commands', and nothing stays."""

from __future__ import annotations

import io
import json
import struct

import h5py
import numpy as np
import pytest
from fastapi.testclient import TestClient
from scipy.io import wavfile
from typer.testing import CliRunner

from api.main import create_app
from api.problems import MEDIA_TYPE
from api.reading.reader import Limits, Reader
from api.settings import Settings
from rcsa_ident.cli import app
from rcsa_ident.io.curves.frf_files import read_frfs
from tests.api.in_process import Here, embedded, refused, service
from tests.signals.test_tap import RATE, hits, receptance

WAV = {"Content-Type": "audio/wav"}
CHATTER = 1234.5


def samples(seconds: float = 3.0, chatter: float = 0.4, rate: float = 22050.0) -> np.ndarray:
    """A cut of four teeth at 6000 rev/min that chatters."""
    time, rng = np.arange(int(seconds * rate)) / rate, np.random.default_rng(1)
    signal = sum(a * np.cos(2.0 * np.pi * 100.0 * m * time) for m, a in {1: 0.06, 4: 0.15, 8: 0.1}.items())
    return signal + chatter * np.cos(2.0 * np.pi * CHATTER * time) + 0.01 * rng.standard_normal(time.size)


def wav(signal: np.ndarray | None = None, rate: int = 22050) -> bytes:
    file = io.BytesIO()
    wavfile.write(file, rate, (samples() if signal is None else signal).astype(np.float32))
    return file.getvalue()


def text_of_hits(count: int = 2, seed: int = 1) -> bytes:
    force, response = hits(count=count, noise=0.01, seed=seed)
    file = io.BytesIO()
    np.savetxt(file, np.stack([np.arange(force.size) / RATE, force, response], axis=1), header="time (s),hammer (N),tip (m/s^2)",
               delimiter=",", comments="", fmt="%.9e")  # fmt: skip
    return file.getvalue()


@pytest.fixture
def sound(tmp_path):
    path = tmp_path / "cut.wav"
    path.write_bytes(wav())
    return path


def files_in(folder):
    return [path for path in (folder / "files").rglob("*") if path.is_file()]


def test_the_same_nouns_as_the_command(client, sound, tmp_path):
    found = client.listen(sound, teeth=4, speed_rpm=6000)
    command = CliRunner().invoke(app, ["listen", str(sound), "--teeth", "4", "--speed-rpm", "6000", "--json"])
    said = json.loads(command.stdout) | {"recording": "cut.wav"}
    assert json.loads(found.model_dump_json(exclude={"curves"})) == said
    assert (found.verdict, found.curves) == ("chatter", None)
    assert found.chatter_frequencies_hz[0] == pytest.approx(CHATTER, abs=0.5)
    assert files_in(tmp_path) == []


def test_as_a_form_and_as_a_body(http, client, sound):
    query = {"teeth": 4, "speed_rpm": 6000}
    as_form = http.post("/v1/listen", params=query, files={"recording": ("cut.wav", sound.read_bytes())})
    as_body = http.post("/v1/listen", params=query, content=sound.read_bytes(), headers=WAV)
    assert as_form.status_code == as_body.status_code == 200
    assert as_form.json() == as_body.json() | {"recording": "cut.wav"} == json.loads(client.listen(sound, **query).model_dump_json())


@pytest.mark.slow
def test_curves_are_small_and_show_what_is_said(http):
    """Also of a minute at the rate of a phone."""
    raw = wav(samples(60.0, rate=48000.0), 48000)
    answer = http.post("/v1/listen", params={"teeth": 4, "speed_rpm": 6000, "curves": True}, content=raw, headers=WAV)
    assert len(answer.content) < 400_000
    curves = answer.json()["curves"]
    amplitude = np.array(curves["spectrum"]["amplitude"])
    assert curves["spectrum"]["frequency_hz"][int(amplitude.argmax())] == pytest.approx(CHATTER, abs=1.0)
    assert amplitude.max() == pytest.approx(0.4, rel=0.2)
    level = np.array(curves["spectrogram"]["level_db"])
    assert (level.max(), level.shape[0] <= 140, level.shape[1] <= 200) == (0, True, True)
    assert (level.mean(axis=1).argmax() + 0.5) * curves["spectrogram"]["row_hz"] == pytest.approx(CHATTER, abs=60.0)
    signal = curves["signal"]
    assert len(signal["low"]) == len(signal["high"]) <= 800
    assert len(signal["low"]) * signal["step_s"] == pytest.approx(60.0, rel=0.01)


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ({"teeth": 0}, "teeth"),
        ({"teeth": 101}, "teeth"),
        ({"teeth": "four"}, "teeth"),
        ({"speed_rpm": -1}, "speed_rpm"),
        ({"speed_rpm": "inf"}, "speed_rpm"),
        ({"speeds_from": 3000}, "speeds_to"),
        ({"speeds_from": 9000, "speeds_to": 3000}, "speeds"),
        ({"quantity": "loudness"}, "quantity"),
        ({"channel": "ch9"}, "channel ch9"),
        ({"name": "cut.exe"}, "name"),
        ({"name": "../../etc/passwd"}, "name"),
    ],
)
def test_what_is_wrong_is_named(http, tmp_path, query, field):
    answer = http.post("/v1/listen", params=query, content=wav(samples(0.5)), headers=WAV)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == MEDIA_TYPE
    assert answer.json()["errors"][0]["field"].startswith(field)
    assert files_in(tmp_path) == []


def header(rate: int = 22050, data: int = 0, channels: int = 1, bits: int = 32, kind: int = 3) -> bytes:
    """Of a WAV file that promises so many bytes."""
    width = channels * bits // 8
    format_ = struct.pack("<HHIIHH", kind, channels & 0xFFFF, rate, rate * width & 0xFFFFFFFF, width & 0xFFFF, bits)
    return b"RIFF" + struct.pack("<I", 0xFFFFFFFF) + b"WAVEfmt " + struct.pack("<I", 16) + format_ + b"data" + struct.pack("<I", data)


def recorder(outside: bool = False) -> bytes:
    """Two channels of a recorder that tells their unit; or a channel that stands in another file."""
    file = io.BytesIO()
    with h5py.File(file, "w") as made:
        made.attrs["sampling_rate_hz"] = 22050.0
        for name in ("x", "y"):
            made.create_dataset(name, data=samples().astype(np.float32)).attrs["unit"] = "m/s^2"
        if outside:
            made["z"] = h5py.ExternalLink("/etc/passwd", "x")
    return file.getvalue()


def test_a_recorders_file_tells_itself(http):
    answer = http.post("/v1/listen", params={"name": "cut.h5"}, content=recorder(), headers={"Content-Type": "application/octet-stream"})
    assert answer.status_code == 200
    said = answer.json()
    assert (said["quantity"], said["channels"], said["verdict"]) == ("acceleration", ["x", "y"], "chatter")


HOSTILE = {
    "nothing": (b"", ".wav"),
    "no samples": (header(), ".wav"),
    "four gigabytes promised": (header(data=0xFFFFFFF0) + bytes(4000), ".wav"),
    "thousands of channels": (header(channels=65535, data=0xFFFFFFF0) + bytes(4000), ".wav"),
    "no rate": (header(rate=0, data=4000) + bytes(4000), ".wav"),
    "silence": (wav(np.zeros(22050)), ".wav"),
    "one sample": (wav(np.ones(1)), ".wav"),
    "not a number": (wav(np.full(22050, np.nan)), ".wav"),
    "infinite": (wav(np.full(22050, np.inf)), ".wav"),
    "no sound": (b"\x00\xff" * 5000, ".flac"),
    "text that is none": (b"time (s),a (m/s^2)\n" + b"x,y\n" * 1000, ".csv"),
    "a sound as text": (wav(), ".csv"),
    "a sound as HDF5": (wav(), ".h5"),
    "HDF5 that is cut off": (recorder()[:-5000], ".h5"),
    "HDF5 whose links lead out": (recorder(outside=True), ".h5"),
}


@pytest.fixture(scope="module")
def in_earnest(tmp_path_factory):
    """A service whose reader is the cut-off process, with little memory."""
    folder = tmp_path_factory.mktemp("hearing")
    reader = Reader(Limits(memory=512, seconds=20.0, wall_seconds=60.0, calls=1000), 5)
    with TestClient(create_app(Settings(data=folder), embedded(folder), Here(), reader), base_url="http://localhost") as http:
        yield http, folder


@pytest.mark.slow
def test_hostile_recordings_are_refused_and_leave_nothing(in_earnest):
    http, folder = in_earnest
    for path in ("listen", "tap"):
        for words, (raw, suffix) in HOSTILE.items():
            headers = {"Content-Type": "application/octet-stream"}
            answer = http.post(f"/v1/{path}", params={"name": f"x{suffix}"}, content=raw, headers=headers)
            assert answer.status_code == 422, (path, words, answer.text[:300])
            assert answer.headers["content-type"] == MEDIA_TYPE
            assert str(folder) not in answer.text
            assert files_in(folder) == [], words
    answer = http.post("/v1/listen", params={"teeth": 4, "speed_rpm": 6000, "curves": True}, content=wav(), headers=WAV)
    assert answer.json()["verdict"] == "chatter"
    hit = http.post("/v1/tap", params={"name": "h.csv"}, content=text_of_hits(), headers={"Content-Type": "text/csv", "Accept": "text/csv"})
    assert hit.text.startswith("frequency_hz,X_re,X_im")
    assert files_in(folder) == []


@pytest.mark.slow
def test_an_upload_without_an_end(store, tmp_path):
    with service(store, tmp_path, max_upload_bytes=100_000) as http:
        part = b'--b\r\nContent-Disposition: form-data; name="recording"; filename="x.wav"\r\n\r\n'
        for headers, begin in ((WAV, b""), ({"Content-Type": "multipart/form-data; boundary=b"}, part)):
            answer = http.post("/v1/listen", content=iter([begin, *[bytes(10_000)] * 100]), headers=headers)
            assert answer.status_code == 413
    assert files_in(tmp_path) == []


def test_another_type_and_a_wrong_form(http):
    assert http.post("/v1/listen", json={"teeth": 4}).status_code == 415
    assert http.post("/v1/listen", content=b"x", headers={"Content-Type": "image/png"}).status_code == 415
    two = [("recording", ("a.wav", wav(samples(0.5)))), ("recording", ("b.wav", wav(samples(0.5))))]
    for files in (two, {"cut": ("a.wav", b"x")}, {"recording": ("a.exe", b"x")}):
        assert http.post("/v1/listen", files=files).status_code == 422
    assert http.post("/v1/tap", files=[("hits", ("a.csv", b"x"))] * 51).status_code == 422


def test_keys_and_groups(guarded_http):
    http, keys = guarded_http
    body = {"content": wav(), "headers": WAV}
    assert http.post("/v1/listen", **body).status_code == 401
    assert http.post("/v1/listen", content=wav(), headers=WAV | {"X-API-Key": keys["read"]}).status_code == 403
    assert http.post("/v1/listen", content=wav(), headers=WAV | {"X-API-Key": keys["run"]}).status_code == 200


def test_too_many_at_once(store, tmp_path):
    with service(store, tmp_path, uploads=1) as http:
        places = http.app.state.components.uploads.places
        assert places.take("local")
        answer = http.post("/v1/listen", content=wav(), headers=WAV)
        places.give("local")
        assert (answer.status_code, "Retry-After" in answer.headers) == (503, True)
        assert http.post("/v1/listen", content=wav(), headers=WAV).status_code == 200


@pytest.mark.slow
def test_hits_to_a_receptance(client, tmp_path):
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    first.write_bytes(text_of_hits())
    second.write_bytes(text_of_hits(1, seed=3))
    found = client.tap(first, second, axis="Y")
    assert (found.used, [hit.recording for hit in found.hits]) == (3, ["first.csv", "first.csv", "second.csv"])
    frequency = np.array(found.frequency_hz)
    inside = (frequency > 300.0) & (frequency < 3000.0)
    measured = np.array(found.axes["Y"].re) + 1j * np.array(found.axes["Y"].im)
    true = receptance(2.0 * np.pi * frequency)
    assert np.linalg.norm((measured - true)[inside]) < 0.03 * np.linalg.norm(true[inside])
    assert np.array(found.coherence)[inside].mean() > 0.9
    assert len(found.frequency_hz) <= 1600
    for name, text in (("tip.csv", client.tap_file(first, second)), ("tip.uff", client.tap_file(first, second, uff=True))):
        (tmp_path / name).write_text(text, encoding="utf-8")
        (test,) = read_frfs(tmp_path / name)
        # every line, not those of the picture alone
        assert test.frequency.size >= frequency.size
    assert files_in(tmp_path) == []


def test_hits_that_are_left_out_and_channels_that_are_not_there(client, tmp_path):
    force, response = hits(count=3)
    force[int(0.53 * RATE)] = 140.0
    table = np.stack([np.arange(force.size) / RATE, force, response], axis=1)
    np.savetxt(tmp_path / "h.csv", table, header="time (s),hammer (N),tip (m/s^2)", delimiter=",", comments="", fmt="%.9e")
    found = client.tap(tmp_path / "h.csv")
    assert [bool(hit.left_out) for hit in found.hits] == [False, True, False]
    assert "double hit" in found.hits[1].left_out
    problem = refused(422, client.tap, tmp_path / "h.csv", force="nobody")
    assert problem.errors[0].field == "force"


def test_the_options_of_the_command_are_described(http):
    """Every option of the command is one of the query."""
    described = http.get("/openapi.json").json()["paths"]["/v1/listen"]["post"]
    names = {parameter["name"] for parameter in described["parameters"]}
    assert {"channel", "quantity", "teeth", "speed_rpm", "speeds_from", "speeds_to", "rate_hz", "sensitivity"} <= names
    assert set(described["requestBody"]["content"]) >= {"audio/wav", "multipart/form-data", "application/octet-stream"}
