"""The soak: what rises is told from what swings."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.soak import slope


def test_a_rise_counts_beyond_its_scatter():
    hours = np.linspace(0.2, 1.0, 300)
    swing = 10.0 * np.sign(np.sin(60.0 * hours))
    assert not slope(hours, 200.0 + 40.0 * hours + swing)[1]
    assert slope(hours, 200.0 + 5.0 * hours + swing)[1]
    # nothing is as flat as what never changes, and one descriptor more in a while is a rise
    assert slope(hours, np.full(300, 8.0)) == (pytest.approx(0.0, abs=1e-9), True)
    assert not slope(hours, 8.0 + np.floor(5.0 * hours))[1]
