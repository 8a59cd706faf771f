"""What is recommended after a tool change: it holds what its sentence promises, by methods that had no part in it."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.power import SpindleDrive
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.machine.known_tip import KnownTip
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.stability.advice import highest_removal
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.result import RESERVE
from rcsa_ident.stability.tip_modes import TIP, TipModes
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import ToolChange
from tests.fixtures import by_hand

HALF = CutSpec(Engagement(0.5 * np.pi, np.pi), coefficients={"tangential": 9e8, "radial_ratio": 0.26})
FED = replace(HALF, feed_per_tooth=1e-4)
#: One plane with two modes, 5 % immersion: period doubling, of which zero-order limits know nothing, takes the tops of their pockets.
DOUBLING = TipModes.of({Dof.X: normal_modes(2.0 * np.pi * np.array([900.0, 2300.0]), [0.02, 0.02], [[6.0], [4.0]], (TIP[0],))})
THIN = CutSpec(Engagement.from_immersion(0.05, "up"), feed_per_tooth=1e-4, coefficients={"tangential": 9e8, "radial_ratio": 0.26})


def doubling(**further):
    return ToolChange(KnownTip(DOUBLING), by_hand.tooling(), THIN, np.linspace(1000.0, 2400.0, 141), 30e-3, **further)


def holds(asked, point):
    """Whether a cut is stable over +-1 % of its speed, by a method that had no part in it."""
    speeds = point.spindle_speed * np.array([0.99, 0.995, 1.0, 1.005, 1.01])
    return bool(np.all(replace(asked, method=SemiDiscretisation()).limits(speeds, draws=0).nominal >= point.depth))


def test_what_is_recommended_holds_where_zero_order_limits_do_not():
    asked = doubling()
    found = advise(asked)
    preview = highest_removal(found.usable, asked.process)
    assert not all(holds(asked, point) for point in preview)
    assert found.recommended
    assert all(holds(asked, point) for point in found.recommended)
    # and is not timid: the reserve and what the tolerance of the speed takes
    assert all(point.depth > 0.6 * point.limit for point in found.recommended)


@pytest.mark.slow
def test_a_lobe_between_the_speeds_of_the_limits_is_seen():
    """Two teeth at a tenth of the diameter: a lobe narrower than the steps of the limits takes 7 % of what they would let recommend."""
    rng = np.random.default_rng(50)
    modes = {}
    for axis, place in ((Dof.X, TIP[0]), (Dof.Y, TIP[1])):
        natural, damping = np.sort(rng.uniform(600.0, 3500.0, 3)), rng.uniform(0.01, 0.03, 3)
        modes[axis] = normal_modes(2.0 * np.pi * natural, damping, rng.uniform(1.5, 6.0, (3, 1)), (place,))
    tenth = Engagement.from_immersion(0.1, "up")
    cut = CutSpec(tenth, rng.uniform(0.0, 6.28), 1e-4, coefficients={"tangential": 9e8, "radial_ratio": 0.26})
    tooling = tooling_of(tomllib.loads(by_hand.TOOLING.replace("teeth = 4", "teeth = 2")), "", "T1")
    asked = ToolChange(KnownTip(TipModes.of(modes)), tooling, cut, np.linspace(1000.0, 2300.0, 131), 30e-3)
    for point in advise(asked).recommended:
        close = point.spindle_speed * np.linspace(0.99, 1.01, 81)
        least = np.min(replace(asked, method=SemiDiscretisation()).limits(close, draws=0).nominal)
        # the least limit is known within half a percent
        assert 0.88 * least < point.depth < 1.005 * (1.0 - RESERVE) * least


def test_a_preview_recommends_nothing():
    found = advise(doubling(recommend=False))
    assert (found.recommended, found.recommended_by) == ((), None)
    assert found.pockets
    assert all(np.isnan(pocket.recommended_depth) for pocket in found.pockets)
    asked = doubling()
    assert asked.seconds > replace(asked, recommend=False).seconds


def test_one_question_has_one_recommended_cut_whatever_stands_beside_it():
    asked = replace(doubling(), speeds=np.linspace(1500.0, 1700.0, 21))
    known = advise(asked)
    assert known.recommended_by == "full-discretisation"
    for further in (
        {"method": FullDiscretisation()},
        {"method": SemiDiscretisation()},
        {"planned": [(1555.5, 0.4e-3)], "depth": 1e-3},
    ):
        method = further.pop("method", asked.method)
        found = advise(replace(asked, method=method), **further)
        assert found.lobes.method == method.name
        assert [(point.spindle_speed, point.depth, point.held) for point in found.recommended] == [
            (point.spindle_speed, point.depth, point.held) for point in known.recommended
        ]


def test_a_recommended_depth_follows_from_the_limit_step_by_step():
    for point in advise(doubling()).recommended:
        held = point.held
        assert held.limit == point.limit >= held.within_tolerance
        assert held.with_probability is None
        assert point.depth == held.depth == pytest.approx(0.9 * held.within_tolerance, rel=1e-12)
        assert f"{1e3 * held.within_tolerance:.2f} mm within ±1 % of the speed → {1e3 * point.depth:.2f} mm less 10 %" in str(held)


def test_a_cut_that_no_fitting_method_takes_is_not_recommended():
    uneven = tuple(2e-6 * np.array([1.0, 0.0, -1.0, 0.0])[: by_hand.tooling().cutter.teeth])
    found = advise(replace(doubling(), cut=replace(THIN, runout=uneven, feed_per_tooth=None)))
    assert found.recommended == ()
    assert any(remark.startswith("no cut is recommended: ") for remark in found.remarks)


@pytest.mark.slow
def test_advice_is_about_the_limits_that_are_shown():
    asked = ToolChange(by_hand.machine(), by_hand.tooling(), FED, np.linspace(600.0, 1500.0, 60), 5e-3, draws=20)
    drive = SpindleDrive.flat(power=5e3)
    found = advise(asked, drive, depth=0.4e-3, planned=[(1234.5, 0.3e-3)])
    assert (found.tooling, found.stickout) == ("T1", pytest.approx(0.06))
    assert {*asked.speeds.tolist(), 1234.5} <= set(found.lobes.spindle_speed.tolist())
    np.testing.assert_array_equal(found.usable.spindle_speed, found.lobes.spindle_speed)
    at = np.searchsorted(found.lobes.spindle_speed, asked.speeds)
    np.testing.assert_array_equal(found.lobes.limit_depth[at], asked.limits().limit_depth)
    np.testing.assert_array_equal(found.lobes.drawn[:, at], asked.limits().drawn)
    # within the range the speeds beside one are the same; at its ends some lie beyond it
    inner = slice(3, -3)
    np.testing.assert_allclose(found.usable.stable[inner], found.lobes.recommended_depth()[inner], rtol=1e-12)
    assert np.all(found.usable.stable <= found.lobes.recommended_depth() * (1.0 + 1e-12))
    np.testing.assert_array_equal(found.usable.limit, found.lobes.nominal)
    best = found.recommended[0]
    assert found.recommended_by == "full-discretisation"
    assert best.removal_rate == max(point.removal_rate for point in found.recommended)
    (limit,) = replace(asked, method=FullDiscretisation()).limits(np.array([best.spindle_speed]), draws=0).limit_depth
    assert best.limit == pytest.approx(limit, rel=5e-3)
    assert 0.0 < best.depth < (1.0 - RESERVE) * best.limit
    for window in found.windows:
        assert window.allowed >= 0.4e-3
    (cut,) = found.planned
    assert cut.spindle_speed == 1234.5
    assert cut.robust_limit <= cut.limit
    np.testing.assert_array_equal(found.common, found.lobes.limit_quantile(1.0))


@pytest.mark.slow
def test_how_deep_limits_are_looked_for_recommends_nothing_and_hides_no_speed():
    asked = ToolChange(by_hand.machine(), by_hand.tooling(), FED, np.linspace(600.0, 1500.0, 60), 50e-3, draws=0)
    whole = advise(asked)
    depth = 0.5 * float(np.max(whole.usable.depth))
    wanted = advise(asked, depth=depth).windows
    assert wanted
    # this depth's reserve lies beyond what is asked for otherwise
    shallow = advise(replace(asked, max_depth=depth), depth=depth, planned=[(1000.0, 0.1 * depth)])
    assert len(shallow.windows) == len(wanted)
    step = float(asked.speeds[1] - asked.speeds[0])
    for found, known in zip(*(sorted(each, key=lambda w: w.low) for each in (shallow.windows, wanted)), strict=True):
        # without a straight line to a limit that nobody has looked for a window ends at a speed that was asked
        assert known.low * (1.0 - 1e-9) <= found.low <= known.low + step
        assert known.high - step <= found.high <= known.high * (1.0 + 1e-9)
    # nothing ends the cut where the search was shallower than the limit
    tiny = 0.1 * float(whole.usable.depth.min())
    free = advise(replace(asked, max_depth=tiny), planned=[(1000.0, 0.5 * tiny)])
    assert np.all(np.isinf(free.usable.depth))
    assert [point.depth for point in free.recommended] == [np.inf]
    assert free.planned[0].robust_limit == np.inf
