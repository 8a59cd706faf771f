"""What is stored is hashed where it is read: damage is told in words, never handed on, and the same content sent again mends it."""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import zipfile
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest
from sqlalchemy import text
from typer.testing import CliRunner

from api import data_folder
from api.backups.save import backup
from api.files import NORMALISED, UPLOADS
from api.security import new_id, now
from api.serve import app
from api.stores.campaigns import Campaign
from api.stores.entities import Damaged, Destroyed, Document, Machine, digest_of
from api.stores.jobs import Outcome
from api.stores.sql import open_store
from rcsa_ident.base.errors import InputError
from tests.api.identifying import carried, job, running
from tests.api.in_process import BOTH, embedded, refused, service
from tests.api.recordings import content, declared
from tests.api.test_tus import SAYS
from tests.fixtures import by_hand
from tests.fixtures.service import example

CUT, AIR = "c0_cut.h5", "c0_air.h5"


@pytest.fixture
def parts(client):
    return client.http.app.state.components


@pytest.fixture
def campaign(client, tmp_path):
    """A campaign of a machine with a cut and its air cut."""
    id = client.make_campaign(client.make_machine("M").id, declared()).id
    for name in (AIR, CUT):
        (tmp_path / name).write_bytes(content(tmp_path, air=name == AIR))
        client.upload(id, tmp_path / name)
    return id


def stored(parts, campaign, name, kind) -> Path:
    row = parts.store.recordings.get("local", campaign, name)
    return parts.files.path("local", kind, row.sha256 if kind == UPLOADS else row.normalised)


def flip(path: Path) -> None:
    """Change one bit in the middle."""
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)


HARMS = [flip, Path.unlink, lambda path: os.truncate(path, 100)]
NAMES = ["flipped", "missing", "truncated"]


@pytest.mark.parametrize("harm", HARMS, ids=NAMES)
def test_a_damaged_upload_is_not_handed_out_and_heals(client, parts, campaign, tmp_path, harm):
    url, where = (f"/v1/campaigns/{campaign}/{face}/{CUT}" for face in ("recordings", "uploads"))
    raw = client.http.get(f"{url}/file").content
    assert raw == (tmp_path / CUT).read_bytes()
    harm(stored(parts, campaign, CUT, UPLOADS))
    for path in (f"{url}/file", f"/v1/campaigns/{campaign}/archive"):
        answer = client.http.get(path)
        assert (answer.status_code, answer.headers["content-type"]) == (500, "application/problem+json")
        assert f"the stored file of the recording {CUT} is " in answer.json()["detail"]
        assert "upload the same recording again" in answer.json()["detail"]
    # to somebody who sends in parts it is not there
    assert client.http.head(where, headers=SAYS).status_code == 404
    before = client.recording(campaign, CUT)
    assert client.upload(campaign, tmp_path / CUT) == before
    assert client.http.get(f"{url}/file").content == raw
    client.archive(campaign, tmp_path / "a.zip")
    assert zipfile.ZipFile(tmp_path / "a.zip").read(f"recordings/{CUT}") == raw
    assert client.http.head(where, headers=SAYS).headers["upload-offset"] == str(len(raw))


@pytest.mark.parametrize("harm", HARMS, ids=NAMES)
def test_damaged_samples_are_not_read_and_heal(client, parts, campaign, tmp_path, harm):
    harm(stored(parts, campaign, CUT, NORMALISED))
    for call in (client.signal, client.spectrum):
        assert f"the stored file of the recording {CUT} is " in refused(500, call, campaign, CUT).detail
    # the upload is whole
    assert client.http.get(f"/v1/campaigns/{campaign}/recordings/{CUT}/file").content == (tmp_path / CUT).read_bytes()
    client.upload_in_parts(campaign, tmp_path / CUT, part=100_000)
    assert client.signal(campaign, CUT).time_s
    assert client.campaign(campaign).usable == 1


def test_verdicts_meet_damage_and_forget_it(client, parts, campaign, tmp_path):
    """A cut whose air cut has come to harm is not judged by it; once the air cut is whole the verdict is the first again."""
    first = client.recording(campaign, CUT).verdict
    assert first.usable
    flip(stored(parts, campaign, AIR, NORMALISED))
    client.forget_recording(campaign, CUT)
    assert AIR in refused(500, client.upload, campaign, tmp_path / CUT).detail
    client.upload(campaign, tmp_path / AIR)
    assert client.upload(campaign, tmp_path / CUT).verdict == first
    flip(stored(parts, campaign, CUT, NORMALISED))
    client.forget_recording(campaign, AIR)
    verdict = client.recording(campaign, CUT).verdict
    assert (verdict.usable, "is damaged" in verdict.reasons[0]) == (False, True)
    client.upload(campaign, tmp_path / AIR)
    client.upload(campaign, tmp_path / CUT)
    assert client.recording(campaign, CUT).verdict == first


