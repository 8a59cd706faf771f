"""The reader process: reads uploads within limits of memory and time, and is replaced where an upload exceeds them."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from api.files import Full, no_room
from api.processes import Child, limit, limit_memory, spawn_context
from api.reading import reader_tasks
from api.work.pool import Busy
from rcsa_ident.errors import InputError

log = logging.getLogger("rcsa_ident.reading")
#: Time limit for the start of the process, including imports and compilation [s].
_START = 300.0


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one call.

    Parameters
    ----------
    memory : int [MiB]
        Address space beyond that of the idle process.
    seconds : float [s]
        CPU time.
    wall_seconds : float [s]
        Wall-clock time.
    calls : int
        After which the process is replaced.
    """

    memory: int = 2048
    seconds: float = 60.0
    wall_seconds: float = 120.0
    calls: int = 200

    @property
    def costly(self) -> InputError:
        """The refusal of an upload that costs more."""
        found = f"a file that costs more than {self.memory} MiB or {self.seconds:g} s to read"
        return InputError("recording", found, "a recording that is cheaper to read: fewer samples, or a simpler format")


class Reader:
    """A spawned process that answers one call at a time.

    Parameters
    ----------
    limits : Limits
    queue : int
        Calls that may wait beyond the running one.
    prepare : callable
        Called first in the process, without limits.
    """

    def __init__(self, limits: Limits, queue: int, prepare: Callable[[], None] = reader_tasks.warm) -> None:
        self.limits, self.queue, self.prepare, self.waiting = limits, queue, prepare, 0
        self.threads: ThreadPoolExecutor | None = None
        self.child: _Reading | None = None

    def start(self) -> None:
        self.threads = ThreadPoolExecutor(1, "reader")
        self.child = _Reading(self.limits, self.prepare)

    @property
    def ready(self) -> bool:
        return self.child is not None

    async def run(self, call: Callable[..., Any], *arguments: Any) -> Any:
        if self.threads is None or self.waiting > self.queue:
            raise Busy
        self.waiting += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self.threads, self._ask, call, arguments)
        finally:
            self.waiting -= 1

    def _ask(self, call: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        # a process killed from outside says nothing about the upload: ask a new one once
        for _ in range(2):
            if self.threads is None:
                break
            self.child = child = self.child or _Reading(self.limits, self.prepare)
            kind, answer = child.ask(call, arguments)
            if kind in ("costly", "killed") or child.calls >= self.limits.calls:
                self._replace()
            if kind == "answer":
                return answer
            if kind == "costly":
                raise self.limits.costly
            if kind == "full":
                raise Full
            if kind == "refused":
                raise InputError(*answer)
            if kind == "failed":
                log.error("a call of the reader has failed", extra={"fields": {"error": answer}})
                raise InputError("recording", "a file that cannot be read", "a complete file of its format")
        raise Busy

    def _replace(self) -> None:
        if self.child is not None:
            self.child.end()
        self.child = None if self.threads is None else _Reading(self.limits, self.prepare)

    def stop(self) -> None:
        threads, self.threads = self.threads, None
        if self.child is not None:
            # a running call ends with its process
            self.child.process.kill()
        if threads is not None:
            threads.shutdown(wait=True, cancel_futures=True)
        if self.child is not None:
            self.child.end()
        self.child = None


class _Reading:
    """One reader process and the pipe to it."""

    def __init__(self, limits: Limits, prepare: Callable[[], None]) -> None:
        self.limits, self.calls, self.ready = limits, 0, False
        self.pipe, theirs = spawn_context().Pipe()
        self.process = Child(_serve, theirs, limits, prepare, name="reader")
        theirs.close()

    def ask(self, call: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, Any]:
        """Return the outcome of a call (answer, refused, failed, costly, full disk, or killed from outside) and its content."""
        try:
            if not self.ready:
                self._receive(_START)
                self.ready = True
            self.calls += 1
            self.pipe.send((call, arguments))
            kind, answer = self._receive(self.limits.wall_seconds)
        except TimeoutError:
            self.process.kill()
            return "costly", None
        except BrokenPipeError:
            # it ended before this call
            return "killed", None
        except (EOFError, OSError):
            self.process.join(10.0)
            return "killed" if self.process.killed or not self.ready else "costly", None
        return kind, answer

    def _receive(self, seconds: float) -> Any:
        if not self.pipe.poll(seconds):
            raise TimeoutError
        # parsed as JSON, never unpickled: an upload may have taken the process over
        return json.loads(self.pipe.recv_bytes())

    def end(self) -> None:
        """End the process: by closing its pipe, else by SIGKILL."""
        self.pipe.close()
        self.process.end(0.5)


def _serve(pipe: Connection, limits: Limits, prepare: Callable[[], None]) -> None:
    """In the process: answer calls until the pipe is closed."""
    from rcsa_ident.io.hdf5 import LARGEST_DATA

    prepare()
    limit_memory(limits.memory)
    # no file larger than the largest result
    limit("RLIMIT_FSIZE", LARGEST_DATA + LARGEST_DATA // 8)
    pipe.send_bytes(b"{}")
    while True:
        try:
            call, arguments = pipe.recv()
        except EOFError:
            return
        # CPU time counts from the start of the process
        limit("RLIMIT_CPU", int(time.process_time() + limits.seconds) + 1, -1)
        pipe.send_bytes(_answer(call, arguments))


def _answer(call: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    kind, answer = "answer", ""
    try:
        return json.dumps([kind, call(*arguments)], allow_nan=False).encode()
    except InputError as error:
        found = error.found if isinstance(error.found, str) else repr(error.found)
        return json.dumps(["refused", [error.field, found[:1000], error.allowed[:1000], error.where]]).encode()
    except MemoryError:
        kind = "costly"
    except Exception as error:
        if no_room(error):
            return json.dumps(["full", ""]).encode()
        kind, answer = "failed", f"{type(error).__name__}: {error}"[:1000]
    return json.dumps([kind, answer]).encode()
