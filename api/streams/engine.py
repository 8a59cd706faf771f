"""Computation of the stream process: one live observer per session, blocks of samples in, forces out."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from api.codec import decode
from rcsa_ident.base.arrays import FloatArray

if TYPE_CHECKING:
    # not at run time: the service itself does not load the observers
    from rcsa_ident.workflows.stream_forces import LiveObserver, LiveState

#: Kind, session, first index, time of arrival [s], drift, known, length of the content.
HEADER = struct.Struct("<BQQdddI")
#: Messages to the process.
OPEN, BLOCK, CLOSE = 1, 2, 3
#: Messages from the process.
READY, FORCES, REFUSED, FAILED = 11, 12, 13, 14


class Endless(Exception):
    """The forces of the signals are not finite."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message between the service and the stream process.

    `kind`: OPEN: content is a `Plan`, encoded by one of the service's own workers. BLOCK: content is float64[samples, channels], `first`
        its index. FORCES: content is float64[samples, axes] of the block from `first` on, without those in which the observer settles,
        `drift` of the spindle's speed as a share, `known` 1 where the spindle's angle was. REFUSED: forces are not finite. FAILED: content
        is what is logged.
    `arrived` [s]: by the machine's monotonic clock; returned with the forces
    """

    kind: int
    session: int = 0
    first: int = 0
    arrived: float = 0.0
    drift: float = 0.0
    known: float = 1.0
    content: bytes = b""

    def packed(self) -> bytes:
        """Return the message as bytes."""
        head = HEADER.pack(self.kind, self.session, self.first, self.arrived, self.drift, self.known, len(self.content))
        return head + self.content


@dataclass(frozen=True, slots=True)
class Column:
    """Column of a quantity in a frame: its channel, and its sensitivity per m or m/s^2."""

    channel: int
    sensitivity: float


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Plan of a session: its observer and the layout of its frames.

    `gap`: for each axis
    `channels`: of a frame
    `origin`: index of the sample at which the observer begins
    `order`: indices of the observer's axes, in the order of the answer's columns
    `settling`: samples behind each start of the observer whose forces are not told
    """

    observer: LiveObserver
    gap: tuple[Column, ...]
    acceleration: tuple[Column | None, ...]
    channels: int
    origin: int
    order: tuple[int, ...]
    settling: int = 0

    def signals(self, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return gaps [m] and accelerations [m/s^2] of a block, shape (n, a) each."""
        gap = np.stack([samples[:, c.channel] / c.sensitivity for c in self.gap], axis=1)
        still = np.zeros(samples.shape[0])
        shaken = [still if c is None else samples[:, c.channel] / c.sensitivity for c in self.acceleration]
        return gap, np.stack(shaken, axis=1)


class Engine:
    """The observers of all sessions and their states."""

    def __init__(self) -> None:
        self.sessions: dict[int, tuple[Plan, LiveState]] = {}

    def answer(self, message: Message) -> Message | None:
        """Return the answer to a message; an error ends its own session only."""
        try:
            if message.kind == OPEN:
                plan: Plan = decode(message.content.decode())
                self.sessions[message.session] = plan, plan.observer.init()
            elif message.kind == CLOSE:
                self.sessions.pop(message.session, None)
            elif message.session in self.sessions:
                return self._forces(message)
        except Endless:
            self.sessions.pop(message.session, None)
            return Message(REFUSED, message.session)
        except Exception as error:
            self.sessions.pop(message.session, None)
            return Message(FAILED, message.session, content=repr(error).encode()[:2000])
        return None

    def _forces(self, message: Message) -> Message:
        plan, state = self.sessions[message.session]
        samples = np.frombuffer(message.content, "<f8").reshape(-1, plan.channels)
        missing = message.first - plan.origin - state.count
        if missing > 0:
            state = plan.observer.bridge(state, missing)
        settling = min(max(plan.settling - state.observer.filtered, 0), samples.shape[0])
        with np.errstate(all="ignore"):
            state, block = plan.observer.run(state, *plan.signals(samples))
        if not np.all(np.isfinite(block.force)):
            raise Endless
        force = block.force[settling:, list(plan.order)]
        self.sessions[message.session] = plan, state
        drift, known = plan.observer.drift(state), float(state.angle.known)
        return Message(FORCES, message.session, message.first + settling, message.arrived, drift, known, force.astype("<f8").tobytes())
