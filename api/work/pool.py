"""Worker processes for computations, which never run in the event loop; a full queue refuses at once."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from functools import partial
from queue import LifoQueue
from typing import Any, Protocol, TypeVar

from api.shares import GROUP, FairThreads, Shares
from api.work.kernels import ANSWERS, OBSERVERS, Kernels
from api.work.worker import Killed, QueryLimits, Worker

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
    """Pool of spawned worker processes; the next call is of the group that has fewest at work.

    One process more answers a preview while all others work on longer questions.

    A process is replaced when its query exceeds a limit or is withdrawn: nothing else ends a computation that has begun.

    `queue`: calls that may wait beyond the running ones
    `machines`: machines that each worker caches
    `limits`: of each call
    `several`: whether the queue is shared by groups
    """

    def __init__(
        self,
        workers: int,
        queue: int,
        machines: int,
        limits: QueryLimits = QueryLimits(),  # noqa: B008 - frozen
        several: bool = False,
        kernels: Kernels = Kernels(),  # noqa: B008 - never changed
    ) -> None:
        self.workers, self.machines, self.limits, self.kernels = workers, machines, limits, kernels
        self.places = Shares(workers + queue, several)
        self.members: list[Worker] = []
        # the one that was used last comes first: its machines are read already
        self.free: LifoQueue[Worker] = LifoQueue()
        self.threads: FairThreads | None = None
        self.lock = threading.Lock()

    @property
    def waiting(self) -> int:
        return self.places.total

    @property
    def ready(self) -> bool:
        return any(member.ready for member in self.members)

    def start(self) -> None:
        self.members = [self._worker() for _ in range(self.workers + 1)]
        for member in reversed(self.members):
            self.free.put(member)
        self.threads = FairThreads(self.workers, "work", spare=True)
        for _ in range(self.workers):
            self.threads.submit(self._answer, _Call())

    def _worker(self) -> Worker:
        return Worker(self.limits, partial(_begin, self.machines, self.kernels), partial(prepare_observers, self.kernels, locks=False))

    async def run(self, call: Callable[..., T], *arguments: Any) -> T:
        """Return the answer of a call; where the caller is cancelled, the call ends with its process.

        Raises `Busy`: the queue is full, or the group's share of it, or a worker was killed from outside.
        Raises `TooLong`, `InputError`: the call has exceeded the limit of time, or of memory.
        """
        group = GROUP.get()
        if self.threads is None or not self.places.take(group):
            raise Busy
        asked = _Call(guarded, (call, *arguments))
        preview = any(getattr(each, "preview", False) for each in arguments)
        submit = self.threads.submit_short if preview else self.threads.submit
        try:
            answer: T = await asyncio.wrap_future(submit(self._answer, asked))
            return answer
        except Killed:
            raise Busy from None
        except asyncio.CancelledError:
            asked.withdraw()
            raise
        finally:
            self.places.give(group)

    def _answer(self, asked: _Call) -> Any:
        """In a thread: have a free process answer, and replace it where it is of no further use."""
        member = self.free.get()
        try:
            member = self._fit(member)
            member.begin()
            return asked.answer(member)
        finally:
            try:
                member = self._fit(member)
            finally:
                self.free.put(member)

    def _fit(self, member: Worker) -> Worker:
        """Return a member that takes calls, or another in its place; the same where the pool ends."""
        with self.lock:
            if self.threads is None or (member.fit and member.process.alive):
                return member
            member.end()
            self.members[self.members.index(member)] = other = self._worker()
            return other

    def stop(self) -> None:
        with self.lock:
            threads, self.threads = self.threads, None
        for member in self.members:
            # a running call ends with its process
            member.process.kill()
        if threads is not None:
            threads.shutdown(wait=True, cancel_futures=True)
        for member in self.members:
            member.end()
        self.members.clear()
        self.free = LifoQueue()


class _Call:
    """A call on its way to a process; without one it only waits until a process is ready."""

    def __init__(self, call: Callable[..., Any] | None = None, arguments: tuple[Any, ...] = ()) -> None:
        self.call, self.arguments = call, arguments
        self.lock, self.withdrawn = threading.Lock(), False
        self.member: Worker | None = None

    def answer(self, member: Worker) -> Any:
        """Return what a process answers, unless nobody waits for it any more."""
        with self.lock:
            if self.call is None or self.withdrawn:
                return None
            self.member = member
        try:
            return member.ask(self.call, self.arguments)
        finally:
            with self.lock:
                self.member = None

    def withdraw(self) -> None:
        """End the process that works on this call, if one does."""
        with self.lock:
            self.withdrawn = True
            if self.member is not None:
                self.member.fit = False
                self.member.process.kill()


def _begin(machines: int, kernels: Kernels) -> None:
    """In a new worker: import the tasks and prepare what quick answers need."""
    from api.work import tasks

    tasks.keep(machines)
    kernels.prepare(*ANSWERS)


def guarded(call: Callable[..., T], *arguments: Any) -> T:
    """Return the answer of a call; numbers that are valid each but have no finite answer together are bad input."""
    import numpy as np

    from rcsa_ident.base.errors import InputError

    try:
        with np.errstate(all="ignore"):
            return call(*arguments)
    except InputError:
        raise
    except (ArithmeticError, np.linalg.LinAlgError, ValueError) as error:
        if isinstance(error, ArithmeticError | np.linalg.LinAlgError) or "infs or NaNs" in str(error):
            raise InputError("numbers of the query", "no finite answer", "a tooling and a cut that can be computed") from None
        raise


def prepare_observers(kernels: Kernels, locks: bool = True) -> None:
    """Prepare the design of force observers, which a stream waits for."""
    kernels.prepare(*OBSERVERS, locks=locks)
    import rcsa_ident.workflows.stream_forces  # noqa: F401
