from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.misfit import DELAY_UNIT, Misfit, Residual
from rcsa_ident.identification.parameters import axis_size
from rcsa_ident.identification.priors import Priors
from tests.identification.conftest import machine_vector

ORDERS = (3, 2)
SHARES = (0.02, 0.05)


@pytest.fixture(scope="module")
def misfit(few):
    return Misfit(few, Priors(), SHARES)


@pytest.fixture(scope="module")
def theta():
    x, y = machine_vector((600.0, 1400.0, 2500.0), 1), machine_vector((900.0, 2100.0), 2)
    return np.concatenate([x[:-4], y])


@pytest.fixture(scope="module")
def here(misfit, theta):
    rough = misfit.evaluate(theta, ORDERS, np.zeros((len(misfit.data.cut_ids), 2)), grid=64)
    # the cuts' own fits go on until nothing moves: only there is the profiled cost smooth
    for _ in range(20):
        rough = misfit.evaluate(theta, ORDERS, rough.nuisance)
    return misfit.evaluate(theta, ORDERS, rough.nuisance, normal=True)


def flat(residual, cuts=True):
    parts = [p for r in residual.lines for p in (r.real, r.imag)] + [residual.own]
    return np.concatenate([*parts, residual.cuts.ravel()] if cuts else parts)


