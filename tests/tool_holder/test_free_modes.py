"""Free modes against closed forms, the full solution and poles by another route."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.tool_holder.free_modes import Motion, bare, bending_modes, denser, rod_modes
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_structure
from tests.tool_holder.test_taper import slender

STEEL = MATERIALS["steel"]


def test_a_thin_rod_bends_as_euler_and_bernoulli_say():
    length, diameter = 0.4, 0.002
    rod = bare((BeamSegment(length, diameter, STEEL),))
    speed = np.sqrt(STEEL.youngs_modulus / STEEL.density) * diameter / 4.0
    exact = np.array([4.730041, 7.853205, 10.995608]) ** 2 * speed / length**2
    found = [mode.omega for mode in bending_modes(rod, 3, 2000.0)]
    np.testing.assert_allclose(found, exact, rtol=1e-3)
    # hysteretic damping: half the loss factor
    np.testing.assert_allclose([mode.damping for mode in bending_modes(rod, 3, 2000.0)], 0.5 * STEEL.loss_factor, rtol=1e-3)


def test_damped_modes_are_those_of_all_freedoms():
    """The full quadratic eigenproblem, undone by nothing."""
    body = slender()
    structure = tool_holder_structure(body, 12e3)
    size, inverse = structure.mass.shape[0], np.linalg.inv(structure.mass)
    state = np.zeros((2 * size, 2 * size), dtype=complex)
    state[:size, size:] = np.eye(size)
    state[size:, :size] = -inverse @ (structure.stiffness + 1j * structure.structural_damping)
    state[size:, size:] = -inverse @ structure.damping
    exact = np.linalg.eigvals(state)
    exact = exact[exact.imag > 1e3]
    exact = exact[np.argsort(np.abs(exact))][:2]
    found = bending_modes(body, 2, 12e3)
    np.testing.assert_allclose([mode.omega for mode in found], np.abs(exact), rtol=1e-6)
    np.testing.assert_allclose([mode.damping for mode in found], -exact.real / np.abs(exact), rtol=1e-5)


@pytest.mark.parametrize("motion", [Motion.AXIAL, Motion.TORSION])
def test_rods_of_two_pieces(motion):
    """Free-free steps of a rod: k1 tan(k1 l) + k2 tan(k2 l) = 0 with the rigidities; of one section sin(k L) = 0."""
    modulus = STEEL.youngs_modulus if motion is Motion.AXIAL else STEEL.shear_modulus
    speed = np.sqrt(modulus / STEEL.density)
    whole = ToolAssembly((BeamSegment(0.1, 0.02, STEEL),), (BeamSegment(0.15, 0.02, STEEL),), insertion=0.0)
    found = [mode.omega for mode in rod_modes(whole, motion, 40e3)][:3]
    np.testing.assert_allclose(found, np.pi * speed / 0.25 * np.arange(1, 4), rtol=5e-4)
    stepped = ToolAssembly((BeamSegment(0.1, 0.01, STEEL),), (BeamSegment(0.15, 0.03, STEEL),), insertion=0.0)
    omega = np.array([mode.omega for mode in rod_modes(stepped, motion, 40e3)][:3])
    power = 2 if motion is Motion.AXIAL else 4
    balance = 0.01**power * np.tan(omega / speed * 0.1) + 0.03**power * np.tan(omega / speed * 0.15)
    slope = 0.01**power * 0.1 / np.cos(omega / speed * 0.1) ** 2 + 0.03**power * 0.15 / np.cos(omega / speed * 0.15) ** 2
    # the root of the exact equation is so far away, as a share
    np.testing.assert_allclose(balance / slope * speed / omega, 0.0, atol=1e-3)


def test_denser_tools_ring_lower():
    tool = (BeamSegment(0.1, 0.012, MATERIALS["carbide"]),)
    light, heavy = (bending_modes(bare(each), 1, 10e3)[0].omega for each in (tool, denser(tool, 0.04)))
    assert heavy / light == pytest.approx(np.exp(-0.02), rel=1e-6)
