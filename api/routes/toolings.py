"""The library of toolings: tooling files, or their keys as JSON."""

from __future__ import annotations

import json
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from api import kept_documents
from api.components import ThisService
from api.conventions import BODY, After, Limit, ToolingName, Why, found_or_404, guard, page, problems, tagged, unchanged
from api.kept_documents import JSON, TOML, text_of_body
from api.schemas.common import Page
from api.schemas.toolings import EXAMPLE, ToolingAnswer, ToolingKeys, ToolingSummary
from api.security import Guarded, WhoAsks, now
from api.stores.entities import Document, digest_of, summary_of
from api.work.toolings import LARGEST, parsed, summary, tooling_of
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.report.drawing import tooling_svg

router = APIRouter(prefix="/toolings", tags=["toolings"], route_class=Guarded)
SVG = "image/svg+xml"
#: Opened as a page of its own a drawing runs nothing and loads nothing.
_ALONE = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'"}
TOOLING_BODY = {
    "required": True,
    "content": {
        JSON: {"schema": {"$ref": "#/components/schemas/ToolingKeys"}, "example": EXAMPLE},
        TOML: {"schema": {"type": "string"}, "example": toml_of(EXAMPLE)},
    },
}


@router.put(
    "/{name}",
    summary="Write a tooling",
    description="If-Match or If-None-Match: * keep what somebody else has written meanwhile. What is replaced stays as a version.",
    openapi_extra=guard("upload", requestBody=TOOLING_BODY, **{"x-content-types": (JSON, TOML)}),
    responses={201: {"model": ToolingAnswer, "description": "There was none before."}, **problems(412, *BODY)},
)
async def write(
    name: ToolingName, request: Request, response: Response, parts: ThisService, caller: WhoAsks, why: Why = ""
) -> ToolingAnswer:
    raw = await request.body()

    def keep() -> Document:
        text = tooling_text(request, raw)
        document = Document(caller.group, name, text, json.dumps(summary(text)), digest_of(text), now())
        kept_documents.keep(parts.store.toolings, document, request, response, caller.note(why), "tooling")
        return document

    return answer_of(await run_in_threadpool(keep))


@router.get("", summary="List toolings", openapi_extra=guard("read"), responses=problems(422))
def list_toolings(parts: ThisService, caller: WhoAsks, after: After = "", limit: Limit = 50) -> Page[ToolingSummary]:
    rows, following = page(parts.store.toolings.list(caller.group, after, limit + 1), limit, lambda row: row.name)
    return Page(
        items=[ToolingSummary(name=row.name, changed=row.changed, etag=row.digest, **summary_of(row)) for row in rows],
        next=following,
    )


@router.get(
    "/{name}",
    summary="A tooling, as JSON or as the tooling file (Accept: application/toml)",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={
        200: {"model": ToolingAnswer, "description": "A tooling.", "content": {TOML: {"schema": {"type": "string"}}}},
        304: {"description": "If-None-Match names it."},
        **problems(404, 422),
    },
)
def get(name: ToolingName, request: Request, parts: ThisService, caller: WhoAsks) -> Response:
    return kept_documents.show(parts.store.toolings, caller.group, name, request, "tooling", answer_of)


@router.get(
    "/{name}/drawing",
    summary="A tooling to scale, SVG in millimetres",
    openapi_extra=guard("read"),
    response_class=Response,
    responses={
        200: {"description": "A drawing.", "content": {SVG: {"schema": {"type": "string"}}}},
        304: {"description": "If-None-Match names it."},
        **problems(404, 422),
    },
)
def drawing(
    name: ToolingName,
    request: Request,
    parts: ThisService,
    caller: WhoAsks,
    brief: Annotated[bool, Query(description="As small as a stamp: with the stickout as its only words.")] = False,
) -> Response:
    document = found_or_404(parts.store.toolings.get(caller.group, name), "tooling")
    if unchanged(request, document.digest):
        return Response(status_code=304, headers=tagged(document.digest))
    headers = tagged(document.digest) | _ALONE
    return Response(tooling_svg(tooling_of(document.text), brief), media_type=SVG, headers=headers)


@router.post(
    "/drawing",
    summary="A tooling that is in no library, to scale: SVG in millimetres",
    openapi_extra=guard("read", requestBody=TOOLING_BODY, **{"x-content-types": (JSON, TOML)}),
    response_class=Response,
    responses={200: {"description": "A drawing.", "content": {SVG: {"schema": {"type": "string"}}}}, **problems(*BODY)},
)
async def draw(request: Request) -> Response:
    raw = await request.body()

    def drawn() -> str:
        return tooling_svg(tooling_of(tooling_text(request, raw)))

    return Response(await run_in_threadpool(drawn), media_type=SVG, headers=_ALONE)


@router.delete("/{name}", status_code=204, summary="Forget a tooling", openapi_extra=guard("upload"), responses=problems(404, 412, 422))
def forget(name: ToolingName, request: Request, parts: ThisService, caller: WhoAsks, why: Why = "") -> Response:
    return kept_documents.forget(parts.store.toolings, caller.group, name, request, caller.note(why), "tooling")


def tooling_text(request: Request, raw: bytes) -> str:
    """Return the text of a tooling file from a body in TOML or JSON."""
    return text_of_body(request, raw, ToolingKeys, LARGEST, "tooling")


def answer_of(document: Document) -> ToolingAnswer:
    """Return a tooling as clients see it."""
    keys = ToolingKeys.model_validate(parsed(document.text))
    return ToolingAnswer(name=document.name, tooling=keys, changed=document.changed, etag=document.digest)
