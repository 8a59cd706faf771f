"""Lines of cutters whose teeth are unlike: at which orders they are read, and that they are the receptance's."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import SLOPES
from rcsa_ident.identification.cut_data import prepare
from rcsa_ident.signals.measurement import forced_orders
from tests.fixtures.synthetic import pair

UNLIKE = {
    "pitch": Cutter(4, 16e-3, np.radians(30.0), np.radians([80.0, 100.0, 85.0, 95.0])),
    "helix": Cutter(4, 16e-3, np.radians([28.0, 34.0, 29.0, 35.0])),
    "two pitches": Cutter(4, 16e-3, np.radians(30.0), np.radians([84.0, 96.0, 84.0, 96.0])),
}


@pytest.mark.parametrize("name", list(UNLIKE))
def test_unlike_teeth_tell_lines_between_their_tooth_passing_ones(name):
    made = pair(14, 8000.0, cutter=UNLIKE[name], trigger={})
    told = 0
    for axis, lines in made.measure().measurement.axes.items():
        between = lines.order % 4 != 0
        # all of them are those of the receptance, as far as noise lets them
        expected = made.expected(lines, axis)
        allowed = 5.0 * np.sqrt(2.0 * lines.summed().variance[:, 0]) + 0.01 * np.abs(expected)
        assert np.all(np.abs(lines.receptance - expected) < allowed)
        told += np.count_nonzero(between)
        # what run-out may make as well is left out
        assert np.all(np.abs(lines.force_slope[between, SLOPES.index("run-out")]) < 0.02)
        if name == "two pitches":
            assert np.all(lines.order % 2 == 0)
    # where pitches are in pairs every second order has a force, and an eccentricity hardly any
    assert told >= (6 if name == "two pitches" else 1)


def test_which_orders_have_a_force():
    assert forced_orders(Cutter(4, 0.012), 12).tolist() == [4, 8, 12]
    # what runs out is not known, and no order to count on
    assert forced_orders(Cutter(4, 0.012, runout=[1e-6, 0.0, 0.0, 0.0]), 8).tolist() == [4, 8]
    assert forced_orders(UNLIKE["helix"], 5).tolist() == [1, 2, 3, 4, 5]


def test_a_delay_of_unlike_teeth_may_lie_anywhere_in_a_turn():
    from rcsa_ident.dynamics.coordinates import Coordinate
    from rcsa_ident.dynamics.receptance import Receptance

    made = pair(14, 8000.0, cutter=UNLIKE["two pitches"], trigger={})
    measurement = made.measure().measurement
    names = [Coordinate.parse(name) for name in ("tip.x", "tip.x'", "flange.x", "flange.x'")]

    def receptance(omega):
        return Receptance(omega, np.tile(np.eye(4, dtype=complex), (omega.size, 1, 1)), tuple(names), tuple(names))

    told = prepare([measurement], {"t": receptance}, {"t": 4}), prepare([measurement], {"t": receptance}, {"t": 4}, unlike=["t"])
    turn = 2.0 * np.pi / made.speed
    assert [float(each.cut_prior.tooth_period[0]) for each in told] == pytest.approx([0.25 * turn, turn], rel=1e-3)
    assert [float(each.cut_prior.pitches[0]) for each in told] == [1.0, 4.0]
    assert told[1].of_cuts(np.array([0])).cut_prior.pitches.tolist() == [4.0]
