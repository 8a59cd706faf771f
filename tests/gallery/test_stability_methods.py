"""The example of all lobe methods is checked here."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gallery.test_gallery import example


def test_all_methods():
    ex = example("all_methods")
    exact = ex.LIMITS["FullDiscretisation"]
    for name, limit in ex.LIMITS.items():
        if name != "ZeroOrder":
            assert limit == pytest.approx(exact, rel=1e-2)
    assert ex.LIMITS["ZeroOrder"] > 3.0 * exact
    # islands: stable again above an unstable depth, at several speeds; few of the points were computed
    assert np.sum(np.any(np.diff(ex.MAP.stable.astype(int), axis=1) == 1, axis=1)) >= 5
    assert ex.MAP.evaluations < 0.6 * ex.MAP.growth.size
