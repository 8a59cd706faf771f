"""The reader process: reads uploads within limits of memory and time, and is replaced where an upload exceeds them.

On Linux a copy of it answers each call and ends: cut off from other files, network and processes, see `api.confinement`, it sees the files
of its call alone, in its room, and leaves nothing to the next one.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from api.confined import Confined, Ended, Line
from api.confinement import Confinement, confine
from api.files import Full, is_short, no_room
from api.log_lines import ids, telling
from api.processes import limit, limit_memory
from api.reading import reader_tasks
from api.reading.room import Room
from api.shares import FairThreads
from api.work.pool import Busy
from rcsa_ident.base.errors import InputError

log = logging.getLogger("rcsa_ident.reading")
#: Time limit for the start of the process, including imports and compilation [s].
_START = 300.0
#: Free space [bytes] that a library may ask for at once: below it, what fails says nothing about the file.
_LEAST = 16 << 20


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one call.

    `memory` [MiB]: address space beyond that of the idle process
    `seconds` [s]: CPU time
    `wall_seconds` [s]: wall-clock time
    `calls`: after which the process is replaced
    """

    memory: int = 2048
    seconds: float = 60.0
    wall_seconds: float = 120.0
    calls: int = 200

    @property
    def costly(self) -> InputError:
        """The refusal of an upload that costs more."""
        found = f"a file that costs more than {self.memory} MiB or {self.seconds:g} s to read"
        return InputError("file", found, "a file that is cheaper to read: fewer samples or entries, or a simpler format")


class Reader:
    """A spawned process that answers one call at a time.

    `queue`: calls that may wait beyond the running one
    `prepare`: called first in the process, without limits
    `folder`: on the disk of the uploads, for the files of a call; nothing else is in it
    `free_bytes`: that uploads leave free there
    """

    def __init__(
        self,
        limits: Limits,
        queue: int,
        prepare: Callable[[], None] = reader_tasks.warm,
        folder: Path | None = None,
        free_bytes: int = 0,
    ) -> None:
        self.limits, self.queue, self.prepare, self.folder, self.waiting = limits, queue, prepare, folder, 0
        self.least = max(free_bytes, _LEAST)
        self.threads: FairThreads | None = None
        self.child: _Reading | None = None

    def start(self) -> None:
        if self.folder is not None:
            # rooms of a service that was killed hold on to files that may be deleted since
            shutil.rmtree(self.folder, ignore_errors=True)
        self.threads = FairThreads(1, "reader")
        self._replace()
        if self.child is not None:
            # what holds is said at the service's start, not at its first upload
            self.threads.submit(self.child.greet)

    @property
    def ready(self) -> bool:
        return self.threads is not None

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
            self.child = child = self.child or self._new()
            kind, answer = child.ask(call, arguments)
            if child.ended or child.calls >= self.limits.calls:
                self._replace()
            if kind == "answer":
                return answer
            if kind == "costly":
                raise self.limits.costly
            if kind == "full":
                raise Full
            if kind == "refused":
                raise answer
            if kind == "failed":
                log.error("a call of the reader has failed", extra={"fields": {"error": answer}})
                raise InputError("file", "one that cannot be read", "a complete file of its format")
        raise Busy

    def _new(self) -> _Reading:
        return _Reading(self.limits, self.prepare, Room(self.folder), self.least)

    def _replace(self) -> None:
        child, self.child = self.child, None
        if child is not None:
            child.end()
        if self.threads is not None:
            # where the disk has no room for another one, the next call tries again, and says so
            with contextlib.suppress(OSError):
                self.child = self._new()

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
    """One reader process and its room."""

    def __init__(self, limits: Limits, prepare: Callable[[], None], room: Room, least: int) -> None:
        self.limits, self.room, self.least, self.calls, self.ended = limits, room, least, 0, False
        self.held: Confinement | None = None
        self.process = Confined(_serve, limits, prepare, room)

    def ask(self, call: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, Any]:
        """Return the outcome of a call (answer, refused, failed, costly, full disk, or killed from outside) and its content."""
        try:
            if not self.greet():
                # a slow start says nothing about the upload
                return "killed", None
            kind, answer = self._outcome(call, self.room.take_in(arguments))
            if kind == "answer":
                self.room.give_out()
            elif is_short(self.room.folder, self.least):
                # libraries fail in many ways where they cannot write, and some end the process
                return "full", None
            return kind, answer
        except OSError as error:
            if not no_room(error):
                raise
            return "full", None
        finally:
            self.room.clear()

    def _outcome(self, call: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, Any]:
        """Ask the process; `ended` is set where it answers no further call."""
        self.calls += 1
        try:
            self.process.send(call, arguments, ids())
        except Ended:
            # before this call
            self.ended = True
            return "killed", None
        try:
            kind, answer = self.process.receive(self.limits.wall_seconds)
            return kind, InputError(*answer) if kind == "refused" else answer
        except (TimeoutError, TypeError, ValueError):
            # too late, or no answer
            self.ended = True
            return "costly", None
        except Ended:
            self.ended = True
            return "killed" if self.process.was_killed() else "costly", None

    def greet(self) -> bool:
        """Wait until the process is ready, say what holds in it, and return whether it takes calls."""
        if self.held is None:
            try:
                self.held = held = Confinement(*self.process.receive(_START))
            except (Ended, TimeoutError, TypeError, ValueError):
                self.ended = True
                return False
            # links are the service's own files under other names: without the filter their modes could be changed
            self.room.links = held.calls
            level = logging.INFO if held.whole else logging.WARNING
            log.log(level, "reader process: %s", held, extra={"fields": {"files": held.files, "calls": held.calls}})
        return True

    def end(self) -> None:
        """End the process at once, and remove its room."""
        self.process.end()
        self.room.remove()


