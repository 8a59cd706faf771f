"""The tip in more than two directions: slopes as the coupling's general solution has them, Z from one axial tap of another tooling."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import Block
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.tip_modes import DIRECTIONS, TIP, fitted_modes
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.decouple import axial_flange_from_tap
from rcsa_ident.workflows.tool_change import ToolChange
from tests.fixtures import by_hand
from tests.fixtures.flange_machine import flange_machine
from tests.fixtures.paths import MACHINES
from tests.fixtures.turning_spindle import tooling, turning_machine, with_tool
from tests.machine.planes import BAND, JOINT, oblique
from tests.machine.test_tip import machine_of
from tests.tool_holder.exact_rods import exact

OMEGA = 2.0 * np.pi * np.linspace(300.0, 4000.0, 120)
SLOPES = tuple(c for c in DIRECTIONS if c.dof.is_slope)
NAMES = [str(c) for c in (*TIP, *SLOPES)]
RPM = 2.0 * np.pi / 60.0


@pytest.fixture
def assembly():
    return by_hand.tooling().assembly


def general(machine, assembly):
    """Translations and slopes of the tip by the coupling's general solution."""
    return machine.coupled(assembly, OMEGA).block([Coordinate.parse(name) for name in NAMES])


@pytest.mark.parametrize(
    "machine",
    [machine_of(), FlangeMachine((oblique(),), BAND, JOINT), turning_machine()],
    ids=["planes apart", "planes coupled", "turning"],
)
def test_slopes_are_those_of_the_general_coupling(machine, assembly):
    tip = machine.tip(assembly, OMEGA, directions=DIRECTIONS)
    assert tip.rows == DIRECTIONS
    truth = general(machine, assembly).values
    size = np.sqrt(np.abs(np.einsum("nii->ni", truth)))
    off = (tip.block((*TIP, *SLOPES)).values - truth) / size[:, :, None] / size[:, None, :]
    assert np.max(np.abs(off)) < 1e-9
    # nobody has tapped it along its axis
    assert not np.any(tip.values[:, 2])
    np.testing.assert_allclose(tip.block(TIP).values, machine.tip(assembly, OMEGA).values, rtol=1e-8, atol=1e-18)


def with_slopes(rotor):
    """The virtual machine with the rotation of its tip's node beside its deflection."""
    rows = np.roll(rotor.ports[rotor.port("tip.x", "tip.y")], 1, axis=1)
    return replace(rotor, ports=np.concatenate([rotor.ports, rows]), coordinates=(*rotor.coordinates, *SLOPES))


def test_slopes_of_the_virtual_machine():
    truth = frequency_response(with_slopes(with_tool("S2-PG25")), OMEGA, 14000.0 * RPM, tuple(NAMES), tuple(NAMES))
    found = turning_machine().at(14000.0 * RPM).tip(tooling("S2-PG25"), OMEGA, directions=DIRECTIONS).block((*TIP, *SLOPES)).values
    error = np.linalg.norm(found - truth, axis=0)
    scale = np.sqrt(np.diag(np.linalg.norm(truth, axis=0)))
    assert np.max(error / np.outer(scale, scale)) < 1e-3


def test_the_spread_of_slopes_is_that_of_the_general_coupling(assembly):
    """Along each direction of the posterior; the translations' is what it was."""
    machine = machine_of()
    tip = machine.tip(assembly, OMEGA, stiffness_spread=0.0, directions=DIRECTIONS)
    found, truth = tip.deviation(), machine.coupled(assembly, OMEGA).deviation()
    for name in NAMES:
        row = Coordinate.parse(name)
        np.testing.assert_allclose(found[row, row], truth[row, row], rtol=1e-6, atol=1e-20)
    before = machine.tip(assembly, OMEGA, stiffness_spread=0.0).deviation()
    np.testing.assert_allclose(found[TIP[0], TIP[0]], before[TIP[0], TIP[0]], rtol=1e-6, atol=1e-20)
    assert tip.complete
    draws = tip.drawn(3, np.random.default_rng(1))
    assert draws.shape == (3, OMEGA.size, 5, 5)
    assert np.all(np.std(draws[:, :, 3, 3], axis=0) > 0.0)


@pytest.mark.parametrize("turns", [False, True])
def test_poles_stand_for_all_directions(turns):
    """A machine whose planes feel each other knows its modes without a fit; others are fitted, slopes weighed like translations."""
    machine = turning_machine() if turns else machine_of()
    tip = machine.tip(tooling() if turns else by_hand.tooling().assembly, OMEGA, spread=False, directions=DIRECTIONS)
    modes, error = fitted_modes(tip)
    assert modes.directions == 5
    assert error < 5e-3
    own = [DIRECTIONS.index(c) for c in (*TIP, *SLOPES)]
    truth = tip.values[:, own][:, :, own]
    size = np.sqrt(np.linalg.norm(np.einsum("nii->ni", truth), axis=0))
    off = np.linalg.norm(modes.response(OMEGA)[:, own][:, :, own] - truth, axis=0) / np.outer(size, size)
    assert np.max(off) < 2 * 5e-3


CARBIDE, STEEL = MATERIALS["carbide"], MATERIALS["steel"]
HOLDER = (BeamSegment(0.05, 0.04, STEEL), BeamSegment(0.04, 0.063, STEEL))
FACE = (BeamSegment(0.03, 0.06, STEEL), BeamSegment(0.04, 0.05, STEEL), BeamSegment(0.03, 0.063, STEEL))
BALL = (BeamSegment(0.05, 0.011, CARBIDE), BeamSegment(0.04, 0.012, CARBIDE))
TAP = 2.0 * np.pi * np.arange(100.0, 4000.0, 2.0)