@pytest.mark.parametrize("other", ['{"verdict": {"usable": false}}', "[]", "nonsense", ""])
def test_a_damaged_verdict_is_told_and_heals(client, parts, campaign, tmp_path, other):
    """The file can still be had; the campaign says of that cut what has happened, and an upload of another cut is judged."""
    url = f"/v1/campaigns/{campaign}/recordings/{CUT}"
    before, usable = client.recording(campaign, CUT), client.campaign(campaign).usable
    with parts.store.writing() as connection:
        connection.execute(text("UPDATE recordings SET found = :other WHERE name = :name"), {"other": other, "name": CUT})
    words = f"the stored verdict on the recording {CUT} is damaged: its content is not what was stored; upload the same recording again"
    for path in (url, f"{url}/spectrum", f"/v1/campaigns/{campaign}/recordings"):
        answer = client.http.get(path)
        assert (answer.status_code, answer.json()["detail"][: len(words)]) == (500, words), path
    verdicts = {cut.cut.name: cut.verdict for cut in client.campaign(campaign).cuts}
    assert not verdicts[CUT].usable
    assert words in verdicts[CUT].reasons[0]
    assert client.http.get(f"{url}/file").content == (tmp_path / CUT).read_bytes()
    # the air cut again, which judges the cuts beside it
    client.forget_recording(campaign, AIR)
    client.upload(campaign, tmp_path / AIR)
    # to somebody who sends in parts it is not there
    assert client.http.head(f"/v1/campaigns/{campaign}/uploads/{CUT}", headers=SAYS).status_code == 404
    assert client.upload(campaign, tmp_path / CUT) == before
    assert client.recording(campaign, CUT) == before
    assert client.campaign(campaign).usable == usable


def test_damaged_summaries_are_told_and_heal(client, store, result):
    machine = client.make_machine("M").id
    client.identify(machine, result)
    client.write_tooling("T1", example())
    for table, other in (("identifications", '{"axes": []}'), ("toolings", "nonsense")):
        with store.writing() as connection:
            connection.execute(text(f"UPDATE {table} SET summary = :other"), {"other": other})
    words = "is damaged: its content is not what was stored; write the same tooling, robot or identification again"
    for call in (partial(client.machine, machine), lambda: list(client.toolings()), partial(client.lobes, machine, "T1")):
        assert words in refused(500, call).detail
    # their texts are whole, and written again they mend it
    text_of_tooling = client.tooling_file("T1")
    client.identify(machine, result)
    client.write_tooling("T1", text_of_tooling)
    assert client.machine(machine).identification.axes
    assert [each.name for each in client.toolings()] == ["T1"]
    # no version was needed for that
    assert [c.version for c in client.changes(kind="tooling")] == [1]


def test_a_damaged_summary_of_a_version_is_not_restored(client, store, result):
    machine = client.make_machine("M").id
    for each in (result, result.replace('"seed": 1', '"seed": 2')):
        client.identify(machine, each)
    with store.writing() as connection:
        connection.execute(text("UPDATE changes SET summary = '{\"axes\": []}' WHERE kind = 'identification' AND version = 1"))
    before = client.machine(machine)
    assert "is damaged" in refused(500, client.restore_identification, machine, 1).detail
    assert client.machine(machine) == before


def test_what_a_job_was_asked_is_what_it_does(client, store, campaign, tmp_path):
    id = client.identify_campaign(campaign, seed=7).id
    with store.writing() as connection:
        connection.execute(text("UPDATE jobs SET request = replace(request, '7', '8')"))
    carried(store, tmp_path)
    told = client.http.get(f"/v1/identifications/{id}").json()
    assert (told["state"], "request of the job" in told["problem"]["detail"]) == ("failed", True)


def test_an_identification_says_which_recording_is_damaged(client, store, parts, campaign, tmp_path):
    flip(stored(parts, campaign, CUT, NORMALISED))
    id = client.identify_campaign(campaign).id
    carried(store, tmp_path)
    told = client.http.get(f"/v1/identifications/{id}").json()
    assert told["state"] == "failed"
    assert "samples that are missing or damaged" in told["problem"]["detail"]


