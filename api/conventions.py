"""What all routes of the interface have in common: parameters, documented answers, entity tags, pages of lists."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import Annotated, Any, ClassVar, TypeVar

from fastapi import Header, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute

from api.problems import MEDIA_TYPE, Problem, of_input, of_validation, title
from api.schemas.common import ID_PATTERN, NAME_PATTERN
from api.stores.entities import ABSENT, Taken
from rcsa_ident.base.errors import InputError

Item = TypeVar("Item")
MachineId = Annotated[str, Path(pattern=ID_PATTERN, description="Id of a machine.")]
ToolingName = Annotated[str, Path(pattern=NAME_PATTERN, description="Name in the library.")]
CampaignId = Annotated[str, Path(pattern=ID_PATTERN, description="Id of a campaign.")]
KeyId = Annotated[str, Path(pattern=ID_PATTERN)]
After = Annotated[str, Query(pattern=r"^[A-Za-z0-9 ._+()-]{0,64}$", description="`next` of the previous page.")]
Limit = Annotated[int, Query(ge=1, le=200, description="Largest number of items.")]
Why = Annotated[
    str, Query(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$", description="Reason of the change, for those who read its trail.")
]
Repeat = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        pattern=r"^[\x21-\x7e]{1,128}$",
        description="A repeated request with this key gets the first answer, for a day.",
    ),
]

_WHY = {
    400: "The body cannot be read.",
    401: "There is no valid API key.",
    403: "The API key does not have the scope.",
    404: "It does not exist, or belongs to another group.",
    408: "The body arrives too slowly.",
    409: "The name, or the idempotency key with another body, is already in use.",
    410: "Another request has given the upload up meanwhile; none of its bytes is kept.",
    412: "The stored content does not match If-Match or If-None-Match.",
    413: "The body is too large, or the group has no room left for it.",
    415: "The body is of another type.",
    416: "The file ends before the part that Range asks for.",
    422: "The input is not usable; the fields at fault are named.",
    429: "There are too many requests with this API key.",
    460: "The bytes of the part do not have the announced checksum; none of them is kept.",
    500: "What is stored is damaged; the sentence says how it becomes whole again.",
    503: "Too many queries are waiting for an answer, the database does not answer, or the disk is full.",
}
_ALWAYS = (401, 403, 429, 503)
#: Statuses of routes with a body.
BODY = (400, 408, 413, 415, 422)


def problems(*statuses: int, always: Sequence[int] = _ALWAYS) -> dict[int | str, dict[str, Any]]:
    """Return the problem documents of a route for OpenAPI, including those of every guarded route."""
    schema = {"$ref": "#/components/schemas/ProblemDocument"}
    found: dict[int | str, dict[str, Any]] = {}
    for status in sorted({*statuses, *always}):
        found[status] = {"description": f"{title(status)}. {_WHY[status]}", "content": {MEDIA_TYPE: {"schema": schema}}}
        if status in (429, 503):
            found[status]["headers"] = {"Retry-After": {"description": "Seconds.", "schema": {"type": "string"}}}
    return found


def guard(scope: str, **further: Any) -> dict[str, Any]:
    """Return the OpenAPI extra that names the scope a route requires; `Guarded` reads it."""
    return {"x-scope": scope, **further}


class Telling(APIRoute):
    """Route whose answers all have further headers, problems too."""

    headers: ClassVar[Mapping[str, str]]

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler of a request."""
        inner = super().get_route_handler()

        async def handler(request: Request) -> Response:
            try:
                answer = await inner(request)
            except (InputError, RequestValidationError, Problem) as error:
                if isinstance(error, InputError):
                    problem = of_input(error)
                else:
                    problem = error if isinstance(error, Problem) else of_validation(error.errors())
                problem.headers.update(self.headers)
                raise problem from None
            answer.headers.update(self.headers)
            return answer

        return handler


def tagged(digest: str) -> dict[str, str]:
    """Return the header that carries an entity tag."""
    return {"ETag": f'"{digest}"'}


def unchanged(request: Request, digest: str) -> bool:
    """Whether If-None-Match contains this digest."""
    tags = request.headers.get("if-none-match", "")
    return any(tag.strip().removeprefix("W/") in ("*", f'"{digest}"') for tag in tags.split(","))


def expected(request: Request, there: Callable[[], str | None]) -> str | None:
    """Return the digest that a conditional write expects: `ABSENT` with If-None-Match: *, None without a condition.

    `there`: returns the current digest; called for If-Match: * only
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
    """Return at most `limit` of `limit + 1` rows, and the cursor of the next page."""
    return (rows[:limit], cursor(rows[limit - 1])) if len(rows) > limit else (rows, None)


def found_or_404(thing: Item | None, what: str) -> Item:
    """Return a thing that exists, else answer 404."""
    if thing is None:
        raise Problem(404, f"there is no such {what}")
    return thing


def in_use(taken: Taken, name: str | None, repeat: str | None) -> Problem:
    """Return the problem of a name, or an idempotency key, that is already in use."""
    what = str(taken)
    found = str(name if what == "name" else repeat)
    return Problem(409, f"the {what} is already in use", [{"field": what, "found": found, "allowed": f"another {what}"}])


async def while_there(request: Request, answer: Coroutine[Any, Any, Item]) -> Item:
    """Return an answer, which is given up as soon as the client of the request has left.

    `request`: whose body has been read
    `answer`: coroutine
    """

    async def leaving() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    asked, left = asyncio.ensure_future(answer), asyncio.ensure_future(leaving())
    try:
        await asyncio.wait((asked, left), return_when=asyncio.FIRST_COMPLETED)
        if not asked.done():
            raise Problem(400, "the client has disconnected")
        return asked.result()
    finally:
        for each in (asked, left):
            each.cancel()
        await asyncio.gather(asked, left, return_exceptions=True)


def utf8(raw: bytes) -> str:
    """Return a body as text, else answer 422."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise Problem(422, f"line {line} of the body is not UTF-8", [{"field": "body", "found": "no UTF-8", "allowed": "UTF-8"}]) from None
