"""Jobs of views: one that nobody follows any more is cancelled, as where a browser has crashed or the network was lost."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from api.stores.entities import Unavailable
from api.stores.jobs import Jobs

log = logging.getLogger("rcsa_ident.jobs")


def sweep(jobs: Jobs, seconds: float, now: datetime | None = None) -> Sequence[str]:
    """Cancel the jobs that are to be watched and have not been for so many seconds, and return their ids."""
    now = datetime.now(UTC) if now is None else now
    why = f"cancelled: the page that asked for it has not followed it for {seconds:g} s; ask again"
    before, when = ((now - timedelta(seconds=each)).isoformat(timespec="milliseconds") for each in (seconds, 0.0))
    return jobs.abandon(before, when, json.dumps({"detail": why, "errors": []}))


async def maintain(jobs: Jobs, seconds: float) -> None:
    """Sweep four times in that time."""
    # who could not follow a job while the service was down gets time to come back
    pause = seconds
    while True:
        await asyncio.sleep(pause)
        pause = seconds / 4.0
        try:
            for id in await asyncio.to_thread(sweep, jobs, seconds):
                log.info("nobody follows the job any more: it is cancelled", extra={"fields": {"job": id}})
        except Unavailable as error:
            log.warning("the sweep of abandoned jobs is postponed", extra={"fields": {"error": type(error).__name__}})
