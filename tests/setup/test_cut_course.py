"""What a campaign tells of the times and temperatures of its cuts, and what of that cannot be."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta

import pytest

from rcsa_ident.setup.cut_course import CourseCode, course_remarks
from tests.fixtures import by_hand

BEGAN = datetime(2026, 1, 5, 8)


@pytest.fixture
def cuts(tmp_path):
    """Four cuts, 90 s from one to the next, each warmer than the one before."""
    (cut, *_) = by_hand.campaign(tmp_path).cuts
    return [replace(cut, id=f"c{k}", started=BEGAN + timedelta(seconds=90.0 * k), temperature=22.0 + k) for k in range(4)]


def said(cuts):
    return [(remark.code, str(remark)) for remark in course_remarks(cuts)]


def test_a_course_that_fits_is_not_remarked_on(cuts):
    assert said(cuts) == []
    assert said([replace(cut, started=None, temperature=None) for cut in cuts]) == []


def test_cuts_out_of_order_are_said_and_not_refused(cuts):
    ((code, words),) = said([cuts[0], cuts[2], cuts[1], cuts[3]])
    assert code is CourseCode.TIMES
    assert words == "started: c1 was made before c2, which stands above it: the times count, not the order"
    ((_, words),) = said(cuts[::-1])
    assert words.startswith("started: c2 was made before c3, which stands above it and 2 more")


def test_two_cuts_at_one_time_are_noticed(cuts):
    ((code, words),) = said([*cuts[:3], replace(cuts[3], started=cuts[1].started)])[1:]
    assert code is CourseCode.TIMES
    assert words.startswith("started: c1 and c3 have the same time, 2026-01-05T08:01:30")


@pytest.mark.parametrize(("days", "noticed"), [(29, False), (31, True)])
def test_times_far_apart_are_noticed(cuts, days, noticed):
    found = said([*cuts[:3], replace(cuts[3], started=cuts[2].started + timedelta(days=days))])
    assert [words.partition(":")[2].split(" lie")[0] for _, words in found] == [" 31 days"] * noticed


@pytest.mark.parametrize(("key", "name", "code"), [("started", "started", "TIMES"), ("temperature", "temperature_c", "TEMPERATURES")])
def test_a_value_in_some_cuts_only_is_said(cuts, key, name, code):
    ((found, words),) = said([cuts[0], *(replace(cut, **{key: None}) for cut in cuts[1:3]), cuts[3]])
    assert found is CourseCode[code]
    assert words.startswith(f"{name} is given for 2 of 4 cuts and counts only where all have it: it is missing in c1 and 1 more")


def test_a_thermometer_that_stands_still_is_noticed(cuts):
    still = [replace(cut, temperature=22.0) for cut in cuts]
    ((code, words),) = said(still)
    assert code is CourseCode.TEMPERATURES
    assert words.startswith("temperature_c is 22 °C in all cuts")
    assert said(still[:2]) == []
