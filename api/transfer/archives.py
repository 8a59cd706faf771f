"""ZIP archives that are sent while they are made: measured signals hardly shrink, so nothing is packed."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

_BLOCK = 1 << 20
#: For each member a header with room for long files, what says how long it was, and an entry in the list; the list's end.
_PER_MEMBER, _END = 30 + 20 + 24 + 46, 22


def zipped(members: Iterable[tuple[str, bytes | Path]]) -> Iterator[bytes]:
    """Yield an archive of files, by their names in it."""
    sink = _Sink()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_STORED) as archive:  # type: ignore[call-overload]
        for name, content in members:
            if isinstance(content, bytes):
                archive.writestr(name, content)
                continue
            with content.open("rb") as source, archive.open(name, "w", force_zip64=True) as entry:
                while block := source.read(_BLOCK):
                    entry.write(block)
                    yield sink.taken()
    yield sink.taken()


def zipped_bytes(members: Sequence[tuple[str, Path]]) -> int:
    """Return how long the archive of these files is."""
    return sum(path.stat().st_size + _PER_MEMBER + 2 * len(name.encode()) for name, path in members) + _END


class _Sink:
    """Takes what an archive is made of until somebody fetches it."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []

    def write(self, data: bytes) -> int:
        self.parts.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Nothing waits."""

    def taken(self) -> bytes:
        """Return what has come since."""
        found, self.parts = b"".join(self.parts), []
        return found
