"""Gyroscopic moments of a free tool-holder: the full equations of both planes, a rigid body, and the virtual machine's own rotor."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.tool_holder.geometry import BeamSegment, Material, ToolAssembly
from rcsa_ident.tool_holder.model import free_body, tool_holder_receptance
from rcsa_ident.tool_holder.turning import TurningToolHolder, both_planes, turning_pair
from rcsa_ident.virtual.machine import Bearing, FlangeJoint, Housing, VirtualSpindle
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.tool_holder.test_model import ASSEMBLIES, STEEL

FASTEST = 2.0 * np.pi * 20000.0 / 60.0
BAND = 2.0 * np.pi * np.linspace(40.0, 5000.0, 30)
#: tip, slope, flange, slope of the X plane, then of the Y plane: each plane's own
PLANES = (slice(0, 4), slice(4, 8))


def naive(assembly: ToolAssembly, omega: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Both planes' full equations with the moments written down between them, one dense solution per frequency, shape (n, 8, 8)."""
    body = free_body(assembly, float(omega[-1]) / (2.0 * np.pi))
    one, none = body.structure, np.zeros_like(body.rotary)
    index = np.concatenate([one.index, one.index + len(none)])
    found = np.empty((omega.size, 8, 8), dtype=complex)
    for i, (w, turning) in enumerate(zip(omega, speed, strict=True)):
        plane = one.stiffness + 1j * one.structural_damping + 1j * w * one.damping - w**2 * one.mass
        moment = 1j * w * turning * 2.0 * body.rotary
        found[i] = np.linalg.inv(np.block([[plane, -moment], [moment, plane]]))[np.ix_(index, index)]
    return found


