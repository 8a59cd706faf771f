"""What a milling process may be."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation

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
