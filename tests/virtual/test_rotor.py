import dataclasses

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.tool_holder.geometry import BeamSegment, Material, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.virtual.machine import Bearing, FlangeJoint, Housing, VirtualSpindle
from rcsa_ident.virtual.rotor import frequency_response, housing_points, rotor

BAND = 2.0 * np.pi * np.arange(600.0, 4000.0, 20.0)


def distance(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["S1-ER32", "S2-PG25", "S3-PG25-long", "S4-shrink"])
def test_halving_the_mesh_changes_little(hpm, machines_folder, name):
    assembly = read_tooling(machines_folder / "toolings" / f"{name}.toml").assembly
    coarse, fine = (frequency_response(rotor(hpm.spindle, assembly, r), BAND) for r in (1, 2))
    for row, col in ((0, 0), (1, 1), (2, 0), (3, 1)):
        assert distance(coarse[:, row, col], fine[:, row, col]) < 2e-3


@pytest.mark.slow
def test_error_falls_with_the_mesh(hpm, tooling):
    values = [frequency_response(rotor(hpm.spindle, tooling.assembly, r), BAND[::8], outputs=("tip.x",)) for r in (1, 2, 4)]
    assert distance(values[0], values[2]) > 3.0 * distance(values[1], values[2])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["S1-ER32", "S4-shrink"])
def test_agrees_with_receptance_coupling(hpm, machines_folder, name):
    # the other road: free tool-holder, spindle's flange, joint, each in its own model
    assembly = read_tooling(machines_folder / "toolings" / f"{name}.toml").assembly
    whole = frequency_response(rotor(hpm.spindle, assembly), BAND, outputs=("tip.x", "flange.x"), inputs=("tip.x",))
    ports = ("flange.x", "flange.x'")
    flange = frequency_response(rotor(hpm.spindle, None), BAND, inputs=ports, outputs=ports)
    joint = LumpedJoint(**dataclasses.asdict(hpm.spindle.joint))
    joined = couple(tool_holder_receptance(assembly, BAND), Receptance(BAND, flange, plane("flange"), plane("flange")), joint)
    assert distance(joined.between("tip.x", "tip.x"), whole[:, 0, 0]) < 3e-3
    assert distance(joined.between("spindle.x", "tip.x"), whole[:, 1, 0]) < 3e-3


@pytest.mark.slow
@pytest.mark.parametrize(("behind", "close"), [(0.03, 0.03), (0.015, 0.015), (-0.01, 0.01), (-0.02, 0.02)])
def test_what_is_seen_beside_the_flange_is_nearly_its_motion_and_slope(hpm, machines_folder, behind, close):
    # what bends and shears on the way is left; it halves with the distance
    for name in ("S1-ER32", "S4-shrink"):
        assembly, below = read_tooling(machines_folder / "toolings" / f"{name}.toml").assembly, BAND[::2][:60]
        model = rotor(dataclasses.replace(hpm.spindle, seen_at=behind), assembly)
        seen, flange = frequency_response(model, below, outputs=("seen.x", "flange.x"), inputs=("tip.x",))[:, :, 0].T
        ports = ("flange.x", "flange.x'")
        alone = frequency_response(rotor(hpm.spindle, None), below, inputs=ports, outputs=ports)
        joint = LumpedJoint(**dataclasses.asdict(hpm.spindle.joint))
        bare = Receptance(below, alone, plane("flange"), plane("flange"))
        joined = couple(tool_holder_receptance(assembly, below), bare, joint, {Dof.X: behind})
        assert distance(joined.between("spindle.x", "tip.x"), seen) < close
        assert distance(flange, seen) > 5.0 * close


