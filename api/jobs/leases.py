"""Jobs of views: one that nobody follows any more is cancelled, as where a browser has crashed or the network was lost."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from datetime import UTC, datetime

from api.stores.entities import Unavailable
from api.stores.jobs import Jobs

log = logging.getLogger("rcsa_ident.jobs")


class Leases:
    """Ends the jobs that are to be watched and are not.

    Clocks jump, and differ between machines: what counts is for how long nobody has changed the time at which a job was watched last.

    `seconds` [s]: for which a job goes on that nobody watches
    """

    def __init__(self, jobs: Jobs, seconds: float) -> None:
        self.jobs, self.seconds = jobs, seconds
        self.seen: dict[str, tuple[str, float]] = {}

    def sweep(self, now: float | None = None) -> list[str]:
        """Cancel the jobs that have not been watched for so long, as far as this was seen, and return their ids.

        `now` [s]: of the monotonic clock
        """
        now = time.monotonic() if now is None else now
        found = self.jobs.watched()
        self.seen = {id: self.seen[id] if self.seen.get(id, ("", now))[0] == when else (when, now) for id, when in found.items()}
        why = f"cancelled: the page that asked for it has not followed it for {self.seconds:g} s; ask again"
        over, problem = datetime.now(UTC).isoformat(timespec="milliseconds"), json.dumps({"detail": why, "errors": []})
        # somebody may have come back meanwhile
        stale = [(id, when) for id, (when, since) in self.seen.items() if now - since > self.seconds]
        return [id for id, when in stale if self.jobs.abandon(id, when, over, problem)]


async def maintain(jobs: Jobs, seconds: float) -> None:
    """Sweep four times in that time; who could not follow a job while the service was down gets all of it to come back."""
    leases = Leases(jobs, seconds)
    while True:
        try:
            for id in await asyncio.to_thread(leases.sweep):
                log.info("nobody follows the job any more: it is cancelled", extra={"fields": {"job": id}})
        except Unavailable as error:
            log.warning("the sweep of abandoned jobs is postponed", extra={"fields": {"error": type(error).__name__}})
        await asyncio.sleep(seconds / 4.0)
