import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.parameters import (
    DAMPING_UNIT,
    axis_size,
    chain,
    joint_of,
    modes_of,
    pack,
    scaled_joint,
    selected,
    split,
    unpack,
    without_mode,
)


@st.composite
def vectors(draw):
    """Any machine that the priors do not find absurd, and many that they do."""
    m = draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    part = rng.standard_normal(axis_size(m)) * draw(st.sampled_from([0.1, 1.0, 2.0]))
    part[:m] = np.log(2.0 * np.pi * rng.uniform(50.0, 6000.0, m))
    return m, part


def receptance(axis, omega):
    """Straight from the equations of motion."""
    lever = np.array([1.0, 1.0 / LEVER])
    psi, damping = axis.psi * lever, axis.factor @ axis.factor.T
    residual = axis.residual @ axis.residual.T * np.outer(lever, lever)
    stiffness = np.diag(axis.stiffness)
    return np.array([psi.T @ np.linalg.solve(stiffness - w**2 * np.eye(axis.order) + 1j * w * damping, psi) + residual for w in omega])


@settings(max_examples=60, deadline=None)
@given(vectors())
def test_vector_and_physics_belong_together(drawn):
    m, part = drawn
    axis = unpack(part, m)
    np.testing.assert_allclose(pack(axis), part, rtol=1e-12, atol=1e-12)
    assert axis.order == m
    assert np.all(np.diag(axis.factor) > 0.0)
    assert np.all(np.triu(axis.factor, 1) == 0.0)


@settings(max_examples=60, deadline=None)
@given(vectors())
def test_every_vector_is_a_passive_reciprocal_machine(drawn):
    m, part = drawn
    axis = unpack(part, m)
    omega = 2.0 * np.pi * np.geomspace(1.0, 20000.0, 150)
    values = modes_of(axis, Dof.X).receptance(omega).values
    assert dissipation(omega, values).min() > -1e-9
    np.testing.assert_allclose(values, np.swapaxes(values, 1, 2), rtol=1e-12)
    expected = receptance(axis, omega)
    assert np.abs(values - expected).max() < 1e-6 * np.abs(expected).max()


def test_overdamped_modes_are_real_poles():
    part = np.zeros(axis_size(2))
    part[:2] = np.log(2.0 * np.pi * np.array([300.0, 900.0]))
    part[2:6] = [1.0, 0.3, -0.5, 1.0]
    part[6:9] = np.log(100.0), 20.0, np.log(90.0)  # damping ratios above 1
    axis = unpack(part, 2)
    modes = modes_of(axis, Dof.Y)
    omega = 2.0 * np.pi * np.linspace(10.0, 3000.0, 50)
    np.testing.assert_allclose(modes.receptance(omega).values, receptance(axis, omega), rtol=1e-7)
    assert np.sum(modes.zeta == 1.0) >= 2
    assert dissipation(omega, modes.receptance(omega).values).min() > -1e-9


def test_chain_is_the_derivative():
    rng = np.random.default_rng(2)
    m = 3
    part = rng.standard_normal(axis_size(m))
    part[:m] += 8.0

    def physics(vector):
        axis = unpack(vector, m)
        lower = axis.factor[np.tril_indices(m)]
        return np.concatenate([axis.stiffness, axis.psi.ravel(), lower, axis.residual[np.tril_indices(2)]])

    for k in range(part.size):
        step = np.zeros(part.size)
        step[k] = 1e-6
        change = (physics(part + step) - physics(part - step)) / 2e-6
        expected = np.zeros(part.size)
        expected[k] = chain(unpack(part, m))[k]
        np.testing.assert_allclose(change, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


@settings(max_examples=40, deadline=None)
@given(vectors().filter(lambda v: v[0] > 1), st.integers(0, 100))
def test_without_mode_keeps_the_others(drawn, which):
    m, part = drawn
    axis = unpack(part, m)
    kept = np.arange(m) != which % m
    left = without_mode(axis, which % m)
    np.testing.assert_array_equal(left.stiffness, axis.stiffness[kept])
    np.testing.assert_array_equal(left.psi, axis.psi[kept])
    damping = (axis.factor @ axis.factor.T)[np.ix_(kept, kept)]
    np.testing.assert_allclose(left.factor @ left.factor.T, damping, rtol=1e-9, atol=1e-12 * damping.max())
    np.testing.assert_allclose(unpack(pack(left), m - 1).factor, left.factor, rtol=1e-12, atol=1e-12 * np.abs(left.factor).max())


def test_without_mode_of_hardly_any_damping():
    # the damping's product has long lost these to rounding: its Cholesky factor does not exist
    part = np.zeros(axis_size(3))
    part[:3] = np.log(2.0 * np.pi * np.array([300.0, 900.0, 2000.0]))
    part[9:15] = [-30.0, 2.0, -40.0, 2.0, 0.0, -50.0]
    left = without_mode(unpack(part, 3), 0)
    assert np.all(np.isfinite(pack(left)))
    np.testing.assert_allclose(left.factor @ left.factor.T, DAMPING_UNIT**2 * np.array([[4.0, 4.0], [4.0, 4.0]]), rtol=1e-6)


def test_selected_in_another_order_is_the_same_machine():
    rng = np.random.default_rng(3)
    part = rng.standard_normal(axis_size(4))
    part[:4] = np.log(2.0 * np.pi * np.array([900.0, 300.0, 2500.0, 1800.0]))
    axis = unpack(part, 4)
    omega = 2.0 * np.pi * np.linspace(100.0, 4000.0, 30)
    turned = selected(axis, np.array([1, 0, 3, 2]))
    np.testing.assert_allclose(receptance(turned, omega), receptance(axis, omega), rtol=1e-9)
    assert np.all(np.diff(turned.stiffness) > 0.0)


def test_split_and_joint():
    orders = (2, 3)
    theta = np.arange(axis_size(2) + axis_size(3) + 4, dtype=float)
    (x, y), joint = split(theta, orders)
    assert (x.size, y.size, joint.size) == (axis_size(2), axis_size(3), 4)
    np.testing.assert_array_equal(np.concatenate([x, y, joint]), theta)
    logs = np.log([1e9, 2e6, 300.0, 4.0])
    found = joint_of(logs)
    assert found.translational_stiffness == pytest.approx(1e9)
    assert found.rotational_stiffness == pytest.approx(2e6)
    assert found.translational_damping == pytest.approx(300.0)
    assert found.rotational_damping == pytest.approx(4.0)
    np.testing.assert_allclose(scaled_joint(logs), [1e9, 2e6 / LEVER**2, 300.0, 4.0 / LEVER**2])
