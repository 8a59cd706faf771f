"""Authentication and authorisation: API keys, scopes, groups, rate limits and content types, checked before a body is read."""

from __future__ import annotations

import hashlib
import hmac
import math
import re
import secrets
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import Depends, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.routing import APIRoute
from starlette.requests import HTTPConnection

from api.components import Components, components_of
from api.problems import Problem
from api.stores.changes import Note
from api.stores.entities import Key

SCOPES = ("read", "upload", "run", "admin")
HEADER = "X-API-Key"
#: Group and key of all requests where no key is required.
LOCAL_GROUP = LOCAL_KEY = "local"
#: A key is PREFIX_ID_SECRET.
PREFIX = "ri"
_LOCAL_NAME = re.compile(r"(localhost|127\.0\.0\.1|\[::1\])(:\d{1,5})?", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Caller:
    """The caller of a route, known by an API key.

    Parameters
    ----------
    id : str
        Of the key.
    group : str
    scopes : tuple of str
    name : str
        Of the key, as people call it.
    """

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
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def new_id() -> str:
    """Return a new id; later ids sort behind earlier ones."""
    return f"{int(datetime.now(UTC).timestamp() * 1e3):012x}{secrets.token_hex(6)}"


def make_key(group: str, scopes: tuple[str, ...], label: str) -> tuple[Key, str]:
    """Return a new key and its text, which is stored nowhere."""
    # 256 random bits cannot be guessed: a plain hash is enough
    id, secret = new_id(), secrets.token_urlsafe(32)
    return Key(id, group, label, scopes, hash_of(secret), now()), f"{PREFIX}_{id}_{secret}"


def hash_of(secret: str) -> str:
    """Return the hash of a secret, which is what the store keeps."""
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()


def caller_of(request: HTTPConnection, components: Components, given: str | None = None) -> Caller:
    """Return the caller; without a key only where none is required.

    Parameters
    ----------
    given : str, optional
        A key from elsewhere than the header, which a page cannot set on a WebSocket.
    """
    text = request.headers.get(HEADER, "") or given or ""
    if not text and not components.settings.asks_for_keys:
        # DNS rebinding: a foreign page may reach loopback through a host name of its own
        if not _LOCAL_NAME.fullmatch(request.headers.get("host", "")):
            raise Problem(403, "without an API key the service answers on localhost only")
        return Caller(LOCAL_KEY, LOCAL_GROUP, SCOPES, LOCAL_KEY)
    _, _, rest = text.partition("_")
    id, _, secret = rest.partition("_")
    key = components.store.keys.get(id) if text.startswith(f"{PREFIX}_") and id.isalnum() and id.isascii() and len(id) <= 64 else None
    # an unknown id takes as long as a wrong secret: no timing attack on ids
    kept = key.secret_hash if key is not None else hash_of("")
    if not hmac.compare_digest(hash_of(secret), kept) or key is None:
        raise Problem(401, f"a valid API key is required in the header {HEADER}", headers={"WWW-Authenticate": "ApiKey"})
    return Caller(key.id, key.group, key.scopes, key.label or key.id)


class Guarded(APIRoute):
    """Route that checks key, scope, rate and content type before it reads a body; OpenAPI has the scope as ``x-scope``."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        answer = super().get_route_handler()
        extra = self.openapi_extra or {}
        scope = extra["x-scope"]
        kinds = extra.get("x-content-types", ("application/json",)) if self.body_field or "requestBody" in extra else ()

        async def handler(request: Request) -> Response:
            components = components_of(request)
            caller = await run_in_threadpool(caller_of, request, components)
            request.state.caller = caller
            if not caller.may(scope):
                raise Problem(403, f"the API key does not have the scope {scope}")
            seconds = components.rates.wait(caller.id)
            if seconds > 0.0:
                raise Problem(429, "too many requests with this API key", headers={"Retry-After": str(math.ceil(seconds))})
            kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
            if kinds and kind not in kinds:
                raise Problem(415, f"found content type {kind[:80] or 'nothing'}, allowed is {' or '.join(kinds)}")
            return await answer(request)

        return handler


def _caller(request: Request) -> Caller:
    caller: Caller = request.state.caller
    return caller


WhoAsks = Annotated[Caller, Depends(_caller)]
