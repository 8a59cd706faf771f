"""A tip in the place of a machine: from tap tests with their cross terms, or from a modal model."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.machine.known_tip import KnownTip, measured_tip
from rcsa_ident.stability.lobes import stability_lobes, uncoupled_planes
from rcsa_ident.stability.tip_modes import TipModes
from tests.fixtures import by_hand

FREQUENCY = np.arange(200.0, 2000.0, 2.0)
TIP_Y = (Coordinate("tip", Dof.Y),)
OMEGA = 2.0 * np.pi * FREQUENCY
SPEEDS = np.array([600.0, 800.0, 1100.0])


def process(feed_angle=0.3):
    return MillingProcess(Cutter(2, 0.012), CuttingCoefficients(9e8, 0.3), Engagement.from_immersion(0.5, "down"), feed_angle)


def planes():
    return [
        (2 * np.pi * f) ** 2 / k / ((2 * np.pi * f) ** 2 - OMEGA**2 + 0.06j * 2 * np.pi * f * OMEGA)
        for f, k in ((700.0, 8e6), (800.0, 4e6))
    ]


def test_cross_receptances_of_a_tap_test():
    """A machine whose planes are turned by 30 degrees, measured along X and Y with its cross term, is that machine."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turn = np.array([[c, -s], [s, c]])
    full = np.einsum("ip,pn,jp->nij", turn, np.array(planes()), turn)
    curves = {Dof.X: (FREQUENCY, full[:, 0, 0]), Dof.Y: (FREQUENCY, full[:, 1, 1])}
    cross = {(Dof.X, Dof.Y): (FREQUENCY, full[:, 0, 1])}
    tip = measured_tip(curves, cross)
    np.testing.assert_allclose(tip.values, full, rtol=1e-12)
    # the same cut with its feed turned along with the machine
    straight = uncoupled_planes(
        *(Receptance(OMEGA, h[:, None, None], *[(Coordinate("tip", d),)] * 2) for d, h in zip((Dof.X, Dof.Y), planes(), strict=True))
    )
    here, there = stability_lobes(tip, process(0.3 + np.pi / 6), SPEEDS, 0.1), stability_lobes(straight, process(), SPEEDS, 0.1)
    np.testing.assert_allclose(here.limit_depth, there.limit_depth, rtol=1e-9)
    both = measured_tip(curves, {**cross, (Dof.Y, Dof.X): (FREQUENCY, 2.0 * full[:, 1, 0])})
    np.testing.assert_allclose(both.values[:, 1, 0], 2.0 * full[:, 1, 0])
    with pytest.raises(InputError, match="cross FRF: found one without an FRF in Y"):
        measured_tip({Dof.X: curves[Dof.X]}, cross)
    with pytest.raises(InputError, match="cross FRF: found 5 frequencies"):
        measured_tip(curves, {(Dof.X, Dof.Y): (FREQUENCY[:5], full[:5, 0, 1])})


def test_an_axial_frf_stands_behind_the_others():
    x, y = planes()
    curves = {Dof.X: (FREQUENCY, x), Dof.Z: (FREQUENCY, y)}
    tip = measured_tip(curves)
    assert [str(row) for row in tip.rows] == ["tip.x", "tip.y", "tip.z"]
    np.testing.assert_array_equal(tip.between("tip.z", "tip.z"), y)
    np.testing.assert_array_equal(tip.between("tip.x", "tip.x"), x)
    assert not np.any(tip.between("tip.y", "tip.y"))
    with pytest.raises(InputError, match="z receptance: found 5 frequencies"):
        measured_tip({Dof.X: (FREQUENCY, x), Dof.Z: (FREQUENCY[:5], y[:5])})
    full = measured_tip({**curves, Dof.Y: (FREQUENCY, y)}, {(Dof.X, Dof.Z): (FREQUENCY, 0.1 * x)})
    np.testing.assert_array_equal(full.between("tip.x", "tip.z"), 0.1 * x)
    np.testing.assert_array_equal(full.between("tip.z", "tip.x"), 0.1 * x)


