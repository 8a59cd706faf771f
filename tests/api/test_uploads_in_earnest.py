"""Uploads over a socket: bodies without an end, clients that go, lie or crawl, many at once; and a kill at every step."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import httpx2
import pytest
import uvicorn

from api.client import Client
from api.files import STALE_FILE, STALE_PART, UPLOADS, Part
from api.main import create_app
from api.reading.examine import write_normalised
from api.settings import Settings
from api.stores.entities import Unavailable
from api.stores.sql import open_store
from tests.api.in_process import Here, embedded, refused, service
from tests.api.recordings import content, declared
from tests.api.test_tus import PART, SAYS, begun, sent
from tests.fixtures.waiting import PATIENCE, until

ROOT = Path(__file__).resolve().parents[2]
BINARY = {"Content-Type": "application/octet-stream"}


@contextmanager
def listening(folder: Path, **settings) -> Iterator[int]:
    """A service of this process on a port of loopback."""
    app = create_app(Settings(data=folder, **settings), embedded(folder), Here(), Here())
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        server = uvicorn.Server(uvicorn.Config(app, log_config=None, access_log=False, timeout_graceful_shutdown=5))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [bound]})
        thread.start()
        until(lambda: server.started)
        try:
            yield bound.getsockname()[1]
        finally:
            server.should_exit = True
            thread.join()


@pytest.fixture
def place(tmp_path):
    """Makes a service with a campaign: port, path of a recording, folder."""

    @contextmanager
    def made(**settings):
        with listening(tmp_path, **settings) as port, Client(f"http://127.0.0.1:{port}") as client:
            id = client.make_campaign(client.make_machine("m").id, declared(2)).id
            yield client, port, id

    return made


@pytest.fixture
def opened(monkeypatch) -> list[Part]:
    """The parts of resumable uploads that a request has begun to write."""
    parts: list[Part] = []
    monkeypatch.setattr("api.transfer.resumable.Part", lambda *arguments: parts.append(Part(*arguments)) or parts[-1])
    return parts


def files_in(folder: Path) -> list[Path]:
    return [p for p in (folder / "files").rglob("*") if p.is_file()]


def head(method: str, path: str, *further: str) -> bytes:
    told = PART | {"Upload-Offset": "0"} if method == "PATCH" else BINARY
    lines = [f"{method} {path} HTTP/1.1", "Host: localhost", *(f"{name}: {value}" for name, value in told.items()), *further]
    return "\r\n".join([*lines, "", ""]).encode()


def answer_of(link: socket.socket) -> tuple[int, bytes]:
    raw = b""
    while part := link.recv(65536):
        raw += part
    return int(raw.split(b" ", 2)[1]), raw


@pytest.mark.slow
def test_a_body_without_an_end_is_cut_off(place, tmp_path):
    with place(max_upload_bytes=3_000_000) as (client, port, id), socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
        link.sendall(head("PUT", f"/v1/campaigns/{id}/recordings/c0_cut.h5", "Transfer-Encoding: chunked"))
        sent = 0
        try:
            while sent < 200_000_000:
                link.sendall(b"f4240\r\n" + bytes(1_000_000) + b"\r\n")
                sent += 1_000_000
        except OSError:
            pass
        assert sent < 100_000_000
        until(lambda: files_in(tmp_path) == [])
        # a length that is told beforehand costs nothing at all
        answer = client.http.put(f"/v1/campaigns/{id}/recordings/c0_cut.h5", content=bytes(3_000_001), headers=BINARY)
        assert (answer.status_code, answer.headers["content-type"]) == (413, "application/problem+json")
        many = [("f", (f"{k}.h5", bytes(400_000))) for k in range(10)]
        assert client.http.post(f"/v1/campaigns/{id}/recordings", files=many).status_code == 413
        assert files_in(tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("method", ["PUT", "PATCH"])
def test_a_client_that_goes_half_way(place, opened, tmp_path, method):
    raw = content(tmp_path)
    with place() as (client, port, id):
        path = f"/v1/campaigns/{id}/recordings/c0_cut.h5"
        if method == "PATCH":
            path = begun(client.http, f"/v1/campaigns/{id}/uploads", len(raw), sha256=hashlib.sha256(raw).hexdigest())
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
            link.sendall(head(method, path, f"Content-Length: {len(raw)}") + raw[:20_000])
            until(lambda: opened if method == "PATCH" else files_in(tmp_path))
        if method == "PUT":
            until(lambda: files_in(tmp_path) == [])
            assert client.http.get(path).status_code == 404
        else:
            # what has come is kept, and the client goes on
            until(lambda: client.http.head(path, headers=SAYS).headers.get("upload-offset") == "20000")
            (tmp_path / "c0_cut.h5").write_bytes(raw)
            assert client.upload_in_parts(id, tmp_path / "c0_cut.h5").sha256 == hashlib.sha256(raw).hexdigest()
        assert client.upload(id, _written(tmp_path, raw)).verdict.usable


def _written(folder: Path, raw: bytes) -> Path:
    path = folder / "c0_cut.h5"
    path.write_bytes(raw)
    return path


@pytest.mark.slow
def test_a_length_that_is_a_lie(place, tmp_path):
    """Less than was told of is waited for, so long; of more than was told of the rest is no part of the body."""
    raw = content(tmp_path)
    with place(upload_idle_seconds=0.3) as (client, port, id):
        path = f"/v1/campaigns/{id}/recordings/c0_cut.h5"
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
            link.sendall(head("PUT", path, f"Content-Length: {len(raw) + 1}") + raw)
            status, text = answer_of(link)
        assert (status, b"no data has arrived for 0.3 s" in text) == (408, True)
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
            link.sendall(head("PUT", path, f"Content-Length: {len(raw) - 1000}") + raw)
            assert answer_of(link)[0] == 422
        assert files_in(tmp_path) == []
        for told in ("-1", "x", "9" * 400, "1e3"):
            with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
                link.sendall(head("PUT", path, f"Content-Length: {told}") + b"x")
                assert answer_of(link)[0] in (400, 413)
        assert client.upload(id, _written(tmp_path, raw)).verdict.usable


@pytest.mark.slow
def test_a_client_that_crawls_is_given_up(place, tmp_path):
    limits = {"upload_idle_seconds": 0.5, "upload_bytes_per_second": 100_000}
    with place(**limits) as (_, port, id), socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
        link.sendall(head("PUT", f"/v1/campaigns/{id}/recordings/c0_cut.h5", "Content-Length: 1000000"))
        begin = time.monotonic()
        try:
            while time.monotonic() - begin < PATIENCE:
                link.sendall(b"x")
                time.sleep(0.05)
                link.setblocking(False)
                try:
                    if link.recv(1, socket.MSG_PEEK):
                        break
                except BlockingIOError:
                    pass
                finally:
                    link.settimeout(PATIENCE)
        except OSError:
            pytest.fail("the connection ended without an answer")
        status, text = answer_of(link)
        assert (status, b"too slow" in text) == (408, True)
    assert files_in(tmp_path) == []


@pytest.mark.slow
def test_too_many_at_once_are_told_to_wait(place, tmp_path):
    raw = content(tmp_path)
    with place(uploads=2) as (client, port, id):
        path = f"/v1/campaigns/{id}/recordings/c0_cut.h5"
        where = begun(client.http, f"/v1/campaigns/{id}/uploads", len(raw), filename="c1_cut.h5")
        links = [socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) for _ in range(2)]
        for link in links:
            link.sendall(head("PUT", path, f"Content-Length: {len(raw)}") + raw[:1000])
        until(lambda: len(files_in(tmp_path)) == 4)
        for upload in (lambda: client.http.put(path, content=raw, headers=BINARY), lambda: sent(client.http, where, raw, 0)):
            answer = _answered(upload)
            assert (answer.status_code, answer.headers["retry-after"]) == (503, "2")
        # reads go on
        assert client.campaign(id).usable == 0
        for link in links:
            link.close()
        assert client.http.delete(where, headers=SAYS).status_code == 204
        until(lambda: files_in(tmp_path) == [])
        assert client.upload(id, _written(tmp_path, raw)).verdict.usable


def _answered(ask):
    """The answer to a body that is refused unread: what is left of it may meet a closed line first, so it is asked again."""
    for _ in range(5):
        try:
            return ask()
        except httpx2.TransportError:
            continue
    return ask()


@pytest.mark.slow
def test_uploads_of_one_name_at_once(place, tmp_path):
    """The same content is one recording; of two contents one is kept, the other refused."""
    raws = [content(tmp_path, seed) for seed in range(2)]
    with place() as (client, port, id):
        url = f"http://127.0.0.1:{port}/v1/campaigns/{id}/recordings/"
        with ThreadPoolExecutor(6) as threads:
            same = list(
                threads.map(
                    lambda _: httpx2.put(url + "c0_cut.h5", content=raws[0], headers=BINARY, timeout=PATIENCE).status_code, range(6)
                )
            )
            other = list(
                threads.map(
                    lambda k: httpx2.put(url + "c1_cut.h5", content=raws[k % 2], headers=BINARY, timeout=PATIENCE).status_code, range(6)
                )
            )
        assert sorted(same) == [200] * 5 + [201]
        assert sorted(other) == [200, 200, 201, 409, 409, 409]
        assert len(files_in(tmp_path)) == 2 * len({each.sha256 for each in client.recordings(id)})


@pytest.mark.slow
def test_two_who_write_the_same_parts(place, opened, tmp_path):
    raw = content(tmp_path)
    with place() as (client, port, id):
        where = begun(client.http, f"/v1/campaigns/{id}/uploads", len(raw))
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
            link.sendall(head("PATCH", where, f"Content-Length: {len(raw)}") + raw[:2000])
            until(lambda: opened)
            assert sent(client.http, where, raw, 0).status_code == 503
            link.sendall(raw[2000:])
            link.settimeout(PATIENCE)
            assert link.recv(65536).split(b" ", 2)[1] == b"204"


@pytest.mark.slow
def test_air_and_cut_at_once_end_with_the_right_verdict(place, tmp_path):
    with place() as (client, port, id):
        url = f"http://127.0.0.1:{port}/v1/campaigns/{id}/recordings/"
        raws = {f"c{k}_{kind}.h5": content(tmp_path, k, kind == "air") for k in range(2) for kind in ("cut", "air")}
        with ThreadPoolExecutor(4) as threads:
            done = list(
                threads.map(lambda name: httpx2.put(url + name, content=raws[name], headers=BINARY, timeout=PATIENCE).status_code, raws)
            )
        assert done == [201] * 4
        found = client.campaign(id)
        assert found.usable == 2
        assert all(cut.verdict.notes == [] for cut in found.cuts)
        assert client.http.get("/health").status_code == 200


def test_no_room_is_told_in_words(store, tmp_path, monkeypatch):
    raw = content(tmp_path)
    with service(store, tmp_path, group_bytes=150_000) as http:
        client = Client(http=http)
        id = client.make_campaign(client.make_machine("m").id, declared(2)).id
        client.upload(id, _written(tmp_path, raw), "c0_cut.h5")
        problem = refused(413, client.upload, id, _written(tmp_path, raw), "c0_air.h5")
        assert "may keep 150000" in problem.detail
        refused(413, client.upload_in_parts, id, tmp_path / "c0_cut.h5", "c0_air.h5")
    with service(embedded(tmp_path / "files"), tmp_path, free_bytes=10**9) as http:
        client = Client(http=http)
        id = client.make_campaign(client.make_machine("m").id, declared(2)).id
        monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**10, 9 * 10**9, 10**9))
        refused(503, client.upload, id, _written(tmp_path, raw))
        monkeypatch.undo()

        def full(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("api.files.Part.write", full)
        before = files_in(tmp_path)
        assert "disk is full" in refused(503, client.upload, id, _written(tmp_path, raw)).detail
        assert files_in(tmp_path) == before


def test_parts_outlive_a_full_disk(http, client, tmp_path, monkeypatch):
    """While a recording is read: nothing is wrong with it, and it need not be sent again."""
    campaign = client.make_campaign(client.make_machine("m").id, declared(1)).id
    url, raw = f"/v1/campaigns/{campaign}/recordings/c0_cut.h5", content(tmp_path)
    where = begun(http, f"/v1/campaigns/{campaign}/uploads", len(raw))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("api.reading.examine.write_normalised", full)
    for answer in (sent(http, where, raw, 0), http.put(url, content=raw, headers=BINARY)):
        assert (answer.status_code, answer.json()["detail"]) == (503, "the disk is full")
    # neither is it told to be there
    assert http.head(where, headers=SAYS).status_code == 503
    monkeypatch.undo()
    answer = http.head(where, headers=SAYS)
    assert (answer.status_code, answer.headers["upload-offset"]) == (204, str(len(raw)))
    assert client.recording(campaign, "c0_cut.h5").sha256 == hashlib.sha256(raw).hexdigest()
    assert len(files_in(tmp_path)) == 2


def test_parts_outlive_a_database_that_takes_no_row(http, client, tmp_path, monkeypatch):
    """Its disk may be full: the files stand in their places already, and no row names them."""
    campaign = client.make_campaign(client.make_machine("m").id, declared(1)).id
    url, raw = f"/v1/campaigns/{campaign}/recordings/c0_cut.h5", content(tmp_path)

    def full(*_):
        raise Unavailable

    monkeypatch.setattr(http.app.state.components.store.recordings, "put", full)
    where = begun(http, f"/v1/campaigns/{campaign}/uploads", len(raw))
    assert sent(http, where, raw, 0).status_code == 503
    assert http.head(where, headers=SAYS).status_code == 503
    monkeypatch.undo()
    answer = http.head(where, headers=SAYS)
    assert (answer.status_code, answer.headers["upload-offset"]) == (204, str(len(raw)))
    assert http.get(f"{url}/file").content == raw
    assert len(files_in(tmp_path)) == 2


@pytest.mark.parametrize("in_parts", [False, True])
def test_a_sweep_while_an_upload_is_stored_takes_nothing_of_it(http, client, tmp_path, monkeypatch, in_parts):
    """Whatever the clock shows: neither what is being read, nor files whose row does not stand yet."""
    campaign = client.make_campaign(client.make_machine("m").id, declared(1)).id
    url, raw = f"/v1/campaigns/{campaign}/recordings/c0_cut.h5", content(tmp_path)
    components, clock, sweeps = http.app.state.components, time.time, []
    write, put = write_normalised, components.store.recordings.put

    def reading(*arguments):
        write(*arguments)
        components.uploads.sweep()

    def storing(*arguments):
        sweeps.append(threading.Thread(target=components.uploads.sweep))
        sweeps[0].start()
        # it would be over by now, did it not wait for the row
        sweeps[0].join(0.2)
        assert sweeps[0].is_alive()
        return put(*arguments)

    monkeypatch.setattr(time, "time", lambda: clock() + 30.0 * STALE_PART)
    monkeypatch.setattr("api.reading.examine.write_normalised", reading)
    monkeypatch.setattr(components.store.recordings, "put", storing)
    if in_parts:
        assert sent(http, begun(http, f"/v1/campaigns/{campaign}/uploads", len(raw)), raw, 0).status_code == 204
    else:
        assert http.put(url, content=raw, headers=BINARY).status_code == 201
    sweeps[0].join()
    assert hashlib.sha256(http.get(f"{url}/file").content).hexdigest() == hashlib.sha256(raw).hexdigest()
    assert len(files_in(tmp_path)) == 2


@pytest.mark.parametrize("replacing", [False, True])
def test_a_complete_upload_is_stored_after_a_kill(store, tmp_path, monkeypatch, replacing):
    raw, other = content(tmp_path), content(tmp_path, 1)
    with service(store, tmp_path) as http:
        machine = http.post("/v1/machines", json={"name": "m"}).json()["id"]
        id = http.post(f"/v1/machines/{machine}/campaigns", json=declared()).json()["id"]
        url = f"/v1/campaigns/{id}/recordings/c0_cut.h5"
        if replacing:
            assert http.put(url, content=other, headers=BINARY).status_code == 201

        async def killed(*_):
            raise RuntimeError("leaves what a kill leaves")

        where = begun(http, f"/v1/campaigns/{id}/uploads", len(raw), replace=str(replacing).lower())
        monkeypatch.setattr("api.reading.uploads.Uploads.take", killed)
        assert sent(http, where, raw, 0).status_code == 500
        monkeypatch.undo()
    with service(store, tmp_path) as http:
        until(lambda: (http.get(url).json() if http.get(url).status_code == 200 else {}).get("sha256") == hashlib.sha256(raw).hexdigest())
        until(lambda: len(files_in(tmp_path)) == 2)


#: Where a process ends without a word: function, calls of it that are survived, and whether what has come is kept then.
STEPS = [
    ("api.files.Part.sync", 0, False),
    ("api.reading.examine.read_upload", 0, False),
    ("api.files.Files.keep", 0, False),
    ("api.files.Files.keep", 1, False),
    ("api.stores.sql_campaigns._changed", 0, False),
    ("api.reading.uploads.Uploads._stale", 0, True),
    ("api.routes.recordings.answer", 0, True),
]
REPLACING = [*STEPS[3:5], ("api.reading.uploads.Uploads._release", 0, True), STEPS[5]]
CODE = """
import importlib, json, os, sys
from pathlib import Path
import api.reading.examine
from tests.api.in_process import embedded, service

