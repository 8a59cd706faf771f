"""Jobs: what was accepted, how far it is, what it has told and found; and the workers that carry jobs out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

OPEN = ("queued", "running")
STATES = (*OPEN, "done", "failed", "cancelled")


class Full(Exception):
    """As many jobs of the group wait as are allowed."""


@dataclass(frozen=True, slots=True)
class Job:
    """Work that was accepted.

    Parameters
    ----------
    id, group, kind, machine : str
    campaign : str or None
    request : str
        What was asked for, JSON.
    state : str
        One of `STATES`.
    created : str
        UTC, ISO 8601.
    progress : str or None
        Stage, done and total, JSON.
    status : str or None
        Of an identification that is done: converged, suspect or failed.
    problem : str or None
        Why it failed, JSON.
    started, finished : str or None
    seconds : float [s]
        That it took, waiting left out.
    attempts : int
        Times that it was taken up since it last came further.
    worker : str or None
        Token of the process that carries it out.
    events : int
        Number of its last event.
    """

    id: str
    group: str
    kind: str
    machine: str
    campaign: str | None
    request: str
    state: str
    created: str
    progress: str | None = None
    status: str | None = None
    problem: str | None = None
    started: str | None = None
    finished: str | None = None
    seconds: float = 0.0
    attempts: int = 0
    worker: str | None = None
    events: int = 0


@dataclass(frozen=True, slots=True)
class Event:
    """What a job has told.

    Parameters
    ----------
    number : int
        Rises within the job, with gaps.
    kind : str
        progress, trace, fit, note or end.
    data : str
        JSON; empty for progress and end, which the job itself tells.
    topic : str
        A later event of the same topic takes the place of an earlier one; empty where all are kept.
    """

    number: int
    kind: str
    data: str
    topic: str = ""


@dataclass(frozen=True, slots=True)
class Applied:
    """The identification that a finished job gives to its machine: text, summary (JSON) and digest."""

    text: str
    summary: str
    digest: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job ended.

    Parameters
    ----------
    state : str
        done or failed.
    finished : str
    seconds : float [s]
    status, problem : str or None
    texts : mapping of name to text
        What was found.
    applied : Applied or None
    """

    state: str
    finished: str
    seconds: float = 0.0
    status: str | None = None
    problem: str | None = None
    texts: Mapping[str, str] = field(default_factory=dict)
    applied: Applied | None = None


@dataclass(frozen=True, slots=True)
class Worker:
    """A process that carries out jobs.

    Parameters
    ----------
    id : str
        The durable engine's name for it: one that takes the place of a dead one has the same.
    place : str
        The machine since its start; processes of one place see each other.
    process : str
        Which process of the place.
    token : str
        Its own alone.
    beats : int
        Rises while it lives.
    """

    id: str
    place: str
    process: str
    token: str
    beats: int = 0


class Jobs(Protocol):
    """Jobs of all groups."""

    def add(self, job: Job, texts: Mapping[str, str], most: int, repeat: tuple[str, str] | None = None) -> Job:
        """Keep a job with what it works on and return it; the same again for an idempotency key that was there, with the same digest.

        Raises
        ------
        Taken
            The idempotency key came with another content.
        Full
            So many of the group are open already.
        KeyError
            The machine is not there.
        """

    def get(self, group: str, id: str) -> Job | None:
        """Return a job."""

    def find(self, id: str) -> Job | None:
        """Return a job whatever its group is: for those who carry it out."""

    def list(self, group: str, wanted: Mapping[str, str], before: str, limit: int) -> list[Job]:
        """Return jobs of a group whose columns have the wanted values, before an id, newest first; before "" means all."""

    def cancel(self, group: str, id: str, when: str) -> tuple[Job, bool] | None:
        """End a job that is open, and return it and whether it was."""

    def open(self) -> Sequence[Job]:
        """Return all jobs that are queued or running, oldest first."""

    def begin(self, id: str, worker: str, when: str) -> Job | None:
        """Let a worker take a job up, and return it as it is then; None where it is over."""

    def take(self, id: str, dead: str | None, worker: str) -> bool:
        """Note that a worker sees to it that a job of a dead one goes on; False where somebody else was first."""

    def tell(self, id: str, worker: str, events: Sequence[Event], progress: str | None = None, further: bool = False) -> bool:
        """Add events (their numbers are given here) and the progress, and return whether the job is still this worker's to carry out.

        Parameters
        ----------
        further : bool
            It has come to a new checkpoint.
        """

    def finish(self, id: str, worker: str | None, outcome: Outcome) -> bool:
        """End a job, with all that it found in the same moment; False where it is over, or another worker's. None is whosever."""

    def events(self, id: str, after: int, limit: int) -> Sequence[Event]:
        """Return events behind a number."""

    def numbers(self, ids: Sequence[str]) -> dict[str, int]:
        """Return the number of the last event of each job."""

    def text(self, id: str, name: str) -> str | None:
        """Return what a job works on, or has found."""

    def counts(self) -> Sequence[tuple[str, str, int, float]]:
        """Return (kind, state, jobs, seconds that they took) over all groups."""

    def workers(self) -> Sequence[Worker]:
        """Return all workers, those that have died without a word among them."""

    def claim(self, worker: Worker, dead: str | None) -> bool:
        """Take a name that nobody has, or that of a dead one with this token; False where somebody else was first."""

    def beat(self, id: str, token: str) -> bool:
        """Live on; False where the name is another's."""

    def leave(self, id: str, token: str) -> None:
        """Give the name back; that its jobs go on elsewhere says nothing against them."""
