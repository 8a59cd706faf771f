"""A step of a structure against quadrature over its past; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.stability._kernels import step as kernels
from rcsa_ident.stability.monodromy import MonodromyOperator, lobatto
from rcsa_ident.stability.tip_modes import ModeArrays
from tests.stability.mills import ONE, mill, tip

NODE, SHARE = np.polynomial.legendre.leggauss(40)
NODE, SHARE = 0.5 * (NODE + 1.0), 0.5 * SHARE


@pytest.mark.parametrize("z", [0.0, 1e-9, -1e-3 + 2e-3j, -0.3 + 1.5j, -2.0 + 6.9j, -2.0 + 7.2j, -30.0 + 4.0j, -0.1 + 25.0j])
def test_moments(z):
    moments = np.empty(7, dtype=complex)
    assert kernels._exponential_moments(complex(z), moments) == pytest.approx(np.exp(z), rel=1e-13)
    expected = [np.sum(SHARE * np.exp(z * (1.0 - NODE)) * NODE**k) for k in range(7)]
    np.testing.assert_allclose(moments, expected, rtol=1e-10)


@pytest.mark.parametrize("degree", [1, 2, 6])
def test_responses(degree):
    """A step's motion under a force that is a polynomial, against an integral over its past."""
    rng = np.random.default_rng(3)
    pole = np.array([-90.0 + 5000.0j, -400.0 + 0.0j, -2000.0 + 21000.0j])
    outputs, inputs = (rng.standard_normal(s) + 1j * rng.standard_normal(s) for s in ((2, 3), (3, 2)))
    table, h = lobatto(degree), 3e-4
    q, m, r = table.shape[1] - 1, pole.size, outputs.shape[0]
    decay, drive, seen = (np.empty(shape, dtype=complex) for shape in ((q + 1, m), (q + 1, m, r), (2, q, r, m)))
    echo = np.zeros((2, q, q + 1, r, r))
    kernels.responses(h, ModeArrays(pole, outputs, inputs, np.zeros((2, 2))), table, decay, drive, seen, echo)
    start, force = rng.standard_normal(3) + 1j * rng.standard_normal(3), rng.standard_normal((degree + 1, 2))
    for j in range(1, degree + 1):
        x = table[0, j]
        powers = (x * NODE)[:, None] ** np.arange(degree + 1)
        along = powers @ table[2:].T @ force
        state = np.exp(pole * h * x) * start
        state = state + h * x * np.sum(SHARE[:, None] * np.exp(pole * h * x * (1.0 - NODE[:, None])) * (along @ inputs.T), axis=0)
        y = np.real(seen[0, j - 1] @ start) + np.einsum("iab,ib->a", echo[0, j - 1], force)
        v = np.real(seen[1, j - 1] @ start) + np.einsum("iab,ib->a", echo[1, j - 1], force)
        np.testing.assert_allclose(y, 2.0 * np.real(outputs @ state), rtol=1e-9)
        np.testing.assert_allclose(v, 2.0 * np.real(outputs @ (pole * state + inputs @ force[j])), rtol=1e-9)
    np.testing.assert_allclose(decay[degree] * start + np.einsum("ikb,ib->k", drive, force), state, rtol=1e-9)


def test_elements_of_nearly_equal_steps_share_what_was_computed():
    """Also where the first and the last of them differ by more than neighbours do."""
    cut = MonodromyOperator(tip(ONE), mill(2, 0.5), 2, False)
    places = np.array([[0.0, 3e-4 * (1.0 + change), 1.0, 3.0 * k, 0.0] for k, change in enumerate((0.0, 0.7e-12, 1.4e-12, 1e-10))])
    _, _, same, *found = kernels.steps(cut.arrays, places, cut.table)
    np.testing.assert_array_equal(same, [0, 0, 0, 3])
    for e in (0, 3):
        _, _, _, *alone = kernels.steps(cut.arrays, places[e : e + 1], cut.table)
        for each, own in zip(found, alone, strict=True):
            np.testing.assert_array_equal(each[e :: places.shape[0]], own)
            assert np.any(own)


@pytest.mark.parametrize("degree", [1, 2, 6])
@pytest.mark.parametrize("modes", [3, 8])
def test_rows_are_what_the_responses_say(degree, modes):
    """Of two elements and one in which nothing cuts; lengths of rows leave no remainder, and what fills them up is nothing."""
    rng = np.random.default_rng(7)
    pole = -100.0 * rng.uniform(0.5, 2.0, modes) + 1j * rng.uniform(2e3, 2e4, modes)
    outputs, inputs = (rng.standard_normal(s) + 1j * rng.standard_normal(s) for s in ((2, modes), (modes, 2)))
    arrays, table = ModeArrays(pole, outputs, inputs, rng.standard_normal((2, 2))), lobatto(degree)
    places = np.array([[0.0, 3e-4, 2.0, 0.0, 0.0], [6e-4, 2e-4, 1.0, -1.0, 0.0], [8e-4, 1e-4, 1.0, 20.0, 0.0]])
    decay, _, same, free, moved, driven = kernels.steps(arrays, places, table)
    np.testing.assert_array_equal(same, [0, 1, 2])
    np.testing.assert_allclose(decay[1, degree], np.exp(2e-4 * pole), rtol=1e-12)
    q, r, pairs = degree, 2, driven.shape[2] // 2
    assert (free.shape[0], moved.shape[0], driven.shape[0]) == (6, 3, 3)
    assert [rows.shape[1] % 4 for rows in (free, moved, driven)] == [0, 0, 0]
    assert (free.shape[2] % 16, moved.shape[2] % 16, pairs % 8) == (0, 0, 0)
    assert (free.shape[1] - 2 * pairs - r < 4, moved.shape[1] - q * r < 4, driven.shape[1] - (q + 1) * r < 4) == (True, True, True)
    assert (pairs - modes < 8, free.shape[2] - q * r < 16) == (True, True)
    for e in (0, 2):
        own = [np.empty(s, dtype=complex) for s in ((q + 1, modes), (q + 1, modes, r), (2, q, r, modes))]
        echo = np.zeros((2, q, q + 1, r, r))
        kernels.responses(places[e, 1], arrays, table, *own, echo)
        state, force = rng.standard_normal(modes) + 1j * rng.standard_normal(modes), rng.standard_normal((q + 1, r))
        # what stands where nothing is wanted counts for nothing
        known, pushes, later = (rng.standard_normal(rows.shape[1]) for rows in (free, driven, moved))
        known[:modes], known[pairs : pairs + modes], known[2 * pairs : 2 * pairs + r] = state.real, state.imag, force[0]
        pushes[: (q + 1) * r], later[: q * r] = force.ravel(), force[1:].ravel()
        for kind in range(2):
            expected = (own[2][kind] @ state).real + np.einsum("jab,b->ja", echo[kind, :, 0], force[0])
            np.testing.assert_allclose((known @ free[3 * kind + e])[: q * r], expected.ravel(), rtol=1e-9)
            assert np.all((known @ free[3 * kind + e])[q * r :] == 0.0)
        expected = np.einsum("jiab,ib->ja", echo[0, :, 1:], force[1:]) + force[1:] @ arrays.constant.T
        np.testing.assert_allclose((later @ moved[e])[: q * r], expected.ravel(), rtol=1e-9)
        expected = np.einsum("ikb,ib->k", own[1], force)
        found = pushes @ driven[e]
        np.testing.assert_allclose(found[:modes] + 1j * found[pairs : pairs + modes], expected, rtol=1e-9)
        assert np.all(np.delete(found.reshape(2, pairs), np.arange(modes), axis=1) == 0.0)
