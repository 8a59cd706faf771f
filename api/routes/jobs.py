"""What routes of jobs share: the job as it stands, waiting for it, its events as a stream, its end."""

from __future__ import annotations

import json
import re
import time
from collections.abc import AsyncIterator, Mapping
from typing import Annotated, Any

from fastapi import Header, Path, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse, StreamingResponse

from api.components import Components
from api.jobs.event_feed import Crowded
from api.problems import Problem
from api.routes.common import found_or_404
from api.schemas.common import ID_PATTERN
from api.schemas.jobs import JobAnswer
from api.security import now
from api.stores.entities import Taken
from api.stores.jobs import OPEN, Full, Job

EVENTS = "text/event-stream"
#: Seconds after which a client may ask again, and between two signs that a stream without events is still there.
AGAIN, HEARTBEAT = "2", 15.0
#: Longest time [s] that a query waits for the end of a job.
LONGEST_WAIT = 30.0
JobId = Annotated[str, Path(pattern=ID_PATTERN, description="Id of a job.")]
Prefer = Annotated[str | None, Header(max_length=200, description="`wait=N`: answer when the job has ended, after N s (30) at the latest.")]
Seen = Annotated[
    str | None, Header(alias="Last-Event-ID", pattern=r"^\d{1,18}$", description="Number of the last event that the client knows.")
]
RETRY = {"Retry-After": {"description": "Seconds.", "schema": {"type": "string"}}}
ACCEPTED: dict[str, Any] = {
    "model": JobAnswer,
    "description": "Accepted: it survives whatever happens to the service.",
    "headers": {"Location": {"description": "Of the job.", "schema": {"type": "string"}}, **RETRY},
}
_EVENT: dict[str, Any] = {
    "type": "object",
    "description": "One event of the stream; its data is JSON.",
    "properties": {
        "event": {"enum": ["progress", "trace", "fit", "note", "end"]},
        "data": {"type": "string"},
        "id": {"type": "string"},
        "retry": {"type": "integer"},
    },
    "required": ["event", "data"],
}
STREAM: dict[str, Any] = {
    "description": "Server-sent events: `progress` and `end` with the job, `trace` with axis, stage, cost and seconds, `fit` with axis, "
    "frequency_hz, measured_abs and model_abs [m/N], `note` with a text: a sentence of the job's story. It ends with `end`.",
    "content": {EVENTS: {"schema": _EVENT}},
}


def answer(job: Job) -> JobAnswer:
    """Return a job as clients see it."""
    names = ("id", "kind", "machine", "campaign", "state", "created", "started", "finished", "status")
    told = {name: getattr(job, name) for name in names}
    texts = {name: None if text is None else json.loads(text) for name, text in (("progress", job.progress), ("problem", job.problem))}
    return JobAnswer.model_validate(told | texts)


def place(job: Job) -> str:
    """Return where a job is found."""
    return f"/v1/{'lobes' if job.kind == 'lobes' else 'identifications'}/{job.id}"


def accepted(job: Job) -> JSONResponse:
    """Return the answer to what has become a job."""
    return JSONResponse(answer(job).model_dump(mode="json"), 202, {"Location": place(job), "Retry-After": AGAIN})


def submit(parts: Components, job: Job, texts: Mapping[str, str], repeat: tuple[str, str] | None) -> Job:
    """Keep a job; from then on it is carried out."""
    try:
        return parts.store.jobs.add(job, texts, parts.settings.job_queue, repeat)
    except Taken as taken:
        entry = {"field": str(taken), "found": str(repeat and repeat[0]), "allowed": f"a {taken} of its own"}
        raise Problem(409, f"the {taken} is in use", [entry]) from None
    except Full:
        raise Problem(503, f"{parts.settings.job_queue} jobs wait already", headers={"Retry-After": "60"}) from None
    except KeyError:
        raise Problem(404, "there is no such machine") from None


def job_of(parts: Components, group: str, id: str, kind: str) -> Job:
    """Return a job of a group and kind."""
    found = parts.store.jobs.get(group, id)
    return found_or_404(found if found is not None and found.kind == kind else None, "job")


async def awaited(parts: Components, group: str, id: str, kind: str, prefer: str | None) -> Job:
    """Return a job, and where the client prefers so, when it has ended."""
    job = await run_in_threadpool(job_of, parts, group, id, kind)
    wanted = re.search(r"(?:^|[,;\s])wait\s*=\s*\"?(\d{1,6})", prefer or "")
    end = time.monotonic() + min(float(wanted[1]) if wanted else 0.0, LONGEST_WAIT)
    while job.state in OPEN and time.monotonic() < end:
        await parts.feeds.wait(id, job.events, end - time.monotonic())
        job = await run_in_threadpool(job_of, parts, group, id, kind)
    return job


def cancel(parts: Components, group: str, id: str, kind: str, response: Response) -> JobAnswer:
    """End a job; one that has ended answers 409."""
    job_of(parts, group, id, kind)
    job, cancelled = found_or_404(parts.store.jobs.cancel(group, id, now()), "job")
    if not cancelled:
        raise Problem(409, f"the job has ended before: it is {job.state}")
    response.headers["Location"] = place(job)
    return answer(job)


def finished(parts: Components, group: str, id: str, kind: str, name: str) -> str:
    """Return what a job has found."""
    job = job_of(parts, group, id, kind)
    if job.state != "done":
        raise Problem(409, f"the job has no result: it is {job.state}", headers={"Retry-After": AGAIN} if job.state in OPEN else {})
    return found_or_404(parts.store.jobs.text(id, name), "result")


async def events(parts: Components, group: str, id: str, kind: str, seen: str | None) -> StreamingResponse:
    """Return the stream of a job's events behind a number."""
    job = await run_in_threadpool(job_of, parts, group, id, kind)
    try:
        watching = parts.feeds.stream()
        watching.__enter__()
    except Crowded:
        raise Problem(503, "too many watch jobs", headers={"Retry-After": "30"}) from None

    async def stream() -> AsyncIterator[str]:
        try:
            async for part in _told(parts, job, int(seen or 0)):
                yield part
        finally:
            watching.__exit__(None, None, None)

    return StreamingResponse(stream(), media_type=EVENTS, headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"})


async def _told(parts: Components, job: Job, after: int) -> AsyncIterator[str]:
    end = time.monotonic() + parts.settings.watch_seconds
    # what is known at once; without a number, so that it is no event that could be missed
    yield f"retry: 2000\n{_event(None, 'progress', answer(job).model_dump_json())}"
    while time.monotonic() < end:
        found = await parts.feeds.events(job.id, after)
        for event in found:
            after = event.number
            if event.kind in ("progress", "end"):
                current = await run_in_threadpool(parts.store.jobs.find, job.id)
                if current is None:
                    return
                yield _event(after, event.kind, answer(current).model_dump_json())
            else:
                yield _event(after, event.kind, event.data)
            if event.kind == "end":
                return
        if found:
            continue
        current = await run_in_threadpool(parts.store.jobs.find, job.id)
        if current is None:
            return
        if current.state not in OPEN:
            # a client that has seen the end asks once more
            yield _event(None, "end", answer(current).model_dump_json())
            return
        if not await parts.feeds.wait(job.id, after, min(HEARTBEAT, max(end - time.monotonic(), 0.0))):
            yield ": still there\n\n"


def _event(number: int | None, kind: str, data: str) -> str:
    return ("" if number is None else f"id: {number}\n") + f"event: {kind}\ndata: {data}\n\n"
