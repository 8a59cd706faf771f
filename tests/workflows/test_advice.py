"""What a machinist asks, on limits made by hand and on a machine with a posterior."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rcsa_ident.workflows.advice import Bound, highest_removal, planned_cut, speed_windows, usable_depths
from rcsa_ident.workflows.limits import Limits, least_within_tolerance, machine_limits, machine_surface, pad_speeds, tip_limits
from rcsa_ident.workflows.lobes import LobeConditions, lobe_bands, tooling_lobes
from rcsa_ident.workflows.speeds import MachineOverSpeed, lobes_over_speed
from rcsa_ident.workflows.tip import MachineAxis, tooltip
from rcsa_ident.workflows.tip_fit import fitted_modes

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.power import SpindleDrive, spindle_load
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.stability.full_discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import uncoupled_planes
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import fitted_modes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.fixtures import by_hand

PROCESS = MillingProcess(Cutter(4, 12e-3), CuttingCoefficients(900e6, 0.3), Engagement(0.0, np.pi), feed_per_tooth=1e-4)
FREE = SpindleDrive.flat()


def limits(depth, speed=None, drawn=None, deepest=10e-3):
    depth = np.asarray(depth, dtype=float)
    speed = 500.0 + 100.0 * np.arange(depth.size) if speed is None else np.asarray(speed)
    infinite = np.isinf(depth)
    lobes = StabilityLobes(speed, depth, np.where(infinite, np.nan, 5e3), np.where(infinite, -1, 2), 1e-3, 5e3, "by hand")
    return Limits(lobes, deepest, drawn)


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


def test_speeds_reach_beyond_the_range_by_the_tolerance():
    found = pad_speeds(np.arange(500.0, 601.0, 10.0), 0.05, also=[523.0])
    assert found[0] <= 475.0
    assert found[-1] >= 630.0
    assert 523.0 in found
    assert set(np.arange(500.0, 601.0, 10.0)) <= set(found)
    np.testing.assert_array_equal(pad_speeds([500.0, 600.0], 0.0), [500.0, 600.0])
    assert pad_speeds([500.0], 0.1)[-1] >= 550.0
    with pytest.raises(InputError, match="speeds that rise"):
        limits([1e-3, 2e-3], [600.0, 500.0])


def test_what_all_machines_have_in_common():
    drawn = np.array([[1.0, 9.0], [2.0, 8.0], [3.0, 7.0], [4.0, np.inf]]) * 1e-3
    here = limits([2.5e-3, 8e-3], drawn=drawn)
    np.testing.assert_allclose(here.limit_quantile(1.0), [1e-3, 7e-3])
    np.testing.assert_allclose(here.limit_quantile(0.75), [2e-3, 8e-3])
    np.testing.assert_allclose(here.limit_quantile(0.25), [4e-3, 10e-3])
    assert here.probability(0, 2e-3) == 0.75
    assert limits([1e-3, 2e-3]).probability(0, 2e-3) is None
    np.testing.assert_allclose(limits([1e-3, np.inf]).limit_quantile(0.9), [1e-3, 10e-3])


@settings(max_examples=40, deadline=None)
@given(st.floats(0.01, 1.0), st.integers(1, 40))
def test_trusted_depths_keep_their_promise(probability, draws):
    drawn = np.random.default_rng(draws).uniform(1e-3, 9e-3, (draws, 3))
    trusted = limits([5e-3] * 3, drawn=drawn).limit_quantile(probability)
    share = np.mean(drawn >= trusted, axis=0)
    assert np.all(share >= probability - 1e-9)
    # a deeper cut that every draw tells apart would break it
    assert np.all(np.mean(drawn > trusted, axis=0) < probability + 1e-9)


def test_power_torque_and_chatter_each_have_their_range():
    depth = np.array([2.0, 9.0, 9.0, 9.0, 3.0, 9.0, 9.0]) * 1e-3
    drive = SpindleDrive.flat(power=5e3, torque=4.0, max_speed=1050.0)
    found = usable_depths(limits(depth, deepest=8e-3), PROCESS, drive)
    load = spindle_load(PROCESS.cutter, PROCESS.conditions(1.0, 1.0), PROCESS.coefficients)
    np.testing.assert_allclose(found.by_torque[:6], 4.0 / load.torque)
    np.testing.assert_allclose(found.by_power[:6], np.minimum(5e3 / (load.torque * found.spindle_speed[:6]), 8e-3))
    assert found.depth[6] == 0.0
    # 5.8 mm by torque; power would end it earlier only beyond 1250 rad/s
    assert [str(b) for b in found.bound] == ["chatter", "torque", "torque", "torque", "chatter", "torque", "speed"]
    np.testing.assert_allclose(found.removal_rate, found.depth * 12e-3 * 4e-4 * found.spindle_speed / (2.0 * np.pi))
    assert usable_depths(limits(depth, deepest=3e-3), PROCESS, FREE).bound[1] is Bound.DEPTH
    weak = usable_depths(limits(depth), PROCESS, SpindleDrive.flat(power=2e3))
    assert weak.bound[5] is Bound.POWER
    best = highest_removal(found, PROCESS)
    assert best[0].spindle_speed == pytest.approx(1000.0)
    assert best[0].torque == pytest.approx(4.0)
    assert best[0].power == pytest.approx(4000.0)
    assert best[0].removal_rate == pytest.approx(found.removal_rate.max())


def test_a_reserve_and_a_tolerance_come_off_the_stable_depth():
    here = limits(np.array([4.0, 2.0, 6.0]) * 1e-3, [100.0, 110.0, 120.0])
    found = usable_depths(here, PROCESS, FREE, tolerance=0.05, margin=0.2)
    np.testing.assert_allclose(found.stable, 0.8 * np.array([3.0, 2.0, 3.6]) * 1e-3)
    np.testing.assert_array_equal(found.between(105.0, 120.0).depth, found.depth[1:])


def test_windows_of_a_depth_end_where_the_limit_meets_it():
    found = speed_windows(usable_depths(limits(np.array([1.0, 3.0, 1.0, 4.0, 4.0]) * 1e-3), PROCESS, FREE), 2e-3)
    assert [(w.low, w.high, w.best) for w in found] == [
        (pytest.approx(700.0 + 100.0 / 3.0), 900.0, pytest.approx(850.0)),
        (pytest.approx(550.0), pytest.approx(650.0), pytest.approx(600.0)),
    ]
    assert [w.allowed for w in found] == pytest.approx([4e-3, 3e-3])
    assert found[1].width == pytest.approx(100.0 / 600.0)
    assert speed_windows(usable_depths(limits([1e-3, 1e-3]), PROCESS, FREE), 2e-3) == []


def test_a_planned_cut_and_its_way_to_the_limit():
    here = limits(
        np.array([1.0, 3.0, 4.0, 1.0, np.inf]) * 1e-3, drawn=np.array([[1.0, 3.0, 1.0, 1.0, 3.0], [1.0, 3.0, 4.0, 1.0, 9.0]]) * 1e-3
    )
    cut = planned_cut(here, PROCESS, SpindleDrive.flat(power=1e3), 700.0, 2e-3)
    assert cut.stable
    assert cut.margin == pytest.approx(1.0)
    assert (cut.slower, cut.faster) == (pytest.approx(550.0), pytest.approx(700.0 + 200.0 / 3.0))
    assert cut.probability == 0.5
    assert cut.robust_limit == pytest.approx(1e-3)
    assert cut.power == pytest.approx(900e6 * cut.removal_rate)
    assert cut.load == pytest.approx(cut.power / 1e3)
    unstable = planned_cut(here, PROCESS, FREE, 800.0, 2e-3)
    assert not unstable.stable
    assert unstable.margin == pytest.approx(-0.5)
    assert unstable.slower == pytest.approx(700.0 + 200.0 / 3.0)
    assert unstable.faster == pytest.approx(800.0 + 100.0 / 9.0)
    edge = planned_cut(here, PROCESS, FREE, 900.0, 2e-3)
    assert edge.faster is None
    assert edge.margin == np.inf
    assert edge.load == 0.0
    with pytest.raises(InputError, match="planned cut"):
        planned_cut(here, PROCESS, FREE, 710.0, 2e-3)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: usable_depths(limits([1e-3, 2e-3]), replace(PROCESS, feed_per_tooth=None), FREE), "feed_per_tooth"),
        (lambda: usable_depths(limits([1e-3, 2e-3]), PROCESS, FREE, margin=1.0), "margin"),
        (lambda: least_within_tolerance(np.array([1.0, 2.0]), np.array([1.0, 2.0]), 0.5), "tolerance"),
        (lambda: limits([1e-3, 2e-3]).limit_quantile(0.0), "probability"),
        (lambda: speed_windows(usable_depths(limits([1e-3, 2e-3]), PROCESS, FREE), 0.0), "depth"),
        (lambda: limits([1e-3, 2e-3], drawn=np.ones((3, 4))), "drawn"),
    ],
)
def test_what_can_not_be_asked(call, words):
    with pytest.raises(InputError, match=words):
        call()


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """A machine that changes with speed, with a posterior, and a tooling."""
    folder = tmp_path_factory.mktemp("shop")
    (folder / "T1.toml").write_text(by_hand.TOOLING, encoding="utf-8")
    tooling = read_tooling(folder / "T1.toml")
    found = by_hand.identification(True)
    machine = {axis: MachineAxis(Spindle(part.modes), part.joint, part.posterior) for axis, part in found.axes.items()}
    conditions = LobeConditions(
        MillingProcess(tooling.cutter, CuttingCoefficients(902e6, 0.26), Engagement.from_immersion(0.5, "down"), feed_per_tooth=1e-4),
        np.linspace(650.0, 1350.0, 15),
        0.02,
    )
    return MachineOverSpeed(machine), tooling, 2.0 * np.pi * np.arange(100.0, 3000.0, 2.0), conditions


def test_limits_of_a_machine_are_those_of_the_lobes(shop):
    machine, tooling, omega, conditions = shop
    found = machine_limits(machine, tooling.assembly, omega, conditions, draws=60)
    lobes, band = lobes_over_speed(machine, tooling.assembly, omega, conditions)
    np.testing.assert_allclose(found.lobes.limit_depth, lobes.limit_depth)
    np.testing.assert_allclose(found.drawn.min(axis=0), found.limit_quantile(1.0))
    low, high = np.quantile(found.drawn, (0.025, 0.975), axis=0, method="nearest")
    np.testing.assert_allclose(low, band[0])
    np.testing.assert_allclose(high, band[1])
    assert machine_limits(machine, tooling.assembly, omega, conditions, draws=0).drawn is None


def test_another_method_keeps_the_proportion_of_its_draws(shop):
    machine, tooling, omega, conditions = shop
    conditions = replace(conditions, speeds=conditions.speeds[::5])
    quick = machine_limits(machine, tooling.assembly, omega, conditions, draws=20)
    fine = machine_limits(machine, tooling.assembly, omega, replace(conditions, method=FullDiscretisation()), draws=20)
    np.testing.assert_allclose(fine.drawn / fine.nominal, quick.drawn / quick.nominal, rtol=1e-9)
    assert np.max(np.abs(fine.nominal / quick.nominal - 1.0)) > 1e-3
    assert any("proportion" in warning for warning in fine.lobes.warnings)
    assert any("fitted with" in warning for warning in fine.lobes.warnings)


def test_a_fit_stands_for_the_receptance(shop):
    machine, tooling, omega, conditions = shop
    response = tooltip(machine.whole, tooling.assembly, omega, bands=False)
    tip = uncoupled_planes(response.coupled[Dof.X], response.coupled[Dof.Y])
    modes, error = fitted_modes(tip)
    assert error < 5e-3
    exact = replace(conditions, method=ZeroOrder())
    np.testing.assert_allclose(tip_limits(modes, exact).nominal, tip_limits(tip, exact).nominal, rtol=0.03)
    assert lobe_bands(response, exact) is None
    np.testing.assert_array_equal(tip_limits(tip, exact).nominal, np.minimum(tooling_lobes(response, exact).limit_depth, 0.02))


def test_the_wall_of_a_machine_that_changes_with_speed(shop):
    machine, tooling, omega, conditions = shop
    speeds = np.array([1300.0, 700.0])
    both = machine_surface(machine, tooling.assembly, omega, conditions.process, speeds, 1e-3)
    for i, speed in enumerate(speeds):
        alone = machine_surface(machine, tooling.assembly, omega, conditions.process, np.array([speed]), 1e-3)
        np.testing.assert_allclose(both.error[i], alone.error[0], rtol=0.2)
    assert both.error.shape == (2, 33)
    assert any("begins at 100 Hz" in warning for warning in both.warnings)
