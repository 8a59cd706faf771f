"""What a drawing does not tell, applied to it."""

from dataclasses import replace
from math import log

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.tool_holder.alteration import Alteration, altered
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.spread import EXACT, LARGEST_SHARE, SPREAD_FIELDS

CARBIDE, STEEL = MATERIALS["carbide"], MATERIALS["steel"]
TOOL = (BeamSegment(0.026, 0.0096, CARBIDE), BeamSegment(0.084, 0.012, CARBIDE))
HOLDER = (BeamSegment(0.040, 0.040, STEEL, 0.012, end_diameter=0.050), BeamSegment(0.030, 0.063, STEEL, 0.02))
DRAWN = ToolAssembly(TOOL, HOLDER, 0.040, Contact(2e10, 6e5, 1e5, 40.0))


def test_nothing_altered_is_the_drawing():
    assert altered(DRAWN, Alteration()) == DRAWN


def test_lengths_are_where_they_belong():
    out = altered(DRAWN, Alteration(stickout=3e-4))
    assert out.stickout == pytest.approx(DRAWN.stickout + 3e-4)
    assert out.insertion == DRAWN.insertion
    assert out.tool[0] == DRAWN.tool[0]
    flutes = altered(DRAWN, Alteration(fluted_length=2e-4))
    assert flutes.tool[0].length == pytest.approx(0.0262)
    assert flutes.stickout == pytest.approx(DRAWN.stickout)


def test_each_logarithm_scales_its_own():
    by = Alteration(
        fluted_diameter=log(1.03), youngs_modulus=log(0.95), translational_stiffness=log(2.0), rotational_damping=log(0.5),
        holder_diameter=log(1.01),
    )  # fmt: skip
    found = altered(DRAWN, by)
    assert found.tool[0].diameter == pytest.approx(1.03 * 0.0096)
    assert found.tool[1].diameter == DRAWN.tool[1].diameter
    assert [s.material.youngs_modulus for s in found.tool] == pytest.approx([0.95 * CARBIDE.youngs_modulus] * 2)
    assert found.holder[0].material == STEEL
    assert (found.holder[0].diameter, found.holder[0].end) == (pytest.approx(0.0404), pytest.approx(0.0505))
    assert found.holder[0].inner_diameter == DRAWN.holder[0].inner_diameter
    assert found.contact is not None
    assert found.contact.translational_stiffness == pytest.approx(4e10)
    assert (found.contact.rotational_stiffness, found.contact.translational_damping) == (6e5, 1e5)
    assert found.contact.rotational_damping == pytest.approx(20.0)


def test_a_told_section_goes_with_the_powers_of_the_diameter():
    told = replace(DRAWN, tool=(replace(TOOL[0], area=5e-5, second_moment=3e-10), TOOL[1]))
    found = altered(told, Alteration(fluted_diameter=log(1.02))).tool[0]
    assert found.area == pytest.approx(5e-5 * 1.02**2)
    assert found.second_moment == pytest.approx(3e-10 * 1.02**4)


def test_a_tool_of_one_piece_has_no_fluted_part():
    plain = replace(DRAWN, tool=(BeamSegment(0.11, 0.012, CARBIDE),))
    assert altered(plain, Alteration(fluted_diameter=0.5, fluted_length=1e-3)) == plain


def test_a_segment_that_nothing_is_left_of_is_refused():
    with pytest.raises(InputError, match="length"):
        altered(DRAWN, Alteration(fluted_length=-0.03))


@pytest.mark.parametrize("name", SPREAD_FIELDS)
def test_spreads_are_possible_ones(name):
    for wrong in (-1e-6, float("nan"), LARGEST_SHARE * 1.01):
        with pytest.raises(InputError, match=name):
            replace(EXACT, **{name: wrong})
    assert not replace(EXACT, **{name: 1e-6}).exact
