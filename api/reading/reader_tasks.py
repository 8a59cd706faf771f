"""What the reader process is asked for, by functions that import nothing here: only there are formats and signals loaded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from api.reading.campaign_text import Upload


def warm() -> None:
    """Import and compile what a verdict needs, see `examine.warm`."""
    from api.reading import examine

    examine.warm()


def look(upload: Upload, text: str, cut_id: str, role: str, air: Path | None) -> dict[str, Any]:
    """Return what was found in an upload, see `examine.look`."""
    from api.reading import examine

    return examine.look(upload, text, cut_id, role, air)


def judge(text: str, cut_id: str, cut: Path, air: Path | None) -> dict[str, Any]:
    """Return the verdict on samples that are there, see `examine.judge`."""
    from api.reading import examine

    return examine.judge(text, cut_id, cut, air)


def envelope(path: Path, points: int) -> dict[str, Any]:
    """Return the outline of a recording, see `previews.envelope`."""
    from api.reading import previews

    return previews.envelope(path, points)


def spectrum(path: Path, speed_rpm: float | None, points: int) -> dict[str, Any]:
    """Return the amplitudes of a recording, see `previews.spectrum`."""
    from api.reading import previews

    return previews.spectrum(path, speed_rpm, points)
