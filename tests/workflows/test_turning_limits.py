"""Stability on a machine whose spindle turns: every method beside the virtual machine's own limit, each speed with its own tip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.machine.flange_part import Doubt, FlangePart, JointedFlange, Perturbation
from rcsa_ident.machine.mode_synthesis import FLANGE
from rcsa_ident.machine.speed_dependence import BLOCK
from rcsa_ident.machine.turning_machine import TurningMachine
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import drawn_limits, stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.surface_error import surface_location_error
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.virtual.limit import true_limit
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.workflows.tool_change import BEYOND, ToolChange, map_of, surface_of
from tests.fixtures.turning_spindle import tooling, turning_machine, with_tool

RPM = np.pi / 30.0
#: Where the cross terms move the zero-order limit by 2 to 5 %.
SPEEDS = RPM * np.array([9000.0, 14_000.0, 20_000.0])
DOWN = Engagement(0.5 * np.pi, np.pi)
ALUMINIUM = CuttingCoefficients(902e6, 0.26)
CUT = CutSpec(DOWN, feed_per_tooth=1e-4, coefficients={"tangential": ALUMINIUM.tangential, "radial_ratio": ALUMINIUM.radial_ratio})


def change(method=None, speeds=SPEEDS, machine: TurningMachine | None = None) -> ToolChange:
    return ToolChange(turning_machine() if machine is None else machine, tooling(), CUT, speeds, 5e-3, method or ZeroOrder(), 0)


@pytest.fixture(scope="module")
def truth():
    """The smallest depth at which a disturbance of the full finite-element machine's cut does not die away, at each speed."""
    small, cutter = reduced(with_tool()), tooling().cutter
    cuts = [CuttingConditions(speed, 1e-3, 1e-4, DOWN) for speed in SPEEDS]
    return np.array([true_limit(poles(small, c.spindle_speed), cutter, c, ALUMINIUM, (2e-4, 2e-3)).depth for c in cuts])


@pytest.mark.parametrize("method", [FullDiscretisation(), SemiDiscretisation(), MultiFrequency()], ids=lambda m: m.name)
def test_the_virtual_machines_own_limit(truth, method):
    np.testing.assert_allclose(change(method).limits().nominal, truth, rtol=2e-3)


def test_zero_order_takes_the_cross_terms(truth):
    """It leaves out the teeth's harmonics, and is as near as they allow; against the wrong sense of rotation it tells."""
    found = change().limits().nominal
    np.testing.assert_allclose(found, truth, rtol=0.06)
    machine = turning_machine()
    moments = replace(machine.modes, gyroscopic=-machine.modes.gyroscopic)
    assert np.max(np.abs(change(machine=replace(machine, modes=moments)).limits().nominal / found - 1.0)) > 0.01


def test_speeds_of_a_block_share_a_tip_that_is_near_enough():
    """Blocks of 2.5 %: some 1e-4 of the limit, on a lobe's flank some more."""
    speeds = RPM * np.linspace(12_000.0, 13_200.0, 31)
    machine, process = turning_machine(), change().process
    own = [stability_lobes(machine.at(s).tip(tooling(), machine.lines(), spread=False), process, [s], 5e-3).limit_depth[0] for s in speeds]
    error = np.abs(change(speeds=speeds).limits().nominal / own - 1.0)
    assert np.median(error) < 3e-4
    assert np.max(error) < 2e-3


def test_maps_and_surfaces_feel_it(truth):
    """The map's edge is the limit; the surface of a stable cut is that of this speed's tip."""
    asked = change(FullDiscretisation(), SPEEDS[:1])
    found = map_of(replace(asked, max_depth=1.5 * truth[0]), depths=60)
    assert found.crossing_depth[0] == pytest.approx(truth[0], rel=3e-3)
    tip = asked.machine.at(SPEEDS[0]).tip(tooling(), asked.machine.lines(BEYOND), spread=False)
    expected = surface_location_error(tip, asked.process, SPEEDS[:1], 0.5 * truth[0])
    np.testing.assert_allclose(surface_of(asked, 0.5 * truth[0]).error, expected.error, rtol=1e-9)
    straight = np.where(np.eye(2), tip.values, 0.0)
    other = surface_location_error(Receptance(tip.omega, straight, tip.rows, tip.cols), asked.process, SPEEDS[:1], 0.5 * truth[0])
    assert np.max(np.abs(other.error - expected.error)) > 0.01 * np.max(np.abs(expected.error))


@dataclass(frozen=True, eq=False, repr=False)
class Doubted(TurningMachine):
    """A turning machine with a spread: each shape may be some shares larger or smaller."""

    @property
    def parts(self) -> tuple[FlangePart, ...]:
        def doubt() -> Doubt:
            rng, steps = np.random.default_rng(7), []
            for _ in range(6):
                change = 0.01 * self.modes.psi * rng.normal(size=self.modes.psi.shape)
                ahead, behind = (replace(self.modes, psi=self.modes.psi + sign * change) for sign in (1.0, -1.0))
                steps.append(Perturbation(JointedFlange(ahead, self.joint), JointedFlange(behind, self.joint), 0.5))
            return Doubt(steps)

        return (FlangePart(FLANGE, JointedFlange(self.modes, self.joint), doubt),)


@pytest.mark.slow
def test_bands_over_speed():
    """All blocks draw at the same frequencies; each one's own ones tell the same, at the anchors but for the interpolation."""
    own = turning_machine()
    machine = Doubted(own.modes, own.known, own.speeds, own.joint)
    speeds = RPM * np.linspace(9000.0, 20_000.0, 45)
    found = replace(change(speeds=speeds, machine=machine), draws=8).limits()
    assert found.drawn.shape == (8, 45)
    for k in (0, 17, 44):
        block = speeds[np.abs(np.log(speeds / speeds[k])) < BLOCK]
        near = {}
        for speed in (block.min(), block.max()):
            tip = machine.at(float(speed)).tip(tooling(), machine.lines())
            near[speed] = drawn_limits(tip, change().process, speeds[k : k + 1], 5e-3, 8)[:, 0]
        low, high = (np.min(list(near.values()), axis=0), np.max(list(near.values()), axis=0))
        size = np.std(found.drawn[:, k])
        assert size > 0.002 * found.nominal[k]
        assert np.all(found.drawn[:, k] > low - 0.1 * size)
        assert np.all(found.drawn[:, k] < high + 0.1 * size)
