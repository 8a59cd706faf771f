"""Supervisor of the job workers beside the service: processes at lower priority, restarted when they die, ended with the service."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from api.processes import BackOff, Child, spawn_context

log = logging.getLogger("rcsa_ident.jobs")
#: Interval between two checks of the workers, and time for one to end before it is killed [s].
LOOK, FAREWELL = 0.2, 3.0
#: Takes the settings and a function that reports readiness, and works until the event is set.
Work = Callable[[Any, Callable[[], None], threading.Event], None]


class Supervisor:
    """Supervisor of worker processes.

    `works`: sequence of callable of (settings, ready, stop); what each worker does; importable by name
    `settings`: picklable
    `nice`: increment of their niceness
    """

    def __init__(self, works: Sequence[Work], settings: Any, nice: int = 0) -> None:
        self.works, self.settings, self.nice = works, settings, nice
        self.members: list[_Member] = []
        self.ending = threading.Event()
        self.watch: threading.Thread | None = None

    @property
    def ready(self) -> bool:
        """Whether a worker takes jobs or is at its first start; true where there should be none."""
        return not self.works or any(member.hopeful for member in self.members)

    def start(self) -> None:
        """Start all workers."""
        self.members = [_Member(work, self.settings, self.nice) for work in self.works]
        self.watch = threading.Thread(target=self._watch, daemon=True)
        self.watch.start()

    def _watch(self) -> None:
        while not self.ending.wait(LOOK):
            for member in self.members:
                member.keep_alive()

    def stop(self) -> None:
        """End all workers; their jobs continue after the next start, or elsewhere."""
        self.ending.set()
        if self.watch is not None:
            self.watch.join()
        for member in self.members:
            member.child.terminate()
        for member in self.members:
            member.child.end(FAREWELL)


class _Member:
    """A worker process that is restarted when it dies."""

    def __init__(self, *arguments: Any) -> None:
        # without a lock, which a killed process could hold for ever
        self.arguments, self.ready = arguments, spawn_context().Value("b", 0, lock=False)
        self.back_off, self.due = BackOff(), 0.0
        self._start()

    def _start(self) -> None:
        self.ready.value, self.due = 0, 0.0
        self.child = Child(_work, *self.arguments, self.ready, name="job worker")

    @property
    def hopeful(self) -> bool:
        """Whether it takes jobs, or is at its first start."""
        return self.child.is_alive() and bool(self.ready.value or not self.back_off.failures)

    def keep_alive(self) -> None:
        """Restart the process when it has died and its pause is over."""
        if self.child.is_alive():
            return
        if not self.due:
            self.due = time.monotonic() + self.back_off.pause(self.child)
            log.warning("a job worker has ended", extra={"fields": {"exit_code": self.child.exitcode}})
        if time.monotonic() >= self.due:
            self._start()


def _work(work: Work, settings: Any, nice: int, ready: Any) -> None:
    """In a new process: work until SIGTERM."""
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    if hasattr(os, "nice"):
        os.nice(nice)
    work(settings, lambda: setattr(ready, "value", 1), stop)
    # threads that still compute do not end by themselves
    os._exit(0)
