"""When cuts were made, by the campaign and by the time stamps of their recordings."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from rcsa_ident.setup.cut_course import CourseCode
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.signals.verdict import Verdict
from rcsa_ident.workflows.cut_times import began, time_remarks
from tests.fixtures import by_hand

BEGAN = datetime(2026, 1, 5, 8)


def made(folder, told, stamped, seconds=0.3, zone=None, shift=0.0):
    """A campaign of cuts, 90 s from one to the next, some with a time in the campaign, some with one in their recording."""
    campaign = by_hand.campaign(folder)
    moments = [BEGAN + timedelta(seconds=90.0 * k) for k in range(4)]
    cuts = [replace(campaign.cuts[0], id=f"c{k}", started=moment if k in told else None) for k, moment in enumerate(moments)]
    stamps = [(moment + timedelta(seconds=shift)).replace(tzinfo=zone) if k in stamped else None for k, moment in enumerate(moments)]
    readings = [Reading(cut.id, "T1", 1000.0, Verdict(()), started=stamp, seconds=seconds) for cut, stamp in zip(cuts, stamps, strict=True)]
    return replace(campaign, cuts=tuple(cuts)), readings


ALL, NONE = range(4), ()


@pytest.mark.parametrize(
    ("told", "stamped", "zone", "shift"),
    [
        (ALL, NONE, None, 0.0),
        (NONE, ALL, UTC, 0.0),
        # the recorder's clock is an hour behind that of the campaign
        (ALL, ALL, UTC, -3600.0),
        ((0, 2), ALL, UTC, -3600.0),
        ((0, 2), ALL, None, -3600.0),
    ],
)
def test_a_time_stamp_counts_where_the_campaign_tells_nothing(tmp_path, told, stamped, zone, shift):
    campaign, readings = made(tmp_path, told, stamped, zone=zone, shift=shift)
    assert began(campaign, readings) == {f"c{k}": 90.0 * k for k in range(4)}
    assert time_remarks(campaign, readings) == []


@pytest.mark.parametrize(("told", "stamped"), [(NONE, NONE), ((0, 1, 2), NONE), (NONE, (0, 1, 2)), ((0, 1), (2, 3))])
def test_without_a_time_of_every_cut_there_is_none(tmp_path, told, stamped):
    """Also where nothing says how campaign and recorder compare."""
    assert began(*made(tmp_path, told, stamped)) == {}


def test_cuts_that_are_not_read_need_no_time(tmp_path):
    campaign, readings = made(tmp_path, (0, 1), NONE)
    assert began(campaign, readings[:2]) == {"c0": 0.0, "c1": 90.0}


def test_recordings_that_overlap_are_noticed(tmp_path):
    ((remark,),) = [time_remarks(*made(tmp_path, ALL, NONE, seconds=100.0))]
    assert remark.code is CourseCode.TIMES
    assert remark == "started: c1 begins 90 s after c0, whose recording lasts 100 s and 2 more: check the times"


def test_a_campaign_that_contradicts_a_recording_is_noticed(tmp_path):
    campaign, readings = made(tmp_path, ALL, ALL, zone=UTC, shift=-3600.0)
    readings[2] = replace(readings[2], started=readings[2].started - timedelta(minutes=30))
    (remark,) = time_remarks(campaign, readings)
    assert remark.code is CourseCode.TIMES
    assert remark.startswith("started: c2 differs by 30 min from the time stamp of its recording")
    assert began(campaign, readings)["c2"] == 180.0
