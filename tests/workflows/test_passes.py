"""A campaign of passes from end to end: files, verdicts, machine, and a cut at one speed among them."""

import itertools
import json
import os
import shutil
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import says
from rcsa_ident.cli import app
from rcsa_ident.front.samples import simulate_campaign
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
from rcsa_ident.identification.result import IdentificationCode
from rcsa_ident.identification.status import Status
from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.results.identifications import identification_to_json
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.workflows.identify import clock_error, data_of, identify, judge
from rcsa_ident.workflows.simulate import true_receptances
from rcsa_ident.workflows.tool_change import tooltip
from tests.fixtures.paths import MACHINES

RPM = np.pi / 30.0

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Four passes and one cut with each of two toolings."""
    machine = read_machine(MACHINES / "hpm.toml")
    ends = np.linspace(8000.0, 20000.0, 5) * RPM
    plan = replace(machine.plan, spindle_speeds=(14000.0 * RPM,), passes=tuple(itertools.pairwise(ends)), pass_duration=2.2)
    folder = tmp_path_factory.mktemp("passes") / "campaign"
    simulate_campaign(replace(machine, plan=plan), folder, 5)
    return folder


@pytest.fixture(scope="module")
def readings(campaign):
    known = read_campaign(campaign)
    return known, judge(known, partial(read_cut, known.sensors, known.sampling_rate))


def test_the_file_tells_passes(campaign):
    known = read_campaign(campaign)
    assert [cut.last_speed is None for cut in known.cuts] == [True, False, False, False, False] * 2
    first = known.cuts[1]
    assert (first.speeds[0] / RPM, first.speeds[1] / RPM) == pytest.approx((8000.0, 11000.0))
    assert str(first).startswith("S1-ER32-p00: S1-ER32, ")
    assert ", to 11000 rev/min" in str(first)
    assert "8000 to 20000 rev/min" in str(known)


def test_all_are_usable_and_windows_are_cuts_of_the_data(readings):
    known, found = readings
    assert all(each.verdict.usable for each in found)
    # at the lowest speeds a pass changes by the largest share, and its windows are the shortest
    assert [len(each.measurements) for each in found] == [1, 14, 13, 10, 8] * 2
    data = data_of(known, found)
    assert data.sweeps
    assert len(data.cut_ids) == 2 * 46
    assert data.cut_ids[:3] == ("S1-ER32-00", "S1-ER32-p00", "S1-ER32-p00")
    # the windows of a pass share an angle that is their own; a cut without a trigger has none
    assert data.clamping[0] == -1
    assert len(set(data.clamping[1:15].tolist())) == 1
    assert data.clampings == 8
    # two constant cuts are too few to say something about a clock
    assert clock_error(found) is None


def test_the_machine_comes_out(readings):
    known, found = readings
    answer = identify(known, found, EvidenceSelection(), 1)
    assert answer.axes
    # what was not seen to be reliable is not called so
    assert answer.status is Status.SUSPECT
    assert says(answer.reasons, IdentificationCode.MOSTLY_PASSES)
    machine = identification_to_json(answer, known, [])
    # a pass has no delay of its own
    assert set(machine["delays"]) == {"S1-ER32-00", "S2-PG25-00"}
    setup = read_machine(MACHINES / "hpm.toml")
    for name, allowed in (("S3-PG25-long", 0.02), ("S4-shrink", 0.05)):
        tooling = read_tooling(MACHINES / "toolings" / f"{name}.toml")
        true = true_receptances(setup, tooling)
        band = (true.frequency_hz >= 600.0) & (true.frequency_hz <= 4000.0)
        tip = tooltip(answer.machine, tooling, 2.0 * np.pi * true.frequency_hz[band]).tip.block(TIP).values
        for k in (0, 1):
            exact = true.tip[band, k, k]
            assert np.linalg.norm(tip[:, k, k] - exact) < allowed * np.linalg.norm(exact)


def test_the_command_line_checks_them(campaign):
    answer = CliRunner().invoke(app, ["check", str(campaign), "--json"])
    assert answer.exit_code == 0, answer.output
    rows = {row["id"]: row for row in json.loads(answer.stdout)["recordings"]}
    assert rows["S1-ER32-p00"]["usable"]
    assert rows["S1-ER32-p00"]["programmed_rpm"] == pytest.approx(9500.0)
    assert rows["S1-ER32-p00"]["found_rpm"] == pytest.approx(9500.0, rel=5e-3)
    assert rows["S1-ER32-p00"]["lines"] > 80
    # a few passes are many cuts
    assert json.loads(answer.stdout)["too_few"] is None


def test_the_published_method_refuses_them(readings):
    known, found = readings
    with pytest.raises(InputError, match="passes whose speed changes"):
        identify(known, found, PaperGeneticAlgorithm(generations=1), 1)


@pytest.mark.parametrize("told", [8001.0, 30000.0, -1.0])
def test_a_last_speed_that_cannot_be_is_refused(campaign, tmp_path, told):
    text = (campaign / "campaign.toml").read_text("utf-8")
    changed = text.replace("spindle_speed_to_rpm = 11000.0", f"spindle_speed_to_rpm = {told}", 1)
    assert changed != text
    answer = CliRunner().invoke(app, ["check", str(_copied(campaign, tmp_path, changed))])
    assert answer.exit_code == 2
    assert "spindle_speed_to_rpm" in answer.output


def _copied(campaign, folder, text):
    target = folder / "campaign"
    shutil.copytree(campaign, target, copy_function=os.link)
    (target / "campaign.toml").unlink()
    (target / "campaign.toml").write_text(text, "utf-8")
    return target
