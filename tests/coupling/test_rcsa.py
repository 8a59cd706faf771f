"""Coupling by four roads: the package's, the textbook's, the dual form, and one assembled system."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.assembly import assemble
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import damped_modes
from rcsa_ident.dynamics.receptance import Receptance, dissipation
from rcsa_ident.dynamics.structure import Structure, poles
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_structure

W = 2.0 * np.pi * np.linspace(150.0, 4000.0, 37)
JOINT = LumpedJoint(2e9, 5e6, 2000.0, 10.0)
ENDS_X, ENDS_Y = (*plane("tip", Dof.X), *plane("flange", Dof.X)), (*plane("tip", Dof.Y), *plane("flange", Dof.Y))
FLANGES = (*plane("flange", Dof.X), *plane("flange", Dof.Y))
TOOL = ToolAssembly(
    (BeamSegment(0.07, 0.012, MATERIALS["carbide"]),),
    (BeamSegment(0.05, 0.04, MATERIALS["steel"]), BeamSegment(0.03, 0.06, MATERIALS["steel"], 0.02)),
    0.03,
    Contact(2e10, 6e5, 6e4, 9.0),
)


def spindle_structure(rng, directions):
    """A few masses and inertias held by springs and coupled among themselves; the first ones are the flange."""
    n, extra = len(directions), 3
    slopes = np.array([d.is_slope for d in directions])
    size = np.where(slopes, 0.03, 1.0)
    scale = np.concatenate([size, np.ones(extra)])
    root = rng.normal(size=(n + extra, n + extra))
    stiffness = (root @ root.T + 2.0 * np.eye(n + extra)) * 2e7 * scale[:, None] * scale
    mass = np.diag(np.concatenate([np.where(slopes, 2e-3, 2.0), np.full(extra, 3.0)]))
    damping = 2e-5 * stiffness + 40.0 * mass
    coordinates = tuple(Coordinate("flange", d) for d in directions)
    return Structure(mass, damping, stiffness, 0.002 * stiffness, coordinates, np.arange(n))


def tool_in_both_planes():
    """The tool-holder in X and Y at once, its planes mixed by an off-axis spring between tip and flange: cross terms."""
    x = tool_holder_structure(TOOL, 4000.0)
    d = x.mass.shape[0]
    zero = np.zeros((d, d))
    mass, damping, stiffness, loss = (np.block([[m, zero], [zero, m]]) for m in (x.mass, x.damping, x.stiffness, x.structural_damping))
    tip_x, tip_y, flange_x, flange_y = x.index[0], d + x.index[0], x.index[2], d + x.index[2]
    across = np.zeros(2 * d)
    across[[tip_x, tip_y, flange_x, flange_y]] = [1.0, 0.7, -1.0, -0.7]
    stiffness = stiffness + 3e6 * np.outer(across, across)
    tips = (*ENDS_X[:2], *ENDS_Y[:2])
    index = np.concatenate([x.index[:2], d + x.index[:2], x.index[2:], d + x.index[2:]])
    return Structure(mass, damping, stiffness, loss, (*tips, *FLANGES), index)


def textbook(a, b, stiffness):
    """C11, C13, C31, C33 by elimination of the joint's force f = K (x2 - x3), one frequency."""
    n = b.shape[0]
    tip = slice(0, a.shape[0] - n)
    flange = slice(a.shape[0] - n, None)
    identity = np.eye(n)
    # x2 = A21 F - A22 f, x3 = F3 B + B f, f = K (x2 - x3)
    compliance = np.linalg.inv(identity + stiffness @ (a[flange, flange] + b)) @ stiffness
    from_tip, from_spindle = compliance @ a[flange, tip], -compliance @ b
    return np.block(
        [
            [a[tip, tip] - a[tip, flange] @ from_tip, -a[tip, flange] @ from_spindle],
            [b @ from_tip, b + b @ from_spindle],
        ]
    )


def dual(a, b, stiffness):
    """Y - Y B^T (B Y B^T + Z^-1)^-1 B Y over all coordinates of both, then tip and spindle."""
    n, m = b.shape[0], a.shape[0]
    y = np.block([[a, np.zeros((m, n))], [np.zeros((n, m)), b]])
    gap = np.zeros((n, m + n))
    gap[:, m - n : m], gap[:, m:] = np.eye(n), -np.eye(n)
    coupled = y - y @ gap.T @ np.linalg.solve(gap @ y @ gap.T + np.linalg.inv(stiffness), gap @ y)
    kept = np.r_[0 : m - n, m : m + n]
    return coupled[np.ix_(kept, kept)]


