"""What routes work with: chosen once, by `create_app`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Request
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

from api.files import Files
from api.reading.reader import Reading
from api.reading.uploads import Uploads
from api.settings import Settings
from api.stores.records import Store
from api.work.pool import Work


class Rates:
    """A bucket of tokens for each key: so many at once, so many a minute.

    Parameters
    ----------
    per_minute, burst : int
    clock : callable
        Seconds that only rise.
    """

    def __init__(self, per_minute: int, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.rate, self.burst, self.clock = per_minute / 60.0, float(burst), clock
        self.buckets: dict[str, tuple[float, float]] = {}
        self.lock = threading.Lock()

    def wait(self, key: str) -> float:
        """Take a token and return 0, or return the seconds until there is one."""
        with self.lock:
            now = self.clock()
            level, seen = self.buckets.get(key, (self.burst, now))
            level = min(self.burst, level + (now - seen) * self.rate)
            self.buckets[key] = (level - 1.0 if level >= 1.0 else level, now)
            if len(self.buckets) > 10_000:
                # who has been away until the bucket is full again is nobody special
                full = self.burst / self.rate
                self.buckets = {k: v for k, v in self.buckets.items() if now - v[1] < full}
            return 0.0 if level >= 1.0 else (1.0 - level) / self.rate


class Metrics:
    """Counters in a registry of their own: two services in one process do not meet."""

    def __init__(self, waiting: Callable[[], float]) -> None:
        self.registry = CollectorRegistry()
        names = ("method", "route", "status")
        self.requests = Counter("rcsa_ident_requests", "Requests answered", names, registry=self.registry)
        self.seconds = Histogram("rcsa_ident_request_seconds", "Time to an answer", names[:2], registry=self.registry)
        gauge = Gauge("rcsa_ident_work_waiting", "Questions without an answer yet", registry=self.registry)
        gauge.set_function(waiting)


@dataclass(frozen=True, slots=True)
class Parts:
    """Settings, store, workers, files and what reads them, limits, metrics."""

    settings: Settings
    store: Store
    work: Work
    files: Files
    reader: Reading
    uploads: Uploads
    rates: Rates = field(repr=False)
    metrics: Metrics = field(repr=False)


def parts_of(request: Request) -> Parts:
    """Return the parts of the service that a request came to."""
    parts: Parts = request.app.state.parts
    return parts


ThisService = Annotated[Parts, Depends(parts_of)]
