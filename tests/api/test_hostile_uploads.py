"""Uploads that mean no good: each is answered, nothing of them stays, and the next honest one is read."""

from __future__ import annotations

import gzip
import io
import json
import struct
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import soundfile
from fastapi.testclient import TestClient

from api.main import create_app
from api.problems import MEDIA_TYPE
from api.reading.reader import Limits, Reader
from api.settings import Settings
from tests.api.in_process import Here, embedded
from tests.api.recordings import RATE, channels, content, declared
from tests.fixtures import hostile_hdf5, hostile_matlab, hostile_tdms
from tests.fixtures.recording_formats import FORMATS
from tests.fixtures.tool_library import END_MILL, library

BINARY = {"Content-Type": "application/octet-stream"}
NAMES = ["flange_x", "flange_y", "fixture_x", "fixture_y"]
SENSORS = {"x": {"quantity": "displacement", "axis": "X", "sensitivity": 1.0}}


class Campaign:
    """A campaign of one sensor ``x`` and a file of each format, on a service that reads as it does in earnest."""

    def __init__(self, http: TestClient, folder: Path, reader: Reader) -> None:
        self.http, self.folder, self.reader = http, folder, reader
        machine = http.post("/v1/machines", json={"name": "m"}).json()["id"]
        self.paths = {}
        for suffix in (".h5", ".csv", ".tdms", ".uff", ".wav", ".flac", ".mat", ".parquet"):
            for kind, sensors in (("x", SENSORS), ("all", declared()["sensors"])):
                data = declared(suffix=suffix, sensors=sensors)
                id = http.post(f"/v1/machines/{machine}/campaigns", json=data).json()["id"]
                self.paths[kind, suffix] = f"/v1/campaigns/{id}/recordings/c0_cut{suffix}"

    def put(self, raw: bytes, suffix: str = ".h5", kind: str = "x"):
        """Return the answer; a refusal leaves nothing."""
        answer = self.http.put(self.paths[kind, suffix], content=raw, headers=BINARY)
        assert answer.status_code in (201, 422), answer.text[:500]
        assert "Traceback" not in answer.text
        assert str(self.folder) not in answer.text
        if answer.status_code == 422:
            assert answer.headers["content-type"] == MEDIA_TYPE
            assert json.loads(answer.content, parse_constant=pytest.fail)["errors"]
            assert len(answer.content) < 4000
            assert self.http.get(self.paths[kind, suffix]).status_code == 404
        else:
            assert self.http.delete(self.paths[kind, suffix]).status_code == 204
        assert [p for p in (self.folder / "files").rglob("*") if p.is_file()] == []
        return answer


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    reader = Reader(Limits(memory=128, seconds=20.0, wall_seconds=120.0, calls=1000), 5)
    settings = Settings(data=folder, requests_per_minute=10**8, burst=10**8)
    with TestClient(create_app(settings, embedded(folder), Here(), reader), base_url="http://localhost") as http:
        yield Campaign(http, folder, reader)


@pytest.fixture(autouse=True, scope="module")
def the_next_honest_one_is_read(campaign):
    yield
    answer = campaign.put(content(campaign.folder), kind="all")
    assert answer.json()["verdict"]["usable"]


HDF5 = [
    hostile_hdf5.external_link,
    hostile_hdf5.external_link_beside,
    hostile_hdf5.soft_link,
    hostile_hdf5.external_storage,
    hostile_hdf5.virtual,
    hostile_hdf5.terabytes,
    hostile_hdf5.bomb,
    hostile_hdf5.unwritten,
    hostile_hdf5.never_written,
    hostile_hdf5.foreign_filter,
    hostile_hdf5.twice_deflated,
    hostile_hdf5.inflating_chunk,
    hostile_hdf5.long_chunk,
    hostile_hdf5.lzf_after_deflate,
]


@pytest.mark.parametrize("spoil", HDF5, ids=lambda f: f.__name__)
def test_hdf5_that_reaches_out_or_lies(campaign, tmp_path, spoil):
    spoil(tmp_path / "x.h5")
    answer = campaign.put((tmp_path / "x.h5").read_bytes())
    assert answer.status_code == 422
    # refused by what stands in it, not by a limit, which is narrow
    assert "costs more" not in answer.text


def test_hdf5_does_not_read_this_machine(campaign, tmp_path):
    """External storage with samples of a file that is there."""
    secret = tmp_path / "secret"
    secret.write_bytes(np.arange(5000, dtype="f4").tobytes())
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file.attrs["sampling_rate_hz"] = RATE
        file.create_dataset("x", (5000,), "f4", external=[(str(secret), 0, 20_000)])
    assert "external file" in campaign.put((tmp_path / "x.h5").read_bytes()).json()["detail"]


