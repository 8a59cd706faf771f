"""A worker: a process that answers one call at a time within limits of time and memory, and the service's end of it."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from api.log_lines import ids, telling
from api.processes import Child, limit_memory, spawn_context
from api.work.requests import TooLong
from rcsa_ident.errors import InputError

#: Time limit for the start of a process, including imports and compilation [s].
_START = 300.0
_SMALLER = "fewer speeds or frequencies, no bands, zero-order"


@dataclass(frozen=True, slots=True)
class QueryLimits:
    """What one query may cost.

    Parameters
    ----------
    seconds : float [s]
        By the clock, once a process works on it.
    memory : int [MiB]
        Address space beyond that of the idle process.
    """

    seconds: float = 60.0
    memory: int = 2048

    @property
    def too_long(self) -> TooLong:
        """The refusal of a query that takes longer."""
        return TooLong("query", f"one that takes more than {self.seconds:g} s", f"a shorter one ({_SMALLER})", seconds=self.seconds)

    @property
    def too_large(self) -> InputError:
        """The refusal of a query that takes more memory."""
        return InputError("query", f"one that takes more than {self.memory} MiB of memory", f"a smaller one ({_SMALLER})")


class Killed(Exception):
    """The process of a call was killed from outside."""


class Worker:
    """A spawned process and the pipe to it.

    Parameters
    ----------
    limits : QueryLimits
    prepare, spare : callable
        What the process does before it takes calls, and as soon as no call waits; importable by name.
    """

    def __init__(self, limits: QueryLimits, prepare: Callable[[], None], spare: Callable[[], None]) -> None:
        self.limits, self.ready, self.fit, self.asked = limits, False, True, 0
        self.pipe, theirs = spawn_context().Pipe()
        self.process = Child(_serve, theirs, limits.memory, prepare, spare, name="worker")
        theirs.close()

    def begin(self) -> None:
        """Wait until the process takes calls; raises `Killed` where it never will."""
        if self.ready or not self.fit:
            return
        try:
            self.ready = self.pipe.poll(_START) and bool(self.pipe.recv())
        except (EOFError, OSError):
            self.ready = False
        self.fit = self.ready
        if not self.fit:
            raise Killed

    def ask(self, call: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Return the answer of a call, or raise what it raises.

        Raises
        ------
        TooLong, InputError
            The call has exceeded the limit of time, or of memory; the process is of no further use.
        Killed
        """
        kind, answer = "killed", None
        try:
            self.pipe.send((call, arguments, ids()))
            self.asked += 1
            # what the process still prepares is not the call's time
            if self.pipe.poll(_START) and self.pipe.recv():
                kind, answer = self.pipe.recv() if self.pipe.poll(self.limits.seconds) else ("too long", None)
        except (EOFError, OSError):
            self.process.join(10.0)
            if not self.process.killed:
                # a library that ends the process where it gets no memory
                kind = "too large"
        self.fit = kind in ("answer", "raised")
        if not self.fit:
            self.process.kill()
        if kind == "answer":
            return answer
        if kind == "too long":
            raise self.limits.too_long
        if kind == "too large":
            raise self.limits.too_large
        if kind == "killed":
            raise Killed
        assert isinstance(answer, Exception)
        raise answer

    def end(self) -> None:
        """End the process at once."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


def _serve(pipe: Connection, memory: int, prepare: Callable[[], None], spare: Callable[[], None]) -> None:
    """In the process: answer calls until the pipe is closed."""
    prepare()
    limit_memory(memory)
    pipe.send(True)
    if not pipe.poll():
        spare()
    while True:
        try:
            call, arguments, known = pipe.recv()
        except EOFError:
            return
        # it has begun
        pipe.send(True)
        with telling(**known):
            pipe.send(_answer(call, arguments))


def _answer(call: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, Any]:
    try:
        return "answer", call(*arguments)
    except MemoryError:
        return "too large", None
    except Exception as error:
        if not isinstance(error, InputError):
            # its traceback does not cross processes
            error.add_note(traceback.format_exc())
        return "raised", error
