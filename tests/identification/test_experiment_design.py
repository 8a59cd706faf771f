"""What further cuts would tell: closed forms, dense algebra, and an identification that has made the cuts."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.experiment_design import (
    CandidateCuts,
    MeanVariance,
    Volume,
    compressed,
    deviations,
    exchanged,
    expected_cut,
    greedy,
    harmonics,
    information,
    tip_changes,
)
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import Layout, ModalBlock, flange_layout
from rcsa_ident.tool_holder.model import tool_holder_receptance
from tests.identification.models import machine_vector, remade, vector_of

NOISE = 1e-10


def random_prospects(seed, candidates=12, unknowns=7, rows=3, apart=None):
    rng = np.random.default_rng(seed)
    # of very different worth, some with fewer rows than others
    cuts = tuple(rng.standard_normal((1 + k % rows, unknowns)) * np.exp(rng.standard_normal(unknowns)) for k in range(candidates))
    targets = (rng.standard_normal((unknowns, 4)), rng.standard_normal((unknowns, 2)))
    return CandidateCuts(cuts, targets, (0.0, 0.01), np.eye(candidates, dtype=bool) if apart is None else apart)


def variance(prospects, chosen):
    return float(np.sum(prospects.deviation(prospects.covariance(chosen)) ** 2))


# the linear model


def test_identical_cuts_of_one_unknown_have_a_closed_form():
    prospects = CandidateCuts((np.array([[3.0]]),) * 5, (np.array([[0.2]]),), (0.0,), np.eye(5, dtype=bool))
    order = greedy(prospects, 5, MeanVariance())
    assert order == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(deviations(prospects, order)[:, 0], 0.2 / np.sqrt(1.0 + 9.0 * np.arange(6)), rtol=1e-12)


def test_what_no_cut_can_lower_stays():
    prospects = CandidateCuts((np.array([[1e6]]),), (np.array([[0.2]]),), (0.03**2,), np.eye(1, dtype=bool))
    assert deviations(prospects, [0])[:, 0] == pytest.approx([np.hypot(0.2, 0.03), 0.03], rel=1e-9)


@pytest.mark.parametrize("goal", [MeanVariance(), Volume()])
def test_rank_updates_choose_as_direct_inversion_does(goal):
    prospects = random_prospects(1)
    chosen = []
    for _ in range(8):
        worth = np.full(12, -np.inf)
        for k in set(range(12)) - set(chosen):
            information_ = np.eye(7) + sum((prospects.rows[c].T @ prospects.rows[c] for c in [*chosen, k]), np.zeros((7, 7)))
            covariance = np.linalg.inv(information_)
            volume = np.linalg.slogdet(information_)[1]
            total = sum(float(np.trace(w.T @ covariance @ w)) for w in prospects.targets)
            worth[k] = volume if isinstance(goal, Volume) else -total
        chosen.append(int(np.argmax(worth)))
    assert greedy(prospects, 8, goal) == chosen


@given(st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_no_cut_widens_a_band_and_the_greedy_one_beats_any_other_first(seed):
    prospects = random_prospects(seed)
    order = greedy(prospects, 12, MeanVariance())
    assert sorted(order) == list(range(12))
    bands = deviations(prospects, order)
    assert np.all(np.diff(bands, axis=0) <= 1e-12)
    assert variance(prospects, order[:1]) == pytest.approx(min(variance(prospects, [k]) for k in range(12)), rel=1e-9)


@pytest.mark.slow
def test_exchange_is_never_worse_and_mends_what_greed_has_spoilt():
    mended = 0
    for seed in range(60):
        prospects = random_prospects(seed, candidates=9)
        first = greedy(prospects, 3, MeanVariance())
        better = exchanged(prospects, first, MeanVariance(), passes=5)
        best = min(variance(prospects, each) for each in combinations(range(9), 3))
        here, there = variance(prospects, first), variance(prospects, better)
        assert best * (1.0 - 1e-9) <= there <= here * (1.0 + 1e-9)
        mended += here > best * (1.0 + 1e-6) and there <= best * (1.0 + 1e-6)
    assert mended > 0


def test_cuts_that_may_not_both_be_made_are_not():
    close = np.abs(np.subtract.outer(np.arange(12), np.arange(12))) < 3
    prospects = random_prospects(3, apart=close)
    for order in (greedy(prospects, 12, MeanVariance()), exchanged(prospects, [0, 3, 6, 9], MeanVariance())):
        assert np.all(np.diff(np.sort(order)) >= 3)
    assert len(greedy(prospects, 12, Volume())) <= 4


def test_compressed_rows_tell_the_same():
    rng = np.random.default_rng(4)
    rows = rng.standard_normal((20, 3)) @ rng.standard_normal((3, 11))
    small = compressed(rows)
    assert small.shape == (3, 11)
    np.testing.assert_allclose(small.T @ small, rows.T @ rows, atol=1e-10)
    assert compressed(np.zeros((4, 11))).shape == (0, 11)


# what a cut's lines tell


def planned(shop, speeds_rpm, names=None, axes=(Dof.X, Dof.Y), depth=None, spread=(0.05, 0.1, 0.0, 0.0)):
    cuts = []
    for name in names or shop.toolings:
        cutter = shop.toolings[name].cutter
        for rpm in speeds_rpm:
            conditions = shop.machine.plan.conditions(rpm * np.pi / 30.0)
            conditions = replace(conditions, axial_depth=(depth or {}).get(rpm, conditions.axial_depth))
            orders = harmonics(cutter.teeth, conditions.spindle_speed)
            force, slope = force_and_slope(cutter, conditions, shop.machine.workpiece.coefficients, orders)
            cuts.append(expected_cut(f"{name}-{rpm}", name, conditions.spindle_speed, cutter.teeth, force, slope, NOISE, axes))
    return shop.prepare(cuts, spread=spread)


def posterior_of(layout, frequency_hz, seed, rivals=(), deviation=0.01, speed_range=(1400.0, 500.0)):
    theta = vector_of(Layout((layout,)), (frequency_hz,), seed)
    root = deviation * np.random.default_rng(seed).standard_normal((theta.size, theta.size)) / np.sqrt(theta.size)
    return Posterior(theta, root @ root.T, layout, speed_range, rivals)


@pytest.fixture(scope="module")
def posteriors():
    rival = machine_vector((700.0, 2500.0), 7)
    return {
        Dof.X: posterior_of(ModalBlock(3), (600.0, 1400.0, 2600.0), 1, (rival,)),
        Dof.Y: posterior_of(ModalBlock(2, softening=True), (800.0, 2100.0), 2),
    }


def invariants(matrix):
    """What does not depend on the axes that the unknowns are counted along."""
    return np.linalg.slogdet(np.eye(matrix.shape[0]) + matrix)[1], np.trace(matrix)


def test_information_is_the_dense_schur_complement_of_the_coupled_machines_own_slopes(shop, posteriors):
    data = planned(shop, [9000.0, 15500.0], names=["S1-ER32"])
    share = {Dof.X: 2e-3, Dof.Y: 1e-4}
    rows = information(data, posteriors, share)
    assembly = shop.toolings["S1-ER32"].assembly
    sizes = [p.theta.size + len(p.rivals) for p in posteriors.values()]
    size = sum(sizes) + len(data.coefficient_spread)
    for k, speed in enumerate(data.spindle_speed):
        # unknowns of both axes, of the force, and the delay; finite differences through modes and coupling
        total = np.zeros((size + 1, size + 1))
        scale = np.zeros((size, size))
        for i, axis in enumerate(data.axes):
            of, posterior = axis.of(axis.cut == k), posteriors[axis.axis]
            holder = tool_holder_receptance(assembly, of.omega, axis.axis)

            def cross(theta, axis=axis, posterior=posterior, holder=holder, speed=speed):
                modes, joint = posterior.machine(axis.axis, theta, speed)
                return couple(holder, modes.receptance(holder.omega), joint)["spindle", "tip"][:, 0, 0]

            value = cross(posterior.theta)
            columns = np.zeros((value.size, size + 1), dtype=complex)
            first, p = sum(sizes[:i]), posterior.theta.size
            for j in range(p):
                step = 1e-5 * np.eye(p)[j]
                columns[:, first + j] = (cross(posterior.theta + step) - cross(posterior.theta - step)) / 2e-5
            for j, rival in enumerate(posterior.rivals):
                columns[:, first + p + j] = cross(rival) - value
            columns[:, sum(sizes) : size] = value[:, None] * of.force_slope
            columns[:, size] = 1j * of.omega * value
            weight = 1.0 / (of.noise + 0.5 * max(share[axis.axis], 5e-4) ** 2 * np.abs(value) ** 2)
            total += np.real(columns.conj().T @ (weight[:, None] * columns))
            scale[first : first + p, first : first + p] = np.linalg.cholesky(posterior.covariance + 1e-18 * np.eye(p))
            scale[first + p : first + sizes[i], first + p : first + sizes[i]] = np.eye(len(posterior.rivals))
        scale[sum(sizes) :, sum(sizes) :] = np.diag(data.coefficient_spread)
        dense = total[:-1, :-1] - np.outer(total[:-1, -1], total[-1, :-1]) / total[-1, -1]
        np.testing.assert_allclose(invariants(rows[k].T @ rows[k]), invariants(scale.T @ dense @ scale), rtol=2e-5)


def test_information_is_that_of_the_misfit(shop):
    theta = machine_vector((600.0, 1400.0, 2600.0))
    data = planned(shop, np.linspace(8000.0, 20000.0, 6), axes=(Dof.X,))
    root = 0.02 * np.random.default_rng(3).standard_normal((theta.size, theta.size))
    posterior = Posterior(theta, root @ root.T, ModalBlock(3))
    rows = information(data, {Dof.X: posterior}, {Dof.X: 1e-3})
    layout = Layout((ModalBlock(3),), len(data.coefficient_spread))
    full = np.concatenate([theta, np.zeros(layout.coefficients)])
    nuisance = np.zeros((len(data.cut_ids), 2))
    model = Misfit(data, Priors(), (1e-3,)).evaluate(full, layout, nuisance).models[0]
    axis = replace(data.axes[0], lines=np.stack([model, 0.0 * model], axis=2))
    evaluation = Misfit(replace(data, axes=(axis,)), Priors(), (1e-3,)).evaluate(full, layout, nuisance, normal=True)
    told = evaluation.hessian - evaluation.linear.own.T @ evaluation.linear.own
    scale = np.zeros_like(told)
    scale[: theta.size, : theta.size], scale[theta.size :, theta.size :] = root, np.diag(data.coefficient_spread)
    np.testing.assert_allclose(invariants(sum(r.T @ r for r in rows)), invariants(scale.T @ told @ scale), rtol=1e-6)


def test_a_cut_without_depth_tells_nothing_and_comes_last(shop, posteriors):
    rows = information(planned(shop, [9000.0, 12000.0], depth={9000.0: 0.0}), posteriors, {Dof.X: 1e-3, Dof.Y: 1e-3})
    assert [len(r) > 0 for r in rows] == [False, True, False, True]
    prospects = CandidateCuts(rows, (np.eye(rows[0].shape[1]),), (0.0,), np.eye(4, dtype=bool))
    for goal in (MeanVariance(), Volume()):
        order = greedy(prospects, 4, goal)
        assert set(order[:2]) == {1, 3}
        bands = deviations(prospects, order)[:, 0]
        np.testing.assert_array_equal(bands[3:], bands[2])
        assert bands[2] < bands[1] < bands[0]


def test_deeper_cuts_tell_more_where_noise_is_what_limits(shop, posteriors):
    shallow, deep = (
        information(planned(shop, [12000.0], depth={12000.0: d}, spread=()), posteriors, {Dof.X: 0.0, Dof.Y: 0.0}) for d in (1e-6, 2e-6)
    )
    for one, two in zip(shallow, deep, strict=True):
        # far below the model's own error twice the force is four times the information, but for the helix
        assert np.sum(two**2) / np.sum(one**2) == pytest.approx(4.0, rel=1e-2)


def test_chosen_speeds_beat_even_and_random_ones(shop, posteriors):
    speeds = np.linspace(8000.0, 20000.0, 15)
    rows = tuple(compressed(r) for r in information(planned(shop, speeds), posteriors, {Dof.X: 1e-3, Dof.Y: 1e-3}))
    holder = tool_holder_receptance(shop.held_out.assembly, 2.0 * np.pi * np.linspace(600.0, 4000.0, 80))
    wanted, first = np.zeros((rows[0].shape[1], 320)), 0
    for i, posterior in enumerate(posteriors.values()):
        value, change = tip_changes(posterior, holder)
        wanted[first : first + change.shape[1], 160 * i : 160 * (i + 1)] = np.vstack([change.real, change.imag]).T / np.linalg.norm(value)
        first += change.shape[1]
    prospects = CandidateCuts(rows, (wanted,), (0.0,), np.eye(30, dtype=bool))
    chosen = exchanged(prospects, greedy(prospects, 6, MeanVariance()), MeanVariance())
    rng = np.random.default_rng(6)
    others = [[0, 7, 14, 15, 22, 29], *(rng.choice(30, 6, replace=False) for _ in range(200))]
    assert variance(prospects, chosen) < min(variance(prospects, each) for each in others)


def test_too_few_force_lines_are_refused():
    with pytest.raises(InputError, match="harmonics"):
        expected_cut("0", "T", 1000.0, 4, np.ones((2, 2)), np.ones((2, 2, 5)), NOISE, (Dof.X,))


# what is wanted


def test_the_tips_changes_are_those_of_the_bands(shop, posteriors):
    holder = tool_holder_receptance(shop.held_out.assembly, 2.0 * np.pi * np.linspace(500.0, 4000.0, 60))
    for posterior in posteriors.values():
        narrow = replace(posterior, covariance=1e-6 * posterior.covariance)

        def tip(modes, joint):
            return couple(holder, modes.receptance(holder.omega), joint)["tip", "tip"][:, 0, 0]

        values, change = tip_changes(narrow, holder)
        found = tip(*posterior.machine(Dof.X))
        # that one goes through complex modes and back
        np.testing.assert_allclose(values, found, rtol=0.0, atol=1e-8 * np.abs(found).max())
        spread = narrow.part(Dof.X).response(lambda candidate, tip=tip: tip(candidate.flange, candidate.joint))[1]
        expected = np.sum(np.abs(spread) ** 2, axis=0)
        np.testing.assert_allclose(np.sum(np.abs(change) ** 2, axis=1), expected, rtol=1e-5)


def test_the_expected_band_is_that_of_an_identification_which_made_the_cuts(few, shop):
    theta = machine_vector((600.0, 1400.0, 2600.0))
    data, _ = remade(few.only(Dof.X), theta, flange_layout(3), np.random.default_rng(8), noise=1e-2)
    axis = data.axes[0]
    # the first campaign has every second cut
    early = np.isin(axis.cut, np.arange(0, len(data.cut_ids), 2))
    holder = tool_holder_receptance(shop.held_out.assembly, 2.0 * np.pi * np.linspace(600.0, 4000.0, 60))

    def identified(part):
        misfit = Misfit(replace(data, axes=(part,)), Priors(), (5e-4,))
        solution = refine(misfit, theta, flange_layout(3), np.zeros((len(data.cut_ids), 2)), 100, grid=32)
        return Posterior(solution.theta, np.linalg.inv(solution.evaluation.hessian), ModalBlock(3))

    first, second = identified(axis.of(early)), identified(axis)
    rows = information(replace(data, axes=(axis.of(~early),)), {Dof.X: first}, {Dof.X: 5e-4})
    value, change = tip_changes(first, holder)
    wanted = np.vstack([change.real, change.imag]).T / np.linalg.norm(value)
    prospects = CandidateCuts(rows, (wanted,), (0.0,), np.eye(len(rows), dtype=bool))
    before, after = deviations(prospects, range(len(rows)))[[0, -1], 0]
    value, change = tip_changes(second, holder)
    found = np.linalg.norm(change) / np.linalg.norm(value)
    assert after < 0.9 * before
    assert after == pytest.approx(found, rel=0.15)
