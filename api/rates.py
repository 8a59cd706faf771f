"""How often something may happen: requests of a key, wrong keys of an address, frames of a stream."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

#: Keys, addresses or streams that one limiter remembers.
MOST_BUCKETS = 10_000


class Rates:
    """Token-bucket rate limiter, one bucket per key: `burst` at once, refilled at `per_minute`. `clock`: monotonic clock [s]."""

    def __init__(self, per_minute: int, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.rate, self.burst, self.clock = per_minute / 60.0, float(burst), clock
        self.buckets: dict[str, tuple[float, float]] = {}
        self.lock = threading.Lock()

    def wait(self, key: str) -> float:
        """Take a token and return 0, or return the time [s] until there is one."""
        with self.lock:
            now, buckets = self.clock(), self.buckets
            level, seen = buckets.pop(key, (self.burst, now))
            level = min(self.burst, level + (now - seen) * self.rate)
            # the first one is the one that has not been asked for longest
            buckets[key] = (level - 1.0 if level >= 1.0 else level, now)
            while len(buckets) > MOST_BUCKETS or now - buckets[next(iter(buckets))][1] >= self.burst / self.rate:
                # one that is full again needs no entry
                del buckets[next(iter(buckets))]
            return 0.0 if level >= 1.0 else (1.0 - level) / self.rate
