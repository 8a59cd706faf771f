"""Oblique coefficients from orthogonal tests: printed values, limits, a ball's tip, and a force balance that shares no formula."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.oblique import OrthogonalData, coefficients_at, coefficients_of_cut, inclinations, insert_angles
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.rows import rows_of

DEG = np.pi / 180.0
#: Relations of the usual form with figures whose source could not be read: of no material that anyone should cut by.
ALLOY = OrthogonalData(613e6, 19.1 * DEG, 0.29, 1.755, -0.028 / DEG, 0.331, -0.0082 / DEG)
SLOT = Engagement(0.0, np.pi)


@pytest.mark.parametrize(
    ("rake", "inclination", "chip", "printed"),
    [
        (0.0, 0.0, 0.1, (1745.57, 604.46, 0.0)),
        (0.0, 30.0, 0.1, (1748.06, 550.31, 642.37)),
        (12.0, 30.0, 0.05, (1509.98, 214.56, 514.93)),
        (5.0, 45.0, 0.02, (1934.85, 376.91, 1136.19)),
    ],
)
def test_coefficients_as_computed_elsewhere(rake, inclination, chip, printed):
    found = ALLOY.coefficients(rake * DEG, inclination * DEG, chip * 1e-3) / 1e6
    assert found == pytest.approx(printed, abs=5e-3)


def test_forces_on_the_rake_balance_friction_and_normal_force():
    """Of the three components, the share along the rake face over that across it is the friction angle's tangent, by plain geometry."""
    rake, inclination = 7.0 * DEG, 25.0 * DEG
    force = ALLOY.coefficients(rake, inclination, 0.06e-3)
    # axes: square to the edge in the cut surface, out of it, along the edge; the tool moves along `speed`
    along, out, edge = np.eye(3)
    speed = np.cos(inclination) * along + np.sin(inclination) * edge
    aside = np.sin(inclination) * -along + np.cos(inclination) * edge
    on_tool = -force[0] * speed + force[1] * out + force[2] * aside
    # the rake face leans back; the chip flows up it and aside, at the inclination
    normal, up = np.cos(rake) * along + np.sin(rake) * out, np.cos(rake) * out - np.sin(rake) * along
    flow = np.cos(inclination) * up - np.sin(inclination) * edge
    across = -float(on_tool @ normal)
    dragged = on_tool + across * normal
    assert np.degrees(np.arctan2(np.linalg.norm(dragged), across)) == pytest.approx(19.1 + 0.29 * 7.0, abs=1e-9)
    assert dragged / np.linalg.norm(dragged) == pytest.approx(flow, abs=1e-12)


def test_an_edge_that_leans_the_other_way_pushes_the_other_way_along():
    there, back = (ALLOY.coefficients(0.1, i, 1e-4) for i in (0.4, -0.4))
    assert back == pytest.approx(there * np.array([1.0, 1.0, -1.0]))


def test_a_balls_axial_coefficient_vanishes_at_its_tip():
    ball = Cutter(2, 0.012, helix=30 * DEG, profile=Profile.ball(0.012))
    rows = rows_of(ball, SLOT, 0.004, 0.1e-3)
    angle = inclinations(ball, rows)
    assert np.tan(angle) == pytest.approx(rows.r / 0.006 * np.sin(rows.kappa) * np.tan(30 * DEG))
    tangential, _, axial = coefficients_at(ball, rows, ALLOY, 0.0)
    lowest, highest = np.argmin(rows.z), np.argmax(rows.z)
    assert abs(axial[lowest] / tangential[lowest]) < 1e-3
    assert axial[highest] / tangential[highest] > 0.2
    cut = CuttingConditions(900.0, 0.004, 0.1e-3, SLOT)
    wall = coefficients_of_cut(Cutter(2, 0.012, helix=30 * DEG), cut, ALLOY, 0.0)
    ball_mean = coefficients_of_cut(ball, cut, ALLOY, 0.0)
    assert 0.3 * wall.axial_ratio < ball_mean.axial_ratio < 0.8 * wall.axial_ratio


def test_a_wall_has_the_coefficients_of_its_helix_and_mean_chip():
    cutter = Cutter(4, 0.012, helix=35 * DEG)
    found = coefficients_of_cut(cutter, CuttingConditions(900.0, 2e-3, 1e-4, SLOT), ALLOY, 6 * DEG)
    told = ALLOY.coefficients(6 * DEG, 35 * DEG, 1e-4 * 2.0 / np.pi)
    assert [found.tangential, found.radial_ratio, found.axial_ratio] == pytest.approx([told[0], *(told[1:] / told[0])])
    same = Cutter(4, 0.012, helix=35 * DEG, helix_kind="angle")
    assert inclinations(same, rows_of(same, SLOT, 2e-3)) == pytest.approx(35 * DEG)


def test_rakes_of_an_insert_turn_with_its_lead_angle():
    """A 90 degree edge has the radial rake as its own and the axial one as its inclination; a 0 degree one the other way round."""
    assert insert_angles(8 * DEG, -5 * DEG, 90 * DEG) == pytest.approx((-5 * DEG, 8 * DEG))
    assert insert_angles(8 * DEG, -5 * DEG, 1e-12) == pytest.approx((8 * DEG, 5 * DEG))
    rake, inclination = insert_angles(8 * DEG, -5 * DEG, 45 * DEG)
    assert np.tan(rake) == pytest.approx((np.tan(8 * DEG) - np.tan(5 * DEG)) / np.sqrt(2.0))
    assert np.tan(inclination) == pytest.approx((np.tan(8 * DEG) + np.tan(5 * DEG)) / np.sqrt(2.0))


def test_bad_input():
    with pytest.raises(InputError, match="chip"):
        ALLOY.coefficients(0.0, 0.0, 0.0)
    with pytest.raises(InputError, match="rake"):
        ALLOY.coefficients(1.3, 0.0, 1e-4)
    with pytest.raises(InputError, match="thicker"):
        ALLOY.coefficients(0.2, 0.0, 0.5)
    with pytest.raises(InputError, match="shear_stress"):
        OrthogonalData(0.0, 0.3, 0.0, 1.0, 0.0, 0.1, 0.0)
