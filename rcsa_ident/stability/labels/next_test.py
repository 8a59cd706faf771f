"""Which cuts to test next: those whose labels tell most about what the draws disagree on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import xlogy

from rcsa_ident.base.arrays import FloatArray

#: Outcomes of the cuts chosen so far that are followed one by one; beyond so many a part of them stands for all.
_OUTCOMES = 512


def most_telling(stable: FloatArray, count: int, rng: np.random.Generator) -> list[int]:
    """Return the places of the cuts whose labels, taken together, tell most about the draws, the most telling first.

    What a label tells is the mutual information of label and draw: large where draws are sure of themselves and disagree with each
    other, nothing where all agree or each is in doubt for itself. A second cut counts for what it adds [kirsch2019].

    Parameters
    ----------
    stable : array, shape (r, n)
        Probability of each draw that each cut is called stable.
    count : int
    rng : numpy.random.Generator
        Chooses outcomes where there are too many to follow all.

    Examples
    --------
    Draws disagree about the second cut; about the third each is in doubt:

    >>> most_telling(np.array([[0.99, 0.98, 0.5], [0.99, 0.02, 0.5]]), 1, np.random.default_rng(1))
    [1]
    """
    chosen: list[int] = []
    # probability of each outcome of the chosen cuts, draw by draw, and how many outcomes each stands for
    outcome, stands_for = np.ones((1, len(stable))), np.ones(1)
    own = np.mean(_entropy(stable), axis=0)
    for _ in range(min(count, stable.shape[1])):
        told = _joint_entropy(outcome, stands_for, stable) - own
        told[chosen] = -np.inf
        best = int(np.argmax(told))
        chosen.append(best)
        outcome = np.concatenate([outcome * stable[:, best], outcome * (1.0 - stable[:, best])])
        stands_for = np.tile(stands_for, 2)
        if len(outcome) > _OUTCOMES:
            share = stands_for * outcome.mean(axis=1)
            places = rng.choice(len(outcome), _OUTCOMES // 2, p=share / share.sum())
            outcome, stands_for = outcome[places], share.sum() / (_OUTCOMES // 2) / outcome.mean(axis=1)[places]
    return chosen


def _joint_entropy(outcome: FloatArray, stands_for: NDArray[np.float64], stable: FloatArray) -> FloatArray:
    """Entropy of the chosen labels with each further one, shape (n,)."""
    found = np.zeros(stable.shape[1])
    for probability in (stable, 1.0 - stable):
        together = outcome @ probability / len(stable)
        found -= stands_for @ xlogy(together, together)
    return found


def _entropy(p: FloatArray) -> FloatArray:
    found: FloatArray = -xlogy(p, p) - xlogy(1.0 - p, 1.0 - p)
    return found