def joint_stiffness(omega, directions):
    return np.diag([5e6 + 10j * omega if d.is_slope else 2e9 + 2000j * omega for d in directions])


@pytest.mark.parametrize("planes", [1, 2])
def test_four_roads(planes):
    """One plane, and X-Y with cross terms on both sides (4 x 4 blocks)."""
    tool = tool_holder_structure(TOOL, 4000.0) if planes == 1 else tool_in_both_planes()
    flange = FLANGES[: 2 * planes]
    directions = tuple(c.dof for c in flange)
    spindle = spindle_structure(np.random.default_rng(7), directions)
    a, b = tool.receptance(W), spindle.receptance(W)
    coupled = couple(a, b, JOINT)
    # entries far below others in a block (cross terms, spindle) carry the rounding of the others
    size = np.sqrt(np.abs(np.einsum("nii->ni", coupled.values)))
    size = size[:, :, None] * size[:, None, :]
    for i, w in enumerate(W):
        stiffness = joint_stiffness(w, directions)
        for road in (textbook, dual):
            assert np.max(np.abs(road(a.values[i], b.values[i], stiffness) - coupled.values[i]) / size[i]) < 1e-9
    whole = assemble(tool, spindle, JOINT)
    assert whole.coordinates == coupled.rows
    assert np.max(np.abs(whole.receptance(W).values - coupled.values) / size) < 1e-8
    assert np.max(np.abs(coupled.values - np.swapaxes(coupled.values, 1, 2)) / size) < 1e-9
    assert np.min(dissipation(W, coupled.values)) > -1e-9
    if planes == 2:
        assert np.min(np.abs(coupled.between("tip.x", "tip.y")) / np.abs(coupled.between("tip.x", "tip.x"))) > 1e-4


def test_reduced_tool_and_modal_spindle():
    """Poles for A and complex modes for B, against the full equations of both."""
    tool = tool_holder_structure(TOOL, 4000.0)
    omega_n = 2.0 * np.pi * np.array([700.0, 1300.0, 2500.0])
    psi = np.array([[0.3, 3.0], [-0.25, 2.0], [0.2, -4.0]])
    factor = np.array([[20.0, 0, 0], [9.0, 25.0, 0], [-6.0, 8.0, 30.0]])
    modes = Spindle(damped_modes(omega_n, factor @ factor.T, psi, np.zeros((2, 2)), plane("flange")))
    coupled = couple(poles(tool, W.max()).receptance(W), modes.receptance(W), JOINT)
    b = np.array([psi.T @ np.linalg.solve(np.diag(omega_n**2) + 1j * w * factor @ factor.T - w**2 * np.eye(3), psi) for w in W])
    a = tool.receptance(W).values
    for i, w in enumerate(W):
        expected = dual(a[i], b[i], joint_stiffness(w, (Dof.X, Dof.SLOPE_X)))
        size = np.sqrt(np.abs(np.diag(expected)))
        assert np.max(np.abs(coupled.values[i] - expected) / size[:, None] / size) < 1e-6
    assert modes.coordinates == plane("flange")


def test_a_rigid_joint_adds_the_dynamic_stiffnesses():
    tool = tool_holder_structure(TOOL, 4000.0).receptance(W)
    spindle = spindle_structure(np.random.default_rng(8), (Dof.X, Dof.SLOPE_X)).receptance(W)
    coupled = couple(tool, spindle, LumpedJoint(1e18, 1e18))
    for i in range(W.size):
        total = np.linalg.inv(tool.values[i])
        total[2:, 2:] += np.linalg.inv(spindle.values[i])
        expected = np.linalg.inv(total)
        size = np.sqrt(np.abs(np.diag(expected)))
        assert np.max(np.abs(coupled.values[i] - expected) / size[:, None] / size) < 1e-6


