from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.misfit import DELAY_UNIT, Misfit, Residual
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.rough_data import with_distances
from rcsa_ident.identification.unknowns import Layout, ModalBlock, flange_layout
from tests.identification.models import vector_of

FREQUENCIES = ((600.0, 1400.0, 2500.0), (900.0, 2100.0))
SHARES = (0.02, 0.05)
KINDS = ("plain", "all", "rough")


class Case:
    """A misfit, a vector, and its evaluation where the cuts' own fits have come to rest."""

    def __init__(self, data, layout, kind):
        self.kind, self.layout = kind, layout
        weight = np.ones(len(data.cut_ids))
        weight[2] = 0.3
        self.misfit = Misfit(data, Priors(), SHARES, weight if kind == "all" else None)
        self.theta = vector_of(layout, FREQUENCIES)
        if data.rough is not None:
            # clearly other contacts, sections and lengths than drawn, and edge forces of another size
            place = layout.force.start + np.arange(data.rough_place.start, data.rough_place.stop)
            self.theta[place] = np.random.default_rng(4).uniform(-1.0, 1.0, place.size)
            self.theta[layout.force.start + 2] = 0.6
        rough = self.misfit.evaluate(self.theta, layout, np.zeros((len(data.cut_ids), 2)), grid=64)
        # the cuts' own fits go on until nothing moves: only there is the profiled cost smooth
        for _ in range(20):
            rough = self.misfit.evaluate(self.theta, layout, rough.nuisance)
        self.here = self.misfit.evaluate(self.theta, layout, rough.nuisance, normal=True)
        self.jacobian = dense(self.misfit, self.theta, layout, self.here.nuisance)


def flat(residual):
    return np.concatenate([*residual.lines, residual.own, residual.cuts.ravel()])


