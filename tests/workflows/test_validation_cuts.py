"""Cuts that judge the answer: nothing is learned from them, and their lines are predicted."""

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.io.results.identifications import identification_to_json
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.signals.verdict import Verdict
from rcsa_ident.workflows.identify import data_of, identify
from tests.fixtures.virtual_shop import open_shop


@pytest.fixture(scope="module")
def shop():
    return open_shop(speeds=12)


@pytest.fixture(scope="module")
def readings(shop):
    cuts, _ = shop.measurements(np.random.default_rng(1), both_forces=True)
    return [Reading(each.cut_id, each.tooling, each.spindle_speed, Verdict(()), (each,)) for each in cuts]


def campaign_of(shop, readings, judges, **told):
    made = [
        Cut(each.cut_id, each.tooling, shop.machine.plan.conditions(each.programmed_speed), Path(), validation=k in judges, **told)
        for k, each in enumerate(readings)
    ]
    return Campaign("C", 25600.0, (), shop.machine.workpiece, shop.toolings, tuple(made))


@pytest.mark.slow
def test_nothing_is_learned_from_cuts_that_judge(shop, readings):
    judges = {len(readings) - 1, len(readings) - 4}
    kept = [each for k, each in enumerate(readings) if k not in judges]
    campaign = campaign_of(shop, readings, judges)
    found = identify(campaign, readings, EvidenceSelection(), 1)
    fewer = identify(campaign_of(shop, kept, ()), kept, EvidenceSelection(), 1)
    assert found.cut_ids == fewer.cut_ids == tuple(each.cut_id for each in kept)
    for axis, part in found.axes.items():
        np.testing.assert_array_equal(part.modes.omega_n, fewer.axes[axis].modes.omega_n)
    # left out in turn, and behind these what judges
    last = [each for each in found.predictions if each not in fewer.predictions]
    assert found.predictions[: len(fewer.predictions)] == fewer.predictions
    assert [each.tooling for each in last] == [readings[-1].tooling] * len(found.axes)
    assert all(each.holds for each in last)
    written = identification_to_json(found, campaign, [])
    assert written["campaign"]["cuts_used"] == len(kept)
    for each in last:
        assert written["axes"][each.axis.upper()]["validation"][each.tooling]["error"] == each.error


def test_cuts_that_judge_alone_teach_nothing(shop, readings):
    with pytest.raises(InputError, match="cuts: found usable ones for validation alone"):
        data_of(campaign_of(shop, readings, range(len(readings))), readings)


def test_time_and_temperature_reach_the_data(shop, readings):
    campaign = campaign_of(shop, readings, (), temperature=30.0)
    assert np.all(data_of(campaign, readings).made.temperature == 30.0)
    began = [replace(cut, started=datetime(2026, 11, 27, 8, k)) for k, cut in enumerate(campaign.cuts)]
    np.testing.assert_array_equal(data_of(replace(campaign, cuts=tuple(began)), readings).made.started, 60.0 * np.arange(len(began)))
    # one that is not told leaves all at even distances
    began[0] = replace(began[0], started=None)
    assert np.ptp(np.diff(data_of(replace(campaign, cuts=tuple(began)), readings).made.started)) == 0.0