def upload(folder, id, target, survived, replacing):
    path, _, function = target.rpartition(".")
    try:
        place = importlib.import_module(path)
    except ModuleNotFoundError:
        module, _, name = path.rpartition(".")
        place = getattr(importlib.import_module(module), name)
    left, before = [survived], getattr(place, function)
    def dying(*arguments, **further):
        if left[0] == 0:
            os._exit(9)
        left[0] -= 1
        return before(*arguments, **further)
    with service(embedded(folder), folder) as http:
        setattr(place, function, dying)
        url = f"/v1/campaigns/{id}/recordings/c0_cut.h5?replace={str(replacing).lower()}"
        http.put(url, content=(folder / "upload").read_bytes(), headers={"Content-Type": "application/octet-stream"})

for folder, *step in json.loads(sys.argv[1]):
    child = os.fork()
    if child == 0:
        upload(Path(folder), *step)
        os._exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def whole(folder: Path, group: str = "local") -> dict[str, str]:
    """Names and hashes of recordings, each of which is there to the last byte."""
    with service(open_store(f"sqlite:///{folder / 'store.db'}"), folder) as http:
        parts = http.app.state.components
        (machine,) = parts.store.machines.list(group, "", 9)
        (campaign,) = parts.store.campaigns.list(group, machine.id, "", 9)
        found = {}
        for row in parts.store.recordings.list(group, campaign.id, "", 99):
            raw = parts.files.path(group, UPLOADS, row.sha256).read_bytes()
            assert (hashlib.sha256(raw).hexdigest(), len(raw)) == (row.sha256, row.size)
            assert http.get(f"/v1/campaigns/{campaign.id}/recordings/{row.name}/signal").status_code == 200
            found[row.name] = row.sha256
        return found


