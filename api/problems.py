"""Problem documents (RFC 9457): every error that a client sees, with the fields at fault; never the text of an unexpected exception."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from api.files import Full, no_room
from api.stores.entities import Damaged, NoRoom
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.validated_table import describe
from rcsa_ident.setup.fields import COEFFICIENTS

log = logging.getLogger("rcsa_ident.service")
MEDIA_TYPE = "application/problem+json"
_LONGEST = 200
#: The library's fields as the bodies call them.
_FIELDS = {
    "spindle_speed": "spindle_speed_rpm",
    "idle share": "idle_percent",
    "runout": "cut.runout_um",
    "tangential coefficient": "cut.ktc_mpa",
    "radial ratio": "cut.krc",
    **{each.name: f"cut.{each.key}" for each in COEFFICIENTS},
    "y_from and y_to": "cut.y_from_mm",
    "engagement map": "cut.engagement",
    "engagement map heights": "cut.engagement",
    "engagement map angles": "cut.engagement",
    "feed_per_tooth": "cut.feed_per_tooth_mm",
    "bore": "bore_mm",
    "mass": "mass_g",
    "holder length": "length_mm",
}
_TITLES = {413: "Content too large", 422: "Input not usable", 460: "Checksum mismatch"}


class Problem(Exception):
    """An error answer. `errors`: sequence of {field, found, allowed}."""

    def __init__(
        self, status: int, detail: str, errors: Sequence[Mapping[str, str]] = (), headers: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(detail)
        self.status, self.detail, self.errors, self.headers = status, detail, list(errors), dict(headers or {})


def title(status: int) -> str:
    """Return the short name of a status."""
    return _TITLES.get(status) or HTTPStatus(status).phrase


def document(request: Request, problem: Problem) -> JSONResponse:
    """Return a problem as the answer to a request."""
    return JSONResponse(content_of(problem, getattr(request.state, "request_id", "")), problem.status, problem.headers, MEDIA_TYPE)


def content_of(problem: Problem, request_id: str) -> dict[str, Any]:
    """Return the content of a problem document."""
    content: dict[str, Any] = {"type": "about:blank", "title": title(problem.status), "status": problem.status, "detail": problem.detail}
    if problem.errors:
        content["errors"] = problem.errors
    return content | {"request_id": request_id}


def of_input(error: InputError) -> Problem:
    """Return the problem of unusable input."""
    found = _short(error.found if isinstance(error.found, str) else describe(error.found))
    field = _FIELDS.get(error.field, error.field)
    return Problem(422, f"{field}: found {found}, allowed is {error.allowed}", [_entry(field, found, error.allowed)])


def of_room(error: NoRoom) -> Problem:
    """Return the problem of a group that keeps as much as it may."""
    detail = (
        f"the group keeps {error.used} bytes in the database, and may keep {error.allowed}: "
        "delete machines or campaigns that nobody needs any more (GET /v1/usage tells what takes the room)"
    )
    return Problem(413, detail, [_entry("group", f"{error.used} bytes", f"{error.allowed} bytes")])


def of_disk(error: Exception) -> Problem | None:
    """Return the problem of a disk that has too little room, None where an error says nothing of it."""
    if not (isinstance(error, Full) or no_room(error)):
        return None
    words = "the disk has too little free space left" if isinstance(error, Full) else "the disk is full"
    return Problem(503, words, headers={"Retry-After": "600"})


def of_validation(errors: Sequence[Any]) -> Problem:
    """Return the problem of a body, query or path that does not match its schema; long values are cut."""
    entries = []
    for error in errors[:20]:
        place = [str(part) for part in error["loc"] if part not in ("body", "query", "path", "header")]
        # for a union pydantic reports its own type names, which the client has not written
        name = ".".join(place) or str(error["loc"][0] if error["loc"] else "body")
        found = "nothing" if error["type"] == "missing" else _short(describe(error.get("input")))
        entries.append(_entry(name, found, error["msg"]))
    first = entries[0]
    return Problem(422, f"{first['field']}: found {first['found']}; {first['allowed']}", entries)


def _entry(field: str, found: str, allowed: str) -> dict[str, str]:
    return {"field": _short(field), "found": found, "allowed": allowed}


def _short(text: str) -> str:
    # a lone surrogate has no encoding in UTF-8
    text = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def _allowed(app: FastAPI, path: str) -> str:
    """Return all methods of a path; a route knows its own only."""
    matching = (item for known, item in app.openapi()["paths"].items() if re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", known), path))
    return ", ".join({method.upper() for item in matching for method in item})


def install(app: FastAPI) -> None:
    """Answer every foreseen exception with a problem document."""

    def known(request: Request, error: Exception) -> Response:
        assert isinstance(error, Problem)
        return document(request, error)

    def unusable(request: Request, error: Exception) -> Response:
        assert isinstance(error, InputError)
        return document(request, of_input(error))

    def damaged(request: Request, error: Exception) -> Response:
        assert isinstance(error, Damaged)
        log.error("damaged", extra={"fields": {"found": str(error)}})
        return document(request, Problem(500, str(error)))

    def full(request: Request, error: Exception) -> Response:
        assert isinstance(error, NoRoom)
        return document(request, of_room(error))

    def malformed(request: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return document(request, of_validation(error.errors()))

    def plain(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        words = {
            413: f"the body is too large: {error.detail}",
            400: "the body cannot be read",
            408: "the body arrives too slowly",
            404: "there is nothing at this path",
            405: "this path does not support the method",
        }
        detail = words.get(error.status_code, title(error.status_code))
        headers = dict(error.headers or {})
        if error.status_code == 405:
            methods = set((_allowed(app, request.url.path) or headers.get("Allow", "")).split(", "))
            headers["Allow"] = ", ".join(sorted(methods | ({"HEAD"} if "GET" in methods else set())))
        return document(request, Problem(error.status_code, detail, headers=headers))

    app.add_exception_handler(Problem, known)
    app.add_exception_handler(InputError, unusable)
    app.add_exception_handler(Damaged, damaged)
    app.add_exception_handler(NoRoom, full)
    app.add_exception_handler(RequestValidationError, malformed)
    app.add_exception_handler(HTTPException, plain)
