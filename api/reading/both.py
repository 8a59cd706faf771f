"""What a worker calls to read uploads that are kept; like `calls` it imports nothing here."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def recording_and_air(cut: Path, air: Path | None) -> tuple[Any, Any]:
    """Return a recording and its air cut, where there is one."""
    from api.reading.samples import read_normalised

    return read_normalised(cut), None if air is None else read_normalised(air)
