"""Contact calibration on taps of the exact beam solution (transfer matrices, no mesh), free and on the virtual machine."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.machine.measured import MeasuredFlange
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.contact import NAMES, Support, TapTest, calibrate_contact, tap_model
from tests.oracles import analytic

pytestmark = pytest.mark.slow

MACHINES = Path(__file__).resolve().parents[2] / "data" / "machines"
C, S = MATERIALS["carbide"], MATERIALS["steel"]
TRUE = Contact(1.2e10, 1.5e6, 6e4, 25.0)
TRUE_LOGS = np.log([getattr(TRUE, name) for name in NAMES])
OMEGA = 2.0 * np.pi * np.arange(200.0, 6000.0, 20.0)
INSERTION = 0.04


def assembly(stickout, modulus=1.0):
    carbide = replace(C, youngs_modulus=C.youngs_modulus * modulus)
    steel = replace(S, youngs_modulus=S.youngs_modulus * modulus)
    tool = (BeamSegment(0.026, 0.0096, carbide), BeamSegment(stickout + INSERTION - 0.026, 0.012, carbide))
    holder = (BeamSegment(0.04, 0.05, steel, 0.012), BeamSegment(0.032, 0.05, steel, 0.014), BeamSegment(0.026, 0.063, steel, 0.02))
    return ToolAssembly(tool, holder, INSERTION)


def beam(segment):
    m = segment.material
    return analytic.Beam(segment.length, segment.diameter, segment.inner_diameter, m.youngs_modulus, m.density, m.poisson, m.loss_factor)


@cache
def exact(stickout, modulus=1.0):
    """Tip receptance of the free assembly by transfer matrices."""
    a = assembly(stickout, modulus)
    contact = tuple(getattr(TRUE, name) for name in NAMES)
    return analytic.assembly_receptance([beam(s) for s in a.tool], [beam(s) for s in a.holder], INSERTION, contact, OMEGA)[:, 0, 0]


def tap(stickout, rng, noise=0.02, gain=0.02, modulus=1.0, values=None, **options):
    """Noise that grows with the receptance and a floor, and a scale that is a little off."""
    h = exact(stickout, modulus) if values is None else values
    white = [rng.normal(size=h.size) + 1j * rng.normal(size=h.size) for _ in range(2)]
    seen = h * (1.0 + gain * rng.normal()) + noise * (np.abs(h) * white[0] + 0.3 * np.median(np.abs(h)) * white[1])
    return TapTest(f"{1e3 * stickout:g} mm", assembly(stickout), OMEGA, seen, **options)


def logs(found):
    return np.log([getattr(found.contact, name) for name in NAMES])


@cache
def three(seed):
    """Found from taps at three stickouts."""
    rng = np.random.default_rng(seed)
    return calibrate_contact([tap(s, rng) for s in (0.05, 0.07, 0.09)])


@pytest.mark.witness
def test_three_stickouts_give_the_contact():
    """Stiffnesses to a percent, dampings to a few; deviations of the size that the covariance says; every parameter told."""
    z = []
    for seed in range(2):
        found = three(seed)
        off = logs(found) - TRUE_LOGS
        assert np.all(np.abs(off[:2]) < 0.012)
        assert np.all(np.abs(off[2:]) < 0.08)
        assert all(found.told)
        assert not found.notes
        assert found.modulus == pytest.approx(1.0, abs=0.004)
        z.append(off / found.log_std)
    assert np.sqrt(np.mean(np.square(z))) < 2.0
    assert np.max(np.abs(z)) < 4.5


def test_one_stickout_parts_less():
    one = calibrate_contact([tap(0.05, np.random.default_rng(1))])
    assert np.all(one.log_std > 3.0 * three(1).log_std)
    assert any("determined only together" in note for note in one.notes)


def test_what_a_low_band_cannot_tell():
    """Up to 1500 Hz a short tool moves as a rigid body with its holder: said, and the prior keeps it."""
    rng = np.random.default_rng(2)
    prior = Contact(2e10, 6e5, 1e5, 40.0)
    found = calibrate_contact([tap(0.05, rng, band=(0.0, 2.0 * np.pi * 1500.0))], prior)
    assert not all(found.told)
    assert any("hardly determined" in note for note in found.notes)
    for name, told, std in zip(NAMES, found.told, found.log_std, strict=True):
        if not told:
            assert abs(np.log(getattr(found.contact, name) / getattr(prior, name))) < 2.5 * np.log(10.0)
            assert std > 0.5
    # whatever is called told is where the truth is
    off = np.abs(logs(found) - TRUE_LOGS)
    assert np.all(off < 4.0 * found.log_std)


def test_a_wrong_modulus_goes_into_its_nuisance():
    """Taps of an assembly that is 2 % stiffer than its drawing: without the nuisance the contact takes it."""
    rng = np.random.default_rng(3)
    taps = [tap(s, rng, modulus=1.02) for s in (0.05, 0.07, 0.09)]
    found, rigid = calibrate_contact(taps), calibrate_contact(taps, modulus_spread=0.0)
    assert found.modulus == pytest.approx(1.02, abs=0.004)
    assert np.all(np.abs(logs(found) - TRUE_LOGS)[:2] < 0.02)
    assert np.abs(logs(rigid) - TRUE_LOGS)[:2].max() > 0.03
    assert rigid.modulus == 1.0


def test_gains_are_found():
    rng = np.random.default_rng(4)
    taps = [tap(0.07, rng, gain=0.0, values=1.04 * exact(0.07)), tap(0.09, rng, gain=0.0)]
    found = calibrate_contact(taps, gain_spread=0.05)
    assert found.gain["70 mm"] == pytest.approx(1.04, abs=0.004)
    assert found.gain["90 mm"] == pytest.approx(1.0, abs=0.004)


def test_a_wrong_geometry_shows():
    """A bore's root 30 % too thick in the drawing: the misfit says so."""
    rng = np.random.default_rng(5)
    wrong = tap(0.07, rng)
    holder = wrong.assembly.holder
    thick = replace(wrong.assembly, holder=(replace(holder[0], diameter=0.07), *holder[1:]))
    found = calibrate_contact([replace(wrong, assembly=thick)])
    assert found.model_error > 0.05
    assert found.notes


