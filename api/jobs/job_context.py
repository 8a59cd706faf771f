"""Where a job is worked on: what it remembers, what it tells on its way, and whether it is still wanted."""

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
#: Seconds between two deliveries of what was told, and between two words or two curves of one axis.
DELIVERY, WORD, CURVE = 0.4, 0.1, 1.0
#: Words of one job after which they come half as often, again and again.
MANY = 1000
#: Seconds in which a job that is no longer wanted ends by itself.
GRACE = 2.0
#: Seconds for which the store may be away before the process gives up.
PATIENCE = 60.0


class Stopped(Exception):
    """The job is no longer wanted."""


class Faulty(Exception):
    """A step of the job has failed in a way that nobody foresaw."""


class JobContext:
    """What a job works with; everything that it tells is delivered by a thread of its own.

    Parameters
    ----------
    jobs : Jobs
    job, token : str
        Of the job, and of the worker.
    remember : Remember
    leave : callable
        Ends the process with an exit code: what cannot go on here goes on after a start from the last step.
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
        """Raise `Stopped` where the job is no longer wanted."""
        if self.stopped.is_set():
            raise Stopped

    def remember(self, name: str, compute: Callable[[], Any]) -> Any:
        """Return what a step came to: computed once, whatever dies meanwhile.

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
            # it has given the job to somebody else, or is out of order itself: what is known by now is not told as an end
            log.error("the engine has refused", exc_info=error, extra={"fields": {"job": self.job, "step": name}})
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
        # the engine sees answers alone: what it made of exceptions would be read back by other rules
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
        """Return the results of all tasks in order, each a step of its own.

        Parameters
        ----------
        name : str
            Of this call: the same each time that the job is carried out, and no other call's.
        stage : str
            What the job is told to be at meanwhile.
        spread : callable
            The builtin, or a pool's: those that have no result yet go through it together.
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
        """Say how far the job is."""
        with self.lock:
            self.state = json.dumps({"stage": stage, "done": done, "total": total})
        self.check()

    def word(self, kind: str, data: dict[str, Any]) -> None:
        """Tell something; most of what comes in quick succession is left out."""
        now = time.monotonic()
        if now - self.last.get(kind, 0.0) >= WORD * 2.0 ** (self.words // MANY):
            self.last[kind] = now
            self.words += 1
            with self.lock:
                self.events.append(Event(0, kind, json.dumps(data, allow_nan=False)))
        self.check()

    def curve(self, topic: str, data: Callable[[], dict[str, Any] | None]) -> None:
        """Tell a curve, which takes the place of the one before; at most one a second is computed, None is not told."""
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
                    # it is another's now: not a word more of it
                    log.error("superseded", extra={"fields": {"job": self.job}})
                    self.leave(3)
                self.stopped.set()
                if not self.over.wait(GRACE):
                    # long work without a word cannot be stopped otherwise
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
                    log.error("the store is away", extra={"fields": {"job": self.job}})
                    self.leave(1)
                    return False
                time.sleep(1.0)
