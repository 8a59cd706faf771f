"""Uploads as tus 1.0 speaks of them: the protocol header by header, and a client that others wrote, over a service that is killed."""

from __future__ import annotations

import base64
import hashlib
import os
import signal
import subprocess
import sys
import threading

import httpx2
import pytest
from tusclient.client import TusClient
from tusclient.exceptions import TusCommunicationError

from api.client import Client
from api.files import Part
from tests.api.in_process import embedded, refused, service
from tests.api.recordings import content, declared
from tests.fixtures.paths import ROOT
from tests.fixtures.service import serving
from tests.fixtures.waiting import PATIENCE, until

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
    assert client.head(where, headers=SAYS).headers["upload-offset"] == str(len(raw))


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
    # any byte may stand in a header
    assert sent(client, where, raw[:500], 0, **{"Upload-Checksum": b"sha1 \xfc\xff"}).status_code == 400
    digest = base64.b64encode(hashlib.sha1(raw[:500]).digest()).decode()
    assert sent(client, where, raw[:500], 0, **{"Upload-Checksum": f"sha1 {digest}"}).status_code == 204


def test_what_breaks_the_protocol_is_refused(place):
    client, path, raw = place
    where = begun(client, path, len(raw))
    version = client.head(where)
    assert (version.status_code, version.headers["tus-version"]) == (412, "1.0.0")
    assert sent(client, where, raw[:1000], 0).status_code == 204
    for offset in (0, 999, 1001, len(raw)):
        wrong = sent(client, where, raw[offset : offset + 10], offset)
        assert (wrong.status_code, wrong.headers["upload-offset"], wrong.headers["tus-resumable"]) == (409, "1000", "1.0.0")
    assert client.patch(where, content=raw[:10], headers=SAYS | {"Upload-Offset": "0", "Content-Type": "text/plain"}).status_code == 415
    assert sent(client, where, raw[1000:] + b"x", 1000).status_code == 422
    assert client.head(where, headers=SAYS).headers["upload-offset"] == "1000"
    assert sent(client, f"{path}/nobody.h5", raw, 0).status_code == 404
    for headers, status in (
        ({"Upload-Metadata": metadata(filename=NAME)}, 422),
        ({"Upload-Length": "10"}, 422),
        ({"Upload-Length": "10", "Upload-Metadata": "filename %%"}, 422),
        ({"Upload-Length": "10", "Upload-Metadata": b"filename \xfc\xff"}, 422),
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


@pytest.mark.parametrize("face", ["uploads", "recordings"])
@pytest.mark.parametrize("half", [True, False])
@pytest.mark.parametrize("during", ["written", "synced", "stored"])
def test_a_part_of_an_upload_that_is_given_up_meanwhile_is_not_acknowledged(place, monkeypatch, face, half, during):
    client, path, raw = place
    components, told = client.app.state.components, []
    where = begun(client, path, len(raw))
    assert sent(client, where, raw[:1000], 0).status_code == 204
    what, name = {"written": (Part, "write"), "synced": (Part, "sync"), "stored": (components.store.recordings, "get")}[during]
    before = getattr(what, name)

    def given_up(*arguments):
        if not told:
            told.append(client.delete(f"{path.removesuffix('uploads')}{face}/{NAME}", headers=SAYS).status_code)
        return before(*arguments)

    monkeypatch.setattr(what, name, given_up)
    # of an upload that lacks bytes nothing is stored
    half = half and during != "stored"
    answer = sent(client, where, raw[1000:2000] if half else raw[1000:], 1000)
    assert (told, answer.status_code) == ([204], 410)
    assert client.head(where, headers=SAYS).status_code == 404
    assert [each for each in components.files.folder.rglob("*") if each.is_file()] == []
    assert sent(client, begun(client, path, len(raw)), raw, 0).status_code == 204


def test_other_content_needs_to_be_told(place, tmp_path):
    client, path, raw = place
    assert sent(client, begun(client, path, len(raw)), raw, 0).status_code == 204
    other = content(tmp_path, seed=1)
    assert sent(client, begun(client, path, len(other)), other, 0).status_code == 409
    assert sent(client, begun(client, path, len(other), replace="true"), other, 0).status_code == 204


def test_a_client_that_sends_only_post_says_what_it_means(place):
    client, path, raw = place
    where = begun(client, path, len(raw))

    def meant(method, content=b"", **headers):
        return client.post(where, content=content, headers=PART | {"X-HTTP-Method-Override": method} | headers)

    assert meant("PATCH", raw[:1000], **{"Upload-Offset": "0"}).headers["upload-offset"] == "1000"
    assert meant("head").headers["upload-offset"] == "1000"
    assert client.post(path, headers={"X-HTTP-Method-Override": "OPTIONS"}).headers["tus-version"] == "1.0.0"
    assert meant("PUT").status_code == 405
    # what a link alone can send changes nothing
    assert client.get(where, headers=SAYS | {"X-HTTP-Method-Override": "DELETE"}).status_code == 405
    assert client.head(where, headers=SAYS).headers["upload-offset"] == "1000"
    assert meant("DELETE").status_code == 204
    assert client.head(where, headers=SAYS).status_code == 404
    # and beside these paths the header says nothing
    assert client.post("/v1/machines", json={"name": "n"}, headers={"X-HTTP-Method-Override": "DELETE"}).status_code == 201


def test_an_upload_that_has_begun_is_not_begun_anew_by_another(place, tmp_path):
    client, path, raw = place
    where = begun(client, path, len(raw))
    for sent_so_far in (0, 1000):
        if sent_so_far:
            assert sent(client, where, raw[:1000], 0).status_code == 204
        for length in (len(raw), 5):
            headers = SAYS | {"Upload-Length": str(length), "Upload-Metadata": metadata(filename=NAME, sha256="0" * 64)}
            answer = client.post(path, headers=headers)
            # clients that find a location in any answer would follow it
            assert (answer.status_code, answer.headers.get("location")) == (409, None)
            assert f"{sent_so_far} of {len(raw)} bytes" in answer.json()["errors"][0]["found"]
        assert client.head(where, headers=SAYS).headers["upload-offset"] == str(sent_so_far)
    assert client.delete(where, headers=SAYS).status_code == 204
    assert sent(client, begun(client, path, len(raw)), raw, 0).status_code == 204


def test_the_same_content_goes_on_where_it_stands(place):
    """A client that has lost the address, or the answer to its creation."""
    client, path, raw = place
    told = {"sha256": hashlib.sha256(raw).hexdigest()}
    where = begun(client, path, len(raw), **told)
    assert sent(client, where, raw[:1000], 0).status_code == 204
    headers = SAYS | {"Upload-Length": str(len(raw)), "Upload-Metadata": metadata(filename=NAME, **told)}
    again = client.post(path, headers=headers)
    assert (again.status_code, again.headers["location"], again.headers["upload-offset"]) == (201, where, "1000")
    # unless it is to take the place of other content, which the first is not
    assert client.post(path, headers=headers | {"Upload-Metadata": metadata(filename=NAME, replace="true", **told)}).status_code == 409
    assert sent(client, where, raw[1000:], 1000).status_code == 204


def test_the_client_goes_on_with_its_own_content_alone(place, client, tmp_path):
    """A mixture of two files of one length would be neither."""
    http, path, raw = place
    id, other = path.split("/")[3], content(tmp_path, 1)
    (tmp_path / NAME).write_bytes(raw)
    assert len(other) == len(raw)
    sent(http, begun(http, path, len(raw), sha256=hashlib.sha256(other).hexdigest()), other[:1000], 0)
    assert client.upload_in_parts(id, tmp_path / NAME, part=50_000).sha256 == hashlib.sha256(raw).hexdigest()
    (tmp_path / NAME).write_bytes(other)
    assert "?replace=true" in refused(409, client.upload_in_parts, id, tmp_path / NAME).errors[0].allowed
    assert client.upload_in_parts(id, tmp_path / NAME, replace=True).sha256 == hashlib.sha256(other).hexdigest()


@pytest.mark.slow
def test_a_file_that_is_not_the_announced_one_is_refused_at_its_end(place):
    client, path, raw = place
    headers = SAYS | {"Upload-Length": str(len(raw)), "Upload-Metadata": metadata(filename=NAME, sha256="ABC")}
    assert client.post(path, headers=headers).status_code == 422
    # nor is one that cannot be read
    for sha256, whole, field in (("0" * 64, raw, "Upload-Metadata"), ("", b"?" * len(raw), "recording")):
        where = begun(client, path, len(raw), sha256=sha256)
        answer = sent(client, where, whole, 0)
        assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, field)
        assert client.head(where, headers=SAYS).status_code == 404
    assert [each for each in client.app.state.components.files.folder.rglob("*") if each.is_file()] == []


