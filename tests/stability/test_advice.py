"""What a machinist asks, on limits made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.power import SpindleDrive, spindle_load
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.stability.advice import highest_removal, planned_cut, speed_windows, usable_depths
from rcsa_ident.stability.operating_point import Bound
from rcsa_ident.stability.result import PROBABILITY, RESERVE, TOLERANCE
from tests.stability.written import lobes

PROCESS = MillingProcess(Cutter(4, 12e-3), CuttingCoefficients(900e6, 0.3), Engagement(0.0, np.pi), feed_per_tooth=1e-4)
FREE = SpindleDrive.flat()


def usable(limits, process=PROCESS, drive=FREE, tolerance=0.0, probability=0.95, reserve=0.0):
    """What is usable where nothing is held back of the limit."""
    return usable_depths(limits, process, drive, tolerance, probability, reserve)


def test_power_torque_and_chatter_each_have_their_range():
    depth = np.array([2.0, 9.0, 9.0, 9.0, 3.0, 9.0, 9.0]) * 1e-3
    drive = SpindleDrive.flat(power=5e3, torque=4.0, max_speed=1050.0)
    found = usable(lobes(depth, deepest=8e-3), PROCESS, drive)
    load = spindle_load(PROCESS.cutter, PROCESS.conditions(1.0, 1.0), PROCESS.coefficients)
    np.testing.assert_allclose(found.by_torque[:6], 4.0 / load.torque)
    np.testing.assert_allclose(found.by_power[:6], [np.inf, np.inf, np.inf, np.inf, np.inf, 5e3 / (load.torque * 1000.0)])
    assert found.depth[6] == 0.0
    # 5.8 mm by torque; power would end it earlier only beyond 1250 rad/s
    assert [str(b) for b in found.bound] == ["chatter", "torque", "torque", "torque", "chatter", "torque", "speed"]
    np.testing.assert_allclose(found.removal_rate, found.depth * 12e-3 * 4e-4 * found.spindle_speed / (2.0 * np.pi))
    np.testing.assert_array_equal(found.limit, np.minimum(depth, 8e-3))
    shallow = usable(lobes(np.where(depth > 3e-3, np.inf, depth), deepest=3.5e-3))
    assert (shallow.bound[1], shallow.depth[1], shallow.removal_rate[1]) == (Bound.DEPTH, np.inf, np.inf)
    weak = usable(lobes(depth), PROCESS, SpindleDrive.flat(power=2e3))
    assert weak.bound[5] is Bound.POWER
    best = highest_removal(found, PROCESS)
    assert best[0].spindle_speed == pytest.approx(1000.0)
    assert best[0].torque == pytest.approx(4.0)
    assert best[0].power == pytest.approx(4000.0)
    assert best[0].removal_rate == pytest.approx(found.removal_rate.max())
    assert best[0].limit == 8e-3


def test_what_a_shape_takes_is_not_in_proportion_to_its_depth():
    """A ball end: at the depth that is told for torque and for power the spindle gives just that, and no cut beyond the edge is asked."""
    ball = Cutter(2, 12e-3, helix=0.5, profile=Profile.ball(12e-3))
    process = MillingProcess(ball, CuttingCoefficients(900e6, 0.3, tangential_edge=2e4), Engagement(0.0, np.pi), feed_per_tooth=1e-4)
    limits = lobes(np.full(7, 5e-3), deepest=6e-3)
    for drive, name in ((SpindleDrive.flat(torque=0.3), "by_torque"), (SpindleDrive.flat(power=250.0), "by_power")):
        found = usable(limits, process, drive)
        for speed, depth, rate in zip(found.spindle_speed, getattr(found, name), found.removal_rate, strict=True):
            load = spindle_load(ball, process.conditions(speed, depth), process.coefficients)
            assert (load.torque / 0.3 if name == "by_torque" else load.power / 250.0) == pytest.approx(1.0, rel=2e-3)
            assert rate == pytest.approx(load.removal_rate, rel=2e-3)
    assert np.all(np.isfinite(usable(lobes(np.full(7, 7e-3), deepest=8e-3), process).removal_rate))


def test_where_nothing_limits_the_cut_no_depth_is_recommended():
    here = lobes(np.array([1.0, np.inf, np.inf, np.inf, 1.0, 3.0, 1.0]) * 1e-3, deepest=10e-3)
    found = usable(here, reserve=0.1)
    free, other = highest_removal(found, PROCESS)
    assert (free.spindle_speed, free.depth, free.bound) == (700.0, np.inf, Bound.DEPTH)
    assert (free.removal_rate, free.power, free.torque) == (None, None, None)
    assert str(free) == "6685 rev/min: nothing up to 10 mm limits the cut, so no depth is recommended"
    assert other.depth == pytest.approx(2.7e-3)
    # what is as deep as the search went is not known to be allowed, what is less deep is
    (window,) = speed_windows(found, 9e-3)
    assert (window.allowed, window.best) == (np.inf, 700.0)
    (wider,) = speed_windows(found, 5e-3)
    assert (wider.low, wider.high) == (pytest.approx(500.0 + 100.0 * 4.1 / 8.1), pytest.approx(900.0 - 100.0 * 4.1 / 8.1))
    with pytest.raises(InputError, match=r"0\.009"):
        speed_windows(found, 9.1e-3)
    # power that ends the depth within what was searched is a reason of its own
    power = spindle_load(PROCESS.cutter, PROCESS.conditions(700.0, 5e-3), PROCESS.coefficients).power
    assert usable(here, PROCESS, SpindleDrive.flat(power=power), reserve=0.1).depth[2] == pytest.approx(5e-3)


def test_a_reserve_and_a_tolerance_come_off_the_stable_depth():
    here = lobes(np.array([4.0, 2.0, 6.0]) * 1e-3, [100.0, 110.0, 120.0])
    found = usable(here, tolerance=0.05, reserve=0.2)
    np.testing.assert_allclose(found.stable, 0.8 * np.array([3.0, 2.0, 3.6]) * 1e-3)
    np.testing.assert_array_equal(found.between(105.0, 120.0).depth, found.depth[1:])


def test_what_is_held_back_is_what_the_lobes_recommend():
    here = lobes(np.array([4.0, 2.0, np.inf]) * 1e-3, [100.0, 110.0, 120.0], np.array([[3e-3, 1e-3, 9e-3], [5e-3, 4e-3, np.inf]]))
    found = usable_depths(here, PROCESS, FREE)
    np.testing.assert_array_equal(found.stable, here.recommended_depth())
    np.testing.assert_array_equal(found.stable, here.recommended_depth(TOLERANCE, PROBABILITY, RESERVE))


def test_without_a_feed_the_deepest_fast_cut_is_recommended_and_power_cannot_be_asked():
    still = replace(PROCESS, feed_per_tooth=None)
    here = lobes(np.array([1.0, 3.0, 1.0, 2.5, 1.0]) * 1e-3)
    found, fed = usable(here, still, FREE), usable(here, PROCESS, FREE)
    assert found.removal_rate is None
    np.testing.assert_array_equal(found.depth, fed.depth)
    assert found.bound == fed.bound
    with pytest.raises(InputError, match="feed per tooth"):
        _ = found.removal
    points, wanted = highest_removal(found, still), highest_removal(fed, PROCESS)
    assert [(p.spindle_speed, p.depth, p.limit, p.bound) for p in points] == [(p.spindle_speed, p.depth, p.limit, p.bound) for p in wanted]
    assert all((p.removal_rate, p.power, p.torque) == (None, None, None) for p in points)
    assert found.between(600.0, 700.0).removal_rate is None
    # a speed limit needs no feed
    assert usable(here, still, SpindleDrive.flat(max_speed=650.0)).bound[2] is Bound.SPEED


def test_windows_of_a_depth_end_where_the_limit_meets_it():
    found = speed_windows(usable(lobes(np.array([1.0, 3.0, 1.0, 4.0, 4.0]) * 1e-3)), 2e-3)
    assert [(w.low, w.high, w.best) for w in found] == [
        (pytest.approx(700.0 + 100.0 / 3.0), 900.0, pytest.approx(850.0)),
        (pytest.approx(550.0), pytest.approx(650.0), pytest.approx(600.0)),
    ]
    assert [w.allowed for w in found] == pytest.approx([4e-3, 3e-3])
    assert found[1].width == pytest.approx(100.0 / 600.0)
    assert speed_windows(usable(lobes([1e-3, 1e-3])), 2e-3) == []


def test_a_planned_cut_and_its_way_to_the_limit():
    here = lobes(
        np.array([1.0, 3.0, 4.0, 1.0, np.inf]) * 1e-3, drawn=np.array([[1.0, 3.0, 1.0, 1.0, 3.0], [1.0, 3.0, 4.0, 1.0, 9.0]]) * 1e-3
    )
    cut = planned_cut(here, PROCESS, SpindleDrive.flat(power=1e3), 700.0, 2e-3, tolerance=0.0)
    assert cut.method == here.method
    assert f"stable by {here.method}" in str(cut)
    assert cut.stable
    assert cut.margin == pytest.approx(1.0)
    assert (cut.slower, cut.faster) == (pytest.approx(550.0), pytest.approx(700.0 + 200.0 / 3.0))
    assert cut.probability == 0.5
    assert cut.robust_limit == pytest.approx(1e-3)
    assert cut.power == pytest.approx(900e6 * cut.removal_rate)
    assert cut.load == pytest.approx(cut.power / 1e3)
    unstable = planned_cut(here, PROCESS, FREE, 800.0, 2e-3, tolerance=0.0)
    assert not unstable.stable
    assert unstable.margin == pytest.approx(-0.5)
    assert unstable.slower == pytest.approx(700.0 + 200.0 / 3.0)
    assert unstable.faster == pytest.approx(800.0 + 100.0 / 9.0)
    edge = planned_cut(here, PROCESS, FREE, 900.0, 2e-3, tolerance=0.0)
    assert edge.faster is None
    assert edge.margin == np.inf
    assert edge.load == 0.0
    with pytest.raises(InputError, match="planned cut"):
        planned_cut(here, PROCESS, FREE, 710.0, 2e-3)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: usable(lobes([1e-3, 2e-3]), replace(PROCESS, feed_per_tooth=None), SpindleDrive.flat(power=1e3)), "feed_per_tooth"),
        (lambda: usable(lobes([1e-3, 2e-3]), replace(PROCESS, feed_per_tooth=None), SpindleDrive.flat(torque=1.0)), "feed_per_tooth"),
        (lambda: usable(lobes([1e-3, 2e-3]), reserve=1.0), "reserve"),
        (lambda: usable(lobes([2e-3, 1e-3], [600.0, 500.0])), "speeds that rise"),
        (lambda: speed_windows(usable(lobes([1e-3, 1e-3])), 0.0), "depth"),
        (lambda: planned_cut(lobes([1e-3, 1e-3]), PROCESS, FREE, 500.0, 11e-3), "at most 0.01 m"),
    ],
)
def test_what_can_not_be_asked(call, words):
    with pytest.raises(InputError, match=words):
        call()
