"""One line of log and one count for each request, under an id that the answer carries, too; nothing unexpected leaves the service."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import secrets
import time
from datetime import UTC, datetime
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.auto import AutoHTTPProtocol

from api.components import Components
from api.problems import Problem, document
from api.stores.entities import Unavailable
from api.work.pool import Busy

log = logging.getLogger("rcsa_ident.service")
_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
RETRY = {"Retry-After": "2"}
#: Time for a body that is no upload [s], what more it gets for each byte that has come, and for a request's head [s]; bytes of a head.
BODY_SECONDS, BYTE_SECONDS, HEAD_SECONDS, HEAD_BYTES = 60.0, 1e-4, 20.0, 262_144


class AccessMonitor:
    """The outermost layer of the service."""

    def __init__(self, app: ASGIApp, components: Components) -> None:
        self.app, self.components = app, components

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request = Request(scope)
        given = request.headers.get("x-request-id", "")
        id = given if _ID.fullmatch(given) else secrets.token_hex(8)
        request.state.request_id = id
        status, start = 0, time.perf_counter()
        # routes that stream to the disk let more in
        request.state.body = body = _Body(request, receive, self.components.settings.max_body_bytes)

        async def observed(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                extra = [(b"x-request-id", id.encode()), (b"x-content-type-options", b"nosniff")]
                if not body.read:
                    # what nobody will read any more need not be sent, least of all if it has no end
                    extra.append((b"connection", b"close"))
                message = {**message, "headers": [*message.get("headers", []), *extra]}
            await send(message)

        try:
            await self.app(scope, body.receive, observed)
        except Exception as error:
            problem = _problem(error)
            log.error("unexpected" if problem.status == 500 else "unavailable", exc_info=error, extra={"fields": {"request_id": id}})
            if status == 0:
                await document(request, problem)(scope, receive, observed)
        finally:
            self._record(scope, id, status, time.perf_counter() - start)

    def _record(self, scope: Scope, id: str, status: int, seconds: float) -> None:
        # the pattern, not the path: ids would make a counter each
        route = getattr(scope.get("route"), "path", "unknown")
        method = scope["method"] if scope["method"] in ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS") else "other"
        self.components.metrics.requests.labels(method, route, str(status)).inc()
        self.components.metrics.seconds.labels(method, route).observe(seconds)
        caller = scope.get("state", {}).get("caller")
        fields = {"request_id": id, "method": method, "route": route, "status": status, "seconds": round(seconds, 6)}
        log.info("request", extra={"fields": fields | ({} if caller is None else {"key": caller.id, "group": caller.group})})


class _Body:
    """A request's body, of which no more is let in than is allowed, whether its length is told before or not."""

    def __init__(self, request: Request, receive: Receive, most: int) -> None:
        self.source, self.most, self.seen = receive, most, 0
        self.usual, self.start = most, time.monotonic()
        text = request.headers.get("content-length", "")
        self.declared = int(text[:20]) if text.isdecimal() and text.isascii() else 0
        self.read = self.declared == 0 and "transfer-encoding" not in request.headers

    async def receive(self) -> Message:
        """Return the next part."""
        if self.declared <= self.most:
            message = await self._in_time()
            self.seen += len(message.get("body", b""))
            if self.seen <= self.most:
                self.read = self.read or not message.get("more_body", False)
                return message
        raise HTTPException(413, f"at most {self.most} bytes")

    async def _in_time(self) -> Message:
        """The next part, if it does not keep everybody waiting; those who let more in look at the clock themselves."""
        if self.read or self.most != self.usual:
            return await self.source()
        try:
            async with asyncio.timeout(self.start + BODY_SECONDS + BYTE_SECONDS * self.seen - time.monotonic()):
                return await self.source()
        except TimeoutError:
            raise HTTPException(408, "too slow") from None


class TimedHeadProtocol(AutoHTTPProtocol):  # type: ignore[misc, valid-type]
    """A connection that is closed if the head of a request does not come in time, or does not end."""

    seconds, most = HEAD_SECONDS, HEAD_BYTES

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self.waiting, self.came = self.loop.call_later(self.seconds, self._over), 0

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.cycle is not None and not self.cycle.response_complete:
            # a head has come to its end
            self.waiting.cancel()
            self.came = 0
            return
        self.came += len(data)
        if self.came > self.most:
            self.transport.close()
        elif self.waiting.cancelled():
            self.waiting = self.loop.call_later(self.seconds, self._over)

    def _over(self) -> None:
        # unless it has become a WebSocket
        if self.transport.get_protocol() is self:
            self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self.waiting.cancel()
        super().connection_lost(exc)


def _problem(error: Exception) -> Problem:
    if isinstance(error, Unavailable):
        return Problem(503, "the store does not answer now", headers=RETRY)
    if isinstance(error, Busy):
        return Problem(503, "too many questions wait for an answer", headers=RETRY)
    return Problem(500, "something unexpected happened; the log has it under this request's id")


class JsonLines(logging.Formatter):
    """A record as one line of JSON."""

    def format(self, record: logging.LogRecord) -> str:
        line: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "event": record.getMessage(),
        }
        line |= getattr(record, "fields", {})
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False, default=str)
