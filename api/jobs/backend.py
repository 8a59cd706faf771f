"""What carries jobs to their end, whatever dies: asked for here, done by a durable engine, or by a table of steps in tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

#: What an unfinished job remembers belongs to this version: raise it when steps change their order, their names or what is in their
#: texts. A job that was begun with another version starts over.
VERSION = "2"
#: Gives the text that a step of a job had come to, computed if it has not been: name of the step, and what computes it.
Remember = Callable[[str, Callable[[], str]], str]
#: Carries out a job of this id; whatever it does a second time gives what it gave the first time.
Carry = Callable[[str, Remember], None]


@dataclass(frozen=True, slots=True)
class Carried:
    """What the engine knows of a job.

    Parameters
    ----------
    job : str
    state : str
        waiting, running or over.
    executor : str or None
        Who runs it.
    current : bool
        Whether workers of this release take it.
    """

    job: str
    state: str
    executor: str | None = None
    current: bool = True


class JobBackend(Protocol):
    """A durable engine: a job that was submitted is carried out until its call returns."""

    def start(self, executor: str, carry: Carry) -> None:
        """Carry out jobs under this name, one at a time; those that the name had taken up before come first."""

    def submit(self, job: str, priority: int) -> None:
        """Have a job carried out, lower priorities first; once, however often it is submitted."""

    def carried(self) -> Sequence[Carried]:
        """Return all jobs that the engine knows."""

    def resume(self, job: str) -> None:
        """Give the job of an executor that is dead to whoever is free."""

    def forget(self, jobs: Sequence[str]) -> None:
        """Forget jobs that are over, with every step."""