def dense(misfit, theta, nuisance):
    """Jacobian of every residual by every parameter and every cut's unknown, by central differences."""
    size, cuts = theta.size, nuisance.size
    unit = np.tile([DELAY_UNIT, 1.0], cuts // 2)
    columns = []
    for k in range(size + cuts):
        step = np.zeros(size + cuts)
        step[k] = 1e-5 if k < size else 1e-4
        ahead, behind = (
            flat(misfit.residual_at(theta + s[:size], ORDERS, nuisance + (s[size:] * unit).reshape(-1, 2))) for s in (step, -step)
        )
        columns.append((ahead - behind) / (2.0 * step[k]))
    return np.array(columns).T


@pytest.fixture(scope="module")
def jacobian(misfit, theta, here):
    return dense(misfit, theta, here.nuisance)


def test_cost_is_all_residuals(misfit, theta, here):
    residual = misfit.residual_at(theta, ORDERS, here.nuisance)
    assert here.cost == pytest.approx(flat(residual) @ flat(residual), rel=1e-12)
    for chi2, lines in zip(here.chi2, here.residual.lines, strict=True):
        assert chi2 == pytest.approx(np.sum(np.abs(lines) ** 2), rel=1e-12)
    assert misfit.points == 2 * sum(a.omega.size for a in misfit.data.axes)


def test_gradient_of_the_profiled_cost(misfit, theta, here):
    # delays and angles follow: 20 fits in a row for each shifted vector
    def cost(vector):
        nuisance = here.nuisance
        for _ in range(20):
            evaluation = misfit.evaluate(vector, ORDERS, nuisance)
            nuisance = evaluation.nuisance
        return evaluation.cost

    differences = []
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = 1e-5
        differences.append((cost(theta + step) - cost(theta - step)) / 4e-5)  # of half the cost
    error = np.abs(here.linear.gradient - differences)
    assert np.all(error < 1e-4 * np.abs(differences) + 1e-6 * np.abs(differences).max())


def test_hessian_is_the_dense_one_with_the_cuts_eliminated(theta, here, jacobian):
    size = theta.size
    square = jacobian.T @ jacobian
    inner = square[size:, size:]
    expected = square[:size, :size] - square[:size, size:] @ np.linalg.solve(inner, square[size:, :size])
    scale = np.sqrt(np.diag(expected))
    assert np.abs((here.hessian - expected) / np.outer(scale, scale)).max() < 1e-5


def test_push_and_follow_are_the_dense_ones(misfit, theta, here, jacobian):
    rng = np.random.default_rng(1)
    step = rng.standard_normal(theta.size)
    size = theta.size
    square = jacobian.T @ jacobian
    cuts = -np.linalg.solve(square[size:, size:], square[size:, :size] @ step).reshape(-1, 2)
    np.testing.assert_allclose(here.linear.follow(step), cuts, rtol=1e-4, atol=1e-5 * np.abs(cuts).max())
    pushed = flat(here.linear.push(step, cuts))
    expected = jacobian @ np.concatenate([step, cuts.ravel()])
    assert np.linalg.norm(pushed - expected) < 1e-6 * np.linalg.norm(expected)


def test_push_and_pull_are_adjoint(misfit, theta, here):
    rng = np.random.default_rng(2)
    step = rng.standard_normal(theta.size)
    lines = tuple(rng.standard_normal(a.omega.size) + 1j * rng.standard_normal(a.omega.size) for a in misfit.data.axes)
    other = Residual(lines, rng.standard_normal(theta.size), rng.standard_normal(here.nuisance.shape))
    pushed = here.linear.push(step, here.linear.follow(step))
    assert flat(pushed) @ flat(other) == pytest.approx(step @ here.linear.pull(other), rel=1e-9)
    # and the Hessian is one after the other
    np.testing.assert_allclose(here.linear.pull(pushed), here.hessian @ step, rtol=1e-7, atol=1e-9 * np.abs(here.hessian @ step).max())


def test_residuals_add_and_scale(misfit, theta, here):
    one = misfit.residual_at(theta, ORDERS, here.nuisance)
    np.testing.assert_allclose(flat(one.minus(one.times(0.25), 2.0)), 0.5 * flat(one), rtol=1e-12)


def test_delay_std_is_that_of_the_cuts_own_fit(misfit, theta, here, jacobian):
    inner = (jacobian.T @ jacobian)[theta.size :, theta.size :]
    expected = np.sqrt(np.diag(np.linalg.inv(inner))[::2]) * DELAY_UNIT
    np.testing.assert_allclose(misfit.delay_std(here.nuisance), expected, rtol=1e-4)


def test_a_cut_that_one_axis_did_not_see(few, theta):
    x, y = few.axes
    keep = y.cut != 2
    fields = {name: getattr(y, name)[keep] for name in ("omega", "order", "variance", "lines", "cut", "flange", "tip")}
    data = replace(few, axes=(x, replace(y, **fields)))
    alone = Misfit(data.only(Dof.Y), Priors(), (0.02,))
    vector = theta[axis_size(3) :]
    found = alone.evaluate(vector, (2,), np.zeros((len(data.cut_ids), 2)), grid=16, normal=True)
    assert np.all(np.isfinite(found.hessian))
    assert np.all(np.isfinite(found.linear.gradient))
    np.testing.assert_array_equal(found.linear.follow(np.ones(vector.size))[2], 0.0)
    # nothing is known of its delay but the period
    std = alone.delay_std(found.nuisance)
    assert std[2] == pytest.approx(data.cut_prior[2, 3] / np.sqrt(12.0))
    assert np.all(std[np.arange(std.size) != 2] < 0.1 * std[2])
    both = Misfit(data, Priors(), SHARES).evaluate(theta, ORDERS, np.zeros((len(data.cut_ids), 2)), grid=16, normal=True)
    assert np.all(np.isfinite(both.hessian))


def test_a_line_of_nothing_without_noise_keeps_its_place(few, theta):
    axis = few.axes[0]
    lines = np.array(axis.lines)
    lines[3] = 0.0
    data = replace(few.only(Dof.X), axes=(replace(axis, lines=lines, variance=np.zeros(axis.omega.size)),))
    found = Misfit(data, Priors(), (0.02,)).evaluate(
        np.concatenate([theta[: axis_size(3)], theta[-4:]]), (3,), np.zeros((len(data.cut_ids), 2)), 16
    )
    assert np.isfinite(found.cost)
