"""Cuts along a path: margins are those of lobes, forces and walls those of the cut at each place; what is alike is asked once."""

import pickle
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement, EngagementMap
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.machine.known_tip import KnownTip
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.margins import FARTHEST
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.toolpath.path import RAPID, ToolPath
from rcsa_ident.workflows.paths import judged_cuts
from rcsa_ident.workflows.paths.removal import field_of, remove_along
from rcsa_ident.workflows.paths.stability import CutsAlong, cuts_along, described, plain, stations_along
from rcsa_ident.workflows.tool_change import ToolChange, surface_of

TOOL = BareCutter("end mill", Cutter(3, 0.01, np.radians(30.0)))
SPEED, FEED_PER_TOOTH = 11000.0 * 2.0 * np.pi / 60.0, 5e-5
FEED = FEED_PER_TOOTH * 3.0 * SPEED / (2.0 * np.pi)
COEFFICIENTS = {"tangential": 8e8, "radial_ratio": 0.3}


def machine() -> KnownTip:
    modes = {
        axis: normal_modes([2.0 * np.pi * hz], [0.03], [[kg**-0.5]], (Coordinate("tip", axis),))
        for axis, hz, kg in ((Dof.X, 922.0, 0.5), (Dof.Y, 1300.0, 0.4))
    }
    return KnownTip(TipModes.of(modes))


def question() -> ToolChange:
    return ToolChange(machine(), TOOL, CutSpec(coefficients=COEFFICIENTS), np.array([SPEED]), 0.02, FullDiscretisation(), 0)


def along(
    places: list[list[float]], low: list[float], high: list[float], step: float = 1e-3, feed: float = FEED
) -> tuple[CutsAlong, ToolPath]:
    path = ToolPath(np.array(places), feed=np.full(len(places), feed), line=np.arange(1, len(places) + 1))
    removal = remove_along(TOOL, path, field_of(TOOL, (np.array(low), np.array(high)), cell=0.25e-3), step)
    change = question()
    return cuts_along(change, removal.path, removal.engagement, stations_along(change.machine, TOOL, removal.path)), removal.path


def lobes(engagement: Engagement, angle: float = 0.0) -> ToolChange:
    return replace(question(), cut=CutSpec(engagement, angle, FEED_PER_TOOTH, coefficients=COEFFICIENTS))


@pytest.mark.parametrize("degrees", [0.0, 90.0])
def test_a_shoulder_has_the_margin_the_force_and_the_wall_of_its_cut(degrees: float) -> None:
    depth, angle = 0.003, np.radians(degrees)
    way, left = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    # half of the cutter, on the right of the way: down-milling
    corners = np.array([0.02 * way, 0.06 * way, 0.02 * way - 0.02 * left, 0.06 * way - 0.02 * left])
    block = [*corners.min(axis=0), -0.01], [*corners.max(axis=0), 0.0]
    found, path = along([[*(0.03 * way), -depth], [*(0.045 * way), -depth]], *block, step=5e-4)
    inner = slice(12, -2)
    change = lobes(Engagement(0.5 * np.pi, np.pi), angle)
    limit = float(change.limits().limit_depth[0])
    assert found.depth[inner] == pytest.approx(depth, rel=1e-6)
    assert found.margin[inner] == pytest.approx(min(limit / depth, FARTHEST), rel=0.02)
    assert found.limit[inner] == pytest.approx(limit, rel=0.02)
    process = change.process
    conditions = CuttingConditions(SPEED, depth, FEED_PER_TOOTH, Engagement(0.5 * np.pi, np.pi))
    mean = force_lines(TOOL.cutter, conditions, process.coefficients, np.array([0]))[0].real
    assert found.mean_force[inner][:, :2] == pytest.approx(np.broadcast_to(mean, found.mean_force[inner][:, :2].shape), rel=0.02)
    wanted = float(surface_of(change, depth).mean[0])
    assert found.form_error[inner] == pytest.approx(wanted, abs=0.03 * abs(wanted) + 5e-8)
    assert found.groups < 8
    assert "no move chatters" in described(found, path)


def test_a_slot_that_is_too_deep_chatters_and_is_named_by_its_line() -> None:
    limit = float(lobes(Engagement(0.0, np.pi)).limits().limit_depth[0])
    deep = 1.2 * limit
    found, path = along([[-0.006, 0.0, -deep], [0.015, 0.0, -deep]], [0.0, -0.01, -0.012], [0.03, 0.01, 0.0])
    assert np.nanmin(found.margin) == pytest.approx(1.0 / 1.2, rel=0.02)
    told = described(found, path)
    assert "chatter" in told
    assert "line 2" in told
    assert "0.83 times as deep" in told
    chattering = found.margin < 1.0
    # how far a cut that chatters moves the tip, and what it leaves, nobody knows
    assert np.all(np.isnan(found.form_error[chattering]))
    assert np.all(np.isnan(found.deflection[chattering]))


def test_two_layers_are_a_map_whose_margin_lies_between_those_of_its_layers() -> None:
    limit = float(lobes(Engagement(0.0, np.pi)).limits().limit_depth[0])
    depth = 0.8 * limit
    places = [
        [-0.006, -0.005, -0.5 * depth],
        [0.036, -0.005, -0.5 * depth],
        [0.036, -0.005, 0.01],
        [-0.006, 0.0, 0.01],
        [-0.006, 0.0, -depth],
        [0.012, 0.0, -depth],
    ]
    path = ToolPath(np.array(places), feed=np.array([FEED, FEED, RAPID, RAPID, RAPID, FEED]))
    removal = remove_along(TOOL, path, field_of(TOOL, (np.array([0.0, -0.02, -0.01]), np.array([0.03, 0.02, 0.0])), cell=0.25e-3), 1e-3)
    change = question()
    found = cuts_along(change, removal.path, removal.engagement, stations_along(change.machine, TOOL, removal.path))
    engagement, height = plain(removal.engagement.at(len(removal.path) - 3), TOOL.cutter)
    assert isinstance(engagement, EngagementMap)
    assert height == pytest.approx(depth)
    # more than a slot of this depth, less than a slot of half of it
    assert limit / depth < found.margin[-3] < 2.0 * limit / depth
    # deeper it would be another cut: how strong the material may be is told, and no limit
    assert found.of_strength[-3]
    assert np.isnan(found.limit[-3])


