"""Uploads as tus 1.0 speaks of them: the protocol header by header, and a client that others wrote, over a service that is killed."""

from __future__ import annotations

import base64
import hashlib
import signal

import httpx2
import pytest
from tusclient.client import TusClient
from tusclient.exceptions import TusCommunicationError

from api.client import Client
from tests.api.recordings import content, declared
from tests.fixtures.service import serving

SAYS = {"Tus-Resumable": "1.0.0"}
PART = SAYS | {"Content-Type": "application/offset+octet-stream"}
NAME = "c0_cut.h5"


def metadata(**told):
    return ",".join(f"{key} {base64.b64encode(value.encode()).decode()}" for key, value in told.items())


@pytest.fixture
def place(http, client, tmp_path):
    """A service in this process, the path of uploads of a campaign with two cuts, and a recording."""
    id = client.make_campaign(client.make_machine("m").id, declared(2)).id
    return http, f"/v1/campaigns/{id}/uploads", content(tmp_path)


def begun(client, path, length, **told):
    answer = client.post(path, headers=SAYS | {"Upload-Length": str(length), "Upload-Metadata": metadata(**({"filename": NAME} | told))})
    assert answer.status_code == 201, answer.text
    assert answer.headers["tus-resumable"] == "1.0.0"
    return answer.headers["location"]


def sent(client, where, raw, offset, **further):
    headers = PART | {"Upload-Offset": str(offset)} | further
    return client.patch(where, content=raw, headers=headers)


def test_what_it_can_is_told_without_a_version(place):
    client, path, _ = place
    answer = client.options(path)
    assert answer.status_code == 204
    assert answer.headers["tus-version"] == "1.0.0"
    assert set(answer.headers["tus-extension"].split(",")) == {"creation", "termination", "checksum"}
    assert {"sha1", "sha256"} <= set(answer.headers["tus-checksum-algorithm"].split(","))
    assert int(answer.headers["tus-max-size"]) > 10**6


def test_parts_become_the_recording(place):
    client, path, raw = place
    where = begun(client, path, len(raw))
    half = len(raw) // 2
    first = sent(client, where, raw[:half], 0)
    assert (first.status_code, first.headers["upload-offset"]) == (204, str(half))
    state = client.head(where, headers=SAYS)
    assert (state.headers["upload-offset"], state.headers["upload-length"]) == (str(half), str(len(raw)))
    last = sent(client, where, raw[half:], half)
    assert (last.status_code, last.headers["upload-offset"]) == (204, str(len(raw)))
    recording = client.get(f"{path.removesuffix('uploads')}recordings/{NAME}").json()
    assert recording["sha256"] == hashlib.sha256(raw).hexdigest()
    # and both faces tell the same of it
    for face in ("uploads", "recordings"):
        assert client.head(f"{path.removesuffix('uploads')}{face}/{NAME}", headers=SAYS).headers["upload-offset"] == str(len(raw))


def test_both_faces_write_the_same_upload(place):
    client, path, raw = place
    where = begun(client, path, len(raw))
    assert sent(client, where, raw[:1000], 0).status_code == 204
    answer = client.patch(
        f"{path.removesuffix('uploads')}recordings/{NAME}",
        content=raw[1000:],
        headers={"Upload-Offset": "1000", "Content-Type": "application/octet-stream"},
    )
    assert answer.status_code == 201


def test_a_part_with_another_checksum_is_not_kept(place):
    client, path, raw = place
    where = begun(client, path, len(raw))
    for algorithm in ("sha1", "sha256", "md5"):
        digest = base64.b64encode(hashlib.new(algorithm, b"other").digest()).decode()
        answer = sent(client, where, raw[:500], 0, **{"Upload-Checksum": f"{algorithm} {digest}"})
        assert answer.status_code == 460
        assert client.head(where, headers=SAYS).headers["upload-offset"] == "0"
    assert sent(client, where, raw[:500], 0, **{"Upload-Checksum": "crc32 AAAA"}).status_code == 400
    assert sent(client, where, raw[:500], 0, **{"Upload-Checksum": "sha1 %%%"}).status_code == 400
    digest = base64.b64encode(hashlib.sha1(raw[:500]).digest()).decode()
    assert sent(client, where, raw[:500], 0, **{"Upload-Checksum": f"sha1 {digest}"}).status_code == 204


