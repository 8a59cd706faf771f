"""A machine made by hand, and one of each noun that shows itself."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.front.identified import Result
from rcsa_ident.io.settings.simulations import SimulatedCampaign
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.observer.force import ForceEstimate
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.signals.verdict import Verdict
from rcsa_ident.workflows.estimate_forces import MonitoredCut
from rcsa_ident.workflows.tool_change import ToolChange, surface_of
from tests.fixtures import by_hand
from tests.fixtures.synthetic import pair

SPEEDS = ri.rpm(6000, 12_000, 200)


@pytest.fixture(scope="session")
def nouns(tmp_path_factory) -> SimpleNamespace:
    """One of each, computed once."""
    folder: Path = tmp_path_factory.mktemp("by_hand")
    (folder / "RESULT.json").write_text(by_hand.result_text(folder), encoding="utf-8")
    campaign, found = by_hand.campaign(folder), by_hand.identification()
    readings = tuple(Reading(cut.id, cut.tooling, cut.conditions.spindle_speed, Verdict()) for cut in campaign.cuts)
    result, read = Result.of(found, campaign, readings), ri.read_result(folder / "RESULT.json")
    tooling, machine = campaign.toolings["T1"], read.machine
    cut = ri.CutSpec(feed_per_tooth=1e-4)
    process = cut.process(tooling.cutter, campaign.workpiece)
    tip = machine.tip(tooling)
    lobes = ri.stability_lobes(tip, process, SPEEDS, max_depth=5e-3)
    modes = ri.TipModes.of({Dof.X: ri.normal_modes([ri.hz(900.0)], [0.04], [[2.0]], (ri.Coordinate("tip", Dof.X),))})
    time = np.arange(2000) / 25600.0
    force = np.stack([np.sin(6000.0 * time), np.cos(6000.0 * time)], axis=1)
    estimate = ForceEstimate((Dof.X, Dof.Y), 1.0 / 25600.0, 50.0 * force, np.full(force.shape, 2.0), np.ones(2))
    settled: Any = SimpleNamespace(settling=0)
    flange = ri.normal_modes(ri.hz(1.0) * np.array([800.0, 1900.0]), [0.05, 0.04], [[0.2, 0.5], [0.15, -0.6]], plane("flange"))
    return SimpleNamespace(
        folder=folder,
        campaign=campaign,
        cut=campaign.cuts[0],
        tooling=tooling,
        identification=found,
        result=result,
        read=read,
        machine=machine,
        flange=FlangeMachine((flange,), (ri.hz(100.0), ri.hz(3000.0)), name="tapped"),
        known=ri.KnownTip(modes),
        modes=modes,
        tip=tip,
        coupled=machine.coupled(tooling, ri.hz(300.0, 3000.0, 10.0)),
        spec=cut,
        process=process,
        lobes=lobes,
        pocket=lobes.best_speeds()[0],
        advice=ri.advise(machine, tooling, cut, SPEEDS, 5e-3, depth=0.3e-3, planned=[(SPEEDS[5], 0.5e-3)]),
        no_feed=ri.advise(machine, tooling, speeds=SPEEDS, max_depth=5e-3),
        chart=ri.stability_map(modes, process, SPEEDS, np.linspace(1e-4, 5e-3, 20)),
        surface=surface_of(ToolChange(machine, tooling, cut, SPEEDS, 5e-3), 2e-4),
        recording=pair(duration=0.2).cut,
        reading=readings[0],
        estimate=estimate,
        forces=MonitoredCut(estimate, settled, ri.rpm(9000), 4, (ri.hz(300.0), ri.hz(4000.0)), {}, {}, {}, ("a remark",)),
    )


@pytest.fixture(scope="session")
def triggered(tmp_path_factory) -> SimulatedCampaign:
    """A campaign of the sample machine whose sensors have a trigger, and one cut with a tool that it never cut with."""
    from dataclasses import replace

    from rcsa_ident.front.samples import sample_data, sample_toolings, simulate_campaign
    from rcsa_ident.io.settings.machines import read_machine

    folder = tmp_path_factory.mktemp("shop")
    machine = read_machine(sample_data() / "hpm.toml")
    machine = replace(machine, sensors=replace(machine.sensors, trigger=True), truth_toolings=())
    speeds = tuple(np.linspace(machine.plan.spindle_speeds[0], machine.plan.spindle_speeds[-1], 8).tolist())
    long = replace(machine, plan=replace(machine.plan, spindle_speeds=speeds[1:2]), toolings=(sample_toolings()["S3-PG25-long"],))
    with pytest.MonkeyPatch.context() as patch:
        # nobody looks at the true receptances
        patch.setattr("rcsa_ident.workflows.simulate.TRUTH_FREQUENCIES", (100.0, 4500.0, 400.0))
        made = simulate_campaign(replace(machine, plan=replace(machine.plan, spindle_speeds=speeds)), folder / "data" / "sample_runs")
        alone = simulate_campaign(long, folder / "alone")
    (folder / "data" / "machines").symlink_to(sample_data(), target_is_directory=True)
    next((alone.folder / "recordings").glob("*_cut.h5")).rename(folder / "cut.h5")
    return made