def test_a_backup_tells_of_damaged_samples(client, parts, campaign, tmp_path):
    harmed = stored(parts, campaign, CUT, NORMALISED)
    flip(harmed)
    os.link(tmp_path / "store.db", tmp_path / "service.db")
    parts.store.close()
    account = backup(tmp_path, tmp_path / "b.tar")
    assert account.damaged == (harmed.relative_to(tmp_path).as_posix(),)


def test_a_download_in_parts(client, campaign, tmp_path):
    url, raw = f"/v1/campaigns/{campaign}/recordings/{CUT}/file", (tmp_path / CUT).read_bytes()
    tag = f'"{hashlib.sha256(raw).hexdigest()}"'
    whole = client.http.get(url)
    assert (whole.headers["etag"], whole.headers["accept-ranges"], whole.headers["content-length"]) == (tag, "bytes", str(len(raw)))
    part = client.http.get(url, headers={"Range": "bytes=1000-1999", "If-Range": tag})
    assert (part.status_code, part.content, part.headers["etag"]) == (206, raw[1000:2000], tag)
    assert part.headers["content-range"] == f"bytes 1000-1999/{len(raw)}"
    assert client.http.get(url, headers={"Range": "bytes=-7"}).content == raw[-7:]
    # of another content the whole
    assert client.http.get(url, headers={"Range": "bytes=1000-1999", "If-Range": '"other"'}).content == raw
    beyond = client.http.get(url, headers={"Range": f"bytes={len(raw)}-"})
    assert (beyond.status_code, beyond.headers["content-range"]) == (416, f"bytes */{len(raw)}")
    for answer in (beyond, client.http.get(url, headers={"Range": "bytes=x"})):
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["status"] == answer.status_code


def test_a_file_is_hashed_once_for_parts_that_follow_each_other(parts, campaign, monkeypatch):
    path, seen, hashed = stored(parts, campaign, CUT, UPLOADS), [], hashlib.file_digest
    monkeypatch.setattr("hashlib.file_digest", lambda *each: (seen.append(each), hashed(*each))[1])
    assert all(parts.files.is_whole(path, path.name) for _ in range(5))
    assert len(seen) <= 1
    before = path.stat()
    flip(path)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert not parts.files.is_whole(path, path.name)


def spoiled(store, statement: str) -> None:
    with store.writing() as connection:
        assert connection.execute(text(statement)).rowcount == 1


@BOTH
def test_one_changed_digit_of_a_text_is_found(store, machine):
    """Results of jobs, identifications, toolings, their versions and declarations of campaigns; each sentence says what to do."""
    id = running(store, machine)
    store.jobs.finish(id, "w", Outcome("done", now(), texts={"result": '{"limit_mm": 1.25}'}))
    store.toolings.put(Document("A", "T1", "stickout 60.5", "{}", digest_of("stickout 60.5"), now()))
    declaration = store.campaigns.add(Campaign(new_id(), "A", machine, "C", '{"depth": 0.4}', 1, now()))
    spoiled(store, "UPDATE job_texts SET text = replace(text, '1.25', '1.26')")
    spoiled(store, "UPDATE toolings SET text = replace(text, '60.5', '65.0')")
    spoiled(store, "UPDATE changes SET text = replace(text, '60.5', '65.0') WHERE kind = 'tooling'")
    spoiled(store, "UPDATE campaigns SET text = replace(text, '0.4', '0.9')")
    for call, words in (
        (lambda: store.jobs.text(id, "result"), f"result of the job {id}.*ask for the job once more"),
        (lambda: store.toolings.get("A", "T1"), "tooling T1.*write it again"),
        (lambda: store.changes.get("A", "tooling", "T1", 1), "version 1 of T1"),
        (lambda: store.campaigns.get("A", declaration.id), "campaign C.*declare it again"),
    ):
        with pytest.raises(Damaged, match=words):
            call()
    # written again, it is whole; and what is damaged can be deleted
    store.toolings.put(Document("A", "T1", "stickout 60.5", "{}", digest_of("stickout 60.5"), now()))
    assert store.toolings.get("A", "T1").text == "stickout 60.5"
    assert store.campaigns.delete("A", declaration.id)


def test_damage_in_the_database_is_a_problem_document(client, store, shop):
    _, machine = shop
    spoiled(store, "UPDATE identifications SET text = replace(text, '1', '2')")
    answer = client.http.get(f"/v1/machines/{machine}/identification")
    assert (answer.status_code, answer.headers["content-type"]) == (500, "application/problem+json")
    assert "identification of the machine is damaged" in answer.json()["detail"]
    assert refused(500, client.lobes, machine, "T1").detail == answer.json()["detail"]


