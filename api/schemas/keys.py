"""API keys."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body, Line

Scope = Literal["read", "upload", "run", "admin"]


class NewKey(Body):
    """A key to make."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"label": "presetting", "scopes": ["read", "run"]}]})

    label: Line = Field("", description="Purpose of the key.")
    scopes: list[Scope] = Field(min_length=1, max_length=4, description="Scopes of the key; admin includes all others.")
    expires_in_days: float | None = Field(None, gt=0.0, le=3650.0, description="After which it opens nothing; without, it lasts.")


class KeyAnswer(Answer):
    """A key without its secret."""

    id: str
    group: str
    label: str
    scopes: list[Scope]
    created: str = Field(description="UTC, ISO 8601.")
    expires: str | None = Field(description="null where it lasts until it is revoked.")
    used: str | None = Field(description="When it was last used, to the minute; null where it never was.")


class MadeKey(KeyAnswer):
    """A new key with its text, which is shown once."""

    key: str = Field(description="To be sent as X-API-Key. It is not stored, and not shown again.")