def test_parts_outlive_the_service(store, tmp_path):
    raw = content(tmp_path)
    with service(store, tmp_path) as http:
        client = Client(http=http)
        path = f"/v1/campaigns/{client.make_campaign(client.make_machine('m').id, declared(2)).id}/uploads"
        where = begun(http, path, len(raw))
        assert sent(http, where, raw[:5000], 0).status_code == 204
    with service(store, tmp_path) as http:
        assert http.head(where, headers=SAYS).headers["upload-offset"] == "5000"
        assert sent(http, where, raw[5000:], 5000).status_code == 204
        # a part that nobody goes on with
        where = begun(http, path, len(raw), filename="c0_air.h5")
        assert sent(http, where, raw[:5000], 0).status_code == 204
        assert http.delete(where.replace("uploads", "recordings")).status_code == 204
        assert http.head(where, headers=SAYS).status_code == 404


def test_an_upload_that_is_being_stored_never_seems_not_to_have_begun(store, tmp_path, monkeypatch):
    raw, answers = content(tmp_path), []
    with service(store, tmp_path) as http:
        client = Client(http=http)
        id = client.make_campaign(client.make_machine("m").id, declared(2)).id
        where = begun(http, f"/v1/campaigns/{id}/uploads", len(raw))
        asking = threading.Thread(target=lambda: answers.append(http.head(where, headers=SAYS)))
        put = store.recordings.put

        def asked_meanwhile(*arguments):
            # its bytes have their place, and no row names them yet
            asking.start()
            asking.join(PATIENCE)
            return put(*arguments)

        monkeypatch.setattr(store.recordings, "put", asked_meanwhile)
        assert sent(http, where, raw, 0).status_code == 204
        assert [(answer.status_code, "retry-after" in answer.headers) for answer in answers] == [(503, True)]
        assert http.head(where, headers=SAYS).headers["upload-offset"] == str(len(raw))


