"""What a campaign whose drawings are not exact leaves unknown, and what it never does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.result import IdentificationCode
from rcsa_ident.machining_setup import HALF_NORMAL, Campaign, Cut
from rcsa_ident.remarks import says
from rcsa_ident.signals.recording import Quantity, Sensor
from rcsa_ident.tool_holder.spread import Spread
from rcsa_ident.workflows.identify import of_campaign, with_rough
from tests.fixtures.virtual_shop import open_shop


@pytest.fixture(scope="module")
def shop():
    return open_shop(speeds=3)


@pytest.fixture(scope="module")
def data(shop):
    return shop.prepare(shop.measurements(np.random.default_rng(1), both_forces=True)[0], spread=(0.05, 0.05, 0.0, 0.0))


@pytest.fixture(scope="module")
def campaign(shop):
    sensors = tuple(Sensor(f"flange_{axis}", Quantity.DISPLACEMENT, axis) for axis in (Dof.X, Dof.Y))
    told = {name: replace(each, spread=Spread()) for name, each in shop.toolings.items()}
    cuts = tuple(Cut(name, name, shop.machine.plan.conditions(1000.0), Path()) for name in told)
    return Campaign("C", 25600.0, sensors, shop.machine.workpiece, told, cuts)


def test_exact_drawings_leave_the_data_alone(data, campaign, shop):
    assert with_rough(data, replace(campaign, toolings=shop.toolings)) is data


def test_depths_gains_delays_cross_talk_and_toolings_join_the_unknowns(data, campaign):
    found = with_rough(data, campaign)
    known = len(data.coefficient_spread)
    # two depths, two gains, two delays, two shares of cross-talk, then the toolings
    depth = campaign.cuts[0].conditions.axial_depth
    more = found.coefficient_spread[known:]
    assert more[:8] == pytest.approx((0.02e-3 / depth,) * 2 + (0.02,) * 2 + (1.0,) * 2 + (0.015,) * 2)
    assert found.rough_place == slice(known + 8, len(found.coefficient_spread))
    assert found.talk_place == {Dof.X: known + 6, Dof.Y: known + 7}
    x, y = found.axes
    assert np.all(x.force_slope[:, known + 2] == 1.0)
    assert not np.any(x.force_slope[:, known + 3])
    # a delay stands in units of its spread, and turns a line backwards
    np.testing.assert_allclose(y.force_slope[:, known + 5], -5e-6j * y.omega)


def test_what_is_told_as_exact_is_no_unknown(data, campaign):
    sensors = tuple(replace(each, gain_spread=0.0, cross_talk_spread=0.0, delay_spread=0.0) for each in campaign.sensors)
    found = with_rough(data, replace(campaign, sensors=sensors, depth_spread=0.0))
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
