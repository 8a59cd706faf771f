"""A table that gives way, from recordings to limits: what is asked of tool and table together, and what of the tool alone."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.uncertain import Doubted
from rcsa_ident.front.samples import simulate_campaign
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.machine.workpiece_side import WorkpieceAxis, WorkpieceSide
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.signals.recording import Role
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.rotor import rotor
from rcsa_ident.virtual.workpiece_side import SideMode, VirtualWorkpieceSide
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.identify import identify, judge
from rcsa_ident.workflows.learn_from_cuts import believed_of_machine
from rcsa_ident.workflows.tool_change import ToolChange, surface_of, tooltip
from tests.fixtures import by_hand
from tests.fixtures.paths import MACHINES

HZ = 2.0 * np.pi
SPEEDS = np.linspace(600.0, 1400.0, 9)
HALF = CutSpec(
    Engagement(0.5 * np.pi, np.pi),
    feed_per_tooth=1e-4,
    coefficients={"tangential": 9e8, "radial_ratio": 0.26, "tangential_spread": 0.0, "ratio_spread": 0.0},
)


def soft(sensor, hertz):
    return WorkpieceAxis(sensor, Role.TABLE, HZ * np.array([hertz]), np.array([0.03]), np.array([4e5]), np.diag([1e-4, 4e-2, 1e-2]) ** 2)


#: So soft that it is what chatters.
SOFT = WorkpieceSide({Dof.X: soft("table_x", 500.0), Dof.Y: soft("table_y", 700.0)})


def change(machine, method=None, **further):
    return ToolChange(machine, by_hand.tooling(), HALF, SPEEDS, 0.05, method or FullDiscretisation(), **further)


@pytest.mark.slow
def test_limits_are_those_of_the_sum_by_two_methods():
    """The table's chatter is heard, at limits that its modes and the tool's receptance have together, in both domains."""
    machine = by_hand.machine(known=False)
    on_table = replace(machine, workpiece_side=SOFT)
    rigid, found = (change(each, draws=0).limits() for each in (machine, on_table))
    assert np.median(rigid.limit_depth / found.limit_depth) > 2.0
    omega = HZ * np.arange(50.0, 4500.0, 1.0)
    own = on_table.tip(by_hand.tooling(), omega)
    added = np.stack([SOFT.axes[axis].receptance(omega) for axis in (Dof.X, Dof.Y)], axis=1)
    summed = replace(own, values=own.values + added[:, :, None] * np.eye(2))
    process = HALF.process(by_hand.tooling().cutter)
    expected = stability_lobes(summed, process, SPEEDS, 0.05, MultiFrequency())
    assert found.limit_depth == pytest.approx(expected.limit_depth, rel=0.02)
    heard = found.chatter_frequency / HZ
    assert np.sum((heard > 400.0) & (heard < 950.0)) >= 7


@pytest.mark.slow
def test_advice_bands_surface_and_labels_know_of_the_table():
    machine = by_hand.machine()
    on_table = replace(machine, workpiece_side=SOFT)
    own, both = (advise(change(each)) for each in (machine, on_table))
    assert np.median(both.lobes.limit_depth) < 0.6 * np.median(own.lobes.limit_depth)
    assert max(point.depth for point in both.recommended) < 0.9 * max(point.depth for point in own.recommended)
    assert SOFT.words in both.remarks
    assert both.band.shares[Doubted.WORKPIECE] > 0.3
    assert Doubted.WORKPIECE not in own.band.shares
    # a wall is left where tool and workpiece stand to each other
    errors = [surface_of(change(each), 1e-4).error for each in (machine, on_table)]
    assert np.nanmax(np.abs(errors[1])) > 1.5 * np.nanmax(np.abs(errors[0]))


def test_labels_teach_tool_and_workpiece_together():
    machine = by_hand.machine(rivals=0)
    certain = WorkpieceSide({axis: replace(each, covariance=1e-6 * each.covariance) for axis, each in SOFT.axes.items()})
    coefficients = change(machine).process.coefficients
    frequencies = [
        np.abs(believed_of_machine(each, by_hand.tooling(), coefficients, 5e-4).prior.modes.pole) / HZ
        for each in (machine, replace(machine, workpiece_side=certain))
    ]
    assert np.min(np.abs(frequencies[1] - 500.0)) < 5.0 < np.min(np.abs(frequencies[0] - 500.0))


def test_a_tooltip_is_the_tools_own_unless_it_is_asked_for_relative():
    machine = replace(by_hand.machine(), workpiece_side=SOFT)
    omega = HZ * np.arange(300.0, 1000.0, 5.0)
    plain, own, relative = (
        tooltip(each, by_hand.tooling(), omega, relative=asked)
        for each, asked in ((by_hand.machine(), False), (machine, False), (machine, True))
    )
    np.testing.assert_array_equal(own.tip.values, plain.tip.values)
    assert own.remarks == (SOFT.words, *plain.remarks)
    added = np.einsum("nii->ni", relative.tip.values - own.tip.values)
    np.testing.assert_allclose(added[:, 1], SOFT.axes[Dof.Y].receptance(omega), rtol=1e-9)


TABLE = VirtualWorkpieceSide((SideMode(HZ * 640.0, 0.025, 3.5e6),), (SideMode(HZ * 800.0, 0.03, 4e6),))


@pytest.mark.witness
@pytest.mark.slow
def test_from_recordings_to_limits(tmp_path, monkeypatch):
    """Two toolings on a table that gives way: its modes within what is told of them, the spindle's side the same to the last bit as without
    the accelerometers, and the limits of a tool that never cut those of tool and table together."""
    monkeypatch.setattr("rcsa_ident.workflows.simulate.TRUTH_FREQUENCIES", (600.0, 900.0, 100.0))
    machine = read_machine(MACHINES / "hpm.toml")
    speeds = tuple(np.linspace(8000.0, 20_000.0, 10) * np.pi / 30.0)
    machine = replace(machine, workpiece_side=TABLE, plan=replace(machine.plan, spindle_speeds=speeds, axial_depth=0.15e-3))
    campaign = read_campaign(simulate_campaign(replace(machine, truth_toolings=()), tmp_path / "c", 502).folder)
    told = {}
    for name, kept in (("with", campaign), ("without", replace(campaign, sensors=campaign.sensors[:4]))):
        readings = judge(kept, partial(read_cut, kept.sensors, kept.sampling_rate))
        told[name] = identify(kept, readings, EvidenceSelection(), 1)
    found, without = told["with"], told["without"]
    assert without.workpiece_side is None
    for axis, part in found.axes.items():
        np.testing.assert_array_equal(part.posterior.theta, without.axes[axis].posterior.theta)
    for axis, modes in ((Dof.X, TABLE.x), (Dof.Y, TABLE.y)):
        each = found.workpiece_side.axes[axis]
        true = np.log([[mode.natural_frequency, mode.damping_ratio, mode.stiffness] for mode in modes]).T
        assert each.logs.shape == true.shape
        assert np.all(np.abs(each.logs - true).ravel() < 4.0 * np.sqrt(np.diag(each.covariance)))
        assert np.all(np.abs(each.logs - true) < [[2e-3], [0.05], [0.05]])
    tooling = read_tooling(machine.truth_toolings[1])
    asked = np.linspace(800.0, 2000.0, 7)
    cut = CutSpec(machine.plan.engagement, machine.plan.feed_angle, coefficients={"tangential": 902e6, "radial_ratio": 0.26})
    limits = [
        ToolChange(each.machine, tooling, cut, asked, 0.02, FullDiscretisation(), draws=0).limits().limit_depth for each in (found, without)
    ]
    whole = TABLE.under(poles(reduced(rotor(machine.spindle, tooling.assembly))))
    tip = [[str(c) for c in whole.coordinates].index(f"tip.{axis}") for axis in "xy"]
    process = MillingProcess(tooling.cutter, machine.workpiece.coefficients, machine.plan.engagement, machine.plan.feed_angle)
    modes = TipModes(whole.pole, whole.outputs[tip], whole.inputs, np.zeros((2, 2)))
    true = FullDiscretisation().lobes(modes, process, asked, 0.02).limit_depth
    assert np.max(np.abs(limits[0] / true - 1.0)) < 0.03
    assert np.max(limits[1] / true) > 2.0
