"""Tool libraries that come in, and examples that go out."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from api.schemas.common import Answer


class ImportedTool(Answer):
    """An entry of a tool library."""

    name: str = Field(description="In the library here.")
    status: Literal["written", "skipped"]
    reason: str | None = Field(description="Why it was skipped.")
    assumed: list[str] = Field(description="What the tool library does not tell; the tooling file begins with it.")


class ImportAnswer(Answer):
    """What became of each entry."""

    items: list[ImportedTool]


class Example(Answer):
    """A file to start with."""

    name: str
    size_bytes: int
    about: str


class Examples(Answer):
    """All of them."""

    items: list[Example]
