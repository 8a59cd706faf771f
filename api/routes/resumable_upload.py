"""Resumable uploads: received bytes survive lost connections and restarts, and the client continues from there."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace as replaced
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from fastapi import APIRouter, Header, Request, Response
from fastapi.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from api.components import Components, ThisService
from api.conventions import BODY, CampaignId, guard, problems, tagged
from api.files import Part, Partial
from api.lookups import own_campaign
from api.problems import Problem
from api.reading.stored import is_whole
from api.reading.uploads import partial_name
from api.routes.recordings import BINARY, RecordingName, Replace, answer, named, take
from api.schemas.campaigns import RecordingAnswer
from api.security import Guarded, WhoAsks
from api.stores.campaigns import Campaign, Recording
from api.stores.entities import Taken
from api.transfer.body_stream import (
    LOOK,
    announced_digest,
    blocks,
    check_digest,
    check_room,
    complete,
    refuse_encoded,
    storage_problems,
    write,
)
from rcsa_ident.base.errors import InputError

router = APIRouter(prefix="/campaigns/{id}/recordings", tags=["recordings"], route_class=Guarded)
_PART = {"required": True, "content": {BINARY: {"schema": {"type": "string", "format": "binary"}}}}
_DIGESTS = [
    {"name": name, "in": "header", "schema": {"type": "string"}, "description": f"sha-256=:BASE64: of {what}, checked (RFC 9530)."}
    for name, what in (("Repr-Digest", "the whole file"), ("Content-Digest", "this part"))
]
_OFFSET: dict[str, Any] = {"Upload-Offset": {"description": "Number of bytes received.", "schema": {"type": "string"}}}
_LENGTH: dict[str, Any] = {"Upload-Length": {"description": "Length of the whole file.", "schema": {"type": "string"}}}
Offset = Annotated[int, Header(alias="Upload-Offset", ge=0, lt=10**15, description="Offset of this part.")]
Length = Annotated[
    int | None, Header(alias="Upload-Length", ge=0, lt=10**15, description="Length of the whole file; required with the first part.")
]


@router.head(
    "/{name}",
    status_code=204,
    summary="State of an upload",
    openapi_extra=guard("upload"),
    description="An offset as large as the length says that the recording is stored.",
    responses={204: {"description": "The state of the upload.", "headers": _OFFSET | _LENGTH}, **problems(404, 422)},
)
async def head(id: CampaignId, name: RecordingName, components: ThisService, caller: WhoAsks) -> Response:
    campaign, name, _ = await run_in_threadpool(named, components, caller.group, id, name)
    state = await state_of(components, campaign, name)
    if state is None:
        raise Problem(404, "no part of this recording has been uploaded")
    return Response(status_code=204, headers={"Upload-Offset": str(state.offset), "Upload-Length": str(state.length)})


@router.patch(
    "/{name}",
    summary="Upload a part of a recording",
    response_model=RecordingAnswer,
    description="Parts follow each other; HEAD returns where to continue. Received bytes survive lost connections and "
    "restarts, for a day. The last part answers as an upload at once does.",
    openapi_extra=guard("upload", requestBody=_PART, parameters=_DIGESTS, **{"x-content-types": (BINARY,)}),
    responses={
        201: {"model": RecordingAnswer, "description": "The upload is complete and stored."},
        204: {"description": "The part is stored; more parts follow.", "headers": _OFFSET},
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
    done = await receive(request, components, campaign, name, Upload(offset, length, replace, whole), checksum)
    if isinstance(done, int):
        return Response(status_code=204, headers={"Upload-Offset": str(done)})
    response.status_code, kept = done
    response.headers.update(tagged(kept.sha256))
    return answer(campaign, kept)


class Checksum(NamedTuple):
    """What a part is to hash to.

    `algorithm`: as `hashlib` calls it
    `digest`: in hexadecimal digits
    `check`: callable of (announced, found); raises where they differ
    """

    algorithm: str
    digest: str
    check: Callable[[str, str], None]


class Upload(NamedTuple):
    """What a part says of its upload.

    `offset` [bytes]
    `length` [bytes]: of the whole; None where it is known
    `replace`: whether the whole takes the place of other content
    `whole`: SHA-256 of the whole
    """

    offset: int
    length: int | None = None
    replace: bool = False
    whole: str | None = None


async def receive(
    request: Request, components: Components, campaign: Campaign, name: str, upload: Upload, checksum: Checksum | None = None
) -> int | tuple[int, Recording]:
    """Append the body of a request to an upload; return the offset behind it, or status and recording where nothing is missing."""
    refuse_encoded(request)
    with alone(components, campaign, name), components.uploads.admitted(campaign.group):
        state = await _go_on(components, campaign, name, upload.offset, upload.length)
        replacing = upload.replace or state.replacing
        state = replaced(state, group=campaign.group, campaign=campaign.id, name=name, replacing=replacing)
        path = components.files.partial(campaign.group, partial_name(campaign.id, name))[0]
        part = await _append(request, components, campaign.group, path, state, checksum)
        try:
            if part.size < state.length:
                return part.size
            received = await complete(part)
            check_digest(upload.whole, received.sha256)
            check_digest(state.sha256 or None, received.sha256, "Upload-Metadata")
            stored = await take(components, campaign, name, received, replacing)
        except Exception as error:
            _check_wanted(components, state)
            # kept unless they are at fault: the disk may have room again, or the client may replace the other content
            if isinstance(error, InputError) or (isinstance(error, Problem) and error.status in (404, 422)):
                await run_in_threadpool(components.files.forget, path)
            raise
        finally:
            part.close()
        await run_in_threadpool(components.files.forget, path)
        return stored


@contextmanager
def alone(components: Components, campaign: Campaign, name: str) -> Iterator[None]:
    """Keep other requests from writing the same upload meanwhile."""
    if (campaign.id, name) in components.uploads.writing:
        # perhaps by the same client, whose lost connection has not been noticed yet
        raise Problem(503, "another request is writing this recording", headers={"Retry-After": "2"})
    with components.uploads.alone(campaign.id, name):
        yield


def _check_wanted(components: Components, state: Partial) -> None:
    """Refuse to go on with an upload that another request has given up meanwhile."""
    if (state.campaign, state.name) in components.uploads.given_up:
        raise Problem(410, "this upload has been given up meanwhile: none of its bytes is kept")


async def state_of(components: Components, campaign: Campaign, name: str) -> Partial | None:
    """State of an upload; one that lacks no byte is stored first: to a client such an upload is one that is kept."""
    await finish(components, campaign, name)
    return await run_in_threadpool(_state, components, campaign, name)


async def finish(components: Components, campaign: Campaign, name: str) -> None:
    """Store an upload that lacks no byte, unless its content may not take the place of the recording's."""
    path, state = await run_in_threadpool(components.files.partial, campaign.group, partial_name(campaign.id, name))
    if state is not None and state.complete:
        with storage_problems(), suppress(Taken):
            await components.uploads.finish(path, replaced(state, group=campaign.group, campaign=campaign.id, name=name))


