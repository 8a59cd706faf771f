"""Tool-holder and machine as one set of poles: beside the receptance that coupling gives, frequency by frequency."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.machine.flange_part import JointedFlange
from rcsa_ident.machine.mode_synthesis import FLANGE, poles_of, synthesised_poles
from rcsa_ident.machine.turning_machine import TurningMachine
from rcsa_ident.stability.tip_modes import NEAR_ENOUGH, fitted_modes
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.turning import turning_tool_holder
from tests.fixtures.turning_spindle import joint, tooling, turning_machine

OMEGA = 2.0 * np.pi * np.linspace(150.0, 7000.0, 700)
SPEED = 2000.0
RESIDUAL = np.diag([3e-10, 4e-8, 2e-10, 3e-8]) + 1e-10 * np.outer([1.0, 3.0, 0.5, 2.0], [1.0, 3.0, 0.5, 2.0])


def few_modes(residual=RESIDUAL) -> TurningModes:
    """As many as an identification finds."""
    rng = np.random.default_rng(3)
    natural, moments = 2.0 * np.pi * np.geomspace(250.0, 5500.0, 14), 0.04 * rng.normal(size=(14, 14))
    lower = np.tril(0.02 * rng.normal(size=(14, 14))) + 0.25 * np.eye(14)
    damping = (lower @ lower.T) * np.sqrt(np.outer(natural, natural))
    psi = rng.normal(size=(14, 4)) * [0.1, 0.8, 0.1, 0.8]
    return TurningModes(natural, damping, moments - moments.T, psi, residual, SPEED, FLANGE)


def lossless(assembly: ToolAssembly) -> ToolAssembly:
    def parts(segments):
        return tuple(replace(s, material=replace(s.material, loss_factor=0.0)) for s in segments)

    return replace(assembly, tool=parts(assembly.tool), holder=parts(assembly.holder))


def machine_of(modes: TurningModes, clamp: LumpedJoint | None) -> TurningMachine:
    return TurningMachine(modes, (1.0, float(OMEGA[-1])), (0.5 * SPEED, 2.0 * SPEED), clamp)


def share(found, expected) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize("name", ["S1-ER32", "S2-PG25", "S3-PG25-long", "S4-shrink"])
@pytest.mark.parametrize("rpm", [8000.0, 20000.0])
def test_virtual_spindle(name, rpm):
    tip = turning_machine(rpm).tip(tooling(name), OMEGA, spread=False)
    poles = tip.poles()
    assert share(poles.response(OMEGA), tip.values) < 2e-3
    assert np.all(poles.pole.real < 0.0)
    modes, error = fitted_modes(tip)
    assert error < 2e-3
    assert modes.pole.size == poles.pole.size < 30
    # left and right shapes differ: turned round they change places
    other = replace(turning_machine(rpm), modes=turning_machine(rpm).modes.at(-turning_machine(rpm).turning))
    turned = fitted_modes(other.tip(tooling(name), OMEGA, spread=False))[0]
    np.testing.assert_allclose(turned.response(OMEGA), modes.response(OMEGA).transpose(0, 2, 1), rtol=1e-5, atol=1e-14)


@pytest.mark.parametrize("residual", [RESIDUAL, np.zeros((4, 4)), np.diag([1e-10, 0.0, 1e-10, 0.0])])
@pytest.mark.parametrize("clamp", [joint(), LumpedJoint(3e9, 6e6)])
def test_without_material_loss_it_is_exact(residual, clamp):
    """But for the poles beyond the band, which stand at rest, and for a damper behind a residual compliance."""
    assembly = lossless(tooling().assembly)
    tip = machine_of(few_modes(residual), clamp).tip(assembly, OMEGA, spread=False)
    assert share(tip.poles().response(OMEGA), tip.values) < 5e-4
    low = 0.5 * OMEGA[-1] > OMEGA
    assert share(tip.poles().response(OMEGA[low]), tip.values[low]) < 1e-4


def test_a_residual_alone_holds_the_tool_holder():
    """Modes that hold the joint's compliance themselves."""
    tip = machine_of(few_modes(), None).tip(lossless(tooling().assembly), OMEGA, spread=False)
    assert share(tip.poles().response(OMEGA), tip.values) < 5e-4


def test_what_holds_rigidly_has_no_spring():
    holder = turning_tool_holder(tooling().assembly, OMEGA[-1], SPEED)
    assert synthesised_poles(holder, few_modes(np.zeros((4, 4))), None, SPEED) is None
    assert synthesised_poles(holder, few_modes(np.diag([1e-10, 0.0, 1e-10, 0.0])), None, SPEED) is None


def test_what_stands_in_no_modes_is_fitted():
    receptance = JointedFlange(turning_machine().modes.receptance(OMEGA), joint())
    assert poles_of(tooling().assembly, receptance, OMEGA[-1], SPEED) is None
    omega = OMEGA[::6]
    tip = machine_of(few_modes(), joint()).tip(tooling(), omega, spread=False)
    fitted, error = fitted_modes(replace(tip, poles=lambda: None))
    assert error < NEAR_ENOUGH
    assert fitted.pole.size > fitted_modes(tip)[0].pole.size


def test_a_softened_machine():
    modes = few_modes()
    change = -0.05 * np.diag(modes.omega_n**2)
    tip = machine_of(replace(modes, stiffness_change=change), joint()).tip(lossless(tooling().assembly), OMEGA, spread=False)
    assert share(tip.poles().response(OMEGA), tip.values) < 5e-4


def test_goes_to_other_processes():
    tip = machine_of(few_modes(), joint()).tip(tooling(), OMEGA, spread=False)
    assert np.array_equal(pickle.loads(pickle.dumps(tip)).poles().pole, tip.poles().pole)


def test_planes_that_feel_each_other_without_turning():
    """An oblique machine: its flange's modes have no moments, and the tool-holder none either."""
    modes = replace(few_modes(), gyroscopic=np.zeros((14, 14)), speed=0.0)
    machine = FlangeMachine((modes,), (1.0, float(OMEGA[-1])), joint())
    tip = machine.tip(tooling(), OMEGA)
    assert machine.turning is None
    assert np.linalg.norm(tip.values[:, 0, 1]) > 0.01 * np.linalg.norm(tip.values[:, 0, 0])
    assert share(tip.poles().response(OMEGA), tip.values) < 2e-3
    np.testing.assert_allclose(tip.values, tip.values.transpose(0, 2, 1), rtol=1e-7)
