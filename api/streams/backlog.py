"""Samples of a session that wait: what arrives, what is taken and what is looked at each cost as much as they are."""

from __future__ import annotations

from collections import deque

import numpy as np

from rcsa_ident.base.arrays import FloatArray


class Backlog:
    """Queue of samples, in runs without a gap."""

    def __init__(self) -> None:
        #: Samples, shape (n, c), and when they arrived [s].
        self.frames: deque[tuple[FloatArray, float]] = deque()
        #: First index and number of samples of each run; counted here, so that nobody looks through its frames.
        self.runs: deque[tuple[int, int]] = deque()

    def add(self, first: int, samples: FloatArray, now: float) -> None:
        """Append samples, whose indices follow all others."""
        self.frames.append((samples, now))
        begin, count = self.runs[-1] if self.runs else (first, 0)
        if first == begin + count and self.runs:
            self.runs[-1] = begin, count + samples.shape[0]
        else:
            self.runs.append((first, samples.shape[0]))

    def head(self, count: int) -> FloatArray:
        """Return the first `count` samples, or as many of them as wait without a gap."""
        parts, missing = list[FloatArray](), min(count, self.runs[0][1])
        for samples, _ in self.frames:
            parts.append(samples[:missing])
            missing -= parts[-1].shape[0]
            if not missing:
                break
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def drop(self, count: int) -> int:
        """Remove the first `count` samples, or as many of them as wait without a gap, and return their number."""
        first, size = self.runs.popleft()
        count = missing = min(count, size)
        if count < size:
            self.runs.appendleft((first + count, size - count))
        while missing:
            samples, arrived = self.frames.popleft()
            if samples.shape[0] > missing:
                self.frames.appendleft((samples[missing:], arrived))
            missing -= min(samples.shape[0], missing)
        return count

    def take(self, count: int) -> tuple[int, FloatArray, float]:
        """Remove the same and return the first index, the samples, and when the first of them arrived [s]."""
        first, arrived, samples = self.runs[0][0], self.frames[0][1], self.head(count)
        self.drop(samples.shape[0])
        return first, samples, arrived
