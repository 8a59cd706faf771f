"""Cutter, tool and holder as a whole: wrong units and shapes that do not fit are refused or remarked on, ordinary toolings are not."""

from __future__ import annotations

import copy
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import PlausibilityCode
from rcsa_ident.io.settings.setups import read_campaign, read_tooling, tooling_of
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.proportions import edge_length
from tests.fixtures import by_hand
from tests.fixtures.service import example

ROOT = Path(__file__).resolve().parents[2]
TOOLINGS = sorted((ROOT / "data").rglob("toolings/*.toml"))
LONG = ROOT / "data" / "machines" / "toolings" / "S3-PG25-long.toml"


def changed(key, value):
    """The tooling of a solid carbide end mill of 12 mm, with fluted part, in which one key has another value."""
    data = copy.deepcopy(tomllib.loads(LONG.read_text(encoding="utf-8")))
    *path, last = key.replace("[", ".").replace("]", "").split(".")
    place = data
    for part in path:
        place = place[int(part)] if part.isdigit() else place[part]
    place[last] = value
    return tooling_of(data, "", "T")


def test_the_examples_give_no_warning():
    assert len(TOOLINGS) >= 6
    assert [read_tooling(path).remarks for path in TOOLINGS] == [()] * len(TOOLINGS)
    assert by_hand.tooling().remarks == tooling_of(example(), "", "T").remarks == ()
    assert read_campaign(ROOT / "data" / "sample_runs").remarks == ()


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("contact.translational_stiffness", 3e4, "N/µm per m (3e+10 N/m per m)?"),
        ("tool.stickout_mm", 0.0659, "given in metres (65.9 mm)?"),
        ("tool.segments[1].inner_diameter_mm", 11.9, "a bore of at most 0.6 times the outer diameter"),
        ("cutter.diameter_mm", 0.012, "given in metres (12 mm)?"),
        ("cutter.diameter_mm", 200.0, "0.7 to 2.2 times that diameter"),
        ("holder.segments[0].inner_diameter_mm", 39.0, "a bore of the tool's own diameter, 12 mm"),
        ("holder.segments[0].inner_diameter_mm", 6.0, "a bore of the tool's own diameter, 12 mm"),
        ("tool.segments[0].outer_diameter_mm", 0.0000096, "at least 0.001"),
    ],
)
def test_what_is_impossible_is_refused(key, value, words):
    with pytest.raises(InputError) as error:
        changed(key, value)
    assert error.value.field == key
    assert words in error.value.allowed


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("contact.translational_damping", 1e6, "a loss factor of 0.21 at 1000 Hz, but usual is a loss factor of at most 0.15"),
        ("contact.rotational_damping", 450.0, "a loss factor of 3.1 at 1000 Hz"),
        ("holder.insertion_mm", 2.0, "2 mm of a tool that is 12 mm thick there, but usual is 0.4 to 15 times"),
        ("tool.segments[1].inner_diameter_mm", 8.0, "8 mm in an outer diameter of 12 mm"),
        ("cutter.diameter_mm", 40.0, "40 mm on a tool that is 9.6 mm thick at its tip"),
        ("cutter.diameter_mm", 5.0, "5 mm on a tool that is 9.6 mm thick at its tip"),
        ("cutter.teeth", 60, "usual are 1 to 30"),
        ("holder.segments[0].inner_diameter_mm", 0.0, "would fill the same place"),
        ("holder.segments[0].inner_diameter_mm", 20.0, "20 mm around a tool that is 12 mm thick"),
        ("tool.stickout_mm", 16.0, "fluted part is 26 mm long"),
        ("tool.stickout_mm", 1.5, "1.5 mm of a tool that is 9.6 mm thick"),
    ],
)
def test_what_is_unusual_is_remarked_on(key, value, words):
    found = changed(key, value).remarks
    assert [remark for remark in found if key in remark and words in remark]
    assert {remark.code for remark in found} <= set(PlausibilityCode)


def test_only_the_bore_around_the_tool_has_to_fit():
    """The holder's bore behind the insertion is anything; a butt joint needs none."""
    assert changed("holder.segments[2].inner_diameter_mm", 30.0).remarks == ()
    one_piece = replace(by_hand.tooling().assembly, insertion=0.0, contact=None)
    assert Tooling("T", by_hand.tooling().cutter, one_piece).remarks == ()


@pytest.mark.parametrize(
    ("key", "value", "field", "words"),
    [
        ("contact.translational_damping", 1e8, "contact.translational_damping", "a loss factor of 21 at 1000 Hz"),
        ("contact.rotational_damping", 45e3, "contact.rotational_damping", "a loss factor of 3.1e+02 at 1000 Hz"),
        ("contact.translational_stiffness", 3e7, "contact.translational_damping", "was it given in N/m per mm (3e+10 N/m per m)?"),
        ("holder.insertion_mm", 0.0, "holder.insertion_mm", "0 mm beside a [contact]"),
        ("holder.insertion_mm", 0.044, "holder.insertion_mm", "0.4 to 15 times its diameter"),
    ],
)
def test_a_contact_damps_as_metal_does_and_holds_the_tool(key, value, field, words):
    """An end mill whose contact damps a thousand times too much had 1.37 mm where 0.24 are right, and no word was said."""
    with pytest.raises(InputError) as error:
        changed(key, value)
    assert error.value.field == field
    assert words in f"{error.value.found} {error.value.allowed}"


def test_edges_end_with_the_flutes_or_with_the_stickout():
    fluted, plain = read_tooling(LONG), by_hand.tooling()
    assert edge_length(fluted.assembly, fluted.cutter) == (pytest.approx(0.026), "fluted part")
    assert edge_length(plain.assembly, plain.cutter) == (pytest.approx(0.06), "stickout")
