"""What is kept of a machine answers as plain coupling does at every frequency."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.posterior import MachineAxis
from rcsa_ident.io.settings import setups
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.stability.lobes import stability_lobes, uncoupled_planes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.tool_holder.geometry import stiffened
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
    return IdentifiedMachine(found, (2.0 * np.pi * 600.0, 2.0 * np.pi * 3000.0))


def slender():
    """A tool that hardly damps: its resonance is sharp."""
    tool = {"stickout_mm": 95.0, "segments": [{"length_mm": 135.0, "outer_diameter_mm": 10.0, "material": "carbide"}]}
    contact = {"translational_stiffness": 2e10, "rotational_stiffness": 6e5, "translational_damping": 0.0, "rotational_damping": 0.0}
    materials = {"carbide": {"loss_factor": 0.001}}
    return setups.tooling_of(example(tool=tool, contact=contact, materials=materials), "", "slender")


TOOLINGS = {"stout": setups.tooling_of(example(), "", "stout"), "slender": slender()}


def process(tooling, **further):
    return MillingProcess(
        tooling.cutter,
        CuttingCoefficients(9e8, 0.3, tangential_spread=0.0, ratio_spread=0.0),
        Engagement.from_immersion(0.5, "down"),
        **further,
    )


def plainly(assembly, share):
    """Tip receptances and their spread for each axis, nothing kept and no inverse in closed form; the holder's stiffness stands last."""
    tips, spreads = {}, {}
    for axis in (Dof.X, Dof.Y):
        coupled = machine().coupled(assembly, OMEGA, (axis,))
        stiffer = machine().coupled(stiffened(assembly, share), OMEGA, (axis,))
        name, place = f"tip.{axis}", [str(row) for row in coupled.rows].index(f"tip.{axis}")
        tips[axis] = coupled.between(name, name)
        spreads[axis] = np.vstack([coupled.spread[:, :, place, place], stiffer.between(name, name) - tips[axis]])
    return tips, spreads


@pytest.fixture(scope="module")
def kept():
    found = machine().kept()
    assert found.prepared
    np.testing.assert_array_equal(found.lines(), OMEGA)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", TOOLINGS)
def test_tooltip_and_its_spread_to_rounding(kept, name):
    assembly = TOOLINGS[name].assembly
    ours = kept.tip(assembly, stiffness_spread=0.01)
    tips, spreads = plainly(assembly, 0.01)
    changes = {ours.rows[v.members[0]].dof: v.change[:, :, 0, 0] for v in ours.variation.at(np.arange(OMEGA.size))}
    for axis in (Dof.X, Dof.Y):
        np.testing.assert_allclose(ours.between(f"tip.{axis}", f"tip.{axis}"), tips[axis], rtol=1e-8)
        size = np.abs(spreads[axis]).max()
        assert changes[axis].shape == spreads[axis].shape
        np.testing.assert_allclose(changes[axis], spreads[axis], atol=1e-9 * size)


def test_without_a_posterior_there_is_no_spread():
    tooling, bare = TOOLINGS["stout"], machine(posterior=False).kept()
    tip = bare.tip(tooling, stiffness_spread=0.01)
    assert isinstance(tip, UncertainReceptance)
    assert tip.variation is None
    assert stability_lobes(tip, process(tooling), SPEEDS, 0.01, draws=60).band is None


@pytest.mark.slow
@pytest.mark.parametrize("name", TOOLINGS)
def test_limits_to_rounding_and_those_of_drawn_machines_closely(kept, name):
    """Drawn machines are asked at a part of the frequencies: less than a ten-thousandth of a limit, far below the band itself."""
    tooling = TOOLINGS[name]
    ours = stability_lobes(kept.tip(tooling, stiffness_spread=5e-4), process(tooling), SPEEDS, 0.02, draws=60)
    tips, spreads = plainly(tooling.assembly, 5e-4)
    planes = [machine().coupled(tooling, OMEGA, (axis,)) for axis in (Dof.X, Dof.Y)]
    theirs = stability_lobes(uncoupled_planes(*planes), process(tooling), SPEEDS, 0.02)
    np.testing.assert_allclose(ours.limit_depth, theirs.limit_depth, rtol=1e-9)
    assert ours.warnings == theirs.warnings
    rng, drawn = np.random.default_rng(1), np.zeros((60, OMEGA.size, 2, 2), dtype=complex)
    for draw in drawn:
        own = [rng.standard_normal(len(spreads[axis])) for axis in (Dof.X, Dof.Y)]
        own[1][-1] = own[0][-1]  # the holder is one and the same in both planes
        for i, axis in enumerate((Dof.X, Dof.Y)):
            draw[:, i, i] = tips[axis] + own[i] @ spreads[axis]
    limits = ZeroOrder().depths(OMEGA, drawn, process(tooling), SPEEDS, 0.02)
    both = np.isfinite(ours.drawn) & np.isfinite(limits)
    assert both.mean() > 0.9
    # at the very end of a lobe the limit jumps; there it may be that of a speed one in two thousand away
    away = [ZeroOrder().depths(OMEGA, drawn, process(tooling), factor * SPEEDS, 0.02) for factor in (0.9995, 1.0005)]
    off = np.abs(ours.drawn / np.array([limits, *away]) - 1.0)
    assert np.mean(off[0][both] < 1e-4) > 0.999
    assert np.all(off.min(axis=0)[both] < 1e-3)
    everywhere = np.quantile(np.where(limits > 0.02, np.inf, limits), (0.025, 0.975), axis=0, method="nearest")
    for here, there in zip(ours.band, everywhere, strict=True):
        known = np.isfinite(here) & np.isfinite(there)
        np.testing.assert_allclose(here[known], there[known], rtol=1e-4)
