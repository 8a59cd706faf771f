"""All sessions of the service: opened, fed, reported on each second, and ended."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from api.metrics import Metrics
from api.rates import Rates
from api.shares import Shares
from api.streams.engine import BLOCK, CLOSE, FAILED, FORCES, OPEN, REFUSED, Message
from api.streams.listener import Listener
from api.streams.process import Host
from api.streams.session import About, End, Session, Stage
from rcsa_ident.base.arrays import FloatArray

log = logging.getLogger("rcsa_ident.service")
#: Most frames of a session per second, each of which costs as much as hundreds of samples, and the seconds that may come at once: behind
#: a pause of the network, or of this process, frames come that were sent in time.
MOST_FRAMES, PAUSED = 2000, 5
#: Blocks of all sessions under computation, from which on sessions wait: enough for the process to have work. They take turns, and what is
#: on its way to the process stays small, however many they are: a buffer is moved as a whole when it grows.
MOST_FLYING = 16
_UNEXPECTED = "an internal error occurred; it is logged under this session's id"


@dataclass(frozen=True, slots=True)
class StreamLimits:
    """Limits of streams.

    `sessions`, `sessions_per_group`, `listeners`: most sessions of the service and of a group, most listeners of a session
    `several`: whether the sessions are shared by groups
    `idle` [s]: time without a new sample after which a session ends
    `drift`: relative deviation of the spindle speed beyond which a note warns of less accurate forces
    """

    sessions: int = 16
    sessions_per_group: int = 8
    listeners: int = 16
    several: bool = False
    idle: float = 30.0
    drift: float = 2e-3


class Full(Exception):
    """The limit of sessions or listeners is reached."""


class Hub:
    """Registry of sessions, between their connections and the stream process."""

    def __init__(self, host: Host, limits: StreamLimits, metrics: Metrics) -> None:
        self.host, self.limits, self.metrics = host, limits, metrics
        self.places = Shares(limits.sessions, limits.several)
        self.pace = Rates(60 * MOST_FRAMES, PAUSED * MOST_FRAMES)
        self.sessions: dict[str, Session] = {}
        self.numbers = itertools.count(1)
        self.by_number: dict[int, Session] = {}
        #: Sessions that may have samples for the process, in the order of their turns.
        self.turns: dict[Session, None] = {}
        self.flying = 0
        self.ticking: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Start the stream process."""
        await self.host.start(self._deliver, self._anew)
        self.ticking = asyncio.create_task(self._tick())

    async def stop(self) -> None:
        """End all sessions and the stream process."""
        for session in list(self.sessions.values()):
            self.close(session, End(1001, 503, "the service is shutting down"))
        if self.ticking is not None:
            self.ticking.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self.ticking
        await self.host.stop()

    def list(self, group: str) -> list[Session]:
        """Return a group's sessions, the oldest first."""
        return [session for session in self.sessions.values() if session.about.group == group]

    def get(self, group: str, id: str) -> Session | None:
        """Return a session of a group, or None."""
        found = self.sessions.get(id)
        return found if found is not None and found.about.group == group else None

    def open(self, about: About) -> Session:
        """Return a new session; raises `Full`."""
        if len(self.sessions) >= self.limits.sessions:
            raise Full(f"{self.limits.sessions} streams are open, which is the limit of the service")
        if len(self.list(about.group)) >= self.limits.sessions_per_group:
            raise Full(f"{self.limits.sessions_per_group} streams of this group are open, which is its limit")
        if not self.places.take(about.group):
            raise Full(f"{len(self.list(about.group))} streams of this group are open; the places that are left are for other groups")
        session = Session(about, next(self.numbers))
        self.sessions[about.id] = self.by_number[session.number] = session
        return session

    def listen(self, session: Session, listener: Listener) -> None:
        """Add a listener to a session; raises `Full`."""
        if len(session.listeners) > self.limits.listeners:
            raise Full(f"{self.limits.listeners} clients watch this stream, which is its limit")
        session.listeners.append(listener)

    def close(self, session: Session, end: End) -> None:
        """End a session and remove it."""
        session.finish(end)
        if self.sessions.pop(session.about.id, None) is not None:
            self.flying -= len(session.flying)
            self.places.give(session.about.group)
            self.by_number.pop(session.number, None)
            self.host.post(Message(CLOSE, session.number))
            self.metrics.missed(0, session.held)
            self._send_blocks()

    def offer(self, session: Session, first: int, samples: FloatArray) -> None:
        """Take a frame from a session's client; too many of them end the session."""
        if self.pace.wait(session.about.id):
            detail = f"more than {MOST_FRAMES} frames per second: send more samples per frame"
            self.close(session, End(1008, 429, detail))
            return
        lost = session.counts.lost
        dropped = session.offer(first, samples, time.monotonic())
        self.metrics.missed(session.counts.lost - lost, dropped)
        self._feed(session)

    def window(self, session: Session, count: int) -> tuple[int, FloatArray] | None:
        """Return first index and samples that a session's observer can be made of, or None."""
        dropped = session.counts.dropped
        found = session.window(count)
        self.metrics.missed(0, session.counts.dropped - dropped)
        return found

    def begin(self, session: Session, plan: str, origin: int, ready: Mapping[str, Any]) -> None:
        """Start the observer of a session at a waiting sample."""
        if session.stage is Stage.ENDED:
            return
        self.metrics.missed(0, session.skip(origin))
        session.plan, session.stage, session.ready = plan.encode(), Stage.LIVE, dict(ready)
        session.notes = list(ready.get("notes", ()))
        self.host.post(Message(OPEN, session.number, content=session.plan))
        for listener in session.listeners:
            listener.tell("ready", **session.ready)
        self._feed(session)

    def _feed(self, session: Session) -> None:
        """Let a session take its turn."""
        self.turns.setdefault(session)
        self._send_blocks()

    def _send_blocks(self) -> None:
        """Send blocks to the process, of each session in turn as many as may fly: behind dropped samples an observer settles."""
        while self.turns and self.flying < MOST_FLYING:
            session = next(iter(self.turns))
            del self.turns[session]
            while session.stage is Stage.LIVE and (block := session.block()) is not None:
                first, samples, arrived = block
                self.flying += 1
                self.host.post(Message(BLOCK, session.number, first, arrived, content=samples.astype("<f8").tobytes()))

    def _deliver(self, message: Message) -> None:
        session = self.by_number.get(message.session)
        if session is None:
            return
        if message.kind == FAILED:
            fields = session.ids | {"found": message.content.decode("utf-8", "replace")}
            log.error("a stream has failed", extra={"fields": fields})
            self.close(session, End(1011, 500, _UNEXPECTED))
        elif message.kind == REFUSED:
            fault = {"field": "samples", "found": "signals whose forces are not finite", "allowed": "signals of the sensors"}
            self.close(session, End(1008, 422, "samples: found signals whose forces are not finite", (fault,)))
        elif message.kind == FORCES:
            values = np.frombuffer(message.content, "<f8").reshape(-1, len(session.about.axes))
            delay = time.monotonic() - message.arrived
            self.flying -= 1
            session.drift, session.known = message.drift, message.known > 0.0
            self.metrics.streamed(session.forces(message.first, values, delay), delay)
            self._feed(session)

    def _anew(self) -> None:
        self.flying, live = 0, [session for session in self.sessions.values() if session.stage is Stage.LIVE]
        for session in live:
            self.metrics.missed(0, session.lost_process())
            self.host.post(Message(OPEN, session.number, content=session.plan))
            for listener in session.listeners:
                listener.tell("restarted", detail="the observer starts again")
        # only once the process knows all of them: a turn may be another one's
        for session in live:
            self._feed(session)

    async def _tick(self) -> None:
        """Send the status each second; end sessions without samples."""
        while True:
            await asyncio.sleep(1.0)
            for session in list(self.sessions.values()):
                if time.monotonic() - session.touched > self.limits.idle and not session.finishing:
                    self.close(session, End(1008, 408, f"no new sample for {self.limits.idle:g} s"))
                    continue
                self.tell_status(session)

    def tell_status(self, session: Session, event: str = "status") -> None:
        """Send the status of a session to its listeners."""
        session.notes = [*session.ready.get("notes", ())]
        if abs(session.drift) > self.limits.drift:
            percent = f"{100.0 * session.drift:+.2f} %"
            session.notes.append(f"the spindle speed deviates by {percent} from the one the observer was designed for: open a new stream")
        if not session.known:
            session.notes.append("the signals do not show the spindle's angle at present: run-out may remain in the forces")
        status = session.status()
        for listener in session.listeners:
            listener.tell(event, **status, unread=listener.unread)
