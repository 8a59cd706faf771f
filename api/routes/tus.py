"""Resumable uploads as tus 1.0 speaks of them."""

from __future__ import annotations

import base64
import re
from typing import Annotated, Any, ClassVar

from fastapi import APIRouter, Depends, Header, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import PlainTextResponse
from starlette.datastructures import Headers
from starlette.routing import Match
from starlette.types import Scope

from api.components import Components, ThisService
from api.conventions import CampaignId, Telling, guard, problems
from api.files import Partial
from api.lookups import own_campaign
from api.problems import Problem
from api.routes.recordings import RecordingName, named
from api.security import Guarded, WhoAsks
from api.stores.campaigns import Campaign
from api.transfer.body_stream import check_room, storage_problems
from api.transfer.resumable import Checksum, alone, continued, finish, receive, state_of, writing
from rcsa_ident.base.errors import InputError

VERSION = "1.0.0"
EXTENSIONS = "creation,termination,checksum"
ALGORITHMS = ("sha1", "sha256", "md5")
PART = "application/offset+octet-stream"
_SHA256 = re.compile("[0-9a-f]{64}")
_BODY = {"required": True, "content": {PART: {"schema": {"type": "string", "format": "binary"}}}}
_TUS: dict[str, Any] = {"Tus-Resumable": {"description": "Version of the protocol.", "schema": {"type": "string"}}}
OFFSET: dict[str, Any] = {"Upload-Offset": {"description": "Number of bytes received.", "schema": {"type": "string"}}}
_PARAMETERS = [
    {"name": "Tus-Resumable", "in": "header", "required": True, "schema": {"const": VERSION}, "description": "Version of the protocol."}
]
Length = Annotated[int, Header(alias="Upload-Length", ge=0, lt=10**15, description="Length of the whole file.")]
Offset = Annotated[int, Header(alias="Upload-Offset", ge=0, lt=10**15, description="Offset of this part.")]
Metadata = Annotated[
    str,
    Header(
        alias="Upload-Metadata",
        max_length=4000,
        description="`filename` and its name in the campaign in Base64; `replace` takes the place of a recording with other content; "
        "`sha256` is that of the whole file in hexadecimal digits, checked at its end: who creates the same upload again goes on with it.",
    ),
]
Announced = Annotated[
    str | None,
    Header(alias="Upload-Checksum", max_length=200, description="Algorithm (sha1, sha256 or md5) and hash of this part in Base64."),
]


class SpeaksTus(Telling, Guarded):
    """Routes that name the version of the protocol in every answer, and that go by the method which X-HTTP-Method-Override says."""

    headers: ClassVar = {"Tus-Resumable": VERSION}

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        """Whether a request is for this route; in front of clients that send POST alone, the header says what they mean."""
        method = scope["method"] if scope["type"] == "http" else ""
        if method == "POST":
            method = Headers(scope=scope).get("x-http-method-override", method).upper()
        match, found = super().matches(dict(scope, method=method))
        # the log tells what was done
        return match, {**found, "method": method} if match is Match.FULL else found


async def speaks(request: Request) -> None:
    """Refuse another version of the protocol; asking what is spoken needs none."""
    if request.method != "OPTIONS" and request.headers.get("tus-resumable") != VERSION:
        raise Problem(412, f"Tus-Resumable: found another version, allowed is {VERSION}", headers={"Tus-Version": VERSION})


router = APIRouter(prefix="/campaigns/{id}/uploads", tags=["recordings"], route_class=SpeaksTus, dependencies=[Depends(speaks)])


@router.options(
    "",
    status_code=204,
    summary="What uploads by tus may do",
    openapi_extra=guard("upload"),
    responses={204: {"description": "Version, extensions and largest size, in headers.", "headers": _TUS}, **problems(404, 422)},
)
async def options(id: CampaignId, components: ThisService) -> Response:
    told = {
        "Tus-Version": VERSION,
        "Tus-Extension": EXTENSIONS,
        "Tus-Max-Size": str(components.settings.max_upload_bytes),
        "Tus-Checksum-Algorithm": ",".join(ALGORITHMS),
    }
    return Response(status_code=204, headers=told)


@router.post(
    "",
    status_code=201,
    response_class=PlainTextResponse,
    summary="Begin an upload by tus",
    description="The file name of the metadata is one that the campaign names. The upload lives for a day without a new byte. "
    "One that another client has begun is never begun anew.",
    openapi_extra=guard("upload", parameters=_PARAMETERS),
    responses={
        201: {
            "description": "Location is where the parts go; the body is empty.",
            "headers": _TUS | OFFSET,
            "content": {"text/plain": {"schema": {"type": "string"}}},
        },
        **problems(404, 409, 412, 413, 422),
    },
)
async def create(
    id: CampaignId, request: Request, components: ThisService, caller: WhoAsks, length: Length, metadata: Metadata
) -> Response:
    told = _metadata(metadata)
    if "filename" not in told:
        raise InputError("Upload-Metadata", metadata[:80], "a filename: its name in the campaign, in Base64")
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, told["filename"], own_campaign)
    await check_room(components, caller.group, length)
    replacing = told.get("replace", "") not in ("", "false", "0")
    state = Partial(0, length, caller.group, campaign.id, name, replacing, _digest(told.get("sha256", "")))
    await finish(components, campaign, name)
    with alone(components, campaign, name):
        offset = await run_in_threadpool(_begin, components, state)
    path = request.url_for("send_part", id=id, name=name).path
    return PlainTextResponse("", 201, {"Location": path, "Upload-Offset": str(offset)})


