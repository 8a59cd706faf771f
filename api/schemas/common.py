"""Base classes and types of all bodies."""

from __future__ import annotations

from typing import Annotated, Generic, TypeVar

from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

#: Names given by users: no paths, no control characters.
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9 ._+()-]{0,63}$"
ID_PATTERN = r"^[A-Za-z0-9]{1,64}$"
Name = Annotated[str, StringConstraints(pattern=NAME_PATTERN)]
Id = Annotated[str, StringConstraints(pattern=ID_PATTERN)]
#: Free text without control characters, which not every database accepts.
Line = Annotated[str, StringConstraints(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
Item = TypeVar("Item")
Model = TypeVar("Model", bound=BaseModel)


class Body(BaseModel):
    """Body of a request: unknown keys and non-finite numbers are refused, and types are not coerced."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True, strict=True)


class Answer(BaseModel):
    """Body of an answer: every number is finite."""

    model_config = ConfigDict(allow_inf_nan=False, frozen=True)


def body_of(model: type[Model], raw: bytes) -> Model:
    """Return the model of a body that a route has read itself."""
    try:
        return model.model_validate_json(raw)
    except ValidationError as error:
        raise RequestValidationError(error.errors()) from None


class Page(Answer, Generic[Item]):
    """A page of a list."""

    items: list[Item]
    next: str | None = Field(description="Value of `after` for the next page; null at the end.")


class Fault(Answer):
    """A field at fault."""

    field: str
    found: str
    allowed: str


class ProblemDocument(Answer):
    """Problem document (RFC 9457)."""

    type: str
    title: str
    status: int
    detail: str
    errors: list[Fault] | None = Field(None, description="The fields at fault.")
    request_id: str