@pytest.mark.parametrize("together", [64, 3])
def test_the_answer_is_the_same_whatever_maps(together: int, monkeypatch: pytest.MonkeyPatch) -> None:
    places = [[-0.006, 0.0, -0.002], [0.01, 0.0, -0.002], [0.01, 0.008, -0.002], [0.03, 0.008, -0.004]]
    path = ToolPath(np.array(places), feed=np.full(4, FEED))
    removal = remove_along(TOOL, path, field_of(TOOL, (np.array([0.0, -0.02, -0.01]), np.array([0.03, 0.02, 0.0])), cell=0.5e-3), 1e-3)
    told: list[tuple[int, int]] = []

    def elsewhere(function: Callable[[Any], Any], tasks: Iterable[Any]) -> list[Any]:
        return [pickle.loads(pickle.dumps(function))(pickle.loads(pickle.dumps(each))) for each in tasks]

    change = question()
    stations = stations_along(change.machine, TOOL, removal.path)
    here = cuts_along(change, removal.path, removal.engagement, stations, lambda done, total: told.append((done, total)))
    # a place with few cuts is one task, one with many is several
    monkeypatch.setattr(judged_cuts, "_TOGETHER", together)
    there = cuts_along(change, removal.path, removal.engagement, stations, map_=elsewhere)
    assert told[-1] == (here.groups, here.groups)
    assert here.cutting.any()
    for name in ("margin", "margin_low", "chatter_frequency", "mean_force", "peak_force", "deflection", "form_error"):
        np.testing.assert_array_equal(getattr(there, name), getattr(here, name))
    assert there.warnings == here.warnings


def test_engagements_are_as_plain_as_they_are() -> None:
    z = np.array([0.0, 0.001, 0.002])
    told = np.radians([[0.4, 179.3], [0.6, 179.6], [0.2, 179.1]])
    engagement, depth = plain(EngagementMap(z, *told.T), TOOL.cutter)
    assert engagement == Engagement(0.0, np.pi)
    assert depth == 0.002
    entry, leave = np.radians([60.0, 130.0])
    engagement, _ = plain(EngagementMap(z, np.full(3, entry), np.full(3, leave)), TOOL.cutter)
    assert (engagement.entry, engagement.exit) == pytest.approx((entry, leave))
    ramp, _ = plain(EngagementMap(z, np.full(3, entry), np.full(3, leave), feed_rise=0.1), TOOL.cutter)
    assert isinstance(ramp, EngagementMap)
    changing, _ = plain(EngagementMap(z, np.full(3, entry), np.radians([100.0, 110.0, 120.0])), TOOL.cutter)
    assert isinstance(changing, EngagementMap)
    # the height above the tip says nothing of a cylinder and all of a ball
    high = EngagementMap(z + 0.006, np.full(3, entry), np.full(3, leave))
    assert isinstance(plain(high, TOOL.cutter)[0], Engagement)
    engagement, depth = plain(high, Cutter(2, 0.01, profile=Profile.ball(0.01)))
    assert isinstance(engagement, EngagementMap)
    assert depth == pytest.approx(0.008)


def test_what_a_path_must_tell() -> None:
    with pytest.raises(InputError, match="line 2"):
        along([[-0.006, 0.0, -0.001], [0.015, 0.0, -0.001]], [0.0, -0.01, -0.012], [0.03, 0.01, 0.0], feed=np.nan)
    path = ToolPath(np.array([[-0.006, 0.0, -0.001], [0.015, 0.0, -0.001]]), feed=np.full(2, FEED))
    removal = remove_along(TOOL, path, field_of(TOOL, (np.array([0.0, -0.01, -0.01]), np.array([0.03, 0.01, 0.0]))), 1e-3)
    silent = replace(question(), speeds=np.zeros(0))
    stations = stations_along(silent.machine, TOOL, removal.path)
    with pytest.raises(InputError, match="spindle speed"):
        cuts_along(silent, removal.path, removal.engagement, stations)


def test_a_standing_spindle_is_named_and_never_replaced() -> None:
    path = ToolPath(
        np.array([[-0.006, 0.0, -0.001], [0.015, 0.0, -0.001]]), feed=np.full(2, FEED), speed=np.zeros(2), line=np.array([1, 9])
    )
    removal = remove_along(TOOL, path, field_of(TOOL, (np.array([0.0, -0.01, -0.01]), np.array([0.03, 0.01, 0.0]))), 1e-3)
    stations = stations_along(machine(), TOOL, removal.path)
    with pytest.raises(InputError, match=r"spindle speed.*line 9"):
        cuts_along(question(), removal.path, removal.engagement, stations)


def test_a_path_in_the_air_cuts_nothing() -> None:
    found, path = along([[-0.006, 0.0, 0.001], [0.015, 0.0, 0.001]], [0.0, -0.01, -0.012], [0.03, 0.01, 0.0])
    assert not found.cutting.any()
    assert described(found, path) == "nothing is cut"
