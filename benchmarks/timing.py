"""One way to time, for both sides of a claim."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


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