def test_a_direction_that_was_not_measured_is_rigid():
    tip = measured_tip({Dof.Y: (FREQUENCY, planes()[1])})
    np.testing.assert_array_equal(tip.between("tip.y", "tip.y"), planes()[1])
    for entry in (("tip.x", "tip.x"), ("tip.x", "tip.y"), ("tip.y", "tip.x")):
        assert not np.any(tip.between(*entry))


def test_a_measured_tip_answers_for_itself_whatever_is_asked():
    known = measured_tip({Dof.X: (FREQUENCY, planes()[0])})
    source = KnownTip(known)
    tip = source.tip(by_hand.tooling(), 2.0 * np.pi * np.array([1.0, 2.0]))
    np.testing.assert_array_equal(tip.omega, known.omega)
    np.testing.assert_array_equal(tip.values, known.values)
    assert (tip.rows, tip.variation) == (known.rows, None)
    for beyond in (1.0, 1.5):
        np.testing.assert_array_equal(source.lines(beyond), OMEGA)
    assert (source.band, source.speed_range, source.workpiece, source.remarks, source.unknowns) == (None, None, None, (), 0)
    assert source.prepared
    assert source.at(1234.0) is source
    ((model, places),) = source.models(SPEEDS)
    assert model is source
    np.testing.assert_array_equal(places, [0, 1, 2])


@pytest.mark.parametrize(("own_hz", "flexibility", "told"), [(2600.0, 3.0, True), (12_000.0, 0.05, False), (1500.0, 3.0, False)])
def test_a_measurement_that_ends_below_the_tools_own_mode_says_so(own_hz, flexibility, told):
    # a machine's mode that is seen, and the tool's, so many times as flexible
    frequency = np.arange(20.0, 2001.0, 2.0)
    modes = normal_modes(
        2.0 * np.pi * np.array([700.0, own_hz]), np.array([0.04, 0.02]), np.array([[1.0], [flexibility**0.5 * own_hz / 700.0]]), TIP_Y
    )
    values = np.asarray(modes.receptance(2.0 * np.pi * frequency).values)[:, 0, 0]
    noisy = values * (1.0 + 0.02 * np.random.default_rng(1).standard_normal(values.size))
    found = KnownTip(measured_tip({Dof.Y: (frequency, noisy)})).remarks
    assert [remark.startswith("the receptance in Y ends at 2000 Hz with a real part of") for remark in found] == [True] * told


@pytest.mark.parametrize(("low_hz", "drift", "told"), [(0.0, 3e-4, True), (0.0, 0.0, False), (0.0, 1e-9, False), (18.0, 0.0, False)])
def test_drift_over_the_square_of_the_frequency_says_so(low_hz, drift, told):
    # modes of a tip, beside them the slow and soft mode of an arm, or an acceleration [m/s^2/N] that nobody made
    frequency = np.arange(2.0, 3001.0, 2.0)
    omega = 2.0 * np.pi * frequency
    modes = ((900.0, 1e7), (1900.0, 8e6), (low_hz, 3e6))
    values = sum(1.0 / (k * (1.0 - (frequency / f) ** 2 + 0.06j * frequency / f)) for f, k in modes if f)
    found = KnownTip(measured_tip({Dof.X: (frequency, values - drift / omega**2)})).remarks
    assert [remark.startswith("the receptance in X falls from its first line on and is negative up to 4 Hz") for remark in found] == [
        True
    ] * told


def test_modes_of_a_tip_stay_modes():
    model = normal_modes(np.array([5000.0]), np.array([0.01]), np.ones((1, 1)), (Coordinate("tip", Dof.Y),))
    modes = TipModes.of({Dof.Y: model})
    source = KnownTip(modes)
    assert source.tip(by_hand.tooling(), OMEGA) is modes
    np.testing.assert_array_equal(source.lines(), modes.receptance().omega)
