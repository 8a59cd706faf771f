"""Backup of a data folder while the service runs."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sqlite3
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

from api.backups.members import BLOCK, ENGINE, FILES, FORMAT, MANIFEST, STORE, Account, copy, disk
from api.files import NORMALISED, UPLOADS, Files, sync_folder
from api.processes import held
from api.stores.sql import open_store
from rcsa_ident.base.errors import InputError
from rcsa_ident.version import __version__

_STAGING = ".backup-"


def backup(data: Path, target: Path) -> Account:
    """Write a backup of a data folder, which a service may be using.

    Raises `InputError`: there is no store, the target exists, or the disk fails.
    """
    if not (data / STORE).is_file():
        raise InputError("RCSA_IDENT_DATA", f"no {STORE}", "the data folder of a service")
    if target.exists() or target.is_symlink():
        raise InputError("FILE.tar", f"{target.name}, which exists already", "the name of a new file")
    if not target.absolute().parent.is_dir():
        raise InputError("FILE.tar", "no such folder", "a file in an existing folder")
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    with disk("FILE.tar"), _alone(data) as staging:
        wanted = _gather(data, staging)
        try:
            # readable by the owner only
            with open(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "wb") as file:
                account = _write(file, staging, wanted)
                file.flush()
                os.fsync(file.fileno())
            _name(part, target)
            sync_folder(target.absolute().parent)
        finally:
            part.unlink(missing_ok=True)
    return account


def _name(part: Path, target: Path) -> None:
    """Give the file its name without replacing another."""
    try:
        os.link(part, target)
    except FileExistsError:
        raise InputError("FILE.tar", f"{target.name}, which exists already", "the name of a new file") from None
    except (AttributeError, OSError):
        # a system or a file system without hard links
        os.rename(part, target)


@contextmanager
def _alone(data: Path) -> Iterator[Path]:
    """Staging folder on the data's own disk, for one backup at a time; remains of a killed backup are removed."""
    with held(data / "backup.lock") as first:
        if not first:
            raise InputError("RCSA_IDENT_DATA", "another backup in progress", "one at a time")
        for old in data.glob(f"{_STAGING}*"):
            shutil.rmtree(old, ignore_errors=True)
        staging = Path(tempfile.mkdtemp(prefix=_STAGING, dir=data))
        try:
            yield staging
        finally:
            shutil.rmtree(staging, ignore_errors=True)


def _gather(data: Path, staging: Path) -> dict[str, str]:
    """Make snapshots of the databases and links to all files that their rows refer to; return these with their SHA-256."""
    wanted: dict[str, str] = {}
    for _ in range(5):
        # links before the snapshot keep files that are deleted after it; links after it include those that arrived just before it
        _link(data / FILES, staging / FILES)
        if (data / ENGINE).is_file():
            _snapshot(data / ENGINE, staging / ENGINE)
        _snapshot(data / STORE, staging / STORE)
        _link(data / FILES, staging / FILES)
        wanted = _referred(staging)
        if all((staging / name).is_file() for name in wanted):
            break
    for path in [path for path in (staging / FILES).rglob("*") if path.is_file()]:
        if path.relative_to(staging).as_posix() not in wanted:
            path.unlink()
    return wanted


def _link(source: Path, target: Path) -> None:
    for kind in (UPLOADS, NORMALISED):
        for folder in source.glob(f"*/{kind}"):
            there = target / folder.relative_to(source)
            there.mkdir(parents=True, exist_ok=True)
            for entry in os.scandir(folder):
                # deleted meanwhile, or already linked
                with suppress(FileNotFoundError, FileExistsError):
                    try:
                        os.link(entry.path, there / entry.name)
                    except (AttributeError, PermissionError):
                        # a system or a file system without hard links
                        shutil.copyfile(entry.path, there / entry.name)


def _snapshot(source: Path, target: Path) -> None:
    """Snapshot of a database in one file."""
    target.unlink(missing_ok=True)
    try:
        with closing(sqlite3.connect(source, timeout=30.0)) as live, closing(sqlite3.connect(target)) as copy:
            live.backup(copy)
            copy.execute("PRAGMA journal_mode=DELETE")
    except sqlite3.Error:
        raise InputError("RCSA_IDENT_DATA", f"{source.name} does not answer", "a database of this service") from None


def _referred(folder: Path) -> dict[str, str]:
    """Files that rows refer to, with their SHA-256, empty where it is not known."""
    store = open_store(f"sqlite:///{folder / STORE}")
    try:
        files = Files(folder / FILES)
        found = {(group, *key): sha256 for group in store.recordings.groups() for key, sha256 in store.recordings.kept(group).items()}
        return {files.path(*each).relative_to(folder).as_posix(): sha256 for each, sha256 in found.items() if each[2]}
    finally:
        store.close()
        # without a separate WAL file
        with closing(sqlite3.connect(folder / STORE)) as database:
            database.execute("PRAGMA journal_mode=DELETE")


def _write(file: BinaryIO, staging: Path, wanted: dict[str, str]) -> Account:
    files = sorted(path.relative_to(staging).as_posix() for path in (staging / FILES).rglob("*") if path.is_file())
    names = [name for name in (STORE, ENGINE) if (staging / name).is_file()] + files
    members: dict[str, dict[str, Any]] = {}
    for name in names:
        with (staging / name).open("rb") as source:
            members[name] = _add(file, name, source, os.fstat(source.fileno()).st_size)
    missing = tuple(sorted(wanted.keys() - members.keys()))
    damaged = tuple(name for name, each in members.items() if wanted.get(name) and wanted[name] != each["sha256"])
    manifest = {
        "format": FORMAT,
        "release": __version__,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "members": members,
        "missing": missing,
    }
    with tempfile.TemporaryFile() as source:
        source.write(json.dumps(manifest, indent=1).encode())
        size = source.tell()
        source.seek(0)
        _add(file, MANIFEST, source, size)
    file.write(bytes(2 * BLOCK))
    return Account(len(members), sum(each["bytes"] for each in members.values()), missing, damaged)


def header(name: str, size: int) -> bytes:
    """Return the header block of a member: POSIX's, with GNU's binary size where octal digits do not suffice.

    Of the formats of `tarfile` none serves alone: names of files have 111 to 117 characters, which its GNU and PAX formats put into a
    member of their own, and a restore takes no other members; its POSIX format splits them, and knows no size of 8 GiB.
    """
    info = tarfile.TarInfo(name)
    info.mode, info.size = 0o600, size if size < 8**11 else 0
    block = bytearray(info.tobuf(tarfile.USTAR_FORMAT))
    if size >= 8**11:
        block[124:136] = b"\x80" + size.to_bytes(11, "big")
        block[148:156] = b" " * 8
        block[148:156] = b"%06o\0 " % sum(block)
    return bytes(block)


def _add(file: BinaryIO, name: str, source: Any, size: int) -> dict[str, Any]:
    file.write(header(name, size))
    digest = hashlib.sha256()
    copy(source, file, size, digest)
    file.write(bytes(-size % BLOCK))
    return {"bytes": size, "sha256": digest.hexdigest()}
