"""One list of cases, all methods that must agree there: none of them is the others' yardstick."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import TipModes
from tests.stability.mills import FOUR, FOUR_COEFFICIENTS, ONE, RPM, SKEWED, TWO, mill, tip

pytestmark = pytest.mark.slow

FULL, SEMI, MULTI, TIME = FullDiscretisation(tolerance=1e-5), SemiDiscretisation(), MultiFrequency(), TimeDomain(contact_loss=False)
#: A mode whose direction is skewed, beside the others: cross receptances.
CROSS = TipModes(
    tip(SKEWED).pole,
    np.array([[1.0, 0.2, 0.6], [0.3, 1.0, -0.8]]) * np.abs(tip(SKEWED).outputs).max(axis=0) * np.exp(-0.25j * np.pi),
    (np.array([[1.0, 0.2, 0.6], [0.3, 1.0, -0.8]]) * np.abs(tip(SKEWED).outputs).max(axis=0) * np.exp(-0.25j * np.pi)).T,
    np.zeros((2, 2)),
)
HELIX = np.radians(40.0)
# modes, cut, speeds [rev/min]
EQUAL: dict[str, tuple[TipModes, MillingProcess, tuple[float, ...]]] = {
    "slot": (tip(ONE), mill(2, 1.0), (7500.0, 12_500.0)),
    "slot, two directions": (tip(TWO), mill(2, 1.0), (7500.0, 20_000.0)),
    "half": (tip(SKEWED), mill(3, 0.5), (6000.0, 11_000.0)),
    "a/D 0.05, flips": (tip(ONE), mill(2, 0.05), (17_000.0, 18_000.0, 18_500.0)),
    "a/D 0.1, up, flips": (tip(ONE), mill(2, 0.1, "up"), (19_000.0, 20_500.0)),
    "a/D 0.05, helix, islands": (tip(ONE), mill(2, 0.05, "up", np.radians(30.0)), (11_400.0, 18_500.0)),
    "helix, feed angle": (tip(SKEWED), mill(4, 0.5, helix=HELIX, feed_angle=0.4), (4000.0, 12_000.0)),
    "skewed mode": (CROSS, mill(2, 0.4, helix=0.4, feed_angle=-0.7), (9000.0, 14_000.0)),
    "turned machine": (tip(SKEWED, turn=0.6), mill(3, 0.3, "up"), (8000.0, 16_000.0)),
    "four modes": (tip(FOUR), mill(4, 0.5, coefficients=FOUR_COEFFICIENTS), (5000.0, 10_000.0)),
    "residual compliance": (tip(SKEWED, (5e-8, 2e-8)), mill(3, 0.1, helix=0.4, feed_angle=0.4), (5000.0, 30_000.0)),
    "heavily damped": (tip(((0, 700.0, 0.5, 0.02), (1, 800.0, 0.3, 0.03))), mill(2, 0.5, feed_angle=0.3), (8000.0, 30_000.0)),
    "one tooth": (tip(SKEWED), mill(1, 0.5), (12_000.0,)),
    "twelve teeth": (tip(SKEWED), mill(12, 0.02, helix=0.5), (3000.0,)),
    "rubbing": (tip(SKEWED), mill(2, 0.4, helix=0.5, damping=ProcessDamping(3e13, 6e-5)), (4000.0, 9000.0)),
}
UNEQUAL: dict[str, tuple[TipModes, MillingProcess, tuple[float, ...]]] = {
    "pitch": (tip(SKEWED), mill(3, 0.5, feed_angle=0.4, pitch=np.radians([110.0, 123.0, 127.0])), (4000.0, 12_000.0)),
    "pitch, helix": (tip(SKEWED), mill(2, 0.2, "up", 0.6, pitch=np.radians([150.0, 210.0])), (9000.0, 15_000.0)),
    "run-out": (tip(SKEWED), mill(2, 0.5, feed_angle=0.4, runout=[0.0, 15e-6], feed_per_tooth=1e-4), (4000.0, 8000.0)),
    "run-out, a tooth that misses": (tip(SKEWED), mill(2, 0.5, runout=[0.0, 60e-6], feed_per_tooth=5e-5), (6000.0, 12_000.0)),
    "run-out, late teeth": (tip(SKEWED), mill(3, 0.4, helix=0.5, runout=[0.0, 30e-6, -10e-6], feed_per_tooth=3e-5), (9000.0,)),
    "speed": (tip(SKEWED), mill(2, 0.5, feed_angle=0.4, speed_variation=SpeedVariation(0.1, 0.5)), (6000.0, 12_000.0)),
    "speed and rubbing": (tip(ONE), mill(2, 0.5, speed_variation=SpeedVariation(0.2, 1.0), damping=ProcessDamping(3e13, 6e-5)), (9000.0,)),
}


def limits(case, method):
    modes, process, rpm = case
    found = stability_lobes(modes, process, np.array(rpm) * RPM, 60e-3, method)
    assert found.warnings == ()
    return found


@pytest.mark.parametrize("name", EQUAL)
def test_equal_teeth(name):
    case = EQUAL[name]
    full, semi, time = (limits(case, method) for method in (FULL, SEMI, TIME))
    assert np.all(np.isfinite(full.limit_depth))
    np.testing.assert_allclose(semi.limit_depth, full.limit_depth, rtol=3e-3)
    np.testing.assert_allclose(time.limit_depth, full.limit_depth, rtol=1.2e-2)
    multi = limits(case, MULTI)
    # harmonics end somewhere: beyond ten times the highest mode nothing of them is kept
    np.testing.assert_allclose(multi.limit_depth, full.limit_depth, rtol=5e-3)
    for other in (semi, multi, time):
        np.testing.assert_array_equal(other.flip if other is not multi else full.flip, full.flip)
    # frequencies of the same vibration may be counted from either side of a multiple of the tooth-passing frequency
    passing = case[1].cutter.teeth * full.spindle_speed
    for other, near in ((semi, 2e-3), (multi, 2e-3), (time, 2e-2)):
        apart = np.stack([sign * other.chatter_frequency - full.chatter_frequency for sign in (1.0, -1.0)])
        apart = np.abs(np.mod(apart + 0.5 * passing, passing) - 0.5 * passing).min(axis=0)
        assert np.all(apart < near * full.chatter_frequency)


@pytest.mark.parametrize("name", UNEQUAL)
def test_unequal_teeth_and_speeds(name):
    case = UNEQUAL[name]
    full, semi, time = (limits(case, method) for method in (FULL, SEMI, TIME))
    assert np.all(np.isfinite(full.limit_depth))
    np.testing.assert_allclose(semi.limit_depth, full.limit_depth, rtol=3e-3)
    np.testing.assert_allclose(time.limit_depth, full.limit_depth, rtol=1.2e-2)


def test_islands_of_low_immersion():
    """Period doubling at little immersion lies below what the mean force lets expect: all methods find it, at both immersions."""
    for immersion, rpm in ((0.05, 18_000.0), (0.1, 18_000.0)):
        case = (tip(ONE), mill(2, immersion), (rpm,))
        mean = limits(case, MultiFrequency(harmonics=0)).limit_depth[0]
        found = [limits(case, method) for method in (FULL, SEMI, MULTI, TIME)]
        depths = np.array([each.limit_depth[0] for each in found])
        assert np.all(depths < 0.6 * mean)
        np.testing.assert_allclose(depths, depths[0], rtol=1.2e-2)
        for each in found:
            assert each.chatter_frequency[0] % (2.0 * rpm * RPM) == pytest.approx(rpm * RPM, rel=1e-3)


@settings(max_examples=10, deadline=None)
@given(
    teeth=st.integers(1, 5),
    immersion=st.floats(0.04, 1.0),
    strategy=st.sampled_from(["up", "down"]),
    helix=st.floats(0.0, 0.8),
    feed_angle=st.floats(-3.0, 3.0),
    rpm=st.floats(4000.0, 30_000.0),
)
def test_any_cut_in_time_and_in_frequency(teeth, immersion, strategy, helix, feed_angle, rpm):
    """A method with matrices of harmonics and one that marches know nothing of each other."""
    case = (tip(SKEWED), mill(teeth, immersion, strategy, helix, feed_angle=feed_angle), (rpm,))
    full, multi = (stability_lobes(case[0], case[1], np.array(case[2]) * RPM, 30e-3, m).limit_depth[0] for m in (FULL, MULTI))
    assert multi == pytest.approx(full, rel=5e-3)
