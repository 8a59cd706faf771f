"""Protocol of the durable engine, which carries jobs to their end whatever process dies; tests have one in memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

#: What an unfinished job remembers belongs to this version: raise it when steps change their order, names or texts.
#: A job that began with another version starts over.
VERSION = "4"
#: Returns the stored text of a step by its name, or computes and stores it.
Remember = Callable[[str, Callable[[], str]], str]
#: Carries out the job of an id; a repetition gives the same result.
Carry = Callable[[str, Remember], None]


@dataclass(frozen=True, slots=True)
class Carried:
    """State of a job in the engine.

    `state`: waiting, running or over
    `executor`: name of the worker that runs it
    `current`: whether workers of this release can run it
    """

    job: str
    state: str
    executor: str | None = None
    current: bool = True


class JobBackend(Protocol):
    """A durable engine: a job that was submitted is carried out until its call returns.

    Each kind of jobs has a queue of its own: none waits behind jobs of another kind.
    Once it has started, every call may raise `Unavailable`.
    """

    def start(self, executor: str, carry: Carry, kinds: Sequence[str]) -> None:
        """Carry out jobs of these kinds as this executor, one at a time of each, its own unfinished ones first."""

    def submit(self, job: str, kind: str) -> None:
        """Submit a job, which is carried out once however often it is submitted; the oldest of a kind first."""

    def carried(self) -> Sequence[Carried]:
        """Return all jobs of the engine."""

    def resume(self, job: str, kind: str) -> None:
        """Return the job of a dead executor to the queue of its kind."""

    def forget(self, jobs: Sequence[str]) -> None:
        """Delete jobs that are over, with their steps."""