def farthest(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest deviation of an entry, against the geometric mean of its coordinates' own motions, in either plane."""
    size = np.abs(np.einsum("nii->ni", expected))
    if size.shape[1] == 8:
        size = np.maximum(size, np.tile(np.abs(np.einsum("nii->ni", expected[:, PLANES[0], PLANES[1]])), 2))
    size = np.sqrt(size)
    return float(np.max(np.abs(found - expected) / size[:, :, None] / size[:, None, :]))


@pytest.mark.parametrize("name", list(ASSEMBLIES))
@pytest.mark.parametrize("per_line", [False, True])
def test_full_equations(name, per_line):
    # a spindle's speed at all frequencies, or its tooth-passing lines: frequency over speed is a whole number there
    speed = BAND / np.maximum(4, np.ceil(BAND / FASTEST)) if per_line else np.full(BAND.size, FASTEST)
    pair = turning_pair(ASSEMBLIES[name], BAND, speed / BAND)
    expected = naive(ASSEMBLIES[name], BAND, speed)
    assert farthest(both_planes(*pair), expected) < 1e-6
    assert np.abs(expected[:, PLANES[0], PLANES[1]]).max() > 0.0
    for each in pair:
        np.testing.assert_allclose(each, each.transpose(0, 2, 1), rtol=1e-9)


@pytest.mark.parametrize("teeth", [1, 2])
def test_first_lines_of_few_teeth(teeth):
    """Spindle speed over frequency the same at all of them: the rotary inertia is doubled or trebled, gone or negative."""
    found = turning_pair(ASSEMBLIES["contact"], BAND, 1.0 / teeth)
    assert farthest(both_planes(*found), naive(ASSEMBLIES["contact"], BAND, BAND / teeth)) < 1e-7


@pytest.mark.parametrize("speed", [3.0, 300.0, FASTEST])
def test_poles_of_a_speed_and_solutions_agree(speed):
    holder = TurningToolHolder.of(ASSEMBLIES["contact"], BAND[-1], FASTEST)
    omega = np.linspace(BAND[0], BAND[-1], 450)
    fast = holder.pair(omega, speed / omega)
    slow = [np.concatenate(parts) for parts in zip(*(holder.pair(part, speed / part) for part in (omega[:225], omega[225:])), strict=True)]
    for a, b in zip(fast, slow, strict=True):
        assert farthest(a, b) < 1e-7


def test_standstill_is_what_does_not_turn():
    expected = tool_holder_receptance(ASSEMBLIES["contact"], BAND).values
    for each in turning_pair(ASSEMBLIES["contact"], BAND, 0.0):
        assert np.array_equal(each, expected)
    for each in turning_pair(ASSEMBLIES["contact"], BAND, 1e-9):
        assert farthest(each, expected) < 1e-6


def test_the_other_sense_of_rotation():
    ratio = FASTEST / BAND
    one, other = (turning_pair(ASSEMBLIES["stepped"], BAND, sign * ratio) for sign in (1.0, -1.0))
    assert farthest(one[0], other[1]) < 1e-9
    # turning the other way is looking from force to motion instead of from motion to force
    assert farthest(both_planes(*one).transpose(0, 2, 1), both_planes(*other)) < 1e-9


def test_moments_take_no_energy():
    values = both_planes(*turning_pair(ASSEMBLIES["contact"], BAND, FASTEST / BAND))
    assert np.min(dissipation(BAND, values)) > -1e-9


def test_rigid_disc():
    """A body that does not bend: mass, and about its middle m R^2 / 4 + m L^2 / 12 and twice m R^2 / 4 of the spin."""
    length, radius, density = 0.03, 0.12, 7850.0
    disc = ToolAssembly((BeamSegment(length, 2.0 * radius, Material(205e15, density, 0.3)),), (), 0.0)
    mass = density * np.pi * radius**2 * length
    rotary = mass * radius**2 / 4.0
    arms = np.array([[1.0, -length / 2.0], [0.0, 1.0], [1.0, length / 2.0], [0.0, 1.0]])
    ratio = 0.2
    for sign, found in zip((1.0, -1.0), turning_pair(disc, BAND, ratio), strict=True):
        inertia = np.diag([mass, rotary * (1.0 + 2.0 * sign * ratio) + mass * length**2 / 12.0])
        expected = -(arms @ np.linalg.inv(inertia) @ arms.T) / BAND[:, None, None] ** 2
        assert farthest(found, expected) < 1e-6


def test_a_free_disc_wobbles():
    """Torque-free precession at W I_p / I_t, in the sense of the spin: A- has its pole there, A+ has none."""
    length, radius, speed = 0.03, 0.12, 1000.0
    disc = ToolAssembly((BeamSegment(length, 2.0 * radius, Material(205e15, 7850.0, 0.3)),), (), 0.0)
    wobble = speed * 0.5 * radius**2 / (radius**2 / 4.0 + length**2 / 12.0)
    omega = wobble * np.array([1.0 - 1e-5, 1.0 + 1e-5])
    forward, backward = turning_pair(disc, omega, speed / omega)
    assert backward[0, 1, 1].real * backward[1, 1, 1].real < 0.0
    assert np.abs(backward[:, 1, 1]).min() > 1e4 * np.abs(forward[:, 1, 1]).max()


@pytest.mark.parametrize("speed", [FASTEST, 0.4 * FASTEST])
def test_virtual_rotor(speed):
    """The virtual machine's own assembly and sense of rotation, its tool-holder hanging on a joint that hardly holds it."""
    housing = Housing(0.1, 10.0, 0.1, (1e8, 1e8), (10.0, 10.0), (1e6, 1e6), (1.0, 1.0))
    bearings = tuple(Bearing(z, (1e8, 1e8), (100.0, 100.0)) for z in (0.02, 0.18))
    spindle = VirtualSpindle((BeamSegment(0.2, 0.07, STEEL),), bearings, housing, FlangeJoint(1e-3, 0.0, 1e-6, 0.0), gyroscopic=True)
    assembly = ASSEMBLIES["stepped"]
    truth = frequency_response(rotor(spindle, assembly, 3), BAND, speed, outputs=("tip.x", "tip.y"))
    found = both_planes(*(each[:, :1, :1] for each in turning_pair(assembly, BAND, speed / BAND)))
    assert np.linalg.norm(found[:, 0, 1]) > 0.01 * np.linalg.norm(found[:, 0, 0])
    for row in range(2):
        for column in range(2):
            difference = np.linalg.norm(found[:, row, column] - truth[:, row, column])
            assert difference < 1e-3 * np.linalg.norm(truth[:, row, column])
    still = dataclasses.replace(spindle, gyroscopic=False)
    assert np.all(frequency_response(rotor(still, assembly), BAND[:2], speed, outputs=("tip.x",))[:, 0, 1] == 0.0)


@pytest.mark.parametrize(("omega", "ratio", "named"), [([0.0, 1.0], 0.1, "omega"), ([1.0, 2.0], [0.1], "ratio"), ([1.0], np.nan, "ratio")])
def test_what_cannot_be_is_named(omega, ratio, named):
    with pytest.raises(InputError, match=named):
        turning_pair(ASSEMBLIES["butt"], omega, ratio)
