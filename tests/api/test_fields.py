"""Bodies of declared keys: they take both ends of their limits, and refuse what is beyond."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from api.schemas.campaigns import SensorKeys
from api.schemas.queries import Cut
from rcsa_ident.setup.fields import ASKED_CUT, NOUNS, SENSOR, Many, Named, Number

HELD = [(Cut, each) for each in ASKED_CUT if isinstance(each.number, Number)]
HELD += [(SensorKeys, each) for each in SENSOR if each.key in ("delay_s", "rotation_deg", "pulses_per_revolution", "distance_spread_mm")]

#: Keys that a body cannot do without.
LEAST = {Cut: {}, SensorKeys: {"quantity": "displacement"}}


def as_written(field, number):
    return [number] if isinstance(field.kind, Many) else number


@pytest.mark.parametrize(
    ("body", "field"), [(body, field) for body, field in HELD if field.number.most is not None], ids=lambda each: getattr(each, "key", "")
)
def test_a_body_takes_both_ends_and_refuses_what_is_beyond(body, field):
    least, most = field.number.least, field.number.most
    for end in (least, most):
        told = getattr(body.model_validate(LEAST[body] | {field.key: as_written(field, end)}), field.key)
        assert told == as_written(field, end)
    step = 1 if field.number.whole else 1e-9 * most
    for beyond in (least - step, most + step):
        with pytest.raises(ValidationError, match="than or equal to"):
            body.model_validate(LEAST[body] | {field.key: as_written(field, beyond)})


@pytest.mark.parametrize("field", [each for each in ASKED_CUT if isinstance(each.kind, tuple | Named)], ids=lambda each: each.key)
def test_a_body_takes_the_choices_that_are_declared(field):
    for choice in field.kind.names if isinstance(field.kind, Named) else field.kind:
        assert getattr(Cut.model_validate({field.key: choice}), field.key) == choice
    with pytest.raises(ValidationError, match="odd"):
        Cut.model_validate({field.key: "odd"})


def test_the_service_tells_every_declared_key(shop):
    client, _ = shop
    told = client.send("GET", "/fields").json()["nouns"]
    assert {noun: [each["key"] for each in keys] for noun, keys in told.items()} == {
        noun: [each.key for each in fields] for noun, fields in NOUNS.items()
    }
    (stickout,) = (each for each in told["spread"] if each["key"] == "stickout_mm")
    assert [stickout[word] for word in ("unit", "least", "most", "above", "default", "needed", "label")] == [
        "mm", 0.0, 5.0, None, 0.05, False, "± Stickout",
    ]  # fmt: skip
    (direction,) = (each for each in told["cut"] if each["key"] == "feed_direction")
    assert (direction["choices"], direction["least"], direction["most"]) == (["+X", "-X", "+Y", "-Y"], -360.0, 360.0)
    (length,) = (each for each in told["segment"] if each["key"] == "length_mm")
    assert (length["needed"], length["default"], length["above"]) == (True, None, 0.0)
