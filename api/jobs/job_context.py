"""Context of a running job: its stored steps, its events and progress, and its cancellation."""

from __future__ import annotations

import json
import logging
import os
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

from api.jobs.backend import Remember
from api.jobs.codec import decode, encode
from api.stores.entities import Unavailable
from api.stores.jobs import Event, Jobs
from rcsa_ident.errors import InputError

log = logging.getLogger("rcsa_ident.jobs")
Spread = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
#: Intervals between two deliveries of events, two trace events and two curves of one topic [s].
DELIVERY, WORD, CURVE = 0.4, 0.1, 1.0
#: Trace events of a job after which their interval doubles, again and again.
MANY = 1000
#: Time for a cancelled job to end by itself [s].
GRACE = 2.0
#: Time without an answer of the store after which the process gives up [s].
PATIENCE = 60.0


class Stopped(Exception):
    """The job has been cancelled or given to another worker."""


class Faulty(Exception):
    """A step of the job has failed unexpectedly."""


class JobContext:
    """Context of a running job, whose events a thread of its own delivers to the store.

    Parameters
    ----------
    jobs : Jobs
    job, token : str
        Of the job, and of the worker.
    remember : Remember
    leave : callable
        Ends the process with an exit code; the job continues from its last step elsewhere or after a restart.
    """

    def __init__(self, jobs: Jobs, job: str, token: str, remember: Remember, leave: Callable[[int], Any] = os._exit) -> None:
        self.jobs, self.job, self.token, self.engine, self.leave = jobs, job, token, remember, leave
        self.stopped, self.over = threading.Event(), threading.Event()
        self.lock = threading.Lock()
        self.events: list[Event] = []
        self.state: str | None = None
        self.came_further = False
        self.words = 0
        self.last: dict[str, float] = {}
        self.thread = threading.Thread(target=self._deliver, daemon=True)

    def __enter__(self) -> JobContext:
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.over.set()
        self.thread.join()
        if not self.stopped.is_set():
            self._tell()

    def check(self) -> None:
        """Raise `Stopped` where the job is not to continue here."""
        if self.stopped.is_set():
            raise Stopped

    def remember(self, name: str, compute: Callable[[], Any]) -> Any:
        """Return the result of a step, which is computed once whatever process dies.

        Raises
        ------
        InputError
            As the step has raised it.
        Faulty
            The step has raised something else.
        """
        self.check()
        try:
            text = self.engine(name, lambda: self._outcome(name, compute))
        except Exception as error:
            # the job belongs to another worker, or the engine fails: no outcome of the job
            log.error("the durable engine has refused a step", exc_info=error, extra={"fields": {"job": self.job, "step": name}})
            self.leave(3)
            raise Stopped from error
        found = decode(text)
        if "refused" in found:
            raise InputError(*found["refused"])
        if "value" not in found:
            self.check()
            raise Faulty(name)
        return found["value"]

    def _outcome(self, name: str, compute: Callable[[], Any]) -> str:
        # the engine stores results only: it would restore exceptions by rules of its own
        try:
            text = encode({"value": compute()})
            self.came_further = True
            return text
        except InputError as error:
            return encode({"refused": (error.field, str(error.found), error.allowed, error.where)})
        except Stopped:
            return encode({})
        except Exception as error:
            log.error("a step has failed", exc_info=error, extra={"fields": {"job": self.job, "step": name}})
            return encode({})

    def map(
        self, function: Callable[[Any], Any], tasks: Iterable[Any], name: str, stage: str, spread: Callable[..., Any] = map
    ) -> list[Any]:
        """Return the results of all tasks in order, each stored as a step.

        Parameters
        ----------
        name : str
            Of this call: unique in the job, and the same in every run.
        stage : str
            Reported as progress meanwhile.
        spread : callable
            The builtin `map` or that of a pool; tasks without a stored result go through it together.
        """
        waiting = list(tasks)
        running: Any = None
        found = []
        for i in range(len(waiting)):

            def compute(i: int = i) -> Any:
                nonlocal running
                if running is None:
                    running = iter(spread(function, waiting[i:]))
                return next(running)

            self.progress(stage, i, len(waiting))
            found.append(self.remember(f"{name}.{i}", compute))
        self.progress(stage, len(waiting), len(waiting))
        return found

    def progress(self, stage: str, done: int, total: int) -> None:
        """Report the progress of the job."""
        with self.lock:
            self.state = json.dumps({"stage": stage, "done": done, "total": total})
        self.check()

    def word(self, kind: str, data: dict[str, Any]) -> None:
        """Report an event; most events in quick succession are omitted."""
        now = time.monotonic()
        if now - self.last.get(kind, 0.0) >= WORD * 2.0 ** (self.words // MANY):
            self.last[kind] = now
            self.words += 1
            with self.lock:
                self.events.append(Event(0, kind, json.dumps(data, allow_nan=False)))
        self.check()

    def curve(self, topic: str, data: Callable[[], dict[str, Any] | None]) -> None:
        """Report a curve that replaces the previous one of its topic; computed at most once a second, None is not reported."""
        now = time.monotonic()
        if now - self.last.get(topic, 0.0) >= CURVE:
            self.last[topic] = now
            found = data()
            if found is not None:
                text = json.dumps(found, allow_nan=False)
                with self.lock:
                    self.events.append(Event(0, "fit", text, topic))
        self.check()

    def _deliver(self) -> None:
        while not self.over.wait(DELIVERY):
            if not self._tell():
                job = self.jobs.find(self.job)
                if job is not None and job.state == "running":
                    # another worker has taken the job over: report nothing more
                    log.error("the job belongs to another worker now", extra={"fields": {"job": self.job}})
                    self.leave(3)
                self.stopped.set()
                if not self.over.wait(GRACE):
                    # long work without a check cannot be stopped otherwise
                    self.leave(0)
                return

    def _tell(self) -> bool:
        with self.lock:
            events, self.events = self.events, []
            state, self.state = self.state, None
            further, self.came_further = self.came_further, False
        start = time.monotonic()
        while True:
            try:
                return self.jobs.tell(self.job, self.token, events, state, further)
            except Unavailable:
                if time.monotonic() - start > PATIENCE:
                    log.error("the database does not answer", extra={"fields": {"job": self.job}})
                    self.leave(1)
                    return False
                time.sleep(1.0)
