"""Surface location error: static and resonant closed forms, and a march of the virtual machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_history
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.surface_error import Wall, surface_location_error
from rcsa_ident.virtual.milling import mill_cut
from rcsa_ident.virtual.reduction import Poles

TIP = (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y))
ALUMINIUM = CuttingCoefficients(700e6, 0.3)
EDGES = CuttingCoefficients(700e6, 0.3, 0.0, 8e3, 5e3)
DOWN, UP = Engagement.from_immersion(0.1, "down"), Engagement.from_immersion(0.1, "up")
#: Axis, natural frequency [Hz], damping ratio, stiffness [N/m].
MODES = ((0, 620.0, 0.03, 8e6), (1, 700.0, 0.02, 6e6))
OMEGA = 2.0 * np.pi * np.arange(0.0, 20000.0, 1.0)


def tip(modes=MODES, omega=OMEGA):
    values = np.zeros((omega.size, 2, 2), dtype=complex)
    for axis, frequency, zeta, stiffness in modes:
        r = omega / (2.0 * np.pi * frequency)
        values[:, axis, axis] += 1.0 / stiffness / (1.0 - r**2 + 2j * zeta * r)
    return Receptance(omega, values, TIP, TIP)


def process(engagement=DOWN, cutter=None, coefficients=ALUMINIUM, **more):
    return MillingProcess(cutter or Cutter(2, 12e-3, np.radians(30.0)), coefficients, engagement, feed_per_tooth=1e-4, **more)


def turned(modes, angle):
    """The same machine, seen from axes turned by -angle."""
    values = tip(modes).values
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, -s], [s, c]])
    return Receptance(OMEGA, rotation @ values @ rotation.T, TIP, TIP)


@pytest.mark.slow
@pytest.mark.parametrize("engagement", [DOWN, UP, Engagement(0.0, np.pi)])
@pytest.mark.parametrize("wall", [None, Wall.ENTRY])
def test_a_slow_cut_bends_the_tool_as_its_force_of_the_moment_does(engagement, wall):
    """Far below resonance: error = compliance times the force at the instant when the edge makes the wall, no series involved."""
    if wall is Wall.ENTRY and engagement is DOWN:
        with pytest.raises(InputError, match="wall: found entry, allowed is one of exit"):
            surface_location_error(tip(), process(engagement), [10.0], 4e-3, wall)
        return
    cutter = Cutter(4, 12e-3, np.radians(30.0))
    cut = process(engagement, cutter, EDGES)
    found = surface_location_error(tip(), cut, np.array([6.0]), 4e-3, wall, heights=9)
    at_entry = wall is Wall.ENTRY or engagement is UP
    assert found.wall is (Wall.ENTRY if at_entry else Wall.EXIT)
    lag = 2.0 * found.height * np.tan(cutter.helix) / cutter.diameter
    # half a slice beside the edge's own place: a force that jumps there has no value of its own
    angle = (0.0 if at_entry else np.pi) + lag
    around = [force_history(cutter, cut.conditions(6.0, 4e-3), EDGES, angle + d, slices=4000)[:, 1] for d in (-1e-3, 1e-3)]
    static = 0.5 * (around[0] + around[1]) / 6e6 * (-1.0 if at_entry else 1.0)
    np.testing.assert_allclose(found.error[0, 1:-1], static[1:-1], atol=0.012 * np.max(np.abs(static)))


@pytest.mark.slow
@pytest.mark.parametrize(("rpm", "depth"), [(9000.0, 0.4e-3), (13000.0, 0.4e-3), (20500.0, 0.8e-3)])
@pytest.mark.parametrize(("engagement", "feed_angle"), [(DOWN, 0.0), (UP, 0.0), (DOWN, 0.5 * np.pi)])
def test_a_march_of_the_virtual_machine_leaves_the_same_wall(rpm, depth, engagement, feed_angle):
    """The march knows regeneration, loss of contact and the whole transient; what it leaves after it is the closed form's wall."""
    names = tuple(Coordinate.parse(f"{point}.{axis}") for point in ("tip", "flange", "fixture") for axis in "xy")
    pole = np.array([2 * np.pi * f * (-z + 1j * np.sqrt(1 - z**2)) for _, f, z, _ in MODES])
    inputs, outputs = np.zeros((2, 2), dtype=complex), np.zeros((6, 2), dtype=complex)
    for k, (axis, frequency, _, stiffness) in enumerate(MODES):
        inputs[k, axis] = (2 * np.pi * frequency) ** 2 / stiffness / (2j * pole[k].imag)
        outputs[axis::2, k] = 1.0
    cut = process(engagement, feed_angle=feed_angle)
    speed = rpm * np.pi / 30.0
    step = 2.0 * np.pi / speed / 2000
    history = mill_cut(Poles(pole, inputs, outputs, names), cut.cutter, cut.conditions(speed, depth), ALUMINIUM, step, 2000 * 70, slices=24)
    found = surface_location_error(tip(), cut, np.array([speed]), depth, heights=5)
    side = np.pi if found.wall is Wall.EXIT else 0.0
    instants = side + 2.0 * found.height * np.tan(cut.cutter.helix) / cut.cutter.diameter + 2.0 * np.pi * 68
    normal = history.tip @ cut.machine_from_feed[:, 1]
    left = np.interp(instants, history.angle, normal) * (1.0 if found.wall is Wall.EXIT else -1.0)
    scale = np.ptp(normal[-4000:])
    np.testing.assert_allclose(found.error[0], left, atol=0.01 * scale)