def _serve(line: Line, limits: Limits, prepare: Callable[[], None], room: Room) -> None:
    """In the process: answer calls until the service ends it."""
    prepare()
    if sys.platform == "linux":
        _serve_apart(line, limits, room)
    _limit(limits, room)
    line.follow()
    line.tell(json.dumps([False, False]))
    while True:
        call, arguments, known = line.take()
        # CPU time counts from the start of the process
        limit("RLIMIT_CPU", int(time.process_time() + limits.seconds) + 1, -1)
        line.tell(_answer(call, arguments, known))


def _serve_apart(line: Line, limits: Limits, room: Room) -> NoReturn:
    """Answer each call in a copy of this process, which is cut off and ends with it: no call sees what another has left."""
    if line.apart(partial(_what_holds, limits, room)):
        line.tell(json.dumps([False, False]))
    while True:
        ended_by = line.apart(partial(_answer_cut_off, limits, room, *line.asked()))
        if ended_by:
            line.tell(json.dumps(["killed" if ended_by == signal.SIGKILL else "costly", ""]))


def _limit(limits: Limits, room: Room) -> None:
    from rcsa_ident.io.channels import LARGEST_STORED

    limit_memory(limits.memory)
    # no file larger than the largest result
    limit("RLIMIT_FSIZE", LARGEST_STORED + LARGEST_STORED // 8)
    tempfile.tempdir = str(room.made)


def _cut_off(limits: Limits, room: Room) -> Confinement:
    _limit(limits, room)
    # a second later it is ended even where it takes no heed
    limit("RLIMIT_CPU", int(limits.seconds) + 1, int(limits.seconds) + 2)
    # no further process of this user, and no thread, is started from here
    limit("RLIMIT_NPROC", 0)
    return confine([room.given], [room.made])


def _what_holds(limits: Limits, room: Room) -> str:
    held = _cut_off(limits, room)
    return json.dumps([held.files, held.calls])


def _answer_cut_off(limits: Limits, room: Room, *asked: Any) -> str:
    _cut_off(limits, room)
    return _answer(*asked)


def _answer(call: Callable[..., Any], arguments: tuple[Any, ...], known: Mapping[str, str]) -> str:
    """What the service is told of a call; `known` are the ids of its lines in the log."""
    kind, answer = "answer", ""
    try:
        with telling(**known):
            return json.dumps([kind, call(*arguments)], allow_nan=False)
    except InputError as error:
        found = error.found if isinstance(error.found, str) else repr(error.found)
        return json.dumps(["refused", [error.field, found[:1000], error.allowed[:1000], error.where]])
    except MemoryError:
        kind = "costly"
    except Exception as error:
        if no_room(error):
            return json.dumps(["full", ""])
        kind, answer = "failed", f"{type(error).__name__}: {error}"[:1000]
    return json.dumps([kind, answer])
