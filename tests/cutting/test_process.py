"""What a milling process may be, and which surface each of its teeth cuts into."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import regenerations
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation
from rcsa_ident.errors import InputError

COEFFICIENTS = CuttingCoefficients(6e8, 0.3)
HALF = Engagement.from_immersion(0.5, "down")


def test_rotation_and_conditions():
    process = MillingProcess(Cutter(2, 0.012), COEFFICIENTS, HALF, 0.3, 1e-4)
    np.testing.assert_allclose(process.machine_from_feed @ [1.0, 0.0], [np.cos(0.3), np.sin(0.3)])
    cut = process.conditions(900.0, 2e-3)
    np.testing.assert_array_equal(cut.machine_from_feed, process.machine_from_feed)
    assert (cut.spindle_speed, cut.axial_depth, cut.feed_per_tooth, cut.engagement) == (900.0, 2e-3, 1e-4, HALF)
    assert MillingProcess(Cutter(2, 0.012), COEFFICIENTS, HALF).conditions(900.0, 2e-3).feed_per_tooth == 0.0


def test_strength_of_the_indentation():
    """K_sp w^2 / 4: 1.5e14 N/m^3 over 40 um of wear land."""
    assert ProcessDamping(1.5e14, 40e-6).strength == pytest.approx(6e4)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: ProcessDamping(0.0, 1e-5), "indentation"),
        (lambda: ProcessDamping(1e14, -1e-5), "wear_land"),
        (lambda: ProcessDamping(1e14, 1e-5, 2.5), "friction"),
        (lambda: ProcessDamping(1e14, 1e-5, float("nan")), "friction"),
        (lambda: SpeedVariation(0.0, 0.5), "amplitude"),
        (lambda: SpeedVariation(0.9, 0.5), "amplitude"),
        (lambda: SpeedVariation(float("nan"), 0.5), "amplitude"),
        (lambda: SpeedVariation(0.1, 0.0), "ratio"),
        (lambda: SpeedVariation(0.1, 20.0), "ratio"),
        (lambda: MillingProcess(Cutter(2, 0.012), COEFFICIENTS, HALF, float("inf")), "feed_angle"),
        (lambda: MillingProcess(Cutter(2, 0.012), COEFFICIENTS, HALF, feed_per_tooth=0.0), "feed_per_tooth"),
    ],
)
def test_bad_input(make, field):
    with pytest.raises(InputError) as error:
        make()
    assert error.value.field == field
    assert error.value.allowed


@settings(max_examples=60, deadline=None)
@given(
    runout=st.lists(st.floats(-8e-5, 8e-5), min_size=2, max_size=5),
    feed=st.floats(1e-5, 2e-4),
    entry=st.floats(0.0, 2.0),
    width=st.floats(0.1, 1.1),
)
def test_regenerations_are_where_the_chip_is(runout, feed, entry, width):
    """Against the smallest distance to the surfaces of the teeth ahead, angle by angle."""
    n = len(runout)
    weights = 1.0 + 0.3 * np.cos(np.arange(n) * 1.7)
    cutter = Cutter(n, 0.012, pitch=2.0 * np.pi * weights / weights.sum(), runout=np.array(runout))
    engagement = Engagement(entry, min(entry + width, np.pi))
    pieces = regenerations(cutter, feed, engagement)
    for phi in np.linspace(engagement.entry, engagement.exit, 57)[1:-1]:
        for j in range(n):
            distances, moved = [], 0.0
            for back in range(1, n + 1):
                moved += feed * n * cutter.pitch[(j + back - 1) % n] / (2.0 * np.pi)
                distances.append(moved * np.sin(phi) + runout[j] - runout[(j + back) % n])
            near = np.sort(distances)
            here = [p for p in pieces if p[0] == j and p[1] <= phi < p[2]]
            assert len(here) <= 1
            if abs(near[0]) < 1e-9 or near[1] - near[0] < 1e-9 or any(abs(phi - a) < 1e-6 for p in pieces for a in p[1:3]):
                continue
            assert bool(here) == (near[0] > 0.0)
            if here:
                assert here[0][3] == int(np.argmin(distances)) + 1


def test_equal_teeth_cut_what_the_last_one_left():
    pieces = regenerations(Cutter(3, 0.012), 1e-4, HALF)
    assert sorted(pieces) == [(j, HALF.entry, HALF.exit, 1) for j in range(3)]
