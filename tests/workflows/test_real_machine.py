"""Hammer tests that nobody here made: from two hits on the holder of a machining centre to the tip, which was hit, too."""

from __future__ import annotations

import pytest

from benchmarks.real_machine import HAMMER, Drawing, answer, measured_tip

pytestmark = pytest.mark.skipif(not HAMMER.is_dir(), reason="the real hammer tests are not there")


@pytest.mark.slow
def test_the_tips_largest_mode_follows_from_hits_on_the_holder():
    """With the carbide tool's drawing that explains these hits best: what others make of them is in docs/real_machine.md."""
    frequency, measured = measured_tip()
    assert abs(measured).max() == pytest.approx(6.78e-7, rel=0.01)
    found = answer(Drawing("carbide", 61.0, 6e6))
    hertz, size = found.peak
    assert hertz == pytest.approx(1056.0, rel=0.015)
    assert size == pytest.approx(6.78e-7, rel=0.15)
    assert found.unexplained < 0.1
    assert found.tip.shape == found.deviation.shape[1:] == frequency.shape
