"""Keys."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict, Field

from api.schemas.common import Answer, Body, Line

Scope = Literal["read", "upload", "run", "admin"]


class NewKey(Body):
    """A key to make."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"label": "presetting", "scopes": ["read", "run"]}]})

    label: Line = Field("", description="What it is for.")
    scopes: list[Scope] = Field(min_length=1, max_length=4, description="What it may do; admin may do everything in its group.")


class KeyAnswer(Answer):
    """A key without its secret."""

    id: str
    group: str
    label: str
    scopes: list[Scope]
    created: str = Field(description="UTC, ISO 8601.")


class MadeKey(KeyAnswer):
    """A key as it is told once."""

    key: str = Field(description="Send it as X-API-Key. It is not kept, and not told again.")
