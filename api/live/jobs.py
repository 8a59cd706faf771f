"""Jobs as their clients follow them: submission, state, waiting, server-sent events, result and cancellation."""

from __future__ import annotations

import json
import logging
import re
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from typing import Annotated, Any

from fastapi import Header, Path, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse
from fastapi.sse import KEEPALIVE_COMMENT, EventSourceResponse, format_sse_event

from api.components import Components
from api.conventions import found_or_404, in_use
from api.jobs.event_feed import Crowded
from api.problems import Problem
from api.schemas.common import ID_PATTERN
from api.schemas.jobs import JobAnswer
from api.security import Caller, now, seconds_between, still_valid
from api.stores.entities import Taken
from api.stores.jobs import OPEN, Full, Job

log = logging.getLogger("rcsa_ident.service")
#: Retry-After [s], and interval of the heartbeat of an event stream without events [s].
AGAIN, HEARTBEAT = "2", 15.0
#: After how long a client whose stream broke off opens another [ms].
REOPEN = 2000
#: Interval between two checks of the API key [s].
LOOK = 3.0
#: Longest wait of a request for the end of a job [s].
LONGEST_WAIT = 30.0
#: Where jobs of each kind are.
_PLACES = {"identification": "identifications", "lobes": "lobes", "path": "paths"}
JobId = Annotated[str, Path(pattern=ID_PATTERN, description="Id of a job.")]
Prefer = Annotated[
    str | None, Header(max_length=200, description="`wait=N`: answer when the job has ended, after N s (at most 30) at the latest.")
]
Seen = Annotated[
    str | None, Header(alias="Last-Event-ID", pattern=r"^\d{1,18}$", description="Number of the last event that the client knows.")
]
RETRY = {"Retry-After": {"description": "Seconds.", "schema": {"type": "string"}}}
ACCEPTED: dict[str, Any] = {
    "model": JobAnswer,
    "description": "The job is accepted; it survives restarts of the service.",
    "headers": {"Location": {"description": "Of the job.", "schema": {"type": "string"}}, **RETRY},
}
_EVENT: dict[str, Any] = {
    "type": "object",
    "description": "One event of the stream; its data is JSON.",
    "properties": {
        "event": {"enum": ["progress", "trace", "fit", "partial", "note", "end"]},
        "data": {"type": "string"},
        "id": {"type": "string"},
        "retry": {"type": "integer"},
    },
    "required": ["event", "data"],
}
STREAM: dict[str, Any] = {
    "description": "Server-sent events: `progress` and `end` with the job, `trace` with axis, stage, cost and seconds, `fit` with axis, "
    "frequency_hz, measured_abs and model_abs [m/N], `partial` with what of a tooling's lobes is known (`PartialLobes`), `note` with a "
    "text: a sentence of the job's story. It ends with `end`.",
    "content": {EventSourceResponse.media_type: {"schema": _EVENT}},
}


def answers(components: Components, jobs: Sequence[Job]) -> list[JobAnswer]:
    """Return jobs as clients see them, those that wait with their places."""
    waiting = [job.id for job in jobs if job.state == "queued"]
    places = components.store.jobs.places(waiting) if waiting else {}
    return [_answer(job, places.get(job.id)) for job in jobs]


def answer(components: Components, job: Job) -> JobAnswer:
    """Return a job as clients see it."""
    return answers(components, [job])[0]


def _answer(job: Job, queue: tuple[int, int] | None) -> JobAnswer:
    names = ("id", "kind", "machine", "campaign", "state", "created", "started", "finished", "status")
    columns = {name: getattr(job, name) for name in names}
    texts = {name: None if text is None else json.loads(text) for name, text in (("progress", job.progress), ("problem", job.problem))}
    end = job.finished or now()
    begun = job.started or end
    # clocks of the service and of a worker elsewhere may differ
    times = {"waited_s": max(seconds_between(job.created, begun), 0.0), "running_s": max(seconds_between(begun, end), 0.0)}
    place = None if queue is None else {"place": queue[0], "waiting": queue[1]}
    return JobAnswer.model_validate(columns | texts | times | {"queue": place})


def place(job: Job) -> str:
    """Return the path of a job."""
    return f"/v1/{_PLACES[job.kind]}/{job.id}"


def accepted(components: Components, job: Job) -> JSONResponse:
    """Return the answer 202 to a submitted job."""
    return JSONResponse(answer(components, job).model_dump(mode="json"), 202, {"Location": place(job), "Retry-After": AGAIN})


def submit(components: Components, job: Job, texts: Mapping[str, str], repeat: tuple[str, str] | None) -> Job:
    """Store a job, which a worker then carries out."""
    try:
        kept = components.store.jobs.add(job, texts, components.settings.job_queue, repeat)
    except Taken as taken:
        raise in_use(taken, None, repeat and repeat[0]) from None
    except Full:
        raise Problem(503, f"{components.settings.job_queue} jobs are waiting already", headers={"Retry-After": "60"}) from None
    except KeyError:
        raise Problem(404, "there is no such machine") from None
    # the worker that carries it out knows the job, not the request
    log.info("job accepted", extra={"fields": {"job": kept.id, "kind": kept.kind}})
    return kept


def job_of(components: Components, group: str, id: str, kind: str) -> Job:
    """Return a job of a group and kind."""
    found = components.store.jobs.get(group, id)
    return found_or_404(found if found is not None and found.kind == kind else None, "job")


