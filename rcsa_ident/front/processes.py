"""Worker processes beside the main one, which works as well, and what is shown of their work while it is done."""

from __future__ import annotations

import importlib
import io
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.reduction import ForkingPickler
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

from rcsa_ident.base.scaleout import ClusterMap

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from rcsa_ident.identification.progress import Step

#: Reading and searching do not get faster beyond it.
MOST_PROCESSES = 8
#: What a worker imports while the main process still reads the campaign's file.
EARLY = ("rcsa_ident.io.recordings.readers", "rcsa_ident.workflows.identify", "rcsa_ident.identification.evidence")
#: Names of what limits the threads of linear algebra, which is small here: further threads only wait for each other, and sums stay the
#: same on any number of cores.
THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
#: Seconds between two steps of one process that are shown.
PAUSE = 0.1
#: What the running script is called as a module, here and where another process has started it.
_SCRIPT = ("__main__", "__mp_main__")

#: Takes axis, stage and cost of a search.
Show = Callable[[str, str, float], None]


class Relay:
    """A progress callable whose copies in worker processes tell the process that made it; most of what comes in quick succession is
    dropped.

    A copy that goes elsewhere, to the machines of a cluster, tells nobody.

    `show`: takes what is told in this process
    `line`: takes it otherwise: the end of a pipe that several processes write to, each word in one piece
    """

    def __init__(self, show: Show | None = None, line: Connection | None = None) -> None:
        self.show, self.line, self.last = show, line, 0.0

    def __call__(self, step: Step) -> None:
        """Show a step, or send it."""
        now = time.monotonic()
        if now - self.last <= PAUSE:
            return
        self.last = now
        if self.show is not None:
            self.show(step.axis, step.label, step.cost)
        elif self.line is not None:
            # nobody may listen any more
            with suppress(OSError):
                self.line.send((step.axis, step.label, step.cost))

    def __reduce__(self) -> tuple[type[Relay], tuple[()]]:
        return Relay, ()


