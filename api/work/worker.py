"""A worker: a process that answers one call at a time within limits of time and memory, and the service's end of it."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from api.confined import Confined, Ended, Line
from api.confinement import confine
from api.log_lines import ids, telling
from api.processes import limit, limit_memory
from api.work.requests import TooLong
from rcsa_ident.base.errors import InputError

#: Time limit for the start of a process, including imports and compilation [s].
_START = 300.0
_SMALLER = "fewer speeds or frequencies, no bands, zero-order"


@dataclass(frozen=True, slots=True)
class QueryLimits:
    """What one query may cost.

    `seconds` [s]: by the clock, once a process works on it
    `memory` [MiB]: address space beyond that of the idle process
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


class Failed(Exception):
    """A call has failed in its process, and no input is at fault."""


class Worker:
    """A process of its own and the line to it; what it answers is JSON, so that tuples come as lists.

    `prepare`, `spare`: what the process does before it takes calls, and as soon as no call waits; importable by name
    """

    def __init__(self, limits: QueryLimits, prepare: Callable[[], None], spare: Callable[[], None]) -> None:
        self.limits, self.ready, self.fit, self.asked = limits, False, True, 0
        self.process = Confined(_serve, limits.memory, prepare, spare)

    def begin(self) -> None:
        """Wait until the process takes calls; raises `Killed` where it never will."""
        if self.ready or not self.fit:
            return
        try:
            self.ready = bool(self.process.receive(_START))
        except (Ended, TimeoutError, ValueError):
            self.ready = False
        self.fit = self.ready
        if not self.fit:
            raise Killed

    def ask(self, call: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Return the answer of a call.

        Raises `TooLong`, `InputError`: the call says so, or has exceeded the limit of time, or of memory; then the process is of no further
            use.
        Raises `Failed`: the call has raised something else.
        Raises `Killed`.
        """
        try:
            kind, answer = self._outcome(call, arguments)
            if kind == "refused":
                answer = _refusal(*answer)
            elif kind == "failed":
                answer = _failure(*answer)
        except (TypeError, ValueError):
            # no answer
            kind, answer = "killed", None
        self.fit = kind in ("answer", "refused", "failed")
        if not self.fit:
            self.process.kill()
        if kind == "answer":
            return answer
        if kind == "too long":
            raise self.limits.too_long
        if kind == "too large":
            raise self.limits.too_large
        if kind in ("refused", "failed"):
            raise answer
        raise Killed

    def _outcome(self, call: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, Any]:
        try:
            self.process.send(call, arguments, ids())
            self.asked += 1
            # what the process still prepares is not the call's time
            self.process.receive(_START)
        except (Ended, TimeoutError):
            return "killed", None
        try:
            kind, answer = self.process.receive(self.limits.seconds)
            return kind, answer
        except TimeoutError:
            return "too long", None
        except Ended:
            # a library may end the process where it gets no memory
            return "killed" if self.process.was_killed() else "too large", None

    def end(self) -> None:
        """End the process at once."""
        self.process.end()


def _refusal(field: str, found: object, allowed: str, where: str, seconds: float | None) -> InputError:
    return InputError(field, found, allowed, where) if seconds is None else TooLong(field, found, allowed, where, seconds)


def _failure(words: str, told: str) -> Failed:
    error = Failed(words)
    error.add_note(told)
    return error


def _serve(line: Line, memory: int, prepare: Callable[[], None], spare: Callable[[], None]) -> None:
    """In the process: answer calls until the service ends it."""
    prepare()
    limit_memory(memory)
    line.follow()
    # no further process of this user, and no thread, is started from here
    limit("RLIMIT_NPROC", 0)
    # its files stay open: what it compiles it keeps for all
    confine(None)
    line.tell("true")
    if line.idle:
        spare()
    while True:
        call, arguments, known = line.take()
        # it has begun
        line.tell("true")
        with telling(**known):
            line.tell(_answer(call, arguments))


def _answer(call: Callable[..., Any], arguments: tuple[Any, ...]) -> str:
    try:
        return json.dumps(["answer", call(*arguments)])
    except InputError as error:
        seconds = error.seconds if isinstance(error, TooLong) else None
        return json.dumps(["refused", [error.field, error.found, error.allowed, error.where, seconds]], default=repr)
    except MemoryError:
        return json.dumps(["too large", None])
    except Exception as error:
        # its traceback does not cross processes
        return json.dumps(["failed", [f"{type(error).__name__}: {error}", traceback.format_exc()]])
