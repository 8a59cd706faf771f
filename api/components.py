"""The components that routes work with: chosen once, by `create_app`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Request

from api.files import Files
from api.jobs.event_feed import EventFeeds
from api.jobs.supervisor import Supervisor
from api.metrics import Metrics
from api.reading.example_campaign import Examples
from api.reading.uploads import Uploads
from api.settings import Settings
from api.stores.entities import Store
from api.streams.hub import Hub
from api.work.answers import Answers
from api.work.pool import Work

#: Keys or addresses that one limiter remembers.
MOST_BUCKETS = 10_000


class Rates:
    """Token-bucket rate limiter, one bucket per key: `burst` requests at once, refilled at `per_minute`.

    Parameters
    ----------
    per_minute, burst : int
    clock : callable
        Monotonic clock [s].
    """

    def __init__(self, per_minute: int, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.rate, self.burst, self.clock = per_minute / 60.0, float(burst), clock
        self.buckets: dict[str, tuple[float, float]] = {}
        self.lock = threading.Lock()

    def wait(self, key: str) -> float:
        """Take a token and return 0, or return the time [s] until there is one."""
        with self.lock:
            now, buckets = self.clock(), self.buckets
            level, seen = buckets.pop(key, (self.burst, now))
            level = min(self.burst, level + (now - seen) * self.rate)
            # the first one is the one that has not been asked for longest
            buckets[key] = (level - 1.0 if level >= 1.0 else level, now)
            while len(buckets) > MOST_BUCKETS or now - buckets[next(iter(buckets))][1] >= self.burst / self.rate:
                # one that is full again needs no entry
                del buckets[next(iter(buckets))]
            return 0.0 if level >= 1.0 else (1.0 - level) / self.rate


@dataclass(frozen=True, slots=True)
class Components:
    """Settings, store, workers and their answers, files and uploads, rate limits (also of wrong keys), metrics, streams, event feeds,
    examples, supervisor."""

    settings: Settings
    store: Store
    work: Work
    answers: Answers
    files: Files
    reader: Work
    uploads: Uploads
    rates: Rates = field(repr=False)
    wrong_keys: Rates = field(repr=False)
    metrics: Metrics = field(repr=False)
    streams: Hub = field(repr=False)
    feeds: EventFeeds = field(repr=False)
    examples: Examples = field(repr=False)
    supervisor: Supervisor | None = field(repr=False)


def components_of(request: Request) -> Components:
    """Return the components of the service that a request came to."""
    components: Components = request.app.state.components
    return components


ThisService = Annotated[Components, Depends(components_of)]
