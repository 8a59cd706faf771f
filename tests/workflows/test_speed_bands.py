"""Which cuts belong to which band, and that each is identified from its own cuts alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement, Reading
from rcsa_ident.signals.verdict import RecordCode, Verdict
from rcsa_ident.workflows.speed_bands import speed_bands, split_by_speed
from tests.fixtures import by_hand


def reading(number, speed, tooling="T1", usable=True):
    id = f"{tooling}-{number}"
    if not usable:
        return Reading(id, tooling, speed, Verdict((Remark(RecordCode.CHATTER, "chatter"),)))
    order = np.array([4, 8])
    value = np.full((2, 1), 1e-8 + 1e-9j)
    lines = AxisLines(
        order, order * speed, value, 0.0 * value, np.full((2, 1), 1e-20), np.ones(2), np.full(2, 10.0 + 0j), np.zeros((2, 5), dtype=complex)
    )
    return Reading(id, tooling, speed, Verdict(()), (CutMeasurement(id, tooling, speed, {Dof.X: lines}, 0.01),))


@dataclass(frozen=True)
class Echo:
    """Stands for a method: says which cuts and which seed it was given."""

    def run(self, data, seed, map):
        return data.cut_ids, seed


def test_bands_are_equal_ranges_and_every_usable_cut_is_in_one():
    readings = [reading(k, speed) for k, speed in enumerate(np.linspace(800.0, 2000.0, 30))]
    readings.append(reading(99, 1500.0, usable=False))
    bands = split_by_speed(readings, 3)
    assert [speeds for speeds, _ in bands] == [pytest.approx(p) for p in ((800.0, 1200.0), (1200.0, 1600.0), (1600.0, 2000.0))]
    for (low, high), cuts in bands:
        speeds = [each.measurement.spindle_speed for each in cuts]
        assert low <= min(speeds) <= max(speeds) <= high
    assert sorted(each.cut_id for _, cuts in bands for each in cuts) == sorted(each.cut_id for each in readings[:-1])


def test_a_band_with_too_few_cuts_of_a_tooling_is_refused_with_the_number():
    readings = [reading(k, speed) for k, speed in enumerate(np.linspace(800.0, 2000.0, 40))]
    readings += [reading(k, speed, "T2") for k, speed in enumerate(np.linspace(800.0, 1500.0, 20))]
    with pytest.raises(InputError) as error:
        split_by_speed(readings, 2)
    for word in ("speed_bands", "3 cuts with T2", "13369 to 19099 rev/min", "at least 8 cuts", "2 bands"):
        assert word in str(error.value)


def test_no_usable_cut_is_said():
    with pytest.raises(InputError, match="none of 1 usable"):
        split_by_speed([reading(0, 900.0, usable=False)], 2)


def test_each_band_is_identified_from_its_own_cuts(tmp_path):
    campaign = by_hand.campaign(tmp_path)
    readings = [reading(k, speed) for k, speed in enumerate(np.linspace(800.0, 2000.0, 20))]
    found = speed_bands(campaign, readings, 2, Echo(), 11)
    assert [band.found[0] for band in found] == [tuple(f"T1-{k}" for k in range(10)), tuple(f"T1-{k}" for k in range(10, 20))]
    assert {band.found[1] for band in found} == {11}
    assert found[0].speeds[1] == found[1].speeds[0]
