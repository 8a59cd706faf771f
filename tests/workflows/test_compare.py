"""Idle against in process on a virtual machine whose bearings soften with speed: the difference is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.compare import LocalMode, Place, compare, frac, local_modes, matched
from tests.workflows.in_process import BAND, MACHINES, RPM, modal_machine, softening_spindle

OMEGA = 2.0 * np.pi * np.arange(300.0, 3800.0, 4.0)
SPEED = 15000.0 * RPM
PORTS = {Place.TIP: ("tip", "tip"), Place.CROSS: ("flange", "tip"), Place.SPINDLE: ("flange", "flange"), Place.FLANGE: ("flange", "flange")}
ENDS = ("flange.x", "flange.y", "tip.x", "tip.y")


@cache
def assembly():
    return read_tooling(MACHINES / "toolings" / "S1-ER32.toml").assembly


@cache
def responses(bare, speed):
    """Of the whole virtual machine at a speed, by its full equations: from all ends to all ends."""
    ends = ENDS[:2] if bare else ENDS
    return frequency_response(rotor(softening_spindle(), None if bare else assembly()), OMEGA, speed, inputs=ends, outputs=ends)


def measured(place, axis, speed):
    """One receptance of them."""
    row, col = (ENDS.index(f"{end}.{axis}") for end in PORTS[place])
    return responses(place is Place.FLANGE, speed)[:, row, col]


@pytest.mark.slow
@pytest.mark.parametrize("axis", [Dof.X, Dof.Y])
def test_in_process_is_in_process(axis):
    """At the speed of the identification all four responses agree with the machine: the comparison itself adds nothing."""
    tests = {(place, axis): (OMEGA, measured(place, axis, SPEED)) for place in Place}
    for each in compare(modal_machine(softening_spindle(), SPEED), tests, assembly()):
        assert each.error < 0.02, each.place
        assert each.frac > 0.999
        for hammer, identified in each.modes:
            assert identified is not None
            assert identified.frequency == pytest.approx(hammer.frequency, rel=2e-3)
            assert identified.compliance == pytest.approx(hammer.compliance, rel=0.03)


@pytest.mark.slow
def test_softening_shows_as_it_is():
    """Idle (speed 0, with noise) against in process: each mode's change is the machine's own, from its full equations at both speeds."""
    rng = np.random.default_rng(1)
    idle, turning = (measured(Place.TIP, Dof.X, s) for s in (0.0, SPEED))
    noisy = idle + 0.01 * np.abs(idle) * (rng.normal(size=idle.size) + 1j * rng.normal(size=idle.size))
    (found,) = compare(modal_machine(softening_spindle(), SPEED), {(Place.TIP, Dof.X): (OMEGA, noisy)}, assembly())
    truth = matched(local_modes(OMEGA, idle), local_modes(OMEGA, turning))
    changes = {round(h.frequency): i.frequency / h.frequency - 1.0 for h, i in truth if i is not None}
    assert len(found.modes) >= 3
    softened = 0
    for hammer, identified in found.modes:
        near = min(changes, key=lambda f: abs(f - hammer.frequency))
        if identified is None or abs(near / hammer.frequency - 1.0) > 0.01:
            continue
        change = identified.frequency / hammer.frequency - 1.0
        assert change == pytest.approx(changes[near], abs=2.5e-3)
        softened += change < -1.5e-3
    assert softened >= 1
    assert found.frac < 0.999
    assert np.min(found.band_frac[1]) < found.frac


@pytest.mark.slow
def test_the_flange_shows_it_more_than_the_tip():
    """The tool is the machine's most compliant part, and it does not soften."""
    machine = modal_machine(softening_spindle(), SPEED)
    tests = {(place, Dof.Y): (OMEGA, measured(place, Dof.Y, 0.0)) for place in (Place.TIP, Place.FLANGE)}
    error = {each.place: each.error for each in compare(machine, tests, assembly())}
    assert error[Place.FLANGE] > error[Place.TIP]


