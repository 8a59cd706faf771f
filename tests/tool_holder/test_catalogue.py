"""The catalogue of holders: dimensions of the standards, bodies that fit their tapers, mass and length."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.tool_holder.catalogue import bores, chucks, holder, stated, tapers
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly

TOOLINGS = Path(__file__).resolve().parents[2] / "data" / "machines" / "toolings"
#: On the smallest flanges nobody mounts the largest chucks.
TOO_WIDE = {("HSK-A40", "ER40")}
EVERY = [(taper, chuck) for taper in tapers() for chuck in chucks() if (taper, chuck) not in TOO_WIDE]
FLANGES = [
    ("HSK-A63", 63.0, 26.0),
    ("HSK-A100", 100.0, 29.0),
    ("BT30", 46.0, 22.0),
    ("BT40", 63.0, 27.0),
    ("BT50", 100.0, 38.0),
    ("CAT40", 63.5, 19.05),
]


def test_every_taper_and_chuck_that_is_common_is_there():
    assert tapers() == ("HSK-A40", "HSK-A50", "HSK-A63", "HSK-A80", "HSK-A100", "BT30", "BT40", "BT50", "CAT40", "CAT50")
    assert chucks() == ("ER16", "ER20", "ER25", "ER32", "ER40", "hydraulic", "shrink", "Weldon", "power")


@pytest.mark.parametrize(("taper", "diameter", "length"), FLANGES)
def test_flanges_are_those_of_the_standards(taper, diameter, length):
    """ISO 12164-1, JIS B 6339, ASME B5.50."""
    flange = [s for s in holder(taper, "ER16", 0.006).segments if s.diameter == pytest.approx(1e-3 * diameter)]
    assert sum(s.length for s in flange) == pytest.approx(1e-3 * length)


def test_every_holder_takes_every_bore_of_its_chuck():
    for taper, chuck, bore in [(*each, bore) for each in EVERY for bore in bores(each[1], each[0])]:
        found = holder(taper, chuck, bore, 0.12)
        assert found.length == pytest.approx(0.12)
        inside = 0.0
        for segment in found.segments:
            if inside < found.insertion - 1e-9:
                assert segment.inner_diameter == bore
            inside += segment.length
            # a wall that a chuck could be made of
            assert min(segment.diameter, segment.end) - segment.inner_diameter >= 4e-3
        # between a bar of its nose and a block of its flange
        flange = max(s.end for s in found.segments)
        nose = found.segments[0].diameter
        bar, block = (MATERIALS["steel"].density * math.pi / 4.0 * 0.12 * d**2 for d in (min(nose, flange), max(nose, flange)))
        assert 0.5 * bar < found.mass < block
        assert len(found.sources) == 2
        assert ToolAssembly((BeamSegment(0.1, bore, MATERIALS["carbide"]),), found.segments, found.insertion).holder_length > 0.0


#: Toolings of the virtual machine, and the chuck that each is called after.
CONTACTS = [("S1-ER32", "ER32"), ("S4-shrink", "shrink")]


@pytest.mark.parametrize(("tooling", "chuck"), CONTACTS)
def test_typical_contacts_are_those_that_their_source_names(tooling, chuck):
    typical = holder("HSK-A63", chuck, 0.012).contact
    assert typical.contact == read_tooling(TOOLINGS / f"{tooling}.toml").assembly.contact
    # the factor of two that its source speaks of
    assert math.exp(typical.stiffness_spread) == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ("translational_stiffness", "translational stiffness of the holder–tool joint, which is assumed (70 %)"),
        ("rotational_damping", "rotational damping of the holder–tool joint, which is assumed (100 %)"),
        ("stickout", "stickout, whose standard deviation is 0.05 mm"),
        ("fluted_diameter", "diameter of the fluted part, whose standard deviation is 3 %"),
        ("identified translational_stiffness", "translational stiffness of the holder–tool joint, which was identified"),
    ],
)
def test_what_is_assumed_of_a_drawing_is_told_from_what_is_stated(parameter, words):
    made = holder("HSK-A63", "ER32", 0.012)
    assert stated(parameter, made.contact.contact, made.spread) == words
    measured = replace(made.contact.contact, rotational_stiffness=6.1e5)
    assert "assumed" not in stated(parameter, measured, made.spread)


def test_what_nobody_knows_of_a_contact_is_not_made_up():
    known = {chuck for chuck in chucks() if holder("HSK-A63", chuck, 0.016 if chuck == "power" else 0.01).contact is not None}
    assert known == set(chucks()) - {"hydraulic", "Weldon", "power"}


def test_mass_of_a_holder_by_hand():
    """A collet chuck of two cylinders: 74 mm of 50 mm with a bore of 12 mm, 40 mm deep, and 23.5 mm behind it; a flange of 63 mm."""
    found = holder("HSK-A63", "ER32", 0.012)
    volume = 40.0 * (50.0**2 - 12.0**2) + 34.0 * (50.0**2 - 23.5**2) + 26.0 * (63.0**2 - 23.5**2)
    assert found.mass == pytest.approx(7850.0 * math.pi / 4.0 * volume * 1e-9)
    assert found.insertion == 0.040
    assert str(found) == "HSK-A63 ER32, bore 12 mm, 100 mm, 1.54 kg"


def test_a_shrink_fit_chuck_is_a_cone_of_4_5_degrees():
    first = holder("HSK-A63", "shrink", 0.012).segments[0]
    assert math.degrees(math.atan(0.5 * (first.end - first.diameter) / first.length)) == pytest.approx(4.5)
    assert first.diameter == pytest.approx(0.024)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (("HSK-A32", "ER32", 0.012), "taper: found HSK-A32, allowed is one of HSK-A40"),
        (("HSK-A63", "ER11", 0.012), "chuck: found ER11, allowed is one of ER16"),
        (("HSK-A63", "ER32", 0.025), "bore: found 25 mm, allowed is from 2 to 20 mm for HSK-A63 ER32"),
        (("HSK-A40", "Weldon", 0.032), "bore: found 32 mm, allowed is from 6 to 20 mm for HSK-A40 Weldon"),
        (("HSK-A40", "ER40", 0.016), "chuck: found ER40, allowed is one that HSK-A40 carries, with a nose of at most 56 mm"),
        (("BT50", "ER32", 0.012, 0.040), "holder length: found 40 mm, allowed is at least 43 mm for BT50 ER32"),
        (("HSK-A63", "ER32", 0.012, float("nan")), "length"),
    ],
)
def test_what_is_not_in_the_catalogue_is_refused(asked, words):
    with pytest.raises(InputError, match=words):
        holder(*asked)