@pytest.mark.slow
@pytest.mark.parametrize("name", hostile_matlab.HOSTILE)
def test_matlab_bombs(campaign, name):
    answer = campaign.put(hostile_matlab.HOSTILE[name][0](), ".mat")
    assert answer.status_code == 422
    assert "costs more" not in answer.text


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".h5", ".csv", ".tdms", ".uff", ".wav", ".mat", ".parquet"])
@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"\0",
        b"\0" * 100_000,
        b"x",
        gzip.compress(bytes(50_000_000)),
        zlib.compress(bytes(10_000_000)),
        b"\x80\x04\x95\x0b\x00\x00\x00\x00\x00\x00\x00\x8c\x05posix\x8c\x06system\x93.",
        b"<?xml version='1.0'?><!DOCTYPE a [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><a>&a;</a>",
        b"\x89HDF\r\n\x1a\n" + b"\xff" * 1000,
        b"RIFF\xff\xff\xff\xffWAVEfmt \xff\xff\xff\xff",
        b"PAR1" + b"\xff" * 100 + b"PAR1",
        b"TDSm" + b"\xff" * 100,
        b"MATLAB 5.0" + b" " * 114 + b"\x00\x01IM" + b"\xff" * 100,
        b"    -1\n    58\n" + b"9" * 2000,
        ("time,x\n" + "1e999,nan\n" * 100).encode(),
        ("x," * 200_000).encode(),
        b"x\n" + b"1" * 3_000_000,
        "x\n\ud800".encode("utf-8", "surrogatepass"),
    ],
    ids=["nothing", "zero", "zeros", "letter", "gzip bomb", "zlib bomb", "pickle", "xml", "hdf5", "riff", "parquet", "tdms", "mat", "uff",
         "csv", "columns", "digits", "surrogate"],
)  # fmt: skip
def test_what_is_no_recording(campaign, suffix, raw):
    answer = campaign.put(raw, suffix)
    # a number without end is a sample that was lost
    assert answer.status_code == 422 or not answer.json()["verdict"]["usable"]


def test_a_tool_library_is_read_where_recordings_are(campaign):
    """Its ZIP and its XML are opened by the cut-off process, too."""
    packed, headers = io.BytesIO(), {"Content-Type": "application/zip"}
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("tools.json", json.dumps(library(END_MILL)))
    before = campaign.reader.child.calls
    assert campaign.http.post("/v1/toolings/import", content=packed.getvalue(), headers=headers).json()["items"][0]["status"] == "written"
    assert campaign.http.post("/v1/toolings/import", content=packed.getvalue()[:50], headers=headers).status_code == 422
    assert campaign.reader.child.calls == before + 2


def test_a_zip_of_a_bomb(campaign):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x", bytes(20_000_000))
    assert campaign.put(packed.getvalue()).status_code == 422


@pytest.mark.parametrize("name", [name for name, (suffix, *_) in FORMATS.items() if suffix not in (".csv", ".unv")])
@pytest.mark.parametrize("share", [0.3, 0.999])
def test_files_that_are_cut_off(campaign, tmp_path, name, share):
    suffix, write, *_ = FORMATS[name]
    path = tmp_path / f"x{suffix}"
    write(path, RATE, {"x": 0.5 * channels()["flange_x"] / np.abs(channels()["flange_x"]).max()})
    raw = path.read_bytes()
    assert campaign.put(raw[: int(share * len(raw))], suffix).status_code == 422


@pytest.mark.parametrize("name", hostile_tdms.HOSTILE)
def test_tdms_that_lies(campaign, name):
    raw, _ = hostile_tdms.HOSTILE[name]
    assert campaign.put(raw, ".tdms").status_code == 422


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38, -1e38, 0.0])
def test_samples_out_of_reach_are_kept_and_not_used(campaign, tmp_path, value):
    raw = content(tmp_path, flange_x=np.full(7168, value, np.float32))
    answer = campaign.put(raw, kind="all")
    assert answer.status_code == 201
    told = json.loads(answer.content, parse_constant=pytest.fail)
    assert not told["verdict"]["usable"]


@pytest.mark.parametrize("rate", [1e-300, 1e-3, 1.0, 100.0, 1e9, 1e300])
def test_rates_that_no_machine_has(campaign, tmp_path, rate):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate_hz"] = rate
        for name, values in channels().items():
            file[name] = values
    answer = campaign.put(path.read_bytes(), kind="all")
    assert answer.status_code == 422 or not answer.json()["verdict"]["usable"]


@pytest.mark.slow
def test_as_many_samples_as_are_allowed_cost_words_or_a_verdict(campaign, tmp_path):
    """Half a minute of four channels is more than 128 MiB can judge or not: either way an answer, and the process goes on."""
    path = tmp_path / "x.h5"
    rng = np.random.default_rng(1)
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate_hz"] = 102400.0
        for name in NAMES:
            file[name] = rng.standard_normal(3_000_000).astype("f4")
    answer = campaign.put(path.read_bytes(), kind="all")
    assert answer.status_code == 201 or "costs more than 128 MiB" in answer.json()["detail"]


