"""The tooltip of a tooling on an identified machine: at a speed, with bands of the posterior and of the holder."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.parameters import AxisLayout, flange_modes, joint_of, pack, simple_axis
from rcsa_ident.identification.posterior import MachineAxis, Posterior, spread
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.tool_holder.geometry import stiffened
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.workflows.tip import STIFFNESS_SPREAD, tooltip

OMEGA = 2.0 * np.pi * np.linspace(500.0, 4000.0, 60)
AXES = (Dof.X, Dof.Y)
SPEEDS = (1500.0, 600.0)
LOGS = np.log([2e9, 5e6, 1e4, 10.0])


@pytest.fixture
def assembly(tooling_file):
    return read_tooling(tooling_file).assembly


def posterior_of(shift, softening):
    natural = 2.0 * np.pi * shift * np.array([900.0, 2000.0])
    damping = np.diag(2.0 * np.array([0.05, 0.04]) * natural)
    axis = simple_axis(natural, np.array([[0.15, 0.1], [0.2, -0.3]]), np.linalg.cholesky(damping), np.diag([2e-5, 3e-5]))
    layout = AxisLayout(2, softening=softening)
    changes = np.array([[-0.04, 0.01], [0.01, -0.06]])
    theta = np.concatenate([pack(replace(axis, softening=changes), layout), LOGS])
    root = 2e-3 * np.random.default_rng(1).standard_normal((theta.size, theta.size))
    return Posterior(theta, root @ root.T / theta.size, layout, SPEEDS)


def machine_of(softening=True):
    found = {}
    for axis, shift in zip(AXES, (1.0, 0.95), strict=True):
        posterior = posterior_of(shift, softening)
        modes, joint = posterior.machine(axis)
        found[axis] = MachineAxis(Spindle(modes), joint, posterior)
    return found


def by_hand(posterior, axis, assembly, x):
    """Coupled without the workflow: one plane for both axes, the vector's machine at relative speed x."""
    plane = tool_holder_receptance(assembly, OMEGA, axis)
    natural = np.exp(posterior.theta[:2])
    physics = simple_axis(natural, posterior.theta[2:6].reshape(2, 2), np.zeros((2, 2)), np.diag([2e-5, 3e-5]))
    lower = np.zeros((2, 2))
    lower[np.tril_indices(2)] = 30.0 * np.where([True, False, True], np.exp(posterior.theta[6:9]), posterior.theta[6:9])
    change = np.zeros((2, 2))
    if posterior.layout.softening:
        change[np.tril_indices(2)] = posterior.theta[12:15]
        change.T[np.tril_indices(2)] = posterior.theta[12:15]
    stiffness = np.outer(natural, natural) * (np.eye(2) + x * change)
    squares, turn = np.linalg.eigh(stiffness)
    turned = replace(physics, omega_n=np.sqrt(squares), psi=turn.T @ physics.psi, factor=turn.T @ lower)
    return couple(plane, flange_modes(turned, axis).receptance(OMEGA), joint_of(LOGS))["tip", "tip"][:, 0, 0]


@pytest.mark.parametrize(("speed", "x"), [(None, 0.0), (1500.0, 0.0), (2100.0, 1.0), (1200.0, -0.5), (9000.0, 1.0)])
def test_tooltip_at_a_speed(assembly, speed, x):
    machine = machine_of()
    found = tooltip(machine, assembly, OMEGA, bands=False, speed=speed)
    assert not found.spread
    for axis in AXES:
        expected = by_hand(machine[axis].posterior, axis, assembly, x)
        assert np.abs(found.tip(axis) - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_machine_that_does_not_change_is_the_same_at_any_speed(assembly):
    one, other = (tooltip(machine_of(False), assembly, OMEGA, speed=speed) for speed in (None, 2100.0))
    for axis in AXES:
        np.testing.assert_array_equal(one.tip(axis), other.tip(axis))
        np.testing.assert_array_equal(one.spread[axis], other.spread[axis])


def test_bands_are_those_of_the_posterior_at_that_speed(assembly):
    machine = machine_of()
    found = tooltip(machine, assembly, OMEGA, speed=2100.0)
    for axis in AXES:
        plane = tool_holder_receptance(assembly, OMEGA, axis)

        def tip(modes, joint, plane=plane):
            return couple(plane, modes.receptance(OMEGA), joint)["tip", "tip"][:, 0, 0]

        expected = spread(machine[axis].posterior, axis, tip, 2100.0)
        np.testing.assert_allclose(found.spread[axis][:-1], expected, rtol=1e-9, atol=1e-20)
        real, imaginary = found.deviation[axis]
        total = np.sum(np.abs(found.spread[axis]) ** 2, axis=0)
        np.testing.assert_allclose(real**2 + imaginary**2, total, rtol=1e-12)


@pytest.mark.parametrize("speed", [None, 2000.0])
@pytest.mark.parametrize("contact", [True, False])
def test_the_last_row_is_the_holders_stiffness(assembly, speed, contact):
    machine = machine_of()
    assembly = assembly if contact else replace(assembly, contact=None)
    known = tooltip(machine, assembly, OMEGA, speed=speed, stiffness_spread=0.0)
    found = tooltip(machine, assembly, OMEGA, speed=speed)
    for axis in AXES:
        np.testing.assert_array_equal(found.spread[axis][:-1], known.spread[axis])
        ahead, behind = (
            tooltip(machine, stiffened(assembly, s), OMEGA, bands=False, speed=speed).tip(axis)
            for s in (STIFFNESS_SPREAD, -STIFFNESS_SPREAD)
        )
        slope = 0.5 * (ahead - behind)
        assert np.linalg.norm(found.spread[axis][-1] - slope) < 0.03 * np.linalg.norm(slope)


def test_modes_without_a_posterior_have_no_bands(assembly):
    machine = {axis: MachineAxis(part.spindle, part.joint) for axis, part in machine_of().items()}
    found = tooltip(machine, assembly, OMEGA, speed=2100.0)
    assert not found.spread
    assert not found.deviation
    for axis in AXES:
        expected = tooltip(machine_of(), assembly, OMEGA, bands=False).tip(axis)
        np.testing.assert_allclose(found.tip(axis), expected, rtol=1e-12)