def test_what_another_group_uploads_is_not_there(guarded_http, tmp_path):
    http, keys = guarded_http
    raw = content(tmp_path)
    owner, other, reader = ({"X-API-Key": keys[name]} for name in ("upload", "other", "read"))
    client = Client(http=http, key=keys["admin"])
    id = client.make_campaign(client.make_machine("m").id, declared(2)).id
    path = f"/v1/campaigns/{id}/uploads"
    begin = SAYS | {"Upload-Length": str(len(raw)), "Upload-Metadata": metadata(filename=NAME)}
    where = http.post(path, headers=begin | owner).headers["location"]
    assert http.patch(where, content=raw[:1000], headers=PART | {"Upload-Offset": "0"} | owner).status_code == 204
    for key, status in ((other, 404), (reader, 403), ({}, 401)):
        assert http.post(path, headers=begin | key).status_code == status
        assert http.head(where, headers=SAYS | key).status_code == status
        assert http.patch(where, content=raw[1000:], headers=PART | {"Upload-Offset": "1000"} | key).status_code == status
        assert http.delete(where, headers=SAYS | key).status_code == status
        override = PART | {"X-HTTP-Method-Override": "DELETE"} | key
        assert http.post(where, headers=override).status_code == status
    assert http.head(where, headers=SAYS | owner).headers["upload-offset"] == "1000"
    assert http.patch(where, content=raw[1000:], headers=PART | {"Upload-Offset": "1000"} | owner).status_code == 204


