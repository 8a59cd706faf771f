"""What Prometheus is told of the service: requests, force streams and jobs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from prometheus_client.metrics_core import GaugeMetricFamily, Metric, SummaryMetricFamily

from api.stores.entities import Unavailable
from api.stores.jobs import Jobs

_DELAYS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


class Metrics:
    """Prometheus metrics in a registry of their own, so that two services in one process do not share them."""

    def __init__(self, waiting: Callable[[], float]) -> None:
        self.registry = CollectorRegistry()
        names = ("method", "route", "status")
        self.requests = Counter("rcsa_ident_requests", "Requests answered", names, registry=self.registry)
        self.seconds = Histogram("rcsa_ident_request_seconds", "Time to an answer", names[:2], registry=self.registry)
        gauge = Gauge("rcsa_ident_work_waiting", "Queries that wait for an answer", registry=self.registry)
        gauge.set_function(waiting)
        self.streams = Gauge("rcsa_ident_streams", "Force streams that are open", registry=self.registry)
        self.stream_samples = Counter("rcsa_ident_stream_samples", "Samples whose forces have been computed", registry=self.registry)
        self.stream_lost = Counter("rcsa_ident_stream_lost_samples", "Samples that never arrived", registry=self.registry)
        self.stream_dropped = Counter("rcsa_ident_stream_dropped_samples", "Samples discarded unused", registry=self.registry)
        self.stream_delay = Histogram(
            "rcsa_ident_stream_delay_seconds", "Time from the arrival of a block to its forces", buckets=_DELAYS, registry=self.registry
        )

    def streamed(self, samples: int, delay: float) -> None:
        """Count samples whose forces have been computed, with the delay since their arrival [s]."""
        self.stream_samples.inc(samples)
        self.stream_delay.observe(delay)

    def missed(self, lost: int, dropped: int) -> None:
        """Count samples that never arrived, and samples that were discarded."""
        self.stream_lost.inc(lost)
        self.stream_dropped.inc(dropped)


class JobCounts:
    """Collector of the jobs in the store: counted when Prometheus asks."""

    def __init__(self, jobs: Jobs) -> None:
        self.jobs = jobs

    def collect(self) -> Iterator[Metric]:
        """Yield the number of jobs by kind and state, and the time that those that have ended took."""
        count = GaugeMetricFamily("rcsa_ident_jobs", "Jobs", labels=("kind", "state"))
        seconds = SummaryMetricFamily("rcsa_ident_job_seconds", "Time that jobs took, without waiting", labels=("kind", "state"))
        with suppress(Unavailable):
            for kind, state, number, total in self.jobs.counts():
                count.add_metric((kind, state), number)
                if state in ("done", "failed"):
                    seconds.add_metric((kind, state), number, total)
        yield from (count, seconds)
