"""A tool that is clamped at its flange and pushed at its tip: closed forms of beams."""

import numpy as np
import pytest

from rcsa_ident.tool_holder.clamped import bending_at_rest
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.timoshenko import cowper

STEEL = MATERIALS["steel"]


def test_one_rod():
    """F l^3 / (3 E I) and the shear's F l / (k G A)."""
    length, diameter = 0.2, 0.02
    parts = (BeamSegment(0.12, diameter, STEEL),), (BeamSegment(0.08, diameter, STEEL),)
    area, second = np.pi * diameter**2 / 4.0, np.pi * diameter**4 / 64.0
    e, nu = STEEL.youngs_modulus, STEEL.poisson
    shear = cowper(nu, 0.0) * e / (2.0 * (1.0 + nu)) * area
    assert bending_at_rest(ToolAssembly(*parts, insertion=0.0)) == pytest.approx(length**3 / (3.0 * e * second) + length / shear, rel=1e-4)


def test_a_soft_contact_adds_what_it_turns():
    tool, holder = (BeamSegment(0.1, 0.012, MATERIALS["carbide"]),), (BeamSegment(0.06, 0.05, STEEL, inner_diameter=0.012),)
    soft, rigid = (bending_at_rest(ToolAssembly(tool, holder, 0.04, contact)) for contact in (Contact(1e8, 5e3), None))
    # a rod on a bed of springs over 40 mm: a translation and a turn about its middle
    lever, bed, turned = 0.06 + 0.02, 1e8 * 0.04, 1e8 * 0.04**3 / 12.0 + 5e3 * 0.04
    assert soft - rigid == pytest.approx(1.0 / bed + lever**2 / turned, rel=0.03)
