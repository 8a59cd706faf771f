"""What the samples of a channel look like, read block by block: lost ones, limits, runs of equal values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals._kernels import end_run, follow_runs
from rcsa_ident.signals.recording import Recording

#: Equal samples in a row that a live analogue channel does not produce.
FROZEN_SAMPLES = 12
#: A signal with fewer levels is too coarsely resolved to tell a limit from a peak.
LEAST_LEVELS = 12
#: An extreme value is a limit if it is this many times more frequent than the level next to it.
PILED_UP = 5.0
#: Runs that are longer than this are not told apart; so many long ones are kept.
_LONGEST_RUN, _KEPT = 1 << 16, 512
_NEW_VALUES = (np.inf, np.inf, -np.inf, -np.inf, np.nan, np.inf, np.nan)


@dataclass(frozen=True, slots=True)
class ChannelScan:
    """What all samples of a channel say together.

    `lost`, `first_lost`: number of samples that are no finite number, and the first of them
    `low`, `high`, `first`: of those that are; `low` is above `high` where there is none
    `clipped`: samples that stand at a limit
    `frozen`: (int, int) or None; start and length of the longest run that a live channel does not produce
    """

    lost: int
    first_lost: int
    low: float
    high: float
    first: float
    clipped: int
    frozen: tuple[int, int] | None


def scan(recording: Recording, columns: list[int]) -> list[ChannelScan]:
    """Return what is found in some of a recording's channels, in one pass over it."""
    found = [_Runs() for _ in columns]
    for start, block in recording.blocks():
        for runs, column in zip(found, columns, strict=True):
            follow_runs(block[:, column], start, *runs.state)
    return [runs.told() for runs in found]


class _Runs:
    """Runs of equal values, see `follow_runs`."""

    def __init__(self) -> None:
        self.values, self.counts = np.array(_NEW_VALUES), np.zeros(14, dtype=np.int64)
        self.lengths, self.levels = np.zeros(_LONGEST_RUN, dtype=np.int64), np.zeros(LEAST_LEVELS)
        # the first row holds what a run needs to be kept at all
        self.front = np.zeros((_KEPT, 3))
        self.front[0, 1] = FROZEN_SAMPLES

    @property
    def state(self) -> tuple[np.ndarray, ...]:
        return self.values, self.counts, self.lengths, self.levels, self.front

    def told(self) -> ChannelScan:
        start, length = int(self.counts[2]), int(self.counts[3])
        if length:
            end_run(-1.0, *self.state)
        low, _, high, _, _, _, first = self.values.tolist()
        lost, first_lost = self.counts[:2].tolist()
        return ChannelScan(lost, first_lost, low, high, first, self._clipped(), self._frozen(start, length))

    def _clipped(self) -> int:
        """Samples that stand at a limit: several runs at an extreme that is far more frequent than the level next to it.

        A coarsely resolved signal also repeats its extreme value, but the level beside it about as often.
        """
        if self.counts[12] < LEAST_LEVELS:
            return 0
        sides = ((self.counts[4:6], self.counts[8:10]), (self.counts[6:8], self.counts[10:12]))
        return sum(int(runs[1]) for samples, runs in sides if samples[0] > PILED_UP * samples[1] and runs[0] >= 2)

    def _frozen(self, start: int, length: int) -> tuple[int, int] | None:
        """The longest run that a live channel does not produce: longer than the others, and the signal has moved on after it.

        A slow signal of coarse resolution also rests at its peaks, but goes on by one level.
        """
        if length >= 4.0 * FROZEN_SAMPLES and length >= 4.0 * self.counts[13]:
            return start, length
        kept = self.front[1:]
        kept = kept[(kept[:, 1] >= FROZEN_SAMPLES) & (kept[:, 2] > 1.5 * self.values[5])]
        # of most channels nothing is left by now
        kept = kept[kept[:, 1] >= 4.0 * _quantile(self.lengths, 0.97)] if kept.size else kept
        if not kept.size:
            return None
        longest = kept[int(np.argmax(kept[:, 1]))]
        return int(longest[0]), int(longest[1])


def _quantile(lengths: FloatArray, share: float) -> float:
    """Quantile of values of which lengths[k] are k, interpolated between neighbours."""
    behind = np.cumsum(lengths)
    place = share * (behind[-1] - 1)
    low, high = np.searchsorted(behind, [np.floor(place), np.ceil(place)], side="right")
    return float(low + (place - np.floor(place)) * (high - low))
