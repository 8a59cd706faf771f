"""Imports of tool libraries, and examples."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from api.schemas.common import Answer


class ImportedTool(Answer):
    """An entry of a tool library."""

    name: str = Field(description="Name in the library of toolings.")
    status: Literal["written", "skipped"]
    reason: str | None = Field(description="Why it was skipped.")
    assumed: list[str] = Field(description="Assumptions about data missing in the tool library, which begin the tooling file.")


class ImportAnswer(Answer):
    """Outcome of each entry."""

    items: list[ImportedTool]


class Example(Answer):
    """An example file."""

    name: str
    size_bytes: int
    about: str


class ExampleCampaign(Answer):
    """The example of a group."""

    machine: str = Field(description="Its id.")
    campaign: str = Field(description="Its id.")


class Examples(Answer):
    """All examples."""

    items: list[Example]