@pytest.mark.parametrize(
    "name",
    ["../x.h5", "..%2fx.h5", "a/b.h5", "%00.h5", "c0_cut.h5%00", "c0_cut.h5%0a", "c0_cut.h5/", "x" * 5000, "%ff.h5", "%2e%2e", "C:%5Cx.h5"],
)
def test_names_that_are_paths(campaign, name):
    base = campaign.paths["x", ".h5"].rsplit("/", 1)[0]
    for method in ("PUT", "PATCH", "GET", "DELETE"):
        answer = campaign.http.request(
            method, f"{base}/{name}", content=b"x", headers=BINARY | {"Upload-Offset": "0", "Upload-Length": "1"}
        )
        assert answer.status_code in (404, 405, 422), (method, answer.status_code, answer.text[:300])
        assert answer.headers["content-type"] == MEDIA_TYPE
    assert [p for p in (campaign.folder / "files").rglob("*") if p.is_file()] == []


def test_bodies_that_would_have_to_be_unpacked(campaign):
    for coding in ("gzip", "deflate", "br", "x"):
        answer = campaign.http.put(campaign.paths["x", ".h5"], content=b"x", headers=BINARY | {"Content-Encoding": coding})
        assert answer.status_code == 415


FORMS = [
    b"", b"--x", b"--x--", b"--x\r\n\r\n", b"--x\r\nContent-Disposition: form-data; name=f; filename=c0_cut.h5\r\n\r\nabc",
    b"--x\r\n" + b"A: b\r\n" * 10_000 + b"\r\nabc\r\n--x--", b"--x\r\n" + b"A" * 100_000, b"\r\n" * 1000, b"--y\r\n\r\n--y--",
    b"--x\r\nContent-Disposition: form-data; filename=\xff\xfe\r\n\r\nabc\r\n--x",
]  # fmt: skip


@pytest.mark.parametrize("raw", FORMS)
@pytest.mark.parametrize(
    "kind",
    [
        "multipart/form-data; boundary=x",
        "multipart/form-data",
        'multipart/form-data; boundary=""',
        "multipart/form-data; boundary=" + "x" * 1000,
    ],
)
def test_forms_that_are_none(campaign, raw, kind):
    path = campaign.paths["x", ".h5"].rsplit("/", 1)[0]
    answer = campaign.http.post(path, content=raw, headers={"Content-Type": kind})
    assert answer.status_code in (200, 400, 413), answer.text[:300]
    assert answer.status_code != 200 or all(item["status"] >= 400 for item in answer.json()["items"])
    assert [p for p in (campaign.folder / "files").rglob("*") if p.is_file()] == []


@pytest.mark.slow
def test_a_form_that_breaks_off_is_told(campaign):
    """Without the boundary at its end the last file may be a part of one: it is not kept, and not left out in silence."""
    path, kind = campaign.paths["x", ".h5"].rsplit("/", 1)[0], {"Content-Type": "multipart/form-data; boundary=x"}
    head = b"--x\r\nContent-Disposition: form-data; name=f; filename=c0_cut.h5\r\n\r\nabc"
    for end in (b"", b"\r\n", b"\r\n--x", b"\r\n--x-", b"\r\n--x\r\n"):
        assert campaign.http.post(path, content=head + end, headers=kind).status_code == 400, end
    assert campaign.http.post(path, content=head + b"\r\n--x--", headers=kind).status_code == 200


@pytest.mark.slow
def test_a_form_of_very_many_parts(campaign):
    path = campaign.paths["x", ".h5"].rsplit("/", 1)[0]
    part = b"--x\r\nContent-Disposition: form-data; name=f; filename=a\r\n\r\n\r\n"
    answer = campaign.http.post(path, content=part * 1001 + b"--x--", headers={"Content-Type": "multipart/form-data; boundary=x"})
    assert answer.status_code == 413


@pytest.mark.slow
def test_declared_sizes_of_every_format_are_looked_at_first(campaign):
    """A RIFF file of 4 GB in a hundred bytes, a TDMS of 2^60 values."""
    form = struct.pack("<HHIIHH", 1, 1, 51200, 102400, 2, 16)
    raw = b"RIFF\xff\xff\xff\xffWAVEfmt " + struct.pack("<I", 16) + form + b"data\xf0\xff\xff\xff" + bytes(100)
    assert campaign.put(raw, ".wav").status_code == 422


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".flac", ".wav"])
def test_sound_is_decoded_in_the_reader(campaign, tmp_path, suffix):
    """The library is found and loaded in there, wherever the service is started; only then its channels can be told."""
    soundfile.write(tmp_path / f"cut{suffix}", np.zeros((600, 2)), 48000)
    answer = campaign.put((tmp_path / f"cut{suffix}").read_bytes(), suffix)
    assert answer.status_code == 422
    assert "one channel of the file: ch1, ch2" in answer.text
