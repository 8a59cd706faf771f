import math
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import (
    close_pairs,
    cut_weights,
    drop_modes,
    evidence,
    exchange_modes,
    grow_modes,
    merged,
    model_error,
    more,
)
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.progress import Stage
from rcsa_ident.identification.unknowns import Layout, ModalBlock, flange_layout, pack, unpack
from tests.identification.models import machine_vector, own, remade, vector_of
from tests.identification.test_unknowns import receptance

BAND = (530.0, 4300.0)
TRUE = flange_layout(3)


@pytest.fixture(scope="module")
def theta():
    return machine_vector((600.0, 1400.0, 2600.0))


def nothing(data):
    return np.zeros((len(data.cut_ids), 2))


def frequencies(solution):
    return np.sort(np.exp(solution.theta[: solution.layout.axes[0].modes])) / (2.0 * np.pi)


def with_two_more(theta, rng):
    """The same machine with two modes of hardly any shape at 1000 and 3500 Hz."""
    m, n = 3, 5
    part, joint = own(theta), theta[-4:]
    more = np.zeros(ModalBlock(n).size)
    more[:n] = [*part[:m], *np.log(2.0 * np.pi * np.array([1000.0, 3500.0]))]
    more[n : 3 * n] = [*part[m : 3 * m], *(0.05 * rng.standard_normal(4))]
    rows, cols = np.tril_indices(n)
    lower = np.where(rows == cols, np.log(0.1 * np.exp(more[:n]))[rows] / 2.0 - np.log(30.0), 0.0)
    lower[: m * (m + 1) // 2] = part[3 * m : -3]
    more[3 * n :] = [*lower, *part[-3:]]
    return np.concatenate([more, joint])


def test_evidence_prefers_the_true_number_of_modes(few, theta):
    rng = np.random.default_rng(6)
    data, _ = remade(few.only(Dof.X), theta, TRUE, rng, noise=5e-3)
    misfit = Misfit(data, Priors(), (5e-4,))
    full = refine(misfit, with_two_more(theta, rng), flange_layout(5), nothing(data), 80, grid=32)
    seen = []
    best = drop_modes(full, misfit, lambda stage, value, solution: seen.append((stage, value, solution.layout)))
    assert best.layout == TRUE
    assert {stage for stage, _, _ in seen} == {Stage.MODES}
    assert [layout.axes[0].modes for _, _, layout in seen] == [4, 3, 2]
    values = {layout.axes[0].modes: value for _, value, layout in seen}
    assert values[3] == pytest.approx(evidence(best, misfit))
    assert values[3] < min(values[4], values[2], evidence(full, misfit))
    np.testing.assert_allclose(frequencies(best), [600.0, 1400.0, 2600.0], rtol=0.02)


@pytest.fixture(scope="module")
def known(few, theta):
    """Lines of three modes, their misfit, and the solution with all three."""
    data, _ = remade(few.only(Dof.X), theta, TRUE, np.random.default_rng(8), noise=5e-3)
    misfit = Misfit(data, Priors(), (5e-4,))
    return data, misfit, refine(misfit, theta, TRUE, nothing(data), 100, grid=32)


@pytest.fixture(scope="module", params=[1, 2])
def poor(request, known, theta):
    """The best that can be done without one of the modes."""
    data, misfit, right = known
    left = unpack(own(theta), TRUE.axes[0]).without_mode(request.param)
    found = refine(misfit, np.concatenate([pack(left), theta[-4:]]), flange_layout(2), nothing(data), 60, grid=32)
    assert evidence(found, misfit) > evidence(right, misfit) + 100.0
    return request.param, found


def more_of(solution, misfit, i, band):
    """An axis with one mode more."""
    return [unpack(theta[layout.axis(i)], layout.axes[i]) for theta, layout in more(solution, misfit, i, band)]


def test_a_mode_that_was_taken_out_is_the_most_promising(known, poor):
    _, misfit, _ = known
    missing, solution = poor
    found = more_of(solution, misfit, 0, BAND)
    assert 1 <= len(found) <= 3
    assert all(axis.order == 3 for axis in found)
    # the grid's step is 15 %
    assert abs(np.log(found[0].omega_n[0] / (2.0 * np.pi * [600.0, 1400.0, 2600.0][missing]))) < 0.15
    # with it the polish takes away nearly all that was left
    theta = np.concatenate([pack(found[0]), solution.theta[-4:]])
    assert refine(misfit, theta, TRUE, solution.evaluation.nuisance, 30).cost < 0.1 * solution.cost


@pytest.mark.parametrize("place", [7, 11, 13, 16])
def test_promise_of_a_weak_mode_is_kept(known, theta, place):
    """Where the shape is small the linearised misfit is exact: frequency and shape are those of the mode that is missing."""
    shape = np.array([0.03, -0.02])
    # at a place of the grid
    frequency = np.geomspace(0.3 * BAND[0], 2.5 * BAND[1], 30)[place]
    more = unpack(own(theta), TRUE.axes[0]).with_mode(2.0 * np.pi * frequency, tuple(shape), 0.06)
    lines, delay = remade(known[0], np.concatenate([pack(more), theta[-4:]]), flange_layout(4), np.random.default_rng(3), noise=0.0)
    misfit = Misfit(lines, Priors(), (1e-3,))
    without = refine(misfit, theta, TRUE, np.stack([delay, 0.0 * delay], axis=1), 60)
    first = more_of(without, misfit, 0, BAND)[0]
    assert first.omega_n[0] / (2.0 * np.pi) == pytest.approx(frequency, rel=1e-9)
    sign = np.sign(first.psi[0] @ shape)
    np.testing.assert_allclose(sign * first.psi[0], shape, rtol=0.15)


def test_promising_with_everything_unknown(rich):
    """Two outputs, softening, uncertain forces, tooth angles: the missing mode is found in the axis that lacks it."""
    axes = (ModalBlock(3, 1, True), ModalBlock(2, 1, True))
    layout = Layout(axes, len(rich.coefficient_spread), rich.clampings)
    theta = vector_of(layout, ((600.0, 1400.0, 2600.0), (900.0, 2100.0)))
    theta[layout.force] *= 0.02
    # the fixture does not feel the mode that will be missing
    theta[layout.axis(0).start + axes[0].core + 1] = 0.0
    data, delay = remade(rich, theta, layout, np.random.default_rng(2), noise=5e-3)
    delay = delay + 0.0
    edge = delay - theta[layout.clamping][rich.clamping] / rich.spindle_speed
    data = replace(data, edge=np.column_stack([edge, rich.edge[:, 1]]))
    misfit = Misfit(data, Priors(), (5e-4, 5e-4))
    poor_axes = (replace(axes[0], modes=2), axes[1])
    left = pack(unpack(theta[layout.axis(0)], axes[0]).without_mode(1), poor_axes[0])
    vector = np.concatenate([left, theta[layout.axis(0).stop :]])
    poor = refine(misfit, vector, replace(layout, axes=poor_axes), np.stack([delay, 0.0 * delay], axis=1), 0)
    found = more_of(poor, misfit, 0, BAND)
    assert abs(np.log(found[0].omega_n[0] / (2.0 * np.pi * 1400.0))) < 0.15
    assert found[0].softening.shape == (3, 3)
    assert found[0].places.shape == (3, 1)


def test_exchange_brings_back_a_mode_that_the_search_has_missed(known, poor):
    _, misfit, right = known
    found = exchange_modes(poor[1], misfit, BAND)
    assert found.layout == TRUE
    np.testing.assert_allclose(frequencies(found), frequencies(right), rtol=2e-3)
    # a joint that is stiff by its damper is nearly as good as one that is stiff by its spring: not every walk tells them apart
    assert evidence(found, misfit) - evidence(right, misfit) < 50.0


def test_exchange_leaves_the_right_model_alone(known):
    _, misfit, right = known
    told = []
    found = exchange_modes(right, misfit, BAND, lambda stage, cost, solution: told.append(stage))
    assert found.layout == TRUE
    assert evidence(found, misfit) <= evidence(right, misfit)
    assert set(told) == {"exchange"}


def test_grow_adds_a_mode_to_each_axis_though_nothing_asks_for_it(few):
    theta = vector_of(flange_layout(3, 2), ((600.0, 1400.0, 2600.0), (900.0, 2100.0)))
    data, _ = remade(few, theta, flange_layout(3, 2), np.random.default_rng(4), noise=5e-3)
    misfit = Misfit(data, Priors(), (5e-4, 5e-4))
    right = refine(misfit, theta, flange_layout(3, 2), nothing(data), 60, grid=32)
    grown = grow_modes(right, misfit, BAND)
    assert grown.layout == flange_layout(4, 3)
    # the data do not pay for them, and what was there stays
    assert evidence(grown, misfit) > evidence(right, misfit)
    assert sum(grown.evaluation.chi2) < sum(right.evaluation.chi2) * 1.001
    # with them the flange is less sure above the band, where nothing was measured
    for i in range(2):
        old, new = (np.exp(s.theta[s.layout.axis(i)][: s.layout.axes[i].modes]) for s in (right, grown))
        assert all(np.abs(np.log(new / f)).min() < 0.05 for f in old)


def test_evidence_without_data_is_the_priors_alone(few, theta):
    # cost 0, log det ratio 0: what is left are the lines' own variances and the ways to write the same machine
    data = few.only(Dof.X)
    misfit = Misfit(data, Priors(), (1e6,))
    solution = refine(misfit, theta, TRUE, nothing(data), 50)
    noise = 2.0 * float(np.sum(np.log(1.0 / misfit.weight(0))))
    alike = 2.0 * math.log(math.factorial(3) * 2**3)
    assert evidence(solution, misfit) - noise == pytest.approx(-alike, abs=1e-2)


def test_evidence_knows_the_variances(known):
    """Twice the standard deviations: chi2 falls to a quarter, each real residual costs log 4 more."""
    data, _, right = known
    loud = replace(data, axes=(replace(data.axes[0], variance=4.0 * data.axes[0].variance),))
    misfits = [Misfit(each, Priors(), (0.0,)) for each in (data, loud)]
    solutions = [refine(m, right.theta, TRUE, right.evaluation.nuisance, 0) for m in misfits]
    values = []
    for misfit, solution in zip(misfits, solutions, strict=True):
        volume = np.linalg.slogdet(solution.evaluation.hessian)[1]
        values.append(evidence(solution, misfit) - volume - solution.cost)
    assert values[1] - values[0] == pytest.approx(misfits[0].points * math.log(4.0), rel=1e-9)


def test_merged_identical_modes_are_the_same_machine():
    """Two modes of one frequency and damping whose shapes are in proportion move flange and fixture as one mode does."""
    axis = unpack(own(machine_vector((600.0, 1400.0, 2600.0))), TRUE.axes[0])
    omega_n = np.array([axis.omega_n[0], axis.omega_n[1], axis.omega_n[1]])
    psi = np.array([axis.psi[0], axis.psi[1], -0.6 * axis.psi[1]])
    factor = np.diag(np.sqrt(2.0 * 0.05 * omega_n))
    double = replace(
        axis, omega_n=omega_n, psi=psi, factor=factor, places=np.array([[0.05], [0.1], [0.2]]), place_residual=np.zeros((1, 2))
    )
    ((low, high),) = close_pairs(double)
    found = merged(double, low, high).without_mode(high)
    assert found.order == 2
    omega = 2.0 * np.pi * np.linspace(100.0, 4000.0, 60)
    # what the fixture does when it is itself pushed is not asked
    expected, values = (receptance(each, omega)[:, :, :2] for each in (double, found))
    np.testing.assert_allclose(values, expected, rtol=1e-7, atol=1e-12 * np.abs(expected).max())


def test_merged_are_neighbours_only():
    axis = unpack(own(machine_vector((600.0, 1400.0, 2600.0))), TRUE.axes[0])
    assert close_pairs(axis) == []
    close = replace(axis, omega_n=np.array([1.0, 1.1, 1.25]) * axis.omega_n[0])
    assert close_pairs(close) == [(0, 1), (1, 2)]
    for low, high in close_pairs(close):
        assert close.omega_n[low] < merged(close, low, high).omega_n[low] < close.omega_n[high]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_model_error_recovers_a_planted_scatter(shop, theta, seed):
    rng = np.random.default_rng(seed)
    every = shop.prepare(shop.measurements(rng, axes=(Dof.X,), fixture=False)[0])
    data, _ = remade(every, theta, TRUE, rng, noise=2e-3, scatter=1e-2)
    misfit = Misfit(data, Priors(), (1e-2,))
    solution = refine(misfit, theta, TRUE, nothing(data), 60, grid=32)
    assert model_error(solution, misfit)[0] == pytest.approx(1e-2, rel=0.2)


def test_model_error_has_a_floor(few, theta):
    data, _ = remade(few.only(Dof.X), theta, TRUE, np.random.default_rng(4), noise=0.0)
    misfit = Misfit(data, Priors(), (1e-3,))
    solution = refine(misfit, theta, TRUE, nothing(data), 60, grid=32)
    assert model_error(solution, misfit) == (5e-4,)


@pytest.fixture(scope="module")
def corrupted(shop, theta):
    """One of forty cuts is a quarter too large and turned: its cutter was another one."""
    rng = np.random.default_rng(7)
    every = shop.prepare(shop.measurements(rng, axes=(Dof.X,), fixture=False)[0])
    data, _ = remade(every, theta, TRUE, rng, noise=5e-3)
    axis = data.axes[0]
    lines = np.where((axis.cut == 11)[:, None, None], (1.25 + 0.3j * axis.order[:, None, None] / 10.0) * axis.lines, axis.lines)
    return replace(data, axes=(replace(axis, lines=lines),))


def test_a_corrupted_cut_counts_less(corrupted, theta):
    misfit = Misfit(corrupted, Priors(), (5e-4,))
    solution = refine(misfit, theta, TRUE, nothing(corrupted), 60, grid=32)
    assert np.flatnonzero(cut_weights(solution, misfit) < 1.0).tolist() == [11]
    better, again = solution, misfit
    for _ in range(3):
        again = Misfit(corrupted, Priors(), (5e-4,), cut_weights(better, again))
        better = refine(again, better.theta, TRUE, better.evaluation.nuisance, 60)
        # it is still known for what it is
        assert np.flatnonzero(again.cut_weight < 1.0).tolist() == [11]
    # as much variance as it shows: it stands among the others
    axis = corrupted.axes[0]
    squares = np.sum(better.evaluation.residual.lines[0].reshape(2, -1) ** 2, axis=0)
    mean = np.bincount(axis.cut, squares) / np.bincount(axis.cut)
    assert mean[11] == pytest.approx(np.median(mean), rel=0.1)
    away = [np.linalg.norm(s.theta[:9] - theta[:9]) for s in (solution, better)]
    assert away[1] < 0.5 * away[0]
    # what it lacks is not laid upon the others
    assert model_error(better, again)[0] < 2e-3


def test_honest_cuts_all_count(known):
    data, misfit, right = known
    np.testing.assert_array_equal(cut_weights(right, misfit), np.ones(len(data.cut_ids)))
