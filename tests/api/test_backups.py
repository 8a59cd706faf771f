"""Backup while somebody writes, restore, and files that claim to be backups."""

from __future__ import annotations

import io
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import tarfile
import threading
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from api.backups import save
from api.backups.load import restore
from api.backups.save import backup
from api.client import Client
from api.files import NORMALISED, UPLOADS, Files
from api.serve import app
from api.stores.entities import Document
from api.stores.migrations import SCHEMA_VERSION
from api.stores.sql import open_store
from rcsa_ident.base.errors import InputError
from tests.api.in_process import service
from tests.api.recordings import content, declared
from tests.fixtures import by_hand


@pytest.fixture
def data(tmp_path, result):
    """The folder of a service with a machine, a tooling, a key, a campaign, and its recordings."""
    folder = tmp_path / "data"
    folder.mkdir()
    store = open_store(f"sqlite:///{folder / 'service.db'}")
    with service(store, folder) as http:
        client = Client(http=http)
        machine = client.make_machine("HPM 800U").id
        client.identify(machine, result)
        client.write_tooling("T1", by_hand.TOOLING)
        campaign = client.make_campaign(machine, declared()).id
        for name, air in (("c0_cut.h5", False), ("c0_air.h5", True)):
            (tmp_path / name).write_bytes(content(tmp_path, air=air))
            client.upload(campaign, tmp_path / name)
    store.close()
    with closing(sqlite3.connect(folder / "jobs.db")) as engine, engine:
        engine.execute("CREATE TABLE steps (name TEXT)")
        engine.execute("INSERT INTO steps VALUES ('search 1')")
    return folder


def answers(folder: Path, scratch: Path) -> list[object]:
    """Everything that a service on a folder tells."""
    store = open_store(f"sqlite:///{folder / 'service.db'}")
    with service(store, folder) as http:
        client = Client(http=http)
        (machine,) = client.machines()
        (campaign,) = client.campaigns(machine.id)
        told: list[object] = [machine, campaign, client.campaign(campaign.id), client.modes(machine.id), client.tooling_file("T1")]
        for each in client.recordings(campaign.id):
            client.recording_file(campaign.id, each.name, scratch)
            told += [each, scratch.read_bytes(), client.signal(campaign.id, each.name)]
        told.append(client.lobes(machine.id, "T1", recommend=False, speeds={"from_rpm": 9000, "to_rpm": 10000, "step_rpm": 500}))
    store.close()
    return told


@pytest.mark.slow
def test_a_restored_service_answers_as_the_other_did(data, tmp_path):
    expected = answers(data, tmp_path / "scratch")
    account = backup(data, tmp_path / "b.tar")
    assert account.missing == account.damaged == ()
    # two databases, two uploads and what was read from each
    assert account.files == 6
    assert oct((tmp_path / "b.tar").stat().st_mode & 0o777) == "0o600"
    assert sorted(path.name for path in data.iterdir()) == ["backup.lock", "files", "jobs.db", "kernels", "service.db"]
    new = tmp_path / "deep" / "new"
    assert restore(tmp_path / "b.tar", new) == account
    assert answers(new, tmp_path / "scratch") == expected
    with closing(sqlite3.connect(new / "jobs.db")) as engine:
        assert engine.execute("SELECT name FROM steps").fetchall() == [("search 1",)]
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["new"]
    # a plain tar to any other program
    with tarfile.open(tmp_path / "b.tar") as tar:
        assert tar.getnames()[:2] == ["service.db", "jobs.db"]
        assert tar.getnames()[-1] == "manifest.json"


@pytest.mark.slow
def test_while_somebody_writes(tmp_path):
    """A backup is the store at one moment: of toolings written one after the other a first part, and every file that a row refers to."""
    folder = tmp_path / "data"
    folder.mkdir()
    store, files = open_store(f"sqlite:///{folder / 'service.db'}"), Files(folder / "files")
    over = threading.Event()
    written = 0

    def write() -> None:
        nonlocal written
        while not over.is_set():
            name = f"T{written:05d}"
            store.toolings.put(Document("g", name, name * 100, "{}", name, "now"))
            part = files.part("g")
            part.write(name.encode())
            part.sync()
            part.close()
            with files.lock:
                files.keep("g", UPLOADS, part.sha256(), part.path)
            written += 1

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for i in range(4):
            while written < 20 * (i + 1):
                pass
            before = written
            backup(folder, tmp_path / f"{i}.tar")
            after = written
            restore(tmp_path / f"{i}.tar", tmp_path / f"new{i}")
            there = open_store(f"sqlite:///{tmp_path / f'new{i}' / 'service.db'}")
            names = [row.name for row in there.toolings.list("g", "", 10**6)]
            there.close()
            assert names == [f"T{k:05d}" for k in range(len(names))]
            assert before <= len(names) <= after + 1
    finally:
        over.set()
        writer.join()
        store.close()


