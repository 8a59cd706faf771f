"""What is kept of a machine answers as the workflows do that keep nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from api.work.machine_side import CHANGE, GROWTH, WIDEST, MachineSide, nodes_of
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.posterior import MachineAxis
from rcsa_ident.io import setups
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.workflows.limits import machine_limits
from rcsa_ident.workflows.lobes import LobeConditions
from rcsa_ident.workflows.speeds import MachineOverSpeed
from rcsa_ident.workflows.tip import tooltip
from tests.fixtures import by_hand
from tests.fixtures.service import example

OMEGA = 2.0 * np.pi * np.arange(100.0, 3001.0, 1.0)
SPEEDS = np.arange(5000.0, 18001.0, 250.0) * np.pi / 30.0


def machine(posterior=True):
    found = {}
    for axis, shift in ((Dof.X, 1.0), (Dof.Y, 0.95)):
        known = by_hand.posterior(shift, seed=3 if axis is Dof.X else 4)
        modes, joint = known.machine(axis)
        found[axis] = MachineAxis(Spindle(modes), joint, known if posterior else None)
    return found


def slender():
    """A tool that hardly damps: its resonance is sharp."""
    tool = {"stickout_mm": 95.0, "segments": [{"length_mm": 135.0, "outer_diameter_mm": 10.0, "material": "carbide"}]}
    contact = {"translational_stiffness": 2e10, "rotational_stiffness": 6e5, "translational_damping": 0.0, "rotational_damping": 0.0}
    materials = {"carbide": {"loss_factor": 0.001}}
    return setups.tooling_of(example(tool=tool, contact=contact, materials=materials), "", "slender")


TOOLINGS = {"stout": setups.tooling_of(example(), "", "stout"), "slender": slender()}


def process(tooling, **further):
    return MillingProcess(tooling.cutter, CuttingCoefficients(9e8, 0.3), Engagement.from_immersion(0.5, "down"), **further)


@pytest.mark.parametrize("name", TOOLINGS)
def test_tooltip_and_its_spread_to_rounding(name):
    assembly = TOOLINGS[name].assembly
    ours = MachineSide.of(machine(), OMEGA).response(assembly, True, 0.01)
    theirs = tooltip(machine(), assembly, OMEGA, True, None, 0.01)
    for axis in (Dof.X, Dof.Y):
        np.testing.assert_allclose(ours.tip(axis), theirs.tip(axis), rtol=1e-8)
        size = np.abs(theirs.spread[axis]).max()
        assert ours.spread[axis].shape == theirs.spread[axis].shape
        np.testing.assert_allclose(ours.spread[axis], theirs.spread[axis], atol=1e-9 * size)


def test_without_a_posterior_there_is_no_spread():
    side = MachineSide.of(machine(posterior=False), OMEGA)
    assert side.response(TOOLINGS["stout"].assembly, True, 0.01).spread == {}
    tooling = TOOLINGS["stout"]
    limits = side.limits(tooling.assembly, LobeConditions(process(tooling), SPEEDS, 0.01), 60, 0.01)
    assert limits.band is None


@pytest.mark.parametrize("name", TOOLINGS)
def test_limits_to_rounding_and_those_of_drawn_machines_closely(name):
    """Drawn machines are asked at a part of the frequencies: less than a ten-thousandth of a limit, far below the band itself."""
    tooling = TOOLINGS[name]
    conditions = LobeConditions(process(tooling), SPEEDS, 0.02)
    ours = MachineSide.of(machine(), OMEGA).limits(tooling.assembly, conditions, 60, 5e-4)
    theirs = machine_limits(MachineOverSpeed(machine()), tooling.assembly, OMEGA, conditions, 60, 5e-4)
    np.testing.assert_allclose(ours.lobes.limit_depth, theirs.lobes.limit_depth, rtol=1e-9)
    assert ours.lobes.warnings == theirs.lobes.warnings
    both = np.isfinite(ours.drawn) & np.isfinite(theirs.drawn)
    assert both.mean() > 0.9
    np.testing.assert_allclose(ours.drawn[both], theirs.drawn[both], rtol=1e-4)
    for here, there in zip(ours.band, theirs.band, strict=True):
        known = np.isfinite(here) & np.isfinite(there)
        np.testing.assert_allclose(here[known], there[known], rtol=1e-4)


@given(st.lists(st.complex_numbers(min_magnitude=0.1, max_magnitude=10.0), min_size=2, max_size=200))
def test_nodes_leave_nothing_out(values):
    """First and last are among them, none is farther than allowed, and where the curve jumps every line stands."""
    curve = np.array(values)
    nodes = nodes_of([curve])
    assert nodes[0] == 0
    assert nodes[-1] == curve.size - 1
    assert np.all(np.diff(nodes) >= 1)
    assert np.all(np.diff(nodes) <= WIDEST + 1)
    steep = np.abs(np.diff(curve)) / np.maximum(np.abs(curve[1:]), np.abs(curve[:-1])) >= CHANGE
    # between two steep lines there is a node at each end
    for k in np.flatnonzero(steep[:-1] & steep[1:]):
        assert k + 1 in nodes


def test_nodes_stand_close_on_both_sides_of_a_jump():
    """Distances shrink towards it and grow away from it, each by a share of what it is."""
    curve = np.ones(400, dtype=complex)
    curve[200:] = 3.0
    gaps = np.diff(nodes_of([curve]))
    nodes = nodes_of([curve])
    place = int(np.searchsorted(nodes, 200))
    before, behind = gaps[:place][::-1], gaps[place:]
    for side in (before, behind):
        assert np.all(side[:6] <= 2)
        assert side.max() >= WIDEST - 1
        far = np.concatenate([[0], np.cumsum(side)[:-1]])
        assert np.all(side <= 3 + 2 * GROWTH * far)
