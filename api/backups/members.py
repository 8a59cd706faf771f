"""Members of a backup."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from api.files import NORMALISED, UPLOADS
from rcsa_ident.base.errors import InputError

STORE, ENGINE, MANIFEST, FILES = "service.db", "jobs.db", "manifest.json", "files"
FORMAT, BLOCK, CHUNK = 1, 512, 1 << 20
MEMBER = re.compile(rf"service\.db|jobs\.db|manifest\.json|files/[0-9a-f]{{32}}/({UPLOADS}/[0-9a-f]{{64}}|{NORMALISED}/[0-9a-f]{{64}}\.h5)")


@dataclass(frozen=True, slots=True)
class Account:
    """Summary of a backup or of its restoring.

    `files`, `bytes`: of all members together
    `missing`: files that rows refer to but that do not exist
    `damaged`: files whose content does not match its hash any more
    """

    files: int
    bytes: int
    missing: tuple[str, ...] = ()
    damaged: tuple[str, ...] = ()


@contextmanager
def disk(field: str) -> Iterator[None]:
    """Turn errors of the disk into `InputError`."""
    try:
        yield
    except OSError as error:
        raise InputError(field, error.strerror or "a disk error", "a writable disk with enough free space") from None


def copy(source: Any, target: Any, size: int, digest: Any) -> None:
    while size > 0:
        data = source.read(min(size, CHUNK))
        if not data:
            raise InputError("FILE.tar", "a file that has become shorter", "files that do not change, and a complete backup")
        digest.update(data)
        target.write(data)
        size -= len(data)
