"""Parser of multipart/form-data that works on the stream: files never stay in memory."""

from __future__ import annotations

from collections.abc import AsyncIterator, Collection
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass

from fastapi import Request
from multipart import MultipartError, MultipartSegment, PushMultipartParser, parse_options_header

from api.components import Components
from api.files import Part
from api.problems import Problem
from api.reading.campaign_text import recording_name
from api.reading.uploads import Received
from api.transfer.body_stream import blocks, complete, new_part, write

FORM = "multipart/form-data"
MOST_PARTS, LARGEST_TEXT = 1000, 1_000_000


@dataclass(frozen=True, slots=True)
class Head:
    """Header of a part. `name`: last part of the file name; None where the part is not a file."""

    field: str
    name: str | None


async def events(request: Request, components: Components) -> AsyncIterator[Head | bytes | None]:
    """Yield the head of each part, its content in pieces, and None at its end.

    Raises `Problem`: 400 where the body is not a complete form, 408 and 413 as from `blocks`.
    """
    boundary, parts = parse_options_header(request.headers.get("content-type", ""))[1].get("boundary", ""), 0
    try:
        # any byte is a character of Latin-1: a name that is not UTF-8 speaks against its part alone
        with PushMultipartParser(boundary, header_charset="latin-1") as parser:
            async for block in blocks(request, components):
                for event in parser.parse(block):
                    if not isinstance(event, MultipartSegment):
                        yield event
                        continue
                    parts += 1
                    if parts > MOST_PARTS:
                        raise Problem(413, f"the body is too large: at most {MOST_PARTS} parts")
                    yield Head(_utf8(event.name or ""), None if event.filename is None else recording_name(_utf8(event.filename)))
    except MultipartError:
        raise Problem(400, "the body cannot be read: it is not complete multipart/form-data") from None


def _utf8(text: str) -> str:
    return text.encode("latin-1").decode("utf-8", "replace")


@asynccontextmanager
async def form(
    request: Request, components: Components, group: str, texts: Collection[str], files: Collection[str], several: bool = False
) -> AsyncIterator[tuple[dict[str, bytes], dict[str, tuple[str, Received]]]]:
    """Texts and files of a form by field; files are on the disk until the end of the context.

    With `several` a file's field may come again: the further ones are `field[1]`, `field[2]` and so on.

    Raises
    ------
    Problem
        422 for an unknown or repeated field, 413 for a text that is too long.
    """
    found: dict[str, bytes] = {}
    received: dict[str, tuple[str, Received]] = {}
    async with AsyncExitStack() as stack:
        head, text, part, seen = Head("", None), bytearray(), None, 0
        async for event in events(request, components):
            if isinstance(event, Head):
                head, text, part = event, bytearray(), None
                again = head.field in received and not several
                if head.field in found or again or head.field not in {*texts, *files}:
                    allowed = f"each once: {', '.join([*texts, *files])}"
                    fault = {"field": head.field[:80] or "part", "found": "such a part", "allowed": allowed}
                    raise Problem(422, f"a part of the form: found {head.field[:80]!r}, allowed is {allowed}", [fault])
                if head.field in files:
                    part = await stack.enter_async_context(new_part(components, group))
            elif event is None:
                if isinstance(part, Part):
                    place = f"{head.field}[{len(received)}]" if head.field in received else head.field
                    received[place] = (head.name or "", await complete(part))
                else:
                    found[head.field] = bytes(text)
            elif isinstance(part, Part):
                seen += len(event)
                await write(components, group, part, event, seen)
            else:
                text += event
                if len(text) > LARGEST_TEXT:
                    raise Problem(413, f"the body is too large: {head.field} has at most {LARGEST_TEXT // 1000} kB")
        yield found, received
