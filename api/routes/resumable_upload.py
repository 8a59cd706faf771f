"""The service's own resumable uploads, as before `tus`: deprecated."""

from __future__ import annotations

from dataclasses import replace as replaced
from functools import partial
from typing import Annotated, Any, ClassVar

from fastapi import APIRouter, Header, Request, Response
from fastapi.concurrency import run_in_threadpool

from api.components import Components, ThisService
from api.conventions import BODY, CampaignId, Telling, guard, problems, tagged
from api.files import Partial
from api.lookups import own_campaign
from api.problems import Problem
from api.routes.recordings import BINARY, RecordingName, Replace, answer, named
from api.routes.tus import OFFSET, Offset
from api.schemas.campaigns import RecordingAnswer
from api.security import Guarded, WhoAsks
from api.stores.campaigns import Campaign
from api.transfer.body_stream import announced_digest, check_digest, check_room
from api.transfer.resumable import Checksum, continued, receive, state_of, writing
from rcsa_ident.base.errors import InputError


class Deprecated(Telling, Guarded):
    """Routes that say since when others take their place (RFC 9745), and until when they are there (RFC 8594)."""

    headers: ClassVar = {"Deprecation": "@1795824000", "Sunset": "Mon, 31 May 2027 00:00:00 GMT"}


router = APIRouter(prefix="/campaigns/{id}/recordings", tags=["recordings"], route_class=Deprecated)
_PART = {"required": True, "content": {BINARY: {"schema": {"type": "string", "format": "binary"}}}}
_DIGESTS = [
    {"name": name, "in": "header", "schema": {"type": "string"}, "description": f"sha-256=:BASE64: of {what}, checked (RFC 9530)."}
    for name, what in (("Repr-Digest", "the whole file"), ("Content-Digest", "this part"))
]
_LENGTH: dict[str, Any] = {"Upload-Length": {"description": "Length of the whole file.", "schema": {"type": "string"}}}
Length = Annotated[
    int | None, Header(alias="Upload-Length", ge=0, lt=10**15, description="Length of the whole file; required with the first part.")
]


@router.head(
    "/{name}",
    deprecated=True,
    status_code=204,
    summary="State of an upload",
    openapi_extra=guard("upload"),
    description="An offset as large as the length says that the recording is stored.",
    responses={204: {"description": "The state of the upload.", "headers": OFFSET | _LENGTH}, **problems(404, 422)},
)
async def head(id: CampaignId, name: RecordingName, components: ThisService, caller: WhoAsks) -> Response:
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, name)
    state = await state_of(components, campaign, name)
    if state is None:
        raise Problem(404, "no part of this recording has been uploaded")
    return Response(status_code=204, headers={"Upload-Offset": str(state.offset), "Upload-Length": str(state.length)})


@router.patch(
    "/{name}",
    deprecated=True,
    summary="Upload a part of a recording",
    response_model=RecordingAnswer,
    description="Parts follow each other; HEAD returns where to continue. Received bytes survive lost connections and "
    "restarts, for a day. The last part answers as an upload at once does.",
    openapi_extra=guard("upload", requestBody=_PART, parameters=_DIGESTS, **{"x-content-types": (BINARY,)}),
    responses={
        201: {"model": RecordingAnswer, "description": "The upload is complete and stored."},
        204: {"description": "The part is stored; more parts follow.", "headers": OFFSET},
        **problems(404, 408, 409, 410, *BODY),
    },
)
async def patch(
    id: CampaignId,
    name: RecordingName,
    request: Request,
    response: Response,
    components: ThisService,
    caller: WhoAsks,
    offset: Offset,
    length: Length = None,
    replace: Replace = False,
) -> Any:
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, name, own_campaign)
    whole, content = announced_digest(request, "Repr-Digest"), announced_digest(request, "Content-Digest")
    checksum = None if content is None else Checksum("sha256", content, partial(check_digest, header="Content-Digest"))
    with writing(request, components, campaign, name):
        state = await _begun(components, campaign, name, offset, length) or await continued(components, campaign, name, offset, length)
        done = await receive(request, components, campaign, replaced(state, replacing=replace or state.replacing), checksum, whole)
    if isinstance(done, int):
        return Response(status_code=204, headers={"Upload-Offset": str(done)})
    response.status_code, kept = done
    response.headers.update(tagged(kept.sha256))
    return answer(campaign, kept)


async def _begun(components: Components, campaign: Campaign, name: str, offset: int, length: int | None) -> Partial | None:
    """Begin an upload where a first part has another length than what is there."""
    path, state = await run_in_threadpool(components.uploads.partial, campaign.group, campaign.id, name)
    if offset > 0 or (state is not None and length in (None, state.length)):
        return None
    if length is None:
        raise InputError("Upload-Length", "nothing", "the length of the whole file, with its first part")
    await check_room(components, campaign.group, length)
    await run_in_threadpool(components.files.forget, path)
    return Partial(0, length, campaign.group, campaign.id, name)
