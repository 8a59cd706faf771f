"""Limits of the marching methods: honest tolerances, the depth that is surely stable, doubts that are told, order of speeds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.stability import multiplier_limits
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.monodromy import stable_depth_bound
from rcsa_ident.stability.multiplier_limits import GROWS, PASSES, Growth, longest_step
from tests.stability.mills import ONE, PASSING, RPM, SKEWED, SLOW, TWO, mill, slow_slot, tip

SPEEDS = np.array([5000.0, 8200.0, 11700.0, 18000.0, 26000.0]) * RPM
FULL = FullDiscretisation()
PROCESSES = {
    "slot": mill(2, 1.0),
    "low immersion": mill(3, 0.05, "up"),
    "helix": mill(4, 0.3, helix=0.7, feed_angle=0.4),
    "pitch": mill(3, 0.4, pitch=np.radians([100.0, 121.0, 139.0])),
    "run-out": mill(2, 0.5, runout=[0.0, 15e-6], feed_per_tooth=1e-4),
    "rubbing": mill(2, 0.4, damping=ProcessDamping(5e13, 6e-5)),
    "a varying speed": mill(2, 0.4, speed_variation=SpeedVariation(0.15, 0.5)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PROCESSES)
def test_limits_are_within_their_tolerance(name):
    exact = stability_lobes(tip(SKEWED), PROCESSES[name], SPEEDS, 20e-3, FullDiscretisation(tolerance=1e-6))
    assert np.isfinite(exact.limit_depth).sum() >= 4
    for method, tolerance in ((FULL, 3e-3), (FullDiscretisation(degree=2, tolerance=1e-2), 1e-2), (SemiDiscretisation(), 3e-3)):
        found = stability_lobes(tip(SKEWED), PROCESSES[name], SPEEDS, 20e-3, method)
        assert found.warnings == ()
        np.testing.assert_array_equal(np.isinf(found.limit_depth), np.isinf(exact.limit_depth))
        deep = np.isfinite(exact.limit_depth)
        np.testing.assert_allclose(found.limit_depth[deep], exact.limit_depth[deep], rtol=tolerance)


def test_the_error_that_is_known_is_taken_off():
    """A coarse semi-discretisation, whose last two steps give its limit to a tenth of what was asked for."""
    speeds = np.array([5000.0, 10_000.0, 18_500.0]) * RPM
    for process in (mill(2, 0.05), mill(2, 1.0)):
        exact, found = (
            stability_lobes(tip(ONE), process, speeds, 30e-3, m).limit_depth
            for m in (FullDiscretisation(tolerance=1e-6), SemiDiscretisation(tolerance=1e-2))
        )
        np.testing.assert_allclose(found, exact, rtol=1.5e-3)


def test_the_limit_is_where_growth_begins():
    process = PROCESSES["helix"]
    found = stability_lobes(tip(SKEWED), process, SPEEDS, 20e-3, FULL)
    cut = FULL.monodromy(tip(SKEWED), process)
    for speed, limit in zip(SPEEDS, found.limit_depth, strict=True):
        growth = Growth(cut, speed, 0.5 * longest_step(cut))
        assert growth(0.99 * limit) < 0.0 < growth(1.01 * limit)


@settings(max_examples=25, deadline=None)
@given(
    immersion=st.floats(0.02, 1.0),
    teeth=st.integers(1, 6),
    rpm=st.floats(500.0, 60_000.0),
    ratio=st.floats(0.0, 1.0),
    constant=st.floats(0.0, 3e-8),
)
def test_nothing_grows_at_the_surely_stable_depth(immersion, teeth, rpm, ratio, constant):
    process = mill(teeth, immersion, coefficients=CuttingCoefficients(6e8, ratio), feed_angle=0.4)
    cut = FULL.monodromy(tip(SKEWED, residual=(constant, 0.5 * constant)), process)
    assert Growth(cut, rpm * RPM, longest_step(cut))(stable_depth_bound(cut.modes, cut.process)) < 0.0


def test_depth_that_is_asked_for():
    """Nothing deeper is looked for, nor is anything lost just below; also where all of it is surely stable."""
    full = stability_lobes(tip(SKEWED), PROCESSES["slot"], SPEEDS, 20e-3, FULL).limit_depth
    median = float(np.median(full))
    found = stability_lobes(tip(SKEWED), PROCESSES["slot"], SPEEDS, 1.001 * median, FULL)
    np.testing.assert_array_equal(found.stable, full > median * 1.001)
    np.testing.assert_allclose(found.limit_depth[~found.stable], full[~found.stable], rtol=3e-3)
    assert np.all(np.isnan(found.chatter_frequency[found.stable]))
    assert np.all(found.lobe[found.stable] == -1)
    low = stable_depth_bound(tip(SKEWED), PROCESSES["slot"])
    for depth in (0.5 * low, 1e-2 * low):
        assert stability_lobes(tip(SKEWED), PROCESSES["slot"], SPEEDS, depth, FULL).stable.all()


def test_order_of_the_speeds():
    one, two = (stability_lobes(tip(SKEWED), PROCESSES["slot"], s, 20e-3, FULL) for s in (SPEEDS, SPEEDS[::-1]))
    np.testing.assert_array_equal(one.limit_depth, two.limit_depth[::-1])
    np.testing.assert_array_equal(one.chatter_frequency, two.chatter_frequency[::-1])


def test_a_limit_that_does_not_converge_is_told():
    """Constant coefficients cannot reach that tolerance in the steps that they may take."""
    found = stability_lobes(tip(ONE), PROCESSES["slot"], SPEEDS[:2], 20e-3, SemiDiscretisation(tolerance=1e-8))
    assert any("2 of 2 speeds" in w and "not converged" in w for w in found.warnings)
    assert np.all(np.isfinite(found.limit_depth))


def test_frequency_lobe_and_flip_hang_together():
    process = mill(2, 0.05)
    found = stability_lobes(tip(ONE), process, np.linspace(6000.0, 24000.0, 60) * RPM, 30e-3, FULL)
    waves = found.chatter_frequency / (2.0 * found.spindle_speed)
    seen = np.isfinite(waves)
    assert found.flip.sum() > 5
    assert (~found.flip & seen).sum() > 5
    np.testing.assert_allclose(waves[found.flip] % 1.0, 0.5, atol=1e-6)
    assert np.all(np.abs(waves[seen & ~found.flip] % 1.0 - 0.5) > 1e-4)
    np.testing.assert_array_equal(found.lobe[seen], np.floor(waves[seen]))


def test_rubbing_helps_at_low_speed_and_not_at_high_speed():
    bare, worn = mill(2, 0.5, helix=0.5), mill(2, 0.5, helix=0.5, damping=ProcessDamping(3e13, 8e-5))
    speeds = np.array([900.0, 2500.0, 8000.0, 30_000.0]) * RPM
    one, two = (stability_lobes(tip(TWO), p, speeds, 50e-3, FULL).limit_depth for p in (bare, worn))
    gain = two / one
    assert gain[0] > 2.0
    assert np.all(np.diff(gain) < 0.0)
    assert gain[-1] == pytest.approx(1.0, abs=0.1)
    # the damping falls as 1 / speed: far above nothing is left
    far = np.array([5e5]) * RPM
    a, b = (stability_lobes(tip(TWO), p, far, 5.0, FULL).limit_depth for p in (bare, worn))
    np.testing.assert_allclose(a, b, rtol=2e-2)


def test_more_wear_is_more_damping():
    limits = [
        stability_lobes(tip(SKEWED), mill(2, 0.5, damping=ProcessDamping(3e13, w)), np.array([2000.0]) * RPM, 50e-3, FULL).limit_depth[0]
        for w in (1e-8, 2e-5, 4e-5, 8e-5)
    ]
    none = stability_lobes(tip(SKEWED), mill(2, 0.5), np.array([2000.0]) * RPM, 50e-3, FULL).limit_depth[0]
    assert limits[0] == pytest.approx(none, rel=3e-3)
    assert np.all(np.diff(limits) > 0.0)


@pytest.mark.parametrize(("wear", "zeta", "immersion", "rpm"), SLOW)
def test_a_vibration_that_grows_a_thousandfold_is_a_limit(wear, zeta, immersion, rpm):
    """Multipliers alone have no sharp limit there; this one has, whatever the step, and noises that it has not seen tell the same."""
    modes, process, speeds = tip(((1, 900.0, zeta, 0.04),)), slow_slot(wear, immersion), np.array([rpm]) * RPM
    found, finer = (stability_lobes(modes, process, speeds, 40e-3, m) for m in (FULL, FullDiscretisation(intervals=200)))
    limit = float(found.limit_depth[0])
    assert found.warnings == finer.warnings != ()
    assert "grows a thousandfold" in found.warnings[0]
    assert finer.limit_depth[0] == pytest.approx(limit, rel=0.01)
    cut = FULL.monodromy(modes, process)

    def grown(depth: float) -> float:
        return float(np.median([cut.growth(speeds[0], depth, longest_step(cut), PASSES, 1e12, seed) for seed in range(100, 120)]))

    assert grown(0.75 * limit) < GROWS < grown(1.25 * limit)
    # far from a rounding of the largest multiplier
    assert abs(cut.multiplier(speeds[0], limit, longest_step(cut), residual=1e-12).value) < 0.95


def test_a_vibration_grows_below_the_largest_depth_and_no_multiplier_tells():
    """All multipliers are small up to 5 mm; the largest motion grows a thousandfold from 4 mm on."""
    speeds = np.array([1600.0]) * RPM
    modes, process = tip(PASSING), slow_slot(1e-4)
    cut = FULL.monodromy(modes, process)
    assert max(abs(cut.multiplier(speeds[0], depth, longest_step(cut)).value) for depth in (1e-3, 3e-3, 5e-3)) < 1.0
    found = stability_lobes(modes, process, speeds, 5e-3, FULL)
    assert 3.5e-3 < found.limit_depth[0] < 4.5e-3
    assert np.isfinite(found.chatter_frequency[0])
    assert stability_lobes(modes, process, speeds, 3e-3, FULL).stable[0]


def test_fast_cuts_are_decided_by_multipliers(monkeypatch):
    """What passes does not move a limit at which nothing passes, by a digit."""
    found = stability_lobes(tip(SKEWED), PROCESSES["helix"], SPEEDS, 20e-3, FULL)
    monkeypatch.setattr(multiplier_limits, "GROWS", 1e12)
    same = stability_lobes(tip(SKEWED), PROCESSES["helix"], SPEEDS, 20e-3, FULL)
    np.testing.assert_array_equal(found.limit_depth, same.limit_depth)
    assert found.warnings == same.warnings == ()
