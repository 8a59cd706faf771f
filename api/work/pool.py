"""Worker processes for computations, which never run in the event loop; a full queue refuses at once."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol, TypeVar

from api.processes import follow_parent, spawn_context

T = TypeVar("T")


class Busy(Exception):
    """The queue is full, or a worker has just died."""


class Work(Protocol):
    """Executor of calls in processes of its own."""

    async def run(self, call: Callable[..., T], *arguments: Any) -> T:
        """Return the answer of a call; raises `Busy` where the queue is full, `InputError` where the input is at fault."""

    @property
    def waiting(self) -> int:
        """Number of calls without an answer yet."""

    @property
    def ready(self) -> bool:
        """Whether there is a process that answers."""

    def start(self) -> None:
        """Start the processes."""

    def stop(self) -> None:
        """End the processes."""


class Pool:
    """Pool of spawned worker processes.

    Parameters
    ----------
    workers : int
    queue : int
        Calls that may wait beyond the running ones.
    machines : int
        Machines that each worker caches.
    """

    def __init__(self, workers: int, queue: int, machines: int) -> None:
        self.workers, self.queue, self.machines = workers, queue, machines
        self.executor: ProcessPoolExecutor | None = None
        self.waiting = 0
        self.warm = 0

    @property
    def ready(self) -> bool:
        return self.warm > 0

    def start(self) -> None:
        self.executor = ProcessPoolExecutor(self.workers, spawn_context(), initializer=_begin, initargs=(self.machines,))
        self.warm = 0
        for _ in range(self.workers):
            self.executor.submit(warm).add_done_callback(self._warmed)
        # queued last, so that nobody waits for it
        for _ in range(self.workers):
            self.executor.submit(warm_observer)

    def _warmed(self, future: Any) -> None:
        if not future.cancelled() and future.exception() is None:
            self.warm += 1

    async def run(self, call: Callable[..., T], *arguments: Any) -> T:
        if self.executor is None or self.waiting >= self.workers + self.queue:
            raise Busy
        executor = self.executor
        self.waiting += 1
        try:
            return await asyncio.wrap_future(executor.submit(guarded, call, *arguments))
        except BrokenProcessPool as error:
            # a worker was killed, perhaps for its memory: all waiting calls fail, and the pool is replaced
            if self.executor is executor:
                executor.shutdown(wait=False, cancel_futures=True)
                self.start()
            raise Busy from error
        finally:
            self.waiting -= 1

    def stop(self) -> None:
        if self.executor is not None:
            self.executor.shutdown(wait=True, cancel_futures=True)
            self.executor = None
            self.warm = 0


def _begin(machines: int) -> None:
    """In a new worker: follow the service, and import the tasks."""
    follow_parent()
    from api.work import tasks

    tasks.keep(machines)


def guarded(call: Callable[..., T], *arguments: Any) -> T:
    """Return the answer of a call; numbers that are valid each but have no finite answer together are bad input."""
    import numpy as np

    from rcsa_ident.errors import InputError

    try:
        with np.errstate(all="ignore"):
            return call(*arguments)
    except InputError:
        raise
    except (ArithmeticError, np.linalg.LinAlgError, ValueError) as error:
        if isinstance(error, ArithmeticError | np.linalg.LinAlgError) or "infs or NaNs" in str(error):
            raise InputError("numbers of the query", "no finite answer", "a tooling and a cut that can be computed") from None
        raise


def warm() -> None:
    """Compile the kernels of quick answers, or load them from the cache."""
    from rcsa_ident.workflows.compile_kernels import STEPS

    for step in ("tool-holder", "lobes"):
        STEPS[step]()


def warm_observer() -> None:
    """Compile the kernels of the design of force observers, which a stream waits for."""
    from rcsa_ident.workflows.compile_kernels import STEPS

    STEPS["force observer"]()
    import rcsa_ident.workflows.stream_forces  # noqa: F401
