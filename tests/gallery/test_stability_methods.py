"""The example of all lobe methods is checked here."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gallery.test_gallery import example


@pytest.mark.slow
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


def test_state_space():
    """The closed loop is H / (1 + K H), its damping the sum; the limits rise with it, and two methods agree on how far."""
    ex = example("state_space")
    omega = ex.NATURAL * np.linspace(0.1, 3.0, 200)
    h = ex.MACHINE.receptance(omega).values[:, 0, 0]
    k = 1j * omega * ex.DAMPER / (1.0 + 1j * omega / ex.CORNER)
    expected = (h / (1.0 + k * h))[:, None, None] * np.eye(2)
    np.testing.assert_allclose(ex.DAMPED.response(omega), expected, rtol=1e-7, atol=1e-9 * np.abs(h).max())
    mode = ex.DAMPED.pole[np.argmax(ex.DAMPED.strength)]
    assert -mode.real / abs(mode) == pytest.approx(ex.ZETA + ex.ADDED, rel=0.01)
    # the lowest real part of a mode is -1 / (4 k zeta (1 + zeta))
    bare, damped = (ex.LOBES[name, "ZeroOrder"].absolute_limit for name in ("bare", "damped"))
    assert damped / bare == pytest.approx((ex.ZETA + ex.ADDED) / ex.ZETA, rel=0.1)
    zero, full = (ex.LOBES["damped", m].limit_depth / ex.LOBES["bare", m].limit_depth for m in ("ZeroOrder", "FullDiscretisation"))
    assert np.all(full > 1.4)
    np.testing.assert_allclose(zero, full, rtol=0.08)