def test_files_that_come_and_go_meanwhile(data, tmp_path, monkeypatch):
    """What is deleted behind the snapshot is in it; what comes behind it is not, and needs no file."""
    store = open_store(f"sqlite:///{data / 'service.db'}")
    snapshot, files = save._snapshot, Files(data / "files")
    gone = [path for path in (data / "files").rglob("*") if path.is_file()]

    def busy(source: Path, target: Path) -> None:
        snapshot(source, target)
        if source.name == "service.db":
            for path in gone:
                path.unlink(missing_ok=True)
            files.path("local", UPLOADS, "f" * 64).write_bytes(b"late")

    monkeypatch.setattr(save, "_snapshot", busy)
    account = backup(data, tmp_path / "b.tar")
    store.close()
    assert account.missing == ()
    restore(tmp_path / "b.tar", tmp_path / "new")
    kept = {path.relative_to(tmp_path / "new") for path in (tmp_path / "new" / "files").rglob("*") if path.is_file()}
    assert kept == {path.relative_to(data) for path in gone}


def test_what_is_missing_or_damaged_is_told(data, tmp_path):
    uploads = sorted(path for path in (data / "files").rglob("*") if path.parent.name == UPLOADS)
    uploads[0].unlink()
    uploads[1].write_bytes(b"rot")
    result = CliRunner().invoke(app, ["--data", str(data), "backup", str(tmp_path / "b.tar")])
    assert result.exit_code == 0, result.output
    assert f"warning: {uploads[0].relative_to(data)} is missing, though referred to" in result.stderr
    assert f"warning: {uploads[1].relative_to(data)} is not what was stored any more" in result.stderr
    assert len(restore(tmp_path / "b.tar", tmp_path / "new").missing) == 1


