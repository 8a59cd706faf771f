"""Context of a running job: its stored steps, its events and progress, and its cancellation."""

from __future__ import annotations

import json
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextvars import copy_context
from typing import Any, TypeVar

from api.codec import Unknown, decode, encode
from api.jobs.backend import VERSION, Remember
from api.stores.entities import Destroyed, Unavailable
from api.stores.jobs import Event, Jobs
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import Map

log = logging.getLogger("rcsa_ident.jobs")
#: Said by a job whose memory is of no use.
STARTS_OVER = "The job starts over from its recordings: what it had stored was written by another version of the service, or is lost."
#: Intervals between two deliveries of events, two events of a kind and two curves of one topic [s].
DELIVERY, PAUSE, CURVE = 0.4, 0.1, 1.0
#: Events of a job after which their interval doubles, again and again.
MANY = 1000
#: Time for a cancelled job to end by itself [s].
GRACE = 2.0
#: Time without an answer of the store after which the process gives up, and pause between two questions [s].
PATIENCE, ASKING = 60.0, 1.0
#: The refusal of a job that needs more memory than its process may take.
TOO_LARGE = InputError("job", "one that needs more memory than the service allows", "a smaller one, or a larger RCSA_IDENT_JOB_MEMORY")


Answer = TypeVar("Answer")


def patiently(ask: Callable[[], Answer]) -> Answer:
    """Return what the store answers, and ask again while its database does not: a server that starts anew costs a job nothing.

    Raises `Unavailable`: there was no answer for `PATIENCE`, or the database is damaged.
    """
    start = time.monotonic()
    while True:
        try:
            return ask()
        except Unavailable as error:
            if isinstance(error, Destroyed) or time.monotonic() - start > PATIENCE:
                raise
            time.sleep(ASKING)


class Stopped(Exception):
    """The job has been cancelled or given to another worker."""


class Outdated(Exception):
    """What a step of the job came to was written by another version of the service, and cannot be read."""


class Faulty(Exception):
    """A step of the job has failed unexpectedly."""


