from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.identification.coupled.data import coupled_data
from rcsa_ident.identification.coupled.fit import with_discs, with_softening
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.model_order import exchange_modes, fewer, more
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import CoupledLayout, pack, unpack
from tests.identification.coupled.models import coupled_vector, dense_receptance

OMEGA = 2.0 * np.pi * np.geomspace(300.0, 4500.0, 30)
LAYOUT = CoupledLayout(5, fixture=True, softening=True, skew=2, turning=1)


def machine():
    return unpack(coupled_vector(LAYOUT), LAYOUT.block)


def test_some_modes_are_the_machine_without_the_others():
    """Their damping and moments as they were: what is left out is only their own motion."""
    kept = np.array([True, False, True, True, False])
    whole = machine()
    few = whole.selected(kept)
    np.testing.assert_allclose(few.factor @ few.factor.T, (whole.factor @ whole.factor.T)[np.ix_(kept, kept)], rtol=1e-9, atol=1e-9)
    for name in ("softening", "skew"):
        np.testing.assert_array_equal(getattr(few, name), getattr(whole, name)[np.ix_(kept, kept)])
    for name in ("omega_n", "psi", "places"):
        np.testing.assert_array_equal(getattr(few, name), getattr(whole, name)[kept])
    none = replace(whole, softening=np.zeros((0, 0)), skew=np.zeros((0, 0))).selected(kept)
    assert none.softening.size == none.skew.size == 0


def test_one_mode_more_adds_its_own_receptance():
    whole, shape = machine(), np.array([0.3, -0.2, 0.1, 0.4])
    omega_n, zeta = 9000.0, 0.03
    more = whole.with_mode(omega_n, shape, zeta)
    for x, speed in ((0.0, 0.0), (0.5, 1500.0)):
        difference = dense_receptance(more, OMEGA, x, speed) - dense_receptance(whole, OMEGA, x, speed)
        own = np.outer(shape, shape) / (omega_n**2 - OMEGA**2 + 2j * zeta * omega_n * OMEGA)[:, None, None]
        np.testing.assert_allclose(difference[:, :4], own, atol=1e-9 * np.abs(own).max())
        # the fixture does not feel it
        assert np.abs(difference[:, 4:]).max() < 1e-9 * np.abs(own).max()


def test_more_discs_are_next_to_nothing_but_have_a_gradient():
    layout = CoupledLayout(4, skew=1, turning=1, coefficients=2)
    theta = coupled_vector(layout)
    grown, wider = with_discs(theta, layout, 2, Priors())
    assert wider == replace(layout, skew=2)
    assert grown.size == wider.size
    np.testing.assert_array_equal(grown[: layout.tail], theta[: layout.tail])
    np.testing.assert_array_equal(grown[wider.tail :], theta[layout.tail :])
    change = unpack(grown, wider.block).skew - unpack(theta, layout.block).skew
    assert 0.0 < np.abs(change).max() < 0.05
    again, _ = with_discs(theta, layout, 2, Priors())
    np.testing.assert_array_equal(again, grown)


def test_softening_comes_with_nothing_and_goes_alone():
    layout = CoupledLayout(4, fixture=True, skew=2, turning=1, coefficients=2)
    theta = coupled_vector(layout)
    softer, wider = with_softening(theta, layout, True)
    assert wider == replace(layout, softening=True)
    one, other = unpack(theta, layout.block), unpack(softer, wider.block)
    np.testing.assert_array_equal(other.softening, np.zeros((4, 4)))
    np.testing.assert_array_equal(other.skew, one.skew)
    np.testing.assert_array_equal(other.places, one.places)
    same, again = with_softening(softer, wider, False)
    assert again == layout
    np.testing.assert_allclose(same, theta, rtol=1e-12)
    assert with_softening(theta, layout, False) == (theta, layout)


def remade(points, theta, layout, noise=1e-3):
    """The same points with lines of a model: for tests of the search, not of the physics."""
    rng = np.random.default_rng(3)
    models = CoupledMisfit(points, Priors(), (0.0, 0.0)).models(theta, layout)
    axes = []
    for axis, model in zip(points.base.axes, models, strict=True):
        draws = (rng.standard_normal(model.shape) + 1j * rng.standard_normal(model.shape)) / np.sqrt(2.0)
        lines = model * (1.0 + noise * draws)
        variance = 0.5 * noise**2 * np.abs(model) ** 2
        axes.append(replace(axis, lines=np.stack([lines, np.zeros_like(lines)], axis=2), variance=variance))
    return replace(points, base=replace(points.base, axes=tuple(axes)))


@pytest.fixture(scope="module")
def missing(plain):
    """A fit without one of the modes that made the lines, and which one that is."""
    layout = CoupledLayout(5, skew=1, turning=1)
    theta = coupled_vector(layout)
    points = remade(coupled_data(plain), theta, layout)
    misfit = CoupledMisfit(points, Priors(), (1e-3, 1e-3))
    without = np.argsort(theta[:5])[2]
    kept = np.arange(5) != without
    few = replace(layout, modes=4)
    discs = layout.block.discs(theta)[:, :, kept]
    start = np.concatenate([pack(unpack(theta, layout.block).selected(kept), few.block, discs), theta[layout.tail :]])
    solution = refine(misfit, start, few, np.zeros((len(points.base.cut_ids), 2)), 30, grid=32)
    band = float(min(a.omega.min() for a in points.base.axes)) / 2.0 / np.pi, float(points.omega.max()) / 2.0 / np.pi
    return misfit, solution, band, np.exp(theta[without])


@pytest.mark.slow
def test_the_missing_mode_is_promised_and_found(missing):
    misfit, solution, band, omega_n = missing
    trials = more(solution, misfit, 0, band)
    assert {layout for _, layout in trials} == {replace(solution.layout, modes=5)}
    assert all(theta.size == layout.size for theta, layout in trials)
    places = np.exp([theta[0] for theta, _ in trials])
    assert np.abs(np.log(places / omega_n)).min() < 0.2
    # the others are what they were, their discs too
    for theta, layout in trials:
        old, new = unpack(solution.theta, solution.layout.block), unpack(theta, layout.block)
        np.testing.assert_allclose(new.skew[1:, 1:], old.skew, rtol=1e-12)
        assert not new.skew[0].any()
    found = exchange_modes(solution, misfit, band, rounds=1)
    assert found.cost < 0.2 * solution.cost
    assert found.layout.modes == 5


@pytest.mark.slow
def test_fewer_modes_keep_what_is_shared(missing):
    misfit, solution, _, _ = missing
    del misfit
    trials = fewer(solution, 1)
    assert len(trials) >= 4
    for theta, layout in trials:
        assert layout == replace(solution.layout, modes=3)
        np.testing.assert_array_equal(theta[layout.tail :], solution.theta[solution.layout.tail :])
    # two of a plane are the fewest
    assert fewer(solution, 2) == []
