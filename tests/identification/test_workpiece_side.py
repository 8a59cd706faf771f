"""Modes of the workpiece's side from lines of many cuts, against structures that no mode has made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import ForceCoefficient, ForceTerm, force_and_slope
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.workpiece_side import workpiece_side
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement
from rcsa_ident.signals.recording import Quantity, Role, Sensor
from rcsa_ident.virtual.workpiece_side import SideMode, VirtualWorkpieceSide
from tests.fixtures import by_hand

HZ = 2.0 * np.pi
SENSORS = tuple(Sensor(f"table_{axis}", Quantity.ACCELERATION, axis, role=Role.TABLE) for axis in (Dof.X, Dof.Y))
COEFFICIENTS = CuttingCoefficients(900e6, 0.26)
TANGENTIAL = ForceCoefficient(ForceTerm.TANGENTIAL)
BAND = HZ * np.arange(450.0, 4000.0, 3.0)


def two_masses(omega):
    """A part in a vice on a table, damped in two places as no proportional damping is: its point receptance, by solving for it."""
    mass = np.diag([2.0, 0.8])
    stiffness = np.array([[9e6 + 45e6, -45e6], [-45e6, 45e6]])
    damping = np.array([[300.0 + 900.0, -900.0], [-900.0, 900.0]])
    dynamic = stiffness + 1j * omega[:, None, None] * damping - omega[:, None, None] ** 2 * mass
    return np.linalg.inv(dynamic)[:, 1, 1]


def stiff(omega):
    """So stiff that no accelerometer sees it."""
    return np.full(omega.size, 1e-14, dtype=complex)


def lines_of(gives_way, seed=1, cuts=24, noise=0.02, believed=1.0, delay_std=3e-7, axes=(Dof.X, Dof.Y), at=two_masses):
    """Cuts of a four-toothed cutter with noise of so much [m/s^2] in each line, and what an identification knows of them.

    `believed` is the tangential coefficient that forces are simulated with, over the true one; delays are known to `delay_std`.
    """
    rng = np.random.default_rng(seed)
    cutter, measurements, delays = Cutter(4, 12e-3, np.radians(30.0)), [], []
    for k, speed in enumerate(np.linspace(8000.0, 20_000.0, cuts) * np.pi / 30.0):
        order = np.arange(4, int(HZ * 4300.0 / speed) + 1, 4)
        conditions = CuttingConditions(speed, 0.4e-3, 0.1e-3, Engagement(0.5 * np.pi, np.pi))
        true, _ = force_and_slope(cutter, conditions, COEFFICIENTS, order)
        force, slope = force_and_slope(cutter, conditions, replace(COEFFICIENTS, tangential=believed * COEFFICIENTS.tangential), order)
        delay, omega = rng.uniform(0.0, HZ / speed / 4.0), order * speed
        found = {}
        for i, axis in enumerate(axes):
            deviation = noise / omega**2
            scatter = deviation * (rng.normal(size=order.size) + 1j * rng.normal(size=order.size))
            moved = -gives_way[axis](omega) * true[:, i] * np.exp(-1j * omega * delay) + scatter
            own = force[:, i]
            variance = (deviation / np.abs(own))[:, None] ** 2
            nothing = np.zeros((order.size, 1), dtype=complex)
            shares = np.array([[0.0, 1.0]])
            found[axis] = AxisLines(
                order, omega, (moved / own)[:, None], nothing, variance, np.ones(order.size), own, slope[:, i], shares=shares
            )
        measurements.append(CutMeasurement(f"{k}", "T1", speed, {}, 0.0, workpiece=found))
        delays.append(delay + delay_std * rng.normal())
    known = replace(
        by_hand.identification(),
        cut_ids=tuple(m.cut_id for m in measurements),
        delay=np.array(delays),
        delay_std=np.full(cuts, delay_std),
        spindle_speed=np.array([m.spindle_speed for m in measurements]),
        coefficients={TANGENTIAL: (-np.log(believed), 0.01)},
    )
    return known, measurements


@pytest.mark.parametrize("believed", [1.0, 1.3])
def test_a_table_of_two_masses_comes_back(believed):
    """Its receptance within a percent over the band, whatever the force was simulated with; nothing along the stiff axis."""
    side, remarks = workpiece_side(*lines_of({Dof.X: two_masses, Dof.Y: stiff}, believed=believed), SENSORS)
    x, y = side.axes[Dof.X], side.axes[Dof.Y]
    assert (x.omega_n.size, y.omega_n.size) in ((2, 0), (3, 0))
    error = x.receptance(BAND) - two_masses(BAND)
    assert np.linalg.norm(error) < 0.01 * np.linalg.norm(two_masses(BAND))
    # the mode within the band, of masses and springs without their dampers
    assert np.min(np.abs(x.omega_n / HZ / 1424.32 - 1.0)) < 0.01
    assert x.chi2_per_point < 1.5
    assert x.model_error < 0.01
    words, nothing = (str(each) for each in remarks)
    assert words == side.words
    assert nothing.startswith(f"workpiece's side, Y: table_y, on the table, shows nothing above the noise in {y.lines} lines")
    assert side.yielding.keys() == {Dof.X}


@pytest.mark.slow
def test_it_is_known_as_well_as_it_says():
    """Over many campaigns: errors of one true mode in their standard deviations; delays and forces are off by theirs."""
    true = np.log([HZ * 640.0, 0.03, 9e6])
    table = VirtualWorkpieceSide((SideMode(*np.exp(true)),), ())
    z, rng = [], np.random.default_rng(3)
    for seed in range(24):
        known, measurements = lines_of({Dof.X: lambda omega: table.receptance(omega)[:, 0, 0]}, seed, 8, 0.2, 1.0, 2e-6, axes=(Dof.X,))
        known = replace(known, coefficients={TANGENTIAL: (0.02 * rng.normal(), 0.02)})
        side, _ = workpiece_side(known, measurements, SENSORS)
        found = side.axes[Dof.X]
        assert found.omega_n.size == 1
        z.append((found.logs[:, 0] - true) / np.sqrt(np.diag(found.covariance)))
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert np.all(rms > 0.6)
    assert np.all(rms < 1.4)


def test_delays_that_are_off_by_more_than_is_told_do_not_go_unseen():
    known, measurements = lines_of({Dof.X: two_masses, Dof.Y: stiff})
    good, _ = workpiece_side(known, measurements, SENSORS)
    wrong = replace(known, delay=known.delay + 3e-5 * np.random.default_rng(2).normal(size=known.delay.size))
    bad, _ = workpiece_side(wrong, measurements, SENSORS)
    assert good.axes[Dof.X].model_error < 0.01 < bad.axes[Dof.X].model_error


def test_noise_alone_is_no_mode():
    for seed in range(6):
        side, remarks = workpiece_side(*lines_of({Dof.X: stiff, Dof.Y: stiff}, seed), SENSORS)
        assert side.yielding == {}
        assert side.words == ""
        assert len(remarks) == 2


def test_a_place_that_does_not_give_way_under_its_own_force_is_told():
    """A sensor elsewhere: two modes that move it against each other, which no passive point does."""

    def elsewhere(omega):
        one, other = (1.0 / k / (1.0 - (omega / w) ** 2 + 0.06j * omega / w) for w, k in ((HZ * 640.0, 9e6), (HZ * 900.0, 9e6)))
        return one - other

    side, remarks = workpiece_side(*lines_of({Dof.X: elsewhere, Dof.Y: stiff}), SENSORS)
    assert side.axes[Dof.X].model_error > 0.1
    assert any("unexplained: it may stand where the workpiece moves otherwise than at the cut" in each for each in remarks)


def test_an_axis_without_a_force_is_told():
    side, remarks = workpiece_side(*lines_of({Dof.X: two_masses}, axes=(Dof.X,)), SENSORS)
    assert side.axes.keys() == {Dof.X}
    assert "table_y, on the table, has no line: no cut at one speed has a force along Y" in str(remarks[-1])


def test_without_such_sensors_there_is_nothing():
    known, measurements = lines_of({Dof.X: two_masses, Dof.Y: stiff}, cuts=2)
    assert workpiece_side(known, measurements, ()) == (None, ())
    assert workpiece_side(replace(known, axes={}), measurements, SENSORS) == (None, ())
