"""Margins of many cuts on one tip: those of lobes, and lower ones those of all drawn machines."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement, EngagementMap
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import draws_of, stability_lobes
from rcsa_ident.stability.margins import FARTHEST, HELD, AskedTip
from rcsa_ident.stability.stability_map import stability_map
from rcsa_ident.stability.strength import Search, strength
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.stability.mills import ONE, RPM, mill, tip
from tests.stability.test_lobes import oblique_tip

DRAWS = 60
CUTTER = Cutter(3, 0.012, np.radians(30.0))
UNLIKE = replace(CUTTER, pitch=np.array([0.6, 0.7, 0.7]) * np.pi)
WIDE, THIN, UP = Engagement.from_immersion(0.5, "down"), Engagement.from_immersion(0.06, "down"), Engagement.from_immersion(0.1, "up")
SPREAD = CuttingCoefficients(9e8, 0.3, tangential_spread=0.03, ratio_spread=0.05)


def cut(engagement, cutter=CUTTER) -> MillingProcess:
    return MillingProcess(cutter, SPREAD, engagement, 0.3, feed_per_tooth=5e-5)


def asked(process: MillingProcess, speed: float, method=None, draws: int = DRAWS) -> AskedTip:
    return AskedTip.of(oblique_tip(), process, speed, method or FullDiscretisation(), draws)


def lobes(process: MillingProcess, speed: float, depth: float, method=None):
    return stability_lobes(oblique_tip(), process, np.array([speed]), FARTHEST * depth, method or FullDiscretisation(), DRAWS)


@pytest.mark.parametrize("share", [0.2, 0.4, 0.9, 1.3])
@pytest.mark.parametrize(("engagement", "cutter"), [(WIDE, CUTTER), (THIN, CUTTER), (UP, CUTTER), (WIDE, UNLIKE)])
def test_a_margin_is_the_limit_over_the_depth(share, engagement, cutter):
    process, speed = cut(engagement, cutter), 900.0
    depth = share * float(lobes(process, speed, 0.02).limit_depth[0])
    wanted = lobes(process, speed, depth)
    found = asked(process, speed).margin(process, depth)
    assert found.times == pytest.approx(min(float(wanted.limit_depth[0]) / depth, FARTHEST), rel=0.01)
    assert found.low == pytest.approx(min(float(wanted.limit_quantile(HELD)[0]) / depth, FARTHEST), rel=0.06)
    if found.times < FARTHEST:
        assert found.chatter_frequency == pytest.approx(float(wanted.chatter_frequency[0]), rel=0.01)


def test_above_an_island_a_cut_is_stable_and_within_it_is_not():
    process, modes, speed = mill(2, 0.05, "up", np.radians(30.0)), tip(ONE), 18_625.0 * RPM
    found = stability_map(modes, process, np.array([speed]), np.linspace(0.1e-3, 8e-3, 80))
    begins, ends, lost = found.crossing_depth
    asked_here = AskedTip.of(modes, process, speed, FullDiscretisation(), 0)
    for depth, limit in ((0.95 * begins, begins), (0.5 * (begins + ends), begins), (1.05 * ends, lost)):
        assert asked_here.margin(process, depth).times == pytest.approx(limit / depth, rel=0.03)


def test_doubtful_lower_margins_are_settled_by_period_maps():
    process, speed = cut(THIN), 900.0
    depth = float(lobes(process, speed, 0.02).limit_quantile(HELD)[0])
    tip = asked(process, speed)
    rough = tip.margin(process, depth)
    assert tip.doubtful(process, rough)
    assert not tip.doubtful(process, rough._replace(low=2.0))
    settled = tip.with_drawn_modes(process).settled(process, depth, rough)
    assert settled.low == pytest.approx(1.0, rel=0.01)
    assert settled.times == rough.times


def test_the_method_that_is_asked_for_decides():
    process, speed, depth = cut(WIDE), 900.0, 1.5e-3
    for method in (ZeroOrder(), TimeDomain(periods=40)):
        found = asked(process, speed, method, 0).margin(process, depth)
        assert found.times == pytest.approx(min(float(lobes(process, speed, depth, method).limit_depth[0]) / depth, FARTHEST), rel=1e-3)
        assert found.low == found.times


def test_cuts_that_change_along_the_edge_have_a_band():
    z = np.array([0.0, 0.4e-3, 0.6e-3, 1e-3])
    process, depth = cut(EngagementMap(z, np.array([0.0, 0.0, 1.2, 1.2]), np.array([1.9, 1.9, 2.5, 2.5]))), 1e-3
    tip = asked(process, 900.0)
    found = tip.margin(process, depth)
    wanted = strength(FullDiscretisation(), tip.tip, process, 900.0, depth, Search(FARTHEST, 1e-3))
    assert found.times == pytest.approx(wanted.times, rel=0.01)
    assert 0.7 * found.times < found.low < found.times
    assert not tip.doubtful(process, found)
    exact = replace(tip, drawn=None)
    assert exact.margin(process, depth).low == exact.margin(process, depth).times


@pytest.mark.parametrize("cutter", [CUTTER, UNLIKE])
def test_shares_are_those_of_all_frequencies(cutter):
    process, speed, tip = cut(WIDE, cutter), 900.0, oblique_tip()
    drawn = draws_of(tip, process, DRAWS, 1)
    middle = Receptance(drawn.omega, drawn.middle, TIP, TIP)
    margin, found = ZeroOrder().shares(middle, drawn.tips, process, speed, 1e-3, drawn.factors)
    whole = ZeroOrder().depths(drawn.omega, drawn.tips, process, np.array([speed]), np.inf, drawn.factors)[:, 0]
    limit = float(ZeroOrder().lobes(middle, process, np.array([speed]), np.inf).limit_depth[0])
    assert margin == pytest.approx(limit / 1e-3)
    np.testing.assert_allclose(np.sort(found)[: DRAWS // 2], np.sort(whole / limit)[: DRAWS // 2], rtol=1e-9)


def test_a_tip_that_is_asked_goes_to_other_processes():
    process = cut(WIDE)
    tip = asked(process, 900.0)
    sent = pickle.loads(pickle.dumps(tip))
    assert sent.margin(process, 1e-3) == tip.margin(process, 1e-3)
