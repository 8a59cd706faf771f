"""Job workers beside the service: processes of their own, at lower priority, started again when they die, gone with it."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.context import SpawnProcess
from typing import Any

log = logging.getLogger("rcsa_ident.jobs")
#: Seconds between two looks, the longest pause before one that dies at once is started again, and until which one ends by itself.
LOOK, PAUSE, FAREWELL = 0.2, 30.0, 5.0
#: Takes what sets ready, and works until the event is set.
Work = Callable[[Any, Callable[[], None], threading.Event], None]


@dataclass(slots=True)
class _Member:
    process: SpawnProcess
    ready: Any
    started: float
    falls: int = 0
    again: float = field(default=0.0)


class Supervisor:
    """Worker processes.

    Parameters
    ----------
    count : int
    work : callable of (settings, ready, stop)
        What each of them does; its module has to be importable.
    settings : object
        That crosses processes.
    nice : int
        How far they step back behind others.
    """

    def __init__(self, count: int, work: Work, settings: Any, nice: int = 0) -> None:
        self.count, self.work, self.settings, self.nice = count, work, settings, nice
        self.members: list[_Member] = []
        self.ending = threading.Event()
        self.watch: threading.Thread | None = None

    @property
    def ready(self) -> bool:
        """Whether a worker is there that takes jobs, or will in a moment, where this crew should have some."""
        return self.count == 0 or any(m.process.is_alive() and (m.ready.value or not m.falls) for m in self.members)

    def start(self) -> None:
        """Start all workers."""
        # each computes on one core; read by the libraries when they are first imported there
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
            os.environ.setdefault(name, "1")
        self.members = [self._started() for _ in range(self.count)]
        self.watch = threading.Thread(target=self._watch, daemon=True)
        self.watch.start()

    def stop(self) -> None:
        """End all workers; what they are at goes on after the next start, or elsewhere."""
        self.ending.set()
        if self.watch is not None:
            self.watch.join()
        for member in self.members:
            member.process.terminate()
        for member in self.members:
            member.process.join(FAREWELL)
            if member.process.is_alive():
                member.process.kill()
                member.process.join()

    def _started(self) -> _Member:
        context = multiprocessing.get_context("spawn")
        # without a lock, which a process that is killed may hold for ever
        ready = context.Value("b", 0, lock=False)
        process = context.Process(target=_member, args=(self.work, self.settings, self.nice, ready), daemon=True)
        process.start()
        return _Member(process, ready, time.monotonic())

    def _watch(self) -> None:
        while not self.ending.wait(LOOK):
            for i, member in enumerate(self.members):
                if member.process.is_alive():
                    continue
                now = time.monotonic()
                if member.again == 0.0:
                    # one that has lived for a while is missed at once
                    member.falls = member.falls + 1 if now - member.started < 2.0 * PAUSE else 1
                    member.again = now + (0.0 if member.falls == 1 else min(2.0 ** (member.falls - 2), PAUSE))
                    log.warning("a job worker has ended", extra={"fields": {"exit_code": member.process.exitcode}})
                if now >= member.again:
                    member.process.join()
                    fresh = self._started()
                    fresh.falls = member.falls
                    self.members[i] = fresh


def _member(work: Work, settings: Any, nice: int, ready: Any) -> None:
    """In a new process: end with the one that started it, however that ends."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    # Ctrl-C is for the service, which ends its workers
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(nice)
    work(settings, lambda: setattr(ready, "value", 1), stop)
    # what computes in a thread does not end by itself
    os._exit(0)