def in_a_row(name, rods, end):
    """Rods end to end, the first `end` of them the tool."""
    return Tooling(name, Cutter(2, 0.012), ToolAssembly(tuple(rods[:end]), tuple(rods[end:]), insertion=0.0))


def axial_spindle(omega):
    """A spindle along its axis: mass on bearings, with a softer mode of the headstock behind."""
    found = 0.0
    for hertz, zeta, stiffness in ((950.0, 0.03, 5e7), (2300.0, 0.05, 2e8)):
        x = omega / (2.0 * np.pi * hertz)
        found = found + 1.0 / (stiffness * (1.0 - x**2 + 2j * zeta * x))
    return found + 4e-10


def axial_tip(rods, omega):
    """The tip along the axis, in closed form."""
    free = exact(rods, omega)
    return free[:, 0, 0] - free[:, 0, 1] * free[:, 1, 0] / (free[:, 1, 1] + axial_spindle(omega))


@pytest.fixture(scope="module")
def tapped():
    """One axial tap of the face mill, with 1 % of noise."""
    values = axial_tip(FACE, TAP)
    rng = np.random.default_rng(3)
    noisy = values * (1.0 + 0.01 / np.sqrt(2.0) * (rng.standard_normal(TAP.size) + 1j * rng.standard_normal(TAP.size)))
    return axial_flange_from_tap(in_a_row("face", FACE, 1), TAP, noisy)


def test_one_axial_tap_serves_all_tools(tapped, assembly):
    found = tapped.receptance(TAP).values[:, 0, 0]
    assert np.linalg.norm(found - axial_spindle(TAP)) < 0.01 * np.linalg.norm(found)
    assert tapped.remarks(tapped.band) == tapped.remarks(None) == ()
    machine = replace(machine_of(), axial=tapped)
    for rods, end in ((FACE, 1), ((*BALL, *HOLDER), 2)):
        tip = machine.tip(in_a_row("a tool", rods, end), TAP, directions=DIRECTIONS)
        truth = axial_tip(rods, TAP)
        error = tip.between("tip.z", "tip.z") - truth
        assert np.linalg.norm(error) < 0.01 * np.linalg.norm(truth)
        assert tip.complete
        # as a lump of its mass the tool would be somewhere else
        lump = 1.0 / (1.0 / axial_spindle(TAP) - sum(rod.mass for rod in rods) * TAP**2)
        assert np.max(np.abs(lump / truth - 1.0)) > 5.0 * np.max(np.abs(error / truth))
    # along the axis nothing of the bending is felt
    assert not np.any(tip.values[:, 2, :2])
    assert machine.tip(assembly, OMEGA).rows == TIP


def test_a_tap_over_less_than_the_machines_band_is_told(tapped):
    low, high = tapped.band
    (told,) = tapped.remarks((low, 1.3 * high))
    assert told.startswith(
        f"along the axis it was tapped from {low / (2 * np.pi):.0f} to {high / (2 * np.pi):.0f} Hz, the machine is known from"
    )
    machine = machine_of()
    shorter = replace(tapped, band=(machine.band[0], 0.5 * machine.band[1]))
    assert any("along the axis it was tapped" in text for text in replace(machine, axial=shorter).remarks)
    wider = replace(tapped, band=machine.band)
    assert not any("it was tapped" in text for text in replace(machine, axial=wider).remarks)


@cache
def face_mill():
    """A face mill of 100 mm on an arbor."""
    cutter = Cutter(7, 0.1, profile=Profile.face(0.1, np.deg2rad(45.0), 0.03))
    arbor = (BeamSegment(0.045, 0.09, STEEL), BeamSegment(0.06, 0.045, STEEL), BeamSegment(0.026, 0.063, STEEL))
    return Tooling("face mill", cutter, ToolAssembly(arbor[:1], arbor[1:], insertion=0.0))


@pytest.mark.slow
def test_limits_of_a_face_mill_take_the_slopes_of_the_chain():
    """Slopes raise them; the true machine's receptances, solved with all its freedoms, give the same."""
    spindle = read_machine(MACHINES / "hpm.toml").spindle
    omega = 2.0 * np.pi * np.arange(200.0, 4001.0, 4.0)
    cut = CutSpec(Block(-0.03, 0.04), coefficients={"tangential": 2e9, "radial_ratio": 0.3, "axial_ratio": 0.1})
    speeds = np.array([900.0, 1400.0]) * RPM
    change = ToolChange(flange_machine(), face_mill(), cut, speeds, 0.02, FullDiscretisation(), draws=0)
    found = change.limits().limit_depth
    rotor_ = with_slopes(rotor(spindle, face_mill().assembly, 2))
    values = frequency_response(rotor_, omega, 1000.0, tuple(NAMES), tuple(NAMES))
    named = tuple(Coordinate.parse(name) for name in NAMES)
    truth = stability_lobes(Receptance(omega, values, named, named), change.process, speeds, 0.02, FullDiscretisation()).limit_depth
    np.testing.assert_allclose(found, truth, rtol=0.02)
    flat = stability_lobes(Receptance(omega, values, named, named).block(TIP), change.process, speeds, 0.02, FullDiscretisation())
    assert np.all(found > 1.1 * flat.limit_depth)


@pytest.mark.slow
def test_a_tap_of_another_tooling_or_sign_is_named():
    wrong = axial_flange_from_tap(in_a_row("ball", (*BALL, *HOLDER), 2), TAP, axial_tip(FACE, TAP))
    turned = axial_flange_from_tap(in_a_row("face", FACE, 1), TAP, -axial_tip(FACE, TAP))
    assert "would feed energy in" in turned.remarks(None)[0]
    assert np.linalg.norm(wrong.receptance(TAP).values[:, 0, 0] - axial_spindle(TAP)) > 0.1 * np.linalg.norm(axial_spindle(TAP))