@router.head(
    "/{name}",
    status_code=204,
    summary="State of an upload by tus",
    description="An offset as large as the length says that the recording is stored.",
    openapi_extra=guard("upload", parameters=_PARAMETERS),
    responses={204: {"description": "The state of the upload.", "headers": _TUS | OFFSET}, **problems(404, 412, 422)},
)
async def state(id: CampaignId, name: RecordingName, components: ThisService, caller: WhoAsks) -> Response:
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, name)
    found = await state_of(components, campaign, name)
    if found is None:
        raise Problem(404, "no such upload has begun")
    return Response(status_code=204, headers={"Upload-Offset": str(found.offset), "Upload-Length": str(found.length)})


@router.patch(
    "/{name}",
    status_code=204,
    summary="Upload a part by tus",
    description="The last part is acknowledged when the recording is read, judged and stored.",
    openapi_extra=guard("upload", requestBody=_BODY, parameters=_PARAMETERS, **{"x-content-types": (PART,)}),
    responses={
        204: {"description": "The part is stored.", "headers": _TUS | OFFSET},
        **problems(400, 404, 408, 409, 410, 412, 413, 415, 422, 460),
    },
)
async def send_part(
    id: CampaignId,
    name: RecordingName,
    request: Request,
    components: ThisService,
    caller: WhoAsks,
    offset: Offset,
    announced: Announced = None,
) -> Response:
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, name)
    checksum = None if announced is None else _checksum(announced)
    _, there = await run_in_threadpool(components.uploads.partial, campaign.group, campaign.id, name)
    if there is None:
        raise Problem(404, "no such upload has begun")
    with writing(request, components, campaign, name):
        state = await continued(components, campaign, name, offset)
        done = await receive(request, components, campaign, state, checksum)
    return Response(status_code=204, headers={"Upload-Offset": str(done if isinstance(done, int) else state.length)})


@router.delete(
    "/{name}",
    status_code=204,
    summary="Give up an upload by tus",
    description="A part that is under way is answered with 410. A recording that is stored already stays: it is deleted as a recording.",
    openapi_extra=guard("upload", parameters=_PARAMETERS),
    responses={204: {"description": "Its bytes are gone.", "headers": _TUS}, **problems(404, 412, 422)},
)
async def give_up(id: CampaignId, name: RecordingName, components: ThisService, caller: WhoAsks) -> Response:
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, name)
    if not await run_in_threadpool(_given_up, components, campaign, name):
        raise Problem(404, "no such upload has begun")
    return Response(status_code=204)


def _begin(components: Components, state: Partial) -> int:
    """Begin an upload, or go on with that of the same content; return its offset.

    Clients that meet 409 for a part ask for the offset and send what follows there. Were an upload begun anew under one of them, or
    lent to two with different files of one length, both would go on, and what both are told to be their file would be a mixture.
    """
    path, there = components.uploads.partial(state.group, state.campaign, state.name)
    if there is not None and not there.complete:
        if state.sha256 and (there.length, there.replacing, there.sha256) == (state.length, state.replacing, state.sha256):
            return there.offset
        found = f"{there.offset} of {there.length} bytes have come, of the SHA-256 {there.sha256 or 'that nobody has told'}"
        allowed = "HEAD and PATCH to go on with that upload, DELETE to give it up, or the same length, `replace` and `sha256`"
        raise Problem(409, "this recording is being uploaded", [{"field": "Upload-Metadata", "found": found, "allowed": allowed}])
    with storage_problems():
        components.files.forget(path)
        path.touch()
        components.files.note(path, state)
    return 0


def _given_up(components: Components, campaign: Campaign, name: str) -> bool:
    with components.files.lock:
        return components.uploads.give_up(campaign.group, campaign.id, name)


def _metadata(text: str) -> dict[str, str]:
    """Pairs of a key and a value in Base64, divided by commas; a key may stand without a value."""
    found = {}
    for pair in text.split(","):
        key, _, value = pair.strip().partition(" ")
        try:
            found[key] = base64.b64decode(value, validate=True).decode("utf-8")
        except ValueError:
            raise InputError("Upload-Metadata", pair[:80], "pairs of a key and UTF-8 text in Base64, divided by commas") from None
    return found


def _digest(text: str) -> str:
    if text and not _SHA256.fullmatch(text):
        raise InputError("Upload-Metadata", f"sha256 {text[:80]}", "64 hexadecimal digits in lower case, in Base64")
    return text


def _checksum(text: str) -> Checksum:
    algorithm, _, value = text.partition(" ")
    if algorithm not in ALGORITHMS:
        raise Problem(400, f"Upload-Checksum: found {algorithm[:40]}, allowed are {', '.join(ALGORITHMS)}")
    try:
        return Checksum(algorithm, base64.b64decode(value, validate=True).hex(), _same)
    except ValueError:
        raise Problem(400, f"Upload-Checksum: found {value[:80]}, allowed is a hash in Base64") from None


def _same(announced: str, found: str) -> None:
    if announced != found:
        raise Problem(460, f"the part has the checksum {found}, announced was {announced}: none of its bytes is kept")