def test_what_is_seen_at_the_holder_does_not_jump_from_node_to_node(hpm, tooling):
    places = (-0.0201, -0.02, -0.0199)
    spindles = [dataclasses.replace(hpm.spindle, seen_at=z) for z in places]
    a, b, c = (frequency_response(rotor(s, tooling.assembly), BAND[:3], outputs=("seen.x",), inputs=("tip.x",))[:, 0, 0] for s in spindles)
    np.testing.assert_allclose(b, 0.5 * (a + c), rtol=1e-9)
    assert np.all(np.abs(a - b) > 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("behind", [0.03, -0.02])
def test_what_is_seen_changes_little_with_the_mesh(hpm, tooling, behind):
    spindle = dataclasses.replace(hpm.spindle, seen_at=behind)
    coarse, fine = (frequency_response(rotor(spindle, tooling.assembly, r), BAND, outputs=("seen.x",)) for r in (1, 2))
    assert distance(coarse, fine) < 2e-3


def test_is_reciprocal_and_its_planes_apart(model):
    omega = BAND[::20]
    names = ("tip.x", "tip.y", "flange.x", "flange.y")
    values = frequency_response(model, omega, inputs=names, outputs=names)
    assert np.allclose(values, values.transpose(0, 2, 1), rtol=0, atol=1e-9 * np.abs(values).max())
    assert np.all(values[:, [0, 0, 2], [1, 3, 3]] == 0.0)


def test_fixture_moves_with_the_housing(hpm, tooling):
    # moving the fixture along the tilting housing moves its displacement linearly
    places = (0.0, 0.1, 0.19)
    spindles = [dataclasses.replace(hpm.spindle, fixture_position=z) for z in places]
    a, b, c = (frequency_response(rotor(s, tooling.assembly), BAND[:3], outputs=("fixture.x",))[:, 0, 0] for s in spindles)
    assert np.allclose(a + (b - a) * 1.9, c, rtol=1e-9)


def test_further_points_of_the_housing_move_as_the_fixture_would_there(hpm, tooling):
    spindle = dataclasses.replace(hpm.spindle, housing_positions=(0.35, -0.02))
    assert housing_points(spindle) == ("housing1", "housing2")
    names = tuple(f"{point}.{axis}" for point in ("fixture", "housing1", "housing2") for axis in "xy")
    many = frequency_response(rotor(spindle, tooling.assembly), BAND[::20], outputs=names)
    for k, place in enumerate((hpm.spindle.fixture_position, 0.35, -0.02)):
        moved = rotor(dataclasses.replace(hpm.spindle, fixture_position=place), tooling.assembly)
        one = frequency_response(moved, BAND[::20], outputs=("fixture.x", "fixture.y"))
        np.testing.assert_allclose(many[:, 2 * k : 2 * k + 2], one, rtol=1e-12, atol=1e-22)


def disc(gyroscopic: bool) -> VirtualSpindle:
    """A steel disc, 240 mm wide and 30 mm thick, on two springs at its faces, in a housing that does not move."""
    rigid = Material(205e14, 7850.0, 0.3)
    housing = Housing(0.015, 1e9, 1e9, (1e16, 1e16), (0.0, 0.0), (1e16, 1e16), (0.0, 0.0))
    bearings = tuple(Bearing(z, (2e7, 2e7), (20.0, 20.0), 1e-3) for z in (0.0, 0.03))
    return VirtualSpindle((BeamSegment(0.03, 0.24, rigid),), bearings, housing, FlangeJoint(1e9, 0.0, 1e6, 0.0), gyroscopic)


def tilt_response(frequency, speed, gyroscopic=True):
    omega = 2.0 * np.pi * frequency
    return frequency_response(rotor(disc(gyroscopic), None), omega, speed, inputs=("flange.x'",), outputs=("flange.x'", "flange.y'"))


@pytest.mark.slow
def test_disc_whirls_as_the_closed_form_says():
    # I_d r'' -+ I_p Omega r' + k_t r = 0: omega = sqrt((g/2)^2 + k_t / I_d) +- g/2, g = I_p Omega / I_d
    mass = 7850.0 * np.pi / 4.0 * 0.24**2 * 0.03
    diametral = mass * (3.0 * 0.12**2 + 0.03**2) / 12.0
    polar = 0.5 * mass * 0.12**2
    speed = 200.0
    stiffness = 2.0 * 2e7 * (1.0 - 1e-3 * speed) * 0.015**2
    g = polar * speed / diametral
    frequency = np.arange(2.0, 130.0, 0.02)
    response = tilt_response(frequency, speed)
    size = np.abs(response[:, 0, 0])
    peaks = frequency[1:-1][(size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])]
    slow, fast = (np.sqrt(0.25 * g**2 + stiffness / diametral) + sign * 0.5 * g for sign in (-1.0, 1.0))
    assert peaks == pytest.approx([slow / (2.0 * np.pi), fast / (2.0 * np.pi)], rel=2e-3)
    # the fast whirl runs with the spindle, from +Y to +X: x = sin, y = cos, y ahead of x by a quarter
    for peak, sign in ((peaks[0], -1.0), (peaks[1], 1.0)):
        x, y = tilt_response(np.array([peak]), speed)[0, :, 0]
        assert y / x == pytest.approx(sign * 1j, abs=0.15)


def test_softening_lowers_the_stiffness():
    # far below resonance the disc's tilt answers with its spring alone
    still, turning = (tilt_response(np.array([0.01]), speed, gyroscopic=False)[0, 0, 0].real for speed in (0.0, 500.0))
    assert turning / still == pytest.approx(1.0 / (1.0 - 0.5), rel=1e-3)


def test_static_compliance_of_a_cantilever():
    # a steel bar of 20 x 150 mm butted against a spindle that does not move: F L^3 / (3 E I) + F L / (kappa G A)
    steel = Material(205e9, 7850.0, 0.3)
    still = dataclasses.replace(
        disc(False),
        bearings=tuple(Bearing(z, (1e15, 1e15), (0.0, 0.0)) for z in (0.0, 0.03)),
        joint=FlangeJoint(1e14, 0.0, 1e13, 0.0),
    )
    bar = ToolAssembly((BeamSegment(0.15, 0.02, steel),), (), 0.0)
    found = frequency_response(rotor(still, bar), np.array([1e-3]), outputs=("tip.x",))[0, 0, 0].real
    area, inertia, kappa = np.pi * 1e-4, np.pi / 4.0 * 1e-8, 6.0 * 1.3 / (7.0 + 6.0 * 0.3)
    assert found == pytest.approx(0.15**3 / (3.0 * 205e9 * inertia) + 0.15 / (kappa * 205e9 / 2.6 * area), rel=1e-4)


def test_unknown_coordinate_is_named(model):
    with pytest.raises(InputError, match=r"tip\.z"):
        frequency_response(model, BAND[:1], outputs=("tip.z",))


@pytest.mark.parametrize("name", ["hpm", "stiff", "table2"])
def test_example_machines_look_like_machines(machines_folder, name):
    # tooltips of real machines: a few micrometres per newton at worst, three or more peaks, X and Y alike but not equal
    machine = read_machine(machines_folder / f"{name}.toml")
    assembly = read_tooling(machine.toolings[0]).assembly
    values = frequency_response(rotor(machine.spindle, assembly), BAND, machine.plan.spindle_speeds[0])
    x, y = np.abs(values[:, 0, 0]), np.abs(values[:, 1, 1])
    assert 3e-7 < x.max() < 5e-6
    assert 0.02 < distance(x, y) < 0.5
    assert ((x[1:-1] > x[:-2]) & (x[1:-1] > x[2:])).sum() >= 2
