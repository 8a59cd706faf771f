"""The one door to a recording's files and to what was found in it: each is what was written, to the last bit, or is not handed out."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from api.files import NORMALISED, UPLOADS, Files, sha256_of
from api.stores.campaigns import Recording
from api.stores.entities import Damaged, digest_of, whole
from rcsa_ident.base.errors import InputError

_MEND = "upload the same recording again"


def upload_of(files: Files, recording: Recording) -> Path:
    """Return the file of a recording as it was uploaded; raises `Damaged` where it is missing or has changed."""
    return _whole(files, recording, UPLOADS, recording.sha256, recording.sha256)


def samples_of(files: Files, recording: Recording) -> Path:
    """Return the samples that were read from a recording; raises `Damaged` where they are missing or have changed."""
    return _whole(files, recording, NORMALISED, recording.normalised, recording.samples)


def found_of(recording: Recording) -> dict[str, Any]:
    """Return what was found in a recording, its verdict with it; raises `Damaged` where it has changed."""
    what = f"verdict on the recording {recording.name}"
    return dict(json.loads(whole(recording.found, recording.digest, what, f"{_MEND}, and it is judged again")))


def is_judged(recording: Recording) -> bool:
    """Whether what was found in a recording is what was stored."""
    return digest_of(recording.found) == recording.digest


def is_whole(files: Files, recording: Recording) -> bool:
    """Whether nothing of a recording is missing or has changed."""
    try:
        upload_of(files, recording)
        samples_of(files, recording)
        found_of(recording)
    except Damaged:
        return False
    return True


def _whole(files: Files, recording: Recording, kind: str, key: str, sha256: str) -> Path:
    path = files.path(recording.group, kind, key)
    if not files.is_whole(path, sha256):
        found = "is damaged: its content is not what was stored" if path.exists() else "is missing"
        raise Damaged(f"the stored file of the recording {recording.name} {found}; {_MEND}, and it is whole again")
    return path


@dataclass(frozen=True, slots=True)
class Samples:
    """The samples of recordings, by the paths of their files, for a process that has no store.

    `sha256`: hexadecimal; empty where it is not known
    """

    sha256: dict[Path, str]

    def check(self, path: Path) -> None:
        """Raise `InputError` where the samples are not what was read from the upload."""
        wanted = self.sha256.get(path, "")
        try:
            found = sha256_of(path) if wanted else ""
        except OSError:
            found = "none"
        if found != wanted:
            raise InputError(
                "recording", "samples that are missing or damaged", "an uploaded recording: the same file uploaded again mends it"
            )
