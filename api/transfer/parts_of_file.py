"""A file, or the parts of it that a client asks for."""

from __future__ import annotations

from fastapi import Request
from fastapi.responses import FileResponse
from starlette.types import Message, Receive, Scope, Send

from api.problems import Problem, document

_WHY = {400: "the header Range cannot be read", 416: "the file ends before the part that Range asks for"}


class PartsOfFile(FileResponse):
    """Starlette's answer with Range and If-Range, whose refusals are problem documents."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        refused: Problem | None = None

        async def told(message: Message) -> None:
            nonlocal refused
            if message["type"] == "http.response.start" and message["status"] in _WHY:
                kept = {name.decode(): value.decode() for name, value in message["headers"] if name == b"content-range"}
                refused = Problem(message["status"], _WHY[message["status"]], headers=kept)
                await document(Request(scope), refused)(scope, receive, send)
            elif refused is None:
                await send(message)

        await super().__call__(scope, receive, told)
