"""The cut whose label tells most."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest

from rcsa_ident.stability.labels.next_test import most_telling


def information(stable, places):
    """Mutual information of several labels and the draw, every outcome by itself."""
    total = 0.0
    for outcome in product((True, False), repeat=len(places)):
        p = np.prod([stable[:, k] if seen else 1.0 - stable[:, k] for k, seen in zip(places, outcome, strict=True)], axis=0)
        total += np.mean(p * np.log(p / p.mean()))
    return total


@pytest.fixture
def stable():
    return np.random.default_rng(3).beta(0.4, 0.6, (50, 8)).clip(1e-6, 1.0 - 1e-6)


def test_the_first_has_the_greatest_information(stable):
    told = [information(stable, (k,)) for k in range(8)]
    assert most_telling(stable, 1, np.random.default_rng(1)) == [int(np.argmax(told))]


def test_each_further_one_adds_most(stable):
    chosen = most_telling(stable, 5, np.random.default_rng(1))
    for n in range(1, 5):
        told = {k: information(stable, (*chosen[:n], k)) for k in range(8) if k not in chosen[:n]}
        assert max(told, key=told.get) == chosen[n]
    best = max(information(stable, pair) for pair in combinations(range(8), 2))
    assert information(stable, chosen[:2]) > 0.9 * best


def test_a_cut_twice_is_taken_once_before_one_that_tells_less():
    """The second of two like cuts adds only what its own doubt leaves."""
    sure = np.where(np.arange(40)[:, None] < 20, 0.98, 0.02)
    other = np.where(np.arange(40)[:, None] % 2, 0.8, 0.2)
    assert most_telling(np.hstack([sure, sure, other]), 2, np.random.default_rng(1)) == [0, 2]


def test_many_are_chosen_and_each_once(stable):
    many = np.random.default_rng(5).random((60, 30))
    chosen = most_telling(many, 14, np.random.default_rng(1))
    assert len(set(chosen)) == 14
    assert sorted(most_telling(stable, 20, np.random.default_rng(1))) == list(range(8))
