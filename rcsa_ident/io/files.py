"""Files as a whole: what a reader may open, and writing that leaves the old file or the new one, never half of either."""

from __future__ import annotations

import mmap
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rcsa_ident.base.errors import InputError

MEGABYTE = 1_000_000
#: Bytes of a file, read or mapped: slices of either are bytes.
Bytes = bytes | mmap.mmap


def existing_file(path: str | Path, field: str, largest: int) -> Path:
    """Return `path` if it is a regular file of at most `largest` bytes, else raise `InputError`.

    `field`: what the file is, for the message
    `largest`: bytes that are allowed
    """
    path = Path(path)
    try:
        found = "a folder" if path.is_dir() else None if path.is_file() else "no such file"
        size = path.stat().st_size if found is None else 0
    except (OSError, ValueError):
        found, size = "a path that cannot be opened", 0
    if found is not None:
        raise InputError(field, found, "an existing file", str(path))
    if size > largest:
        raise InputError(field, f"{size / MEGABYTE:.0f} MB", f"at most {largest / MEGABYTE:.0f} MB", str(path))
    if size == 0:
        raise InputError(field, "an empty file", "a file that is not empty", str(path))
    return path


def read_bytes(path: str | Path, field: str, largest: int) -> bytes:
    """Return the file's bytes; a file that is missing, empty, too large or not readable raises `InputError`.

    `field`: what the file is, for the message
    `largest`: bytes that are allowed
    """
    path = existing_file(path, field, largest)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(field, error.strerror or "an error on reading", "a file that can be read", str(path)) from None


def mapped(path: str | Path, field: str, largest: int) -> Bytes:
    """Return the file's bytes as `read_bytes`, but none of them is in memory before it is looked at.

    `field`: what the file is, for the message
    `largest`: bytes that are allowed
    """
    path = existing_file(path, field, largest)
    try:
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        found = getattr(error, "strerror", None) or "an error on reading"
        raise InputError(field, found, "a file that can be read", str(path)) from None


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; at the end it takes the place of `path`, after an error it is gone."""
    path = Path(path)
    part = path.with_name(f".{path.name}.{secrets.token_hex(6)}.part")
    try:
        yield part
        with part.open("rb+") as written:
            os.fsync(written.fileno())
        os.replace(part, path)
    except OSError as error:
        raise InputError("output file", error.strerror or str(error), "a place that can be written to", str(path)) from None
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def filling(folder: str | Path, field: str = "output folder") -> Iterator[Path]:
    """Yield a temporary folder; at the end what is in it goes into `folder`, after an error it is gone and `folder` as it was.

    `folder`: made with the folders around it if it is missing; its files of the same names are replaced
    `field`: what the folder is, for the message
    Raises `InputError` before anything is computed where nothing could be written.
    """
    folder = Path(folder).absolute()
    # the folders around it are made at the end, too
    there = next(each for each in (folder, *folder.parents) if each.exists())
    if not (there.is_dir() and os.access(there, os.W_OK)):
        found = "a folder without permission to write" if there.is_dir() else f"a file, {there.name}"
        raise InputError(field, found, "a folder that can be written to", str(folder))
    part = (there.parent if there == folder and os.access(there.parent, os.W_OK) else there) / f".{folder.name}.{secrets.token_hex(6)}.part"
    try:
        with _writing(field, folder):
            part.mkdir()
        yield part
        with _writing(field, folder):
            for path in [part, *sorted(part.rglob("*"))]:
                into = folder / path.relative_to(part)
                if path.is_dir():
                    into.mkdir(parents=True, exist_ok=True)
                else:
                    os.replace(path, into)
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _writing(field: str, folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(field, error.strerror or str(error), "a folder that can be written to", str(folder)) from None


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text with newlines as they are, all or nothing."""
    with replacing(path) as part:
        part.write_bytes(text.encode("utf-8"))
