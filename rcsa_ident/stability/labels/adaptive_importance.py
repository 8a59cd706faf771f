"""Posterior of a few unknowns by importance sampling that learns where to draw, without gradients and without chains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from rcsa_ident.base.arrays import FloatArray

#: Share of each further round that is drawn from the prior all the same, so that no weight can be without bound.
_DEFENSIVE = 0.1
#: Variance that is added to every unknown's.
_FLOOR = 0.02
#: Draws that stand for the posterior so far, around each of which a further round draws.
_CENTRES = 100


@dataclass(frozen=True, slots=True, eq=False)
class WeightedDraws:
    """Draws of unknowns whose prior is standard normal, with weights.

    `z`, shape (n, d)
    `weight`, shape (n,): sum 1
    `log_evidence`: logarithm of the mean likelihood under the prior
    """

    z: FloatArray
    weight: FloatArray
    log_evidence: float

    @property
    def effective(self) -> float:
        """How many draws with equal weights tell as much (Kish)."""
        return float(1.0 / np.sum(self.weight**2))


def adaptive_importance(
    log_likelihood: Callable[[FloatArray], FloatArray], first: FloatArray, rng: np.random.Generator, further: int, rounds: int
) -> WeightedDraws:
    """Return draws of the posterior: a round from the prior, further ones from mixtures of normals around all draws so far.

    Each draw is weighted by prior times likelihood over the density that it was drawn from [cappe2004], and each round counts by its
    effective draws; the mixtures are West's [west1993], with Silverman's width. Weights by the mixture of all rounds would tell more with
    fewer draws, but where a round was drawn hangs on the draws before it, which then count for too little: in eight dimensions a third of
    the evidence was missing.

    `log_likelihood`: of z, shape (n, d), returns shape (n,); it may be an unbiased estimate of the likelihood. It is asked once for each
        round.
    `first`, shape (n, d): draws of the prior, independent standard normals
    `further`, `rounds`: draws of each further round, and how many of these there are
    """
    parts = [first]
    logs = [log_likelihood(first)]
    for _ in range(rounds):
        new, density = _mixture(np.concatenate(parts), _gentle(_shares(logs), 2.0 * first.shape[1]), further, rng)
        parts.append(new)
        logs.append(log_likelihood(new) + _log_normal(new) - density(new))
    evidence = [float(logsumexp(own)) - np.log(own.size) for own in logs]
    return WeightedDraws(np.concatenate(parts), _shares(logs), float(logsumexp(evidence, b=_effective(logs))))


def _effective(logs: list[FloatArray]) -> FloatArray:
    """Effective draws of each round, as shares of all."""
    found = np.array([np.exp(2.0 * logsumexp(own) - logsumexp(2.0 * own)) for own in logs])
    return found / found.sum()


def _shares(logs: list[FloatArray]) -> FloatArray:
    """Weights of sum 1, each round's sum in proportion to its effective draws."""
    return np.concatenate([share * np.exp(own - logsumexp(own)) for share, own in zip(_effective(logs), logs, strict=True)])


def _gentle(weight: FloatArray, fewest: float) -> FloatArray:
    """Weights raised to a power, at most one, at which they count for so many draws: where few agree, the next round looks around them."""
    power = 1.0
    while power > 1e-3:
        found = weight**power / np.sum(weight**power)
        if np.sum(found**2) * fewest <= 1.0:
            break
        power *= 0.8
    return found


def _mixture(
    z: FloatArray, weight: FloatArray, count: int, rng: np.random.Generator
) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
    """Draws around the posterior so far, and the logarithm of their density."""
    size = z.shape[1]
    effective = 1.0 / np.sum(weight**2)
    mean = weight @ z
    covariance = (weight * (z - mean).T) @ (z - mean)
    # few draws know how wide each unknown is, but not yet which of them go together
    trust = effective / (effective + 2.0 * size)
    covariance = trust * covariance + (1.0 - trust) * np.diag(np.diag(covariance)) + _FLOOR * np.eye(size)
    width = min((4.0 / (size + 2.0) / max(effective, 2.0)) ** (1.0 / (size + 4.0)), 1.0)
    root = width * np.linalg.cholesky(covariance)
    # drawn towards the mean, so that the mixture is no wider than the posterior
    centres = mean + np.sqrt(1.0 - width**2) * (z[systematic(weight, _CENTRES, rng)] - mean)
    own = round((1.0 - _DEFENSIVE) * count)
    around = centres[rng.integers(len(centres), size=own)] + rng.standard_normal((own, size)) @ root.T
    new = np.concatenate([around, rng.standard_normal((count - own, size))])
    log_det = float(np.sum(np.log(np.diag(root))))
    inverse = np.linalg.inv(root)

    def density(at: FloatArray) -> FloatArray:
        apart = (at @ inverse.T)[:, None] - centres @ inverse.T
        near = logsumexp(-0.5 * np.sum(apart**2, axis=2), axis=1) - np.log(len(centres)) - log_det - 0.5 * size * np.log(2.0 * np.pi)
        found: FloatArray = np.logaddexp(np.log(own / count) + near, np.log1p(-own / count) + _log_normal(at))
        return found

    return new, density


def _log_normal(z: FloatArray) -> FloatArray:
    found: FloatArray = -0.5 * np.sum(z**2, axis=1) - 0.5 * z.shape[1] * np.log(2.0 * np.pi)
    return found


def systematic(weight: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Return places drawn in proportion to weights of sum 1, each as often as its share says, to one [kitagawa1996]."""
    steps = (rng.random() + np.arange(count)) / count
    return np.minimum(np.searchsorted(np.cumsum(weight), steps), weight.size - 1)
