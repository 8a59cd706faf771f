from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.modal_parameters import flange_modes
from rcsa_ident.identification.unknowns import (
    DAMPING_UNIT,
    JOINT,
    Layout,
    ModalBlock,
    chain,
    flange_layout,
    joint_of,
    pack,
    parameter_names,
    scaled_joint,
    split,
    unpack,
)


@st.composite
def vectors(draw, softening=None):
    """Any machine that the priors do not find absurd, and many that they do; softening as small as machines have it."""
    layout = ModalBlock(draw(st.integers(1, 6)), draw(st.integers(0, 2)), draw(st.booleans()) if softening is None else softening)
    m = layout.modes
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    part = rng.standard_normal(layout.size) * draw(st.sampled_from([0.1, 1.0, 2.0]))
    part[:m] = np.log(2.0 * np.pi * rng.uniform(50.0, 6000.0, m))
    if layout.softening:
        part[-layout.pairs :] = rng.uniform(-1.0, 1.0, layout.pairs) * 0.3 / m
    return layout, part


def receptance(axis, omega, x=0.0):
    """Straight from the equations of motion at relative speed x: flange translation, flange slope, other places."""
    count = 2 + axis.places.shape[1]
    lever = np.array([1.0, 1.0 / LEVER, *[1.0] * (count - 2)])
    psi, damping = np.column_stack([axis.psi, axis.places]) * lever, axis.factor @ axis.factor.T
    residual = np.zeros((count, count))
    residual[:2, :2] = axis.residual @ axis.residual.T
    residual[2:, :2], residual[:2, 2:] = axis.place_residual, axis.place_residual.T
    residual *= np.outer(lever, lever)
    stiffness = np.diag(axis.omega_n**2)
    if axis.softening.size:
        stiffness = stiffness + x * axis.softening * np.outer(axis.omega_n, axis.omega_n)
    return np.array([psi.T @ np.linalg.solve(stiffness - w**2 * np.eye(axis.order) + 1j * w * damping, psi) + residual for w in omega])


@settings(max_examples=60, deadline=None)
@given(vectors())
def test_vector_and_physics_belong_together(drawn):
    layout, part = drawn
    axis = unpack(part, layout)
    np.testing.assert_allclose(pack(axis, layout), part, rtol=1e-12, atol=1e-12)
    again = unpack(pack(axis, layout), layout)
    for each in fields(axis):
        np.testing.assert_allclose(getattr(again, each.name), getattr(axis, each.name), rtol=1e-12)
    # the flange at the middle speed is a vector of its own: the first entries
    np.testing.assert_allclose(pack(axis), part[: layout.core], rtol=1e-12, atol=1e-12)
    # what is asked for and was not there starts at nothing
    more = replace(layout, places=layout.places + 1, softening=True)
    padded = unpack(pack(replace(axis, softening=np.zeros((0, 0))), more), more)
    np.testing.assert_allclose(padded.places[:, :-1], axis.places, rtol=1e-12)
    assert np.all(padded.places[:, -1] == 0.0)
    assert np.all(padded.place_residual[-1] == 0.0)
    assert np.all(padded.softening == 0.0)
    assert axis.order == layout.modes
    assert np.all(np.diag(axis.factor) > 0.0)
    assert np.all(np.triu(axis.factor, 1) == 0.0)
    np.testing.assert_array_equal(axis.softening, axis.softening.T)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(vectors(), st.floats(-1.0, 1.0))
def test_every_vector_is_a_passive_reciprocal_machine(drawn, x):
    layout, part = drawn
    axis = unpack(part, layout)
    omega = 2.0 * np.pi * np.geomspace(1.0, 20000.0, 150)
    values = flange_modes(axis.at(x), Dof.X).receptance(omega).values
    assert dissipation(omega, values).min() > -1e-9
    np.testing.assert_allclose(values, np.swapaxes(values, 1, 2), rtol=1e-12)
    expected = receptance(axis, omega, x)[:, :2, :2]
    assert np.abs(values - expected).max() < 1e-6 * np.abs(expected).max()


@settings(max_examples=40, deadline=None)
@given(vectors(softening=True), st.floats(-1.0, 1.0))
def test_another_speed_is_the_same_equations(drawn, x):
    """Modes at a speed, those of other places among them; what they are made of no longer changes."""
    layout, part = drawn
    axis = unpack(part, layout)
    moved = axis.at(x)
    omega = 2.0 * np.pi * np.geomspace(30.0, 9000.0, 40)
    expected = receptance(axis, omega, x)
    assert np.abs(receptance(moved, omega) - expected).max() < 1e-6 * np.abs(expected).max()
    assert moved.softening.size == 0
    assert moved.at(0.5) is moved


