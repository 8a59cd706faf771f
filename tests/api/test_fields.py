"""Bodies of declared keys: they take both ends of their limits, and refuse what is beyond."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from api.schemas.queries import Cut
from rcsa_ident.setup.fields import ASKED_CUT, Many, Named, Number

HELD = [(Cut, each) for each in ASKED_CUT if isinstance(each.number, Number)]


def as_written(field, number):
    return [number] if isinstance(field.kind, Many) else number


@pytest.mark.parametrize(
    ("body", "field"), [(body, field) for body, field in HELD if field.number.most is not None], ids=lambda each: getattr(each, "key", "")
)
def test_a_body_takes_both_ends_and_refuses_what_is_beyond(body, field):
    least, most = field.number.least, field.number.most
    for end in (least, most):
        told = getattr(body.model_validate({field.key: as_written(field, end)}), field.key)
        assert told == as_written(field, end)
    for beyond in (math.nextafter(least, -math.inf), math.nextafter(most, math.inf)):
        with pytest.raises(ValidationError, match="than or equal to"):
            body.model_validate({field.key: as_written(field, beyond)})


@pytest.mark.parametrize("field", [each for each in ASKED_CUT if isinstance(each.kind, tuple | Named)], ids=lambda each: each.key)
def test_a_body_takes_the_choices_that_are_declared(field):
    for choice in field.kind.names if isinstance(field.kind, Named) else field.kind:
        assert getattr(Cut.model_validate({field.key: choice}), field.key) == choice
    with pytest.raises(ValidationError, match="odd"):
        Cut.model_validate({field.key: "odd"})
