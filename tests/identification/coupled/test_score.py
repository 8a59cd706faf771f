"""The score test on lines of a known model; what it says of virtual machines stands in `test_fit`."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.identification.coupled.data import coupled_data
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.coupled.score import STRIKES, Coupling, coupled_start, coupling
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import EVERY_PAIR, Layout, ModalBlock
from tests.identification.coupled.models import some_missing
from tests.identification.models import vector_of
from tests.identification.test_misfit import dense, flat

FREQUENCIES = ((700.0, 1400.0, 2600.0), (900.0, 2100.0))
NOISE = 3e-3


@pytest.fixture(scope="module")
def all_cuts(turned_shop):
    """As many as an identification asks for at least: eight of each tooling."""
    cuts, _ = turned_shop.measurements(np.random.default_rng(1), runout=1e-7, fixture=False, both_forces=True)
    return turned_shop.prepare(some_missing(cuts), turning=True)


def across(theta, layout):
    """Places of what is zero for planes that feel nothing of each other, and of the gyroscopic coupling, from the vector itself."""
    vector, whole = coupled_start(theta, layout, EVERY_PAIR)
    zero = vector == 0.0
    turning = np.zeros(vector.size, dtype=bool)
    turning[whole.block.parts["skew"]] = True
    return vector, whole, zero & ~turning, turning


def case(data, seed, change=0.0, kind=None):
    """Lines of planes that feel `change` of each other, and the optimum of planes that feel nothing, with the noise that is there."""
    layout = Layout((ModalBlock(3), ModalBlock(2)))
    theta = vector_of(layout, FREQUENCIES)
    vector, whole, oblique, turning = across(theta, layout)
    rng = np.random.default_rng(seed)
    if kind is not None:
        place = {"oblique": oblique & (np.arange(vector.size) < whole.block.parts["shapes"].stop), "gyroscopic": turning}[kind]
        vector = vector + change * place * rng.choice([-1.0, 1.0], vector.size)
    points = coupled_data(data)
    axes = []
    for axis, model in zip(points.base.axes, CoupledMisfit(points, Priors(), (0.0, 0.0)).models(vector, whole), strict=True):
        draws = rng.standard_normal(model.shape) + 1j * rng.standard_normal(model.shape)
        variance = 0.5 * NOISE**2 * np.abs(model) ** 2
        lines = model + np.sqrt(variance) * draws
        axes.append(replace(axis, lines=np.stack([lines, np.zeros_like(lines)], axis=2), variance=variance, beside=np.zeros((0, 0))))
    base = replace(points.base, axes=tuple(axes))
    known = Misfit(base, Priors(), (1e-6, 1e-6))
    found = refine(known, theta, layout, np.zeros((len(base.cut_ids), 2)), 200, grid=32, tolerance=1e-9)
    return found, CoupledMisfit(replace(points, base=base), Priors(), (1e-6, 1e-6))


def asked(found, misfit):
    return coupling(found.theta, found.layout, found.evaluation.nuisance, misfit)


def test_chance_alone():
    assert Coupling(STRIKES + 1e-9, 0.0, 0.0, 0.0).found
    assert not Coupling(STRIKES, 99.0, 99.0, 1.0).found


@pytest.mark.slow
def test_planes_that_feel_nothing_score_as_chance_does(all_cuts):
    """Over draws of the noise: nothing strikes, and the mean is about none."""
    scores = np.array([[c.score, c.oblique, c.gyroscopic] for c in (asked(*case(all_cuts, seed)) for seed in range(12))])
    assert np.abs(scores).max() < 4.0
    assert np.abs(scores.mean(axis=0)).max() < 1.0
    assert np.all(scores.std(axis=0) < 2.0)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "change"), [("oblique", 0.02), ("gyroscopic", 0.05)])
def test_what_is_felt_is_found_and_told_apart(all_cuts, kind, change):
    """A fiftieth of a shape across, or moments as large as a spindle's."""
    for seed in range(3):
        found = asked(*case(all_cuts, seed, change, kind))
        assert found.score > STRIKES
        other = {"oblique": "gyroscopic", "gyroscopic": "oblique"}[kind]
        assert getattr(found, kind) > getattr(found, other)
        assert 0.3 < found.explained < 1.1


@pytest.mark.slow
def test_gain_is_that_of_one_step_of_least_squares(all_cuts):
    """All residuals linear in everything: what a step with everything felt across gains more than one without it."""
    found, misfit = case(all_cuts, 1, 0.02, "oblique")
    # a little beside the optimum: there, what all others would gain counts, too
    theta = found.theta + 1e-4 * np.random.default_rng(2).standard_normal(found.theta.size)
    vector, whole, oblique, turning = across(theta, found.layout)
    nuisance = found.evaluation.nuisance
    for _ in range(20):
        nuisance = misfit.evaluate(vector, whole, nuisance).nuisance
    jacobian = dense(misfit, vector, whole, nuisance)
    residual = flat(misfit.residual_at(vector, whole, nuisance))
    prior = misfit.prior(whole).spread
    chi2 = sum(misfit.residual_at(vector, whole, nuisance).chi2)
    each = coupling(theta, found.layout, nuisance, misfit)
    cuts = np.ones(jacobian.shape[1] - vector.size, dtype=bool)
    for score, places in ((each.score, oblique | turning), (each.oblique, oblique), (each.gyroscopic, turning)):
        known = np.concatenate([~(oblique | turning), cuts])
        basis, _ = np.linalg.qr(jacobian[:, known])
        columns = jacobian[:, : vector.size][:, places]
        columns = columns - basis @ (basis.T @ columns)
        left = residual - basis @ (basis.T @ residual)
        gain = left @ columns @ np.linalg.solve(columns.T @ columns, columns.T @ left)
        chance = np.sum(places) - np.trace(np.linalg.solve(columns.T @ columns, np.diag(prior[places] ** -2.0)))
        expected = (gain / (chi2 / misfit.points) - chance) / np.sqrt(2.0 * chance)
        assert score == pytest.approx(expected, rel=1e-2, abs=0.05)


def test_the_start_is_the_same_machine():
    layout = Layout((ModalBlock(3, 1, True), ModalBlock(2, 1, True)), 3, 2)
    theta = vector_of(layout, FREQUENCIES)
    vector, whole, oblique, turning = across(theta, layout)
    # everything that is not felt across is there once, in some place
    np.testing.assert_allclose(np.sort(vector[~(oblique | turning)]), np.sort(theta), rtol=1e-12)
    assert (whole.modes, whole.fixture, whole.softening, whole.coefficients, whole.clampings) == (5, True, True, 3, 2)
    np.testing.assert_array_equal(vector[whole.tail :], theta[layout.tail :])
    # one axis that does not change with speed, or has no fixture, leaves the whole without
    fewer = replace(layout, axes=(ModalBlock(3, 1), ModalBlock(2, 0, True)))
    _, whole = coupled_start(vector_of(fewer, FREQUENCIES), fewer)
    assert not whole.fixture
    assert not whole.softening
