"""Averages of physics and of labels without it."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.stability.labels.averaging import trust_in, weight_of_labels


def test_the_weight_is_that_of_the_evidence():
    """Odds of four to one, and a factor e for two of the logarithm of the ratio."""
    assert trust_in(0.0) == pytest.approx(0.8)
    assert trust_in(2.0) == pytest.approx(4.0 * np.e / (1.0 + 4.0 * np.e))
    assert trust_in(-100.0) < 1e-9


def test_labels_keep_their_weight_where_they_are():
    near = np.array([1.0, np.exp(-0.5), np.exp(-2.0), 0.0])
    assert weight_of_labels(near, 0.0).tolist() == [1.0] * 4
    assert weight_of_labels(near, 1.0).tolist() == [0.0] * 4
    assert weight_of_labels(near, 0.8) == pytest.approx([0.2, 0.2, 0.04, 0.04])
