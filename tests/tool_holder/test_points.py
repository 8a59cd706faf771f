"""Receptances at points between tip and flange, and what a sensor's mass does there."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.model import point_name, receptance_at_points, tool_holder_receptance

CARBIDE, STEEL = MATERIALS["carbide"], MATERIALS["steel"]
TOOL = (BeamSegment(0.026, 0.0096, CARBIDE), BeamSegment(0.0845, 0.012, CARBIDE))
HOLDER = (BeamSegment(0.04, 0.05, STEEL, 0.012), BeamSegment(0.032, 0.05, STEEL, 0.014), BeamSegment(0.026, 0.063, STEEL, 0.02))
OMEGA = 2.0 * np.pi * np.linspace(60.0, 5000.0, 40)


@pytest.fixture(params=[Contact(2e10, 6e5, 6e4, 9.0), None], ids=["contact", "rigid"])
def assembly(request):
    return ToolAssembly(TOOL, HOLDER, 0.04, request.param)


def test_both_ends_are_points_like_others(assembly):
    length = assembly.stickout + assembly.holder_length
    found = receptance_at_points(assembly, OMEGA, [0.0, length])
    known = tool_holder_receptance(assembly, OMEGA).values
    scale = np.abs(known).max(axis=0)
    assert np.all(np.abs(found.values[:, :4, :4] - known) < 1e-5 * scale)
    np.testing.assert_array_equal(found.values[:, 4:6], found.values[:, :2])
    np.testing.assert_array_equal(found.values[:, 6:], found.values[:, 2:4])


def test_points_of_a_bar_are_those_of_two_bars_joined_there():
    """The same bar with its halves named tool and holder: the point between them is where they meet, on either side."""
    whole = ToolAssembly((BeamSegment(0.2, 0.03, STEEL),), (BeamSegment(0.01, 0.03, STEEL),), 0.0)
    halves = ToolAssembly((BeamSegment(0.07, 0.03, STEEL),), (BeamSegment(0.14, 0.03, STEEL),), 0.0)
    one, two = (receptance_at_points(each, OMEGA, [0.07, 0.15]) for each in (whole, halves))
    scale = np.abs(one.values).max(axis=0)
    # each to the error of its own mesh
    assert np.all(np.abs(one.values - two.values) < 1e-4 * scale)


def test_every_pair_of_points_is_reciprocal(assembly):
    found = receptance_at_points(assembly, OMEGA, [0.03, 0.0705, 0.12]).values
    assert np.all(np.abs(found - found.transpose(0, 2, 1)) < 1e-6 * np.abs(found).max(axis=0))


def test_a_sensor_adds_its_mass_where_it_is_fixed(assembly):
    mass, place = 0.006, 0.03
    plain = receptance_at_points(assembly, OMEGA, [place])
    loaded = receptance_at_points(assembly, OMEGA, [place], (place, mass)).values
    at = plain.values[:, 4, 4]
    # a rank-one change of the dynamic stiffness [Sherman and Morrison]
    factor = OMEGA**2 * mass / (1.0 - OMEGA**2 * mass * at)
    expected = plain.values + factor[:, None, None] * plain.values[:, :, 4:5] * plain.values[:, 4:5, :]
    assert np.all(np.abs(loaded - expected) < 1e-5 * np.abs(expected).max(axis=0))
    assert np.abs(loaded[:, 0, 0] / plain.values[:, 0, 0] - 1.0).max() > 0.05
    assert point_name(place) == "30 mm"


@pytest.mark.parametrize("z", [-0.001, 0.2])
def test_a_point_beside_the_assembly_is_refused(assembly, z):
    with pytest.raises(InputError, match=r"0 to 168\.5 mm, the assembly's length"):
        receptance_at_points(assembly, OMEGA, [z])
