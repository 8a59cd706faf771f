"""Tapers on a string: masses as cones have them, and what they do to the first free mode."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.tool_holder.free_modes import bending_modes
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.taper import hung, taper, tapers

CARBIDE, STEEL = MATERIALS["carbide"], MATERIALS["steel"]


def slender():
    """A shrink-fit holder with a thin nose: of common ones the one that feels its taper most."""
    tool = (BeamSegment(0.026, 0.0096, CARBIDE), BeamSegment(0.0726, 0.012, CARBIDE))
    holder = (
        BeamSegment(0.036, 0.027, STEEL, 0.012, end_diameter=0.032),
        BeamSegment(0.034, 0.034, STEEL, 0.014),
        BeamSegment(0.026, 0.063, STEEL, 0.020),
    )
    return ToolAssembly(tool, holder, 0.036, Contact(6e10, 1.8e6, 8e4, 30.0))


def test_every_taper_has_mass_and_source():
    for name in tapers():
        found = taper(name)
        assert 0.01 < found.mass < 2.5
        assert found.source
        assert all(segment.inner_diameter < segment.diameter for segment in found.segments)


def test_a_solid_taper_is_a_cone_with_its_stud():
    """Volume of a truncated cone of 7/24, and the three cylinders of the stud."""
    first, length = 0.04445, 0.0654
    last = first - 7.0 / 24.0 * length
    cone = np.pi / 12.0 * length * (first**2 + first * last + last**2)
    stud = np.pi / 4.0 * (0.007 * 0.023**2 + 0.018 * 0.010**2 + 0.010 * 0.015**2)
    assert taper("BT40").mass == pytest.approx(STEEL.density * (cone + stud), rel=2e-3)


def test_kinds_of_one_size_share_their_taper():
    assert taper("HSK-A63").segments == taper("HSK-E63").segments == taper("HSK-F80").segments


@pytest.mark.parametrize(("name", "least", "most"), [("HSK-A63", 0.03, 0.06), ("BT40", 0.07, 0.15), ("SK40", 0.07, 0.15)])
def test_a_taper_lowers_the_first_free_mode(name, least, most):
    """By as much as the literature on free-free tests expects: some percent for a hollow one, a tenth for a solid one with its stud."""
    plain, carried = (bending_modes(body, 1, 6e3)[0].omega for body in (slender(), hung(slender(), name)))
    assert least < 1.0 - carried / plain < most


def test_an_unknown_name():
    with pytest.raises(InputError, match=r"taper: found HSK63, allowed is one of HSK-A32"):
        taper("HSK63")
    assert hung(slender(), "") == slender()
