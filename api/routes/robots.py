"""Robots: their files, or the keys of these as JSON; what they are at a posture and along a path."""

from __future__ import annotations

import json
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Path, Request, Response
from fastapi.concurrency import run_in_threadpool

from api import kept_documents
from api.components import ThisService
from api.conventions import BODY, After, Limit, Why, guard, page, problems, utf8, while_there
from api.kept_documents import JSON, TOML, text_of_body
from api.lookups import posed_robot, tooling_source
from api.problems import Problem
from api.schemas.common import NAME_PATTERN, Page
from api.schemas.robot_queries import MapAnswer, MapQuery, PathAnswer, PathPreview, PathQuery, PostureAnswer, PostureQuery
from api.schemas.robots import EXAMPLE, RobotAnswer, RobotKeys, RobotSummary
from api.security import Guarded, WhoAsks, now
from api.stores.entities import Document, digest_of, summary_of
from api.work import robots as work
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.paths.tool_paths import tool_path_of
from rcsa_ident.io.toml_text import toml_of

router = APIRouter(prefix="/robots", tags=["robots"], route_class=Guarded)
RobotName = Annotated[str, Path(pattern=NAME_PATTERN, description="Name of a robot that is kept.")]
CSV = "text/csv"
_LARGEST_PATH = 1_000_000
_ROBOT = {
    "required": True,
    "content": {
        JSON: {"schema": {"$ref": "#/components/schemas/RobotKeys"}, "example": EXAMPLE},
        TOML: {"schema": {"type": "string"}, "example": toml_of(EXAMPLE)},
    },
}
_PATH = {"required": True, "content": {CSV: {"schema": {"type": "string"}}}}


@router.put(
    "/{name}",
    summary="Write a robot: ROBOT.toml, or its keys",
    description="If-Match or If-None-Match: * keep what somebody else has written meanwhile. What is replaced stays as a version.",
    openapi_extra=guard("upload", requestBody=_ROBOT, **{"x-content-types": (JSON, TOML)}),
    responses={201: {"model": RobotAnswer, "description": "There was none before."}, **problems(412, *BODY)},
)
async def write(name: RobotName, request: Request, response: Response, parts: ThisService, caller: WhoAsks, why: Why = "") -> RobotAnswer:
    raw = await request.body()
    text = await run_in_threadpool(text_of_body, request, raw, RobotKeys, work.LARGEST, "robot")
    # modes of what strangers write are looked for in another process
    summary = await while_there(request, parts.work.run(work.summary, text))
    document = Document(caller.group, name, text, json.dumps(summary), digest_of(text), now())
    await run_in_threadpool(kept_documents.keep, parts.store.robots, document, request, response, caller.note(why), "robot")
    return answer_of(document)


@router.get("", summary="List robots", openapi_extra=guard("read"), responses=problems(422))
def list_robots(parts: ThisService, caller: WhoAsks, after: After = "", limit: Limit = 50) -> Page[RobotSummary]:
    rows, following = page(parts.store.robots.list(caller.group, after, limit + 1), limit, lambda row: row.name)
    items = [RobotSummary(name=row.name, changed=row.changed, etag=row.digest, **summary_of(row)) for row in rows]
    return Page(items=items, next=following)


@router.get(
    "/{name}",
    summary="A robot, as JSON or as ROBOT.toml (Accept: application/toml)",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={
        200: {"model": RobotAnswer, "description": "A robot.", "content": {TOML: {"schema": {"type": "string"}}}},
        304: {"description": "If-None-Match names it."},
        **problems(404, 422),
    },
)
def get(name: RobotName, request: Request, parts: ThisService, caller: WhoAsks) -> Response:
    return kept_documents.show(parts.store.robots, caller.group, name, request, "robot", answer_of)


@router.delete("/{name}", status_code=204, summary="Forget a robot", openapi_extra=guard("upload"), responses=problems(404, 412, 422))
def forget(name: RobotName, request: Request, parts: ThisService, caller: WhoAsks, why: Why = "") -> Response:
    return kept_documents.forget(parts.store.robots, caller.group, name, request, caller.note(why), "robot")


@router.post(
    "/posture",
    summary="An arm at a posture: tool point, natural frequencies, compliance, other postures, and what a picture is drawn from",
    openapi_extra=guard("run"),
    responses=problems(404, *BODY),
)
async def posture(body: PostureQuery, request: Request, parts: ThisService, caller: WhoAsks) -> PostureAnswer:
    def look() -> tuple[Any, Any]:
        robot = posed_robot(parts, caller.group, body.robot)
        return robot, None if body.tooling is None else tooling_source(parts, caller.group, body.tooling)

    robot, tooling = await run_in_threadpool(look)
    found = await while_there(request, parts.work.run(work.posture, robot.text, tooling, body.drawing))
    return PostureAnswer.model_validate(found)


@router.post(
    "/path",
    summary="Postures that bring a tool's tip along a path: of all that reach a place the one that turns the joints least",
    openapi_extra=guard("run"),
    responses=problems(404, *BODY),
)
async def along(body: PathQuery, request: Request, parts: ThisService, caller: WhoAsks) -> PathAnswer:
    robot, tooling = await _subject(parts, caller.group, body)
    return PathAnswer.model_validate(await while_there(request, parts.work.run(work.along, robot.text, tooling, body.places)))


@router.post(
    "/map",
    summary="Stability limits at every place of a path and every speed",
    openapi_extra=guard("run"),
    responses=problems(404, *BODY),
)
async def limit_map(body: MapQuery, request: Request, parts: ThisService, caller: WhoAsks) -> MapAnswer:
    question = body.request(parts.settings.work_seconds)
    robot, tooling = await _subject(parts, caller.group, body)
    found = await while_there(request, parts.work.run(work.limit_map, robot.text, tooling, body.places, question))
    return MapAnswer.model_validate(found)


@router.post(
    "/path/preview",
    summary="The places of PATH.csv, as the commands read it; nothing is stored",
    openapi_extra=guard("read", requestBody=_PATH, **{"x-content-types": (CSV,)}),
    responses=problems(*BODY),
)
async def preview(request: Request) -> PathPreview:
    raw = await request.body()
    if len(raw) > _LARGEST_PATH:
        raise Problem(413, f"a path has at most {_LARGEST_PATH // 1000} kB")

    def read() -> PathPreview:
        try:
            found = tool_path_of(utf8(raw), "")
        except InputError as error:
            # a body has no file's name, but lines
            raise InputError(", ".join(filter(None, (error.where.strip(), error.field))), error.found, error.allowed) from None
        if len(found) > work.MOST_PLACES:
            raise InputError("places", f"{len(found)} of them", f"at most {work.MOST_PLACES}")
        return PathPreview(places=np.hstack([(1e3 * found.places).round(9), found.axes]).tolist())

    return await run_in_threadpool(read)


async def _subject(parts: ThisService, group: str, body: PathQuery) -> tuple[Any, Any]:
    """The robot and the tooling, each as it is kept or as it came."""

    def look() -> tuple[Any, Any]:
        return posed_robot(parts, group, body.robot), tooling_source(parts, group, body.tooling)

    return await run_in_threadpool(look)


def answer_of(document: Document) -> RobotAnswer:
    """Return a robot as clients see it."""
    keys = RobotKeys.model_validate(work.parsed(document.text))
    return RobotAnswer(name=document.name, robot=keys, changed=document.changed, etag=document.digest)
