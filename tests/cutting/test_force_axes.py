"""Axes of a dynamometer found among all 8 or 48, from forces sampled over the angle; seeds fixed before the thresholds were chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_history
from rcsa_ident.cutting.force_axes import axes_choices
from rcsa_ident.cutting.force_record import ForceRecord
from rcsa_ident.cutting.signal_fit import Dynamometer

COEFFICIENTS = CuttingCoefficients(900e6, 0.27, 0.15, 14e3, 17e3, 3e3)
FEEDS = (4e-5, 8e-5, 1.2e-4)
ORDERS = 25
CUTS = {
    "slot, 2 teeth": (Cutter(2, 0.02, np.radians(30.0)), Engagement(0.0, np.pi), 2e-3),
    "slot, 4 teeth": (Cutter(4, 0.012, np.radians(35.0)), Engagement(0.0, np.pi), 4e-4),
    "half, down": (Cutter(4, 0.012, np.radians(30.0)), Engagement(0.5 * np.pi, np.pi), 1e-3),
    "half, up": (Cutter(3, 0.016, np.radians(40.0)), Engagement(0.0, 0.5 * np.pi), 1e-3),
    "a quarter, down": (Cutter(2, 0.012, np.radians(30.0)), Engagement(2.0, np.pi), 1e-3),
}


def records(cut, axes, rng, ringing=False):
    """Three feeds seen through turned channels, with run-out, noise and, where it rings, a dynamometer's resonance in the band."""
    cutter, engagement, depth = CUTS[cut]
    eccentric = replace(cutter, runout=4e-6 * np.cos(cutter.tooth_angle - 1.1))
    angle = 2.0 * np.pi * np.arange(2048) / 2048
    order = np.arange(ORDERS)
    made = []
    for feed in FEEDS:
        conditions = CuttingConditions(630.0, depth, feed, engagement)
        lines = np.fft.rfft(force_history(eccentric, conditions, COEFFICIENTS, angle, slices=32), axis=0)[:ORDERS] / angle.size
        lines[1:] *= 2.0
        lines = lines * np.exp(1j * order * 2.0 * np.pi * rng.random())[:, None]
        if ringing:
            follow = Dynamometer(2, 1000.0, 0.04).response(order * 630.0, np.zeros(4))
            lines = lines * follow[:, [0, 1, 1]]
        seen = lines[:, : axes.shape[0]] @ axes.T
        seen = seen + 0.5 * (rng.normal(size=seen.shape) + 1j * rng.normal(size=seen.shape) * (order > 0)[:, None])
        made.append(ForceRecord(cutter, conditions, "a", seen, np.full(seen.shape, 0.25), np.zeros((2, *seen.shape))))
    return made


@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("channels", [2, 3])
def test_the_channels_are_told_apart(cut, channels):
    """Four random mountings each, left-handed ones as well: the true one is first, with its coefficients."""
    rng = np.random.default_rng(41)
    for _ in range(4):
        axes = rng.choice([-1.0, 1.0], size=channels)[:, None] * np.eye(channels)[rng.permutation(channels)]
        first = axes_choices(records(cut, axes, rng))[0]
        np.testing.assert_array_equal(first.axes, axes)
        assert first.as_told == np.array_equal(axes, np.eye(channels))
        assert first.forces.of("K_tc")[0] == pytest.approx(900e6, rel=0.05)


@pytest.mark.parametrize("cut", CUTS)
def test_a_dynamometer_that_rings(cut):
    rng = np.random.default_rng(42)
    axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = axes_choices(records(cut, axes, rng, ringing=True))
    np.testing.assert_array_equal(found[0].axes, axes)
    assert found[0].shown() == ("+Y", "+X", "+Z")


def test_another_cutter_than_the_one_that_cut():
    """Three teeth told where four cut: no choice explains the force over time, and that is said instead of the best of them."""
    told = [replace(r, cutter=Cutter(3, 0.012, r.cutter.helix)) for r in records("half, down", np.eye(3), np.random.default_rng(43))]
    with pytest.raises(InputError, match="unexplained by the best of 48 choices"):
        axes_choices(told)


def test_feeds_that_are_told_the_wrong_way_round():
    """Forces that fall while the feed is told to rise belong to no cutting force, from whichever side they are seen."""
    made = records("half, down", np.eye(2), np.random.default_rng(44))
    feeds = [r.conditions.feed_per_tooth for r in made][::-1]
    turned = [replace(r, conditions=replace(r.conditions, feed_per_tooth=f)) for r, f in zip(made, feeds, strict=True)]
    with pytest.raises(InputError, match="axes of the force sensors"):
        axes_choices(turned)


def test_one_feed_tells_no_axes():
    made = records("half, down", np.eye(2), np.random.default_rng(45))
    with pytest.raises(InputError, match="two or more different feeds"):
        axes_choices([made[0]] * 3)
