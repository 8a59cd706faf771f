"""Access log, metrics and limits: one line and one count per request, under an id that the answer carries, too; errors never leak."""

from __future__ import annotations

import asyncio
import logging
import re
import secrets
import time
from contextlib import suppress
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.auto import AutoHTTPProtocol

from api.components import Components
from api.log_lines import tell
from api.problems import Problem, document, of_disk
from api.stores.entities import Destroyed, Unavailable
from api.work.pool import Busy

log = logging.getLogger("rcsa_ident.service")
_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
RETRY = {"Retry-After": "2"}
#: Of a body that nobody will read, what is dropped after the answer [bytes, s].
DROPPED, DROP_SECONDS = 1_000_000, 1.0
#: Time limit of a body that is not an upload [s], its extension per received byte [s], and time limit [s] and size of a request's head.
BODY_SECONDS, BYTE_SECONDS, HEAD_SECONDS, HEAD_BYTES = 60.0, 1e-4, 20.0, 262_144
#: Time limit of an answer that its client does not read [s], extended by `BYTE_SECONDS` for each byte that waits.
UNREAD_SECONDS = 120.0


class AccessMonitor:
    """Middleware around the whole service: request ids, size and time limits of bodies, access log and metrics."""

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
        tell(request_id=id)
        status, start = 0, time.perf_counter()
        # routes that stream uploads to the disk raise this limit
        request.state.body = body = _Body(request, receive, self.components.settings.max_body_bytes)

        async def observed(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                extra = [(b"x-request-id", id.encode()), (b"x-content-type-options", b"nosniff")]
                if not any(name.lower() == b"cache-control" for name, _ in message.get("headers", [])):
                    # answers hold what belongs to a group: neither a proxy nor a browser keeps them
                    extra.append((b"cache-control", b"no-store"))
                if scope["scheme"] == "https":
                    extra.append((b"strict-transport-security", b"max-age=31536000"))
                if not body.read:
                    # the rest of a body that nobody will read need not be sent
                    extra.append((b"connection", b"close"))
                message = {**message, "headers": [*message.get("headers", []), *extra]}
            if message["type"] != "http.response.body" or message.get("more_body", False) or body.read:
                await send(message)
                return
            # the whole answer, and only then its end, with which the connection is closed
            await send({**message, "more_body": True})
            await body.drop()
            await send({"type": "http.response.body", "body": b""})

        try:
            await self.app(scope, body.receive, observed)
        except asyncio.CancelledError:
            # the server ends, and gives up what still runs
            if status == 0:
                await document(request, Problem(503, "the service is shutting down", headers=RETRY))(scope, receive, observed)
        except Exception as error:
            problem = _problem(error)
            if not isinstance(error, Busy):
                # who is refused because others are there already leaves one line, that of the request
                log.error("unexpected" if problem.status == 500 else "unavailable", exc_info=error)
            if status == 0:
                await document(request, problem)(scope, receive, observed)
        finally:
            self._record(scope, status, time.perf_counter() - start)

    def _record(self, scope: Scope, status: int, seconds: float) -> None:
        # the pattern, not the path: every id would make a counter of its own
        route = getattr(scope.get("route"), "path", "unknown")
        method = scope["method"] if scope["method"] in ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS") else "other"
        self.components.metrics.requests.labels(method, route, str(status)).inc()
        self.components.metrics.seconds.labels(method, route).observe(seconds)
        fields = {"method": method, "route": route, "status": status, "seconds": round(seconds, 6)}
        log.info("request", extra={"fields": fields})


class _Body:
    """A request's body with limits of size and time, whether its length is declared or not."""

    def __init__(self, request: Request, receive: Receive, most: int) -> None:
        self.source, self.most, self.seen = receive, most, 0
        self.usual, self.start = most, time.monotonic()
        text = request.headers.get("content-length", "")
        self.declared = int(text[:20]) if text.isdecimal() and text.isascii() else 0
        self.read = self.declared == 0 and "transfer-encoding" not in request.headers

    def limit(self, most: int) -> None:
        """Allow no more than this, whatever the settings say."""
        self.most = self.usual = min(self.usual, most)

    async def receive(self) -> Message:
        """Return the next part of the body; raises 413 beyond the limit and 408 where it arrives too slowly."""
        if self.declared <= self.most:
            message = await self._in_time()
            self.seen += len(message.get("body", b""))
            if self.seen <= self.most:
                self.read = self.read or not message.get("more_body", False)
                return message
        raise HTTPException(413, f"at most {self.most} bytes")

    async def drop(self) -> None:
        """Read what a client still sends, for a short time: a connection that is closed over unread bytes takes the answer with it."""
        left = DROPPED
        with suppress(TimeoutError):
            async with asyncio.timeout(DROP_SECONDS):
                while left > 0 and not self.read:
                    message = await self.source()
                    left -= len(message.get("body", b""))
                    self.read = not message.get("more_body", False)

    async def _in_time(self) -> Message:
        """The next part within the time limit; routes that raise the size limit have a time limit of their own."""
        if self.read or self.most != self.usual:
            return await self.source()
        try:
            async with asyncio.timeout(self.start + BODY_SECONDS + BYTE_SECONDS * self.seen - time.monotonic()):
                return await self.source()
        except TimeoutError:
            raise HTTPException(408, "too slow") from None


class TimedHeadProtocol(AutoHTTPProtocol):  # type: ignore[misc, valid-type]
    """HTTP connection that is closed when the head of a request takes too long or grows too large, or its answer is read too slowly."""

    seconds, most, unread_seconds = HEAD_SECONDS, HEAD_BYTES, UNREAD_SECONDS
    unread: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self.waiting, self.came = self.loop.call_later(self.seconds, self._over), 0

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.cycle is not None and not self.cycle.response_complete:
            # the head is complete
            self.waiting.cancel()
            self.came = 0
            return
        self.came += len(data)
        if self.came > self.most:
            self.transport.close()
        elif self.waiting.cancelled():
            self.waiting = self.loop.call_later(self.seconds, self._over)

    def _over(self) -> None:
        # unless the connection has become a WebSocket
        if self.transport.get_protocol() is self:
            self.transport.close()

    def pause_writing(self) -> None:
        # until the client has read, memory holds the answer
        seconds = self.unread_seconds + BYTE_SECONDS * self.transport.get_write_buffer_size()
        self.unread = self.loop.call_later(seconds, self._too_slow)
        super().pause_writing()

    def resume_writing(self) -> None:
        self._forget_unread()
        super().resume_writing()

    def _too_slow(self) -> None:
        if self.transport.get_protocol() is self:
            # closing would wait for the client to read the rest
            self.transport.abort()

    def _forget_unread(self) -> None:
        if self.unread is not None:
            self.unread.cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        self.waiting.cancel()
        self._forget_unread()
        super().connection_lost(exc)


def _problem(error: Exception) -> Problem:
    if isinstance(error, Destroyed):
        words = "the database is damaged, and nothing more is written to it: whoever runs the service restores a backup"
        return Problem(503, words, headers={"Retry-After": "600"})
    if isinstance(error, Unavailable):
        return Problem(503, "the database does not answer", headers=RETRY)
    if isinstance(error, Busy):
        return Problem(503, "too many queries are waiting for an answer", headers=RETRY)
    return of_disk(error) or Problem(500, "an internal error occurred; it is logged under this request's id")
