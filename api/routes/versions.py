"""Versions of toolings, robots and identifications, what they differ in, their restoration, and the audit trail of all changes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from api.components import Components, ThisService
from api.conventions import BODY, Limit, MachineId, ToolingName, Why, expected, found_or_404, guard, page, problems, tagged
from api.kept_documents import JSON, TOML
from api.lookups import machine_of
from api.problems import Problem
from api.routes import robots
from api.routes.machines import CSV, summary_of
from api.routes.toolings import TOOLING_BODY, answer_of, tooling_text
from api.schemas.common import NAME_PATTERN, Page
from api.schemas.machines import Identification, IdentificationSummary
from api.schemas.robots import RobotAnswer, RobotKeys
from api.schemas.toolings import ToolingAnswer, ToolingKeys
from api.schemas.versions import ChangeAnswer, Difference, Differences, Kind, RobotVersion, ToolingVersion
from api.security import Caller, Guarded, WhoAsks, now
from api.stores.changes import IDENTIFICATION, ROBOT, TOOLING, Change
from api.stores.entities import Document, Documents, Stale, digest_of
from api.stores.entities import summary_of as stored_summary
from api.work.machine_cache import is_result
from api.work.robots import parsed as robot_keys
from api.work.toolings import differences, parsed, summary

router = APIRouter(tags=["versions"], route_class=Guarded)
Version = Annotated[int, Path(ge=1, le=2_000_000_000, description="`version` of an entry of the trail.")]
_MACHINE, _TOOLING = "/machines/{id}/identification/versions/{version}", "/toolings/{name}/versions/{version}"
_ROBOT = "/robots/{name}/versions/{version}"


@router.get(
    "/changes",
    summary="The audit trail: who wrote which tooling, robot, machine or identification, when and why, newest first",
    openapi_extra=guard("read"),
    responses=problems(422),
)
def changes(
    components: ThisService,
    caller: WhoAsks,
    kind: Kind | None = None,
    name: Annotated[str | None, Query(pattern=NAME_PATTERN, description="Of a tooling or a robot, or id of a machine.")] = None,
    after: Annotated[str, Query(pattern=r"^[0-9]{0,18}$", description="`next` of the previous page.")] = "",
    limit: Limit = 50,
) -> Page[ChangeAnswer]:
    found = components.store.changes.list(caller.group, int(after) if after else None, limit + 1, kind, name)
    rows, following = page(found, limit, lambda row: str(row.id))
    return Page(items=[_answer(row) for row in rows], next=following)


@router.post(
    "/toolings/{name}/differences",
    summary="Where a tooling differs from that of the library, before it is written",
    openapi_extra=guard("read", requestBody=TOOLING_BODY, **{"x-content-types": (JSON, TOML)}),
    responses=problems(404, *BODY),
)
async def compare(name: ToolingName, request: Request, components: ThisService, caller: WhoAsks) -> Differences:
    raw = await request.body()

    def compared() -> Differences:
        text = tooling_text(request, raw)
        summary(text)
        there = found_or_404(components.store.toolings.get(caller.group, name), "tooling")
        return Differences(etag=there.digest, differences=_differences(parsed(there.text), parsed(text)))

    return await run_in_threadpool(compared)


@router.get(_TOOLING, summary="A version of a tooling", openapi_extra=guard("read"), responses=problems(404, 422))
def tooling_version(name: ToolingName, version: Version, components: ThisService, caller: WhoAsks) -> ToolingVersion:
    found = _version(components, caller, TOOLING, name, version)
    there, keys = components.store.toolings.get(caller.group, name), parsed(found.text)
    compared = [] if there is None else _differences(parsed(there.text), keys)
    return ToolingVersion(change=_answer(found), tooling=ToolingKeys.model_validate(keys), differences=compared)


@router.post(
    f"{_TOOLING}/restore",
    summary="Write a version of a tooling again, also one that was deleted",
    description="If-Match or If-None-Match: * protect against overwriting concurrent changes. What it replaces stays as a version; "
    "409 where the version is what is there now.",
    openapi_extra=guard("upload"),
    responses={201: {"model": ToolingAnswer, "description": "It was deleted before."}, **problems(404, 409, 412, 413, 422, 500)},
)
def restore_tooling(
    name: ToolingName, version: Version, request: Request, response: Response, components: ThisService, caller: WhoAsks, why: Why = ""
) -> ToolingAnswer:
    found = _version(components, caller, TOOLING, name, version)
    document = Document(caller.group, name, found.text, json.dumps(summary(found.text)), digest_of(found.text), now())
    _restore(components.store.toolings, document, found, request, response, caller, why)
    return answer_of(document)


@router.get(_ROBOT, summary="A version of a robot", openapi_extra=guard("read"), responses=problems(404, 422))
def robot_version(name: robots.RobotName, version: Version, components: ThisService, caller: WhoAsks) -> RobotVersion:
    found = _version(components, caller, ROBOT, name, version)
    there, keys = components.store.robots.get(caller.group, name), robot_keys(found.text)
    compared = [] if there is None else _differences(robot_keys(there.text), keys)
    return RobotVersion(change=_answer(found), robot=RobotKeys.model_validate(keys), differences=compared)


@router.post(
    f"{_ROBOT}/restore",
    summary="Write a version of a robot again, also one that was deleted",
    description="If-Match or If-None-Match: * protect against overwriting concurrent changes. What it replaces stays as a version; "
    "409 where the version is what is there now.",
    openapi_extra=guard("upload"),
    responses={201: {"model": RobotAnswer, "description": "It was deleted before."}, **problems(404, 409, 412, 413, 422, 500)},
)
def restore_robot(
    name: robots.RobotName, version: Version, request: Request, response: Response, components: ThisService, caller: WhoAsks, why: Why = ""
) -> RobotAnswer:
    found = _version(components, caller, ROBOT, name, version)
    document = Document(caller.group, name, found.text, found.summary, found.digest, now(), found.summary_digest)
    # a damaged one is not written again
    stored_summary(document)
    _restore(components.store.robots, document, found, request, response, caller, why)
    return robots.answer_of(document)


@router.get(
    _MACHINE,
    summary="A version of a machine's identification: RESULT.json or FLANGE.csv, as written",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={
        200: {"model": Identification, "description": "For use with the commands, too.", "content": {CSV: {"schema": {"type": "string"}}}},
        **problems(404, 422),
    },
)
def identification_version(id: MachineId, version: Version, components: ThisService, caller: WhoAsks) -> Response:
    machine_of(components, caller.group, id)
    found = _version(components, caller, IDENTIFICATION, id, version)
    return Response(found.text.encode(), media_type=JSON if is_result(found.text) else CSV, headers=tagged(found.digest))


@router.post(
    f"{_MACHINE}/restore",
    summary="Write a version of a machine's identification again",
    description="If-Match or If-None-Match: * protect against overwriting concurrent changes. What it replaces stays as a version; "
    "409 where the version is what is there now.",
    openapi_extra=guard("upload"),
    responses={
        201: {"model": IdentificationSummary, "description": "The machine had none before."},
        **problems(404, 409, 412, 413, 422, 500),
    },
)
def restore_identification(
    id: MachineId, version: Version, request: Request, response: Response, components: ThisService, caller: WhoAsks, why: Why = ""
) -> IdentificationSummary:
    machine_of(components, caller.group, id)
    found = _version(components, caller, IDENTIFICATION, id, version)
    document = Document(caller.group, id, found.text, found.summary, found.digest, now(), found.summary_digest)
    # a damaged one is not written again
    told = summary_of(document)
    _restore(components.store.identifications, document, found, request, response, caller, why)
    return told


def _version(components: Components, caller: Caller, kind: str, name: str, version: int) -> Change:
    """A version with a content; what a deletion has written down has none."""
    found = components.store.changes.get(caller.group, kind, name, version)
    return found_or_404(found if found is not None and found.text else None, "version with a content")


def _restore(kept: Documents, document: Document, version: Change, request: Request, response: Response, caller: Caller, why: str) -> None:
    seen = expected(request, lambda: getattr(kept.brief(document.group, document.name), "digest", None))
    if version.holds and seen in (None, document.digest):
        raise Problem(409, f"there is nothing to restore: version {version.version} is what is there now")
    try:
        response.status_code = 201 if kept.put(document, seen, caller.note(why, version.version)) else 200
    except Stale:
        raise Problem(412, "what would be replaced is not what the query expects") from None
    response.headers.update(tagged(document.digest))


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Difference]:
    return [Difference(field=field, old=before, new=after) for field, before, after in differences(old, new)]


def _answer(change: Change) -> ChangeAnswer:
    same = ("id", "kind", "name", "title", "version", "action", "created", "key", "who", "why", "holds")
    columns = {name: getattr(change, name) for name in same}
    return ChangeAnswer.model_validate(columns | {"restores": change.restores or None, "etag": change.digest or None})