def test_bands_hold(identification):
    """With a posterior every response has one; a flange's is that of its modes."""
    machine = replace(identification.machine, identified_band=BAND)
    h = machine.identified[Dof.X].spindle.receptance(OMEGA).values[:, 0, 0]
    (found,) = compare(machine, {(Place.FLANGE, Dof.X): (OMEGA, 1.1 * h)})
    assert found.deviation is not None
    assert np.all(found.deviation[0] >= 0.0)
    assert found.frac == pytest.approx(1.0)
    assert found.error == pytest.approx(0.1 / 1.1, rel=1e-3)
    (bare,) = compare(machine, {(Place.FLANGE, Dof.X): (OMEGA, h)}, bands=False)
    assert bare.deviation is None


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(
    first=st.floats(500.0, 1200.0),
    gap=st.floats(1.6, 2.2),
    zeta=st.tuples(st.floats(0.01, 0.06), st.floats(0.01, 0.06)),
)
def test_local_modes_find_two_modes(first, gap, zeta):
    """Frequencies to half a permille, damping to two percent, whatever stands beside them."""
    natural = 2.0 * np.pi * np.array([first, first * gap])
    psi = np.array([[0.3, 1.0], [0.35, 1.0]])
    h = normal_modes(natural, np.array(zeta), psi, plane("flange")).receptance(OMEGA).values[:, 0, 0]
    found = local_modes(OMEGA, h)
    assert len(found) == 2
    for mode, w, z in zip(found, natural, zeta, strict=True):
        assert mode.frequency == pytest.approx(w, rel=5e-4)
        assert mode.damping == pytest.approx(z, rel=0.02)
        assert mode.compliance == pytest.approx(np.abs(h[np.argmin(np.abs(OMEGA - w))]), rel=0.05)


def test_noise_makes_no_modes():
    rng = np.random.default_rng(2)
    h = normal_modes(2.0 * np.pi * np.array([1000.0]), np.array([0.03]), np.array([[0.3, 1.0]]), plane("flange")).receptance(OMEGA)
    values = h.values[:, 0, 0] * (1.0 + 0.01 * (rng.normal(size=OMEGA.size) + 1j * rng.normal(size=OMEGA.size)))
    assert [round(m.frequency / 2.0 / np.pi, -1) for m in local_modes(OMEGA, values)] == [1000.0]


def test_matching():
    """The highest peak chooses first; too far away is nobody."""
    one = [LocalMode(1000.0, 0.01, 5.0), LocalMode(1050.0, 0.01, 1.0), LocalMode(3000.0, 0.01, 1.0)]
    other = [LocalMode(1040.0, 0.01, 1.0)]
    assert [(a.frequency, None if b is None else b.frequency) for a, b in matched(one, other)] == [
        (1000.0, 1040.0),
        (1050.0, None),
        (3000.0, None),
    ]


@given(scale=st.complex_numbers(min_magnitude=1e-3, max_magnitude=1e3), seed=st.integers(0, 1000))
def test_frac_sees_shapes_only(scale, seed):
    rng = np.random.default_rng(seed)
    a, b = (rng.normal(size=20) + 1j * rng.normal(size=20) for _ in range(2))
    assert frac(a, scale * a) == pytest.approx(1.0)
    assert 0.0 <= frac(a, b) <= 1.0 + 1e-12
    assert frac(a, b) == pytest.approx(frac(scale * b, a))


@pytest.mark.slow
def test_what_is_refused():
    whole = modal_machine(softening_spindle(), SPEED)
    machine = replace(whole, flanges=whole.flanges[:1])
    h = measured(Place.TIP, Dof.X, 0.0)
    with pytest.raises(InputError, match="an identified axis"):
        compare(machine, {(Place.TIP, Dof.Y): (OMEGA, h)}, assembly())
    with pytest.raises(InputError, match="the tooling that was clamped"):
        compare(machine, {(Place.TIP, Dof.X): (OMEGA, h)})
    with pytest.raises(InputError, match="eight at least"):
        compare(replace(machine, known=(0.0, OMEGA[4])), {(Place.TIP, Dof.X): (OMEGA, h)}, assembly())
