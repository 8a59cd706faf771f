"""Worker processes beside the main one, which works as well; what they tell on their way."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.errors import InputError
from rcsa_ident.scaleout import ClusterMap, cluster_map

if TYPE_CHECKING:
    from multiprocessing.queues import SimpleQueue

#: Reading and searching do not get faster beyond it.
MOST_PROCESSES = 8
#: What a worker imports while the main process still reads the campaign's file.
EARLY = ("rcsa_ident.io.recordings", "rcsa_ident.workflows.identify", "rcsa_ident.identification.evidence")
#: Seconds between two words of one process.
PAUSE = 0.1

Processes = Annotated[
    int | None, typer.Option(min=1, max=64, help="Number of processes; default: one per core, at most 8.", show_default=False)
]
DASK_HELP = "Dask scheduler (tcp://host:8786) to use instead of local processes; its workers find the campaign under the same path."
Dask = Annotated[str | None, typer.Option(metavar="ADDRESS", help=DASK_HELP, show_default=False)]
#: Takes axis, stage and cost of a search.
Show = Callable[[str, str, float], None]

# where this process' words go: to the screen in the main process, into the queue in a worker, nowhere by default
_sink: Callable[[tuple[str, str, float]], None] | None = None
_last = 0.0


def tell(axis: str, stage: str, cost: float, theta: Any = None, layout: Any = None) -> None:
    """Say where a search is: a progress callback that may cross processes; most of what comes in quick succession is dropped."""
    global _last
    now = time.monotonic()
    if _sink is not None and now - _last > PAUSE:
        _last = now
        _sink((axis, stage, cost))


@dataclass(frozen=True, slots=True, eq=False)
class Workers:
    """A `map` that may run in several processes; results come in the order of the tasks.

    Parameters
    ----------
    helpers : int
        Processes beside this one.
    pool : ProcessPoolExecutor or None
        None without helpers.
    words : SimpleQueue or None
        What the helpers tell.
    cluster : ClusterMap or None
        In place of processes here; it tells nothing on its way.
    """

    helpers: int = 0
    pool: ProcessPoolExecutor | None = None
    words: SimpleQueue[tuple[str, str, float]] | None = None
    cluster: ClusterMap | None = None

    def map(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterable[Any]:
        """Few long tasks."""
        if self.cluster is not None:
            return self.cluster(function, tasks)
        return map(function, tasks) if self.pool is None else _Shared(self.pool, function, list(tasks)).run(self.helpers)

    def map_many(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterable[Any]:
        """Many short tasks, sent some at a time."""
        if self.pool is None and self.cluster is None:
            return map(function, tasks)
        tasks = list(tasks)
        workers = self.helpers + 1 if self.cluster is None else self.cluster.slots
        size = max(1, min(8, len(tasks) // (4 * workers)))
        chunks = [_Chunk(function, tasks[i : i + size]) for i in range(0, len(tasks), size)]
        return (result for results in self.map(_run_chunk, chunks) for result in results)

    @contextmanager
    def listening(self, show: Show) -> Iterator[None]:
        """Pass what this process and the helpers tell to `show`, from another thread where it comes from them."""
        global _sink
        done = threading.Event()

        def drain() -> None:
            while self.words is not None and not done.wait(PAUSE):
                while not self.words.empty():
                    show(*self.words.get())

        _sink = lambda word: show(*word)  # noqa: E731
        thread = threading.Thread(target=drain, daemon=True)
        thread.start()
        try:
            yield
        finally:
            _sink = None
            done.set()
            # a worker that was ended in the middle of a word would keep the thread waiting for the rest
            thread.join(1.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Chunk:
    function: Callable[[Any], Any]
    tasks: Sequence[Any]


def _run_chunk(chunk: _Chunk) -> list[Any]:
    return [chunk.function(task) for task in chunk.tasks]


class _Shared:
    """Tasks of which each helper has one at a time; the main process does what it would otherwise wait for."""

    def __init__(self, pool: ProcessPoolExecutor, function: Callable[[Any], Any], tasks: Sequence[Any]) -> None:
        self.pool, self.function, self.tasks = pool, function, tasks
        self.futures: dict[int, Future[Any]] = {}
        self.next, self.lock = 0, threading.Lock()

    def run(self, helpers: int) -> Iterator[Any]:
        for _ in range(helpers):
            self._send()
        own: dict[int, Any] = {}
        for i in range(len(self.tasks)):
            while not (i in own or (i in self.futures and self.futures[i].done())):
                with self.lock:
                    mine, self.next = self.next, self.next + 1
                if mine >= len(self.tasks):
                    break
                own[mine] = self.function(self.tasks[mine])
            yield own.pop(i) if i in own else self.futures[i].result()

    def _send(self) -> None:
        with self.lock:
            i = self.next
            if i >= len(self.tasks):
                return
            self.futures[i] = self.pool.submit(self.function, self.tasks[i])
            self.next += 1
        # called by the pool's own thread as soon as the helper is free
        self.futures[i].add_done_callback(self._more)

    def _more(self, future: Future[Any]) -> None:
        if not future.cancelled() and future.exception() is None:
            # a pool that is being ended takes no more
            with suppress(RuntimeError):
                self._send()


@contextmanager
def workers_or_cluster(processes: int | None, dask: str | None) -> Iterator[Workers]:
    """Yield what maps: processes here, or the workers of a cluster."""
    if dask is None:
        with workers(processes) as pool:
            yield pool
        return
    if processes is not None:
        raise InputError("--dask", f"given together with --processes {processes}", "one of the two: a cluster has its own processes")
    with cluster_map(dask) as cluster:
        yield Workers(cluster=cluster)


@contextmanager
def workers(processes: int | None, early: Sequence[str] = EARLY) -> Iterator[Workers]:
    """Yield worker processes, which start at once; on the way out they are gone, immediately if something went wrong.

    Parameters
    ----------
    processes : int or None
        With the main one.
    early : sequence of str
        Modules that the workers import before the first task comes.
    """
    helpers = (processes or min(_cores(), MOST_PROCESSES)) - 1
    if helpers == 0:
        yield Workers()
        return
    context = multiprocessing.get_context("spawn")
    words: SimpleQueue[tuple[str, str, float]] = context.SimpleQueue()
    pool = ProcessPoolExecutor(helpers, context, initializer=_begin, initargs=(words, tuple(early)))
    try:
        with _no_interrupts(), _no_script():
            for _ in range(helpers):
                pool.submit(_nothing)
        yield Workers(helpers, pool, words)
    except BaseException:
        for child in multiprocessing.active_children():
            child.terminate()
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


def _begin(words: SimpleQueue[tuple[str, str, float]], early: Sequence[str]) -> None:
    global _sink
    _sink = words.put
    for name in early:
        importlib.import_module(name)


def _nothing() -> None:
    """The first task of each worker: a pool starts its processes with their tasks."""


def _cores() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1