def test_a_stiffness_that_would_turn_negative_does_not():
    layout = ModalBlock(2, softening=True)
    part = np.zeros(layout.size)
    part[:2] = np.log(2.0 * np.pi * np.array([300.0, 900.0]))
    part[-3:] = [-0.5, 0.0, 0.2]
    axis = unpack(part, layout).at(5.0)
    assert np.all(np.isfinite(axis.omega_n))
    assert np.all(axis.omega_n > 0.0)


def test_overdamped_modes_are_real_poles():
    part = np.zeros(ModalBlock(2).size)
    part[:2] = np.log(2.0 * np.pi * np.array([300.0, 900.0]))
    part[2:6] = [1.0, 0.3, -0.5, 1.0]
    part[6:9] = np.log(100.0), 20.0, np.log(90.0)  # damping ratios above 1
    axis = unpack(part, ModalBlock(2))
    modes = flange_modes(axis, Dof.Y)
    omega = 2.0 * np.pi * np.linspace(10.0, 3000.0, 50)
    np.testing.assert_allclose(modes.receptance(omega).values, receptance(axis, omega)[:, :2, :2], rtol=1e-7)
    assert np.sum(modes.zeta == 1.0) >= 2
    assert dissipation(omega, modes.receptance(omega).values).min() > -1e-9