class JobContext:
    """Context of a running job, whose events a thread of its own delivers to the store.

    `job`, `token`: of the job, and of the worker
    `leave`: ends the process with an exit code; the job continues from its last step elsewhere or after a restart
    `resumed`: the job had come past its first step before: if that is not remembered, it says so
    """

    def __init__(
        self,
        jobs: Jobs,
        job: str,
        token: str,
        remember: Remember,
        leave: Callable[[int], Any] = os._exit,
        resumed: bool = False,
    ) -> None:
        self.jobs, self.job, self.token, self.engine, self.leave, self.resumed = jobs, job, token, remember, leave, resumed
        self.stopped, self.over = threading.Event(), threading.Event()
        self.lock = threading.Lock()
        self.events: list[Event] = []
        self.state: str | None = None
        self.came_further = False
        self.count = 0
        self.last: dict[str, float] = {}
        self.thread = threading.Thread(target=copy_context().run, args=(self._deliver_until_over,), daemon=True)

    def __enter__(self) -> JobContext:
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.over.set()
        self.thread.join()
        if not self.stopped.is_set():
            self._deliver()

    def text(self, name: str) -> str | None:
        """Return an input of the job."""
        return patiently(lambda: self.jobs.text(self.job, name))

    def check(self) -> None:
        """Raise `Stopped` where the job is not to continue here."""
        if self.stopped.is_set():
            raise Stopped

    def remember(self, name: str, compute: Callable[[], Any]) -> Any:
        """Return the result of a step, which is computed once whatever process dies.

        Raises `InputError` as the step has raised it.
        Raises `Faulty`: the step has raised something else.
        Raises `Outdated`: it is remembered, but by another version of the service, or in a form that cannot be read.
        """
        self.check()
        computed: dict[str, Any] | None = None

        def outcome() -> str:
            nonlocal computed
            computed = self._outcome(name, compute)
            return _text(computed)

        try:
            text = self.engine(name, outcome)
        except Exception as error:
            # the job belongs to another worker, or the engine fails: no outcome of the job
            log.error("the durable engine has refused a step", exc_info=error, extra={"fields": {"step": name}})
            self.leave(3)
            raise Stopped from error
        if computed is not None and self.resumed:
            self._add(Event(0, "note", json.dumps({"text": STARTS_OVER})))
        self.resumed = False
        found = _read(text)
        if found is None:
            if computed is None:
                log.warning("remembered by another version, or not at all", extra={"fields": {"step": name}})
                raise Outdated(name)
            # the work is done and its result in hand: only if the process dies has the job to start over
            log.error("a step cannot be read back", extra={"fields": {"step": name}})
            found = computed
        elif computed is not None and "value" in found:
            self.came_further = True
        if "refused" in found:
            raise InputError(*found["refused"])
        if "value" not in found:
            self.check()
            raise Faulty(name)
        return found["value"]

    def _outcome(self, name: str, compute: Callable[[], Any]) -> dict[str, Any]:
        # the engine stores results only: it would restore exceptions by rules of its own
        try:
            return {"value": compute()}
        except (InputError, MemoryError) as error:
            refused = TOO_LARGE if isinstance(error, MemoryError) else error
            return {"refused": (refused.field, str(refused.found), refused.allowed, refused.where)}
        except Stopped:
            return {}
        except Exception as error:
            log.error("a step has failed", exc_info=error, extra={"fields": {"step": name}})
            return {}

    def map(self, function: Callable[[Any], Any], tasks: Sequence[Any], name: str, stage: str, spread: Map = map) -> Iterator[Any]:
        """Yield the results of all tasks in order, each a step of its own: where nobody asks for the next one, it is not done.

        `name`: of this call: unique in the job, and the same in every run
        `stage`: reported as progress meanwhile
        `spread`: the builtin `map` or that of a pool; tasks without a stored result go through it together
        """
        running: Any = None
        for i in range(len(tasks)):

            def compute(i: int = i) -> Any:
                nonlocal running
                if running is None:
                    running = iter(spread(function, tasks[i:]))
                return next(running)

            self.progress(stage, i, len(tasks))
            yield self.remember(f"{name}.{i}", compute)
        self.progress(stage, len(tasks), len(tasks))

    def progress(self, stage: str, done: int, total: int) -> None:
        """Report the progress of the job."""
        with self.lock:
            self.state = json.dumps({"stage": stage, "done": done, "total": total})
        self.check()

    def event(self, kind: str, data: dict[str, Any]) -> None:
        """Report an event; most events in quick succession are omitted."""
        now = time.monotonic()
        if now - self.last.get(kind, 0.0) >= PAUSE * 2.0 ** (self.count // MANY):
            self.last[kind] = now
            self.count += 1
            self._add(Event(0, kind, json.dumps(data, allow_nan=False)))
        self.check()

    def curve(self, topic: str, data: Callable[[], dict[str, Any] | None], kind: str = "fit") -> None:
        """Report a curve that replaces the previous one of its topic; computed at most once a second, None is not reported."""
        now = time.monotonic()
        if now - self.last.get(topic, 0.0) >= CURVE:
            self.last[topic] = now
            found = data()
            if found is not None:
                self._add(Event(0, kind, json.dumps(found, allow_nan=False), topic))
        self.check()

    def _add(self, event: Event) -> None:
        with self.lock:
            self.events.append(event)

    def _deliver_until_over(self) -> None:
        while not self.over.wait(DELIVERY):
            if not self._deliver():
                job = patiently(lambda: self.jobs.find(self.job))
                if job is not None and job.state == "running":
                    # another worker has taken the job over: report nothing more
                    log.error("the job belongs to another worker now")
                    self.leave(3)
                self.stopped.set()
                if not self.over.wait(GRACE):
                    # long work without a check cannot be stopped otherwise
                    self.leave(0)
                return

    def _deliver(self) -> bool:
        """Hand over what there is, and return whether the job is still wanted here."""
        with self.lock:
            events, self.events = self.events, []
            state, self.state = self.state, None
            further, self.came_further = self.came_further, False
        try:
            return patiently(lambda: self.jobs.tell(self.job, self.token, events, state, further))
        except Unavailable:
            log.error("the database does not answer")
            self.leave(1)
            return False


def _text(outcome: dict[str, Any]) -> str:
    """Return what a step came to, with the version that says so; what cannot be encoded is of none."""
    try:
        return encode({"version": VERSION, **outcome})
    except Unknown as error:
        log.error("a step cannot be stored", exc_info=error)
        return encode({"version": ""})


def _read(text: str) -> dict[str, Any] | None:
    """Return what a step came to; None where another version of the service says so."""
    try:
        found = decode(text)
    except Unknown:
        return None
    return found if isinstance(found, dict) and found.get("version") == VERSION else None
