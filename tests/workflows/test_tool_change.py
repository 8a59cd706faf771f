"""A tool change: limits over speed of machines that stay, change or are measured, what is drawn, said and recommended."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.power import SpindleDrive
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.identification.status import Status
from rcsa_ident.io.curves.flanges import read_flange_machine, write_flange_csv
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.machine.known_tip import KnownTip
from rcsa_ident.machine.measured import MeasuredFlange
from rcsa_ident.machine.speed_dependence import BLOCK, tips_over_speed
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.drawn_modes import of_draw
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict, tally
from rcsa_ident.stability.lobes import DRAWS, both_directions, drawn_limits, stability_lobes
from rcsa_ident.stability.stability_map import stability_map
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import TIP, TipModes, fitted_modes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import BEYOND, ToolChange, classify_tested_cuts, map_of, spread_seconds, surface_of, tooltip
from tests.fixtures import by_hand
from tests.machine.planes import BAND, JOINT, oblique
from tests.stability.written import lobes

LOW, HIGH = 600.0, 1400.0
HALF = CutSpec(Engagement(0.5 * np.pi, np.pi), coefficients={"tangential": 9e8, "radial_ratio": 0.26})
FED = replace(HALF, feed_per_tooth=1e-4)


def change(machine, speeds, depth=0.05, **further):
    return ToolChange(machine, by_hand.tooling(), HALF, np.asarray(speeds, dtype=float), depth, **further)


def one_axis(shift=1.0, softening=False, known=True):
    return by_hand.machine(shift, softening, known, axes=(Dof.X,))


def alone(asked, machine, speed, draws=0):
    """Limits at one speed, of a machine as it stands there."""
    tip = machine.tip(asked.tooling, asked.omega, draws > 0)
    return stability_lobes(tip, asked.process, np.array([speed]), asked.max_depth, asked.method, draws)


def same(one, other):
    for name in ("spindle_speed", "limit_depth", "chatter_frequency", "lobe"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.absolute_limit, one.absolute_frequency, one.method) == (other.absolute_limit, other.absolute_frequency, other.method)


# over speed


def test_a_machine_that_stays_has_the_lobes_of_one_response():
    asked = change(one_axis(), np.linspace(500.0, 1500.0, 40)[::-1])
    found = asked.limits()
    one = stability_lobes(one_axis().tip(asked.tooling, asked.omega), asked.process, np.sort(asked.speeds), 0.05)
    same(found, one)
    for mine, theirs in zip(found.band, one.band, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_each_speed_feels_the_machine_at_that_speed():
    machine, speeds = one_axis(softening=True), [1300.0, 650.0, 1000.0]
    asked = change(machine, speeds, draws=0)
    found = asked.limits()
    assert found.band is None
    np.testing.assert_array_equal(found.spindle_speed, sorted(speeds))
    lowest = []
    for k, speed in enumerate(sorted(speeds)):
        here = alone(asked, machine.at(speed), speed)
        assert found.limit_depth[k] == here.limit_depth[0]
        assert found.chatter_frequency[k] == here.chatter_frequency[0]
        lowest.append(here.absolute_limit)
    assert found.absolute_limit == min(lowest)


def test_the_change_with_speed_matters():
    machine = one_axis(softening=True)
    asked = change(machine, np.linspace(LOW, HIGH, 60), draws=0)
    still = stability_lobes(machine.tip(asked.tooling, asked.omega, False), asked.process, asked.speeds, 0.05)
    assert np.max(np.abs(asked.limits().limit_depth / still.limit_depth - 1.0)) > 0.03


def test_blocks_are_narrow_enough():
    machine, speeds = one_axis(softening=True), np.linspace(LOW, HIGH, 120)
    asked = change(machine, speeds, draws=0)
    found = asked.limits()
    for k in range(0, speeds.size, 17):
        # half a block of a few per cent of softening over the whole range
        assert found.limit_depth[k] == pytest.approx(alone(asked, machine.at(speeds[k]), speeds[k]).limit_depth[0], rel=0.02)
    assert BLOCK <= 0.025


def test_outside_its_speeds_the_machine_of_the_nearest_answers():
    machine = one_axis(softening=True)
    asked = change(machine, [300.0, 2500.0], draws=0)
    found = asked.limits()
    for k, nearest in enumerate((LOW, HIGH)):
        here = alone(asked, machine.at(nearest), found.spindle_speed[k])
        assert found.limit_depth[k] == pytest.approx(here.limit_depth[0], rel=1e-12)
    (said,) = [remark for remark in asked.remarks(found) if "outside this range" in remark]
    assert f"from {LOW * 30.0 / np.pi:.0f} to {HIGH * 30.0 / np.pi:.0f} rev/min" in said
    inside = change(machine, np.array([LOW, HIGH]) * [1.0 - 1e-12, 1.0 + 1e-12])
    assert not any("outside this range" in remark for remark in inside.remarks(found))


@pytest.mark.slow
def test_bands_between_the_anchors_are_those_of_a_posterior_there():
    machine, speeds = one_axis(softening=True), np.linspace(LOW, HIGH, 9)
    asked = change(machine, speeds)
    low, high = asked.limits().band
    for k, speed in enumerate(speeds):
        own_low, own_high = alone(asked, machine.at(speed), speed, DRAWS).band
        assert low[k] < high[k]
        assert (high[k] - low[k]) == pytest.approx(own_high[0] - own_low[0], rel=0.1)


def test_a_speed_band_answers_with_its_own_machine():
    slow, fast = one_axis(0.9), one_axis(1.1)
    machine = replace(by_hand.over_speed([((LOW, 1000.0), slow), ((1000.0, HIGH), fast)]), identified=one_axis().identified)
    asked = change(machine, [1200.0, 700.0])
    found = asked.limits()
    for k, own in enumerate((slow, fast)):
        here = alone(asked, own, found.spindle_speed[k], DRAWS)
        assert found.limit_depth[k] == here.limit_depth[0]
        np.testing.assert_array_equal([edge[k] for edge in found.band], [edge[0] for edge in here.band])


def test_a_machine_without_a_posterior_has_no_band():
    assert change(one_axis(known=False), [900.0]).limits().band is None


def test_what_cuts_are_recommended_costs_more_where_teeth_differ(shop):
    """Each revolution is then followed as a whole, also around the pockets of a preview of equal teeth."""
    uneven = replace(shop, cut=replace(shop.cut, runout=(0.0, 8e-6, 0.0, 8e-6)))
    assert uneven.seconds > shop.seconds
    assert replace(uneven, recommend=False).seconds == replace(shop, recommend=False).seconds


# what is drawn


@pytest.fixture(scope="module")
def shop():
    """A machine that changes with speed, with a posterior, and a tooling."""
    spec = CutSpec(Engagement.from_immersion(0.5, "down"), feed_per_tooth=1e-4, coefficients={"tangential": 902e6, "radial_ratio": 0.26})
    return ToolChange(by_hand.machine(softening=True), by_hand.tooling(), spec, np.linspace(650.0, 1350.0, 15), 0.02)


@pytest.mark.slow
def test_limits_of_a_machine_are_those_of_its_tips(shop):
    found = shop.limits()
    tips = list(tips_over_speed(shop.machine, shop.tooling, shop.omega, shop.speeds))
    assert len(tips) > 10
    for places, tip in tips:
        np.testing.assert_array_equal(
            found.limit_depth[places], ZeroOrder().lobes(tip, shop.process, shop.speeds[places], 0.02).limit_depth
        )
        np.testing.assert_array_equal(found.drawn[:, places], drawn_limits(tip, shop.process, shop.speeds[places], 0.02))
    np.testing.assert_allclose(found.drawn.min(axis=0), found.limit_quantile(1.0))
    low, high = np.quantile(found.drawn, (0.025, 0.975), axis=0, method="nearest")
    np.testing.assert_allclose(low, found.band[0])
    np.testing.assert_allclose(high, found.band[1])
    assert replace(shop, draws=0).limits().drawn is None


@pytest.mark.slow
def test_another_method_has_draws_of_its_own_on_the_same_machines(shop):
    fine = replace(shop, speeds=shop.speeds[::5], draws=3, method=FullDiscretisation())
    marched, known = fine.limits(), fine.process.coefficients
    factors = np.exp(np.random.default_rng([1, 1]).standard_normal((3, 2)) * (known.tangential_spread, known.ratio_spread))
    processes = of_draw(fine.process, factors, 3)
    for places, tip in fine.tips(fine.speeds, spread=True):
        nodes = tip.thinned()
        drawn = both_directions(nodes).rows
        for limits, values, process in zip(marched.drawn, nodes.drawn(3, np.random.default_rng(1)), processes, strict=True):
            alone = stability_lobes(Receptance(nodes.omega, values, drawn, drawn), process, fine.speeds[places], 0.02, fine.method)
            # both fits leave some thousandths
            np.testing.assert_allclose(limits[places], alone.limit_depth, rtol=1e-2)
    # in the proportion of the zero-order limits they would be beside that
    ratio = (marched.drawn / marched.nominal) / (
        replace(shop, speeds=fine.speeds, draws=3).limits().drawn / shop.limits(fine.speeds, draws=0).nominal
    )
    assert np.max(np.abs(ratio - 1.0)) > 0.05
    assert any("replaced by a fit with" in warning for warning in marched.warnings)
    assert set(marched.warnings) <= set(fine.remarks(marched))


def test_a_fit_stands_for_the_receptance(shop):
    tip = shop.machine.tip(shop.tooling, shop.omega, spread=False)
    modes, error = fitted_modes(tip)
    assert error < 5e-3
    fitted, exact = (stability_lobes(each, shop.process, shop.speeds, 0.02) for each in (modes, tip))
    np.testing.assert_allclose(fitted.nominal, exact.nominal, rtol=0.03)
    assert exact.band is None
    np.testing.assert_array_equal(exact.nominal, np.minimum(exact.limit_depth, 0.02))
    known = replace(shop, machine=KnownTip(tip)).limits()
    same(known, exact)


def test_the_wall_of_a_machine_that_changes_with_speed(shop):
    speeds = np.array([1300.0, 700.0])
    both = surface_of(replace(shop, speeds=speeds), 1e-3)
    np.testing.assert_array_equal(both.spindle_speed, [700.0, 1300.0])
    for i, speed in enumerate(both.spindle_speed):
        alone = surface_of(replace(shop, speeds=np.array([speed])), 1e-3)
        np.testing.assert_allclose(both.error[i], alone.error[0], rtol=0.2)
    assert both.error.shape == (2, 33)
    assert any("begins at 100 Hz" in warning for warning in both.warnings)


@pytest.mark.slow
def test_the_map_of_a_machine_that_changes_is_that_of_its_tips(shop):
    asked = replace(shop, speeds=np.array([900.0, 1300.0]), max_depth=4e-3)
    chart = map_of(asked, depths=12)
    np.testing.assert_array_equal(chart.spindle_speed, [900.0, 1300.0])
    for i, speed in enumerate(chart.spindle_speed):
        tip = shop.machine.at(speed).tip(shop.tooling, shop.machine.lines(BEYOND), spread=False)
        own = stability_map(fitted_modes(both_directions(tip))[0], asked.process, np.array([speed]), chart.depth, FullDiscretisation())
        unstable = own.growth[0] > 0.0
        assert unstable.any()
        np.testing.assert_array_equal(chart.growth[i] > 0.0, unstable)


# what is said


def test_chatter_outside_the_band_is_said():
    asked = change(replace(one_axis(), identified_band=(2.0 * np.pi * 500.0, 2.0 * np.pi * 4000.0)), [900.0])
    assert asked.remarks(lobes([1e-3, 2e-3, np.inf])) == ()
    (text,) = asked.remarks(lobes([1e-3, 2e-3, np.inf], chatter=np.array([2.0 * np.pi * 300.0, 5000.0, 1.0])))
    assert "1 of 3 speeds" in text
    assert "300 Hz" in text
    assert "500-4000 Hz" in text
    # a tip that was measured says itself where it ends
    tip = asked.machine.tip(asked.tooling, spread=False)
    assert replace(asked, machine=KnownTip(tip)).remarks(lobes([1e-3], chatter=10.0)) == ()


@pytest.mark.parametrize(("top_hz", "told"), [(1000.0, True), (1500.0, True), (2000.0, False), (4000.0, False)])
def test_a_measured_tip_that_ends_below_the_tools_mode_is_said(top_hz, told):
    # the tool's first mode on this machine is at 1.7 kHz
    tip = one_axis().tip(by_hand.tooling(), 2.0 * np.pi * np.arange(100.0, top_hz + 1.0, 5.0), spread=False)
    found = change(KnownTip(tip), [900.0]).remarks(lobes([1e-3]))
    starts = [f"the receptance in X ends at {top_hz:.0f} Hz with a real part of", "a mode of this tool-holder at about 1740 Hz lies above"]
    assert [remark.startswith(start) for remark, start in zip(found, starts, strict=told)] == [True, True] * told


def test_what_speaks_against_the_machine_and_the_limits_is_said_once():
    machine = replace(one_axis(), status=Status.SUSPECT, reasons=("few cuts",))
    told = replace(lobes([1e-3]), warnings=("interrupted cut", "interrupted cut"))
    assert change(machine, [900.0]).remarks(told) == ("the identification is suspect: few cuts", "interrupted cut")


def shaped(shape="flat", corner=0.0):
    tooling = by_hand.tooling()
    return replace(tooling, cutter=replace(tooling.cutter, shape=shape, corner_radius=corner))


@pytest.mark.slow
def test_a_cutter_that_is_no_cylinder_is_said_with_every_answer():
    told = "computed as a cylinder: the cutter's shape is ball; its stability limits were 0.80 to 1.07 times the true ones in a slot"
    for softening in (False, True):
        machine = one_axis(softening=softening)
        plain, ball = (replace(change(machine, np.linspace(LOW, HIGH, 9), draws=0), tooling=shaped(shape)) for shape in ("flat", "ball"))
        answers = [(advise(each).remarks, tooltip(machine, each.tooling, spread=False).remarks) for each in (plain, ball)]
        assert not any("cylinder" in remark for remarks in answers[0] for remark in remarks)
        assert [sum(remark.startswith(told) for remark in remarks) for remarks in answers[1]] == [1, 1]


@pytest.mark.slow
def test_a_corner_radius_is_said_where_limits_are_shallow():
    """A tooltip knows no depth; limits of a machine that changes with speed say it once for all its blocks."""
    machine = one_axis(softening=True)
    asked = replace(change(machine, np.linspace(LOW, HIGH, 9), draws=0), tooling=shaped(corner=5e-3))
    lowest = float(asked.limits().nominal.min())
    assert tooltip(machine, asked.tooling, spread=False).remarks == ()
    for share, count in ((0.05, 0), (0.5, 1)):
        remarks = advise(replace(asked, tooling=shaped(corner=share * lowest))).remarks
        assert sum("the corner radius is more than a tenth of the depth" in remark for remark in remarks) == count


def test_a_tooltip_beyond_the_band_and_the_speeds_is_told_to_be_extrapolated():
    machine, tooling = by_hand.machine(softening=True), by_hand.tooling()
    inside = tooltip(machine, tooling, speed=1000.0)
    assert inside.remarks == ()
    np.testing.assert_array_equal(inside.tip.omega, machine.lines())
    np.testing.assert_array_equal(inside.tip.values, machine.at(1000.0).tip(tooling).values)
    assert inside.tip.complete
    omega = 2.0 * np.pi * np.arange(100.0, 4001.0, 50.0)
    beyond, outside = tooltip(machine, tooling, omega, speed=2000.0, spread=False).remarks[::-1]
    assert beyond == "the machine is known up to 3000 Hz; above that the receptance is extrapolated"
    assert "rev/min" in outside
    assert tooltip(machine, tooling, omega, spread=False).tip.variation is None


def test_modes_of_a_tip_answer_as_a_receptance():
    tip = one_axis().tip(by_hand.tooling(), spread=False)
    modes = fitted_modes(both_directions(tip))[0]
    found = tooltip(KnownTip(modes), by_hand.tooling())
    assert isinstance(found.tip, UncertainReceptance)
    assert found.tip.rows == TIP
    np.testing.assert_array_equal(found.tip.values, modes.receptance().values)
    assert found.remarks == ()
    omega = np.array([1000.0, 2000.0])
    np.testing.assert_array_equal(tooltip(KnownTip(modes), by_hand.tooling(), omega).tip.values, modes.response(omega))


def test_a_known_tip_stands_in_for_a_machine():
    asked = change(one_axis(), np.linspace(600.0, 1400.0, 20), draws=0)
    tip = one_axis().tip(asked.tooling, asked.omega, spread=False)
    here = replace(asked, machine=KnownTip(tip))
    same(here.limits(), asked.limits())
    modes = TipModes.joined([fitted_modes(both_directions(tip))[0]])
    exact = stability_lobes(modes, asked.process, asked.speeds, 0.05, FullDiscretisation())
    same(replace(asked, machine=KnownTip(modes), method=FullDiscretisation()).limits(), exact)
    assert not any("fit" in warning for warning in exact.warnings)


# how long it takes


def test_seconds_are_those_of_the_speeds_the_spread_and_the_change():
    speeds = np.array([1000.0, 2000.0]) * np.pi / 30.0
    # slower spindles have closer lobes: 4 + 2 times the cost at 4000 rev/min, and that of 1 % less and more
    times = 6.0 + 4.0 / 0.99 + 2.0 / 1.01
    bare = change(by_hand.machine(known=False), speeds, draws=0, recommend=False)
    assert bare.seconds == pytest.approx(times * ZeroOrder.seconds_per_operation)
    # of close speeds there are many within 1 %
    close = replace(bare, speeds=np.array([1000.0, 1001.0]) * np.pi / 30.0)
    assert close.seconds == pytest.approx(22.0 * 4.0 * ZeroOrder.seconds_per_operation, rel=0.05)
    known = change(by_hand.machine(), speeds, recommend=False)
    kept = replace(known, machine=known.machine.kept())
    drawn, spread = kept.seconds, spread_seconds(known.machine, known.omega)
    assert drawn > 2.0 * bare.seconds
    assert known.seconds == pytest.approx(drawn + spread)
    # directions of the posterior, each at every line
    assert spread > 0.0
    assert spread_seconds(known.machine, known.omega[::2]) == pytest.approx(spread * known.omega[::2].size / known.omega.size)
    assert spread_seconds(one_axis(), known.omega) == pytest.approx(0.5 * spread)
    assert spread_seconds(bare.machine, known.omega) == 0.0
    changing = change(by_hand.machine(softening=True), speeds, recommend=False)
    own = spread_seconds(changing.machine, changing.omega)
    assert changing.seconds - drawn - own == pytest.approx(replace(changing, draws=0).seconds - bare.seconds)
    assert replace(changing, draws=0).seconds > 1.0
    # what is kept is kept for the zero-order method's lines alone
    assert replace(kept, method=FullDiscretisation()).seconds == replace(known, method=FullDiscretisation()).seconds
    tooling = by_hand.tooling()
    uneven = replace(tooling, cutter=replace(tooling.cutter, pitch=np.array([0.4, 0.6, 0.4, 0.6]) * np.pi))
    off = replace(tooling, cutter=replace(tooling.cutter, runout=np.array([0.0, 1e-6, 0.0, 0.0])))
    assert replace(bare, tooling=uneven).seconds == pytest.approx(30.0 * bare.seconds)
    for method in (FullDiscretisation(), SemiDiscretisation(), TimeDomain()):
        # a revolution is followed in place of a tooth's period
        exact = replace(bare, method=method)
        assert replace(exact, tooling=off).seconds == pytest.approx(replace(exact, tooling=uneven).seconds)
        assert replace(exact, tooling=uneven).seconds > 1.2 * exact.seconds
        # and a recommendation is what a preview costs and the method that fits the cut, at some speeds
    preview = replace(bare, recommend=True).seconds - bare.seconds
    assert preview > 30.0 / 6.0 * (replace(bare, method=FullDiscretisation()).seconds - 1.0)


def test_modes_are_fitted_to_receptances_that_reach_beyond_the_band():
    asked = change(by_hand.machine(), [900.0])
    assert asked.omega[-1] == pytest.approx(2.0 * np.pi * 3000.0)
    assert replace(asked, method=FullDiscretisation()).omega[-1] == pytest.approx(BEYOND * 2.0 * np.pi * 3000.0)


# cuts that were tried


def test_tested_cuts_are_asked_each_at_its_own_speed():
    asked = change(by_hand.machine(softening=True), np.linspace(700.0, 1300.0, 5), depth=1e-3, draws=0)
    speed = np.array([1111.0, 650.0, 977.0, 1111.0])
    cuts = TestedCuts(speed, np.array([0.2, 3.0, 0.6, 0.9]) * 1e-3, (Verdict.STABLE, Verdict.CHATTER, Verdict.STABLE, Verdict.CHATTER))
    limits = [alone(replace(asked, max_depth=3.03e-3), asked.machine.at(each), each).limit_depth[0] for each in speed]
    assert classify_tested_cuts(asked, cuts) == tally(cuts, np.array(limits))
    assert advise(asked, tested=cuts).tested == tally(cuts, np.array(limits))


# a flange that was measured

GRID_HZ = np.arange(100.3, 3000.0, 1.7)


def flange(modes):
    return MeasuredFlange(modes.receptance(2.0 * np.pi * GRID_HZ))


@pytest.mark.slow
@pytest.mark.parametrize("planes", ["apart", "oblique"])
def test_a_measured_flange_has_the_lobes_and_the_advice_of_its_modes(planes):
    apart = tuple(part.spindle.modes for part in by_hand.machine().identified.values())
    modes = (oblique(),) if planes == "oblique" else apart
    known = (2.0 * np.pi * GRID_HZ[0], 2.0 * np.pi * GRID_HZ[-1])
    one = FlangeMachine(modes, BAND, JOINT)
    other = FlangeMachine(tuple(flange(each) for each in modes), known, JOINT, ends=True)
    speeds = np.linspace(500.0, 1500.0, 101)
    asked = ToolChange(one, by_hand.tooling(), FED, speeds, 5e-3)
    measured = replace(asked, machine=other)
    mine, theirs = measured.limits(), asked.limits()
    np.testing.assert_allclose(mine.limit_depth, theirs.limit_depth, rtol=1e-4)
    np.testing.assert_allclose(mine.chatter_frequency, theirs.chatter_frequency, rtol=1e-4)
    np.testing.assert_array_equal(mine.lobe, theirs.lobe)
    assert mine.drawn is None
    drive = SpindleDrive.flat(power=2e3)
    advice, wanted = advise(measured, drive, depth=0.3e-3), advise(asked, drive, depth=0.3e-3)
    assert [point.bound for point in advice.recommended] == [point.bound for point in wanted.recommended]
    for found, expected in zip(advice.recommended, wanted.recommended, strict=True):
        assert found.spindle_speed == expected.spindle_speed
        # through modes that were fitted to either
        assert (found.depth, found.limit) == (pytest.approx(expected.depth, rel=2e-3), pytest.approx(expected.limit, rel=2e-3))
    assert [w.low for w in advice.windows] == pytest.approx([w.low for w in wanted.windows], rel=1e-4)
    # methods that fit modes stay within what was measured, and say what it does not tell
    marched = replace(measured, method=FullDiscretisation(), speeds=speeds[::50]).limits()
    exact = replace(asked, method=FullDiscretisation(), speeds=speeds[::50]).limits()
    np.testing.assert_allclose(marched.limit_depth, exact.limit_depth, rtol=0.03)
    assert surface_of(replace(measured, speeds=speeds[::50]), 1e-3).error.shape[0] == 3


def test_a_flange_file_is_a_machine(tmp_path):
    """The joint's compliance stands in it; its columns are what couples."""
    values = {}
    for axis, part in by_hand.machine().identified.items():
        at = part.spindle.modes.receptance(2.0 * np.pi * GRID_HZ)
        values[axis] = at.values + np.eye(2) * part.joint.compliance_along(at.omega, [c.dof for c in at.rows])[:, None, :]
    write_flange_csv(tmp_path / "FLANGE.csv", GRID_HZ, values)
    machine = read_flange_machine(tmp_path / "FLANGE.csv")
    assert machine.axes == (Dof.X, Dof.Y)
    tip, expected = (each.tip(by_hand.tooling(), machine.lines(), spread=False) for each in (machine, by_hand.machine()))
    for axis in (Dof.X, Dof.Y):
        c = str(Coordinate("tip", axis))
        assert np.linalg.norm(tip.between(c, c) - expected.between(c, c)) < 1e-4 * np.linalg.norm(expected.between(c, c))
    speeds = np.linspace(600.0, 1400.0, 30)
    mine, theirs = (change(each, speeds, draws=0).limits() for each in (machine, by_hand.machine()))
    np.testing.assert_allclose(mine.limit_depth, theirs.limit_depth, rtol=1e-4)


def test_a_tip_of_a_single_direction_is_enough():
    tip = one_axis().tip(by_hand.tooling(), spread=False)
    bare = Receptance(tip.omega, tip.values, tip.rows, tip.cols)
    found = change(KnownTip(bare), [700.0, 900.0]).limits()
    assert found.drawn is None
    np.testing.assert_array_equal(found.limit_depth, change(one_axis(), [700.0, 900.0], draws=0).limits().limit_depth)
