"""What all routes of the interface have in common: parameters, documented answers, entity tags, pages of lists."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, TypeVar

from fastapi import Header, Path, Query, Request

from api.problems import MEDIA_TYPE, Problem, title
from api.schemas.common import ID_PATTERN, NAME_PATTERN
from api.stores.entities import ABSENT

Item = TypeVar("Item")
MachineId = Annotated[str, Path(pattern=ID_PATTERN, description="Id of a machine.")]
ToolingName = Annotated[str, Path(pattern=NAME_PATTERN, description="Name in the library.")]
CampaignId = Annotated[str, Path(pattern=ID_PATTERN, description="Id of a campaign.")]
KeyId = Annotated[str, Path(pattern=ID_PATTERN)]
After = Annotated[str, Query(pattern=r"^[A-Za-z0-9 ._+()-]{0,64}$", description="`next` of the part before.")]
Limit = Annotated[int, Query(ge=1, le=200, description="At most so many.")]
Repeat = Annotated[
    str | None,
    Header(alias="Idempotency-Key", pattern=r"^[\x21-\x7e]{1,128}$", description="The same again answers as the first time, for a day."),
]

_WHY = {
    400: "The body cannot be read.",
    401: "No key, or not a valid one.",
    403: "The key has not the scope.",
    404: "Nothing is there, or it is another group's.",
    408: "The body comes too slowly.",
    409: "The name, or the idempotency key with another body, is in use.",
    412: "What is there is not what If-Match or If-None-Match expects.",
    413: "The body is too large.",
    415: "The body is of another type.",
    422: "Something in the query is not usable; the fields are named.",
    429: "Too many requests with this key.",
    503: "Too much waits for an answer, or the store does not answer now.",
}
_ALWAYS = (401, 403, 429, 503)
#: What a body may meet.
BODY = (400, 408, 413, 415, 422)


def problems(*statuses: int, always: Sequence[int] = _ALWAYS) -> dict[int | str, dict[str, Any]]:
    """Return problem documents for OpenAPI, those that every guarded route may answer among them."""
    schema = {"$ref": "#/components/schemas/ProblemDocument"}
    found: dict[int | str, dict[str, Any]] = {}
    for status in sorted({*statuses, *always}):
        found[status] = {"description": f"{title(status)}. {_WHY[status]}", "content": {MEDIA_TYPE: {"schema": schema}}}
        if status in (429, 503):
            found[status]["headers"] = {"Retry-After": {"description": "Seconds.", "schema": {"type": "string"}}}
    return found


def guard(scope: str, **further: Any) -> dict[str, Any]:
    """Return what tells `Guarded`, and OpenAPI, which scope a route asks for."""
    return {"x-scope": scope, **further}


def tagged(digest: str) -> dict[str, str]:
    """Return the header that carries an entity tag."""
    return {"ETag": f'"{digest}"'}


def unchanged(request: Request, digest: str) -> bool:
    """Whether the client has said that it knows this very text."""
    tags = request.headers.get("if-none-match", "")
    return any(tag.strip().removeprefix("W/") in ("*", f'"{digest}"') for tag in tags.split(","))


def expected(request: Request, there: Callable[[], str | None]) -> str | None:
    """Return the digest that a writer expects: `ABSENT` with If-None-Match: *, None where it has not said.

    Parameters
    ----------
    there : callable
        The digest that is there, looked up for If-Match: * alone.
    """
    if request.headers.get("if-none-match", "").strip() == "*":
        return ABSENT
    tags = [tag.strip() for tag in request.headers.get("if-match", "").split(",") if tag.strip()]
    if not tags:
        return None
    if "*" in tags or len(tags) > 1:
        found = there()
        return found if found is not None and ("*" in tags or f'"{found}"' in tags) else "nothing that is there"
    return tags[0].strip('"')


def page(rows: Sequence[Item], limit: int, cursor: Callable[[Item], str]) -> tuple[Sequence[Item], str | None]:
    """Return at most `limit` of one row more than that, and where the next part begins."""
    return (rows[:limit], cursor(rows[limit - 1])) if len(rows) > limit else (rows, None)


def found_or_404(thing: Item | None, what: str) -> Item:
    """Return a thing that is there."""
    if thing is None:
        raise Problem(404, f"there is no such {what}")
    return thing


def utf8(raw: bytes) -> str:
    """Return a body as text."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise Problem(422, f"line {line} of the body is not UTF-8", [{"field": "body", "found": "no UTF-8", "allowed": "UTF-8"}]) from None
