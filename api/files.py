"""Files of uploads: written once, named by the hash of their content, never by a client.

A group has a folder of its own. What arrives goes to a part; a part that is complete is synced and gets a second name, the hash of its
content, by one rename, so that a file that is there is whole. A row of the store refers to a file only after that, and only then does
the part lose its own name.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import secrets
import shutil
import threading
import time
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

#: Kinds of files: uploads as received, samples read from them, and parts of unfinished uploads.
UPLOADS, NORMALISED, PARTS = "uploads", "normalised", "parts"
#: Time [s] for which a file counts as whole after it was hashed, unless it changes: parts of one download follow each other.
FRESH = 60.0
#: Age [s] at which an abandoned part is removed, and a file that no row refers to.
STALE_PART, STALE_FILE = 86400.0, 600.0
_KEY = re.compile(r"[0-9a-f]{64}")


class TooLarge(Exception):
    """The group's quota is exceeded."""


class Full(Exception):
    """The free space of the disk is below its limit."""


@dataclass(frozen=True, slots=True)
class Partial:
    """State of a resumable upload.

    `offset` [bytes]: received and on the disk
    `length` [bytes]: of the whole
    `group`, `campaign`, `name`: where the whole belongs
    `replacing`: whether it takes the place of other content
    `sha256`: that the whole has, as announced; empty where it is not
    """

    offset: int
    length: int
    group: str = ""
    campaign: str = ""
    name: str = ""
    replacing: bool = False
    sha256: str = ""

    @property
    def complete(self) -> bool:
        """Whether nothing is missing, though it may not have been read yet."""
        return self.offset == self.length


class Part:
    """A file that is being written. `offset`: length to keep of an existing file; the rest is cut off."""

    def __init__(self, path: Path, offset: int = 0) -> None:
        self.path, self.size = path, offset
        self.hash: Any = hashlib.sha256() if offset == 0 else None
        # without a buffer: what does not fit on the disk is written by nobody later on
        self.file = path.open("r+b" if path.exists() else "xb", buffering=0)
        self.file.truncate(offset)
        self.file.seek(offset)

    def write(self, data: bytes | bytearray) -> None:
        """Append; `size` counts what the disk has taken, also where it is full before the end."""
        left = memoryview(data)
        while left:
            taken = self.file.write(left)
            self.size += taken
            if self.hash is not None:
                self.hash.update(left[:taken])
            left = left[taken:]

    def sync(self) -> None:
        """Return when everything written is on the disk."""
        os.fsync(self.file.fileno())

    def close(self) -> None:
        """Close the file and keep it."""
        self.file.close()

    def drop(self) -> None:
        """Remove the file."""
        self.file.close()
        self.path.unlink(missing_ok=True)

    def sha256(self) -> str:
        """Return the hash of the whole, hexadecimal."""
        if self.hash is None:
            return sha256_of(self.path)
        return str(self.hash.hexdigest())


