"""One way to time, for both sides of a claim."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple


class Race(NamedTuple):
    """One task, done by the package and by a peer in the same process, from the same input and to the accuracy that is told.

    `claim`: the task
    `peer`: what it is compared with, in words
    `package`: distribution whose version counts
    `ours`, `theirs`: each does the task once
    `accuracy`: of both
    `parts`: (int, int); how many times a call of either does the task
    `unit`, `scale`: what a time is told in, and how many of these a second has
    """

    claim: str
    peer: str
    package: str
    ours: Callable[[], Any]
    theirs: Callable[[], Any]
    accuracy: str
    parts: tuple[int, int] = (1, 1)
    unit: str = "us"
    scale: float = 1e6

    def row(self) -> dict[str, Any]:
        """Return the line of the table with the best time of either side."""
        ours, theirs = (self.scale * best_of(call) / n for call, n in zip((self.ours, self.theirs), self.parts, strict=True))
        return row(self.claim, ours, theirs, self.unit, self.accuracy)

    def ratios(self, rounds: int = 7, seconds: float = 0.1) -> list[float]:
        """Return how many times longer the peer takes, round by round, each side in turn for about so many seconds."""
        counts = [_calls_in(call, seconds) for call in (self.ours, self.theirs)]
        found = []
        for _ in range(rounds):
            ours, theirs = (
                _mean_time(call, count) / n for call, count, n in zip((self.ours, self.theirs), counts, self.parts, strict=True)
            )
            found.append(theirs / ours)
        return found


def _calls_in(call: Callable[[], Any], seconds: float) -> int:
    call()
    return max(1, int(seconds / max(_mean_time(call, 1), 1e-7)))


def _mean_time(call: Callable[[], Any], count: int) -> float:
    start = time.process_time()
    for _ in range(count):
        call()
    return (time.process_time() - start) / count


def row(claim: str, ours: float, peer: float | None, unit: str, accuracy: str) -> dict[str, Any]:
    """Return one line of the table; ratio is peer over ours."""
    return {"claim": claim, "ours": ours, "peer": peer, "ratio": None if peer is None else peer / ours, "unit": unit, "accuracy": accuracy}


def best_of(call: Callable[[], Any], repeats: int = 7, seconds: float = 0.2) -> float:
    """Return the shortest mean time of a call over a few rounds [s]: the one that the machine's other work disturbed least."""
    call()
    start = time.perf_counter()
    call()
    count = max(1, int(seconds / repeats / max(time.perf_counter() - start, 1e-7)))
    best = float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(count):
            call()
        best = min(best, (time.perf_counter() - start) / count)
    return best


def once(call: Callable[[], Any]) -> float:
    """Return the time of a single call that takes seconds [s]."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
