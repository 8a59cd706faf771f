"""ZIP archives, sent while they are made; stored without compression, since measured signals hardly shrink."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

_BLOCK = 1 << 20
#: Bytes per member (local header, ZIP64 extra, data descriptor, directory entry) and of the end of the directory.
_PER_MEMBER, _END = 30 + 20 + 24 + 46, 22


def zipped(members: Iterable[tuple[str, bytes | Path]]) -> Iterator[bytes]:
    """Yield an archive of files under the given names."""
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
    """Return the size of the archive of these files [bytes]."""
    return sum(path.stat().st_size + _PER_MEMBER + 2 * len(name.encode()) for name, path in members) + _END


class _Sink:
    """Write-only file that collects the bytes of an archive until they are taken."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []

    def write(self, data: bytes) -> int:
        self.parts.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Do nothing: there is no buffer."""

    def taken(self) -> bytes:
        """Return the bytes written since the last call."""
        found, self.parts = b"".join(self.parts), []
        return found
