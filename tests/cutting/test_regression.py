"""Cluster-robust covariance: closed forms of simple designs, and intervals that hold what they say."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from rcsa_ident.cutting.regression import cluster_covariance, student_quantile


def fit(design, observed, cluster):
    solution = np.linalg.lstsq(design, observed)[0]
    return solution, *cluster_covariance(design, observed - design @ solution, cluster)


def test_a_mean_of_single_observations():
    """Each its own cluster: the textbook's s^2 / n with n - 1 degrees of freedom."""
    values = np.random.default_rng(1).normal(size=9)
    _, covariance, dof = fit(np.ones((9, 1)), values, np.arange(9))
    np.testing.assert_allclose(covariance[0, 0], values.var(ddof=1) / 9, rtol=1e-12)
    np.testing.assert_allclose(dof, 8.0, rtol=1e-12)


def test_a_mean_of_equal_clusters():
    """Only the clusters' means count, however much the members go together."""
    rng = np.random.default_rng(2)
    values = (rng.normal(size=(6, 1)) + 0.01 * rng.normal(size=(6, 50))).ravel()
    _, covariance, dof = fit(np.ones((300, 1)), values, np.repeat(np.arange(6), 50))
    means = values.reshape(6, 50).mean(axis=1)
    np.testing.assert_allclose(covariance[0, 0], means.var(ddof=1) / 6, rtol=1e-12)
    np.testing.assert_allclose(dof, 5.0, rtol=1e-12)


def test_single_observations_give_hc2():
    """The heteroscedastic-robust covariance with leverage, by its textbook formula."""
    rng = np.random.default_rng(3)
    design = np.stack([np.ones(12), rng.normal(size=12)], axis=1)
    observed = rng.normal(size=12)
    solution, covariance, _ = fit(design, observed, np.arange(12))
    bread = np.linalg.inv(design.T @ design)
    leverage = np.einsum("ni,ij,nj->n", design, bread, design)
    left = observed - design @ solution
    expected = bread @ (design.T * (left**2 / (1.0 - leverage))) @ design @ bread
    np.testing.assert_allclose(covariance, expected, rtol=1e-10)


@pytest.mark.slow
def test_exact_in_the_mean_for_equal_errors():
    rng = np.random.default_rng(4)
    design = np.stack([np.ones(20), np.linspace(0.0, 1.0, 20)], axis=1)
    cluster = np.repeat(np.arange(5), 4)
    mean = np.mean([fit(design, rng.normal(size=20), cluster)[1] for _ in range(3000)], axis=0)
    np.testing.assert_allclose(mean, np.linalg.inv(design.T @ design), rtol=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("uneven", [0.0, 1.0])
def test_intervals_hold(uneven):
    """Five clusters of two, errors of a cluster alike, large where the regressor is: 95 % intervals hold 93 % or more."""
    rng = np.random.default_rng(5)
    feed = np.repeat([0.04, 0.06, 0.08, 0.1, 0.12], 2)
    design = np.stack([np.ones(10), feed], axis=1)
    cluster = np.repeat(np.arange(5), 2)
    hits, draws = np.zeros(2), 2000
    for _ in range(draws):
        size = 1.0 + uneven * 30.0 * (feed - 0.04)
        error = size * (np.repeat(rng.normal(size=5), 2) + 0.5 * rng.normal(size=10))
        solution, covariance, dof = fit(design, error, cluster)
        hits += np.abs(solution) <= student_quantile(dof) * np.sqrt(np.diag(covariance))
    assert np.all(hits / draws > 0.93)
    assert np.all(hits / draws < 0.995)


def test_quantile():
    np.testing.assert_allclose(student_quantile(np.array([2.0, 7.3])), scipy.stats.t.ppf(0.975, [2.0, 7.3]), rtol=1e-9)


def test_a_cluster_that_decides_alone():
    """A parameter that one cluster alone determines has no scatter: finite, and of no degrees of freedom to speak of."""
    design = np.zeros((7, 2))
    design[:6, 0], design[6, 1] = 1.0, 1.0
    _, covariance, dof = fit(design, np.arange(7.0), np.arange(7))
    assert np.all(np.isfinite(covariance))
    assert covariance[1, 1] < 1e-12
    assert dof[0] == pytest.approx(5.0)
