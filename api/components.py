"""What routes work with: chosen once, by `create_app`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Request
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from prometheus_client.metrics_core import GaugeMetricFamily, Metric, SummaryMetricFamily

from api.files import Files
from api.jobs.event_feed import EventFeeds
from api.jobs.supervisor import Supervisor
from api.reading.uploads import Uploads
from api.settings import Settings
from api.stores.entities import Store, Unavailable
from api.stores.jobs import Jobs
from api.streams.hub import Hub
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


_DELAYS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


class Metrics:
    """Counters in a registry of their own: two services in one process do not meet."""

    def __init__(self, waiting: Callable[[], float]) -> None:
        self.registry = CollectorRegistry()
        names = ("method", "route", "status")
        self.requests = Counter("rcsa_ident_requests", "Requests answered", names, registry=self.registry)
        self.seconds = Histogram("rcsa_ident_request_seconds", "Time to an answer", names[:2], registry=self.registry)
        gauge = Gauge("rcsa_ident_work_waiting", "Questions without an answer yet", registry=self.registry)
        gauge.set_function(waiting)
        self.streams = Gauge("rcsa_ident_streams", "Force streams that are open", registry=self.registry)
        self.stream_samples = Counter("rcsa_ident_stream_samples", "Samples that have got a force", registry=self.registry)
        self.stream_lost = Counter("rcsa_ident_stream_lost_samples", "Samples that never came", registry=self.registry)
        self.stream_dropped = Counter("rcsa_ident_stream_dropped_samples", "Samples thrown away unused", registry=self.registry)
        self.stream_delay = Histogram(
            "rcsa_ident_stream_delay_seconds", "From a block's arrival to its forces", buckets=_DELAYS, registry=self.registry
        )

    def streamed(self, samples: int, delay: float) -> None:
        """Count samples that have got a force, so long after they came [s]."""
        self.stream_samples.inc(samples)
        self.stream_delay.observe(delay)

    def missed(self, lost: int, dropped: int) -> None:
        """Count samples that never came, or were thrown away."""
        self.stream_lost.inc(lost)
        self.stream_dropped.inc(dropped)


class JobCounts:
    """Jobs in the store, as they are when somebody asks."""

    def __init__(self, jobs: Jobs) -> None:
        self.jobs = jobs

    def collect(self) -> Iterator[Metric]:
        """Yield how many jobs of which kind are in which state, and how long those that have ended took."""
        count = GaugeMetricFamily("rcsa_ident_jobs", "Jobs", labels=("kind", "state"))
        seconds = SummaryMetricFamily("rcsa_ident_job_seconds", "Time that jobs took, waiting left out", labels=("kind", "state"))
        with suppress(Unavailable):
            for kind, state, number, total in self.jobs.counts():
                count.add_metric((kind, state), number)
                if state in ("done", "failed"):
                    seconds.add_metric((kind, state), number, total)
        yield from (count, seconds)


@dataclass(frozen=True, slots=True)
class Components:
    """Settings, store, workers, files and what reads them, limits, metrics, force streams, what jobs tell and who carries them out."""

    settings: Settings
    store: Store
    work: Work
    files: Files
    reader: Work
    uploads: Uploads
    rates: Rates = field(repr=False)
    metrics: Metrics = field(repr=False)
    streams: Hub = field(repr=False)
    feeds: EventFeeds = field(repr=False)
    crew: Supervisor | None = field(repr=False)


def parts_of(request: Request) -> Components:
    """Return the parts of the service that a request came to."""
    parts: Components = request.app.state.parts
    return parts


ThisService = Annotated[Components, Depends(parts_of)]