def test_what_breaks_the_protocol_is_refused(place):
    client, path, raw = place
    where = begun(client, path, len(raw))
    version = client.head(where)
    assert (version.status_code, version.headers["tus-version"]) == (412, "1.0.0")
    wrong = sent(client, where, raw[:10], 5)
    assert (wrong.status_code, wrong.headers["upload-offset"], wrong.headers["tus-resumable"]) == (409, "0", "1.0.0")
    assert client.patch(where, content=raw[:10], headers=SAYS | {"Upload-Offset": "0", "Content-Type": "text/plain"}).status_code == 415
    assert sent(client, where, raw + b"more", 0).status_code == 422
    assert sent(client, f"{path}/nobody.h5", raw, 0).status_code == 404
    for headers, status in (
        ({"Upload-Metadata": metadata(filename=NAME)}, 422),
        ({"Upload-Length": "10"}, 422),
        ({"Upload-Length": "10", "Upload-Metadata": "filename %%"}, 422),
        ({"Upload-Length": "10", "Upload-Metadata": metadata(filename="nobody.h5")}, 404),
        ({"Upload-Length": str(10**12), "Upload-Metadata": metadata(filename=NAME)}, 413),
    ):
        answer = client.post(path, headers=SAYS | headers)
        assert (answer.status_code, answer.headers["tus-resumable"]) == (status, "1.0.0")


def test_an_upload_that_is_given_up_is_gone_and_a_recording_is_not(place):
    client, path, raw = place
    where = begun(client, path, len(raw))
    assert sent(client, where, raw[:1000], 0).status_code == 204
    assert client.delete(where, headers=SAYS).status_code == 204
    assert client.head(where, headers=SAYS).status_code == 404
    where = begun(client, path, len(raw))
    assert sent(client, where, raw, 0).status_code == 204
    assert client.delete(where, headers=SAYS).status_code == 404
    assert client.head(where, headers=SAYS).headers["upload-offset"] == str(len(raw))


def test_other_content_needs_to_be_told(place, tmp_path):
    client, path, raw = place
    assert sent(client, begun(client, path, len(raw)), raw, 0).status_code == 204
    other = content(tmp_path, seed=1)
    assert sent(client, begun(client, path, len(other)), other, 0).status_code == 409
    assert sent(client, begun(client, path, len(other), replace="true"), other, 0).status_code == 204


@pytest.mark.slow
def test_a_client_that_others_wrote_goes_on_after_a_kill(tmp_path):
    raw = content(tmp_path)
    file = tmp_path / NAME
    file.write_bytes(raw)
    with serving(tmp_path / "store") as served, Client(served.url) as client, file.open("rb") as stream:
        id = client.make_campaign(client.make_machine("m").id, declared(2)).id
        told = {"chunk_size": 20_000, "metadata": {"filename": NAME}, "upload_checksum": True}
        uploader = TusClient(f"{served.url}/v1/campaigns/{id}/uploads").uploader(file_stream=stream, **told)
        for _ in range(3):
            uploader.upload_chunk()
        assert uploader.offset == 60_000
        served.process.send_signal(signal.SIGKILL)
        served.process.wait()
        with pytest.raises(TusCommunicationError):
            uploader.upload_chunk()
    with serving(tmp_path / "store") as served, Client(served.url) as client, file.open("rb") as stream:
        url = f"{served.url}/v1/campaigns/{id}/uploads/{NAME}"
        uploader = TusClient(f"{served.url}/v1/campaigns/{id}/uploads").uploader(file_stream=stream, url=url, **told)
        assert uploader.offset == 60_000
        uploader.upload()
        assert client.recording(id, NAME).sha256 == hashlib.sha256(raw).hexdigest()
        assert httpx2.head(url, headers=SAYS).headers["upload-offset"] == str(len(raw))
