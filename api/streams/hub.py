"""All sessions of the service: opened, fed, told about each second, and ended."""

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
from api.streams.engine import BLOCK, CLOSE, FAILED, FORCES, OPEN, REFUSED, Message
from api.streams.listener import Listener
from api.streams.process import Host
from api.streams.session import About, End, Session, Stage
from rcsa_ident.arrays import FloatArray

log = logging.getLogger("rcsa_ident.service")
#: Frames of a session in a second: each costs the service as much as hundreds of samples.
MOST_FRAMES = 2000
_UNEXPECTED = "something unexpected happened; the log has it under this session"


@dataclass(frozen=True, slots=True)
class StreamLimits:
    """What is allowed.

    Parameters
    ----------
    sessions, sessions_per_group, listeners : int
        Of the service, of a group, of a session.
    idle : float [s]
        Without a new sample, after which a session ends.
    drift : float
        Share of the speed beyond which forces are told to be less true.
    """

    sessions: int = 16
    sessions_per_group: int = 8
    listeners: int = 16
    idle: float = 30.0
    drift: float = 2e-3


class Full(Exception):
    """No more sessions, or listeners, are allowed."""


class Hub:
    """Sessions by id.

    Parameters
    ----------
    host : Host
    limits : StreamLimits
    metrics : Metrics
    """

    def __init__(self, host: Host, limits: StreamLimits, metrics: Metrics) -> None:
        self.host, self.limits, self.metrics = host, limits, metrics
        self.sessions: dict[str, Session] = {}
        self.numbers = itertools.count(1)
        self.by_number: dict[int, Session] = {}
        self.ticking: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Start the process."""
        await self.host.start(self._deliver, self._anew)
        self.ticking = asyncio.create_task(self._tick())

    async def stop(self) -> None:
        """End all sessions, and the process."""
        for session in list(self.sessions.values()):
            self.close(session, End(1001, 503, "the service ends"))
        if self.ticking is not None:
            self.ticking.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self.ticking
        await self.host.stop()

    def list(self, group: str) -> list[Session]:
        """Return a group's sessions, the oldest first."""
        return [session for session in self.sessions.values() if session.about.group == group]

    def get(self, group: str, id: str) -> Session | None:
        """Return a session, where it is this group's."""
        found = self.sessions.get(id)
        return found if found is not None and found.about.group == group else None

    def open(self, about: About) -> Session:
        """Return a new session; raises `Full`."""
        if len(self.sessions) >= self.limits.sessions:
            raise Full(f"{self.limits.sessions} streams are open, more are not served")
        if len(self.list(about.group)) >= self.limits.sessions_per_group:
            raise Full(f"{self.limits.sessions_per_group} streams of this group are open, more are not served")
        session = Session(about, next(self.numbers))
        self.sessions[about.id] = self.by_number[session.number] = session
        return session

    def listen(self, session: Session, listener: Listener) -> None:
        """Let somebody hear a session; raises `Full`."""
        if len(session.listeners) > self.limits.listeners:
            raise Full(f"{self.limits.listeners} listen to this stream, more are not served")
        session.listeners.append(listener)

    def close(self, session: Session, end: End) -> None:
        """End a session and forget it."""
        session.finish(end)
        if self.sessions.pop(session.about.id, None) is not None:
            self.by_number.pop(session.number, None)
            self.host.post(Message(CLOSE, session.number))
            self.metrics.missed(0, session.held)

    def offer(self, session: Session, first: int, samples: FloatArray) -> None:
        """Take a frame of a session's client."""
        session.frames += 1
        lost = session.counts.lost
        dropped = session.offer(first, samples, time.monotonic())
        self.metrics.missed(session.counts.lost - lost, dropped)
        self._feed(session)

    def begin(self, session: Session, plan: bytes, origin: int, ready: Mapping[str, Any]) -> None:
        """Stream: an observer is there, and begins at a sample that waits."""
        if session.stage is Stage.ENDED:
            return
        self.metrics.missed(0, session.skip(origin))
        session.plan, session.stage, session.ready = plan, Stage.LIVE, dict(ready)
        session.notes = list(ready.get("notes", ()))
        self.host.post(Message(OPEN, session.number, content=plan))
        for listener in session.listeners:
            listener.tell("ready", **session.ready)
        self._feed(session)

    def _feed(self, session: Session) -> None:
        while session.stage is Stage.LIVE and (block := session.block()) is not None:
            first, samples, arrived = block
            self.host.post(Message(BLOCK, session.number, first, arrived, content=samples.astype("<f8").tobytes()))

    def _deliver(self, message: Message) -> None:
        session = self.by_number.get(message.session)
        if session is None:
            return
        if message.kind == FAILED:
            fields = {"session": session.about.id, "found": message.content.decode("utf-8", "replace")}
            log.error("a stream has failed", extra={"fields": fields})
            self.close(session, End(1011, 500, _UNEXPECTED))
        elif message.kind == REFUSED:
            fault = {"field": "samples", "found": "signals whose forces are not finite", "allowed": "signals of the sensors"}
            self.close(session, End(1008, 422, "samples: found signals whose forces are not finite", (fault,)))
        elif message.kind == FORCES:
            values = np.frombuffer(message.content, "<f8").reshape(-1, len(session.about.axes))
            delay = time.monotonic() - message.arrived
            session.drift, session.known = message.drift, message.known > 0.0
            session.forces(message.first, values, delay)
            self.metrics.streamed(values.shape[0], delay)
            self._feed(session)

    def _anew(self) -> None:
        for session in list(self.sessions.values()):
            if session.stage is Stage.LIVE:
                self.metrics.missed(0, session.lost_process())
                self.host.post(Message(OPEN, session.number, content=session.plan))
                for listener in session.listeners:
                    listener.tell("restarted", detail="the observer begins anew")
                self._feed(session)

    async def _tick(self) -> None:
        """Tell everybody each second; end what nobody feeds."""
        while True:
            await asyncio.sleep(1.0)
            for session in list(self.sessions.values()):
                if time.monotonic() - session.touched > self.limits.idle and not session.finishing:
                    self.close(session, End(1008, 408, f"no new sample in {self.limits.idle:g} s"))
                    continue
                if session.frames > MOST_FRAMES:
                    detail = f"{session.frames} frames in a second, at most {MOST_FRAMES} are taken: put more samples into each"
                    self.close(session, End(1008, 429, detail))
                    continue
                session.frames = 0
                self.tell_status(session)

    def tell_status(self, session: Session, event: str = "status") -> None:
        """Tell all who listen how a session stands."""
        session.notes = [*session.ready.get("notes", ())]
        if abs(session.drift) > self.limits.drift:
            percent = f"{100.0 * session.drift:+.2f} %"
            session.notes.append(f"the spindle's speed is {percent} from the one that the observer was made for: open a new stream")
        if not session.known:
            session.notes.append("the spindle's angle is not told by the signals now: run-out may be left in")
        status = session.status()
        for listener in session.listeners:
            listener.tell(event, **status, unread=listener.unread)
