"""A tool along a path through stock: what it takes out, how far each move is from chatter, what happens turn by turn."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse

from api.components import Components, ThisService
from api.conventions import BODY, Repeat, guard, problems, utf8, while_there
from api.jobs.paths import asked
from api.live import jobs
from api.lookups import tip_source, tooling_source
from api.problems import Problem
from api.reading.uploads import Received
from api.schemas.common import body_of
from api.schemas.jobs import JobAnswer
from api.schemas.paths import PathCutAnswer, PathJob, PathMillingQuery, PathStabilityQuery, PathTold, RemovalQuery
from api.security import Caller, Guarded, WhoAsks, new_id, now
from api.stores.jobs import Job
from api.transfer.body_stream import announced_length, check_room, refuse_encoded, storage_problems
from api.transfer.multipart import FORM, form
from api.work import paths as work
from api.work.requests import MachineText, ToolingSource
from rcsa_ident.base.errors import InputError

router = APIRouter(prefix="/paths", tags=["paths"], route_class=Guarded)
CSV, GCODE, KIND = "text/csv", "text/x-gcode", "path"
_SUFFIX = {CSV: "PATH.csv", GCODE: "PATH.nc"}
_FILE = {"type": "string", "format": "binary"}
_TEXT = {"required": True, "content": {kind: {"schema": {"type": "string"}} for kind in _SUFFIX}}
_FILES = (
    "A form: `query`, the file `path`, G-code (.nc) or a table (.csv), and where the query has no block the file `stock`, a closed surface "
    "(.stl, in mm). 202 and a job, whose answer is under `/v1/paths/{id}`."
)


def _form(query: str) -> dict[str, Any]:
    properties = {"query": {"$ref": f"#/components/schemas/{query}"}, "path": _FILE, "stock": _FILE}
    schema = {"type": "object", "required": ["query", "path"], "properties": properties, "additionalProperties": False}
    return {"required": True, "content": {FORM: {"schema": schema, "encoding": {"query": {"contentType": "application/json"}}}}}


def _job_of(query: str) -> dict[str, Any]:
    return guard("run", requestBody=_form(query), **{"x-content-types": (FORM,)})


_ACCEPTED: dict[int | str, dict[str, Any]] = {202: jobs.ACCEPTED, **problems(404, 409, *BODY)}


@router.post(
    "/preview",
    summary="What a path is: its line, length and time, and what its moves lack; nothing is stored",
    openapi_extra=guard("read", requestBody=_TEXT, **{"x-content-types": (CSV, GCODE)}),
    responses=problems(*BODY),
)
async def preview(request: Request, parts: ThisService) -> PathTold:
    raw = await request.body()
    if len(raw) > work.LARGEST_PATH:
        raise Problem(413, f"a path has at most {work.LARGEST_PATH // 1000} kB")
    file = _SUFFIX[request.headers["content-type"].split(";")[0].strip().lower()]
    return PathTold.model_validate(await while_there(request, parts.work.run(work.preview, file, utf8(raw))))


def _begins(model: type[RemovalQuery]) -> Callable[..., Awaitable[Any]]:
    async def begin(request: Request, parts: ThisService, caller: WhoAsks, repeat: Repeat = None) -> Any:
        return await _begin(request, parts, caller, model, repeat)

    return begin


for _name, _model, _summary in (
    ("removal", RemovalQuery, "What a tooling takes out of its stock along a path, as a job"),
    (
        "stability",
        PathStabilityQuery,
        "How far every move of a path is from chatter, its force, and where it leaves the wall, as a job",
    ),
    ("milling", PathMillingQuery, "Milling along a path in time, turn by turn, and the walls that are left, as a job"),
):
    router.post(
        f"/{_name}",
        status_code=202,
        summary=_summary,
        description=_FILES,
        openapi_extra=_job_of(_model.__name__),
        response_model=JobAnswer,
        responses=_ACCEPTED,
    )(_begins(_model))


@router.get(
    "/{id}",
    summary="A tool along a path, as a job: its state, and its answer once it is done",
    openapi_extra=guard("read"),
    responses={200: {"description": "The job.", "headers": jobs.RETRY}, **problems(404, 422)},
)
async def get(id: jobs.JobId, parts: ThisService, caller: WhoAsks, response: Response, prefer: jobs.Prefer = None) -> PathJob:
    job, text = await jobs.answered(parts, caller.group, id, KIND, prefer, response)
    return PathJob(job=job, answer=None if text is None else PathCutAnswer.model_validate_json(text))


@router.get(
    "/{id}/table",
    summary="The whole table, as the command writes it: ENGAGEMENT.csv, STABILITY.csv or FORCES.csv",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={200: {"content": {CSV: {"schema": {"type": "string"}}}, "description": "A table."}, **problems(404, 409, 422)},
)
def table(id: jobs.JobId, parts: ThisService, caller: WhoAsks) -> Response:
    return Response(jobs.finished(parts, caller.group, id, KIND, "table").encode(), media_type=CSV)


@router.get(
    "/{id}/events",
    summary="What such a job tells on its way",
    openapi_extra=guard("read"),
    response_class=StreamingResponse,
    responses={200: jobs.STREAM, **problems(404, 422)},
)
async def events(id: jobs.JobId, parts: ThisService, caller: WhoAsks, seen: jobs.Seen = None) -> StreamingResponse:
    return await jobs.events(parts, caller, id, KIND, seen)


@router.delete("/{id}", status_code=202, summary="Cancel such a job", openapi_extra=guard("run"), responses=problems(404, 409, 422))
def cancel(id: jobs.JobId, parts: ThisService, caller: WhoAsks, response: Response) -> JobAnswer:
    return jobs.cancel(parts, caller.group, id, KIND, response)


async def _begin(request: Request, parts: Components, caller: Caller, model: type[RemovalQuery], repeat: str | None) -> Any:
    """Read the form, weigh the work, and have a job do it."""
    refuse_encoded(request)
    with parts.uploads.admitted(caller.group):
        await check_room(parts, caller.group, announced_length(request))
        async with form(request, parts, caller.group, ("query",), ("path", "stock")) as (texts, files):
            for name in ("query", "path"):
                if name not in texts and name not in files:
                    fault = {"field": name, "found": "nothing", "allowed": "a part of this name"}
                    raise Problem(422, f"the form has no part named {name}", [fault])
            body = body_of(model, texts["query"])
            with storage_problems():
                file, text = await run_in_threadpool(_path, files)
                surface = await run_in_threadpool(_surface, files)
    question = body.request(file, text, surface)

    def look() -> tuple[MachineText | None, str, ToolingSource]:
        machine, called = None, ""
        if isinstance(body, PathStabilityQuery | PathMillingQuery):
            machine, called = tip_source(parts, caller.group, body.machine, body.robot)
        return machine, called, tooling_source(parts, caller.group, body.tooling)

    machine, called, tooling = await run_in_threadpool(look)
    await while_there(request, parts.work.run(work.weighed, machine, tooling, question))
    words = body.model_dump_json()
    given = getattr(body, "machine", None) or ""
    job = Job(new_id(), caller.group, KIND, given, None, words, "queued", now(), key=caller.id, who=caller.name)
    digest = hashlib.sha256("\n".join((question.kind, words, file, text, surface)).encode()).hexdigest()
    again = None if repeat is None else (repeat, digest)
    kept = await run_in_threadpool(jobs.submit, parts, job, {"question": asked(machine, called, tooling, question)}, again)
    return await run_in_threadpool(jobs.accepted, parts, kept)


def _path(files: Mapping[str, tuple[str, Received]]) -> tuple[str, str]:
    name, received = files["path"]
    if received.size > work.LARGEST_PATH:
        raise Problem(413, f"a path has at most {work.LARGEST_PATH // 1000} kB")
    return name, utf8(received.path.read_bytes())


def _surface(files: Mapping[str, tuple[str, Received]]) -> str:
    """The stock's file in base64; empty where there is none."""
    if "stock" not in files:
        return ""
    name, received = files["stock"]
    if not name.lower().endswith(".stl"):
        raise InputError("stock", name[-80:] or "nothing", "a file that ends in .stl")
    if received.size > work.LARGEST_STOCK:
        raise Problem(413, f"a stock's file has at most {work.LARGEST_STOCK // 1000} kB")
    return base64.b64encode(received.path.read_bytes()).decode("ascii")
