"""Corner radii that nobody told exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.corner import corner_change, has_corner, with_corner
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.cutting.profile import Profile

HALF = CuttingConditions(900.0, 0.4e-3, 1e-4, Engagement.from_immersion(0.5, "down"))
COEFFICIENTS = CuttingCoefficients(9e8, 0.3, 0.2, 12e3, 10e3, 3e3)
FLAT = Cutter(4, 0.012, np.radians(30.0))
BULL = Cutter(4, 0.012, np.radians(30.0), shape="bull-nose", corner_radius=0.5e-3, profile=Profile.bull_nose(0.012, 0.5e-3, 0.02))
ORDERS = 4 * np.arange(1, 6)


def test_which_cutters_have_a_corner():
    assert has_corner(FLAT)
    assert has_corner(BULL)
    # taken for a cylinder: nobody knows its corner's outline
    assert not has_corner(replace(BULL, profile=None))
    assert not has_corner(Cutter(2, 0.012, shape="ball", corner_radius=0.006, profile=Profile.ball(0.012)))


def test_another_corner_keeps_the_length_of_cut():
    other = with_corner(BULL, 0.7e-3)
    assert other.outline.radius_at(0.0) == pytest.approx(0.006 - 0.7e-3)
    assert other.outline.height == BULL.outline.height
    assert with_corner(BULL, 0.0).profile is None
    assert with_corner(FLAT, 0.2e-3).outline.radius_at(0.2e-3) == pytest.approx(0.006)


@pytest.mark.parametrize("cutter", [FLAT, BULL])
def test_the_change_is_that_of_the_lines(cutter):
    change = corner_change(cutter, HALF, COEFFICIENTS, ORDERS, 0.1e-3)
    told, wider = (force_lines(with_corner(cutter, cutter.corner_radius + r), HALF, COEFFICIENTS, ORDERS) for r in (0.0, 0.1e-3))
    assert np.exp(change) * told == pytest.approx(wider, rel=1e-12)


def test_lines_of_a_flat_cutter_go_straight_with_a_small_radius():
    one, two = (np.expm1(corner_change(FLAT, HALF, COEFFICIENTS, ORDERS, r)) for r in (0.05e-3, 0.1e-3))
    assert np.abs(two - 2.0 * one).max() < 0.03 * np.abs(two).max()


def test_no_force_does_not_change():
    slot = CuttingConditions(900.0, 0.4e-3, 1e-4, Engagement(0.0, np.pi))
    assert np.all(corner_change(FLAT, slot, COEFFICIENTS, np.array([1, 2, 3]), 0.1e-3) == 0.0)
