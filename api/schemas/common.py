"""Base classes and types of all bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Generic, Literal, TypeVar

from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, model_validator
from pydantic.fields import FieldInfo

from rcsa_ident.base.plausibility import Range
from rcsa_ident.setup.fields import NEEDED, Many, Named, Number
from rcsa_ident.setup.fields import Field as Key

#: Names given by users: no paths, no control characters.
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9 ._+()-]{0,63}$"
ID_PATTERN = r"^[A-Za-z0-9]{1,64}$"
Name = Annotated[str, StringConstraints(pattern=NAME_PATTERN)]
Id = Annotated[str, StringConstraints(pattern=ID_PATTERN)]
#: Free text without control characters, which not every database accepts.
Line = Annotated[str, StringConstraints(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
#: Rows of a map of engagement, each a height and two angles.
EngagementRows = Annotated[list[Annotated[list[float], Field(min_length=3, max_length=3)]], Field(min_length=1, max_length=1000)]
#: Keys of a body or of a part of it, and items of one key.
MOST_KEYS, MOST_ITEMS = 100, 5000
Item = TypeVar("Item")
Model = TypeVar("Model", bound=BaseModel)


def within(kind: Range) -> Any:
    """Return the limits of a number in its quantity's own unit: what is possible is the library's to say."""
    return Field(ge=kind.possible[0], le=kind.possible[1])


class Body(BaseModel):
    """Body of a request: unknown keys and non-finite numbers are refused, and types are not coerced."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _few(cls, data: Any) -> Any:
        """Refuse at once what would have hundreds of thousands of faults, each of which costs a kilobyte."""
        if isinstance(data, dict):
            if len(data) > MOST_KEYS:
                raise ValueError(f"at most {MOST_KEYS} keys are allowed, found {len(data)}")
            for key, value in data.items():
                if isinstance(value, list | dict) and len(value) > MOST_ITEMS:
                    raise ValueError(f"at most {MOST_ITEMS} items are allowed, found {len(value)} in {str(key)[:80]}")
        return data


def _kind_of(field: Key, limits: bool) -> Any:
    """The type of what stands under a key."""
    match field.kind:
        case Many(most=most):
            return Annotated[list[_number(field, limits)], Field(max_length=most)]  # type: ignore[misc]
        case Named(names=names):
            return Literal[names] | _number(field, limits)
        case tuple() as choices:
            return Literal[choices]
        case type() as kind:
            return Line if kind is str else kind
        case _:
            return _number(field, limits)


def _number(field: Key, limits: bool) -> Any:
    number = field.number
    if not limits or not isinstance(number, Number):
        return int if isinstance(number, Number) and number.whole else float
    return Annotated[int if number.whole else float, Field(ge=number.least, gt=number.above, le=number.most)]


class Declared(BaseModel):
    """Declared keys; a class types or limits some of them otherwise, where bodies tell something else than files.

    Parameters
    ----------
    fields : sequence of Field
    limits : bool
        Whether limits of plain numbers are held to here; else whoever reads the keys does that.
    defaults : bool
        Whether a key that is left out is what counts then; else it is null.
    """

    if TYPE_CHECKING:

        def __getattr__(self, key: str) -> Any: ...

    def __init_subclass__(cls, fields: Sequence[Key] = (), limits: bool = False, defaults: bool = False) -> None:
        own, cls.__annotations__ = dict(cls.__annotations__), {}
        for each in fields:
            usual = each.default if defaults or each.default is NEEDED else None
            usual = vars(cls).get(each.key, ... if usual is NEEDED else usual)
            kind = _kind_of(each, limits)
            cls.__annotations__[each.key] = own.pop(each.key, kind | None if usual is None else kind)
            setattr(cls, each.key, usual if isinstance(usual, FieldInfo) else Field(usual, description=each.described or None))
        cls.__annotations__ |= own


class Keys(Body, Declared):
    """A body of declared keys."""


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
