"""Structures: small ones in closed form, and the reduction to poles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.dynamics.structure import Structure, natural_frequencies, poles, rigid_body_modes, unit_responses


def coordinates(count):
    return tuple(Coordinate.parse(f"p{i}.x") for i in range(count))


def structure(mass, damping, stiffness, loss=None, index=(0,)):
    mass, damping, stiffness = (np.atleast_2d(np.asarray(m, dtype=float)) for m in (mass, damping, stiffness))
    loss = np.zeros_like(mass) if loss is None else loss
    return Structure(mass, damping, stiffness, loss, coordinates(len(index)), np.array(index))


def chain(springs, dampers, masses, losses=0.0):
    """Masses in a row with a spring and a damper between neighbours, free at both ends."""
    n = len(masses)
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    tie = np.array([[1.0, -1.0], [-1.0, 1.0]])
    for i in range(n - 1):
        stiffness[i : i + 2, i : i + 2] += springs[i] * tie
        damping[i : i + 2, i : i + 2] += dampers[i] * tie
    return Structure(np.diag(masses), damping, stiffness, losses * stiffness, coordinates(2), np.array([0, n - 1]))


W = np.linspace(20.0, 3000.0, 61)


@pytest.mark.slow
def test_one_mass_on_a_spring():
    m, c, k = 2.0, 30.0, 4e5
    one = structure(m, c, k)
    expected = 1.0 / (k + 1j * W * c - W**2 * m)
    np.testing.assert_allclose(one.receptance(W).between("p0.x", "p0.x"), expected, rtol=1e-12)
    np.testing.assert_allclose(poles(one, 3000.0).receptance(W).between("p0.x", "p0.x"), expected, rtol=1e-9)
    assert natural_frequencies(one)[0] == pytest.approx(np.sqrt(k / m))


@pytest.mark.slow
def test_hysteretic_damping_takes_energy_at_positive_frequencies():
    one = structure(2.0, 0.0, 4e5, np.array([[4e3]]))
    expected = 1.0 / (4e5 * (1 + 0.01j) - W**2 * 2.0)
    np.testing.assert_allclose(one.receptance(W).between("p0.x", "p0.x"), expected, rtol=1e-12)
    np.testing.assert_allclose(poles(one, 3000.0).receptance(W).between("p0.x", "p0.x"), expected, rtol=1e-9)
    assert np.all(expected.imag < 0.0)


def test_two_masses_free_in_space():
    m1, m2, k, c = 1.0, 3.0, 5e5, 20.0
    two = chain([k], [c], [m1, m2])
    z = k + 1j * W * c
    # -W^2 m1 m2 + z (m1 + m2) times -W^2
    determinant = -(W**2) * (z * (m1 + m2) - W**2 * m1 * m2)
    expected = np.array([[z - W**2 * m2, z], [z, z - W**2 * m1]]) / determinant
    for way in (two, poles(two, 3000.0)):
        np.testing.assert_allclose(np.moveaxis(way.receptance(W).values, 0, -1), expected, rtol=1e-7)


def test_rigid_body_motions_are_found_and_only_they():
    free = chain([1e6, 3e6, 2e6], [0.0] * 3, [1.0, 2.0, 0.5, 1.5])
    motion = rigid_body_modes(free, 5000.0)
    assert motion.shape == (4, 1)
    np.testing.assert_allclose(motion[:, 0], np.sign(motion[0, 0]) / np.sqrt(5.0), rtol=1e-10)
    held = Structure(
        free.mass, free.damping, free.stiffness + np.diag([1.0, 0, 0, 0]), free.structural_damping, free.coordinates, free.index
    )
    assert rigid_body_modes(held, 5000.0).shape == (4, 0)
    braked = Structure(
        free.mass, free.damping + np.diag([9.0, 0, 0, 0]), free.stiffness, free.structural_damping, free.coordinates, free.index
    )
    assert rigid_body_modes(braked, 5000.0).shape == (4, 0)
    for each in (held, braked):
        full = each.receptance(W).values
        np.testing.assert_allclose(poles(each, 3000.0).receptance(W).values, full, rtol=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    springs=st.lists(st.floats(1e5, 1e8), min_size=3, max_size=20),
    seed=st.integers(0, 10**6),
    loss=st.floats(0.0, 0.05),
    dampers=st.floats(0.0, 300.0),
)
def test_poles_against_the_full_equations(springs, seed, loss, dampers):
    rng = np.random.default_rng(seed)
    n = len(springs) + 1
    body = chain(springs, dampers * rng.uniform(0.0, 1.0, n - 1), rng.uniform(0.2, 2.0, n), loss)
    full = body.receptance(W).values
    fast = poles(body, 3000.0).receptance(W).values
    # an undamped resonance may lie on a line: a rounding error in the pole is all of the answer there
    safe = np.max(np.abs(full), axis=(1, 2)) < 1e3 * np.median(np.abs(full))
    largest = np.max(np.abs(full), axis=(1, 2))[:, None, None]
    assert np.max((np.abs(fast - full) / largest)[safe], initial=0.0) < 1e-6
    assert np.min(dissipation(W[safe], fast[safe]), initial=0.0) > -1e-6


def test_unit_responses_solve_the_equations():
    body = chain([1e6, 3e6, 2e6], [10.0, 200.0, 30.0], [1.0, 2.0, 0.5, 1.5], 0.02)
    for w, x in zip(W[::10], unit_responses(body, W[::10]), strict=True):
        dynamic = body.stiffness + 1j * body.structural_damping + 1j * w * body.damping - w**2 * body.mass
        force = dynamic @ x
        np.testing.assert_allclose(force, np.eye(4)[:, [0, 3]], atol=1e-9)


def test_arrays_are_read_only_and_checked():
    body = chain([1e6], [0.0], [1.0, 1.0])
    with pytest.raises(ValueError, match="read-only"):
        body.mass[0, 0] = 2.0
    with pytest.raises(InputError, match="stiffness"):
        Structure(np.eye(2), np.zeros((2, 2)), np.eye(3), np.zeros((2, 2)), coordinates(1), np.array([0]))
    with pytest.raises(InputError, match="one for each index"):
        Structure(np.eye(2), np.zeros((2, 2)), np.eye(2), np.zeros((2, 2)), coordinates(2), np.array([0]))


def test_coordinates_that_are_combinations_of_freedoms():
    """Their receptances are the same combinations of those of the freedoms themselves, and so are their poles."""
    rng = np.random.default_rng(5)
    root, turn = rng.normal(size=(6, 6)), rng.normal(size=(6, 2))
    stiffness = 1e6 * (root @ root.T + np.eye(6))
    matrices = np.eye(6), 1e-4 * stiffness, stiffness, 0.01 * stiffness
    own = Structure(*matrices, coordinates(6), np.arange(6))
    combined = Structure(*matrices, coordinates(2), shapes=turn)
    omega = np.linspace(100.0, 4000.0, 40)
    expected = turn.T @ own.receptance(omega).values @ turn
    np.testing.assert_allclose(combined.receptance(omega).values, expected, rtol=1e-9)
    np.testing.assert_allclose(poles(combined, 5000.0).receptance(omega).values, expected, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_array_equal(combined.ports, turn)


def test_shapes_that_do_not_fit_are_refused():
    matrices = [np.eye(3)] * 4
    with pytest.raises(InputError, match="shapes"):
        Structure(*matrices, coordinates(2), shapes=np.zeros((2, 3)))
    with pytest.raises(InputError, match="shapes"):
        Structure(*matrices, coordinates(2), np.array([0, 1]), shapes=np.zeros((3, 2)))