def test_sign_changes_where_a_harmonic_of_the_teeth_meets_the_mode():
    """Below f_n = k f_tooth the tool follows the force, above it moves against it: the published trend, for a short blow."""
    lone = ((1, 700.0, 0.01, 5e6),)
    short = process(Engagement.from_immersion(0.01, "down"), Cutter(2, 12e-3))
    for k in (1, 2, 3):
        resonant = 2.0 * np.pi * 700.0 / (k * 2)
        below, above = surface_location_error(tip(lone), short, resonant * np.array([0.97, 1.03]), 1e-3).mean
        assert below * above < 0.0
        around = surface_location_error(tip(lone), short, resonant * np.linspace(0.97, 1.03, 61), 1e-3).mean
        crossing = np.flatnonzero(np.diff(np.sign(around)))
        assert crossing.size == 1


def test_one_harmonic_alone_is_a_closed_form():
    """A lightly damped mode at the tooth-passing frequency: Y = -i Q F / k, all else is small."""
    lone = ((1, 700.0, 1e-3, 5e6),)
    cutter = Cutter(2, 12e-3)
    speed = 2.0 * np.pi * 700.0 / 2
    found = surface_location_error(tip(lone), process(cutter=cutter), [speed], 1e-3, heights=1).error[0, 0]
    angle = np.linspace(0.0, 2.0 * np.pi, 40000, endpoint=False)
    force = force_history(cutter, process(cutter=cutter).conditions(speed, 1e-3), ALUMINIUM, angle, slices=1)[:, 1]
    line = 2.0 * np.mean(force * np.exp(-2j * angle))
    assert found == pytest.approx((line * (-0.5j / 1e-3) / 5e6 * np.exp(2j * np.pi)).real, rel=0.02)


@settings(max_examples=15, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(300.0, 2500.0))
def test_a_machine_turned_with_its_feed_leaves_the_same_wall(angle, speed):
    straight = surface_location_error(tip(), process(), [speed], 1e-3, heights=3).error
    other = surface_location_error(turned(MODES, angle), process(feed_angle=angle), [speed], 1e-3, heights=3).error
    np.testing.assert_allclose(other, straight, atol=1e-9 * np.max(np.abs(straight)) + 1e-15)


def test_error_grows_with_the_feed_and_a_straight_edge_makes_a_straight_wall():
    cut = process(cutter=Cutter(2, 12e-3))
    one = surface_location_error(tip(), cut, np.array([900.0, 1200.0]), 1e-3)
    two = surface_location_error(tip(), replace(cut, feed_per_tooth=2e-4), np.array([900.0, 1200.0]), 2e-3)
    np.testing.assert_allclose(two.error, 4.0 * one.error, rtol=1e-9)
    assert np.ptp(one.error, axis=1) == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(one.mean, one.largest, rtol=1e-9)


def test_the_deepest_of_unequal_teeth_leaves_the_wall():
    stiff = tip(((0, 5000.0, 0.05, 1e12), (1, 5000.0, 0.05, 1e12)))
    cutter = Cutter(2, 12e-3, runout=np.array([4e-6, -4e-6]))
    found = surface_location_error(stiff, process(cutter=cutter), [900.0], 1e-3)
    np.testing.assert_allclose(found.error, -4e-6, rtol=1e-3)
    assert any("not alike" in doubt for doubt in found.warnings)


def test_what_the_receptance_lacks_is_told():
    high = Receptance(OMEGA[400:900], tip().values[400:900], TIP, TIP)
    words = " ".join(surface_location_error(high, process(), [900.0], 1e-3).warnings)
    assert "begins at 400 Hz" in words
    assert "ends at 899 Hz" in words
    assert surface_location_error(tip(), process(), [900.0], 1e-3).warnings == ()


@pytest.mark.parametrize(
    ("changed", "depth", "words"),
    [
        ({"feed_per_tooth": None}, 1e-3, "feed_per_tooth"),
        ({"engagement": Engagement(0.5, 2.5)}, 1e-3, "only there a wall is left"),
        ({}, 0.0, "depth"),
    ],
)
def test_what_has_no_answer(changed, depth, words):
    with pytest.raises(InputError, match=words):
        surface_location_error(tip(), replace(process(), **changed), [900.0], depth)