def test_clamped_in_a_machine():
    """Taps on the virtual machine (its own assembly of the whole rotor), the flange known as measured; contact from its file."""
    spindle = read_machine(MACHINES / "stiff.toml").spindle
    ports = ("flange.y", "flange.y'")
    omega = 2.0 * np.pi * np.arange(300.0, 5000.0, 15.0)
    b = frequency_response(rotor(spindle, None), omega, 0.0, inputs=ports, outputs=ports)
    flange = MeasuredFlange(Receptance(omega, b, plane("flange", Dof.Y), plane("flange", Dof.Y)))
    j = spindle.joint
    joint = LumpedJoint(j.translational_stiffness, j.rotational_stiffness, j.translational_damping, j.rotational_damping)
    rng = np.random.default_rng(6)
    taps = []
    for stickout in (0.05, 0.08):
        own = replace(assembly(stickout), contact=TRUE)
        h = frequency_response(rotor(spindle, own), omega, 0.0, inputs=("tip.y",), outputs=("tip.y",))[:, 0, 0]
        h = h + 0.01 * np.abs(h) * (rng.normal(size=h.size) + 1j * rng.normal(size=h.size))
        taps.append(TapTest(f"{stickout}", assembly(stickout), omega, h, Support(flange, joint)))
    found = calibrate_contact(taps)
    off = np.abs(logs(found) - TRUE_LOGS)
    assert np.all(off[:2] < 0.03)
    assert np.all(off[2:] < 0.25)
    assert all(found.told)


def test_a_tap_at_the_flange_and_across():
    """Rows and columns other than the tip: reciprocal, and they take part."""
    own = assembly(0.07)
    h = exact(0.07)
    cross = TapTest("a", own, OMEGA, h, row="flange", col="tip")
    back = TapTest("b", own, OMEGA, h, row="tip", col="flange")
    np.testing.assert_allclose(tap_model(cross, TRUE), tap_model(back, TRUE), rtol=1e-6)
    np.testing.assert_allclose(tap_model(TapTest("c", own, OMEGA, h), TRUE), h, rtol=0.02)


def test_what_is_refused():
    with pytest.raises(InputError, match="at least one tap"):
        calibrate_contact([])
    own = assembly(0.07)
    with pytest.raises(InputError, match="frequencies above 0"):
        TapTest("a", own, OMEGA[::-1], exact(0.07))
    with pytest.raises(InputError, match="receptance above 0"):
        TapTest("a", own, OMEGA, 0.0 * exact(0.07))
    with pytest.raises(InputError, match="eight at least"):
        TapTest("a", own, OMEGA, exact(0.07), band=(0.0, OMEGA[3]))
    with pytest.raises(InputError, match="without one there is no contact"):
        TapTest("a", ToolAssembly(own.tool, own.holder, 0.0), OMEGA, exact(0.07))