@dataclass(frozen=True, slots=True, eq=False)
class Workers:
    """A `map` that may run in several processes; results come in the order of the tasks.

    Helpers do not run the script that starts them. What it defines itself, or what cannot be pickled, is therefore computed in this process
    alone, and a `RuntimeWarning` says so.

    `helpers`: processes beside this one
    `pool`: None without helpers
    `cluster`: in place of processes here; it tells nothing on its way
    """

    helpers: int = 0
    pool: ProcessPoolExecutor | None = None
    cluster: ClusterMap | None = None

    def map(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterable[Any]:
        """Return the results of few long tasks, in their order."""
        if self.cluster is not None:
            return self.cluster(function, tasks)
        return map(function, tasks) if self.pool is None else _Shared(self.pool, function, list(tasks)).run(self.helpers)

    def map_many(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterable[Any]:
        """Return the results of many short tasks, which are sent some at a time."""
        if self.pool is None and self.cluster is None:
            return map(function, tasks)
        tasks = list(tasks)
        workers = self.helpers + 1 if self.cluster is None else self.cluster.slots
        size = max(1, min(8, len(tasks) // (4 * workers)))
        chunks = [_Chunk(function, tasks[i : i + size]) for i in range(0, len(tasks), size)]
        return (result for results in self.map(_run_chunk, chunks) for result in results)

    @contextmanager
    def listening(self, show: Show) -> Iterator[Relay]:
        """Yield a progress callable for this process and the helpers, which calls `show`; from another thread where helpers tell."""
        if self.pool is None:
            yield Relay(show)
            return
        here, there = multiprocessing.Pipe(duplex=False)
        over = threading.Event()

        def pass_on() -> None:
            while not over.is_set():
                if here.poll(PAUSE):
                    show(*here.recv())

        thread = threading.Thread(target=pass_on, daemon=True)
        thread.start()
        try:
            yield Relay(show, there)
        finally:
            over.set()
            thread.join()
            there.close()
            here.close()


@dataclass(frozen=True, slots=True, eq=False)
class _Chunk:
    function: Callable[[Any], Any]
    tasks: Sequence[Any]


def _run_chunk(chunk: _Chunk) -> list[Any]:
    return [chunk.function(task) for task in chunk.tasks]


class _Unsendable(Exception):
    """A task cannot go to a helper; the message says why."""


class _Parcel(ForkingPickler):
    """A pickler that refuses what only the running script defines: the helpers could not find it."""

    def reducer_override(self, obj: Any) -> Any:
        """Look at each function and class by the way, as the pickler will name it, and leave the work to the pickler.

        What multiprocessing itself sends may hold a connection: a relay keeps its line.
        """
        if isinstance(obj, Relay):
            return Relay, (None, None if obj.line is None or obj.line.closed else obj.line)
        if isinstance(obj, type | FunctionType) and obj.__module__ in _SCRIPT:
            raise _Unsendable(f"{obj.__qualname__} is defined in the script that runs, which the helpers do not run")
        return NotImplemented


def _packed(function: Callable[[Any], Any], task: Any) -> bytes:
    """Return a task as it is sent: packed here, since neither a helper that cannot unpack nor a pool's thread tells in words.

    Raises `_Unsendable`, which names what only the script knows, or what cannot be pickled.
    """
    held = io.BytesIO()
    try:
        _Parcel(held, pickle.HIGHEST_PROTOCOL).dump((function, task))
    except (pickle.PicklingError, AttributeError, TypeError, ValueError) as error:
        # what pickle raises, and what it is given raises: functions within functions, locks, open files
        raise _Unsendable(str(error)) from error
    return held.getvalue()


def _run_packed(parcel: bytes) -> Any:
    function, task = pickle.loads(parcel)
    return function(task)


class _Shared:
    """Tasks of which each helper has one at a time; the main process does what it would otherwise wait for, or what cannot be sent."""

    def __init__(self, pool: ProcessPoolExecutor, function: Callable[[Any], Any], tasks: Sequence[Any]) -> None:
        self.pool, self.function, self.tasks = pool, function, tasks
        self.futures: dict[int, Future[Any]] = {}
        self.next, self.lock = 0, threading.Lock()
        #: Why the helpers get no more.
        self.alone: _Unsendable | None = None

    def run(self, helpers: int) -> Iterator[Any]:
        for _ in range(helpers):
            self._send()
        own: dict[int, Any] = {}
        warned = False
        for i in range(len(self.tasks)):
            while not (i in own or (i in self.futures and self.futures[i].done())):
                if self.alone is not None and not warned:
                    warned = True
                    _warn_alone(self.alone)
                with self.lock:
                    mine, self.next = self.next, self.next + 1
                if mine >= len(self.tasks):
                    break
                own[mine] = self.function(self.tasks[mine])
            yield own.pop(i) if i in own else self.futures[i].result()

    def _send(self) -> None:
        with self.lock:
            i = self.next
            if i >= len(self.tasks) or self.alone is not None:
                return
            try:
                parcel = _packed(self.function, self.tasks[i])
            except _Unsendable as reason:
                # said by the main process, which now does the rest
                self.alone = reason
                return
            self.futures[i] = self.pool.submit(_run_packed, parcel)
            self.next += 1
        # called by the pool's own thread as soon as the helper is free
        self.futures[i].add_done_callback(self._more)

    def _more(self, future: Future[Any]) -> None:
        if not future.cancelled() and future.exception() is None:
            # a pool that is being ended takes no more
            with suppress(RuntimeError):
                self._send()


def _warn_alone(reason: _Unsendable) -> None:
    what = "put it into a module of its own to use several processes, or ask for processes=1"
    warnings.warn(f"computed in this process alone: {reason}; {what}", RuntimeWarning, stacklevel=2)


@contextmanager
def workers(processes: int | None, early: Sequence[str] = EARLY) -> Iterator[Workers]:
    """Yield worker processes, which start at once; on the way out they are gone, immediately if something went wrong.

    `processes`: with the main one; by default one a core, at most 8. A daemonic process, which may have none of its own, works alone.
    `early`: modules that the workers import before the first task comes
    """
    helpers = (processes or min(_cores(), MOST_PROCESSES)) - 1
    if helpers == 0 or multiprocessing.current_process().daemon:
        yield Workers()
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(helpers, context, initializer=_import, initargs=(tuple(early),))
    others = multiprocessing.active_children()
    try:
        with _no_interrupts(), _no_script(), _one_thread():
            for _ in range(helpers):
                pool.submit(_nothing)
        yield Workers(helpers, pool)
    except BaseException:
        for child in multiprocessing.active_children():
            if child not in others:
                # a shell may have had SIGTERM ignored, which they inherit; they hold nothing that a kill would leave behind
                child.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _no_interrupts() -> Iterator[None]:
    """Let processes that start here not see Ctrl-C: they would say so one by one, and the main process ends them anyway."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _no_script() -> Iterator[None]:
    """Let processes that start here not run the script again that starts them: they need nothing of it, and it may have no guard."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let processes that start here compute on one thread each."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _import(early: Sequence[str]) -> None:
    for name in early:
        importlib.import_module(name)


def _nothing() -> None:
    """The first task of each worker: a pool starts its processes with their tasks."""


def _cores() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1
