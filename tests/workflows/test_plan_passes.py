"""Passes whose speed changes: what they cross, how deep and how long they are, what they are expected to tell."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.sweep import WINDOW
from rcsa_ident.workflows.plan import limits_at, plan_cuts
from rcsa_ident.workflows.plan_passes import plan_passes
from tests.workflows.test_plan import ALLOWED, BAND, COEFFICIENTS, RPM, machine_of

ERRORS = {Dof.X: 2e-3, Dof.Y: 2e-3}
DEPTHS = replace(ALLOWED, depths=(0.1e-3, 0.2e-3, 0.4e-3, 0.6e-3))


def plan(cut_with, wanted, count=6, allowed=DEPTHS, **more):
    return plan_passes(machine_of(), cut_with, wanted, allowed, COEFFICIENTS, 1e-10, ERRORS, BAND, count, **more)


@pytest.fixture(scope="module")
def planned(toolings, targets):
    return plan(toolings, targets)


def test_they_cross_all_speeds_one_after_the_other(planned, toolings):
    for tooling in toolings:
        own = [each for each in planned.passes if each.tooling == tooling.name]
        assert len(own) == 6
        assert own[0].conditions.spindle_speed == pytest.approx(ALLOWED.lowest)
        assert own[-1].last_speed == pytest.approx(ALLOWED.highest)
        for one, other in itertools.pairwise(own):
            assert one.last_speed == other.conditions.spindle_speed
    rpm = np.array([each.conditions.spindle_speed for each in planned.passes]) / RPM
    np.testing.assert_allclose(rpm, np.round(rpm), atol=1e-6)


def test_each_is_stable_at_every_speed_that_it_crosses(planned, toolings):
    by_name = {tooling.name: tooling for tooling in toolings}
    for each in planned.passes[::3]:
        # at others than the speeds that the plan has asked
        speeds = np.linspace(each.conditions.spindle_speed, each.last_speed, 97)
        limits = limits_at(machine_of(), by_name[each.tooling], ALLOWED, COEFFICIENTS, ALLOWED.feed_angle, speeds)
        assert each.conditions.axial_depth * ALLOWED.margin <= 1.01 * limits.min()
        deeper = [depth for depth in DEPTHS.depths if depth > each.conditions.axial_depth]
        assert all(depth * ALLOWED.margin > each.limit_depth for depth in deeper)


def test_the_path_is_feed_times_teeth(planned, toolings):
    each = planned.passes[0]
    teeth = toolings[0].cutter.teeth
    turns = 0.5 * (each.conditions.spindle_speed + each.last_speed) / (2.0 * np.pi) * each.seconds
    assert each.path == pytest.approx(turns * teeth * 1e-4)


def test_bands_fall_pass_by_pass_and_as_with_cuts_at_these_speeds(planned, toolings, targets):
    assert planned.band.shape == (len(planned.passes) + 1, len(targets))
    assert np.all(np.diff(planned.band, axis=0) < 0.0)
    # as much as many chosen cuts: windows are cuts
    cuts = plan_cuts(machine_of(), toolings, targets, ALLOWED, COEFFICIENTS, 1e-10, ERRORS, BAND, 10)
    windows = sum(int(each.seconds / WINDOW) for each in planned.passes)
    assert windows > 100
    assert np.all(planned.band[-1] < cuts.band[-1])
    np.testing.assert_allclose(planned.band[0], cuts.band[0], rtol=1e-9)


def test_a_pass_that_is_nowhere_deep_enough_is_named(toolings, targets):
    limits = [each.limit_depth for each in plan(toolings, targets).passes]
    depth = float(np.median(limits)) / ALLOWED.margin
    found = plan(toolings, targets, allowed=replace(ALLOWED, depths=(depth,)))
    assert 0 < len(found.passes) < 12
    assert len(found.passes) + len(found.warnings) == 12
    assert "stable everywhere are" in found.warnings[0]


@pytest.mark.parametrize(
    ("count", "seconds", "allowed", "words"),
    [
        (400, 4.0, ALLOWED, "passes that change the speed by 0.5 to 200 %"),
        (1, 4.0, replace(ALLOWED, lowest=2000.0 * RPM), "passes that change the speed"),
        (0, 4.0, ALLOWED, "1 or more"),
        (6, 0.0, ALLOWED, "seconds of a pass"),
        (6, 4.0, replace(ALLOWED, depths=(0.05,)), "none stable"),
    ],
)
def test_bad_input_is_named(toolings, targets, count, seconds, allowed, words):
    with pytest.raises(InputError, match=words):
        plan(toolings, targets, count, allowed, seconds=seconds)