@pytest.mark.parametrize("layout", [ModalBlock(3), ModalBlock(3, 1), ModalBlock(2, 2, True)])
def test_chain_is_the_derivative(layout):
    rng = np.random.default_rng(2)
    m = layout.modes
    part = rng.standard_normal(layout.size)
    part[:m] += 8.0

    def physics(vector):
        """In the kernel's order and units: frequencies as logarithms, the residual as its factor."""
        axis = unpack(vector, layout)
        lower = np.tril_indices(m)
        parts = [np.log(axis.omega_n), axis.psi.ravel(), axis.factor[lower], axis.residual[np.tril_indices(2)]]
        for e in range(layout.places):
            parts += [axis.places[:, e], axis.place_residual[e]]
        return np.concatenate([*parts, axis.softening[lower]] if layout.softening else parts)

    for k in range(part.size):
        step = np.zeros(part.size)
        step[k] = 1e-6
        change = (physics(part + step) - physics(part - step)) / 2e-6
        expected = np.zeros(part.size)
        expected[k] = chain(unpack(part, layout), layout)[k]
        np.testing.assert_allclose(change, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


@settings(max_examples=40, deadline=None)
@given(vectors().filter(lambda v: v[0].modes > 1), st.integers(0, 100))
def test_without_mode_keeps_the_others(drawn, which):
    layout, part = drawn
    m = layout.modes
    axis = unpack(part, layout)
    kept = np.arange(m) != which % m
    left = axis.without_mode(which % m)
    np.testing.assert_array_equal(left.omega_n, axis.omega_n[kept])
    np.testing.assert_array_equal(left.psi, axis.psi[kept])
    np.testing.assert_array_equal(left.places, axis.places[kept])
    np.testing.assert_array_equal(left.place_residual, axis.place_residual)
    if layout.softening:
        np.testing.assert_array_equal(left.softening, axis.softening[np.ix_(kept, kept)])
    damping = (axis.factor @ axis.factor.T)[np.ix_(kept, kept)]
    np.testing.assert_allclose(left.factor @ left.factor.T, damping, rtol=1e-9, atol=1e-12 * damping.max())
    smaller = replace(layout, modes=m - 1)
    again = unpack(pack(left, smaller), smaller).factor
    np.testing.assert_allclose(again, left.factor, rtol=1e-12, atol=1e-12 * np.abs(left.factor).max())


@settings(max_examples=30, deadline=None)
@given(vectors(), st.floats(100.0, 5000.0), st.floats(0.01, 0.3), st.floats(-1.0, 1.0))
def test_with_mode_adds_its_own_receptance(drawn, hertz, zeta, x):
    layout, part = drawn
    axis = unpack(part, layout)
    psi, omega_n = np.array([0.4, -0.2]), 2.0 * np.pi * hertz
    omega = 2.0 * np.pi * np.geomspace(30.0, 9000.0, 40)
    more = axis.with_mode(omega_n, tuple(psi), zeta)
    fraction = 1.0 / (omega_n**2 - omega**2 + 2j * zeta * omega_n * omega)
    expected = receptance(axis, omega, x)
    lever = np.array([1.0, 1.0 / LEVER])
    expected[:, :2, :2] += np.outer(psi * lever, psi * lever) * fraction[:, None, None]
    assert np.abs(receptance(more, omega, x) - expected).max() < 1e-9 * np.abs(expected).max()
    # and it goes again without a trace
    back = more.without_mode(0)
    assert np.abs(receptance(back, omega, x) - receptance(axis, omega, x)).max() < 1e-9 * np.abs(expected).max()


def test_without_mode_of_hardly_any_damping():
    # the damping's product has long lost these to rounding: its Cholesky factor does not exist
    part = np.zeros(ModalBlock(3).size)
    part[:3] = np.log(2.0 * np.pi * np.array([300.0, 900.0, 2000.0]))
    part[9:15] = [-30.0, 2.0, -40.0, 2.0, 0.0, -50.0]
    left = unpack(part, ModalBlock(3)).without_mode(0)
    assert np.all(np.isfinite(pack(left)))
    np.testing.assert_allclose(left.factor @ left.factor.T, DAMPING_UNIT**2 * np.array([[4.0, 4.0], [4.0, 4.0]]), rtol=1e-6)


@settings(max_examples=30, deadline=None)
@given(vectors(), st.integers(0, 2**32 - 1), st.floats(-1.0, 1.0))
def test_selected_in_another_order_is_the_same_machine(drawn, seed, x):
    layout, part = drawn
    axis = unpack(part, layout)
    order = np.random.default_rng(seed).permutation(layout.modes)
    omega = 2.0 * np.pi * np.geomspace(30.0, 9000.0, 40)
    turned = axis.selected(order)
    expected = receptance(axis, omega, x)
    assert np.abs(receptance(turned, omega, x) - expected).max() < 1e-9 * np.abs(expected).max()
    np.testing.assert_array_equal(turned.omega_n, axis.omega_n[order])


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.builds(ModalBlock, st.integers(1, 5), st.booleans(), st.booleans()), min_size=1, max_size=3),
    st.integers(0, 9),
    st.integers(0, 3),
)
def test_every_unknown_has_one_place(axes, coefficients, clampings):
    layout = Layout(tuple(axes), coefficients, clampings)
    parts = [*(layout.axis(i) for i in range(len(axes))), layout.joint, layout.force, layout.clamping]
    assert np.concatenate([np.arange(p.start, p.stop) for p in parts]).tolist() == list(range(layout.size))
    assert [p.stop - p.start for p in parts] == [*(a.size for a in axes), JOINT, coefficients, clampings]
    theta = np.arange(layout.size, dtype=float)
    found, joint = split(theta, layout)
    np.testing.assert_array_equal(np.concatenate([*found, joint]), theta[: layout.tail + JOINT])
    for axis, part in zip(axes, found, strict=True):
        # the flange with its softening, without other places: what a posterior keeps
        own = part[axis.machine]
        assert own.size + JOINT == len(parameter_names(axis)) == replace(axis, places=0).size + JOINT
        np.testing.assert_array_equal(own[: axis.core], part[: axis.core])
        if axis.softening:
            np.testing.assert_array_equal(own[axis.core :], part[axis.size - axis.pairs :])


def test_plain_layout():
    assert flange_layout(2, 3) == Layout((ModalBlock(2), ModalBlock(3)))
    assert flange_layout(4).size == 4 + 8 + 10 + 3 + 4


def test_joint():
    logs = np.log([1e9, 2e6, 300.0, 4.0])
    found = joint_of(logs)
    assert found.translational_stiffness == pytest.approx(1e9)
    assert found.rotational_stiffness == pytest.approx(2e6)
    assert found.translational_damping == pytest.approx(300.0)
    assert found.rotational_damping == pytest.approx(4.0)
    np.testing.assert_allclose(scaled_joint(logs), [1e9, 2e6 / LEVER**2, 300.0, 4.0 / LEVER**2])


def test_names_follow_the_vector():
    layout = ModalBlock(2, places=1, softening=True)
    names = parameter_names(layout)
    assert names[:6] == (
        "log natural_frequency_rad_s[0]",
        "log natural_frequency_rad_s[1]",
        "psi_t[0]",
        "psi_lever*r[0]",
        "psi_t[1]",
        "psi_lever*r[1]",
    )
    assert names[-7:-4] == ("softening[0,0]", "softening[1,0]", "softening[1,1]")
    assert not any("place" in name for name in names)
