"""Lobes of a machine that changes with speed: each speed feels its own machine, one that does not change feels no difference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.posterior import MachineAxis
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.workflows.lobes import LobeConditions, lobe_bands, tooling_lobes
from rcsa_ident.workflows.speeds import BLOCK, MachineOverSpeed, lobes_over_speed
from rcsa_ident.workflows.tip import tooltip
from tests.fixtures import by_hand

OMEGA = 2.0 * np.pi * np.arange(300.0, 3000.0, 10.0)
LOW, HIGH = 600.0, 1400.0


def machine_of(shift=1.0, softening=False):
    known = by_hand.posterior(shift, softening)
    modes, joint = known.machine(Dof.X)
    return {Dof.X: MachineAxis(Spindle(modes), joint, known)}


@pytest.fixture
def assembly(tmp_path):
    return by_hand.campaign(tmp_path).toolings["T1"].assembly


def conditions(speeds):
    return LobeConditions(
        MillingProcess(Cutter(4, 0.012), CuttingCoefficients(9e8, 0.26), Engagement(0.5 * np.pi, np.pi)), np.array(speeds), 0.05
    )


def test_a_machine_that_stays_has_the_lobes_of_one_response(assembly):
    machine = machine_of()
    wanted = conditions(np.linspace(500.0, 1500.0, 40)[::-1])
    response = tooltip(machine, assembly, OMEGA)
    lobes, band = lobes_over_speed(MachineOverSpeed(machine), assembly, OMEGA, wanted)
    one = tooling_lobes(response, wanted)
    for name in ("spindle_speed", "limit_depth", "chatter_frequency", "lobe"):
        np.testing.assert_array_equal(getattr(lobes, name), getattr(one, name))
    assert (lobes.absolute_limit, lobes.absolute_frequency, lobes.method) == (one.absolute_limit, one.absolute_frequency, one.method)
    for mine, theirs in zip(band, lobe_bands(response, wanted), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_each_speed_feels_the_machine_at_that_speed(assembly):
    machine = machine_of(softening=True)
    speeds = [1300.0, 650.0, 1000.0]
    lobes, band = lobes_over_speed(MachineOverSpeed(machine), assembly, OMEGA, conditions(speeds), bands=False)
    assert band is None
    np.testing.assert_array_equal(lobes.spindle_speed, speeds)
    lowest = []
    for k, speed in enumerate(speeds):
        alone = tooling_lobes(tooltip(machine, assembly, OMEGA, False, speed), conditions([speed]))
        assert lobes.limit_depth[k] == alone.limit_depth[0]
        assert lobes.chatter_frequency[k] == alone.chatter_frequency[0]
        lowest.append(alone.absolute_limit)
    assert lobes.absolute_limit == min(lowest)


def test_the_change_with_speed_matters(assembly):
    machine = machine_of(softening=True)
    wanted = conditions(np.linspace(LOW, HIGH, 60))
    lobes, _ = lobes_over_speed(MachineOverSpeed(machine), assembly, OMEGA, wanted, bands=False)
    still = tooling_lobes(tooltip(machine, assembly, OMEGA, False), wanted)
    assert np.max(np.abs(lobes.limit_depth / still.limit_depth - 1.0)) > 0.03


def test_blocks_are_narrow_enough(assembly):
    machine = machine_of(softening=True)
    speeds = np.linspace(LOW, HIGH, 120)
    lobes, _ = lobes_over_speed(MachineOverSpeed(machine), assembly, OMEGA, conditions(speeds), bands=False)
    for k in range(0, speeds.size, 17):
        alone = tooling_lobes(tooltip(machine, assembly, OMEGA, False, speeds[k]), conditions([speeds[k]]))
        # half a block of a few per cent of softening over the whole range
        assert lobes.limit_depth[k] == pytest.approx(alone.limit_depth[0], rel=0.02)
    assert BLOCK <= 0.025


def test_outside_its_speeds_the_machine_of_the_nearest_answers(assembly):
    machine = machine_of(softening=True)
    lobes, _ = lobes_over_speed(MachineOverSpeed(machine), assembly, OMEGA, conditions([300.0, 2500.0]), bands=False)
    for k, nearest in enumerate((LOW, HIGH)):
        alone = tooling_lobes(tooltip(machine, assembly, OMEGA, False, nearest), conditions(lobes.spindle_speed[k : k + 1]))
        assert lobes.limit_depth[k] == pytest.approx(alone.limit_depth[0], rel=1e-12)


def test_bands_between_the_anchors_are_those_of_a_posterior_there(assembly):
    machine = machine_of(softening=True)
    speeds = np.linspace(LOW, HIGH, 9)
    _, (low, high) = lobes_over_speed(MachineOverSpeed(machine), assembly, OMEGA, conditions(speeds))
    for k, speed in enumerate(speeds):
        alone = conditions([speed])
        own_low, own_high = lobe_bands(tooltip(machine, assembly, OMEGA, True, speed), alone)
        assert low[k] < high[k]
        assert (high[k] - low[k]) == pytest.approx(own_high[0] - own_low[0], rel=0.1)


def test_a_speed_band_answers_with_its_own_machine(assembly):
    slow, fast, whole = machine_of(0.9), machine_of(1.1), machine_of()
    machine = MachineOverSpeed(whole, [((LOW, 1000.0), slow), ((1000.0, HIGH), fast)])
    assert machine.at(None) is whole
    assert machine.at(700.0) is slow
    assert machine.at(1001.0) is fast
    # the nearest one beyond both ends
    assert machine.at(10.0) is slow
    assert machine.at(9000.0) is fast
    assert machine.speed_range == (LOW, HIGH)
    speeds = [1200.0, 700.0]
    lobes, band = lobes_over_speed(machine, assembly, OMEGA, conditions(speeds))
    for k, own in enumerate((fast, slow)):
        alone = conditions([speeds[k]])
        response = tooltip(own, assembly, OMEGA)
        assert lobes.limit_depth[k] == tooling_lobes(response, alone).limit_depth[0]
        np.testing.assert_array_equal([edge[k] for edge in band], [edge[0] for edge in lobe_bands(response, alone)])


def test_a_machine_without_a_posterior_stays_and_has_no_band(assembly):
    machine = {axis: replace(part, posterior=None) for axis, part in machine_of().items()}
    assert MachineOverSpeed(machine).speed_range is None
    assert MachineOverSpeed(machine_of()).speed_range is None
    assert MachineOverSpeed(machine_of(softening=True)).speed_range == (LOW, HIGH)
    _, band = lobes_over_speed(MachineOverSpeed(machine), assembly, OMEGA, conditions([900.0]))
    assert band is None
