"""What a campaign whose drawings are not exact leaves unknown, and what it never does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.base.remarks import says
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.result import IdentificationCode
from rcsa_ident.setup.campaign import HALF_NORMAL, Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.recording import Quantity, Sensor
from rcsa_ident.tool_holder.spread import SPREAD_FIELDS, Spread
from rcsa_ident.workflows.identify import of_campaign, with_rough
from tests.fixtures.virtual_shop import open_shop


@pytest.fixture(scope="module")
def shop():
    return open_shop(speeds=3)


@pytest.fixture(scope="module")
def data(shop):
    return shop.prepare(shop.measurements(np.random.default_rng(1), both_forces=True)[0], spread=(0.05, 0.05, 0.0, 0.0))


@pytest.fixture(scope="module")
def campaign(shop, data):
    sensors = tuple(Sensor(f"flange_{axis}", Quantity.DISPLACEMENT, axis) for axis in (Dof.X, Dof.Y))
    told = {name: replace(each, spread=Spread()) for name, each in shop.toolings.items()}
    names = [data.toolings[k] for k in data.cut_tooling]
    made = zip(data.cut_ids, names, data.spindle_speed, strict=True)
    cuts = tuple(Cut(each, name, shop.machine.plan.conditions(speed), Path()) for each, name, speed in made)
    return Campaign("C", 25600.0, sensors, shop.machine.workpiece, told, cuts)


def test_exact_drawings_leave_the_data_alone(data, campaign, shop):
    assert with_rough(data, replace(campaign, toolings=shop.toolings)) is data


def test_depths_gains_delays_cross_talk_and_toolings_join_the_unknowns(data, campaign):
    found = with_rough(data, campaign)
    known = len(data.coefficient_spread)
    # two depths, two gains, two delays, two corner radii, two shares of cross-talk, then the toolings
    depth = campaign.cuts[0].conditions.axial_depth
    more = found.coefficient_spread[known:]
    assert more[:10] == pytest.approx((0.02e-3 / depth,) * 2 + (0.02,) * 2 + (1.0,) * 4 + (0.015,) * 2)
    assert found.rough_place == slice(known + 10, len(found.coefficient_spread))
    assert found.talk_place == {Dof.X: known + 8, Dof.Y: known + 9}
    x, y = found.axes
    assert np.all(x.force_slope[:, known + 2] == 1.0)
    assert not np.any(x.force_slope[:, known + 3])
    # a delay stands in units of its spread, and turns a line backwards
    np.testing.assert_allclose(y.force_slope[:, known + 5], -5e-6j * y.omega)


def test_a_corner_radius_changes_the_force_of_its_own_cutters_lines(data, campaign, shop):
    known = len(data.coefficient_spread)
    found = with_rough(data, campaign)
    first = campaign.cuts[0]
    cutter, depth = shop.toolings[first.tooling].cutter, first.conditions.axial_depth
    broken = replace(cutter, profile=Profile.bull_nose(cutter.diameter, 0.1e-3))
    for place, axis in enumerate(found.axes):
        own = axis.cut == 0
        sharp, blunt = (force_lines(each, first.conditions, campaign.coefficients, axis.order[own])[:, place] for each in (cutter, broken))
        np.testing.assert_allclose(np.exp(axis.force_slope[own, known + 6]) * sharp, blunt, rtol=1e-9)
        # a corner of a tenth of a millimetre is a fraction of the depth, and of the force
        size = np.median(np.abs(axis.force_slope[own, known + 6]))
        assert 1e-3 < size < 0.5e-3 / depth
        assert not np.any(axis.force_slope[data.cut_tooling[axis.cut] == 1, known + 6])
        assert np.all(axis.force_slope[data.cut_tooling[axis.cut] == 1, known + 7] != 0.0)


def test_tools_of_one_model_have_one_corner_radius_and_exact_ones_none(data, campaign):
    alike = {name: replace(each, tool_model="EM12") for name, each in campaign.toolings.items()}
    none = {name: replace(each, spread=replace(each.spread, corner_radius=0.0)) for name, each in campaign.toolings.items()}
    two, one, no = (with_rough(data, replace(campaign, toolings=t)).rough_first for t in (campaign.toolings, alike, none))
    assert (two - one, two - no) == (1, 2)


def test_a_corner_radius_alone_may_be_unknown(data, campaign):
    exact = dict.fromkeys(SPREAD_FIELDS, 0.0)
    told = {name: replace(each, spread=Spread(**{**exact, "corner_radius": 0.3e-3})) for name, each in campaign.toolings.items()}
    found = with_rough(data, replace(campaign, toolings=told))
    assert found.rough is None
    assert len(found.coefficient_spread) == len(data.coefficient_spread) + 10


def test_what_is_told_as_exact_is_no_unknown(data, campaign):
    sensors = tuple(replace(each, gain_spread=0.0, cross_talk_spread=0.0, delay_spread=0.0) for each in campaign.sensors)
    sharp = {name: replace(each, spread=replace(each.spread, corner_radius=0.0)) for name, each in campaign.toolings.items()}
    found = with_rough(data, replace(campaign, sensors=sensors, depth_spread=0.0, toolings=sharp))
    assert len(found.coefficient_spread) == len(data.coefficient_spread) + len(found.rough.unknowns)
    assert not found.talk_place


def test_a_force_that_points_elsewhere_is_known_no_better_along_an_axis(data, campaign):
    for before, after in zip(data.axes, with_rough(data, campaign).axes, strict=True):
        whole = np.abs(before.force) ** 2 + np.abs(before.across) ** 2
        np.testing.assert_allclose(after.power, before.power * (whole / np.abs(before.force) ** 2)[:, None])


def test_edge_forces_that_nobody_told_are_expected(campaign, shop):
    assert campaign.rough
    told = campaign.workpiece.coefficients
    assert told.tangential_edge == told.radial_edge == 0.0
    assert campaign.coefficients.tangential_edge == pytest.approx(HALF_NORMAL * 10e3)
    assert replace(campaign, toolings=shop.toolings).coefficients == told
    none = replace(campaign, workpiece=replace(campaign.workpiece, edge_force_spread=0.0))
    assert none.coefficients == told


def test_passes_take_drawings_as_exact_and_say_so(data, campaign):
    axes = tuple(replace(axis, sweep=np.tile([10.0, 0.28], (axis.omega.size, 1))) for axis in data.axes)
    passes = replace(data, axes=axes)
    assert passes.sweeps
    assert with_rough(passes, campaign) is passes


def test_an_answer_that_took_drawings_as_exact_says_so(campaign, shop):
    from rcsa_ident.identification.diagnostics import failed

    nothing = shop.prepare(shop.measurements(np.random.default_rng(1))[0])
    found = failed(nothing, 1, "paper")
    assert says(of_campaign(found, campaign).notes, IdentificationCode.DRAWINGS_EXACT)
    assert not says(of_campaign(found, replace(campaign, toolings=shop.toolings)).notes, IdentificationCode.DRAWINGS_EXACT)
