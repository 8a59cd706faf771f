"""Shares of groups: places that are held for long leave room for others, and whoever waits is served in turn."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import ContextVar, copy_context
from typing import Any

#: Group of the request that is being answered; empty for what the service does by itself.
GROUP: ContextVar[str] = ContextVar("group", default="")


class Shares:
    """Places that groups share: a group takes another one only while more are free than it holds.

    One group alone gets half of them, the next one half of the rest: who comes later finds a place, and nobody's is taken away.

    Parameters
    ----------
    most : int
        Places.
    several : bool
        Whether there can be more groups than one; one alone may take all of them.
    """

    def __init__(self, most: int, several: bool = True) -> None:
        self.most, self.several = most, several
        self.held: Counter[str] = Counter()

    @property
    def total(self) -> int:
        """Places that are taken."""
        return self.held.total()

    def take(self, group: str) -> bool:
        """Take a place, or return that there is none for this group."""
        free = self.most - self.total
        if free <= 0 or (self.several and self.held[group] >= free):
            return False
        self.held[group] += 1
        return True

    def give(self, group: str) -> None:
        """Give a place back."""
        self.held[group] -= 1
        if not self.held[group]:
            del self.held[group]


class FairThreads(ThreadPoolExecutor):
    """Threads whose next call is of the group that has fewest at work, among these of the one that waits longest since its last.

    Parameters
    ----------
    count : int
    name : str
    """

    def __init__(self, count: int, name: str) -> None:
        super().__init__(count, name)
        self.guard = threading.Lock()
        # in the order in which the groups were served
        self.lines: dict[str, deque[_Waiting]] = {}
        self.working: Counter[str] = Counter()

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        waiting = _Waiting(GROUP.get(), call, arguments, named)
        with self.guard:
            self.lines.setdefault(waiting.group, deque()).append(waiting)
        # which call it is is found once a thread is free
        super().submit(self._next)
        return waiting.answer

    def _next(self) -> None:
        with self.guard:
            group = min((group for group, line in self.lines.items() if line), key=lambda group: self.working[group], default=None)
            if group is None:
                # the end has come between
                return
            line = self.lines.pop(group)
            waiting = line.popleft()
            if line:
                self.lines[group] = line
            self.working[group] += 1
        try:
            waiting.carry_out()
        finally:
            with self.guard:
                self.working[group] -= 1

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        if cancel_futures:
            with self.guard:
                left = [waiting for line in self.lines.values() for waiting in line]
                self.lines.clear()
            for waiting in left:
                waiting.answer.cancel()
        super().shutdown(wait, cancel_futures=cancel_futures)


class _Waiting:
    """A call that waits for a thread."""

    def __init__(self, group: str, call: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> None:
        self.group, self.call, self.arguments, self.named = group, call, arguments, named
        self.answer: Future[Any] = Future()
        # the thread knows for whom it works, and so does what it logs
        self.context = copy_context()

    def carry_out(self) -> None:
        """Answer, unless nobody waits any more."""
        if not self.answer.set_running_or_notify_cancel():
            return
        try:
            found = self.context.run(self.call, *self.arguments, **self.named)
        except BaseException as error:
            self.answer.set_exception(error)
        else:
            self.answer.set_result(found)
