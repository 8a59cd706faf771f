"""What limits leave out is said beside them: modes above the band, depths beyond the tool's edges, unusual values."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.curves.flanges import read_flange_machine
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import ToolChange
from tests.fixtures import by_hand

HALF = CutSpec(Engagement(0.5 * np.pi, np.pi), coefficients={"tangential": 9e8, "radial_ratio": 0.26})


def one_axis():
    return by_hand.machine(axes=(Dof.X,))


def change(machine, speeds, depth=0.05):
    return ToolChange(machine, by_hand.tooling(), HALF, np.asarray(speeds, dtype=float), depth)


def pulled_out(machine, stickout_mm):
    keys = tomllib.loads(by_hand.TOOLING)
    keys["tool"]["stickout_mm"] = stickout_mm
    return ToolChange(machine, tooling_of(keys, "", "T"), HALF, np.array([900.0]), 0.01, draws=0)


def above(asked):
    return [remark for remark in asked.remarks(asked.limits()) if "a mode of this tool-holder" in remark]


def test_a_mode_of_the_tool_above_the_band_is_told():
    """The short tool bends above 3 kHz; the limits see the mode of the long one, and nearly all of one that stands at 3 kHz."""
    short = pulled_out(one_axis(), 35.0)
    (told,) = above(short)
    omega = 2.0 * np.pi * np.arange(3000.0, 7500.0, 2.0)
    beyond = short.machine.tip(short.tooling, omega, spread=False).values[:, 0, 0].real
    assert float(re.search("at about ([0-9]+) Hz", told)[1]) == pytest.approx(omega[np.argmin(beyond)] / (2.0 * np.pi), abs=12.0)
    assert [above(pulled_out(one_axis(), length)) for length in (40.0, 60.0)] == [[], []]


def test_a_mode_of_the_tool_above_a_measurement_is_told(tmp_path):
    """Nothing is known of the flange there: it is taken as being at rest."""
    machine = read_flange_machine(by_hand.flange_file(tmp_path / "FLANGE.csv"))
    assert machine.ends
    assert [len(above(pulled_out(machine, length))) for length in (35.0, 60.0)] == [1, 0]


def test_a_limit_beyond_the_tools_edges_is_told():
    soft = replace(HALF, coefficients={"tangential": 3e7, "radial_ratio": 0.3})
    asked = replace(change(one_axis(), np.linspace(500.0, 1500.0, 5), depth=0.5), cut=soft)
    found = asked.limits(draws=0)
    deeper = int(np.sum(np.minimum(found.limit_depth, 0.5) > 0.06))
    assert deeper > 0
    assert f"at {deeper} of 5 speeds the limit is deeper than the tool's stickout of 60 mm" in asked.remarks(found)


def test_unusual_values_reach_the_answer():
    odd = replace(HALF, engagement=Engagement.from_immersion(0.005, "down"))
    found = advise(replace(change(one_axis(), [900.0, 950.0]), cut=odd))
    assert "radial immersion is 0.5 %, but usual are 1.5 to 100 %: was 50 % meant?" in found.remarks
    assert not [remark for remark in advise(change(one_axis(), [900.0, 950.0])).remarks if "usual" in remark]
