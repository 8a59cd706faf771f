"""A session: its waiting samples, blocks under computation, and listeners."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from api.log_lines import ids
from api.streams.backlog import Backlog
from api.streams.counts import Counts
from api.streams.listener import Listener
from rcsa_ident.base.arrays import FloatArray

#: Samples per block, and blocks of a session under computation at once: no session waits long for another.
BLOCK, FLYING = 4096, 4


class Stage(StrEnum):
    """Stages of a session."""

    SETTLING = "settling"
    DESIGNING = "designing"
    LIVE = "live"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class End:
    """Why a session is over.

    `code`: close code of the WebSocket
    `status`: status of the problem document; 0 without an error
    `errors`: tuple of {field, found, allowed}
    """

    code: int = 1000
    status: int = 0
    detail: str = ""
    errors: tuple[Mapping[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class About:
    """Description of a session. `rate` [Hz]. `most_waiting`: samples that may wait; beyond that the oldest are dropped."""

    id: str
    group: str
    name: str
    machine: str
    tooling: str
    started: str
    rate: float
    axes: tuple[str, ...]
    channels: int
    most_waiting: int


@dataclass(slots=True, eq=False)
class Second:
    """Statistics since the last status. `delays`: list of float [s]. `total`, `square`: arrays, shape (a,) [N], [N^2]."""

    total: FloatArray
    square: FloatArray
    delays: list[float] = field(default_factory=list)
    count: int = 0

    @classmethod
    def of(cls, axes: int) -> Second:
        """Return empty statistics."""
        return cls(np.zeros(axes), np.zeros(axes))


class Session:
    """The stream of one client. `number`: id of the session towards the stream process."""

    def __init__(self, about: About, number: int) -> None:
        self.about, self.number = about, number
        #: What its lines in the log carry: those of the request that opened it, too.
        self.ids = ids() | {"session": about.id, "stream": str(number)}
        self.stage, self.end = Stage.SETTLING, End()
        self.counts, self.waiting = Counts(), Backlog()
        self.flying: deque[int] = deque()
        self.listeners: list[Listener] = []
        self.ready: dict[str, Any] = {}
        self.plan = b""
        self.touched = time.monotonic()
        self.drift, self.known, self.notes = 0.0, True, list[str]()
        self.second = Second.of(len(about.axes))
        self.room, self.over, self.drained, self.arrived = (asyncio.Event() for _ in range(4))
        self.room.set()
        self.finishing, self.settling = False, 0

    @property
    def held(self) -> int:
        """Samples that wait here, without those under computation."""
        return self.counts.backlog - sum(self.flying)

    def offer(self, first: int, samples: FloatArray, now: float) -> int:
        """Take a frame, shape (n, c), and return the number of older samples dropped for it."""
        late = self.counts.take(first, samples.shape[0])
        if late == samples.shape[0]:
            return 0
        self.touched = now
        self.arrived.set()
        self.waiting.add(first + late, samples[late:], now)
        dropped = 0
        while (excess := self.held - self.about.most_waiting) > 0:
            dropped += self._drop(excess)
        if self.held > self.about.most_waiting // 2:
            self.room.clear()
        return dropped

    def window(self, count: int) -> tuple[int, FloatArray] | None:
        """Return first index and samples of the earliest `count` ones that wait without a gap, or None; fewer before a gap are dropped."""
        runs = self.waiting.runs
        while runs and runs[0][1] < count:
            if len(runs) == 1:
                return None
            # behind the gap nothing is added to them
            self._drop(runs[0][1])
        return (runs[0][0], self.waiting.head(count)) if runs else None

    def skip(self, index: int) -> int:
        """Drop waiting samples before an index, and return their number."""
        dropped, runs = 0, self.waiting.runs
        while runs and runs[0][0] < index:
            dropped += self._drop(index - runs[0][0])
        return dropped

    def _drop(self, count: int) -> int:
        dropped = self.waiting.drop(count)
        self.counts.drop(dropped)
        return dropped

    def block(self) -> tuple[int, FloatArray, float] | None:
        """Return the next block without gaps, or None where nothing waits or enough blocks are under computation."""
        if not self.waiting.runs or len(self.flying) >= FLYING:
            return None
        first, samples, arrived = self.waiting.take(BLOCK)
        self.flying.append(samples.shape[0])
        if self.held <= self.about.most_waiting // 2:
            self.room.set()
        return first, samples, arrived

    def forces(self, first: int, values: FloatArray, delay: float) -> int:
        """Take the forces of the oldest block under computation, and return its samples: in those without a force the observer settles."""
        computed = self.flying.popleft()
        self.counts.done(computed)
        self.settling += computed - values.shape[0]
        self.second.delays.append(delay)
        self.second.count += values.shape[0]
        self.second.total += values.sum(axis=0)
        self.second.square += (values**2).sum(axis=0)
        for listener in self.listeners if values.shape[0] else ():
            listener.forces(first, values)
        if self.finishing and self.counts.backlog == 0:
            self.drained.set()
        return computed

    def lost_process(self) -> int:
        """Count the samples under computation in a dead process as dropped, and return their number."""
        count = sum(self.flying)
        self.flying.clear()
        self.counts.drop(count)
        return count

    def status(self) -> dict[str, Any]:
        """Return the status of the last second, and reset the statistics."""
        seen, self.second = self.second, Second.of(len(self.about.axes))
        n, counts, delays = seen.count, self.counts, np.array(seen.delays or [0.0]) * 1e3
        rms = np.sqrt(np.maximum(seen.square / n - (seen.total / n) ** 2, 0.0)).round(6).tolist() if n else [None] * len(self.about.axes)
        return {
            "stage": str(self.stage),
            "samples": counts.samples,
            "settling": self.settling,
            "lost": counts.lost,
            "late": counts.late,
            "dropped": counts.dropped,
            "backlog": counts.backlog,
            "delay_ms": round(float(np.median(delays)), 3),
            "delay_max_ms": round(float(delays.max()), 3),
            "speed_drift_percent": round(100.0 * self.drift, 5),
            "angle_known": self.known,
            "rms_n": dict(zip(self.about.axes, rms, strict=True)),
            "notes": self.notes,
        }

    def finish(self, end: End) -> None:
        """End the session; the first reason stands."""
        if self.stage is not Stage.ENDED:
            self.stage, self.end = Stage.ENDED, end
            for event in (self.over, self.room, self.arrived, self.drained):
                event.set()
            for listener in self.listeners:
                listener.awake.set()
