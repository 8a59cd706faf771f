"""Bodies that are files: streamed to the disk in blocks, counted, hashed, and refused where they are too large or too slow."""

from __future__ import annotations

import asyncio
import base64
import binascii
import re
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from api.components import Components
from api.files import Full, Part, TooLarge
from api.problems import Problem, of_disk
from api.reading.uploads import Received
from api.stores.campaigns import Campaign, Recording
from api.stores.entities import Taken

#: Size of a block, and amount written between two checks of the free space [bytes].
BLOCK, LOOK = 1 << 20, 64 << 20
_DIGEST = re.compile(r"(?:^|,)\s*sha-256=:([A-Za-z0-9+/=]*):")


async def blocks(request: Request, components: Components) -> AsyncIterator[bytearray]:
    """Yield the body in blocks, within the time limits of uploads.

    Raises `Problem`: 408 where the client is too slow, 400 where it has disconnected.
    Raises `HTTPException`: 413 where the body is larger than an upload may be.
    """
    settings, waited, seen, buffer = components.settings, 0.0, 0, bytearray()
    request.state.body.most = settings.max_upload_bytes
    stream = request.stream()
    while True:
        start = time.monotonic()
        try:
            async with asyncio.timeout(settings.upload_idle_seconds):
                chunk = await anext(stream, b"")
        except TimeoutError:
            raise Problem(408, f"no data has arrived for {settings.upload_idle_seconds:g} s") from None
        except ClientDisconnect:
            if buffer:
                yield buffer
            raise Problem(400, "the client has disconnected") from None
        if not chunk:
            break
        # the time spent writing does not count
        waited, seen = waited + time.monotonic() - start, seen + len(chunk)
        if waited > settings.upload_seconds or seen < (waited - settings.upload_idle_seconds) * settings.upload_bytes_per_second:
            raise Problem(408, f"the upload is too slow: {seen} bytes in {waited:.0f} s")
        buffer += chunk
        if len(buffer) >= BLOCK:
            yield buffer
            buffer = bytearray()
    if buffer:
        yield buffer


async def append(request: Request, components: Components, group: str, part: Part) -> None:
    """Append a body to a part, within quota and free space."""
    seen = 0
    async for block in blocks(request, components):
        seen += len(block)
        await write(components, group, part, block, seen)


async def write(components: Components, group: str, part: Part, block: bytes | bytearray, seen: int) -> None:
    """Write a block; `seen` counts the bytes of this request so far."""
    with storage_problems():
        if seen // LOOK != (seen - len(block)) // LOOK:
            await run_in_threadpool(components.files.check_space, group)
        await run_in_threadpool(part.write, block)


async def check_room(components: Components, group: str, announced: int) -> None:
    """Refuse an upload whose announced size exceeds the limits."""
    if announced > components.settings.max_upload_bytes:
        raise Problem(413, f"the body is too large: at most {components.settings.max_upload_bytes} bytes")
    with storage_problems():
        await run_in_threadpool(components.files.check_space, group, announced)


@contextmanager
def storage_problems() -> Iterator[None]:
    """Turn exhausted quota or disk space into problems."""
    try:
        yield
    except TooLarge as error:
        raise Problem(413, str(error)) from None
    except (Full, OSError) as error:
        problem = of_disk(error)
        if problem is None:
            raise
        raise problem from None


@asynccontextmanager
async def new_part(components: Components, group: str) -> AsyncIterator[Part]:
    """A new part, removed at the end unless it has been renamed."""
    with storage_problems():
        part = await run_in_threadpool(components.files.part, group)
    try:
        yield part
    finally:
        part.drop()


async def complete(part: Part) -> Received:
    """Return a complete part, synced to the disk, with its hash."""

    def finish() -> Received:
        part.sync()
        return Received(part.path, part.size, part.sha256())

    with storage_problems():
        return await run_in_threadpool(finish)


async def take(components: Components, campaign: Campaign, name: str, received: Received, replacing: bool) -> tuple[int, Recording]:
    """Store a received file, or raise a problem with the reason."""
    try:
        with storage_problems():
            return await components.uploads.take(campaign, name, received, replacing)
    except Taken:
        fault = {"field": "name", "found": name[:120], "allowed": "the same content, or ?replace=true"}
        raise Problem(409, "a recording with other content exists under this name", [fault]) from None
    except KeyError:
        raise Problem(404, "there is no such campaign") from None


def refuse_encoded(request: Request) -> None:
    """Refuse a body with a content encoding."""
    coding = request.headers.get("content-encoding", "identity").strip().lower()
    if coding not in ("", "identity"):
        raise Problem(415, f"found content encoding {coding[:80]}, allowed is none: send the file as it is")


def announced_length(request: Request) -> int:
    """Return the Content-Length of a request, 0 where it has none."""
    text = request.headers.get("content-length", "")
    return int(text[:20]) if text.isdecimal() and text.isascii() else 0


def announced_digest(request: Request, *headers: str) -> str | None:
    """Return the hexadecimal SHA-256 of one of the headers (RFC 9530); other hashes are ignored."""
    for header in headers:
        text = request.headers.get(header, "")
        found = _DIGEST.search(text)
        if found is None and "sha-256" in text:
            raise _digest_fault(header, text)
        if found is not None:
            try:
                value = base64.b64decode(found[1], validate=True)
            except binascii.Error:
                raise _digest_fault(header, text) from None
            if len(value) != 32:
                raise _digest_fault(header, text)
            return value.hex()
    return None


def _digest_fault(header: str, text: str) -> Problem:
    fault = {"field": header, "found": text[:120], "allowed": "sha-256=:BASE64:, of 32 bytes"}
    return Problem(422, f"{header} cannot be parsed", [fault])


def check_digest(announced: str | None, found: str, header: str = "Repr-Digest") -> None:
    """Refuse content that does not match the announced digest."""
    if announced is not None and announced != found:
        fault = {"field": header, "found": f"content with the SHA-256 {found}", "allowed": announced}
        raise Problem(422, "the content does not match the digest: it was damaged in transit", [fault])
