"""Adaptive importance sampling beside closed forms and beside emcee."""

from __future__ import annotations

import emcee
import numpy as np
import pytest
from scipy.special import log_expit

from rcsa_ident.stability.labels.adaptive_importance import _gentle, adaptive_importance, systematic

#: A Gaussian likelihood of eight unknowns, of which it tells four.
CENTRE, PRECISION = np.array([1.0, -1.0, 0.5, 0, 0, 0, 0, 0]), np.array([9.0, 9.0, 4.0, 1.0, 0, 0, 0, 0])


def gaussian(z):
    return -0.5 * np.sum(PRECISION * (z - CENTRE) ** 2, axis=1)


def sampled(log_likelihood, size, seed, first=1500, further=700, rounds=4):
    rng = np.random.default_rng(seed)
    return adaptive_importance(log_likelihood, rng.standard_normal((first, size)), rng, further, rounds)


def test_a_gaussian_posterior_and_its_evidence_are_those_of_the_closed_form():
    """Means of twelve runs: weights by the mixture of all rounds, which are biased, are 0.2 off in the evidence here."""
    runs = [sampled(gaussian, 8, seed) for seed in range(12)]
    evidence = np.array([run.log_evidence for run in runs])
    exact = np.sum(-0.5 * np.log1p(PRECISION) - 0.5 * CENTRE**2 * PRECISION / (1.0 + PRECISION))
    assert evidence.mean() == pytest.approx(exact, abs=3.5 * evidence.std() / np.sqrt(12) + 0.02)
    assert evidence.std() < 0.15
    means = np.array([run.weight @ run.z for run in runs])
    assert means.mean(axis=0) == pytest.approx(CENTRE * PRECISION / (1.0 + PRECISION), abs=0.05)
    spread = np.sqrt(np.mean([run.weight @ (run.z - mean) ** 2 for run, mean in zip(runs, means, strict=True)], axis=0))
    assert spread == pytest.approx(1.0 / np.sqrt(1.0 + PRECISION), rel=0.07)
    # a round from the prior alone has far fewer effective draws for as many likelihoods
    plain = sampled(gaussian, 8, 1, first=4300, rounds=0)
    assert np.median([run.effective for run in runs]) > 2.0 * plain.effective


def test_two_separate_maxima_keep_their_shares():
    """Likelihood of +2 and of -2 alike but for a factor of three."""

    def two(z):
        return np.logaddexp(np.log(0.75) - 0.5 * ((z[:, 0] - 2.0) / 0.2) ** 2, np.log(0.25) - 0.5 * ((z[:, 0] + 2.0) / 0.2) ** 2)

    shares = [run.weight @ (run.z[:, 0] > 0.0) for run in (sampled(two, 3, seed) for seed in range(8))]
    assert np.mean(shares) == pytest.approx(0.75, abs=0.05)


def test_a_bent_posterior_beside_emcee():
    """Labels of a limit that hangs on a product of two unknowns: no Gaussian."""
    depth, chatter = np.array([-1.0, -0.3, 0.2, 0.5, 1.2]), np.array([False, False, True, False, True])

    def log_likelihood(z):
        limit = z[:, 0] + 0.8 * z[:, 0] * z[:, 1] + 0.3 * z[:, 1] ** 2
        margin = (depth - limit[:, None]) / 0.15
        return np.sum(log_expit(np.where(chatter, margin, -margin)), axis=1)

    found = sampled(log_likelihood, 2, 3, rounds=5)
    chains = emcee.EnsembleSampler(40, 2, lambda z: log_likelihood(z) - 0.5 * np.sum(z**2, axis=1), vectorize=True)
    chains._random = np.random.RandomState(4)
    chains.run_mcmc(np.random.default_rng(4).standard_normal((40, 2)), 3000)
    kept = chains.get_chain(discard=500, flat=True)
    assert found.weight @ found.z == pytest.approx(kept.mean(axis=0), abs=0.08)
    second = found.weight @ found.z**2, found.weight @ np.prod(found.z, axis=1)
    assert second[0] == pytest.approx(np.mean(kept**2, axis=0), abs=0.15)
    assert second[1] == pytest.approx(np.mean(np.prod(kept, axis=1)), abs=0.12)


def test_the_same_generator_gives_the_same_draws():
    one, two = sampled(gaussian, 8, 5), sampled(gaussian, 8, 5)
    assert np.array_equal(one.z, two.z)
    assert np.array_equal(one.weight, two.weight)
    assert one.weight.sum() == pytest.approx(1.0)


def test_systematic_resampling_takes_each_as_often_as_its_share_says():
    weight = np.array([0.05, 0.5, 0.2, 0.25])
    count = np.bincount(systematic(weight, 40, np.random.default_rng(1)), minlength=4)
    assert np.all(np.abs(count - 40 * weight) <= 1)


def test_weights_of_few_draws_are_raised_to_a_power_until_enough_count():
    """Enough as they are: none is changed. Too few: as many as are asked for, in the same order."""
    even, steep = np.full(40, 1.0 / 40.0), np.exp(-np.arange(40.0))
    assert np.array_equal(_gentle(even, 16.0), even)
    found = _gentle(steep / steep.sum(), 16.0)
    assert 16.0 <= 1.0 / np.sum(found**2) < 24.0
    assert np.all(np.diff(found) < 0.0)
