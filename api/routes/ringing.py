"""A tooling learned from how it rings: nothing is stored, and whoever likes what is learned writes it as a tooling."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool

from api.components import ThisService
from api.conventions import BODY, guard, problems, while_there
from api.lookups import tooling_source
from api.problems import Problem
from api.reading import reader_tasks
from api.reading.uploads import Received
from api.routes.listening import checked_name
from api.schemas.common import body_of
from api.schemas.ringing import RingAnswer, RingQuery
from api.security import Guarded, WhoAsks
from api.stores.entities import digest_of
from api.transfer.body_stream import announced_length, check_room, refuse_encoded, storage_problems
from api.transfer.multipart import FORM, form
from rcsa_ident.base.errors import InputError

router = APIRouter(tags=["listen"], route_class=Guarded)
JSON = "application/json"
SOUNDS, BARE_TOOL = "sounds", "bare_tool"
MOST_SOUNDS = 20
_FILES: dict[str, Any] = {"type": "array", "items": {"type": "string", "format": "binary"}, "maxItems": MOST_SOUNDS}
_BODY = {
    "required": True,
    "content": {
        FORM: {
            "schema": {
                "type": "object",
                "required": ["query"],
                "properties": {
                    "query": {"$ref": "#/components/schemas/RingQuery"},
                    SOUNDS: _FILES | {"description": "The tooling on a string, tapped: one sound with several hits, or several."},
                    BARE_TOOL: _FILES | {"description": "The tool alone, tapped."},
                },
                "additionalProperties": False,
            },
            "encoding": {"query": {"contentType": JSON}},
        },
    },
}


@router.post(
    "/ring",
    summary="What the ring of a tooling tells of it: modes heard, the drawing before and after; nothing is stored",
    description="A form with the tooling and the sounds of a tap, as `rcsa-ident ring --json` answers them; any recording format. "
    "`PUT /v1/toolings/{name}` with `learned` takes what was learned over.",
    openapi_extra=guard("run", requestBody=_BODY, **{"x-content-types": (FORM,)}),
    responses=problems(404, *BODY),
)
async def ring(request: Request, components: ThisService, caller: WhoAsks) -> RingAnswer:
    refuse_encoded(request)
    with components.uploads.admitted(caller.group):
        await check_room(components, caller.group, announced_length(request))
        async with form(request, components, caller.group, ("query",), (SOUNDS, BARE_TOOL), several=True) as (texts, files):
            if "query" not in texts:
                fault = {"field": "query", "found": "nothing", "allowed": "a part of this name"}
                raise Problem(422, "the form has no part named query", [fault])
            if len(files) > MOST_SOUNDS:
                raise InputError(SOUNDS, f"{len(files)} files", f"at most {MOST_SOUNDS}")
            query = body_of(RingQuery, texts["query"])
            source = await run_in_threadpool(tooling_source, components, caller.group, query.tooling)
            asked = query.model_dump(exclude={"tooling"}) | {SOUNDS: _names(files, SOUNDS), BARE_TOOL: _names(files, BARE_TOOL)}
            paths = [*_paths(files, SOUNDS), *_paths(files, BARE_TOOL)]
            with storage_problems():
                found = await while_there(request, components.reader.run(reader_tasks.ring, source, asked, *paths))
    etag = digest_of(source.text) if isinstance(query.tooling, str) else None
    return RingAnswer.model_validate(found | {"etag": etag})


def _of(files: Mapping[str, tuple[str, Received]], field: str) -> list[tuple[str, Received]]:
    """Files of a field that came several times."""
    return [file for place, file in files.items() if place.partition("[")[0] == field]


def _names(files: Mapping[str, tuple[str, Received]], field: str) -> list[str]:
    return [checked_name(name, field) for name, _ in _of(files, field)]


def _paths(files: Mapping[str, tuple[str, Received]], field: str) -> list[Path]:
    return [received.path for _, received in _of(files, field)]
