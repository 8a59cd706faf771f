"""A recording that comes without a campaign: read in the reader process, its samples written, nothing judged."""

from __future__ import annotations

from typing import Any

from api.reading.campaign_text import Upload
from rcsa_ident.signals.recording import Sensor


def read_plain(upload: Upload, sensors: tuple[Sensor, ...], rate: float | None) -> dict[str, Any]:
    """Return rate, duration and channels of an upload."""
    from api.reading import examine

    return examine.told(examine.read_upload(upload, sensors, rate))
