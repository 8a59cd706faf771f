"""Tool and holder along their axis, beside the exact rods of text books."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.structure import natural_frequencies
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.rods import TWISTING_ENDS, reduced_rod, rod_poles, rod_structure
from tests.tool_holder.exact_rods import exact

OMEGA = 2.0 * np.pi * np.linspace(50.0, 12e3, 400)
CARBIDE, STEEL = MATERIALS["carbide"], MATERIALS["steel"]
TOOL = (BeamSegment(0.03, 0.0096, CARBIDE), BeamSegment(0.07, 0.012, CARBIDE))
HOLDER = (BeamSegment(0.05, 0.04, STEEL, inner_diameter=0.012), BeamSegment(0.04, 0.063, STEEL))


def off(found, truth):
    """The largest error at a frequency, as a share of all entries there."""
    return np.max(np.linalg.norm(found - truth, axis=(1, 2)) / np.linalg.norm(truth, axis=(1, 2)))


def test_a_stepped_rod():
    """Tool and holder end to end, with the materials' loss."""
    body = ToolAssembly(TOOL, HOLDER, insertion=0.0)
    found = rod_poles(body, float(OMEGA[-1])).receptance(OMEGA).values
    truth = exact((*TOOL, *HOLDER), OMEGA)
    assert off(found, truth) < 1e-4
    low = OMEGA < 3e4
    assert off(found[low], truth[low]) < 1e-5
    np.testing.assert_allclose(found, found.transpose(0, 2, 1), rtol=1e-9)


def test_it_moves_as_its_mass_where_it_is_slow():
    body = ToolAssembly(TOOL, HOLDER, 0.03, Contact(2e10, 1e6, 1e4))
    mass = sum(each.mass for each in (*TOOL, *HOLDER))
    low = np.array([60.0])
    np.testing.assert_allclose(rod_poles(body, 6e4).receptance(low).values * -mass * low**2, np.ones((1, 2, 2)), rtol=1e-3)


def test_a_contact_gives_way_as_a_spring_along_the_shank():
    """Far below its resonances tip over flange is stiffer by what lies between: the shear lag of two rods and a layer, in closed form."""
    k, length = 4e9, 0.03
    tool, holder = (BeamSegment(length + 0.02, 0.012, STEEL),), (BeamSegment(length, 0.03, STEEL, inner_diameter=0.012),)
    light = replace(STEEL, density=1.0, loss_factor=0.0)
    tool, holder = (tuple(replace(s, material=light) for s in each) for each in (tool, holder))
    low = np.array([2.0e3])
    body = rod_poles(ToolAssembly(tool, holder, length, Contact(k, 1e6)), 6e5).receptance(low).values[0]
    stretch = body[0, 0] - body[0, 1] - body[1, 0] + body[1, 1]
    a, b = (STEEL.youngs_modulus * np.pi / 4.0 * (s[0].diameter ** 2 - s[0].inner_diameter ** 2) for s in (tool, holder))
    # a u'' = k (u - v), b v'' = k (v - u) with the force in the tool at one end and in the holder at the other
    beta = np.sqrt(k * (1.0 / a + 1.0 / b))
    cosh, sinh = np.cosh(beta * length), np.sinh(beta * length)
    layer = (length + (a / b + b / a) * cosh / (beta * sinh) + 2.0 / (beta * sinh)) / (a + b)
    assert stretch.real == pytest.approx(0.02 / a + layer, rel=1e-3)


def test_a_rigid_clamping_is_the_limit_of_a_stiff_one():
    stiff, rigid = (rod_poles(ToolAssembly(TOOL, HOLDER, 0.03, each), 3e4) for each in (Contact(1e15, 1e6), None))
    omega = OMEGA[OMEGA < 3e4]
    assert off(stiff.receptance(omega).values, rigid.receptance(omega).values) < 1e-3


def test_a_mesh_ends_where_a_segment_ends():
    """Places of both bodies that are no multiples of an element, nor of a nanometre."""
    body = ToolAssembly(
        (BeamSegment(0.05130000043, 0.012, STEEL),),
        (BeamSegment(0.04010000037, 0.04, STEEL, inner_diameter=0.012),),
        0.02070000041,
        Contact(1e10, 1e6),
    )
    structure = rod_structure(body)
    assert structure.mass.sum() == pytest.approx(sum(s.mass for s in (*body.tool, *body.holder)), rel=1e-6)
    assert np.count_nonzero(natural_frequencies(structure) < 1.0) == 1
    np.testing.assert_allclose(structure.stiffness.sum(axis=1), 0.0, atol=1e-6 * structure.stiffness.max())


def test_a_rod_that_twists():
    """A plain one, in closed form: theta at one end over a moment at the other is -1 / (G J k sin(k L)), k = w sqrt(rho / G)."""
    material, length, diameter = replace(STEEL, loss_factor=0.0), 0.2, 0.02
    half = (BeamSegment(0.5 * length, diameter, material),)
    # below its first resonance, which nothing damps
    omega = OMEGA[OMEGA < 4e4]
    found = rod_poles(ToolAssembly(half, half, insertion=0.0), float(OMEGA[-1]), twisting=True).receptance(omega)
    assert found.rows == TWISTING_ENDS
    rigidity, k = material.shear_modulus * np.pi / 32.0 * diameter**4, omega * np.sqrt(material.density / material.shear_modulus)
    across, own = -1.0 / (rigidity * k * np.sin(k * length)), -1.0 / (rigidity * k * np.tan(k * length))
    truth = np.array([[own, across], [across, own]]).transpose(2, 0, 1)
    assert off(found.values, truth) < 1e-3


@pytest.mark.parametrize("twisting", [False, True])
def test_a_rod_in_few_coordinates(twisting):
    """Mass one, stiffness and damping projected: the same receptances as from its poles."""
    body = ToolAssembly(TOOL, HOLDER, 0.03, Contact(2e10, 1e6, 1e4))
    rod, omega = reduced_rod(body, 3e4, twisting), OMEGA[OMEGA < 3e4]
    assert len(rod.damping) < 30
    one = np.eye(len(rod.damping))
    found = np.array([rod.ports @ np.linalg.solve(rod.stiffness + 1j * w * rod.damping - w**2 * one, rod.ports.T) for w in omega])
    assert off(found, rod_poles(body, 3e4, twisting).receptance(omega).values) < 1e-5
