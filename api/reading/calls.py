"""What the reader process is asked for, by functions that import nothing here: only there are formats and signals loaded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from api.reading.declared import Upload


def warm() -> None:
    """Import and compile what a verdict needs, see `look.warm`."""
    from api.reading import look

    look.warm()


def look(upload: Upload, text: str, cut_id: str, role: str, air: Path | None) -> dict[str, Any]:
    """Return what was found in an upload, see `look.look`."""
    from api.reading import look

    return look.look(upload, text, cut_id, role, air)


def judge(text: str, cut_id: str, cut: Path, air: Path | None) -> dict[str, Any]:
    """Return the verdict on samples that are there, see `look.judge`."""
    from api.reading import look

    return look.judge(text, cut_id, cut, air)


def envelope(path: Path, points: int) -> dict[str, Any]:
    """Return the outline of a recording, see `pictures.envelope`."""
    from api.reading import pictures

    return pictures.envelope(path, points)


def spectrum(path: Path, speed_rpm: float | None, points: int) -> dict[str, Any]:
    """Return the amplitudes of a recording, see `pictures.spectrum`."""
    from api.reading import pictures

    return pictures.spectrum(path, speed_rpm, points)