@pytest.mark.slow
@pytest.mark.parametrize("replacing", [False, True], ids=["new", "replacing"])
def test_a_kill_at_every_step_loses_nothing_and_leaves_nothing(tmp_path, replacing):
    """What was there is there, or what has come in its place, whole; the rest is swept, and the same upload again is taken."""
    folder, steps = tmp_path / "data", REPLACING if replacing else STEPS
    folder.mkdir()
    old, new = content(tmp_path, 1), content(tmp_path)
    with service(embedded(folder), folder) as http:
        client = Client(http=http)
        id = client.make_campaign(client.make_machine("m").id, declared(1)).id
        if replacing:
            (folder / "upload").write_bytes(old)
            client.upload(id, folder / "upload", "c0_cut.h5")
    (folder / "upload").write_bytes(new)
    before = {"c0_cut.h5": hashlib.sha256(old).hexdigest()} if replacing else {}
    copies = [tmp_path / str(k) for k in range(len(steps))]
    for copy in copies:
        shutil.copytree(folder, copy)
    asked = [[str(copy), id, target, survived, replacing] for copy, (target, survived, _) in zip(copies, steps, strict=True)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-c", CODE, json.dumps(asked)]
    process = subprocess.run(words, env=environment, capture_output=True, text=True, check=False, cwd=ROOT)
    assert process.stdout.split() == ["9"] * len(steps), process.stderr[-2000:]
    for copy, (*step, kept) in zip(copies, steps, strict=True):
        there = whole(copy)
        assert there == ({"c0_cut.h5": hashlib.sha256(new).hexdigest()} if kept else before), step
        for path in files_in(copy):
            long_ago = time.time() - 2.0 * max(STALE_FILE, STALE_PART)
            os.utime(path, (long_ago, long_ago))
        # the next start sweeps, and judges what is owed
        with service(open_store(f"sqlite:///{copy / 'store.db'}"), copy) as http:
            until(lambda copy=copy, there=there: len(files_in(copy)) == 2 * len(there))
            store = http.app.state.components.store
            until(lambda store=store: store.campaigns.unsettled() == [])
            again = http.put(f"/v1/campaigns/{id}/recordings/c0_cut.h5?replace=true", content=new, headers=BINARY)
            assert again.status_code == (200 if kept else 201)
            assert again.json()["verdict"]["usable"]
            assert http.get(f"/v1/campaigns/{id}/recordings/c0_cut.h5/file").content == new
        assert len(files_in(copy)) == 2
