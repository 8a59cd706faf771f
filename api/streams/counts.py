"""Accounting of the samples of a stream: each is counted once, as computed, dropped, lost or waiting."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Counts:
    """Counts of the samples of a session.

    At any time, of all indices from the first to the one before `following`:
    following - origin = samples + dropped + lost + backlog.

    `origin`, `following`: index of the first sample, and the next one expected; -1 before the first frame
    `samples`: whose forces have been computed
    `lost`: that never arrived
    `late`: that arrived twice or after later ones; discarded, and not part of the sum
    `dropped`: that arrived and were discarded because the service lagged behind
    `backlog`: that are waiting
    """

    origin: int = -1
    following: int = -1
    samples: int = 0
    lost: int = 0
    late: int = 0
    dropped: int = 0
    backlog: int = 0

    def take(self, first: int, count: int) -> int:
        """Count a frame, and return the number of its leading samples that are late."""
        if self.origin < 0:
            self.origin = self.following = first
        late = min(max(self.following - first, 0), count)
        self.late += late
        if late == count:
            return late
        self.lost += max(first - self.following, 0)
        self.following = first + count
        self.backlog += count - late
        return late

    def drop(self, count: int) -> None:
        """Count waiting samples as dropped."""
        self.backlog -= count
        self.dropped += count

    def done(self, count: int) -> None:
        """Count waiting samples as computed."""
        self.backlog -= count
        self.samples += count
