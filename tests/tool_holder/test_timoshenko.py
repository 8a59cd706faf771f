"""Beam elements against closed forms, and how fast their error falls."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.dynamics.structure import natural_frequencies
from rcsa_ident.tool_holder import model
from rcsa_ident.tool_holder.geometry import BeamSegment, Material, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_structure
from rcsa_ident.tool_holder.timoshenko import (
    Section,
    beam_matrices,
    cowper,
    hutchinson,
    layer_matrices,
    refined_beam_matrices,
    refined_layer_matrices,
    section,
    shape_functions,
    stacked,
    together,
)
from tests.oracles import literature

STEEL = Material(205e9, 7850.0, 0.3, 0.002)
BEAM = Section(6.0e4, 2.0e8, 12.0, 2.0e-3, 0.004)
THIN = Section(600.0, 3.0e7, 1.6, 1.5e-5, 0.002)


def rod(length, diameter, material, inner=0.0):
    return ToolAssembly((BeamSegment(length, diameter, material, inner),), (), 0.0)


@pytest.mark.parametrize("length", [0.002, 0.02, 0.2])
@pytest.mark.parametrize("beam", [BEAM, THIN])
def test_rigid_motion_costs_no_energy(beam, length):
    mass, stiffness, damping = refined_beam_matrices(beam, length)
    shift, turn = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 1.0, length, 1.0, 0.0, 0.0])
    for motion in (shift, turn):
        assert np.max(np.abs(stiffness @ motion)) < 1e-9 * np.max(np.abs(stiffness))
        assert np.max(np.abs(damping @ motion)) < 1e-9 * np.max(np.abs(damping))
    assert shift @ mass @ shift == pytest.approx(beam.mass * length, rel=1e-12)
    assert shift @ mass @ turn == pytest.approx(beam.mass * length**2 / 2, rel=1e-12)
    assert turn @ mass @ turn == pytest.approx(beam.mass * length**3 / 3 + beam.rotary * length, rel=1e-12)


def test_inner_freedoms_are_stiff_by_themselves():
    _, stiffness, _ = refined_beam_matrices(BEAM, 0.03)
    np.testing.assert_allclose(stiffness[:4, 4:], 0.0, atol=1e-12 * stiffness.max())
    assert stiffness[4, 5] == pytest.approx(0.0, abs=1e-12 * stiffness.max())
    # energy of the shapes as the docstring writes them, by quadrature of their derivatives
    x, weight = np.polynomial.legendre.leggauss(6)
    x, weight, length = 0.5 * (x + 1.0), 0.5 * weight * 0.03, 0.03
    shear = 4.0 - 8.0 * x
    assert stiffness[4, 4] == pytest.approx(np.sum(weight * BEAM.shear * shear**2), rel=1e-12)
    turn = (4.0 * x - 4.0 * x**2 - 2.0 / 3.0) - 4.0 * x * (1.0 - x)
    bend = (4.0 - 8.0 * x) / length
    assert stiffness[5, 5] == pytest.approx(np.sum(weight * (BEAM.shear * turn**2 + BEAM.bending * bend**2)), rel=1e-12)


def test_many_elements_at_once():
    lengths = np.array([0.004, 0.03])
    for batch, one, two in zip(
        refined_beam_matrices(stacked([BEAM, THIN]), lengths),
        refined_beam_matrices(BEAM, 0.004),
        refined_beam_matrices(THIN, 0.03),
        strict=True,
    ):
        np.testing.assert_array_equal(batch, [one, two])
    layers = refined_layer_matrices(stacked([BEAM, THIN]), stacked([THIN, BEAM]), lengths)
    for batch, one, two in zip(layers, refined_layer_matrices(BEAM, THIN, 0.004), refined_layer_matrices(THIN, BEAM, 0.03), strict=True):
        np.testing.assert_allclose(batch, [one, two], rtol=1e-13, atol=1e-18)


@pytest.mark.parametrize("length", [0.01, 0.3])
def test_cantilever_tip_compliance_is_exact_with_one_element(length):
    for beam in (BEAM, THIN):
        free = beam_matrices(beam, length)[1][:2, :2]
        exact = np.array(
            [
                [length**3 / (3 * beam.bending) + length / beam.shear, -(length**2) / (2 * beam.bending)],
                [-(length**2) / (2 * beam.bending), length / beam.bending],
            ]
        )
        np.testing.assert_allclose(np.linalg.inv(free), exact, rtol=1e-9)


def test_shape_functions_take_nodal_values():
    deflection, rotation = shape_functions(np.array([0.0, 1.0]), 0.02, 0.7)
    np.testing.assert_allclose(deflection, [[1, 0, 0, 0], [0, 0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(rotation, [[0, 1, 0, 0], [0, 0, 0, 1]], atol=1e-15)


def test_layer_feels_only_relative_motion():
    length = 0.01
    gap, turn = layer_matrices(BEAM, THIN, length)
    together_ = np.array([0.3, 2.0, 0.3 + 2.0 * length, 2.0] * 2)
    assert np.max(np.abs(gap @ together_)) < 1e-15
    assert np.max(np.abs(turn @ together_)) < 1e-14
    apart = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert apart @ gap @ apart == pytest.approx(length)
    turned = np.array([0.0, 1.0, length, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert turned @ turn @ turned == pytest.approx(length)


@settings(max_examples=30, deadline=None)
@given(poisson=st.floats(0.0, 0.49), ratio=st.floats(0.0, 0.99))
def test_shear_coefficients(poisson, ratio):
    for coefficient in (cowper, hutchinson):
        assert 0.45 < coefficient(poisson, ratio) < 1.0
    assert cowper(poisson, 0.0) == pytest.approx(6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson))
    assert cowper(poisson, 1.0) == pytest.approx(2.0 * (1.0 + poisson) / (4.0 + 3.0 * poisson))
    assert hutchinson(poisson, 0.0) == pytest.approx(6.0 * (1.0 + poisson) ** 2 / (7.0 + 12.0 * poisson + 4.0 * poisson**2))


def test_section_of_a_tube_and_of_a_cone():
    tube = section(BeamSegment(0.1, 0.05, STEEL, 0.02))
    assert tube.bending == pytest.approx(205e9 * np.pi / 64 * (0.05**4 - 0.02**4))
    assert tube.mass == pytest.approx(7850.0 * np.pi / 4 * (0.05**2 - 0.02**2))
    assert tube.rotary / tube.mass == pytest.approx((0.05**2 + 0.02**2) / 16)
    cone = section(BeamSegment(0.1, 0.02, STEEL, end_diameter=0.04))
    d = 0.02 + 0.02 * (np.arange(100000) + 0.5) / 100000
    assert cone.mass == pytest.approx(7850.0 * np.mean(np.pi / 4 * d**2), rel=1e-9)
    assert cone.bending == pytest.approx(205e9 * np.mean(np.pi / 64 * d**4), rel=1e-9)
    fluted = section(BeamSegment(0.1, 0.02, STEEL, area=2e-4, second_moment=3e-9))
    assert fluted.bending == pytest.approx(205e9 * 3e-9)
    assert fluted.mass == pytest.approx(7850.0 * 2e-4)


def test_bodies_that_move_as_one():
    both = together([BEAM, THIN])
    one, two, sum_ = (refined_beam_matrices(b, 0.02) for b in (BEAM, BEAM, together([BEAM, BEAM])))
    for a, b, c in zip(one, two, sum_, strict=True):
        np.testing.assert_allclose(a + b, c, rtol=1e-12, atol=1e-12 * np.abs(c).max())
    assert both.bending == BEAM.bending + THIN.bending
    assert both.loss_factor == pytest.approx((BEAM.bending * 0.004 + THIN.bending * 0.002) / both.bending)
    assert both.shear_loss_factor == pytest.approx((BEAM.shear * 0.004 + THIN.shear * 0.002) / both.shear)


@pytest.mark.parametrize("name", list(literature.TIMOSHENKO))
def test_closed_form_frequencies(name):
    """The tabulated roots of the frequency determinant; they go with `hutchinson`, not with the default."""
    case = literature.TIMOSHENKO[name]
    material = Material(case["youngs_modulus"], case["density"], case["poisson"])
    structure = tool_holder_structure(rod(case["length"], case["diameter"], material), 60e3, shear_coefficient=hutchinson, refinement=4)
    if "free_free" in case:
        found = natural_frequencies(structure)[2:7] / (2.0 * np.pi)
        np.testing.assert_allclose(found, case["free_free"], rtol=5e-8)
    else:
        kept = np.setdiff1d(np.arange(structure.mass.shape[0]), structure.index[2:])
        squares = scipy.linalg.eigvalsh(structure.stiffness[np.ix_(kept, kept)], structure.mass[np.ix_(kept, kept)])
        np.testing.assert_allclose(np.sqrt(squares[:5]) / (2.0 * np.pi), case["clamped_free"], rtol=5e-8)


@pytest.mark.parametrize(("diameter", "inner"), [(0.005, 0.0), (0.06, 0.0), (0.06, 0.04)])
def test_order_of_convergence_is_four(diameter, inner, monkeypatch):
    """Slender and stubby, solid and hollow: halve the elements, divide the error by sixteen."""
    monkeypatch.setattr(model, "ELEMENTS_PER_DIAMETER", 1e-3)
    assembly = rod(0.1, diameter, STEEL, inner)
    exact = natural_frequencies(tool_holder_structure(assembly, 1.0, refinement=32))[2]
    errors = [np.abs(natural_frequencies(tool_holder_structure(assembly, 1.0, refinement=r))[2] / exact - 1.0) for r in (4, 8)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize(("diameter", "order"), [(0.0004, 4.0), (0.06, 2.0)])
def test_order_of_the_elements_without_inner_freedoms(diameter, order):
    def lowest(count):
        beam, size = section(BeamSegment(0.1 / count, diameter, STEEL)), 2 * count + 2
        mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
        for i in range(count):
            m, k = beam_matrices(beam, 0.1 / count)
            mass[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += m
            stiffness[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += k
        return np.sqrt(scipy.linalg.eigvalsh(stiffness, mass)[2])

    exact = lowest(96)
    errors = [abs(lowest(n) / exact - 1.0) for n in (4, 8)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.4)
