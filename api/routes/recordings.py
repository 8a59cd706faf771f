"""Recordings of a campaign: upload in one request, description, spectrum, envelope, original file and deletion."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import FileResponse

from api.components import Components, ThisService
from api.conventions import BODY, CampaignId, Limit, found_or_404, guard, page, problems, tagged, unchanged, while_there
from api.lookups import known_campaign, own_campaign
from api.problems import Problem
from api.reading import reader_tasks
from api.reading.campaign_text import HAMMER, File, files_of
from api.reading.stored import found_of, samples_of, upload_of
from api.schemas.campaigns import RecordingAnswer, SignalAnswer, SpectrumAnswer
from api.schemas.common import Page
from api.security import Guarded, WhoAsks
from api.stores.campaigns import Campaign, Recording
from api.transfer.body_stream import (
    announced_digest,
    announced_length,
    append,
    check_digest,
    check_room,
    complete,
    new_part,
    refuse_encoded,
    take,
)
from api.transfer.parts_of_file import PartsOfFile
from rcsa_ident.base.errors import InputError

router = APIRouter(prefix="/campaigns/{id}/recordings", tags=["recordings"], route_class=Guarded)
BINARY = "application/octet-stream"
_NAME = r"^[^\x00-\x1f\x7f/\\]{1,128}$"
RecordingName = Annotated[str, Path(pattern=_NAME, description="Name of the recording in the campaign.")]
AfterName = Annotated[str, Query(pattern=r"^[^\x00-\x1f\x7f/\\]{0,128}$", description="`next` of the previous page.")]
Replace = Annotated[bool, Query(description="Replace a recording of this name that has other content.")]
Points = Annotated[int, Query(ge=10, le=10_000, description="Largest number of points.")]
_FILE = {"required": True, "content": {BINARY: {"schema": {"type": "string", "format": "binary"}}}}
_DIGESTS = [
    {"name": name, "in": "header", "schema": {"type": "string"}, "description": "sha-256=:BASE64: of the file, checked (RFC 9530)."}
    for name in ("Repr-Digest", "Content-Digest")
]
_CONTENT: dict[str, Any] = {BINARY: {"schema": {"type": "string", "format": "binary"}}}


@router.put(
    "/{name}",
    summary="Upload a recording",
    description="Any format of the commands, by the suffix of the name. The answer comes when the file is on the disk, "
    "read and judged. The same content again changes nothing.",
    openapi_extra=guard("upload", requestBody=_FILE, parameters=_DIGESTS, **{"x-content-types": (BINARY,)}),
    responses={201: {"model": RecordingAnswer, "description": "The recording is stored."}, **problems(404, 408, 409, *BODY)},
)
async def put(
    id: CampaignId,
    name: RecordingName,
    request: Request,
    response: Response,
    components: ThisService,
    caller: WhoAsks,
    replace: Replace = False,
) -> RecordingAnswer:
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, name, own_campaign)
    digest = announced_digest(request, "Repr-Digest", "Content-Digest")
    refuse_encoded(request)
    with components.uploads.admitted(caller.group):
        await check_room(components, caller.group, announced_length(request))
        async with new_part(components, caller.group) as part:
            await append(request, components, caller.group, part)
            received = await complete(part)
            check_digest(digest, received.sha256)
            response.status_code, kept = await take(components, campaign, name, received, replace)
    response.headers.update(tagged(kept.sha256))
    return answer(campaign, kept)


@router.get("", summary="List recordings", openapi_extra=guard("read"), responses=problems(404, 422))
def list_recordings(
    id: CampaignId, components: ThisService, caller: WhoAsks, after: AfterName = "", limit: Limit = 50
) -> Page[RecordingAnswer]:
    campaign = known_campaign(components, caller.group, id)
    rows, following = page(components.store.recordings.list(caller.group, id, _form(after), limit + 1), limit, lambda row: row.name)
    known = files_of(campaign.text)
    return Page(items=[_answer(known[row.name], row) for row in rows], next=following)


@router.get("/{name}", summary="Description of a recording with its verdict", openapi_extra=guard("read"), responses=problems(404, 422))
def get(id: CampaignId, name: RecordingName, response: Response, components: ThisService, caller: WhoAsks) -> RecordingAnswer:
    campaign, row = _kept(components, caller.group, id, name)
    response.headers.update(tagged(row.sha256))
    return answer(campaign, row)


@router.get(
    "/{name}/file",
    summary="The original file",
    description="Hashed before its first byte is sent: it is what was uploaded, or it is not sent. Parts by Range, and If-Range.",
    openapi_extra=guard("read"),
    response_class=FileResponse,
    responses={
        200: {"description": "Its entity tag is its SHA-256.", "content": _CONTENT},
        206: {"description": "The part that Range asks for.", "content": _CONTENT},
        304: {"description": "The content matches If-None-Match."},
        **problems(400, 404, 416, 422, 500),
    },
)
def file(id: CampaignId, name: RecordingName, request: Request, components: ThisService, caller: WhoAsks) -> Response:
    _, row = _kept(components, caller.group, id, name)
    if unchanged(request, row.sha256):
        return Response(status_code=304, headers=tagged(row.sha256))
    # a browser must never show an uploaded file as a page
    headers = {"Content-Disposition": "attachment", "Content-Security-Policy": "default-src 'none'; sandbox"}
    return PartsOfFile(upload_of(components.files, row), media_type=BINARY, headers=tagged(row.sha256) | headers)


@router.get("/{name}/spectrum", summary="Amplitude spectrum", openapi_extra=guard("read"), responses=problems(404, 422, 500))
async def spectrum(
    id: CampaignId, name: RecordingName, request: Request, components: ThisService, caller: WhoAsks, points: Points = 2000
) -> SpectrumAnswer:
    row = await run_in_threadpool(_over_time, components, caller.group, id, name)
    path = await run_in_threadpool(samples_of, components.files, row)
    speed = found_of(row)["spindle_speed_rpm"]
    return SpectrumAnswer.model_validate(await while_there(request, components.work.run(reader_tasks.spectrum, path, speed, points)))


@router.get("/{name}/signal", summary="Envelope over time", openapi_extra=guard("read"), responses=problems(404, 422, 500))
async def signal(
    id: CampaignId, name: RecordingName, request: Request, components: ThisService, caller: WhoAsks, points: Points = 1000
) -> SignalAnswer:
    row = await run_in_threadpool(_over_time, components, caller.group, id, name)
    path = await run_in_threadpool(samples_of, components.files, row)
    return SignalAnswer.model_validate(await while_there(request, components.work.run(reader_tasks.envelope, path, points)))


@router.delete(
    "/{name}",
    status_code=204,
    summary="Delete a recording or its unfinished upload",
    openapi_extra=guard("upload"),
    responses=problems(404, 422),
)
async def forget(id: CampaignId, name: RecordingName, components: ThisService, caller: WhoAsks) -> Response:
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, name)
    if not await components.uploads.forget(campaign, name):
        raise Problem(404, "there is no such recording")
    return Response(status_code=204)


def _form(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def named(
    components: Components, group: str, id: str, name: str, of: Callable[[Components, str, str], Campaign] = known_campaign
) -> tuple[Campaign, str, File]:
    """Return a campaign and a recording that it names; of `own_campaign` where that is to be written."""
    campaign = of(components, group, id)
    found = files_of(campaign.text).get(_form(name))
    if found is None:
        raise Problem(404, "the campaign does not name this recording")
    return campaign, _form(name), found


def _kept(components: Components, group: str, id: str, name: str) -> tuple[Campaign, Recording]:
    campaign = known_campaign(components, group, id)
    return campaign, found_or_404(components.store.recordings.get(group, id, _form(name)), "recording")


def _over_time(components: Components, group: str, id: str, name: str) -> Recording:
    _, row = _kept(components, group, id, name)
    if row.role == HAMMER:
        raise InputError("name", f"{row.name}, which holds FRFs of hammer tests", "a recording over time")
    return row


def answer(campaign: Campaign, row: Recording) -> RecordingAnswer:
    """Return the description of a recording."""
    return _answer(files_of(campaign.text)[row.name], row)


def _answer(file: File, row: Recording) -> RecordingAnswer:
    found = found_of(row)
    common = {"name": row.name, "role": file.role, "cuts": list(file.cuts), "created": row.created}
    return RecordingAnswer.model_validate(common | {"size_bytes": row.size, "sha256": row.sha256} | found)