def dense(misfit, theta, layout, nuisance):
    """Jacobian of every residual by every parameter and every cut's unknown, by central differences."""
    size, cuts = theta.size, nuisance.size
    unit = np.tile([DELAY_UNIT, 1.0], cuts // 2)
    columns = []
    for k in range(size + cuts):
        step = np.zeros(size + cuts)
        step[k] = 1e-5 if k < size else 1e-4
        ahead, behind = (
            flat(misfit.residual_at(theta + s[:size], layout, nuisance + (s[size:] * unit).reshape(-1, 2))) for s in (step, -step)
        )
        columns.append((ahead - behind) / (2.0 * step[k]))
    return np.array(columns).T


@pytest.fixture(scope="module", params=KINDS)
def case(request, few, rich, rough):
    if request.param == "plain":
        return Case(few, flange_layout(3, 2), "plain")
    # one sensor looks behind the flange, one at the holder, and nobody knows where exactly
    data = with_distances(rich, np.array([0.03, -0.02]), np.array([0.02, 0.005])) if request.param == "all" else rough
    layout = Layout((ModalBlock(3, 1, True), ModalBlock(2, 1, True)), len(data.coefficient_spread), data.clampings)
    return Case(data, layout, request.param)


def test_the_case_of_everything_has_everything(rich):
    assert all(a.outputs == 2 for a in rich.axes)
    assert rich.clampings == 2
    assert len(rich.coefficient_spread) == 2 + 2 + 2 * 2 * 2 * 2  # K_tc and k_rc, run-outs, smooth errors
    assert np.abs(rich.relative_speed).max() == pytest.approx(1.0)


def test_cost_is_all_residuals(case):
    residual = case.misfit.residual_at(case.theta, case.layout, case.here.nuisance)
    assert case.here.cost == pytest.approx(flat(residual) @ flat(residual), rel=1e-12)
    for chi2, lines in zip(case.here.chi2, case.here.residual.lines, strict=True):
        assert chi2 == pytest.approx(np.sum(lines**2), rel=1e-12)
    assert case.misfit.points == sum(2 * a.variance.size for a in case.misfit.data.axes)
    assert sum(r.size for r in residual.lines) == case.misfit.points


def test_residual_from_its_definition(case):
    """Line by line and cut by cut, from the models alone."""
    data, misfit, here = case.misfit.data, case.misfit, case.here
    middle, half = data.speed_range
    assert (data.spindle_speed.min(), data.spindle_speed.max()) == pytest.approx((middle - half, middle + half))
    for i, axis in enumerate(data.axes):
        found = here.residual.lines[i].reshape(2, -1, axis.outputs)
        weight = misfit.weight(i)
        for f in range(0, axis.omega.size, 7):
            delay, angle = here.nuisance[axis.cut[f]]
            for o in range(axis.outputs):
                cut, air = axis.lines[f, o]
                if data.talk_place:
                    share = case.theta[case.layout.force][data.talk_place[axis.axis]]
                    cut, air = np.array([cut, air]) - share * axis.talk[f, o]
                turned = (cut - air * np.exp(1j * axis.order[f] * angle)) * np.exp(1j * axis.omega[f] * delay)
                rest = turned - here.models[i][f, o]
                total = axis.variance[f, o] + 0.5 * SHARES[i] ** 2 * axis.power[f, o]
                assert weight[f, o] == pytest.approx(misfit.cut_weight[axis.cut[f]] / total, rel=1e-9)
                expected = np.sqrt(weight[f, o]) * rest
                np.testing.assert_allclose(found[:, f, o], [expected.real, expected.imag], rtol=1e-7, atol=1e-9 * abs(expected))
    for k in range(len(data.cut_ids)):
        delay, angle = here.nuisance[k]
        assert here.residual.cuts[k, 1] == pytest.approx(np.sqrt(data.cut_prior.angle_weight[k]) * angle, rel=1e-9)
        expected = 0.0
        if case.kind == "all":
            tooth = case.theta[case.layout.clamping][data.clamping[k]]
            expected = (delay - data.edge[k, 0] - tooth / data.spindle_speed[k]) * np.sqrt(data.edge[k, 1])
        assert here.residual.cuts[k, 0] == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_scales_of_the_force_are_factors_of_the_lines(case):
    if not case.layout.coefficients:
        return
    without = np.array(case.theta)
    kept = case.layout.force.start + np.arange(case.misfit.data.rough_place.start, case.misfit.data.rough_place.stop)
    # where a sensor looks is no factor
    kept = np.append(kept, [case.layout.force.start + place for place in case.misfit.data.distance_place.values()]).astype(int)
    without[np.setdiff1d(np.arange(case.layout.force.start, case.layout.force.stop), kept)] = 0.0
    plainly = case.misfit.evaluate(without, case.layout, case.here.nuisance).models
    for axis, model, bare in zip(case.misfit.data.axes, case.here.models, plainly, strict=True):
        logs = np.array(case.theta[case.layout.force])
        slope, factor = axis.force_slope, 1.0
        if case.kind == "rough":
            # chips and edges add up: K_tc e^t (U_1 + k_rc e^r U_2) + K_te e^p U_3 + K_re e^q U_4, whose shares the slopes are
            chip, ratio, edges = slope[:, 0], slope[:, 1], slope[:, 2:4]
            t, r, *of_edges = np.exp(logs[:4])
            factor, logs[:4] = t * (chip - ratio + ratio * r) + edges @ of_edges, 0.0
            place = case.misfit.data.rough_place
            assert not np.any(slope[:, place])
        np.testing.assert_allclose(model, (factor * np.exp(slope @ logs))[:, None] * bare, rtol=1e-10)


def test_where_a_sensor_looks_is_what_was_told_and_what_is_left_of_it(rich):
    data = with_distances(rich, np.array([0.03, -0.02]), np.array([0.02, 0.0]))
    count = len(rich.coefficient_spread)
    assert data.distance_place == {Dof.X: count, Dof.Y: count + 1}
    # of one that is told as exact next to nothing is left
    assert data.coefficient_spread[count:] == pytest.approx((0.2, 1e-4))
    misfit = Misfit(data, Priors(), SHARES)
    layout = Layout((ModalBlock(3, 1), ModalBlock(2, 1)), count + 2, data.clampings)
    theta = vector_of(layout, FREQUENCIES)
    theta[layout.force][count:] = [-0.1, 0.01]
    np.testing.assert_allclose([misfit.seen_at(i, theta, layout) for i in (0, 1)], [[0.2, 0.0], [-0.19, 1.0]])
    # a search that has no such unknown believes what was told
    plain = Layout(layout.axes, 0, 0)
    np.testing.assert_allclose(misfit.seen_at(0, np.zeros(plain.size), plain), [0.3, 0.0])


def test_gradient_is_the_dense_one_with_the_cuts_eliminated(case):
    size, rest = case.theta.size, flat(case.here.residual)
    own, cuts = case.jacobian[:, :size], case.jacobian[:, size:]
    expected = own.T @ (rest - cuts @ np.linalg.lstsq(cuts, rest, rcond=None)[0])
    np.testing.assert_allclose(case.here.linear.gradient, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


def test_gradient_of_the_profiled_cost(case):
    if case.kind == "rough":
        # its cuts' own fits end a part in 1e10 of a large cost away from rest: more than such differences may be off
        return

    # delays and angles follow: fits in a row for each shifted vector
    def cost(vector):
        nuisance = case.here.nuisance
        for _ in range(6):
            evaluation = case.misfit.evaluate(vector, case.layout, nuisance)
            nuisance = evaluation.nuisance
        return evaluation.cost

    differences = []
    for k in range(case.theta.size):
        step = np.zeros(case.theta.size)
        step[k] = 1e-5
        differences.append((cost(case.theta + step) - cost(case.theta - step)) / 4e-5)  # of half the cost
    error = np.abs(case.here.linear.gradient - differences)
    assert np.all(error < 1e-4 * np.abs(differences) + 1e-6 * np.abs(differences).max())


def test_hessian_is_the_dense_one_with_the_cuts_eliminated(case):
    size = case.theta.size
    square = case.jacobian.T @ case.jacobian
    inner = square[size:, size:]
    expected = square[:size, :size] - square[:size, size:] @ np.linalg.solve(inner, square[size:, :size])
    scale = np.sqrt(np.diag(expected))
    assert np.abs((case.here.hessian - expected) / np.outer(scale, scale)).max() < 1e-5


def test_push_and_follow_are_the_dense_ones(case):
    rng = np.random.default_rng(1)
    step = rng.standard_normal(case.theta.size)
    size = case.theta.size
    square = case.jacobian.T @ case.jacobian
    cuts = -np.linalg.solve(square[size:, size:], square[size:, :size] @ step).reshape(-1, 2)
    np.testing.assert_allclose(case.here.linear.follow(step), cuts, rtol=1e-4, atol=1e-5 * np.abs(cuts).max())
    pushed = flat(case.here.linear.push(step, cuts))
    expected = case.jacobian @ np.concatenate([step, cuts.ravel()])
    assert np.linalg.norm(pushed - expected) < 1e-6 * np.linalg.norm(expected)


def random_residual(case, rng):
    lines = tuple(rng.standard_normal(r.size) for r in case.here.residual.lines)
    return Residual(lines, rng.standard_normal(case.theta.size), rng.standard_normal(case.here.nuisance.shape))


def test_push_and_pull_are_adjoint(case):
    rng = np.random.default_rng(2)
    step = rng.standard_normal(case.theta.size)
    other = random_residual(case, rng)
    linear = case.here.linear
    pushed = linear.push(step, linear.follow(step))
    assert flat(pushed) @ flat(other) == pytest.approx(step @ linear.pull(other), rel=1e-9)
    # and the Hessian is one after the other
    expected = case.here.hessian @ step
    np.testing.assert_allclose(linear.pull(pushed), expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("i", [0, 1])
def test_border_is_that_of_the_dense_augmented_problem(case, i):
    """Further unknowns of one axis beside all others: normal equations of everything, the cuts' unknowns eliminated."""
    rng = np.random.default_rng(3)
    lines = case.here.residual.lines
    rows = rng.standard_normal((lines[i].size, 6))
    residual = random_residual(case, rng)
    before = sum(r.size for r in lines[:i])
    more = np.zeros((case.jacobian.shape[0], 6))
    more[before : before + lines[i].size] = rows
    size = case.theta.size
    whole = np.hstack([case.jacobian[:, :size], more])
    cuts = case.jacobian[:, size:]
    # projection on what the cuts' unknowns cannot reach
    whole = whole - cuts @ np.linalg.lstsq(cuts, whole, rcond=None)[0]
    square, slope = whole.T @ whole, whole.T @ flat(residual)
    gradient, own, mixed = case.here.linear.border({i: rows}, 3, residual)
    scale = np.sqrt(np.diag(square))
    np.testing.assert_allclose(gradient, slope[size:], atol=1e-5 * np.abs(slope[size:]).max())
    for k in range(2):
        place = slice(size + 3 * k, size + 3 * k + 3)
        np.testing.assert_allclose(own[k], square[place, place], atol=1e-6 * scale[place].max() ** 2)
    assert np.abs((mixed - square[:size, size:]) / np.outer(scale[:size], scale[size:])).max() < 1e-6


def test_compliance_is_the_change_with_the_flange(case):
    """What `model_order.more` puts a new mode on: d residual / d (tt, tr, rr) of the flange's receptance."""
    layout = case.layout.axes[0]
    first = case.layout.axis(0).start + layout.core - 3
    axis_factor = case.theta[first : first + 3] * np.sqrt(1e-9)
    a, b, c = axis_factor
    turn = np.array([[2.0 * a, 0.0, 0.0], [b, a, 0.0], [0.0, 2.0 * b, 2.0 * c]])
    for k in range(3):
        step = np.zeros(case.theta.size)
        step[first + k] = 1e-5
        ahead, behind = (case.misfit.evaluate(case.theta + s, case.layout, case.here.nuisance).models[0] for s in (step, -step))
        difference = -case.misfit.root_weight(0) * ((ahead - behind) / 2e-5).ravel()
        expected = case.here.linear.compliance[0] @ turn[:, k] * np.sqrt(1e-9)
        np.testing.assert_allclose(expected, difference, atol=1e-6 * np.abs(difference).max())


def test_residuals_add_and_scale(case):
    one = case.misfit.residual_at(case.theta, case.layout, case.here.nuisance)
    np.testing.assert_allclose(flat(one.minus(one.times(0.25), 2.0)), 0.5 * flat(one), rtol=1e-12)


def test_delay_std_is_that_of_the_joint_covariance(case):
    """Delays from the inverse of everything's normal matrix; and with the parameters held fast, each cut's own."""
    size = case.theta.size
    square = case.jacobian.T @ case.jacobian
    scale = np.sqrt(np.diag(square))
    covariance = np.linalg.inv(square / np.outer(scale, scale)) / np.outer(scale, scale)
    expected = np.sqrt(np.diag(covariance)[size::2]) * DELAY_UNIT
    np.testing.assert_allclose(case.here.linear.delay_std(np.linalg.inv(case.here.hessian)), expected, rtol=1e-4)
    alone = np.sqrt(np.diag(np.linalg.inv(square[size:, size:]))[::2]) * DELAY_UNIT
    np.testing.assert_allclose(case.here.linear.delay_std(np.zeros((size, size))), alone, rtol=1e-4)
    assert np.all(expected > alone)


def test_evaluation_leaves_the_given_nuisance_alone(case):
    nuisance = np.zeros_like(case.here.nuisance)
    case.misfit.evaluate(case.theta, case.layout, nuisance, grid=8)
    np.testing.assert_array_equal(nuisance, 0.0)


def test_without_delay_is_the_model_plus_its_residual(case):
    for i, axis in enumerate(case.misfit.data.axes):
        rest = case.here.residual.lines[i].reshape(2, -1, axis.outputs)
        left = (rest[0] + 1j * rest[1]) / np.sqrt(case.misfit.weight(i))
        expected = np.sum(case.here.models[i] + left, axis=1)
        found = case.misfit.without_delay(i, case.theta, case.layout, case.here.nuisance)
        np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_two_outputs_add_up_to_the_model_of_one(rich):
    layout = Layout((ModalBlock(3, 1), ModalBlock(2, 1)))
    theta = vector_of(layout, FREQUENCIES)
    nuisance = np.zeros((len(rich.cut_ids), 2))
    both = Misfit(rich, Priors(), SHARES).evaluate(theta, layout, nuisance).models
    parts = [theta[layout.axis(i)][: layout.axes[i].core] for i in range(2)]
    one = (
        Misfit(rich.summed(), Priors(), SHARES)
        .evaluate(np.concatenate([*parts, theta[layout.joint]]), flange_layout(3, 2), nuisance)
        .models
    )
    for two, single in zip(both, one, strict=True):
        np.testing.assert_allclose(two.sum(axis=1), single[:, 0], rtol=1e-9)


def test_a_cut_that_one_axis_did_not_see(few):
    theta = vector_of(flange_layout(3, 2), FREQUENCIES)
    x, y = few.axes
    data = replace(few, axes=(x, y.of(y.cut != 2)))
    alone = Misfit(data.only(Dof.Y), Priors(), (0.02,))
    vector = theta[flange_layout(3).axis(0).stop :]
    found = alone.evaluate(vector, flange_layout(2), np.zeros((len(data.cut_ids), 2)), grid=16, normal=True)
    assert np.all(np.isfinite(found.hessian))
    assert np.all(np.isfinite(found.linear.gradient))
    np.testing.assert_array_equal(found.linear.follow(np.ones(vector.size))[2], 0.0)
    # nothing is known of its delay but the period
    std = found.linear.delay_std(np.linalg.inv(found.hessian))
    assert std[2] == pytest.approx(data.cut_prior.tooth_period[2] / np.sqrt(12.0))
    rows = np.random.default_rng(1).standard_normal((found.residual.lines[0].size, 3))
    assert all(np.all(np.isfinite(part)) for part in found.linear.border({0: rows}, 3, found.residual))
    both = Misfit(data, Priors(), SHARES).evaluate(theta, flange_layout(3, 2), np.zeros((len(data.cut_ids), 2)), grid=16, normal=True)
    assert np.all(np.isfinite(both.hessian))


def test_a_line_of_nothing_without_noise_keeps_its_place(few):
    axis = few.axes[0]
    lines = np.array(axis.lines)
    lines[3] = 0.0
    data = replace(few.only(Dof.X), axes=(replace(axis, lines=lines, variance=np.zeros_like(axis.variance)),))
    theta = vector_of(flange_layout(3), FREQUENCIES[:1])
    found = Misfit(data, Priors(), (0.02,)).evaluate(theta, flange_layout(3), np.zeros((len(data.cut_ids), 2)), 16)
    assert np.isfinite(found.cost)


def test_a_cut_that_counts_less(few):
    theta, layout = vector_of(flange_layout(3, 2), FREQUENCIES), flange_layout(3, 2)
    weight = np.ones(len(few.cut_ids))
    weight[4] = 0.01
    nuisance = np.zeros((len(few.cut_ids), 2))
    plainly, less = (Misfit(few, Priors(), SHARES, w).residual_at(theta, layout, nuisance) for w in (None, weight))
    for axis, a, b in zip(few.axes, plainly.lines, less.lines, strict=True):
        mine = np.tile(axis.cut == 4, 2)
        np.testing.assert_allclose(b[mine], 0.1 * a[mine], rtol=1e-12)
        np.testing.assert_array_equal(b[~mine], a[~mine])
