"""Which directions of a flange stand apart, and what one that is doubted responds."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.machine.flange_part import Doubt, FlangePart, JointedFlange, Perturbation, independent_parts
from tests.machine.planes import FLANGES, JOINT, oblique

OMEGA = 2.0 * np.pi * np.array([500.0, 1000.0, 2000.0])


def flange(values, rows=FLANGES):
    return Receptance(np.array([100.0, 200.0]), np.array(values, dtype=complex), rows, rows)


def test_cross_terms_at_a_single_frequency_join_the_planes():
    straight = np.zeros((2, 4, 4))
    straight[:, :2, :2] = straight[:, 2:, 2:] = np.eye(2)
    assert independent_parts(flange(straight)) == [plane("flange", Dof.X), plane("flange", Dof.Y)]
    for place in ((1, 0, 2), (0, 3, 1)):
        crossed = straight.copy()
        crossed[place] = 1e-30
        assert independent_parts(flange(crossed)) == [FLANGES]


def test_one_plane_is_one_part_though_its_slope_may_feel_nothing():
    assert independent_parts(flange(np.array([np.eye(2)] * 2), plane("flange", Dof.Y))) == [plane("flange", Dof.Y)]


def test_the_order_of_the_planes_is_that_of_the_flange():
    rows = (FLANGES[3], FLANGES[0], FLANGES[2], FLANGES[1])
    assert independent_parts(flange(np.array([np.eye(4)] * 2), rows)) == [plane("flange", Dof.Y), plane("flange", Dof.X)]


@pytest.mark.parametrize("rows", [FLANGES[:1], FLANGES[::2], FLANGES[:3], plane("spindle"), (*FLANGES[:2], *plane("tip", Dof.Y))])
def test_half_a_plane_or_another_point_is_refused(rows):
    with pytest.raises(InputError, match="flange coordinates"):
        independent_parts(flange(np.ones((2, len(rows), len(rows))), rows))


def test_w_is_the_flange_and_the_joints_compliance():
    here = JointedFlange(oblique(), JOINT).interface(OMEGA)
    translation = 1.0 / (2e9 + 2000j * OMEGA)
    slope = 1.0 / (5e6 + 10j * OMEGA)
    expected = oblique().receptance(OMEGA).values.copy()
    for i, each in enumerate((translation, slope, translation, slope)):
        expected[:, i, i] += each
    np.testing.assert_allclose(here, expected, rtol=1e-12)
    np.testing.assert_array_equal(JointedFlange(oblique(), None).interface(OMEGA), oblique().receptance(OMEGA).values)


def candidate(hertz):
    modes = normal_modes([2.0 * np.pi * hertz], [0.05], [[0.2, 1.0]], plane("flange"))
    return JointedFlange(modes, LumpedJoint(2e9, 5e6))


def frequency(each):
    return each.flange.omega_n / (2.0 * np.pi)


def test_a_parts_changes_are_those_of_its_steps_and_rivals():
    doubt = Doubt(
        (Perturbation(candidate(905.0), candidate(895.0), 0.7), Perturbation(candidate(901.0), candidate(899.0), 2.0)), (candidate(950.0),)
    )
    here, change = FlangePart(plane("flange"), candidate(900.0), lambda: doubt).response(frequency)
    np.testing.assert_allclose(here, [900.0])
    np.testing.assert_allclose(change, [[7.0], [4.0], [50.0]])


def test_an_empty_doubt_is_one_direction_without_change_and_none_at_all_is_none():
    np.testing.assert_array_equal(FlangePart(plane("flange"), candidate(900.0), Doubt).response(frequency)[1], [[0.0]])
    assert FlangePart(plane("flange"), candidate(900.0)).response(frequency)[1] is None


def test_doubts_are_asked_for_only_where_a_response_is_wanted():
    asked = []

    def doubt():
        asked.append(1)
        return Doubt()

    part = FlangePart(plane("flange"), candidate(900.0), doubt)
    assert not asked
    part.response(frequency)
    assert asked
