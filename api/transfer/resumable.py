"""Resumable uploads: received bytes survive lost connections and restarts, and the client continues from there."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace as replaced
from pathlib import Path
from typing import NamedTuple

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from api.components import Components
from api.files import Part, Partial
from api.problems import Problem
from api.reading.stored import is_whole
from api.stores.campaigns import Campaign, Recording
from api.stores.entities import Taken
from api.transfer.body_stream import LOOK, blocks, check_digest, complete, refuse_encoded, storage_problems, take, write
from rcsa_ident.base.errors import InputError


class Checksum(NamedTuple):
    """What a part is to hash to: an algorithm of `hashlib`, hexadecimal digits, and what raises where others are found."""

    algorithm: str
    digest: str
    check: Callable[[str, str], None]


@contextmanager
def alone(components: Components, campaign: Campaign, name: str) -> Iterator[None]:
    """Keep other requests from writing the same upload meanwhile."""
    if (campaign.id, name) in components.uploads.writing:
        # perhaps by the same client, whose lost connection has not been noticed yet
        raise Problem(503, "another request is writing this recording", headers={"Retry-After": "2"})
    with components.uploads.alone(campaign.id, name):
        yield


@contextmanager
def writing(request: Request, components: Components, campaign: Campaign, name: str) -> Iterator[None]:
    """Let a request write a part, alone and in its turn."""
    refuse_encoded(request)
    with alone(components, campaign, name), components.uploads.admitted(campaign.group):
        yield


async def continued(components: Components, campaign: Campaign, name: str, offset: int, length: int | None = None) -> Partial:
    """Return the state of the upload that a part continues, else answer 409 with the offset at which it goes on."""
    _, state = await run_in_threadpool(components.uploads.partial, campaign.group, campaign.id, name)
    if state is None or state.offset != offset or length not in (None, state.length):
        there = await run_in_threadpool(_state, components, campaign, name)
        found = 0 if there is None else there.offset
        fault = {"field": "Upload-Offset", "found": str(offset), "allowed": f"{found}, of {there.length if there else 'nothing'} bytes"}
        raise Problem(409, f"the upload continues at byte {found}", [fault], {"Upload-Offset": str(found)})
    return state


async def receive(
    request: Request,
    components: Components,
    campaign: Campaign,
    state: Partial,
    checksum: Checksum | None = None,
    whole: str | None = None,
) -> int | tuple[int, Recording]:
    """Append the body of a request to an upload; return the offset behind it, or status and recording where nothing is missing.

    Parameters
    ----------
    whole : str, optional
        SHA-256 of the whole that this request announces.
    """
    path, _ = components.uploads.partial(state.group, state.campaign, state.name)
    part = await _append(request, components, path, state, checksum)
    try:
        if part.size < state.length:
            return part.size
        received = await complete(part)
        check_digest(whole, received.sha256)
        check_digest(state.sha256 or None, received.sha256, "Upload-Metadata")
        stored = await take(components, campaign, state.name, received, state.replacing)
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
    path, state = await run_in_threadpool(components.uploads.partial, campaign.group, campaign.id, name)
    if state is not None and state.complete:
        with storage_problems(), suppress(Taken):
            await components.uploads.finish(path, state)


def _state(components: Components, campaign: Campaign, name: str) -> Partial | None:
    """State of an upload; a stored recording is complete."""
    # between the two steps that store an upload it is neither a part nor a recording
    with components.files.lock:
        state = components.uploads.partial(campaign.group, campaign.id, name)[1]
        row = None if state is not None else components.store.recordings.get(campaign.group, campaign.id, name)
    # one that is damaged is sent again
    return state if row is None or not is_whole(components.files, row) else Partial(row.size, row.size)


async def _append(request: Request, components: Components, path: Path, state: Partial, checksum: Checksum | None) -> Part:
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
                await write(components, state.group, part, block, part.size - state.offset + len(block))
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
