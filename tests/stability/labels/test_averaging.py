"""Averages of physics and of labels without it."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.stability.labels.averaging import belief_in, trust_in


def test_the_weight_is_that_of_the_evidence():
    """Odds of four to one, and a factor e for two of the logarithm of the ratio."""
    assert trust_in(0.0) == pytest.approx(0.8)
    assert trust_in(2.0) == pytest.approx(4.0 * np.e / (1.0 + 4.0 * np.e))
    assert trust_in(-100.0) < 1e-9


def test_a_belief_that_told_labels_no_better_than_a_coin_is_an_even_chance():
    assert belief_in(np.log(0.5), 10) == pytest.approx(0.5)
    assert belief_in(np.log(0.5) + 0.1, 20) == pytest.approx(np.e / (1.0 + np.e))
    assert belief_in(-3.0, 40) < 1e-9
