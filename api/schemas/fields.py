"""Keys that are declared once, as the page asks for them."""

from __future__ import annotations

from pydantic import Field

from api.schemas.common import Answer


class FieldAnswer(Answer):
    """A key of a noun: what may stand there, and what is said of it."""

    key: str
    unit: str = Field(description="Of its numbers; empty where they have none.")
    least: float | None = Field(description="null: no end, or one that hangs on other keys.")
    most: float | None
    above: float | None = Field(description="Not allowed itself.")
    choices: list[str] = Field(description="Texts that are allowed; empty: any, or none.")
    default: float | str | bool | None = Field(description="What counts where it is left out.")
    needed: bool
    label: str = Field(description="What a form calls it; empty where it is in no form.")
    hint: str
    description: str


class FieldsAnswer(Answer):
    """Keys of every noun."""

    nouns: dict[str, list[FieldAnswer]]