def test_a_quota_that_is_full_refuses_an_upload_before_its_first_byte(store, tmp_path):
    raw = content(tmp_path)
    with service(store, tmp_path, group_bytes=len(raw) + 1000) as http:
        client = Client(http=http)
        id = client.make_campaign(client.make_machine("m").id, declared(2)).id
        path = f"/v1/campaigns/{id}/uploads"
        headers = SAYS | {"Upload-Length": str(len(raw) + 2000), "Upload-Metadata": metadata(filename=NAME)}
        answer = http.post(path, headers=headers)
        assert (answer.status_code, f"may keep {len(raw) + 1000}" in answer.json()["detail"]) == (413, True)
        assert http.head(f"{path}/{NAME}", headers=SAYS).status_code == 404
        # parts count as soon as they have come, of whichever recording
        where = begun(http, path, len(raw))
        assert sent(http, where, raw[:2000], 0).status_code == 204
        beside = SAYS | {"Upload-Length": str(len(raw)), "Upload-Metadata": metadata(filename="c1_cut.h5")}
        assert http.post(path, headers=beside).status_code == 413


#: Ends this process while it stores the whole: before anything of it is kept, or when all is.
DYING = """
import os, signal, sys
from pathlib import Path
from api.reading.uploads import Uploads
from tests.api.in_process import embedded, refused, service
from tests.api.test_tus import sent

folder, where, offset, when = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), sys.argv[4]
take = Uploads.take

async def dying(*arguments):
    if when == "after":
        await take(*arguments)
    os.kill(os.getpid(), signal.SIGKILL)

Uploads.take = dying
with service(embedded(folder), folder) as http:
    sent(http, where, (folder / "upload").read_bytes()[offset:], offset)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="elsewhere there is no such signal")
@pytest.mark.parametrize("when", ["before", "after"])
def test_a_kill_between_the_last_byte_and_its_acknowledgement(tmp_path, when):
    """The client asks how much has come, hears that all has, and the recording is there, once."""
    folder = tmp_path / "data"
    folder.mkdir()
    raw = content(tmp_path)
    (folder / "upload").write_bytes(raw)
    with service(embedded(folder), folder) as http:
        client = Client(http=http)
        id = client.make_campaign(client.make_machine("m").id, declared(2)).id
        where = begun(http, f"/v1/campaigns/{id}/uploads", len(raw))
        assert sent(http, where, raw[:1000], 0).status_code == 204
    words = [sys.executable, "-c", DYING, str(folder), where, "1000", when]
    ended = subprocess.run(words, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False, cwd=ROOT)
    assert ended.returncode == -signal.SIGKILL, ended.stderr[-2000:]
    with service(embedded(folder), folder) as http:
        # until the start has stored it, another request is writing it
        until(lambda: http.head(where, headers=SAYS).status_code != 503)
        assert http.head(where, headers=SAYS).headers["upload-offset"] == str(len(raw))
        rows = http.get(f"/v1/campaigns/{id}/recordings").json()["items"]
        assert [(row["name"], row["sha256"]) for row in rows] == [(NAME, hashlib.sha256(raw).hexdigest())]
        until(lambda: not list((folder / "files").rglob("*.part")))
        assert len(list((folder / "files").glob("*/uploads/*"))) == 1


@pytest.mark.witness
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
