"""Torque, power and removal rate of a cut, against quadratures; a motor's curve."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import tooth_force
from rcsa_ident.cutting.power import SpindleDrive, radial_depth, spindle_load

EDGES = CuttingCoefficients(800e6, 0.3, 0.1, 8e3, 6e3)


@given(
    st.integers(1, 8), st.floats(0.0, 3.0), st.floats(0.05, 3.1), st.floats(0.0, 0.3e-3), st.floats(0.1e-3, 20e-3), st.floats(50.0, 3000.0)
)
def test_power_is_what_the_edges_work(teeth, entry, width, feed, depth, speed):
    """Mean over the turn of the tangential force times the edge's velocity, from the force on the tool itself."""
    engagement = Engagement(entry, min(entry + width, np.pi))
    cutter = Cutter(teeth, 12e-3)
    found = spindle_load(cutter, CuttingConditions(speed, depth, feed, engagement), EDGES)
    node, weight = np.polynomial.legendre.leggauss(40)
    half = 0.5 * (engagement.exit - engagement.entry)
    phi = engagement.entry + half * (1.0 + node)
    # the edge moves along (cos phi, -sin phi): clockwise from the normal; the force on the tool acts against it
    along = np.stack([np.cos(phi), -np.sin(phi)], axis=1)
    against = -np.sum(tooth_force(phi, feed * np.sin(phi), EDGES)[:, :2] * along, axis=1)
    power = depth * teeth / (2.0 * np.pi) * half * np.sum(weight * against) * 6e-3 * speed
    assert found.power == pytest.approx(power, rel=1e-9)
    assert found.torque == pytest.approx(power / speed, rel=1e-9)


@pytest.mark.slow
@given(st.floats(0.02, 1.0), st.sampled_from(["up", "down"]))
def test_without_edges_a_cubic_metre_costs_the_tangential_coefficient(immersion, strategy):
    engagement = Engagement.from_immersion(immersion, strategy)
    cutter = Cutter(3, 20e-3, pitch=np.radians([100.0, 120.0, 140.0]), helix=0.5)
    found = spindle_load(cutter, CuttingConditions(800.0, 2e-3, 1e-4, engagement), CuttingCoefficients(700e6, 0.4))
    assert radial_depth(cutter, engagement) == pytest.approx(immersion * 20e-3)
    assert found.removal_rate == pytest.approx(2e-3 * immersion * 20e-3 * 3e-4 * 800.0 / (2.0 * np.pi))
    assert found.power == pytest.approx(700e6 * found.removal_rate)


def test_a_slot_in_aluminium_by_hand():
    """12 mm slot, 3 mm deep, 4 teeth, 0.1 mm, 10000 rev/min: 144 cm^3/min at 900 MPa are 2.16 kW and 2.06 N m."""
    found = spindle_load(
        Cutter(4, 12e-3), CuttingConditions(1e4 * np.pi / 30.0, 3e-3, 1e-4, Engagement(0.0, np.pi)), CuttingCoefficients(900e6, 0.3)
    )
    assert found.removal_rate * 60e6 == pytest.approx(144.0)
    assert found.power == pytest.approx(2160.0)
    assert found.torque == pytest.approx(2.0626, rel=1e-4)


def test_a_flat_drive():
    drive = SpindleDrive.flat(5e3, None, 1000.0)
    np.testing.assert_array_equal(drive.power_at(np.array([10.0, 1000.0, 1001.0])), [5e3, 5e3, 0.0])
    np.testing.assert_array_equal(drive.torque_at(np.array([10.0, 1000.0, 1001.0])), [np.inf, np.inf, 0.0])
    assert SpindleDrive.flat().power_at(np.array([1e6]))[0] == np.inf


def test_a_curve_and_a_limit_together():
    curve = SpindleDrive(np.array([100.0, 500.0, 1000.0]), np.array([1e3, 5e3, 5e3]), np.array([10.0, 10.0, 5.0]))
    both = curve.limited(SpindleDrive.flat(4e3, None, 900.0))
    np.testing.assert_allclose(both.power_at(np.array([50.0, 300.0, 500.0, 800.0, 950.0])), [1e3, 3e3, 4e3, 4e3, 0.0])
    np.testing.assert_allclose(both.torque_at(np.array([100.0, 750.0, 950.0])), [10.0, 7.5, 0.0])
    # where one end of an interval is not known nothing limits
    gap = SpindleDrive(np.array([100.0, 200.0, 300.0]), np.array([1e3, 2e3, np.inf]), np.full(3, np.inf))
    np.testing.assert_allclose(gap.power_at(np.array([150.0, 250.0, 400.0])), [1500.0, np.inf, np.inf])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1.0, 1.0], [1.0, 1.0], [1.0, 1.0]), "increasing speeds"),
        (([1.0, 2.0], [1.0, 0.0], [1.0, 1.0]), "power"),
        (([1.0, 2.0], [1.0, 1.0], [1.0]), "torque"),
        (([1.0], [1.0], [1.0], 0.0), "max_speed"),
    ],
)
def test_a_drive_that_is_none(arguments, words):
    with pytest.raises(InputError, match=words):
        SpindleDrive(*arguments)
