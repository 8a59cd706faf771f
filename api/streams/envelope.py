"""Envelope of a fast stream for plots: minimum and maximum over buckets of samples."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import FloatArray


def envelope(values: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
    """Return minima and maxima over buckets of `size` samples, the last one possibly shorter, shape (b, c) each.

    Parameters
    ----------
    values : array, shape (n, c)
    size : int
    """
    if values.shape[0] == 0:
        return values, values
    begin = np.arange(0, values.shape[0], size)
    return np.minimum.reduceat(values, begin), np.maximum.reduceat(values, begin)


class Envelope:
    """Running envelope of a stream. Buckets begin at multiples of their size, whatever the blocks; empty buckets are omitted.

    Parameters
    ----------
    size : int
        Samples per bucket.
    axes : int
    """

    def __init__(self, size: int, axes: int) -> None:
        self.size, self.bucket = size, -1
        self.low = self.high = np.zeros(axes)

    def add(self, first: int, values: FloatArray) -> list[tuple[int, FloatArray]]:
        """Return the buckets that these samples complete, as runs without gaps: first index, and values of shape (b, a, 2)."""
        count, size = values.shape[0], self.size
        if count == 0:
            return []
        begin = np.concatenate([[0], np.arange(-first % size or size, count, size)])
        low, high = np.minimum.reduceat(values, begin), np.maximum.reduceat(values, begin)
        runs = []
        if first // size == self.bucket:
            low[0], high[0] = np.minimum(low[0], self.low), np.maximum(high[0], self.high)
        elif self.bucket >= 0:
            # the rest of the last bucket was lost
            runs.append((self.bucket * size, np.stack([self.low, self.high], axis=1)[None]))
        self.bucket, self.low, self.high = -1, low[-1], high[-1]
        if (first + count) % size:
            self.bucket = (first + count) // size
            low, high = low[:-1], high[:-1]
        if low.shape[0]:
            runs.append((first // size * size, np.stack([low, high], axis=2)))
        return runs