def _followed(components: Components, group: str, id: str, kind: str) -> Job:
    """Return a job of a group and kind that somebody follows."""
    job = job_of(components, group, id, kind)
    if job.watched is not None and job.state in OPEN:
        components.store.jobs.watch(id, now())
    return job


async def _awaited(components: Components, group: str, id: str, kind: str, prefer: str | None) -> Job:
    """Return a job, where the client prefers so after it has ended."""
    job = await run_in_threadpool(_followed, components, group, id, kind)
    wanted = re.search(r"(?:^|[,;\s])wait\s*=\s*\"?(\d{1,6})", prefer or "")
    end = time.monotonic() + min(float(wanted[1]) if wanted else 0.0, LONGEST_WAIT)
    while job.state in OPEN and time.monotonic() < end:
        await components.feeds.wait(id, job.events, end - time.monotonic())
        job = await run_in_threadpool(job_of, components, group, id, kind)
    return job


async def state_of(components: Components, group: str, id: str, kind: str, prefer: str | None, response: Response) -> JobAnswer:
    """Return a job as clients see it, where the client prefers so after it has ended; one that goes on says when to ask again."""
    job = await _awaited(components, group, id, kind, prefer)
    if job.finished is None:
        response.headers["Retry-After"] = AGAIN
    return await run_in_threadpool(answer, components, job)


async def answered(
    components: Components, group: str, id: str, kind: str, prefer: str | None, response: Response
) -> tuple[JobAnswer, str | None]:
    """Return the same with the job's answer, which is there once it is done."""
    job = await state_of(components, group, id, kind, prefer, response)
    return job, await run_in_threadpool(components.store.jobs.text, id, "answer") if job.state == "done" else None


def cancel(components: Components, group: str, id: str, kind: str, response: Response) -> JobAnswer:
    """Cancel a job; one that has ended answers 409."""
    job_of(components, group, id, kind)
    job, cancelled = found_or_404(components.store.jobs.cancel(group, id, now()), "job")
    if not cancelled:
        raise Problem(409, f"the job has already ended: its state is {job.state}")
    response.headers["Location"] = place(job)
    return answer(components, job)


def finished(components: Components, group: str, id: str, kind: str, name: str) -> str:
    """Return a result of a finished job."""
    job = job_of(components, group, id, kind)
    if job.state != "done":
        raise Problem(409, f"the job has no result: its state is {job.state}", headers={"Retry-After": AGAIN} if job.state in OPEN else {})
    text, days = components.store.jobs.text(id, name), components.settings.keep_results_days
    if text is None and days:
        raise Problem(404, f"the result of the job is not there any more: results are kept for {days:g} days")
    return found_or_404(text, "result")


async def events(components: Components, caller: Caller, id: str, kind: str, seen: str | None) -> EventSourceResponse:
    """Return the stream of a job's events after a number; it ends when the caller's key does."""
    job = await run_in_threadpool(_followed, components, caller.group, id, kind)
    try:
        watching = components.feeds.stream(caller.group)
        watching.__enter__()
    except Crowded:
        raise Problem(503, "too many event streams of jobs are open, of this group or of all", headers={"Retry-After": "30"}) from None

    async def stream() -> AsyncIterator[bytes]:
        try:
            async for part in _events(components, caller, job, int(seen or 0)):
                yield part
        finally:
            watching.__exit__(None, None, None)

    return EventSourceResponse(stream(), headers={"X-Accel-Buffering": "no"})


def longest(components: Components, job: Job) -> float:
    """Return for how long a stream of a job's events goes on [s]."""
    settings = components.settings
    # a lost network looks like a client that listens: of a job that somebody has to follow the client opens another stream in time
    return settings.watch_seconds if job.watched is None else min(settings.watch_seconds, settings.unwatched_seconds / 2.0)


async def _events(components: Components, caller: Caller, job: Job, after: int) -> AsyncIterator[bytes]:
    end, beat = time.monotonic() + longest(components, job), time.monotonic() + HEARTBEAT
    # the current state first, without a number: it is not an event that could be missed
    told = await run_in_threadpool(answer, components, job)
    yield format_sse_event(event="progress", data_str=told.model_dump_json(), retry=REOPEN)
    while time.monotonic() < end and await run_in_threadpool(still_valid, components, caller):
        found = await components.feeds.events(job.id, after)
        for event in found:
            after = event.number
            if event.kind in ("progress", "end"):
                current = await run_in_threadpool(components.store.jobs.find, job.id)
                if current is None:
                    return
                told = await run_in_threadpool(answer, components, current)
                yield _event(after, event.kind, told.model_dump_json())
            else:
                yield _event(after, event.kind, event.data)
            if event.kind == "end":
                return
        if found:
            continue
        current = await run_in_threadpool(components.store.jobs.find, job.id)
        if current is None:
            return
        if current.state not in OPEN:
            # the client reconnected after the end
            yield _event(None, "end", (await run_in_threadpool(answer, components, current)).model_dump_json())
            return
        if current.state == "queued":
            # jobs before it have ended: nothing of its own has happened
            moved = await run_in_threadpool(answer, components, current)
            if moved.queue != told.queue:
                told = moved
                yield _event(None, "progress", told.model_dump_json())
        if not await components.feeds.wait(job.id, after, min(LOOK, max(end - time.monotonic(), 0.0))) and time.monotonic() > beat:
            beat = time.monotonic() + HEARTBEAT
            yield KEEPALIVE_COMMENT


def _event(number: int | None, kind: str, data: str) -> bytes:
    return format_sse_event(event=kind, data_str=data, id=None if number is None else str(number))
