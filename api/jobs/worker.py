"""Job worker: claims a name, sends heartbeats, takes over the jobs of dead workers, and hands jobs to the durable engine."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import psutil

from api.jobs.backend import JobBackend, Remember
from api.jobs.job_context import TOO_LARGE, Faulty, JobContext, Outdated, Stopped, patiently
from api.log_lines import tell, telling
from api.stores.entities import Damaged, Unavailable
from api.stores.jobs import Job, Jobs, Outcome, Worker
from rcsa_ident.base.errors import InputError

log = logging.getLogger("rcsa_ident.jobs")
#: Intervals between two polls for new jobs, two heartbeats and two rounds of housekeeping, and time without a sign of life after which a
#: worker counts as dead [s].
LOOK, BEAT, ROUND, LEASE = 0.5, 4.0, 3.0, 20.0
#: Carries out a job of one kind and returns its outcome, without the seconds.
Carrier = Callable[[Job, JobContext], Outcome]


def carry(
    jobs: Jobs,
    carriers: Mapping[str, Carrier],
    token: str,
    attempts: int,
    id: str,
    remember: Remember,
    leave: Callable[[int], Any] = os._exit,
) -> None:
    """Carry out a job and store its outcome; in any case either the job ends or the process does.

    `attempts`: times that a job may be started without completing another step
    """
    with telling(job=id):
        try:
            job = patiently(lambda: jobs.begin(id, token, _now()))
            if job is None:
                return
            tell(key=job.key, group=job.group)
            start = time.monotonic()
            outcome = _given_up(attempts) if job.attempts > attempts else _outcome(jobs, carriers[job.kind], job, token, remember, leave)
            if outcome is not None:
                seconds = job.seconds + time.monotonic() - start
                names = ("state", "status", "problem", "texts", "applied")
                whole = Outcome(finished=_now(), seconds=seconds, **{name: getattr(outcome, name) for name in names})
                patiently(lambda: jobs.finish(id, token, whole))
        except Unavailable as error:
            log.error("the database does not answer", exc_info=error)
            leave(1)


def _outcome(jobs: Jobs, carrier: Carrier, job: Job, token: str, remember: Remember, leave: Callable[[int], Any]) -> Outcome | None:
    """Outcome of the job; None where it was stopped, or has to start over."""
    try:
        with JobContext(jobs, job.id, token, remember, leave, resumed=job.progress is not None) as context:
            return carrier(job, context)
    except (Stopped, Outdated):
        # of an outdated job the engine knows no more than that it is over: it forgets it, and begins anew
        return None
    except (InputError, MemoryError) as fault:
        error = TOO_LARGE if isinstance(fault, MemoryError) else fault
        found = error.found if isinstance(error.found, str) else repr(error.found)
        where = f"{error.where}: " if error.where else ""
        return failed(f"{where}{error.field}: found {found}, allowed is {error.allowed}", (error.field, found, error.allowed))
    except Unavailable:
        raise
    except Damaged as error:
        log.error("damaged", extra={"fields": {"found": str(error)}})
        return failed(str(error))
    except Faulty:
        return failed("an internal error occurred; it is logged under this job's id")
    except Exception as error:
        log.error("unexpected", exc_info=error)
        return failed("an internal error occurred; it is logged under this job's id")


def failed(detail: str, *errors: tuple[str, str, str]) -> Outcome:
    """Return the outcome of a failed job."""
    entries = [dict(zip(("field", "found", "allowed"), error, strict=True)) for error in errors]
    return Outcome("failed", "", problem=json.dumps({"detail": detail, "errors": entries}))


def _given_up(attempts: int) -> Outcome:
    return failed(f"the worker process has died {attempts} times at the same step: perhaps it needs more memory than is available")


class JobWorker:
    """The job worker of this process. `carriers`: mapping of kind to Carrier, of the kinds that it carries out."""

    def __init__(self, jobs: Jobs, backend: JobBackend, carriers: Mapping[str, Carrier], attempts: int) -> None:
        self.jobs, self.backend, self.carriers, self.attempts = jobs, backend, carriers, attempts
        self.token, self.place = secrets.token_hex(12), place()
        self.id = ""
        self.submitted: set[str] = set()
        self.seen: dict[str, tuple[tuple[int, float], float]] = {}

    def run(self, ready: Callable[[], None], stop: threading.Event) -> None:
        """Work until `stop` is set; a running job continues elsewhere, or after the next start."""
        while not self._claim():
            if stop.wait(LOOK):
                return
        kinds = tuple(self.carriers)
        self.backend.start(self.id, lambda id, remember: carry(self.jobs, self.carriers, self.token, self.attempts, id, remember), kinds)
        log.info("job worker", extra={"fields": {"worker": self.id, "kinds": ", ".join(kinds)}})
        ready()
        last_beat = last_round = 0.0
        while not stop.wait(LOOK):
            now = time.monotonic()
            try:
                if now - last_beat >= BEAT:
                    if not self.jobs.beat(self.id, self.token):
                        # suspended for so long that another worker has taken over the jobs
                        log.error("another worker has taken this one for dead", extra={"fields": {"worker": self.id}})
                        os._exit(3)
                    last_beat = now
                self.submit_accepted()
                if now - last_round >= ROUND:
                    self.reconcile()
                    last_round = now
            except Unavailable as error:
                log.warning("the database does not answer", exc_info=error)
        self.jobs.leave(self.id, self.token)

    def submit_accepted(self) -> None:
        """Hand jobs to the engine: all that have begun, and of each kind the one whose turn it is, once this worker has none of it.

        What waits stays in the store: whose turn it is shows when a place is free, not when a job is accepted.
        """
        open = [job for job in self.jobs.open() if job.kind in self.carriers]
        self.submitted &= {job.id for job in open}
        handed = (job for job in open if (job.id in self.submitted if job.state == "queued" else job.worker == self.token))
        busy = {job.kind for job in handed}
        for job in open:
            if job.id not in self.submitted and (job.state == "running" or job.kind not in busy):
                self.backend.submit(job.id, job.kind)
                self.submitted.add(job.id)
                busy |= {job.kind} if job.state == "queued" else set()

    def reconcile(self) -> None:
        """Take over jobs of dead workers, delete finished ones from the engine, and submit again those that it has lost."""
        # in this order: a job accepted in between is open and not yet in the engine
        carried = {each.job: each for each in self.backend.carried()}
        open = {job.id: job for job in self.jobs.open()}
        rows = self._living()
        names, tokens = {row.id for row in rows}, {row.token for row in rows} - {self.token}
        for id, each in carried.items():
            orphan = each.state == "running" and each.executor not in names and id in open and open[id].worker not in tokens
            # one of several workers that see it takes it over
            if orphan and self.jobs.take(id, open[id].worker, self.token):
                log.warning("job taken over from a dead worker", extra={"fields": {"job": id, "from": each.executor, "worker": self.id}})
                self.backend.resume(id, open[id].kind)
        done = {
            id
            for id, each in carried.items()
            if each.state == "over"
            or (each.state == "waiting" and id not in open)
            # of another version: its executor is dead, or has been replaced by this one under its name
            or not (each.current or each.executor in names - {self.id})
        }
        if done:
            self.backend.forget(sorted(done))
        # the row counts: the tables of the engine may be older, newer or lost
        self.submitted &= set(carried) - done

    def _claim(self) -> bool:
        """Claim the first name of this place that is free or belongs to a dead worker."""
        living = {row.id for row in self._living()}
        rows = {row.id: row for row in self.jobs.workers()}
        number = 1
        while f"{self.place}-{number}" in living:
            number += 1
        name = f"{self.place}-{number}"
        row = Worker(name, self.place, process(os.getpid()), self.token)
        if not self.jobs.claim(row, rows[name].token if name in rows else None):
            return False
        self.id = name
        return True

    def _living(self) -> list[Worker]:
        """Workers that appear alive; clocks differ between machines, so only changes of their heartbeats count.

        One of this place that computes is alive, too: a long step leaves its heartbeat no time, least of all on a machine under load.
        """
        now, found = time.monotonic(), []
        for row in self.jobs.workers():
            sign = (row.beats, spent(row.process) if row.place == self.place else 0.0)
            before, since = self.seen.get(row.token, (sign, now))
            if before != sign:
                since = now
            self.seen[row.token] = (sign, since)
            if now - since <= LEASE and not (row.place == self.place and gone(row.process)):
                found.append(row)
        return found


def place() -> str:
    """Return an id shared by processes that can see each other: of the machine since its boot, and of the container."""
    parts = [socket.gethostname()]
    for name in ("/proc/sys/kernel/random/boot_id", "/proc/self/ns/pid"):
        try:
            parts.append(os.readlink(name) if "ns" in name else Path(name).read_text(encoding="ascii").strip())
        except OSError:
            parts.append("")
    return "w" + hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]


def process(number: int) -> str:
    """Return the identity of a process, its number and start time, which differs from a later one of the same number."""
    try:
        # after the name in parentheses, which may hold anything: field 3 is the state, field 22 the start time
        fields = Path(f"/proc/{number}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return _elsewhere(number)
    return f"{number}:" if fields[0] == "Z" else f"{number}:{fields[19]}"


def _elsewhere(number: int) -> str:
    """The same of a system without ``/proc``."""
    try:
        return f"{number}:{psutil.Process(number).create_time()}"
    except psutil.Error:
        return f"{number}:"


def spent(identity: str) -> float:
    """Return what a process of this place has used of processors [s], 0 where nobody knows."""
    try:
        used = psutil.Process(int(identity.partition(":")[0])).cpu_times()
    except (psutil.Error, ValueError):
        return 0.0
    return float(used.user + used.system)


def gone(identity: str) -> bool:
    """Whether a process of this place has certainly ended, by its identity."""
    return not identity.endswith(":") and process(int(identity.partition(":")[0])) != identity


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
