"""Which ways of cutting push the tool in further directions: feed along Y does, up-milling at half immersion with four teeth does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force_directions import WORTH, gain_across, lines_of, told_across, turned

COEFFICIENTS = CuttingCoefficients(902e6, 0.26)
SPEEDS = np.linspace(900.0, 2000.0, 24)
HIGHEST = 2.0 * np.pi * 4500.0


def campaign(teeth=4, immersion=0.5, strategy="down", feed=0.0):
    found = []
    for speed in SPEEDS:
        conditions = CuttingConditions(speed, 4e-4, 1e-4, Engagement.from_immersion(immersion, strategy), feed)
        found.append(lines_of(Cutter(teeth, 0.012), conditions, COEFFICIENTS, HIGHEST))
    return found


@pytest.mark.parametrize("feed", [0.5 * np.pi, 0.25 * np.pi, -0.5 * np.pi])
def test_another_feed_direction_tells_more(feed):
    assert gain_across(campaign(), campaign(feed=feed)) > WORTH


def test_up_milling_half_immersed_with_four_teeth_tells_nothing_new():
    """Its lines are the same with the opposite sign: sin^2 = 1 - cos^2."""
    down, up = campaign(), campaign(strategy="up")
    for (_, one), (_, other) in zip(down, up, strict=True):
        np.testing.assert_allclose(other, -one, rtol=1e-9, atol=1e-12)
    assert gain_across(down, up) == pytest.approx(1.0, rel=1e-9)


def test_the_opposite_feed_is_the_same_direction():
    assert gain_across(campaign(), campaign(feed=np.pi)) == pytest.approx(1.0, rel=1e-9)


def test_where_other_teeth_push_otherwise_up_milling_may_tell():
    """A rule would not know: three teeth, or another immersion."""
    assert gain_across(campaign(teeth=3), campaign(teeth=3, strategy="up")) > 1.02


def test_alike_directions_tell_one_and_even_ones_both():
    omega = np.full(8, 1000.0)
    alike = np.outer(np.exp(1j * np.arange(8)), [3.0, 4.0j])
    assert told_across(omega, alike)[1] == pytest.approx([0.0], abs=1e-7)
    even = alike.copy()
    even[::2] = np.outer(np.ones(4), [4.0, -3.0j])
    assert told_across(omega, even)[1] == pytest.approx([np.sqrt(0.5)])
    # a line alone, and one without force, tell nothing across
    assert told_across(omega[:1], alike[:1])[1] == pytest.approx([0.0])
    assert told_across(omega[:1], 0.0 * alike[:1])[1].size == 0
    # whatever the forces' size
    np.testing.assert_allclose(told_across(omega, even * np.arange(1, 9)[:, None])[1], [np.sqrt(0.5)])


def test_cuts_in_alternating_directions_are_told_apart_from_one():
    mixed = [a if k % 2 else b for k, (a, b) in enumerate(zip(campaign(), campaign(feed=0.5 * np.pi), strict=True))]
    assert gain_across(mixed, turned(mixed)) < gain_across(campaign(), campaign(feed=0.5 * np.pi))


def test_a_feed_turned_turns_the_force():
    conditions = CuttingConditions(1000.0, 4e-4, 1e-4, Engagement.from_immersion(0.5, "down"))
    along, across = (
        lines_of(Cutter(4, 0.012), replace(conditions, feed_angle=angle), COEFFICIENTS, HIGHEST) for angle in (0.0, 0.5 * np.pi)
    )
    np.testing.assert_allclose(turned([along])[0][1], across[1], rtol=1e-9, atol=1e-12)
