"""The process of the streams: spawned, at the priority of the service, warm before it is asked."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import multiprocessing
import os
import socket
import time
from collections.abc import Callable
from typing import Any, Protocol

from api.streams.engine import HEADER, READY, Engine, Message

log = logging.getLogger("rcsa_ident.service")
#: A process that ends so often in so many seconds is not started again.
MOST_STARTS, STARTS_WITHIN = 5, 60.0


class Host(Protocol):
    """Where sessions are computed."""

    async def start(self, deliver: Callable[[Message], None], anew: Callable[[], None]) -> None:
        """Begin; `deliver` takes every answer, `anew` is called where all sessions have been lost and must be opened again."""

    def post(self, message: Message) -> None:
        """Send a message."""

    async def stop(self) -> None:
        """End."""

    @property
    def ready(self) -> bool:
        """Whether it answers."""


class StreamProcess:
    """A spawned process behind a pair of sockets; where it dies it is started again."""

    def __init__(self) -> None:
        self.process: Any = None
        self.writer: asyncio.StreamWriter | None = None
        self.task: asyncio.Task[None] | None = None
        self.ready = False

    async def start(self, deliver: Callable[[Message], None], anew: Callable[[], None]) -> None:
        reader = await self._spawned()
        self.task = asyncio.create_task(self._follow(reader, deliver, anew))

    async def _spawned(self) -> asyncio.StreamReader:
        ours, theirs = socket.socketpair()
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
            os.environ.setdefault(name, "1")
        context = multiprocessing.get_context("spawn")
        self.process = context.Process(target=serve, args=(theirs,), name="rcsa-ident-streams", daemon=True)
        await asyncio.get_running_loop().run_in_executor(None, self.process.start)
        theirs.close()
        reader, self.writer = await asyncio.open_connection(sock=ours)
        return reader

    async def _follow(self, reader: asyncio.StreamReader, deliver: Callable[[Message], None], anew: Callable[[], None]) -> None:
        starts = [time.monotonic()]
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
            starts = [t for t in starts if time.monotonic() - t < STARTS_WITHIN]
            log.error("the process of the streams has ended", extra={"fields": {"starts": len(starts)}})
            if len(starts) >= MOST_STARTS:
                await asyncio.sleep(STARTS_WITHIN)
            starts.append(time.monotonic())
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
            # its end of the connection is where the process learns of it
            self.writer.close()
            self.writer = None
        if self.process is not None:
            await asyncio.get_running_loop().run_in_executor(None, self.process.join, 5.0)
            if self.process.is_alive():
                self.process.kill()
            self.process = None


async def _received(reader: asyncio.StreamReader) -> Message:
    kind, session, first, arrived, drift, known, length = HEADER.unpack(await reader.readexactly(HEADER.size))
    return Message(kind, session, first, arrived, drift, known, await reader.readexactly(length))


def serve(connection: socket.socket) -> None:
    """Answer messages until the service ends, however it does."""
    import signal

    # whoever stops the service with a key stops this process through it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError), open("/proc/self/comm", "w") as name:
        # what a list of processes calls it
        name.write("rcsa-streams")
    from rcsa_ident.workflows.compile_kernels import STEPS

    STEPS["force observer"]()
    import rcsa_ident.workflows.stream_forces  # noqa: F401

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
            answer = engine.answer(Message(kind, session, first, arrived, drift, known, content))
            if answer is not None:
                connection.sendall(answer.packed())
