"""Identifications as jobs: from a campaign's recordings to modes, lines and a report."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from fastapi.responses import StreamingResponse

from api.components import ThisService
from api.conventions import BODY, After, Limit, Repeat, guard, page, problems
from api.live import jobs
from api.live.jobs import ACCEPTED, RETRY, STREAM, JobId, Prefer, Seen
from api.lookups import known_campaign, robot_text
from api.schemas.common import ID_PATTERN, Page
from api.schemas.jobs import FittedLines, JobAnswer, JobState, NewIdentification
from api.schemas.machines import Identification, IdentifiedRobot, Modes
from api.security import Guarded, WhoAsks, new_id, now
from api.stores.jobs import Job
from api.work import tasks
from api.work.machine_cache import starts
from rcsa_ident.base.errors import InputError

router = APIRouter(prefix="/identifications", tags=["identifications"], route_class=Guarded)
KIND = "identification"
#: A report opened as a page of its own runs and loads nothing.
_ALONE = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:"}
_Of = Annotated[str | None, Query(pattern=ID_PATTERN)]


@router.post(
    "",
    status_code=202,
    summary="Identify a machine, or a robot, from a campaign",
    description="The identification is a job; it uses the recordings that have been uploaded when it starts.",
    openapi_extra=guard("run"),
    response_model=JobAnswer,
    responses={202: ACCEPTED, **problems(404, 409, *BODY)},
)
def identify(body: NewIdentification, components: ThisService, caller: WhoAsks, repeat: Repeat = None) -> Any:
    campaign = known_campaign(components, caller.group, body.campaign)
    counts = components.store.campaigns.counts(caller.group, [campaign.id]).get(campaign.id)
    if counts is None or counts.uploaded + counts.hammer == 0:
        raise InputError("campaign", f"no recording of its {campaign.cuts} cuts", "a campaign with recordings")
    if counts.hammer and body.method == "paper":
        raise InputError("method", "paper with hammer tests", "the default method, which takes them")
    texts = {}
    if body.robot is not None:
        if body.method != "default" or body.start:
            raise InputError("robot", "one with another method or a start", "the default method alone, which begins at the data sheet")
        if counts.hammer:
            raise InputError("robot", "one with hammer tests", "a campaign of cuts alone")
        texts["robot"] = robot_text(components, caller.group, body.robot)
    if body.start:
        if body.method == "paper":
            raise InputError("start", "true with the method paper", "the default method, which has a posterior")
        known = components.store.identifications.get(caller.group, campaign.machine)
        if known is None:
            raise InputError("start", "true for a machine without an identification", "a machine that has one")
        starts(known.text)
        texts["start"] = known.text
    request = body.model_dump_json()
    job = Job(new_id(), caller.group, KIND, campaign.machine, campaign.id, request, "queued", now(), key=caller.id, who=caller.name)
    digest = hashlib.sha256(request.encode()).hexdigest()
    return jobs.accepted(components, jobs.submit(components, job, texts, None if repeat is None else (repeat, digest)))


@router.get("", summary="List identifications, newest first", openapi_extra=guard("read"), responses=problems(422))
def list_jobs(
    components: ThisService,
    caller: WhoAsks,
    machine: _Of = None,
    campaign: _Of = None,
    state: JobState | None = None,
    after: After = "",
    limit: Limit = 50,
) -> Page[JobAnswer]:
    wanted = {"kind": KIND, "machine": machine, "campaign": campaign, "state": state}
    given = {name: str(value) for name, value in wanted.items() if value is not None}
    rows, following = page(components.store.jobs.list(caller.group, given, after, limit + 1), limit, lambda job: job.id)
    return Page(items=jobs.answers(components, rows), next=following)


@router.get(
    "/{id}",
    summary="State of an identification",
    openapi_extra=guard("read"),
    responses={200: {"description": "The job.", "headers": RETRY}, **problems(404, 422)},
)
async def get(id: JobId, components: ThisService, caller: WhoAsks, response: Response, prefer: Prefer = None) -> JobAnswer:
    return await jobs.state_of(components, caller.group, id, KIND, prefer, response)


@router.delete("/{id}", status_code=202, summary="Cancel an identification", openapi_extra=guard("run"), responses=problems(404, 409, 422))
def cancel(id: JobId, components: ThisService, caller: WhoAsks, response: Response) -> JobAnswer:
    return jobs.cancel(components, caller.group, id, KIND, response)


@router.get(
    "/{id}/events",
    summary="Events of an identification",
    openapi_extra=guard("read"),
    response_class=StreamingResponse,
    responses={200: STREAM, **problems(404, 422)},
)
async def events(id: JobId, components: ThisService, caller: WhoAsks, seen: Seen = None) -> StreamingResponse:
    return await jobs.events(components, caller, id, KIND, seen)


@router.get("/{id}/modes", summary="Modes with their uncertainties", openapi_extra=guard("read"), responses=problems(404, 409, 422))
def modes(id: JobId, components: ThisService, caller: WhoAsks) -> Modes:
    return Modes.model_validate(tasks.modes(jobs.finished(components, caller.group, id, KIND, "result")))


@router.get(
    "/{id}/frf",
    summary="Measured lines of the cross FRF, and those of the model",
    openapi_extra=guard("read"),
    responses=problems(404, 409, 422),
)
def frf(id: JobId, components: ThisService, caller: WhoAsks) -> FittedLines:
    return FittedLines.model_validate_json(jobs.finished(components, caller.group, id, KIND, "frf"))


@router.get(
    "/{id}/result",
    summary="RESULT.json",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={
        200: {"model": Identification | IdentifiedRobot, "description": "For use with the commands, too."},
        **problems(404, 409, 422),
    },
)
def result(id: JobId, components: ThisService, caller: WhoAsks) -> Response:
    return Response(jobs.finished(components, caller.group, id, KIND, "result").encode(), media_type="application/json")


@router.get(
    "/{id}/report",
    summary="Report as HTML without scripts",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={200: {"content": {"text/html": {"schema": {"type": "string"}}}, "description": "A page."}, **problems(404, 409, 422)},
)
def report(id: JobId, components: ThisService, caller: WhoAsks) -> Response:
    return Response(jobs.finished(components, caller.group, id, KIND, "report").encode(), media_type="text/html", headers=_ALONE)
