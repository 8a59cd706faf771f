"""How long events and results of jobs and versions are kept, where the settings say how long."""

from __future__ import annotations

import asyncio
import logging
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from api.stores.entities import Store, Unavailable

log = logging.getLogger("rcsa_ident.service")
#: Interval between two sweeps [s].
_ROUND = 3600.0


@dataclass(frozen=True, slots=True)
class Lifetimes:
    """How long things are kept; 0 keeps them for ever.

    `events`, `results` [days]: of jobs, after their end
    `versions` [days]: entries of the trail with the texts of their versions, except the newest of each thing
    """

    events: float = 0.0
    results: float = 0.0
    versions: float = 0.0


def sweep(store: Store, kept: Lifetimes, now: datetime | None = None) -> dict[str, int]:
    """Remove what is older than it may be, and return how many jobs and entries that were."""
    now = datetime.now(UTC) if now is None else now

    def before(days: float) -> str:
        return (now - timedelta(days=days)).isoformat(timespec="milliseconds")

    store.forget_repeats(now)
    return {
        "events": store.jobs.forget_events(before(kept.events)) if kept.events else 0,
        "results": store.jobs.forget_texts(before(kept.results)) if kept.results else 0,
        "versions": store.changes.forget(before(kept.versions)) if kept.versions else 0,
    }


async def maintain(store: Store, kept: Lifetimes) -> None:
    """Sweep at the start and every hour."""
    while True:
        try:
            removed = await asyncio.to_thread(sweep, store, kept)
            if any(removed.values()):
                log.info("no longer kept", extra={"fields": removed})
        except Unavailable as error:
            log.warning("the sweep of old entries is postponed", extra={"fields": {"error": type(error).__name__}})
        await asyncio.sleep(_ROUND)
