"""What is kept under a name as a file's text, toolings and robots alike: written, read and forgotten in one way."""

from __future__ import annotations

from collections.abc import Callable

from fastapi import Request, Response

from api.conventions import expected, found_or_404, tagged, unchanged, utf8
from api.problems import Problem
from api.schemas.common import Answer, Body, body_of
from api.stores.changes import Note
from api.stores.entities import Document, Documents, Stale
from rcsa_ident.io.toml_text import toml_of

TOML, JSON = "application/toml", "application/json"


def text_of_body(request: Request, raw: bytes, keys: type[Body], largest: int, what: str) -> str:
    """Return a file's text from a body that holds it, or its keys as JSON.

    `raw`: the body
    `keys`: of the file
    `largest`: bytes at most
    `what`: it is, for the message
    """
    if len(raw) > largest:
        raise Problem(413, f"a {what} has at most {largest // 1000} kB")
    if request.headers["content-type"].split(";")[0].strip().lower() == TOML:
        return utf8(raw)
    return toml_of(body_of(keys, raw).model_dump(exclude_unset=True, exclude_none=True))


def keep(kept: Documents, document: Document, request: Request, response: Response, note: Note, what: str) -> None:
    """Write a document unless somebody else has been there: 201 where there was none before, 412 where it is not the expected one."""
    try:
        new = kept.put(document, _expected(kept, document.group, document.name, request), note)
    except Stale:
        raise _other(what) from None
    response.status_code = 201 if new else 200
    response.headers.update(tagged(document.digest))


def show(kept: Documents, group: str, name: str, request: Request, what: str, answer: Callable[[Document], Answer]) -> Response:
    """Return a document as JSON, or as its text where that is asked for; 304 where it is known."""
    document = found_or_404(kept.get(group, name), what)
    headers = tagged(document.digest) | {"Vary": "Accept"}
    if unchanged(request, document.digest):
        return Response(status_code=304, headers=headers)
    if TOML in request.headers.get("accept", ""):
        return Response(document.text.encode(), media_type=TOML, headers=headers)
    return Response(answer(document).model_dump_json(), media_type=JSON, headers=headers)


def forget(kept: Documents, group: str, name: str, request: Request, note: Note, what: str) -> Response:
    """Delete a document: 204, 404 where there is none, 412 where it is not the expected one."""
    try:
        there = kept.delete(group, name, _expected(kept, group, name, request), note)
    except Stale:
        raise _other(what) from None
    if not there:
        raise Problem(404, f"there is no such {what}")
    return Response(status_code=204)


def _expected(kept: Documents, group: str, name: str, request: Request) -> str | None:
    return expected(request, lambda: getattr(kept.brief(group, name), "digest", None))


def _other(what: str) -> Problem:
    return Problem(412, f"the {what} is not the one that the query expects")