@pytest.mark.slow
@pytest.mark.parametrize("member", [1, 2, 4, 7])
def test_killed_at_any_member_nothing_has_the_name_of_a_backup(data, tmp_path, member):
    code = f"""
import os, sys
from pathlib import Path
from api.backups import save
add, count = save._add, 0
def counted(*arguments):
    global count
    count += 1
    found = add(*arguments)
    if count == {member}:
        os._exit(9)
    return found
save._add = counted
save.backup(Path(sys.argv[1]), Path(sys.argv[2]))
"""
    target = tmp_path / "b.tar"
    assert subprocess.run([sys.executable, "-c", code, str(data), str(target)], check=False).returncode == 9
    assert not target.exists()
    (part,) = tmp_path.glob(".b.tar.*.part")
    with pytest.raises(InputError, match="complete backup"):
        restore(part, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    # what the dead one has left in the data folder is gone with the next
    backup(data, target)
    assert sorted(path.name for path in data.iterdir()) == ["backup.lock", "files", "jobs.db", "kernels", "service.db"]
    restore(target, tmp_path / "new")


@pytest.mark.slow
def test_an_error_on_the_way_leaves_nothing(data, tmp_path, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(save, "_add", full)
    with pytest.raises(InputError, match="No space left"):
        backup(data, tmp_path / "b.tar")
    assert not list(tmp_path.glob("*b.tar*"))


def test_two_at_once(data, tmp_path, monkeypatch):
    write = save._write

    def again(*arguments: object) -> object:
        with pytest.raises(InputError, match="one at a time"):
            backup(data, tmp_path / "other.tar")
        # somebody else was quicker with the name
        (tmp_path / "b.tar").write_text("mine")
        return write(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(save, "_write", again)
    with pytest.raises(InputError, match="exists already"):
        backup(data, tmp_path / "b.tar")
    assert (tmp_path / "b.tar").read_text() == "mine"


def made(path: Path, members: list[tuple[tarfile.TarInfo, bytes]]) -> Path:
    with tarfile.open(
        path, "w", format=tarfile.USTAR_FORMAT if max(len(info.name) for info, _ in members) < 200 else tarfile.GNU_FORMAT
    ) as tar:
        for info, body in members:
            info.size = len(body) if info.isreg() else 0
            tar.addfile(info, io.BytesIO(body) if info.isreg() else None)
    return path


def member(name: str, kind: bytes = tarfile.REGTYPE, link: str = "") -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type, info.linkname = kind, link
    return info


HASH = "0" * 64


@pytest.mark.parametrize(
    "info",
    [
        member("../service.db"), member("/etc/passwd"), member("files/../../x"), member(f"files/{'0' * 32}/uploads/../{HASH}"),
        member(f"files/{'0' * 32}/{NORMALISED}/{HASH}"), member(f"files/{'0' * 32}/parts/{HASH}"), member("service.db/"), member("x" * 300),
        member("service.db", tarfile.SYMTYPE, "/etc/passwd"), member("service.db", tarfile.LNKTYPE, "jobs.db"),
        member("service.db", tarfile.CHRTYPE), member("service.db", tarfile.FIFOTYPE), member("files", tarfile.DIRTYPE),
        member("service.db", tarfile.GNUTYPE_SPARSE), member("service.db", tarfile.XHDTYPE), member("service.db-wal"), member("sérvice.db"),
    ],
    ids=lambda info: f"{info.name[:20]}-{info.type.decode()}",
)  # fmt: skip
def test_members_that_no_backup_has(tmp_path, info):
    before = set(tmp_path.iterdir())
    tar = made(tmp_path / "b.tar", [(info, b"{}" if info.isreg() else b"")])
    with pytest.raises(InputError, match="complete backup"):
        restore(tar, tmp_path / "new")
    assert set(tmp_path.iterdir()) - before == {tar}


def rewritten(source: Path, target: Path, change) -> Path:
    """A backup whose members have been changed."""
    with tarfile.open(source) as tar:
        members = [(member(each.name), tar.extractfile(each).read()) for each in tar]
    return made(target, change(members))


def of_format(number):
    def change(members):
        manifest = json.loads(members[-1][1]) | {"format": number, "release": "9.9"}
        return [*members[:-1], (members[-1][0], json.dumps(manifest).encode())]

    return change


def of_schema(members):
    path = Path(os.environ["SCRATCH"])
    path.write_bytes(members[0][1])
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE alembic_version SET version_num = '99'")
    return matching([(members[0][0], path.read_bytes()), *members[1:]])


def matching(members):
    """With a manifest that fits."""
    import hashlib

    manifest = json.loads(members[-1][1])
    manifest["members"] = {info.name: {"bytes": len(body), "sha256": hashlib.sha256(body).hexdigest()} for info, body in members[:-1]}
    return [*members[:-1], (members[-1][0], json.dumps(manifest).encode())]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda members: members[1:], "service.db"),
        (lambda members: members[:-2] + members[-1:], "other content than its manifest"),
        (lambda members: members[:-1], "not written to the end"),
        (lambda members: [*members, members[0]], "twice"),
        (lambda members: [members[-1], *members[:-1]], "behind the manifest"),
        (lambda members: [(members[0][0], members[0][1] + b"x"), *members[1:]], "other content"),
        (lambda members: [*members[:-1], (members[-1][0], b"[" * 100_000)], "manifest that cannot be read"),
        (lambda members: [*members[:-1], (members[-1][0], b'{"format": 1}')], "manifest that cannot be read"),
        (lambda members: matching([(members[0][0], b"no database" * 1000), *members[1:]]), "no whole database"),
        (of_format(2), "format 2, of release 9.9"),
        (of_schema, f"at most {SCHEMA_VERSION}: a later release"),
    ],
)
def test_other_content(data, tmp_path, monkeypatch, change, words):
    monkeypatch.setenv("SCRATCH", str(tmp_path / "scratch"))
    backup(data, tmp_path / "b.tar")
    tar = rewritten(tmp_path / "b.tar", tmp_path / "c.tar", change)
    with pytest.raises(InputError, match=words):
        restore(tar, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    assert not list(tmp_path.glob(".new*"))


@pytest.mark.parametrize("size", [0, 8**11 - 1, 8**11, 10**12 + 7])
def test_sizes_beyond_octal_digits(size):
    name = f"files/{'0' * 32}/{NORMALISED}/{HASH}.h5"
    info = tarfile.TarInfo.frombuf(save.header(name, size), "ascii", "strict")
    assert (info.name, info.size, info.type) == (name, size, tarfile.REGTYPE)


@pytest.mark.skipif(shutil.which("tar") is None, reason="there is no tar")
def test_other_programs_read_a_member_beyond_octal_digits(tmp_path):
    """Of a file with a hole, so that nothing of that size is written."""
    name, size = f"files/{'0' * 32}/{NORMALISED}/{HASH}.h5", 8**11 + 5
    with (tmp_path / "b.tar").open("wb") as file:
        file.write(save.header(name, size))
        file.truncate(512 + size + -size % 512 + 1024)
    told = subprocess.run(["tar", "-tvf", tmp_path / "b.tar"], capture_output=True, text=True, check=True).stdout.split()
    assert (told[2], told[-1]) == (str(size), name)
    with tarfile.open(tmp_path / "b.tar") as tar:
        assert [(each.name, each.size) for each in tar] == [(name, size)]


def contents(folder: Path) -> dict[Path, bytes]:
    return {path.relative_to(folder): path.read_bytes() for path in (folder / "files").rglob("*") if path.is_file()}


def test_a_file_that_grows_meanwhile(data, tmp_path, monkeypatch):
    """What it had when it was opened is in the backup, in pieces of bounded size."""
    wanted, copied, pieces = contents(data), save.copy, []

    class Counted:
        def __init__(self, file):
            self.file = file

        def read(self, size):
            pieces.append(size)
            return self.file.read(size)

    def growing(source, target, size, digest):
        # the manifest's file has no name
        if isinstance(source.name, str):
            with open(source.name, "ab") as file:
                file.write(b"later")
        copied(Counted(source), target, size, digest)

    monkeypatch.setattr(save, "copy", growing)
    monkeypatch.setattr("api.backups.members.CHUNK", 4096)
    assert backup(data, tmp_path / "b.tar").damaged == ()
    assert contents(data) != wanted
    assert max(pieces) == 4096
    restore(tmp_path / "b.tar", tmp_path / "new")
    assert contents(tmp_path / "new") == wanted


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0.0, 1.0, exclude_max=True), cut=st.booleans())
def test_a_byte_more_or_less(small, place, cut):
    """Cut off anywhere or with any byte changed: nothing is restored, or everything."""
    folder, whole = small
    at = int(place * len(whole))
    (folder / "c.tar").write_bytes(whole[:at] if cut else whole[:at] + bytes([whole[at] ^ 0x20]) + whole[at + 1 :])
    new = folder / "new"
    try:
        account = restore(folder / "c.tar", new)
    except InputError:
        assert not new.exists()
        return
    assert account.files == 1
    with closing(sqlite3.connect(new / "service.db")) as database:
        assert database.execute("SELECT count(*) FROM machines").fetchall() == [(0,)]
    for path in new.iterdir():
        path.unlink()
    new.rmdir()


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The backup of an empty store."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "data").mkdir()
    open_store(f"sqlite:///{folder / 'data' / 'service.db'}").close()
    backup(folder / "data", folder / "b.tar")
    return folder, (folder / "b.tar").read_bytes()


