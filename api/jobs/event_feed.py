"""Event feeds of jobs for many clients: one poll of the store for all jobs, and one read of the new events of each."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import Context

from api.shares import Shares
from api.stores.entities import Unavailable
from api.stores.jobs import Event, Jobs

#: Interval between two polls [s], and most events per read.
LOOK, BATCH = 0.3, 500


class Crowded(Exception):
    """The limit of event streams is reached, of the group or of all."""


class EventFeeds:
    """Feeds of the events of jobs. `places`: simultaneous streams."""

    def __init__(self, jobs: Jobs, places: Shares) -> None:
        self.jobs, self.places = jobs, places
        self.numbers: dict[str, int] = {}
        self.bells: dict[str, set[asyncio.Event]] = {}
        self.readings: dict[tuple[str, int], tuple[float, asyncio.Task[Sequence[Event]]]] = {}
        self.looking: asyncio.Task[None] | None = None

    @contextmanager
    def stream(self, group: str) -> Iterator[None]:
        """Count a stream while it is open; raises `Crowded` where there are too many."""
        if not self.places.take(group):
            raise Crowded
        try:
            yield
        finally:
            self.places.give(group)

    async def events(self, job: str, after: int) -> Sequence[Event]:
        """Return the events after a number; concurrent requests share one read."""
        now = time.monotonic()
        self.readings = {key: value for key, value in self.readings.items() if now - value[0] < LOOK}
        if (job, after) not in self.readings:
            self.readings[job, after] = now, asyncio.create_task(asyncio.to_thread(self.jobs.events, job, after, BATCH))
        return await asyncio.shield(self.readings[job, after][1])

    async def wait(self, job: str, after: int, seconds: float) -> bool:
        """Wait at most so many seconds for an event after a number, and return whether there is one."""
        end = time.monotonic() + seconds
        bell = asyncio.Event()
        self.bells.setdefault(job, set()).add(bell)
        if self.looking is None or self.looking.done():
            # for all who watch, not for the one who came first
            self.looking = asyncio.create_task(self._poll(), context=Context())
        try:
            while self.numbers.get(job, 0) <= after:
                try:
                    await asyncio.wait_for(bell.wait(), max(end - time.monotonic(), 0.0))
                except TimeoutError:
                    return False
                bell.clear()
            return True
        finally:
            self.bells[job].discard(bell)
            if not self.bells[job]:
                del self.bells[job]
                self.numbers.pop(job, None)

    async def _poll(self) -> None:
        while self.bells:
            try:
                found = await asyncio.to_thread(self.jobs.numbers, list(self.bells))
            except Unavailable:
                found = {}
            for job, number in found.items():
                if number > self.numbers.get(job, 0):
                    self.numbers[job] = number
                    for bell in self.bells.get(job, ()):
                        bell.set()
            await asyncio.sleep(LOOK)
