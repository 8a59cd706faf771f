"""Machines and their identifications."""

from __future__ import annotations

import hashlib
import json
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from api.components import Components, ThisService
from api.conventions import (
    BODY,
    After,
    Limit,
    MachineId,
    Repeat,
    Why,
    expected,
    found_or_404,
    guard,
    in_use,
    page,
    problems,
    tagged,
    unchanged,
    utf8,
    while_there,
)
from api.lookups import identification_of, known_machine, machine_of
from api.problems import Problem
from api.reading.example_campaign import example_id
from api.schemas.common import Page
from api.schemas.machines import Frf, Identification, IdentificationSummary, MachineAnswer, MachineContents, Modes, NewMachine
from api.security import Guarded, WhoAsks, new_id, now
from api.stores.entities import Document, Machine, Stale, Taken, digest_of
from api.stores.entities import summary_of as stored_summary
from api.work import tasks
from api.work.machine_cache import is_result

router = APIRouter(prefix="/machines", tags=["machines"], route_class=Guarded)
JSON, CSV = "application/json", "text/csv"
_RESULT = {
    "content": {JSON: {"schema": {"$ref": "#/components/schemas/Identification"}}, CSV: {"schema": {"type": "string"}}},
    "required": True,
}


@router.post("", status_code=201, summary="Make a machine", openapi_extra=guard("upload"), responses=problems(409, *BODY))
def make(
    body: NewMachine, components: ThisService, caller: WhoAsks, response: Response, repeat: Repeat = None, why: Why = ""
) -> MachineAnswer:
    machine = Machine(new_id(), caller.group, body.name, body.description, now())
    digest = hashlib.sha256(body.model_dump_json().encode()).hexdigest()
    try:
        kept = components.store.machines.add(machine, None if repeat is None else (repeat, digest), caller.note(why))
    except Taken as taken:
        raise in_use(taken, body.name, repeat) from None
    response.headers["Location"] = f"/v1/machines/{kept.id}"
    return _answer(components, kept)


@router.get("", summary="List machines", openapi_extra=guard("read"), responses=problems(422))
def list_machines(components: ThisService, caller: WhoAsks, after: After = "", limit: Limit = 50) -> Page[MachineAnswer]:
    rows, following = page(components.store.machines.list(caller.group, after, limit + 1), limit, lambda machine: machine.id)
    return Page(items=[_answer(components, machine) for machine in rows], next=following)


@router.get("/{id}", summary="A machine", openapi_extra=guard("read"), responses=problems(404, 422))
def get(id: MachineId, components: ThisService, caller: WhoAsks) -> MachineAnswer:
    return _answer(components, machine_of(components, caller.group, id))


@router.get(
    "/{id}/contents",
    summary="What is deleted with a machine: its identification, campaigns and recordings by name, toolings of an example",
    openapi_extra=guard("read"),
    responses=problems(404, 422),
)
async def contents(id: MachineId, response: Response, components: ThisService, caller: WhoAsks) -> MachineContents:
    there = found_or_404(await contents_of(components, caller.group, id), "machine")
    response.headers.update(tagged(there.etag))
    return there


@router.delete(
    "/{id}",
    status_code=204,
    summary="Delete a machine, its identification and its campaigns",
    description="With the entity tag of its contents in If-Match nothing goes that was not among them.",
    openapi_extra=guard("upload"),
    responses=problems(404, 412, 422),
)
async def forget(id: MachineId, request: Request, components: ThisService, caller: WhoAsks, why: Why = "") -> Response:
    if "if-match" in request.headers and (there := await contents_of(components, caller.group, id)) is not None:
        unseen(request, there)
    if not await run_in_threadpool(components.uploads.forget_machine, caller.group, id, caller.note(why)):
        raise Problem(404, "there is no such machine")
    return Response(status_code=204)


@router.put(
    "/{id}/identification",
    summary="Write the dynamics of a machine: RESULT.json of `rcsa-ident identify`, or FLANGE.csv of a measured or decoupled flange",
    description="If-Match or If-None-Match: * protect against overwriting concurrent changes.",
    openapi_extra=guard("upload", requestBody=_RESULT, **{"x-content-types": (JSON, CSV), "x-parsed-elsewhere": True}),
    responses={201: {"model": IdentificationSummary, "description": "The machine had none before."}, **problems(404, 412, *BODY)},
)
async def identify(
    id: MachineId, request: Request, response: Response, components: ThisService, caller: WhoAsks, why: Why = ""
) -> IdentificationSummary:
    await run_in_threadpool(machine_of, components, caller.group, id)
    text = utf8(await request.body())
    summary = await while_there(request, components.work.run(tasks.check, text))
    document = Document(caller.group, id, text, json.dumps(summary), digest_of(text), now())
    kept = components.store.identifications

    def write() -> bool:
        return kept.put(document, expected(request, lambda: _digest(kept.brief(caller.group, id))), caller.note(why))

    try:
        response.status_code = 201 if await run_in_threadpool(write) else 200
    except Stale:
        raise Problem(412, "the stored identification does not match If-Match or If-None-Match") from None
    response.headers.update(tagged(document.digest))
    return summary_of(document)


