"""Jobs, their events and results, and the workers that carry them out: entities, and the protocol of their store."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

OPEN = ("queued", "running")
STATES = (*OPEN, "done", "failed", "cancelled")
#: Kind of the events with a part of the answer, which go when the job ends.
PARTIAL = "partial"


class Full(Exception):
    """The limit of the group's open jobs is reached."""


@dataclass(frozen=True, slots=True)
class Job:
    """An accepted job.

    `machine`: id of the one that it belongs to, and is deleted with; empty where it asks of a robot
    `request`: body of the request, JSON
    `state`: one of `STATES`
    `created`: UTC, ISO 8601
    `progress`: stage, done and total, JSON
    `status`: of an identification that is done: converged, not validated, suspect or failed
    `problem`: reason of a failure, JSON
    `seconds` [s]: that it took, waiting left out
    `attempts`: times that it was taken up since it last came further
    `worker`: token of the process that carries it out
    `events`: number of its last event
    `key`, `who`: of the API key that asked for it: id and name
    `watched`: when somebody followed it last; None where it goes on without
    `request_digest`: of the request, as it was stored
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
    key: str = ""
    who: str = ""
    watched: str | None = None
    request_digest: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a job.

    `number`: increases within the job, with gaps
    `kind`: progress, trace, fit, partial, note or end
    `data`: JSON; empty for progress and end, whose content is the job itself
    `topic`: a later event replaces an earlier one of the same topic; empty where all are stored
    """

    number: int
    kind: str
    data: str
    topic: str = ""


@dataclass(frozen=True, slots=True)
class Applied:
    """The identification that a finished job writes to its machine: text, summary (JSON) and digest."""

    text: str
    summary: str
    digest: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a job.

    `state`: done or failed
    `seconds` [s]
    `texts`: mapping of name to text, results
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

    `id`: its name as executor of the durable engine; the successor of a dead worker takes the same name
    `place`: id of the machine since its boot; processes of one place see each other
    `process`: identity of the process at its place
    `token`: unique to this worker
    `beats`: heartbeats; increases while the worker lives
    """

    id: str
    place: str
    process: str
    token: str
    beats: int = 0


class Jobs(Protocol):
    """Jobs of all groups."""

    def add(self, job: Job, texts: Mapping[str, str], most: int, repeat: tuple[str, str] | None = None) -> Job:
        """Store a job with its inputs and return it; for a repeated idempotency key with the same digest, return the first one.

        Raises
        ------
        Taken
            The idempotency key came with another content.
        Full
            The limit of the group's open jobs is reached.
        KeyError
            The machine is not there.
        """

    def get(self, group: str, id: str) -> Job | None:
        """Return a job."""

    def find(self, id: str) -> Job | None:
        """Return a job of any group, for the workers."""

    def list(self, group: str, wanted: Mapping[str, str], before: str, limit: int) -> list[Job]:
        """Return jobs of a group with the wanted values, before an id ("" for all), newest first."""

    def cancel(self, group: str, id: str, when: str) -> tuple[Job, bool] | None:
        """Cancel an open job, whose inputs are dropped, and return the job and whether it was open."""

    def watch(self, id: str, when: str) -> None:
        """Note that somebody follows a job, where that matters."""

    def watched(self) -> Mapping[str, str]:
        """Return when the open jobs that are to be watched were so last, by their ids."""

    def abandon(self, id: str, watched: str, when: str, problem: str) -> bool:
        """Cancel an open job that has not been watched since, for this reason; return whether there was one."""

    def open(self) -> Sequence[Job]:
        """Return all jobs that are queued or running, in the order of their turn: groups take turns, each with its oldest first."""

    def places(self, ids: Sequence[str]) -> dict[str, tuple[int, int]]:
        """Return (place, waiting) of each of these jobs that waits: its place among all jobs of its kind that do, and their number."""

    def begin(self, id: str, worker: str, when: str) -> Job | None:
        """Assign a job to a worker and return it; None where it is over."""

    def take(self, id: str, dead: str | None, worker: str) -> bool:
        """Transfer a job from a dead worker to another; False where a third was first."""

    def tell(self, id: str, worker: str, events: Sequence[Event], progress: str | None = None, further: bool = False) -> bool:
        """Store events, which are numbered here, and progress; return whether the job still belongs to this worker.

        Parameters
        ----------
        further : bool
            Whether the job has reached a new checkpoint.
        """

    def finish(self, id: str, worker: str | None, outcome: Outcome) -> bool:
        """Store the outcome of a job in one transaction, in the place of its inputs; False where it is over or another worker's.

        Worker None matches any.
        """

    def events(self, id: str, after: int, limit: int) -> Sequence[Event]:
        """Return the events after a number."""

    def numbers(self, ids: Sequence[str]) -> dict[str, int]:
        """Return the number of the last event of each job."""

    def text(self, id: str, name: str) -> str | None:
        """Return an input or result of a job; raises `Damaged` where it is not what was written."""

    def forget_events(self, before: str) -> int:
        """Remove the events of jobs of all groups that ended before a time, except their end, and return of how many jobs."""

    def forget_texts(self, before: str) -> int:
        """Remove inputs and results of jobs of all groups that ended before a time, and return of how many jobs."""

    def counts(self) -> Sequence[tuple[str, str, int, float]]:
        """Return (kind, state, jobs, seconds that they took) over all groups."""

    def workers(self) -> Sequence[Worker]:
        """Return all workers, including those that have died without notice."""

    def claim(self, worker: Worker, dead: str | None) -> bool:
        """Claim a free name, or that of the dead worker with this token; False where another was first."""

    def beat(self, id: str, token: str) -> bool:
        """Send a heartbeat; False where another worker has the name."""

    def leave(self, id: str, token: str) -> None:
        """Release the name; its jobs continue elsewhere, which does not count as an attempt."""
