"""Tool-holder geometry: what is refused, and how a tool is cut to length."""

from __future__ import annotations

import pytest

from rcsa_ident.errors import InputError
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, Material, ToolAssembly, clamped

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
