"""The stream process: spawned, at the priority of the service, with its kernels compiled before the first session."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable
from typing import Protocol

from api.log_lines import telling
from api.processes import BackOff, Child
from api.streams.engine import HEADER, READY, Engine, Message
from api.work.kernels import Kernels
from api.work.pool import prepare_observers

log = logging.getLogger("rcsa_ident.service")
#: Restarts in succession without a pause, and time for the process to end by itself [s].
AT_ONCE, FAREWELL = 4, 3.0


class Host(Protocol):
    """Where the observers of sessions run."""

    async def start(self, deliver: Callable[[Message], None], anew: Callable[[], None]) -> None:
        """Start; `deliver` takes every answer, `anew` is called after a restart, when all sessions must be opened again."""

    def post(self, message: Message) -> None:
        """Send a message."""

    async def stop(self) -> None:
        """End."""

    @property
    def ready(self) -> bool:
        """Whether the process answers."""


class StreamProcess:
    """A spawned process behind a socket pair, restarted when it dies."""

    def __init__(self, kernels: Kernels = Kernels()) -> None:  # noqa: B008 - never changed
        self.kernels = kernels
        self.process: Child | None = None
        self.writer: asyncio.StreamWriter | None = None
        self.task: asyncio.Task[None] | None = None
        self.ready = False

    async def start(self, deliver: Callable[[Message], None], anew: Callable[[], None]) -> None:
        reader = await self._spawned()
        self.task = asyncio.create_task(self._follow(reader, deliver, anew))

    async def _spawned(self) -> asyncio.StreamReader:
        ours, theirs = socket.socketpair()
        self.process = await asyncio.to_thread(Child, serve, theirs, self.kernels, name="rcsa-ident-streams")
        theirs.close()
        reader, self.writer = await asyncio.open_connection(sock=ours)
        return reader

    async def _follow(self, reader: asyncio.StreamReader, deliver: Callable[[Message], None], anew: Callable[[], None]) -> None:
        back_off = BackOff(AT_ONCE)
        while True:
            with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
                while True:
                    message = await _received(reader)
                    if message.kind == READY:
                        self.ready = True
                    else:
                        deliver(message)
            self.ready = False
            if self.writer is not None:
                self.writer.close()
                self.writer = None
            assert self.process is not None
            pause = back_off.pause(self.process)
            log.error("the process of the streams has ended", extra={"fields": {"failures": back_off.failures}})
            await asyncio.sleep(pause)
            reader = await self._spawned()
            anew()

    def post(self, message: Message) -> None:
        if self.writer is not None:
            self.writer.write(message.packed())

    async def stop(self) -> None:
        self.ready = False
        if self.task is not None:
            self.task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self.task
        if self.writer is not None:
            # the process ends at the end of its input
            self.writer.close()
            self.writer = None
        if self.process is not None:
            await asyncio.to_thread(self.process.end, FAREWELL)
            self.process = None


async def _received(reader: asyncio.StreamReader) -> Message:
    kind, session, first, arrived, drift, known, length = HEADER.unpack(await reader.readexactly(HEADER.size))
    return Message(kind, session, first, arrived, drift, known, await reader.readexactly(length))


def serve(connection: socket.socket, kernels: Kernels) -> None:
    """Answer messages until the service closes its end."""
    with contextlib.suppress(OSError), open("/proc/self/comm", "w", encoding="utf-8") as name:
        # its name in `ps` and `top`
        name.write("rcsa-streams")
    prepare_observers(kernels)

    engine, source = Engine(), connection.makefile("rb", buffering=1 << 16)
    with contextlib.suppress(OSError):
        connection.sendall(Message(READY).packed())
        while head := source.read(HEADER.size):
            if len(head) < HEADER.size:
                return
            kind, session, first, arrived, drift, known, length = HEADER.unpack(head)
            content = source.read(length)
            if len(content) < length:
                return
            with telling(stream=str(session)):
                answer = engine.answer(Message(kind, session, first, arrived, drift, known, content))
            if answer is not None:
                connection.sendall(answer.packed())
