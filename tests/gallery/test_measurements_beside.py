"""Measurements beside: each example states, solves, checks."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gallery.test_gallery import example


def test_cutting_coefficients():
    ex = example("cutting_coefficients")
    true = np.array([ex.TRUE.tangential, ex.TRUE.tangential * ex.TRUE.radial_ratio, ex.TRUE.tangential_edge, ex.TRUE.radial_edge])
    assert np.all(np.abs(ex.FOUND.value - true) < ex.FOUND.half_width)
    assert ex.FOUND.half_width[0] < 0.1 * true[0]


@pytest.mark.slow
def test_decoupled_flange():
    ex = example("decoupled_flange")
    true = ex.MACHINE.receptance(ex.OMEGA).values
    for i, j in ((0, 0), (0, 1), (1, 1)):
        assert np.median(np.abs(ex.FOUND.receptance.values - true)[:, i, j] / np.abs(true[:, i, j])) < 0.02
    assert np.linalg.norm(ex.TIP - ex.TRUE_TIP) < 0.02 * np.linalg.norm(ex.TRUE_TIP)