@router.get(
    "/{id}/identification",
    summary="The dynamics of a machine: RESULT.json or FLANGE.csv, as written",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={
        200: {"model": Identification, "description": "For use with the commands, too."},
        304: {"description": "The content matches If-None-Match."},
        **problems(404, 422),
    },
)
def result(id: MachineId, request: Request, components: ThisService, caller: WhoAsks) -> Response:
    document = identification_of(components, caller.group, id)
    if unchanged(request, document.digest):
        return Response(status_code=304, headers=tagged(document.digest))
    media_type = JSON if is_result(document.text) else CSV
    return Response(document.text.encode(), media_type=media_type, headers=tagged(document.digest))


@router.get(
    "/{id}/identification/modes", summary="Modes with their uncertainties", openapi_extra=guard("read"), responses=problems(404, 422)
)
def modes(id: MachineId, components: ThisService, caller: WhoAsks) -> Modes:
    return Modes.model_validate(tasks.modes(identification_of(components, caller.group, id).text))


@router.get(
    "/{id}/identification/frf",
    summary="The spindle's receptance at its flange, with standard deviations",
    openapi_extra=guard("read"),
    responses=problems(404, 422),
)
async def frf(
    id: MachineId,
    request: Request,
    components: ThisService,
    caller: WhoAsks,
    from_hz: Annotated[float | None, Query(ge=1.0, le=20_000.0, allow_inf_nan=False)] = None,
    to_hz: Annotated[float | None, Query(ge=1.0, le=20_000.0, allow_inf_nan=False)] = None,
    step_hz: Annotated[float, Query(ge=0.01, le=1000.0, allow_inf_nan=False)] = 2.0,
) -> Frf:
    machine = await run_in_threadpool(known_machine, components, caller.group, id)
    found = components.work.run(tasks.flange_frf, machine, (from_hz, to_hz, step_hz), components.settings.work_seconds)
    return Frf.model_validate(await while_there(request, found))


async def contents_of(components: Components, group: str, id: str) -> MachineContents | None:
    """Return what goes with a machine; None where there is no such machine."""
    example = id == example_id(group)

    def look() -> tuple[dict[str, Any], str] | None:
        machine = components.store.machines.get(group, id)
        if machine is None:
            return None
        known = components.store.identifications.brief(group, id)
        campaigns = []
        for campaign in components.store.campaigns.list(group, id, "", 1_000_000):
            rows = components.store.recordings.list(group, campaign.id, "", 1_000_000)
            told = {"id": campaign.id, "name": campaign.name, "example": campaign.id == example_id(group)}
            campaigns.append(told | {"recordings": [row.name for row in rows], "size_bytes": sum(row.size for row in rows)})
        status = None if known is None else stored_summary(known)["status"]
        told = {"id": id, "name": machine.name, "example": example, "identification": status, "campaigns": campaigns}
        return told, "" if known is None else known.digest

    found = await run_in_threadpool(look)
    if found is None:
        return None
    told, digest = found
    told["toolings"] = sorted(await components.examples.untouched(group)) if example else []
    # what the virtual machine makes meanwhile changes nothing that anybody would miss
    own = [each for each in told["campaigns"] if not each["example"]]
    return MachineContents(**told, etag=digest_of(json.dumps([told | {"campaigns": own}, digest])))


def unseen(request: Request, there: MachineContents) -> None:
    """Refuse to delete what was not among the contents that the caller has seen."""
    if expected(request, lambda: there.etag) not in (None, there.etag):
        raise Problem(412, "the machine holds something else than what was looked at: look again at what is deleted with it")


def _digest(document: Document | None) -> str | None:
    return None if document is None else document.digest


def summary_of(document: Document) -> IdentificationSummary:
    """Return what lists tell of an identification."""
    return IdentificationSummary(**stored_summary(document), changed=document.changed, etag=document.digest)


def _answer(components: Components, machine: Machine) -> MachineAnswer:
    document = components.store.identifications.brief(machine.group, machine.id)
    summary = None if document is None else summary_of(document)
    told = {name: getattr(machine, name) for name in ("id", "name", "description", "created")}
    return MachineAnswer(**told, example=machine.id == example_id(machine.group), identification=summary)
