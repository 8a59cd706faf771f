"""Modes of a machine that turns: solved frequency by frequency, in closed form, and beside the virtual machine's own spindle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import damped_modes
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.fixtures.turning_spindle import FLANGE, REFINEMENT, flange_modes, gyroscopic_spindle

OMEGA = 2.0 * np.pi * np.linspace(20.0, 6000.0, 200)
SPEED = 2.0 * np.pi * 20000.0 / 60.0


def modes(m=14, seed=0, speed=SPEED, softening=0.0) -> TurningModes:
    rng = np.random.default_rng(seed)
    natural = 2.0 * np.pi * np.sort(rng.uniform(150.0, 6000.0, m))
    lower = np.tril(rng.normal(size=(m, m))) * np.sqrt(0.01 * natural)
    moments, change = 0.05 * rng.normal(size=(m, m)), softening * rng.normal(size=(m, m)) * np.outer(natural, natural)
    root = np.tril(rng.normal(size=(4, 4))) * np.array([1e-5, 1e-3, 1e-5, 1e-3])[:, None]
    psi = rng.normal(size=(m, 4)) * np.array([0.2, 2.0, 0.2, 2.0])
    return TurningModes(
        natural, lower @ lower.T, moments - moments.T, psi, root @ root.T, speed, FLANGE, change + change.T if softening else None
    )


def naive(m: TurningModes, omega: np.ndarray) -> np.ndarray:
    """One dense solution per frequency, from the definition."""
    stiffness = np.diag(m.omega_n**2) + (0.0 if m.stiffness_change is None else m.stiffness_change)
    unit = np.eye(m.omega_n.size)
    return np.array(
        [m.psi.T @ np.linalg.solve(stiffness - w**2 * unit + 1j * w * (m.damping + m.speed * m.gyroscopic), m.psi) for w in omega]
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("softening", [0.0, 0.01])
@pytest.mark.parametrize("speed", [0.0, 700.0, -SPEED])
def test_definition(seed, softening, speed):
    each = modes(seed=seed, softening=softening, speed=speed)
    expected = naive(each, OMEGA) + each.residual
    size = np.sqrt(np.abs(np.einsum("nii->ni", expected)))
    assert np.max(np.abs(each.receptance(OMEGA).values - expected) / size[:, :, None] / size[:, None, :]) < 1e-9


def test_turned_round_it_is_transposed():
    one, other = (modes().at(sense * SPEED).receptance(OMEGA).values for sense in (1.0, -1.0))
    np.testing.assert_allclose(one.transpose(0, 2, 1), other, rtol=1e-7)
    assert np.max(np.abs(one[:, 0, 2] - one[:, 2, 0])) > 0.05 * np.max(np.abs(one[:, 0, 0]))


@pytest.mark.parametrize("speed", [0.0, SPEED, 3.0 * SPEED])
def test_takes_energy_at_every_speed(speed):
    values = modes(softening=0.01).at(speed).receptance(OMEGA).values
    assert np.min(dissipation(OMEGA, values)) > -1e-9


def test_without_moments_it_is_a_modal_model():
    still = replace(modes(), gyroscopic=np.zeros((14, 14)))
    expected = damped_modes(still.omega_n, still.damping, still.psi, still.residual, FLANGE).receptance(OMEGA).values
    np.testing.assert_allclose(still.receptance(OMEGA).values, expected, rtol=1e-7)


def test_whirl_splits_as_the_closed_form_says():
    """Alike in X and Y: s^2 + (2 zeta w -+ i g W) s + w^2 = 0, the faster whirl from +Y to +X."""
    natural, zeta, g = 6000.0, 0.001, 0.08
    shapes = np.array([[0.2, 1.0, 0.0, 0.0], [0.0, 0.0, 0.2, 1.0]])
    moments = np.array([[0.0, -g], [g, 0.0]])
    each = TurningModes([natural] * 2, 2.0 * zeta * natural * np.eye(2), moments, shapes, np.zeros((4, 4)), SPEED, FLANGE)
    found = each.pole_residue().pole
    circled = [np.roots([1.0, 2.0 * zeta * natural - sense * 1j * g * SPEED, natural**2]) for sense in (1.0, -1.0)]
    upper = np.array([roots[np.argmax(roots.imag)] for roots in circled])
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(upper), rtol=1e-9)
    fast = np.array([np.max(upper.imag)])
    x, y = each.receptance(fast).values[0, [0, 2], 0]
    assert y / x == pytest.approx(1j, abs=0.15)


def test_two_poles_that_become_one():
    one = TurningModes([1000.0], [[2000.0]], [[0.0]], [[1.0, 0.0]], np.zeros((2, 2)), 0.0, plane("flange"))
    np.testing.assert_allclose(one.receptance(OMEGA).values[:, 0, 0], 1.0 / (1000.0 + 1j * OMEGA) ** 2, rtol=1e-4)


@pytest.mark.parametrize("rpm", [8000.0, 14000.0, 20000.0])
def test_virtual_spindle(rpm):
    """The virtual machine's bare spindle, reduced to its modes: its full equations at every frequency."""
    speed, omega = rpm * np.pi / 30.0, OMEGA[::6]
    names = tuple(str(c) for c in FLANGE)
    truth = frequency_response(rotor(gyroscopic_spindle(), None, REFINEMENT), omega, speed, names, names)
    found = flange_modes().at(speed).receptance(omega).values
    for i in range(4):
        for j in range(4):
            assert np.linalg.norm(found[:, i, j] - truth[:, i, j]) < 1e-4 * np.linalg.norm(truth[:, i, j])


def test_poles_stand_for_it_elsewhere():
    each = modes()
    control = each.to_control()
    w = OMEGA[30]
    np.testing.assert_allclose(control(1j * w), each.receptance(np.array([w])).values[0], rtol=1e-6)
    assert "20000 rev/min" in str(each)
    assert "14 modes" in str(each)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"omega_n": np.zeros(14)}, "omega_n"),
        ({"damping": -np.eye(14)}, "damping"),
        ({"damping": np.triu(np.ones((14, 14)))}, "damping"),
        ({"residual": -np.eye(4)}, "residual"),
        ({"gyroscopic": np.eye(14)}, "gyroscopic"),
        ({"psi": np.ones((14, 2))}, "psi"),
        ({"speed": np.nan}, "speed"),
        ({"stiffness_change": -1e12 * np.eye(14)}, "stiffness_change"),
        ({"damping": np.full((14, 14), np.nan)}, "damping"),
    ],
)
def test_what_cannot_be_is_named(changed, named):
    with pytest.raises(InputError, match=named):
        replace(modes(), **changed)


def test_directions_are_the_flanges():
    assert modes().receptance(OMEGA[:2]).rows == (*plane("flange", Dof.X), *plane("flange", Dof.Y))
