"""Declared keys: their numbers in SI, and what every address of them takes and refuses."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import Range
from rcsa_ident.cli.conditions import cut_of
from rcsa_ident.cli.options import CutOptions
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.cutter import HelixKind
from rcsa_ident.cutting.outlines import Dimensions
from rcsa_ident.cutting.stock import Immersion
from rcsa_ident.dynamics.passivity import Correction
from rcsa_ident.io.settings.cuts import FEED_DIRECTIONS
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Workpiece, asked_cut
from rcsa_ident.setup.fields import (
    ASKED_CUT,
    CAMPAIGN,
    COEFFICIENTS,
    CONTACT,
    DIMENSIONS,
    MATERIAL,
    NEEDED,
    NOUNS,
    SEGMENT,
    SENSOR,
    SPREAD,
    WORKPIECE,
    Field,
    Many,
    Number,
    keys_told,
    told_in_si,
)
from rcsa_ident.signals.recording import CAMPAIGN_QUANTITIES, Role, Sensor
from rcsa_ident.tool_holder.geometry import BeamSegment, Contact, Material
from rcsa_ident.tool_holder.spread import Spread

WORN = {"wear_land_um": 80.0, "indentation": 1e14, "friction": 0.3}


@pytest.mark.parametrize(
    ("kind", "written", "meant"),
    [
        (Number("mm", 1e-3), 12.0, 12.0 * 1e-3),
        (Number("%", per=100.0), 35.0, 35.0 / 100.0),
        (Number("deg", math.radians(1.0)), 90.0, math.pi / 2.0),
        (Many(Number("µm", 1e-6), 4), [1.0, 2.0], (1.0 * 1e-6, 2.0 * 1e-6)),
        (str, "carbide", "carbide"),
        (Number("mm", 1e-3), None, None),
    ],
)
def test_a_key_is_in_its_unit_and_the_noun_in_si(kind, written, meant):
    assert Field("a", "a_mm", kind).in_si(written) == meant


def test_choices_are_those_of_their_nouns():
    choices = {f"{noun}.{each.key}": each.choices for noun, fields in NOUNS.items() for each in fields}
    assert choices["sensor.quantity"] == CAMPAIGN_QUANTITIES
    assert choices["sensor.role"] == tuple(Role)
    assert choices["cutter.helix_kind"] == tuple(HelixKind)
    assert choices["cuts.feed_direction"] == choices["cut.feed_direction"] == tuple(FEED_DIRECTIONS)
    assert choices["frfs.correction"] == tuple(Correction)


def test_declarations_cost_a_command_nothing():
    code = "import sys, rcsa_ident.setup.fields; print('numpy' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "False"


def test_what_is_not_told_is_left_to_the_noun():
    assert told_in_si(COEFFICIENTS, {"ktc_mpa": 900.0, "krc": None, "odd": 1}) == {"tangential": 900.0 * 1e6}


@pytest.mark.parametrize(
    ("noun", "fields"),
    [
        (Spread(stickout=0.25e-3, contact_stiffness=0.5), SPREAD),
        (Contact(2e10, 6e5, 0.0, 9.0), CONTACT),
        (Material(5.8e11, 14400.0, 0.22), MATERIAL),
        (BeamSegment(0.02, 0.01, Material(5.8e11, 14400.0, 0.22), end_diameter=0.0125), SEGMENT),
    ],
    ids=lambda each: type(each).__name__,
)
def test_a_noun_is_made_again_of_the_keys_that_it_tells(noun, fields):
    every, unusual = keys_told(fields, noun), keys_told(fields, noun, usual=False)
    assert unusual.items() < every.items()
    assert type(noun)(**told_in_si(fields, every)) == type(noun)(**told_in_si(fields, unusual)) == noun


def test_every_key_of_a_cut_is_an_option_with_its_words():
    assert [each.name for each in dataclasses.fields(CutOptions)] == [each.key for each in ASKED_CUT]
    for each in ASKED_CUT:
        (option,) = CutOptions.__annotations__[each.key].__metadata__
        assert option.help
        assert "{" not in option.help


@pytest.mark.parametrize("field", [each for each in ASKED_CUT if hasattr(each.kind, "possible")], ids=lambda each: each.key)
def test_a_cut_takes_both_ends_of_what_is_possible_and_says_what_that_is(field):
    low, high = field.kind.possible
    for end in (low, high):
        assert asked_cut(Immersion(0.5, "down"), 0.0, {field.key: end}) == cut_of(CutOptions(**{field.key: end}))
    for beyond in (low - abs(low) - 1.0, high * 1.01):
        with pytest.raises(InputError) as error:
            cut_of(CutOptions(**{field.key: beyond}))
        assert f"a number at least {low:g} and at most {high:g}" in error.value.allowed


@pytest.mark.parametrize("key", WORN)
def test_a_worn_land_takes_both_ends_of_what_its_limits_are(key):
    (number,) = (each.number for each in ASKED_CUT if each.key == key)
    for end in (number.least, number.most):
        assert cut_of(CutOptions(**WORN | {key: end})).damping is not None


LIMITED = [(noun, each) for noun, fields in NOUNS.items() for each in fields if isinstance(each.kind, Range | Number)]


@pytest.mark.parametrize(("noun", "field"), LIMITED, ids=[f"{noun}.{each.key}" for noun, each in LIMITED])
def test_a_reader_takes_both_ends_of_a_key_and_refuses_what_is_beyond_in_one_sentence(noun, field):
    def read(value):
        return Table({field.key: value}, "F.toml", noun).field(field)

    kind = field.kind
    least, most = kind.possible if isinstance(kind, Range) else (kind.least, kind.most)
    for end in (least, most):
        assert end is None or read(end) == end
    for beyond, side in ((least, -1.0), (most, 1.0)):
        if beyond is not None:
            with pytest.raises(InputError) as error:
                read(beyond + side * max(1e-6 * abs(beyond), 1e-12))
            assert error.value.field == f"{noun}.{field.key}"
            assert f"{'at least' if side < 0.0 else 'at most'} {beyond:g}" in error.value.allowed
    if isinstance(kind, Number) and kind.above is not None:
        with pytest.raises(InputError, match=f"above {kind.above:g}"):
            read(kind.above)


OF_NOUNS = [
    (Spread, SPREAD), (Contact, CONTACT), (Material, MATERIAL), (Dimensions, DIMENSIONS), (BeamSegment, SEGMENT),
    (CuttingCoefficients, WORKPIECE[1:-1]), (Workpiece, (WORKPIECE[0], WORKPIECE[-1])), (Sensor, SENSOR), (Campaign, CAMPAIGN),
]  # fmt: skip


@pytest.mark.parametrize(("noun", "fields"), OF_NOUNS, ids=[noun.__name__ for noun, _ in OF_NOUNS])
def test_a_key_that_is_left_out_is_what_its_noun_takes_then(noun, fields):
    own = {each.name: each.default for each in dataclasses.fields(noun)}
    for each in fields:
        assert each.name in own
        if each.default not in (NEEDED, None):
            assert each.in_si(each.default) == own[each.name]


@pytest.mark.parametrize(("noun", "fields"), OF_NOUNS[:6], ids=[noun.__name__ for noun, _ in OF_NOUNS[:6]])
def test_a_noun_of_numbers_has_a_key_for_each(noun, fields):
    assert {each.name for each in fields} == {each.name for each in dataclasses.fields(noun) if each.compare}