def test_a_campaign_whose_declaration_is_damaged_can_be_deleted(client, store, parts, campaign):
    spoiled(store, "UPDATE campaigns SET text = substr(text, 3)")
    assert "declaration of the campaign by hand is damaged" in refused(500, client.campaign, campaign).detail
    client.forget_campaign(campaign)
    refused(404, client.campaign, campaign)
    assert not [path for path in parts.files.folder.rglob("*") if path.is_file()]


@BOTH
def test_a_job_that_begins_from_damaged_text_says_so(store, machine, tmp_path):
    store.jobs.add(job(machine, kind="lobes"), {"question": "as it was asked"}, 9)
    spoiled(store, "UPDATE job_texts SET text = 'another question'")
    (id,) = (each.id for each in store.jobs.open())
    carried(store, tmp_path)
    assert "question of the job" in json.loads(store.jobs.find(id).problem)["detail"]


def folder_of_a_store(tmp_path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    with closing(open_store(f"sqlite:///{folder / 'service.db'}")) as store:
        for k in range(200):
            store.toolings.put(Document("A", f"T{k}", "x" * 3000, "{}", digest_of("x" * 3000), now()))
    return folder


def nonsense(path: Path) -> None:
    path.write_bytes(b"no database " * 1000)


def halved(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2 // 4096 * 4096)


def torn(path: Path) -> None:
    """Overwrite pages in the middle."""
    with path.open("r+b") as file:
        file.seek(path.stat().st_size // 2 // 4096 * 4096)
        file.write(b"\xff" * 3 * 4096)


@pytest.mark.parametrize("harm", [nonsense, halved, torn])
def test_a_destroyed_database_is_told_at_the_start_and_stays_as_it_is(tmp_path, harm):
    folder = folder_of_a_store(tmp_path)
    harm(folder / "service.db")
    left = (folder / "service.db").read_bytes()
    with pytest.raises(InputError, match=r"service.db, which is damaged.*restore a backup"):
        data_folder.check(folder)
    result = CliRunner().invoke(app, ["--data", str(folder), "create-key"])
    assert (result.exit_code, "which is damaged" in result.stderr) == (2, True)
    assert (folder / "service.db").read_bytes() == left


def test_a_lost_database_is_not_begun_anew_over_what_is_left(tmp_path):
    """A new one would call every recording an orphan, and remove it."""
    folder = folder_of_a_store(tmp_path)
    data_folder.check(folder)
    upload = folder / "files" / ("0" * 32) / "uploads" / ("0" * 64)
    upload.parent.mkdir(parents=True)
    upload.write_bytes(b"recording")
    for harm in (lambda path: path.write_bytes(b""), Path.unlink):
        harm(folder / "service.db")
        with pytest.raises(InputError, match=r"service.db is missing or empty"):
            data_folder.check(folder)
    upload.unlink()
    data_folder.check(folder)
    (folder / "jobs.db").write_bytes(b"no database " * 1000)
    with pytest.raises(InputError, match=r"service.db is missing or empty"):
        data_folder.check(folder)
    (folder / "service.db").write_bytes(b"")
    with closing(sqlite3.connect(folder / "service.db")) as database:
        database.execute("CREATE TABLE meta (schema_version INTEGER)")
    with pytest.raises(InputError, match=r"jobs.db, which is damaged.*or remove jobs.db"):
        data_folder.check(folder)


def test_a_database_that_is_destroyed_meanwhile(tmp_path):
    """503 with a sentence, and nothing more is written."""
    folder = folder_of_a_store(tmp_path)
    with closing(embedded(tmp_path)) as store, service(store, tmp_path) as http:
        http.put("/v1/toolings/T0", content=by_hand.TOOLING, headers={"Content-Type": "application/toml"})
        store.close()
        nonsense(tmp_path / "store.db")
        for each in ("store.db-wal", "store.db-shm"):
            (tmp_path / each).unlink(missing_ok=True)
        left = (tmp_path / "store.db").read_bytes()
        for method, path in (("GET", "/v1/toolings/T0"), ("GET", "/ready"), ("POST", "/v1/machines")):
            answer = http.request(method, path, json={"name": "M"} if method == "POST" else None)
            assert (answer.status_code, answer.headers["retry-after"]) == (503, "600")
            assert answer.json()["detail"].startswith("the database is damaged, and nothing more is written to it")
        assert (tmp_path / "store.db").read_bytes() == left
    torn(folder / "service.db")
    with closing(open_store(f"sqlite:///{folder / 'service.db'}")) as store:
        with pytest.raises(Destroyed):
            [store.toolings.get("A", f"T{k}") for k in range(200)]
        with pytest.raises(Destroyed):
            store.machines.add(Machine(new_id(), "A", "M", "", now()))
