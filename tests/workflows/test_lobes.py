"""What stands between a tip and a recommendation."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.errors import InputError
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.workflows.lobes import band_warning, best_speeds, modal_tip


def lobes(limit, chatter=None):
    limit = np.array(limit, dtype=float)
    speed = 100.0 * np.arange(1, limit.size + 1)
    chatter = np.full(limit.size, 5000.0) if chatter is None else np.array(chatter)
    return StabilityLobes(
        speed, limit, np.where(np.isinf(limit), np.nan, chatter), np.where(np.isinf(limit), -1, 3), 1.0, 5000.0, "by hand"
    )


def test_best_speeds_are_one_a_pocket():
    # 3.0 and 2.9 share a pocket: the limit between them hardly falls
    assert best_speeds(lobes([1.0, 3.0, 2.8, 2.9, 1.0, 2.0, 1.0, 1.5])) == [(200.0, 3.0), (600.0, 2.0), (800.0, 1.5)]
    assert best_speeds(lobes([1.0, 3.0, 2.8, 2.9, 1.0, 2.0, 1.0, 1.5]), count=1) == [(200.0, 3.0)]


def test_the_middle_of_a_stable_range_comes_first_the_widest_before_others():
    found = best_speeds(lobes([1.0, np.inf, 1.0, np.inf, np.inf, np.inf, 1.0, 3.0, 2.0]))
    assert found == [(500.0, np.inf), (200.0, np.inf), (800.0, 3.0)]


def test_order_of_the_speeds_does_not_matter():
    one = lobes([1.0, 3.0, 1.0, 2.0, 1.0])
    back = StabilityLobes(*(a[::-1] for a in (one.spindle_speed, one.limit_depth, one.chatter_frequency, one.lobe)), 1.0, 1.0, "")
    assert best_speeds(one) == best_speeds(back)


def test_chatter_outside_the_band_is_said():
    inside = lobes([1.0, 2.0, np.inf])
    assert band_warning(inside, (500.0, 4000.0)) is None
    text = band_warning(lobes([1.0, 2.0, np.inf], [2.0 * np.pi * 300.0, 5000.0, 1.0]), (500.0, 4000.0))
    assert text is not None
    assert "1 of 3 speeds" in text
    assert "300 Hz" in text


def test_modal_tip_resolves_the_sharpest_mode():
    tip = modal_tip({Dof.Y: normal_modes(np.array([5000.0]), np.array([0.01]), np.ones((1, 1)), (Coordinate("tip", Dof.Y),))})
    np.testing.assert_array_equal(tip.between("tip.x", "tip.x"), 0.0)
    step = np.diff(tip.omega).max()
    assert step <= 2.0 * 0.01 * 5000.0 / 10.0
    peak = tip.omega[np.argmax(np.abs(tip.between("tip.y", "tip.y")))]
    assert peak == pytest.approx(5000.0, rel=2e-3)


def test_a_mode_too_sharp_to_resolve_is_refused():
    model = normal_modes(np.array([5000.0]), np.array([1e-7]), np.ones((1, 1)), (Coordinate("tip", Dof.X),))
    with pytest.raises(InputError, match="damping_ratio"):
        modal_tip({Dof.X: model})
