"""Authentication and authorisation: API keys, scopes, groups, rate limits and content types, checked before a body is read."""

from __future__ import annotations

import hashlib
import hmac
import math
import re
import secrets
from asyncio import sleep
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Annotated, Any
from urllib.parse import urlsplit

from fastapi import Depends, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.routing import APIRoute
from starlette.requests import HTTPConnection

from api.components import Components, components_of
from api.connections import network_of
from api.log_lines import tell
from api.problems import Problem
from api.shares import GROUP
from api.stores.changes import Note
from api.stores.entities import Key, Unavailable

SCOPES = ("read", "upload", "run", "admin")
HEADER = "X-API-Key"
JSON = "application/json"
#: Largest body in JSON that the service's own process parses: empty lists take sixty times their text [bytes].
MOST_JSON = 1_000_000
_ASK = {"WWW-Authenticate": "ApiKey"}
#: Group and key of all requests where no key is required.
LOCAL_GROUP = LOCAL_KEY = "local"
#: A key is PREFIX_ID_SECRET.
PREFIX = "ri"
#: Longest life of a key that expires [days], and how exactly its last use is known [s].
LONGEST, USED = 3650, 60.0
#: Wrong keys of an address that are answered at once: each minute, and in a burst.
WRONG_KEYS = (20, 20)
#: What a proxy adds to a request that it passes on: its own name, or where the request comes from, as X-Forwarded-For or CF-Connecting-IP.
_PASSED_ON = re.compile(r"via|.*forwarded.*|.*(client|connecting|real|remote|source|external)[-_]?(ip|ipv6|addr|address)")
_LOCAL_NAME = re.compile(r"(localhost|127\.0\.0\.1|\[::1\])(:\d{1,5})?", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Caller:
    """The caller of a route, known by an API key. `id`: of the key. `name`: of the key, as people call it."""

    id: str
    group: str
    scopes: tuple[str, ...]
    name: str

    def may(self, scope: str) -> bool:
        """Whether the caller has a scope; admin includes all others."""
        return scope in self.scopes or "admin" in self.scopes

    def note(self, why: str = "", restores: int = 0) -> Note:
        """Return what the caller leaves with a change."""
        return Note(self.id, self.name, why, restores)


def now() -> str:
    """Return the time in UTC as ISO 8601."""
    return _time(datetime.now(UTC))


def _time(when: datetime) -> str:
    return when.isoformat(timespec="milliseconds")


def seconds_between(first: str, last: str) -> float:
    """Return the time between two moments as `now` tells them [s]."""
    return (datetime.fromisoformat(last) - datetime.fromisoformat(first)).total_seconds()


def new_id() -> str:
    """Return a new id; later ids sort behind earlier ones."""
    return f"{int(datetime.now(UTC).timestamp() * 1e3):012x}{secrets.token_hex(6)}"


def make_key(group: str, scopes: tuple[str, ...], label: str, days: float | None = None) -> tuple[Key, str]:
    """Return a new key, which expires after so many days, and its text, which is stored nowhere."""
    # 256 random bits cannot be guessed: a plain hash is enough
    id, secret = new_id(), secrets.token_urlsafe(32)
    expires = None if days is None else _time(datetime.now(UTC) + timedelta(days=days))
    return Key(id, group, label, scopes, hash_of(secret), now(), expires), f"{PREFIX}_{id}_{secret}"


def hash_of(secret: str) -> str:
    """Return the hash of a secret, which is what the store keeps."""
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()


class WrongKey(Problem):
    """A key that nobody has."""


async def admitted(request: HTTPConnection, components: Components, given: str | None = None) -> Caller:
    """Return the caller as `caller_of` does; an address that sends many wrong keys waits for the answer to the next wrong one."""
    try:
        return await run_in_threadpool(caller_of, request, components, given)
    except WrongKey:
        # a right key is answered all the same: others may share the address
        seconds = components.wrong_keys.wait(network_of(request.client.host) if request.client is not None else "")
        if seconds <= 0.0:
            raise
        await sleep(seconds)
        raise Problem(429, "too many wrong API keys from this address", headers={"Retry-After": str(math.ceil(seconds))}) from None


def caller_of(request: HTTPConnection, components: Components, given: str | None = None) -> Caller:
    """Return the caller; without a key only where none is required.

    `given`: a key from elsewhere than the header, which a page cannot set on a WebSocket
    """
    text = request.headers.get(HEADER, "") or given or ""
    if not text and not components.settings.asks_for_keys:
        check_local(request)
        return Caller(LOCAL_KEY, LOCAL_GROUP, SCOPES, LOCAL_KEY)
    _, _, rest = text.partition("_")
    id, _, secret = rest.partition("_")
    key = components.store.keys.get(id) if text.startswith(f"{PREFIX}_") and id.isalnum() and id.isascii() and len(id) <= 64 else None
    # an unknown id takes as long as a wrong secret: no timing attack on ids
    kept = key.secret_hash if key is not None else hash_of("")
    if not hmac.compare_digest(hash_of(secret), kept) or key is None:
        kind = WrongKey if text else Problem
        raise kind(401, f"a valid API key is required in the header {HEADER}", headers=_ASK)
    if _expired(key):
        raise Problem(401, f"the API key has expired on {key.expires}", headers=_ASK)
    if key.used is None or datetime.now(UTC) - datetime.fromisoformat(key.used) > timedelta(seconds=USED):
        # who may read is answered although nobody can write at the moment
        with suppress(Unavailable):
            components.store.keys.use(key.id, now())
    return Caller(key.id, key.group, key.scopes, key.label or key.id)


def still_valid(components: Components, caller: Caller) -> bool:
    """Whether the caller's key has been neither withdrawn nor expired since."""
    if caller.id == LOCAL_KEY:
        return True
    key = components.store.keys.get(caller.id)
    return key is not None and not _expired(key)


def is_foreign(request: HTTPConnection) -> bool:
    """Whether a page of another origin sends the request."""
    origin, host = request.headers.get("origin"), request.headers.get("host", "")
    return origin is not None and (urlsplit(origin).scheme not in ("http", "https") or urlsplit(origin).netloc.lower() != host.lower())


def _expired(key: Key) -> bool:
    return key.expires is not None and key.expires <= now()


def check_local(request: HTTPConnection) -> None:
    """Refuse what does not come from this machine itself, where no key is required."""
    # DNS rebinding: a foreign page may reach loopback through a host name of its own
    if not _LOCAL_NAME.fullmatch(request.headers.get("host", "")):
        raise Problem(403, "without an API key the service answers on localhost only")
    # a browser sends a form anywhere without asking
    if is_foreign(request) or request.headers.get("sec-fetch-site", "").lower() == "cross-site":
        raise Problem(403, "without an API key the service answers no pages of another origin")
    passed_on = next((name for name in request.headers if _PASSED_ON.fullmatch(name)), None)
    if passed_on is not None:
        raise Problem(403, f"without an API key the service answers nothing that a proxy has passed on (found the header {passed_on})")


class Guarded(APIRoute):
    """Route that checks key, scope, rate and content type before it reads a body; OpenAPI has the scope as ``x-scope``."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        answer = super().get_route_handler()
        extra = self.openapi_extra or {}
        scope = extra["x-scope"]
        kinds = extra.get("x-content-types", (JSON,)) if self.body_field or "requestBody" in extra else ()

        async def handler(request: Request) -> Response:
            components = components_of(request)
            caller = await admitted(request, components)
            request.state.caller = caller
            GROUP.set(caller.group)
            tell(key=caller.id, group=caller.group)
            if not caller.may(scope):
                raise Problem(403, f"the API key does not have the scope {scope}")
            seconds = components.rates.wait(caller.id)
            if seconds > 0.0:
                raise Problem(429, "too many requests with this API key", headers={"Retry-After": str(math.ceil(seconds))})
            kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
            if kinds and kind not in kinds:
                raise Problem(415, f"found content type {kind[:80] or 'nothing'}, allowed is {' or '.join(kinds)}")
            if kind == JSON and extra.get("x-parsed-elsewhere") is None:
                request.state.body.limit(MOST_JSON)
            return await answer(request)

        return handler


def _caller(request: Request) -> Caller:
    caller: Caller = request.state.caller
    return caller


WhoAsks = Annotated[Caller, Depends(_caller)]
