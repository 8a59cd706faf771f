"""What the process of the streams computes: a live observer for each session, blocks in, forces out."""

from __future__ import annotations

import pickle
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rcsa_ident.arrays import FloatArray

if TYPE_CHECKING:
    # loads the observers, which this module needs in the process of the streams alone
    from rcsa_ident.workflows.stream_forces import LiveObserver, LiveState

#: kind, session, first index, time of arrival [s], two numbers of the answer, bytes that follow.
HEADER = struct.Struct("<BQQdddI")
#: To the process.
OPEN, BLOCK, CLOSE = 1, 2, 3
#: From the process.
READY, FORCES, REFUSED, FAILED = 11, 12, 13, 14


class Endless(Exception):
    """Signals whose forces are not finite."""


@dataclass(frozen=True, slots=True)
class Message:
    """What crosses between service and process.

    Parameters
    ----------
    kind : int
        OPEN: content is a `Plan`, pickled by one of the service's own workers. BLOCK: content is float64[samples, channels], `first`
        its index. FORCES: content is float64[samples, axes], `drift` of the spindle's speed as a share, `known` 1 where the
        spindle's angle was. REFUSED: forces are not finite. FAILED: content is what is logged.
    session : int
    first : int
    arrived : float [s]
        Clock of the whole machine; goes back with the forces.
    drift, known : float
    content : bytes
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
    """Where a quantity stands in a frame: channel, and the signal of one metre or metre per second squared."""

    channel: int
    sensitivity: float


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """How a session's forces are found.

    Parameters
    ----------
    observer : LiveObserver
    gap : tuple of Column
        For each axis.
    acceleration : tuple of Column or None
    channels : int
        Of a frame.
    origin : int
        Index of the sample at which the observer begins.
    order : tuple of int
        Places of the observer's axes in the answer's columns.
    """

    observer: LiveObserver
    gap: tuple[Column, ...]
    acceleration: tuple[Column | None, ...]
    channels: int
    origin: int
    order: tuple[int, ...]

    def signals(self, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return gaps [m] and accelerations [m/s^2] of a block, shape (n, a) each."""
        gap = np.stack([samples[:, c.channel] / c.sensitivity for c in self.gap], axis=1)
        still = np.zeros(samples.shape[0])
        shaken = [still if c is None else samples[:, c.channel] / c.sensitivity for c in self.acceleration]
        return gap, np.stack(shaken, axis=1)


class Engine:
    """All sessions of the process."""

    def __init__(self) -> None:
        self.sessions: dict[int, tuple[Plan, LiveState]] = {}

    def answer(self, message: Message) -> Message | None:
        """Return what a message is answered with; what fails ends its session alone."""
        try:
            if message.kind == OPEN:
                plan: Plan = pickle.loads(message.content)
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
        with np.errstate(all="ignore"):
            state, block = plan.observer.run(state, *plan.signals(samples))
        force = block.force[:, list(plan.order)]
        if not np.all(np.isfinite(force)):
            raise Endless
        self.sessions[message.session] = plan, state
        drift, known = plan.observer.drift(state), float(state.angle.known)
        return Message(FORCES, message.session, message.first, message.arrived, drift, known, force.astype("<f8").tobytes())
