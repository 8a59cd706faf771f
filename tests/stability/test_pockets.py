"""Where a level is highest over speed, and how low it is near one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.pockets import AROUND, least_within_tolerance, pad_speeds, peaks, speeds_around

SPEED = 100.0 * np.arange(1, 10)


def test_peaks_are_one_a_pocket():
    # 3.0 and 2.9 share a pocket: the limit between them hardly falls
    level = np.array([1.0, 3.0, 2.8, 2.9, 1.0, 2.0, 1.0, 1.5])
    assert peaks(SPEED[:8], level) == [(200.0, 3.0), (600.0, 2.0), (800.0, 1.5)]
    assert peaks(SPEED[:8], level, count=1) == [(200.0, 3.0)]


def test_the_middle_of_a_stable_range_comes_first_the_widest_before_others():
    level = np.array([1.0, np.inf, 1.0, np.inf, np.inf, np.inf, 1.0, 3.0, 2.0])
    assert peaks(SPEED, level) == [(500.0, np.inf), (200.0, np.inf), (800.0, 3.0)]


def test_what_rounding_tears_apart_is_one_plateau():
    # power divided by a speed and multiplied by it again
    level = np.array([1.0, 3.0, np.nextafter(3.0, 4.0), 3.0, 3.0, np.nextafter(3.0, 2.0), 1.0, 2.0, 1.0])
    assert peaks(SPEED, level) == [(400.0, 3.0), (800.0, 2.0)]


def test_order_of_the_speeds_does_not_matter():
    level = np.array([1.0, 3.0, 1.0, 2.0, 1.0])
    assert peaks(SPEED[:5], level) == peaks(SPEED[:5][::-1], level[::-1])


def test_the_lowest_limit_within_a_tolerance():
    speed = np.array([100.0, 110.0, 120.0, 130.0])
    depth = np.array([4.0, 2.0, 6.0, 8.0])
    np.testing.assert_array_equal(least_within_tolerance(speed, depth, 0.0), depth)
    # 5 % of 100 is half the way down to 2; of 120 it reaches 114, with 2 + 4 * 0.4
    np.testing.assert_allclose(
        least_within_tolerance(speed, depth, 0.05), [3.0, 2.0, 3.6, 2.0 + 0.4 * 0.0 + (123.5 - 120.0) / 10.0 * 2.0 + 4.0]
    )
    assert least_within_tolerance(speed, depth, 0.1)[2] == 2.0


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.1, 10.0), min_size=2, max_size=30), st.floats(0.0, 0.3), st.floats(0.0, 0.15))
def test_more_tolerance_never_allows_more(depths, tolerance, more):
    speed = np.linspace(300.0, 900.0, len(depths))
    depth = np.array(depths)
    small, large = least_within_tolerance(speed, depth, tolerance), least_within_tolerance(speed, depth, tolerance + more)
    assert np.all(large <= small + 1e-12)
    assert np.all(small <= depth)
    assert np.all(large >= depth.min())


@pytest.mark.parametrize("tolerance", [-0.1, 0.5, np.nan])
def test_a_tolerance_is_a_share(tolerance):
    with pytest.raises(InputError, match="tolerance"):
        least_within_tolerance(np.array([1.0, 2.0]), np.array([1.0, 2.0]), tolerance)


@pytest.mark.parametrize("tolerance", [0.0, 0.1])
def test_speeds_that_do_not_rise_are_refused(tolerance):
    with pytest.raises(InputError, match="speeds that rise"):
        least_within_tolerance(np.array([600.0, 500.0]), np.array([1e-3, 2e-3]), tolerance)


def test_speeds_reach_beyond_the_range_by_the_tolerance():
    found = pad_speeds(np.arange(500.0, 601.0, 10.0), 0.05, also=[523.0])
    assert found[0] <= 475.0
    assert found[-1] >= 630.0
    assert 523.0 in found
    assert set(np.arange(500.0, 601.0, 10.0)) <= set(found)
    np.testing.assert_array_equal(pad_speeds([500.0, 600.0], 0.0), [500.0, 600.0])
    assert pad_speeds([500.0], 0.1)[-1] >= 550.0


@pytest.mark.parametrize("first", [4000.0, 4100.0, 3999.0])
def test_a_coarse_step_does_not_lead_far_beyond_the_speeds(first):
    """4000 less a step of 4000 is a standstill, but for its last digit."""
    speeds = (first + 4000.0 * np.arange(5)) * np.pi / 30.0
    np.testing.assert_allclose(pad_speeds(speeds, 0.01), [0.99 * speeds[0], *speeds, 1.01 * speeds[-1]])


def test_a_speed_that_differs_in_its_last_digit_is_the_same():
    found = pad_speeds(np.array([500.0, 600.0]), 0.0, also=[600.0 * (1.0 - 1e-15), 550.0])
    np.testing.assert_allclose(found, [500.0, 550.0, 600.0])


def test_speeds_around_pockets_see_the_tolerance_at_every_top():
    found = speeds_around([1000.0, 1010.0, 1990.0], 0.01, (500.0, 2000.0))
    # the second belongs to the first
    assert [each.tops for each in found] == [pytest.approx((985.0, 1015.0)), pytest.approx((1990.0 * (1.0 - AROUND), 2000.0))]
    for each, top in zip(found, (1000.0, 1990.0), strict=True):
        assert top in each.speeds
        assert np.all(np.diff(each.speeds) > 0.0)
        assert np.max(np.diff(each.speeds)) < 0.0051 * top
        assert each.speeds[0] <= 0.99 * each.tops[0] * (1.0 + 1e-12)
        assert each.speeds[-1] >= 1.01 * each.tops[1] * (1.0 - 1e-12)


def test_a_top_beside_the_end_of_the_range_has_no_closer_speeds():
    (found,) = speeds_around([1000.0], 0.01, (500.0, 1000.0 * (1.0 + 1e-12)))
    assert found.speeds.size < 12
    assert np.min(np.diff(found.speeds)) > 1e-6


def test_a_single_speed_is_its_own_neighbourhood():
    (found,) = speeds_around([1000.0], 0.0, (1000.0, 1000.0))
    assert found.tops == (1000.0, 1000.0)
    np.testing.assert_array_equal(found.speeds, [1000.0])
