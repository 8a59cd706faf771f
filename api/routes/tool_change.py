"""After a tool change: what the tip does, and what cuts are stable."""

from __future__ import annotations

import asyncio
import hashlib
import re
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse

from api.components import Components, ThisService
from api.conventions import BODY, Repeat, guard, problems, while_there
from api.jobs.lobes import asked
from api.live import jobs
from api.lookups import asked_toolings, tip_source
from api.schemas.jobs import JobAnswer, LobeJob
from api.schemas.queries import AdviceAnswer, AdviceQuery, LobeAnswer, LobeQuery, TipAnswer, TipQuery
from api.schemas.toolings import ToolingKeys
from api.security import Guarded, WhoAsks, new_id, now
from api.stores.jobs import Job
from api.work import tasks
from api.work.requests import MachineText, ToolingSource, TooLong

router = APIRouter(tags=["tool change"], route_class=Guarded)
CSV, LOBES = "text/csv", "lobes"
_PREFERENCES = (
    "`respond-async`: as a job in any case. `while-watched`: a job that is cancelled when for some time nobody has asked for it or opened "
    "its events."
)
Later = Annotated[str | None, Header(alias="Prefer", max_length=200, description=_PREFERENCES)]


@router.post(
    "/tooltip",
    summary="Tooltip FRF of a tooling, with bands; Accept: text/csv for FRF.csv",
    openapi_extra=guard("run"),
    response_model=TipAnswer,
    responses={200: {"description": "Receptances.", "content": {CSV: {"schema": {"type": "string"}}}}, **problems(404, *BODY)},
)
async def tooltip(body: TipQuery, request: Request, parts: ThisService, caller: WhoAsks) -> Any:
    machine, _, (tooling,) = await _subject(parts, caller.group, body, [] if body.tooling is None else [body.tooling])
    csv = CSV in request.headers.get("accept", "")
    found = parts.work.run(tasks.tooltip, machine, tooling, body.request(parts.settings.work_seconds), csv)
    answer = await while_there(request, found)
    return Response(answer, media_type=CSV) if csv else TipAnswer.model_validate(answer)


@router.post(
    "/lobes",
    summary="Stability lobes of one tooling or several; what takes long becomes a job",
    description="At once where that is quick, as always with zero-order; else, or with `Prefer: respond-async`, 202 and a job.",
    openapi_extra=guard("run"),
    response_model=LobeAnswer,
    responses={202: jobs.ACCEPTED, **problems(404, 409, *BODY)},
)
async def lobes(body: LobeQuery, request: Request, parts: ThisService, caller: WhoAsks, prefer: Later = None, repeat: Repeat = None) -> Any:
    question = body.request(parts.settings.work_seconds)
    machine, called, toolings = await _subject(parts, caller.group, body, body.toolings)
    most = parts.settings.job_work_seconds
    wanted = re.split(r"[\s,;]+", (prefer or "").lower())
    if "respond-async" not in wanted:
        try:
            found = await while_there(request, _each(parts, tasks.lobes, machine, toolings, question))
            return LobeAnswer.model_validate({"machine": called, "toolings": found})
        except TooLong as error:
            if error.seconds * len(toolings) > most:
                raise
    text = asked(machine, toolings, body.request(most))
    words = body.model_dump_json()
    watched = now() if "while-watched" in wanted else None
    job = Job(
        new_id(), caller.group, LOBES, body.machine or "", None, words, "queued", now(), key=caller.id, who=caller.name, watched=watched
    )
    digest = hashlib.sha256(words.encode()).hexdigest()
    again = None if repeat is None else (repeat, digest)
    kept = await run_in_threadpool(jobs.submit, parts, job, {"question": text}, again)
    return await run_in_threadpool(jobs.accepted, parts, kept)


@router.get(
    "/lobes/{id}",
    summary="Lobes that were computed as a job",
    openapi_extra=guard("read"),
    responses={200: {"description": "The job, with its answer once it is done.", "headers": jobs.RETRY}, **problems(404, 422)},
)
async def lobe_job(id: jobs.JobId, parts: ThisService, caller: WhoAsks, response: Response, prefer: jobs.Prefer = None) -> LobeJob:
    job, text = await jobs.answered(parts, caller.group, id, LOBES, prefer, response)
    return LobeJob(job=job, answer=None if text is None else LobeAnswer.model_validate_json(text))


@router.get(
    "/lobes/{id}/events",
    summary="What lobes as a job tell on their way",
    openapi_extra=guard("read"),
    response_class=StreamingResponse,
    responses={200: jobs.STREAM, **problems(404, 422)},
)
async def lobe_events(id: jobs.JobId, parts: ThisService, caller: WhoAsks, seen: jobs.Seen = None) -> StreamingResponse:
    return await jobs.events(parts, caller, id, LOBES, seen)


@router.delete(
    "/lobes/{id}",
    status_code=202,
    summary="Cancel lobes as a job",
    openapi_extra=guard("run"),
    responses=problems(404, 409, 422),
)
def cancel_lobes(id: jobs.JobId, parts: ThisService, caller: WhoAsks, response: Response) -> JobAnswer:
    return jobs.cancel(parts, caller.group, id, LOBES, response)


@router.post(
    "/advice",
    summary="Highest removal rate, speeds for a depth, margin of planned cuts",
    openapi_extra=guard("run"),
    responses=problems(404, *BODY),
)
async def advice(body: AdviceQuery, request: Request, parts: ThisService, caller: WhoAsks) -> AdviceAnswer:
    question = body.advice(parts.settings.work_seconds)
    machine, called, toolings = await _subject(parts, caller.group, body, body.toolings)
    found = await while_there(request, _each(parts, tasks.advice, machine, toolings, question))
    return AdviceAnswer.model_validate({"machine": called, "toolings": found})


async def _each(parts: Components, call: Any, machine: MachineText, toolings: list[ToolingSource], question: Any) -> list[Any]:
    """Ask for every tooling, on as many workers as are free; the first failure is the answer."""
    found = await asyncio.gather(*(parts.answers.of(call, machine, tooling, question) for tooling in toolings), return_exceptions=True)
    for answer in found:
        if isinstance(answer, BaseException):
            raise answer
    return found


async def _subject(
    parts: Components, group: str, body: TipQuery | LobeQuery | AdviceQuery, toolings: list[str | ToolingKeys]
) -> tuple[MachineText, str, list[ToolingSource]]:
    """Return the machine, the robot or the tip, what it is called, and the toolings, each from the library or as it came."""

    def look() -> tuple[MachineText, str, list[ToolingSource]]:
        field = "tooling" if isinstance(body, TipQuery) else "toolings"
        return *tip_source(parts, group, body.machine, body.robot, body.tip), asked_toolings(parts, group, toolings, body.tip, field)

    return await run_in_threadpool(look)