def test_what_is_refused(data, tmp_path, small):
    whole = small[0] / "b.tar"
    full, link = tmp_path / "full", tmp_path / "link"
    full.mkdir()
    (full / "x").touch()
    link.symlink_to(tmp_path / "elsewhere")
    for new in (full, link, full / "x"):
        with pytest.raises(InputError, match="--data"):
            restore(whole, new)
    empty = tmp_path / "empty"
    empty.mkdir()
    restore(whole, empty)
    with pytest.raises(InputError, match="no such file"):
        restore(tmp_path / "none.tar", tmp_path / "new")
    with pytest.raises(InputError, match=r"no service\.db"):
        backup(full, tmp_path / "b.tar")
    with pytest.raises(InputError, match="exists already"):
        backup(data, full / "x")
    with pytest.raises(InputError, match="no such folder"):
        backup(data, tmp_path / "nowhere" / "b.tar")


@pytest.mark.slow
def test_commands(data, tmp_path, small):
    run = CliRunner().invoke
    made = run(app, ["--data", str(data), "backup", str(tmp_path / "b.tar")])
    assert (made.exit_code, made.stdout.split(": ")[1].split(",")[0]) == (0, "6 files")
    assert run(app, ["restore", str(tmp_path / "b.tar"), "--data", str(tmp_path / "new")]).exit_code == 0
    assert (tmp_path / "new" / "service.db").is_file()
    again = run(app, ["restore", str(tmp_path / "b.tar"), "--data", str(tmp_path / "new")])
    assert (again.exit_code, "which is not empty" in again.stderr) == (2, True)
    elsewhere = {"RCSA_IDENT_DATABASE": "postgresql+psycopg://u:secret@h/n"}
    other = run(app, ["--data", str(data), "backup", str(tmp_path / "c.tar")], env=elsewhere)
    assert (other.exit_code, "pg_dump" in other.stderr, "secret" in other.stderr) == (2, True, False)
