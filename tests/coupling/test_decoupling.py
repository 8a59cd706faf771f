"""Decoupling undoes coupling; finite differences give slopes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.decoupling import decouple, with_slope
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.receptance import Receptance, dissipation
from rcsa_ident.tool_holder.model import tool_holder_structure
from tests.coupling.test_rcsa import FLANGES, TOOL, W, spindle_structure, tool_in_both_planes

JOINT = LumpedJoint(2e9, 5e6, 2000.0, 10.0)
ENTRIES = (np.array([0, 1, 1]), np.array([1, 0, 1]))
A = tool_holder_structure(TOOL, 4000.0).receptance(W)


def part(coupled, rows, cols):
    keep_rows = [i for i, c in enumerate(coupled.rows) if c.point == rows]
    keep_cols = [i for i, c in enumerate(coupled.cols) if c.point == cols]
    kept = coupled.values[:, keep_rows][:, :, keep_cols]
    return Receptance(coupled.omega, kept, tuple(coupled.rows[i] for i in keep_rows), tuple(coupled.cols[i] for i in keep_cols))


def assert_same(found, true, tolerance):
    size = np.sqrt(np.abs(np.einsum("nii->ni", true)))
    assert np.max(np.abs(found - true) / size[:, :, None] / size[:, None, :]) < tolerance


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    stiffness=st.floats(8.0, 12.0),
    turning=st.floats(5.0, 9.0),
    where=st.sampled_from([("tip", "tip"), ("spindle", "spindle"), ("spindle", "tip")]),
)
def test_decoupling_undoes_coupling(seed, stiffness, turning, where):
    """From the tip, from the spindle's end and across, whatever the spindle and the joint; what comes out is passive as what went in."""
    joint = LumpedJoint(10**stiffness, 10**turning, 1e3, 5.0)
    spindle = spindle_structure(np.random.default_rng(seed), tuple(c.dof for c in FLANGES[:2])).receptance(W)
    found = decouple(part(couple(A, spindle, joint), *where), A, joint)
    assert found.rows == found.cols == FLANGES[:2]
    assert_same(found.values, spindle.values, 1e-5)
    assert np.min(dissipation(W, found.values)) > -1e-5


def test_both_planes_at_once():
    tool = tool_in_both_planes().receptance(W)
    spindle = spindle_structure(np.random.default_rng(4), tuple(c.dof for c in FLANGES)).receptance(W)
    found = decouple(part(couple(tool, spindle, JOINT), "tip", "tip"), tool, JOINT)
    assert_same(found.values, spindle.values, 1e-5)


def test_without_a_joint_it_stays_in_the_flange():
    """A rigid decoupling of a jointed assembly returns B + K^-1, which couples back to the same tip."""
    spindle = spindle_structure(np.random.default_rng(5), tuple(c.dof for c in FLANGES[:2])).receptance(W)
    coupled = couple(A, spindle, JOINT)
    found = decouple(part(coupled, "tip", "tip"), A)
    expected = spindle.values.copy()
    i = np.arange(2)
    expected[:, i, i] += JOINT.compliance_along(W, tuple(c.dof for c in FLANGES[:2]))
    assert_same(found.values, expected, 1e-6)
    again = couple(A, found, LumpedJoint(1e18, 1e18))
    np.testing.assert_allclose(again["tip", "tip"], coupled["tip", "tip"], rtol=1e-6)


def test_what_is_refused():
    spindle = spindle_structure(np.random.default_rng(5), tuple(c.dof for c in FLANGES[:2])).receptance(W)
    coupled = couple(A, spindle, JOINT)
    tip = part(coupled, "tip", "tip")
    translation = Receptance(W, tip.values[:, :1, :1], tip.rows[:1], tip.cols[:1])
    with pytest.raises(InputError, match="several toolings"):
        decouple(translation, A, JOINT)
    other = Receptance(W[:-1], tip.values[:-1], tip.rows, tip.cols)
    with pytest.raises(InputError, match="the tool-holder's frequencies"):
        decouple(other, A, JOINT)


@pytest.mark.parametrize(("points", "order"), [(2, 1), (3, 2), (4, 3)])
def test_slopes_from_neighbouring_points(points, order):
    """Modes that are known functions of z: the error of the worst entry falls with the spacing's power."""
    rng = np.random.default_rng(8)
    number, phase = rng.uniform(5.0, 40.0, 6), rng.uniform(0.0, 6.0, 6)
    gains = rng.normal(size=(9, 6)) + 1j * rng.normal(size=(9, 6))

    def shapes(z):
        return np.sin(np.outer(z, number) + phase)

    at = 0.01
    both = np.stack([shapes(np.array([at]))[0], number * np.cos(at * number + phase)])
    exact = np.einsum("im,nm,jm->nij", both, gains, both)
    errors = []
    for spacing in (2e-3, 1e-3):
        z = at + spacing * np.arange(points)
        found = with_slope(np.einsum("im,nm,jm->nij", shapes(z), gains, shapes(z)), z)
        np.testing.assert_allclose(found[:, 0, 0], exact[:, 0, 0], rtol=1e-12)
        errors.append(np.linalg.norm(found - exact, axis=0)[ENTRIES])
    assert np.all(errors[1] < errors[0] / 2**order * 1.25)
    assert np.all(errors[1] > errors[0] / 2**order * 0.75)


def test_positions_must_differ():
    with pytest.raises(InputError, match="places that differ"):
        with_slope(np.zeros((3, 2, 2)), np.array([0.1, 0.1]))
    with pytest.raises(InputError, match="two points"):
        with_slope(np.zeros((3, 1, 1)), np.array([0.1]))
