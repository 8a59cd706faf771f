"""Tool-holder geometry: what is refused, and how a tool is cut to length."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.structure import natural_frequencies
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, Material, ToolAssembly, clamped, stiffened
from rcsa_ident.tool_holder.model import tool_holder_structure

STEEL = MATERIALS["steel"]
TOOL = (BeamSegment(0.03, 0.01, STEEL, end_diameter=0.012), BeamSegment(0.08, 0.012, STEEL))
HOLDER = (BeamSegment(0.05, 0.05, STEEL, 0.012),)


def test_a_longer_tool_is_cut_at_its_end():
    assembly = clamped(TOOL, HOLDER, 0.05, 0.04, None)
    assert assembly.tool_length == pytest.approx(0.09)
    assert assembly.stickout == pytest.approx(0.05)
    assert assembly.tool[0] is TOOL[0]
    assert assembly.tool[1].length == pytest.approx(0.06)
    within = clamped(TOOL, HOLDER, 0.01, 0.01, None)
    assert len(within.tool) == 1
    assert within.tool[0].end == pytest.approx(0.01 + 0.002 * 2 / 3)
    whole = clamped(TOOL, HOLDER, 0.07, 0.04, None)
    assert whole.tool == TOOL


def test_parts_of_a_cone_fit_together():
    cone = BeamSegment(0.04, 0.01, STEEL, 0.002, end_diameter=0.03)
    one, two = cone.part(0.0, 0.015), cone.part(0.015, 0.04)
    assert one.end == pytest.approx(two.diameter)
    assert two.end == pytest.approx(0.03)
    assert one.length + two.length == pytest.approx(cone.length)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Material(0.0, 7850.0, 0.3), "youngs_modulus"),
        (lambda: Material(2e11, 7850.0, 0.5), "below 0.5"),
        (lambda: Material(2e11, 7850.0, 0.3, -0.1), "loss_factor"),
        (lambda: BeamSegment(-0.1, 0.01, STEEL), "length"),
        (lambda: BeamSegment(0.1, 0.01, STEEL, 0.01), "inner_diameter"),
        (lambda: BeamSegment(0.1, 0.02, STEEL, 0.012, end_diameter=0.01), "inner_diameter"),
        (lambda: BeamSegment(0.1, 0.02, STEEL, area=1e-4), "both or neither"),
        (lambda: Contact(0.0, 1.0), "translational_stiffness"),
        (lambda: ToolAssembly((), HOLDER, 0.0), "at least one segment"),
        (lambda: ToolAssembly(TOOL, HOLDER, 0.2), "less than the tool"),
        (lambda: ToolAssembly(TOOL, HOLDER, 0.06), "holder's length, 50 mm"),
        (lambda: clamped(TOOL, HOLDER, 0.1, 0.04, None), "110 mm"),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize("contact", [None, Contact(2e10, 6e5, 6e4, 9.0)])
def test_stiffened_is_all_moduli_and_the_contact(contact):
    assembly = ToolAssembly(TOOL, HOLDER, 0.04, contact)
    stiffer = stiffened(assembly, 0.02)
    for old, new in zip((*assembly.tool, *assembly.holder), (*stiffer.tool, *stiffer.holder), strict=True):
        assert new.material.youngs_modulus == pytest.approx(1.02 * old.material.youngs_modulus)
        assert replace(new, material=old.material) == old
        assert replace(new.material, youngs_modulus=old.material.youngs_modulus) == old.material
    assert stiffer.insertion == assembly.insertion
    if contact is None:
        assert stiffer.contact is None
    else:
        assert stiffer.contact == replace(contact, translational_stiffness=1.02 * 2e10, rotational_stiffness=1.02 * 6e5)


@pytest.mark.parametrize("contact", [None, Contact(2e10, 6e5)])
def test_natural_frequencies_rise_by_half_the_share(contact):
    """K is all stiffness there is: every natural frequency of the free assembly by the square root, exactly."""
    assembly = ToolAssembly(TOOL, HOLDER, 0.04, contact)
    plain, stiffer = (natural_frequencies(tool_holder_structure(a, 5000.0))[2:8] for a in (assembly, stiffened(assembly, 0.02)))
    assert stiffer / plain == pytest.approx(1.02**0.5, rel=1e-9)
