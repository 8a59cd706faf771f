"""Child processes of the service: spawned, with one thread of computation each, and gone when the service is, however it ends."""

from __future__ import annotations

import ctypes
import gc
import importlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from types import ModuleType
from typing import Any

import psutil

from api import log_lines

#: A child that has lived this long [s] is not counted as one that fails at once.
LIVED = 60.0
MEBIBYTE = 1 << 20


def spawn_context() -> SpawnContext:
    """Return the context in which children start: they inherit neither threads nor locks, and compute on one core each."""
    # the libraries read these when a child first imports them
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    return multiprocessing.get_context("spawn")


def follow_parent() -> None:
    """In a child: end this process as soon as its parent has ended, even by SIGKILL."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def _resource() -> ModuleType | None:
    """The module that limits what a process takes; Windows has none."""
    try:
        return importlib.import_module("resource")
    except ImportError:
        return None


def memory_is_limited() -> bool:
    """Whether the system keeps a process to the memory that `limit_memory` allows; macOS refuses."""
    return _resource() is not None and sys.platform != "darwin"


def limit(name: str, soft: int, hard: int | None = None) -> None:
    """In a child: set one of the limits of `resource` by its name, where the system has it; -1 is none."""
    resource = _resource()
    if resource is not None:
        resource.setrlimit(getattr(resource, name), (soft, soft if hard is None else hard))


def limit_memory(mebibytes: int) -> None:
    """In a child: let it take so much address space beyond what it has now."""
    if memory_is_limited():
        limit("RLIMIT_AS", psutil.Process().memory_info().vms + mebibytes * MEBIBYTE)
    # no core dump of a client's data
    limit("RLIMIT_CORE", 0)


def share_heaps() -> None:
    """Let the threads of this process share two heaps, where the C library is glibc: each of many keeps free what one moment took."""
    if sys.platform == "linux":
        # M_ARENA_MAX of malloc.h; musl has no mallopt
        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
        if mallopt is not None:
            mallopt(-8, 2)


def leave_out_what_stays() -> None:
    """Let the collector look at what this process makes from now on: beside its libraries' objects it would put off its full collections.

    Python collects all only once a quarter more objects have outlived two collections than there are; until then what requests leave in
    cycles, with the bodies that hang on them, is kept.
    """
    gc.collect()
    gc.freeze()
    # that there is next to nothing now is known only to a collection
    gc.collect()


@contextmanager
def held(path: Path) -> Iterator[bool]:
    """Hold a file as the only process that does, and yield whether it is; the system lets go of it however the process ends."""
    import filelock

    lock = filelock.FileLock(path, timeout=0)
    try:
        lock.acquire()
    except filelock.Timeout:
        yield False
        return
    try:
        yield True
    finally:
        lock.release()


class Child(SpawnProcess):
    """A process that is started at once and follows its parent.

    `call`: what it does; importable by name
    `*arguments`: that cross processes
    """

    def __init__(self, call: Callable[..., None], *arguments: Any, name: str) -> None:
        spawn_context()
        super().__init__(target=call, args=arguments, name=name, daemon=True)
        self.born = time.monotonic()
        self.start()

    def run(self) -> None:
        follow_parent()
        # Ctrl-C reaches the whole group of processes: the service takes it and ends its children
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        log_lines.start()
        super().run()

    @property
    def killed(self) -> bool:
        """Whether it was ended by force; not by itself, nor by a limit of processor time."""
        return self.exitcode == -getattr(signal, "SIGKILL", signal.SIGTERM)

    def end(self, seconds: float) -> None:
        """Wait for the process, at most so long, then kill it."""
        self.join(seconds)
        if self.is_alive():
            self.kill()
            self.join()


class BackOff:
    """The pause before a child is started again: none at first, then 1, 2, 4 … 30 s while it fails soon after each start.

    `at_once`: restarts in succession that come without a pause
    """

    def __init__(self, at_once: int = 1) -> None:
        self.at_once, self.failures = at_once, 0

    def pause(self, child: Child) -> float:
        """Return the pause [s] after the end of a child."""
        self.failures = self.failures + 1 if time.monotonic() - child.born < LIVED else 1
        return 0.0 if self.failures <= self.at_once else min(2.0 ** (self.failures - self.at_once - 1), 30.0)
