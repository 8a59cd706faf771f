"""Listener of a stream: a bounded queue of events and forces for one client."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from typing import Any

import numpy as np

from api.streams.frames import packed
from rcsa_ident.base.arrays import FloatArray

#: Most bytes of frames and most texts that wait for a slow reader.
WAITING_BYTES, WAITING_TEXTS = 4_000_000, 32


class Listener:
    """Receiver of a session's events and forces.

    `text`: JSON in place of bytes
    `size`: samples per bucket of the envelope; None for every sample
    """

    def __init__(self, axes: int, text: bool, size: int | None) -> None:
        self.text, self.envelope = text, None if size is None else Envelope(size, axes)
        self.frames: deque[tuple[int, str | bytes]] = deque()
        self.texts: deque[str] = deque(maxlen=WAITING_TEXTS)
        self.bytes, self.unread, self.last = 0, 0, ""
        self.awake = asyncio.Event()

    def forces(self, first: int, values: FloatArray) -> None:
        """Queue forces; the oldest unread ones are discarded and counted where the queue is full."""
        runs = [(first, values)] if self.envelope is None else self.envelope.add(first, values)
        for begin, rows in runs:
            frame = json.dumps({"first": begin, "samples": rows.tolist()}) if self.text else packed(begin, rows)
            count = rows.shape[0] * (1 if self.envelope is None else self.envelope.size)
            self.frames.append((count, frame))
            self.bytes += len(frame)
        while self.bytes > WAITING_BYTES:
            count, frame = self.frames.popleft()
            self.bytes -= len(frame)
            self.unread += count
        self.awake.set()

    def tell(self, event: str, **further: Any) -> None:
        """Queue an event: `end` behind all forces, others ahead of them."""
        text = json.dumps({"event": event, **further}, allow_nan=False)
        if event == "end":
            self.last = text
        else:
            self.texts.append(text)
        self.awake.set()

    @property
    def pending(self) -> bool:
        """Whether the queue holds anything."""
        return bool(self.frames or self.texts or self.last)

    def taken(self) -> list[str | bytes]:
        """Take the next texts and at most one frame from the queue."""
        found: list[str | bytes] = [*self.texts]
        self.texts.clear()
        # one frame at a time, so that the others can still be discarded
        if self.frames:
            frame = self.frames.popleft()[1]
            self.bytes -= len(frame)
            found.append(frame)
        elif self.last:
            found.append(self.last)
            self.last = ""
        if not self.pending:
            self.awake.clear()
        return found


class Envelope:
    """Running envelope of a stream. Buckets begin at multiples of their size, whatever the blocks; empty buckets are omitted.

    `size`: samples per bucket
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