class Files:
    """Files of all groups.

    `folder`: made at the first upload
    `group_bytes`: quota of a group
    `free_bytes`: kept free on the disk
    """

    def __init__(self, folder: Path, group_bytes: int = 1 << 62, free_bytes: int = 0) -> None:
        self.folder, self.group_bytes, self.free_bytes = folder, group_bytes, free_bytes
        self.hashed: dict[tuple[Any, ...], float] = {}
        #: What the clock showed when the monotonic one stood at 0.
        self.began = time.time() - time.monotonic()
        #: Sizes of the files of a folder by name, of those alone that never change.
        self.sizes: dict[Path, dict[str, int]] = {}
        #: Held from the rename of a file until its row is written, and while files without a row are removed.
        self.lock = threading.Lock()

    def of_group(self, group: str, kind: str) -> Path:
        """Return a folder of a group, made where it is missing."""
        folder = self.folder / _folder_name(group) / kind
        if not folder.is_dir():
            folder.mkdir(parents=True, exist_ok=True)
            # the names of the folders are on the disk before anything in them counts
            for each in (folder.parent, self.folder, self.folder.parent):
                sync_folder(each)
        return folder

    def path(self, group: str, kind: str, key: str) -> Path:
        """Return the path of a file, whether it exists or not."""
        if not _KEY.fullmatch(key) or kind not in (UPLOADS, NORMALISED):
            raise ValueError(f"no key of a file: {kind}/{key}")
        return self.of_group(group, kind) / f"{key}{'.h5' if kind == NORMALISED else ''}"

    def is_whole(self, path: Path, sha256: str) -> bool:
        """Whether a file has this hash; of one that was stored before hashes were kept ("") whether it is there."""
        try:
            stat = path.stat()
            mark = (path, sha256, stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)
            now = time.monotonic()
            if now - self.hashed.get(mark, -FRESH) < FRESH or not sha256:
                return True
            if sha256_of(path) != sha256:
                return False
        except OSError:
            return False
        self.hashed = {key: seen for key, seen in self.hashed.items() if now - seen < FRESH} | {mark: now}
        return True

    def part(self, group: str) -> Part:
        """Return a new part."""
        return Part(self.spare(group))

    def spare(self, group: str) -> Path:
        """Return an unused path for a part."""
        return self.of_group(group, PARTS) / f"{secrets.token_hex(16)}.part"

    def check_space(self, group: str, more: int = 0) -> None:
        """Raise `TooLarge` or `Full` where so many more bytes do not fit."""
        used = sum(self.usage(group).values())
        if used + more > self.group_bytes:
            raise TooLarge(f"the group keeps {used} bytes, and may keep {self.group_bytes}")
        if is_short(self.of_group(group, PARTS), self.free_bytes + more):
            raise Full

    def usage(self, group: str) -> dict[str, int]:
        """Return the size of all files of a group, including parts, by kind [bytes]."""
        whole = {kind: self._size(self.of_group(group, kind)) for kind in (UPLOADS, NORMALISED)}
        return whole | {PARTS: sum(_size(Path(entry.path)) for entry in os.scandir(self.of_group(group, PARTS)))}

    def _size(self, folder: Path) -> int:
        """Size of a folder of files that are named by their content: each is asked for its size once."""
        # names are read anew each time: other services may share the folder
        known, names = self.sizes.get(folder, {}), os.listdir(folder)
        found = {name: known[name] if name in known else _size(folder / name) for name in names}
        self.sizes[folder] = found
        return sum(found.values())

    def keep(self, group: str, kind: str, key: str, source: Path) -> None:
        """Give a synced part its final name beside its own, replacing an equal file. The caller holds `lock`.

        The part keeps its own until a row refers to the file: where none can be written, nothing that was acknowledged is lost.
        """
        target, new = self.path(group, kind, key), self.spare(group)
        try:
            _link(source, new)
            os.replace(new, target)
        finally:
            # of two names of one file neither takes the other's place
            new.unlink(missing_ok=True)
        # a whole file may take the place of a damaged one
        self.sizes.get(target.parent, {}).pop(target.name, None)
        sync_folder(target.parent)

    def remove(self, group: str, keys: Iterable[tuple[str, str]]) -> None:
        """Remove files. The caller holds `lock` and has checked that no row refers to them."""
        for kind, key in keys:
            self.path(group, kind, key).unlink(missing_ok=True)

    def partial(self, group: str, name: str) -> tuple[Path, Partial | None]:
        """Return the path of a resumable upload, and its state."""
        path = self.of_group(group, PARTS) / f"{hashlib.sha256(name.encode()).hexdigest()}.part"
        return path, _noted(path)

    def complete(self) -> Iterator[tuple[Path, Partial]]:
        """Yield the resumable uploads of all groups that are complete, but not stored."""
        for note in list(self.folder.glob(f"*/{PARTS}/*.json")):
            path = note.with_suffix(".part")
            state = _noted(path)
            if state is not None and state.complete:
                yield path, state

    def note(self, path: Path, state: Partial) -> None:
        """Record the state of a resumable upload, whose bytes have been synced."""
        target, new = path.with_suffix(".json"), path.with_suffix(".new")
        with new.open("w", encoding="utf-8") as file:
            json.dump(asdict(state), file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(new, target)
        sync_folder(target.parent)

    def forget(self, path: Path) -> None:
        """Remove a resumable upload."""
        for each in (path.with_suffix(".json"), path.with_suffix(".new"), path):
            each.unlink(missing_ok=True)

    def sweep(self, kept: Mapping[str, Container[tuple[str, str]]], now: float | None = None) -> int:
        """Remove stale parts and files that no row refers to, and return how many. The caller holds `lock`.

        `kept`: mapping of group to files, files that rows refer to
        """
        # of a clock that jumps and one that cannot, the earlier: a part that is being written never looks older than it is
        now, count = min(time.time(), self.began + time.monotonic()) if now is None else now, 0
        known = {_folder_name(group): files for group, files in kept.items()}
        for folder in self.folder.iterdir() if self.folder.is_dir() else ():
            for kind, age in ((UPLOADS, STALE_FILE), (NORMALISED, STALE_FILE), (PARTS, STALE_PART)):
                for entry in list(os.scandir(folder / kind)) if (folder / kind).is_dir() else ():
                    # a row is written within minutes of its file
                    referred = (kind, entry.name.removesuffix(".h5")) in known.get(folder.name, ())
                    if not referred and now - entry.stat().st_mtime > age:
                        Path(entry.path).unlink(missing_ok=True)
                        count += 1
        return count


def _noted(path: Path) -> Partial | None:
    """State of a resumable upload, None where none is noted or its bytes are missing."""
    try:
        state = Partial(**json.loads(path.with_suffix(".json").read_text(encoding="utf-8")))
        return state if path.stat().st_size >= state.offset else None
    except (OSError, ValueError, TypeError):
        return None


def sha256_of(path: Path) -> str:
    """Return the hash of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_short(folder: Path, least: int) -> bool:
    """Whether a disk has fewer free bytes than these, or no room for another file."""
    if shutil.disk_usage(folder).free < least:
        return True
    # Windows counts no files; where this number is 0 neither does the file system
    counted = os.statvfs(folder) if hasattr(os, "statvfs") else None
    return counted is not None and counted.f_files > 0 and counted.f_favail == 0


def no_room(error: BaseException) -> bool:
    """Whether an error says that a disk, or a quota on it, is full."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


def _link(source: Path, target: Path) -> None:
    """Give a synced file a second name, or copy and sync it where its file system has no such thing."""
    try:
        os.link(source, target)
    except (AttributeError, OSError) as error:
        if no_room(error) or isinstance(error, FileNotFoundError):
            raise
        shutil.copyfile(source, target)
        with target.open("rb+") as copied:
            os.fsync(copied.fileno())


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except FileNotFoundError:
        # removed meanwhile
        return 0


def _folder_name(group: str) -> str:
    return hashlib.sha256(group.encode()).hexdigest()[:32]


def sync_folder(folder: Path) -> None:
    """Return when the names in a folder are on the disk."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except PermissionError:
        # Windows opens no folders: its file system writes names down by itself
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
