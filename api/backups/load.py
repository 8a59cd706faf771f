"""Restoring of a backup, whose content is not trusted."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import sqlite3
import tarfile
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any, BinaryIO

from api.backups.members import BLOCK, ENGINE, FORMAT, MANIFEST, MEMBER, STORE, Account, copy, disk
from api.files import sync_folder
from api.stores.database import version_in
from rcsa_ident.base.errors import InputError

_LARGEST_MANIFEST = 1 << 28


def restore(source: Path, data: Path) -> Account:
    """Restore a backup into a data folder.

    Raises `InputError`: the folder is not empty, or the file is not a complete backup that this release can read.
    """
    if data.is_symlink() or (data.exists() and not (data.is_dir() and not any(data.iterdir()))):
        raise InputError("--data", f"{data.name} which is not empty", "a folder that is empty or does not exist yet")
    with disk("--data"):
        data.absolute().parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{data.name}.restoring-", dir=data.absolute().parent))
        try:
            account = _extract(source, temporary)
            _check(temporary)
            for folder in (path for path in (temporary, *temporary.rglob("*")) if path.is_dir()):
                sync_folder(folder)
            _place(temporary, data.absolute())
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    return account


def _extract(source: Path, folder: Path) -> Account:
    """Extract every member to the path that the manifest gives it."""
    if not source.is_file():
        raise InputError("FILE.tar", "no such file", "a backup of this service")
    found: dict[str, dict[str, Any]] = {}
    with source.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        while (info := _header(file, size)) is not None:
            if info.name in found or MANIFEST in found:
                raise _no_backup(f"{info.name} twice, or behind the manifest")
            path = folder / info.name
            path.parent.mkdir(parents=True, exist_ok=True)
            digest = hashlib.sha256()
            with path.open("xb") as target:
                copy(file, target, info.size, digest)
                target.flush()
                os.fsync(target.fileno())
            file.seek(-info.size % BLOCK, os.SEEK_CUR)
            found[info.name] = {"bytes": info.size, "sha256": digest.hexdigest()}
    manifest = _manifest(folder / MANIFEST)
    found.pop(MANIFEST)
    if manifest["members"] != found or STORE not in found:
        wrong = sorted(name for name in {*manifest["members"], *found} if manifest["members"].get(name) != found.get(name))
        raise _no_backup(f"other content than its manifest has: {', '.join(wrong[:3]) or STORE}")
    (folder / MANIFEST).unlink()
    return Account(len(found), sum(each["bytes"] for each in found.values()), tuple(manifest["missing"]))


def _header(file: BinaryIO, size: int) -> tarfile.TarInfo | None:
    """Header of the next member, None at the end; long names, links and sparse files are refused."""
    block = file.read(BLOCK)
    if block == bytes(BLOCK):
        return None
    try:
        info = tarfile.TarInfo.frombuf(block, "ascii", "strict")
    except (tarfile.HeaderError, ValueError):
        raise _no_backup("something else, or an end too early") from None
    if info.type not in (tarfile.REGTYPE, tarfile.AREGTYPE) or info.linkname or not MEMBER.fullmatch(info.name):
        raise _no_backup(f"a member {info.name[:80]!r}")
    if not 0 <= info.size <= size - file.tell() or (info.name == MANIFEST and info.size > _LARGEST_MANIFEST):
        raise _no_backup(f"{info.name} of {info.size} bytes")
    return info


def _manifest(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise _no_backup("no manifest: it was not written to the end")
    try:
        manifest = json.loads(path.read_bytes())
        format, missing = int(manifest["format"]), manifest["missing"]
        if format > FORMAT:
            raise InputError(
                "FILE.tar", f"format {format}, of release {str(manifest['release'])[:20]}", f"at most {FORMAT}: take that release"
            )
        if not isinstance(manifest["members"], dict) or not all(isinstance(name, str) for name in missing):
            raise TypeError
    except InputError:
        raise
    except (ValueError, TypeError, KeyError, RecursionError):
        raise _no_backup("a manifest that cannot be read") from None
    return dict(manifest)


def _check(folder: Path) -> None:
    """Check that the databases are intact, and of a version that this release knows."""
    for name in (STORE, ENGINE):
        if (folder / name).is_file():
            try:
                with closing(sqlite3.connect(folder / name)) as database:
                    ((state,), *_) = database.execute("PRAGMA quick_check").fetchall()
                    if state != "ok":
                        raise sqlite3.DatabaseError(state)
                if name == STORE and not version_in(folder / name):
                    raise ValueError
            except InputError as error:
                raise InputError("FILE.tar", error.found, error.allowed) from None
            except (sqlite3.Error, ValueError):
                raise _no_backup(f"{name} that is no whole database") from None


def _place(folder: Path, data: Path) -> None:
    """Rename the folder to its final name."""
    try:
        os.rename(folder, data)
    except OSError as error:
        if error.errno not in (errno.EBUSY, errno.EXDEV):
            raise
        # the folder is a mount point: the database, which makes it a store, comes last
        inside = data / folder.name
        shutil.copytree(folder, inside)
        for name in sorted(os.listdir(inside), key=lambda each: each == STORE):
            os.rename(inside / name, data / name)
        inside.rmdir()
        sync_folder(data)
    sync_folder(data.parent)


def _no_backup(found: str) -> InputError:
    return InputError("FILE.tar", found, "a complete backup of this service")
