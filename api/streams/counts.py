"""What became of every sample of a stream: nothing comes in or goes without being counted."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Counts:
    """Samples of a session.

    At any time, of all indices from the first to the one before `following`:
    following - origin = samples + dropped + lost + backlog.

    Parameters
    ----------
    origin, following : int
        Index of the first sample, and the one that should come now; -1 before the first frame.
    samples : int
        With a force.
    lost : int
        That never came.
    late : int
        That came once more, or behind later ones; thrown away, and no part of the sum.
    dropped : int
        That came, and were thrown away since the service was behind.
    backlog : int
        That wait.
    """

    origin: int = -1
    following: int = -1
    samples: int = 0
    lost: int = 0
    late: int = 0
    dropped: int = 0
    backlog: int = 0

    def take(self, first: int, count: int) -> int:
        """Count a frame in, and return how many of its first samples are late."""
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
        """Count samples that wait no longer, since they were thrown away."""
        self.backlog -= count
        self.dropped += count

    def done(self, count: int) -> None:
        """Count samples that wait no longer, since they have a force."""
        self.backlog -= count
        self.samples += count