def test_a_loose_joint_leaves_both_alone():
    tool = tool_holder_structure(TOOL, 4000.0).receptance(W)
    spindle = spindle_structure(np.random.default_rng(8), (Dof.X, Dof.SLOPE_X)).receptance(W)
    coupled = couple(tool, spindle, LumpedJoint(1e-3, 1e-6))
    np.testing.assert_allclose(coupled["tip", "tip"], tool["tip", "tip"], rtol=1e-6)
    np.testing.assert_allclose(coupled["spindle", "spindle"], spindle["flange", "flange"], rtol=1e-6)
    assert np.max(np.abs(coupled["spindle", "tip"] / tool["flange", "tip"])) < 1e-6


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    stiffness=st.floats(5.0, 13.0),
    turning=st.floats(3.0, 10.0),
    damping=st.floats(0.0, 1e5),
    turning_damping=st.floats(0.0, 1e3),
)
def test_coupling_keeps_reciprocity_and_passivity(seed, stiffness, turning, damping, turning_damping):
    tool = tool_holder_structure(TOOL, 4000.0).receptance(W[::6])
    spindle = spindle_structure(np.random.default_rng(seed), (Dof.X, Dof.SLOPE_X)).receptance(W[::6])
    coupled = couple(tool, spindle, LumpedJoint(10**stiffness, 10**turning, damping, turning_damping)).values
    size = np.sqrt(np.abs(np.einsum("nii->ni", coupled)))
    assert np.max(np.abs(coupled - np.swapaxes(coupled, 1, 2)) / size[:, :, None] / size[:, None, :]) < 1e-8
    assert np.min(dissipation(W[::6], coupled)) > -1e-8


def test_joint():
    directions = (Dof.X, Dof.SLOPE_X, Dof.Y, Dof.SLOPE_Y)
    compliance = JOINT.compliance_along(W, directions)
    assert compliance.shape == (W.size, 4)
    for i, w in enumerate(W):
        np.testing.assert_allclose(np.diag(1.0 / compliance[i]), joint_stiffness(w, directions), rtol=1e-12)
    with pytest.raises(InputError, match="translational_stiffness"):
        LumpedJoint(0.0, 1.0)
    with pytest.raises(InputError, match="rotational_damping"):
        LumpedJoint(1.0, 1.0, 0.0, -1.0)


def test_directions_must_match():
    tool = tool_holder_structure(TOOL, 4000.0).receptance(W)
    spindle = spindle_structure(np.random.default_rng(8), (Dof.Y, Dof.SLOPE_Y)).receptance(W)
    with pytest.raises(InputError, match="in that order"):
        couple(tool, spindle, JOINT)
    turned = tuple(reversed(plane("flange")))
    swapped = Receptance(W, spindle.values, turned, turned)
    with pytest.raises(InputError, match="in that order"):
        couple(tool, swapped, JOINT)
    with pytest.raises(InputError, match="frequencies"):
        couple(tool, spindle_structure(np.random.default_rng(8), (Dof.X, Dof.SLOPE_X)).receptance(W[:-1]), JOINT)


def test_a_tip_without_its_slope():
    """A tip known in translation only, as a tap test gives it."""
    full = tool_holder_structure(TOOL, 4000.0).receptance(W)
    spindle = spindle_structure(np.random.default_rng(8), (Dof.X, Dof.SLOPE_X)).receptance(W)
    kept = [0, 2, 3]
    ends = tuple(ENDS_X[i] for i in kept)
    less = couple(Receptance(W, full.values[:, kept][:, :, kept], ends, ends), spindle, JOINT)
    more = couple(full, spindle, JOINT)
    np.testing.assert_allclose(less.between("tip.x", "tip.x"), more.between("tip.x", "tip.x"), rtol=1e-10)
    np.testing.assert_allclose(less["spindle", "tip"][:, :, 0], more["spindle", "tip"][:, :, 0], rtol=1e-10)


def test_down_to_zero_frequency():
    """A floats, C does not: what cancels in C11 = A11 - A12 Z A21 grows with 1 / w^2 and must not matter."""
    omega = 2.0 * np.pi * np.array([0.0, 0.1, 1.0, 10.0, 4000.0])
    tool = tool_holder_structure(TOOL, 4000.0)
    spindle = spindle_structure(np.random.default_rng(7), (Dof.X, Dof.SLOPE_X))
    coupled = couple(poles(tool, omega.max()).receptance(omega), spindle.receptance(omega), JOINT).values
    expected = assemble(tool, spindle, JOINT).receptance(omega).values
    np.testing.assert_allclose(coupled[1:], expected[1:], rtol=1e-5)
    np.testing.assert_allclose(coupled[0], expected[0], rtol=1e-2)
