"""What all bodies share."""

from __future__ import annotations

from typing import Annotated, Generic, TypeVar

from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

#: What a person may call something: no path, no control characters.
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9 ._+()-]{0,63}$"
ID_PATTERN = r"^[A-Za-z0-9]{1,64}$"
Name = Annotated[str, StringConstraints(pattern=NAME_PATTERN)]
Id = Annotated[str, StringConstraints(pattern=ID_PATTERN)]
#: Text of people; no control characters, which not every store takes.
Line = Annotated[str, StringConstraints(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
Item = TypeVar("Item")
Model = TypeVar("Model", bound=BaseModel)


class Body(BaseModel):
    """What a client sends: every key is known, every number finite, nothing is turned into what it is not."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True, strict=True)


class Answer(BaseModel):
    """What a client gets: every number finite."""

    model_config = ConfigDict(allow_inf_nan=False, frozen=True)


def body_of(model: type[Model], raw: bytes) -> Model:
    """Return a body that a route reads itself."""
    try:
        return model.model_validate_json(raw)
    except ValidationError as error:
        raise RequestValidationError(error.errors()) from None


class Page(Answer, Generic[Item]):
    """A part of a list."""

    items: list[Item]
    next: str | None = Field(description="Value of `after` for the next part; null at the end.")


class Fault(Answer):
    """A field at fault."""

    field: str
    found: str
    allowed: str


class ProblemDocument(Answer):
    """RFC 9457."""

    type: str
    title: str
    status: int
    detail: str
    errors: list[Fault] | None = Field(None, description="The fields at fault.")
    request_id: str
