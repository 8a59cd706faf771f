"""Poles and residues against closed forms, there and back through state space and python-control."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.modal import damped_modes, normal_modes
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.state_space import StateSpace
from tests.dynamics.test_state_space import OSCILLATOR, random_system, sampled

#: A pair, and a real pole with half its residue.
POLE = np.array([-20.0 + 300.0j, -150.0])
SYSTEM = PoleResidue(POLE, np.array([[1.0 - 2.0j, 3.0], [0.5j, 1.0]]), np.array([[1.0 + 1.0j], [2.0]]), np.array([[0.1], [0.0]]))
OMEGA = np.linspace(0.0, 600.0, 40)


def test_response_is_the_sum():
    s = 1j * OMEGA
    pair = (1.0 - 2.0j) * (1.0 + 1.0j)
    expected = pair / (s - POLE[0]) + np.conj(pair) / (s - np.conj(POLE[0])) + 12.0 / (s + 150.0) + 0.1
    np.testing.assert_allclose(SYSTEM.response(OMEGA)[:, 0, 0], expected, rtol=1e-12)


def test_projected_and_joined():
    left, right = np.array([[1.0, 2.0]]), np.array([[0.5, -1.0, 3.0]])
    np.testing.assert_allclose(SYSTEM.projected(left, right).response(OMEGA), left @ SYSTEM.response(OMEGA) @ right, rtol=1e-12)
    twice = PoleResidue.joined([SYSTEM, SYSTEM])
    np.testing.assert_allclose(twice.response(OMEGA), 2.0 * SYSTEM.response(OMEGA), rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 8))
def test_through_state_space_in_modal_form(seed, order):
    system = random_system(seed, order)
    found = PoleResidue.from_state_space(system)
    modal = found.state_space()
    omega = np.linspace(0.0, 10.0, 7)
    np.testing.assert_allclose(found.response(omega), system.response(omega), rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(modal.response(omega), system.response(omega), rtol=1e-7, atol=1e-7)
    assert modal.order == order
    # blocks of one and two states
    outside = np.abs(np.subtract.outer(np.arange(order), np.arange(order))) > 1
    np.testing.assert_array_equal(modal.A[outside], 0.0)
    assert np.sum(np.triu(modal.A, 1) != 0.0) == np.sum(system.pole.imag > 0.0)


def test_a_mode_that_does_not_swing_needs_one_state():
    """Overdamped modes of a structure have shapes that are real or imaginary."""
    shapes = np.array([[1.0, 0.2], [0.4, -1.0]])
    modes = damped_modes(np.array([100.0, 500.0]), np.diag([400.0, 50.0]), shapes, np.zeros((2, 2)), plane("flange"))
    assert np.sum(modes.pole.imag == 0.0) == 2
    system = modes.pole_residue().state_space()
    assert system.order == 4
    np.testing.assert_allclose(system.response(OMEGA), modes.receptance(OMEGA).values, rtol=1e-9)
    # a residue that is neither: one more
    skewed = PoleResidue(np.array([-5.0]), np.array([[1.0], [1.0j]]), np.array([[1.0, 1.0j]]), np.zeros((2, 2)))
    assert skewed.state_space().order == 2
    np.testing.assert_allclose(skewed.state_space().response(OMEGA), skewed.response(OMEGA), rtol=1e-12, atol=1e-15)


def test_python_control_there_and_back():
    there = SYSTEM.to_control(["force"], ["tip.x", "tip.y"])
    assert there.output_labels == ["tip_x", "tip_y"]
    np.testing.assert_allclose(there(1j * OMEGA).transpose(2, 0, 1), SYSTEM.response(OMEGA), rtol=1e-10)
    back = PoleResidue.from_control(there)
    np.testing.assert_allclose(np.sort_complex(back.pole), np.sort_complex(POLE), rtol=1e-10)
    np.testing.assert_allclose(back.response(OMEGA), SYSTEM.response(OMEGA), rtol=1e-10)


def test_a_loop_that_is_closed_in_python_control():
    """H / (1 + K H), entry by entry: two planes whose modes have the same poles, one of them in the loop."""
    model = normal_modes(np.full(2, 300.0), np.full(2, 0.02), np.eye(2), plane("flange"))
    # 2e4 / (s / 2000 + 1) from the first displacement to the first force
    feedback = control.ss([[-2000.0]], [[1.0, 0.0]], [[4e7], [0.0]], np.zeros((2, 2)))
    closed = PoleResidue.from_control(control.feedback(model.to_control(), feedback))
    h, k = model.receptance(OMEGA).values, 2e4 / (1j * OMEGA / 2000.0 + 1.0)
    expected = h.copy()
    expected[:, 0, 0] = h[:, 0, 0] / (1.0 + k * h[:, 0, 0])
    np.testing.assert_allclose(closed.response(OMEGA), expected, rtol=1e-8, atol=1e-15)


@pytest.mark.slow
def test_a_measured_receptance_goes_to_python_control():
    omega = 2.0 * np.pi * np.arange(100.0, 3000.0, 4.0)
    model = normal_modes(
        2.0 * np.pi * np.array([400.0, 1100.0]), np.array([0.03, 0.04]), np.array([[0.2, 1.0], [0.3, -2.0]]), plane("flange")
    )
    measured = model.receptance(omega)
    system = measured.to_control()
    assert system.input_labels == system.output_labels == [str(c).replace(".", "_") for c in plane("flange")]
    assert system.nstates == 4
    np.testing.assert_allclose(system(1j * omega).transpose(2, 0, 1), measured.values, rtol=1e-6)
    # planes that do not couple keep their own poles
    apart = measured.values * np.eye(2)
    system = Receptance(omega, apart, measured.rows, measured.cols).to_control()
    assert np.max(np.abs(system(1j * omega)[0, 1])) == 0.0
    np.testing.assert_allclose(system(1j * omega)[0, 0], apart[:, 0, 0], rtol=1e-4)
    noise = np.random.default_rng(1).normal(size=(2, *apart.shape)) * np.abs(apart).max()
    with pytest.raises(InputError, match="60 poles"):
        Receptance(omega[:120], (noise[0] + 1j * noise[1])[:120], measured.rows, measured.cols).to_control()
    with pytest.raises(InputError, match="where the forces act"):
        Receptance(omega, measured.values[:, :1], measured.rows[:1], measured.cols).to_control()


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: PoleResidue(POLE, SYSTEM.outputs[:, :1], SYSTEM.inputs, SYSTEM.constant), "outputs"),
        (lambda: PoleResidue(POLE, SYSTEM.outputs, np.full((2, 1), np.nan), SYSTEM.constant), "inputs"),
        (lambda: PoleResidue(POLE, SYSTEM.outputs, SYSTEM.inputs, np.zeros(2)), "constant"),
        (lambda: PoleResidue.from_state_space(sampled(OSCILLATOR, 0.1, "zoh")), "step"),
        (lambda: PoleResidue.from_state_space(StateSpace([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])), "poles"),
    ],
)
def test_bad_input(call, field):
    with pytest.raises(InputError) as error:
        call()
    assert error.value.field == field
