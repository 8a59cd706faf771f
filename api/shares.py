"""Shares of groups: places that are held for long leave room for others, and whoever waits is served in turn."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from contextvars import ContextVar, copy_context
from typing import Any

#: Group of the request that is being answered; empty for what the service does by itself.
GROUP: ContextVar[str] = ContextVar("group", default="")


class Shares:
    """Places that groups share: a group takes another one only while more are free than it holds.

    One group alone gets half of them, the next one half of the rest: who comes later finds a place, and nobody's is taken away.

    `most`: places
    `several`: whether there can be more groups than one; one alone may take all of them
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

    `count`: calls at work at once
    `spare`: whether one thread more answers a short call while all at work are long ones: what takes milliseconds waits behind nothing that
        takes seconds
    """

    def __init__(self, count: int, name: str, spare: bool = False) -> None:
        super().__init__(count + spare, name)
        self.count, self.spare = count, spare
        self.guard = threading.Lock()
        # in the order in which the groups were served
        self.lines: dict[str, deque[_Waiting]] = {}
        self.working: Counter[str] = Counter()
        self.long = 0

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        return self._line_up(_Waiting(GROUP.get(), call, arguments, named))

    def submit_short(self, call: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """Submit a call that takes milliseconds."""
        return self._line_up(_Waiting(GROUP.get(), call, arguments, named, short=True))

    def _line_up(self, waiting: _Waiting) -> Future[Any]:
        with self.guard:
            self.lines.setdefault(waiting.group, deque()).append(waiting)
        # which call it is is found once a thread is free
        super().submit(self._work)
        return waiting.answer

    def _work(self) -> None:
        """In a thread: answer one call after the other, until none may begin."""
        while waiting := self._next():
            try:
                waiting.carry_out()
            finally:
                with self.guard:
                    self.working[waiting.group] -= 1
                    self.long -= not waiting.short

    def _next(self) -> _Waiting | None:
        with self.guard:
            at_work = self.working.total()
            aside = self.spare and at_work == self.long == self.count
            if at_work >= self.count and not aside:
                # whoever ends next goes on with what waits
                return None
            firsts = (next((each for each in line if each.short or not aside), None) for line in self.lines.values())
            waiting = min((each for each in firsts if each), key=lambda each: self.working[each.group], default=None)
            if waiting is None:
                return None
            group = waiting.group
            line = self.lines.pop(group)
            line.remove(waiting)
            if line:
                self.lines[group] = line
            self.working[group] += 1
            self.long += not waiting.short
            if self.spare and self.long == self.count:
                # short ones that wait may begin now; where the end has come, those at work answer them
                with suppress(RuntimeError):
                    super().submit(self._work)
            return waiting

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

    def __init__(
        self, group: str, call: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any], short: bool = False
    ) -> None:
        self.group, self.call, self.arguments, self.named, self.short = group, call, arguments, named, short
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