def _state(components: Components, campaign: Campaign, name: str) -> Partial | None:
    """State of an upload; a stored recording is complete."""
    # between the two steps that store an upload it is neither a part nor a recording
    with components.files.lock:
        state = components.files.partial(campaign.group, partial_name(campaign.id, name))[1]
        row = None if state is not None else components.store.recordings.get(campaign.group, campaign.id, name)
    # one that is damaged is sent again
    return state if row is None or not is_whole(components.files, row) else Partial(row.size, row.size)


async def _go_on(components: Components, campaign: Campaign, name: str, offset: int, length: int | None) -> Partial:
    """Return the state of an upload if the part continues it; offset 0 with another length starts a new one."""
    path, state = await run_in_threadpool(components.files.partial, campaign.group, partial_name(campaign.id, name))
    if offset == 0 and (state is None or (length is not None and length != state.length)):
        if length is None:
            raise InputError("Upload-Length", "nothing", "the length of the whole file, with its first part")
        await check_room(components, campaign.group, length)
        state = Partial(0, length)
        await run_in_threadpool(components.files.forget, path)
        return state
    if state is None or state.offset != offset or length not in (None, state.length):
        there = await run_in_threadpool(_state, components, campaign, name)
        found = 0 if there is None else there.offset
        fault = {"field": "Upload-Offset", "found": str(offset), "allowed": f"{found}, of {there.length if there else 'nothing'} bytes"}
        raise Problem(409, f"the upload continues at byte {found}", [fault], {"Upload-Offset": str(found)})
    return state


async def _append(request: Request, components: Components, group: str, path: Path, state: Partial, checksum: Checksum | None) -> Part:
    """Append a part and record the state, also where the part breaks off."""
    with storage_problems():
        part = await run_in_threadpool(Part, path, state.offset)
    digest, noted = hashlib.new(checksum.algorithm if checksum else "sha256"), 0
    try:
        try:
            async for block in blocks(request, components):
                _check_wanted(components, state)
                if part.size + len(block) > state.length:
                    raise InputError(
                        "body", "more bytes than Upload-Length", f"at most {state.length - state.offset} bytes from {state.offset}"
                    )
                await write(components, group, part, block, part.size - state.offset + len(block))
                digest.update(block)
                if checksum is None and (part.size - state.offset) // LOOK > noted:
                    noted += 1
                    await run_in_threadpool(_note, components, part, part.size, state)
            if checksum is not None:
                checksum.check(checksum.digest, digest.hexdigest())
        except (Problem, InputError, HTTPException) as error:
            # a part with a digest counts only when it is complete
            kept = state.offset if checksum is not None or isinstance(error, InputError) else part.size
            await run_in_threadpool(_note, components, part, kept, state)
            raise
        await run_in_threadpool(_note, components, part, part.size, state)
    except BaseException:
        part.close()
        raise
    return part


def _note(components: Components, part: Part, offset: int, state: Partial) -> None:
    with storage_problems():
        part.sync()
        with components.files.lock:
            # an offset that is noted, and acknowledged, has its bytes on the disk
            _check_wanted(components, state)
            components.files.note(part.path, replaced(state, offset=offset))
