"""Calls of the reader process and the workers; they import formats and signals where they run, so that the service does not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from api.reading.campaign_text import Upload
from api.work.requests import ToolingSource
from rcsa_ident.signals.recording import Sensor


def warm() -> None:
    """Import and compile what a verdict needs, see `examine.warm`, and what listening does; import what reads tool libraries."""
    from api.reading import examine, hammer_files, hearing  # noqa: F401, what is imported once is there
    from api.work import libraries  # noqa: F401

    examine.warm()
    hearing.warm()


def look(upload: Upload, text: str, cut_id: str, role: str, air: Path | None) -> dict[str, Any]:
    """Return the description of an upload, see `examine.look`."""
    from api.reading import examine

    return examine.look(upload, text, cut_id, role, air)


def look_at_hammer_tests(upload: Upload, text: str) -> dict[str, Any]:
    """Return what the FRFs of a campaign's hammer tests are, see `hammer_files.look`."""
    from api.reading import hammer_files

    return hammer_files.look(upload, text)


def read_alone(upload: Upload, sensors: tuple[Sensor, ...], rate: float | None) -> dict[str, Any]:
    """Write the samples of an upload that comes without a campaign, and return its rate, duration and channels."""
    from api.reading import examine

    return examine.described(examine.read_upload(upload, sensors, rate))


def listen(path: Path, name: str, asked: dict[str, Any]) -> dict[str, Any]:
    """Return what a recording says, see `hearing.listen`."""
    from api.reading import hearing

    return hearing.listen(path, name, asked)


def tap(asked: dict[str, Any], *hits: Upload) -> dict[str, Any]:
    """Return the receptance of hammer hits, see `hearing.tap`."""
    from api.reading import hearing

    return hearing.tap(asked, *hits)


def ring(tooling: ToolingSource, asked: dict[str, Any], *sounds: Path) -> dict[str, Any]:
    """Return what the ring of a tooling tells of it, see `hearing.ring`."""
    from api.reading import hearing

    return hearing.ring(tooling, asked, *sounds)


def recording_and_air(cut: Path, air: Path | None) -> tuple[Any, Any]:
    """Return the stored samples of a recording and of its air cut, where there is one."""
    from api.reading.samples import read_normalised

    return read_normalised(cut), None if air is None else read_normalised(air)


def judge(text: str, cut_id: str, cut: Path, air: Path | None) -> dict[str, Any]:
    """Return the verdict on stored samples, see `examine.judge`."""
    from api.reading import examine

    return examine.judge(text, cut_id, cut, air)


def among_fellows(toolings: list[str], alone: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the verdicts of a campaign's cuts, see `examine.among_fellows`."""
    from api.reading import examine

    return examine.among_fellows(toolings, alone)


def envelope(path: Path, points: int) -> dict[str, Any]:
    """Return the envelope of a recording, see `previews.envelope`."""
    from api.reading import previews

    return previews.envelope(path, points)


def spectrum(path: Path, speed_rpm: float | None, points: int) -> dict[str, Any]:
    """Return the amplitudes of a recording, see `previews.spectrum`."""
    from api.reading import previews

    return previews.spectrum(path, speed_rpm, points)
