"""The order in which planned cuts are made: random and seeded, tooling by tooling, with a second feed and a repeat at the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.workflows.plan import PlannedCut, limits_at
from rcsa_ident.workflows.plan_course import Purpose, in_course, names_of
from tests.workflows.test_plan import ALLOWED, COEFFICIENTS, RPM, machine_of

SPEEDS = (9000.0, 10_500.0, 12_000.0, 14_000.0, 17_000.0)


def cuts_of(toolings, depth=1e-4):
    conditions = [CuttingConditions(rpm * RPM, depth, 1e-4, ALLOWED.engagement, 0.0) for rpm in SPEEDS]
    return [PlannedCut(tooling.name, each, 1e-3) for tooling in toolings for each in conditions]


def course_of(toolings, seed=1, cuts=None, allowed=ALLOWED):
    return in_course(cuts_of(toolings) if cuts is None else cuts, machine_of(), toolings, allowed, COEFFICIENTS, seed)


@pytest.fixture(scope="module")
def course(toolings):
    return course_of(toolings)


def test_every_planned_cut_is_made_once_and_the_first_one_again(course, toolings):
    names = names_of(cuts_of(toolings))
    assert [each.tooling for each in course] == [tooling.name for tooling in toolings]
    assert sorted(turn.id for each in course for turn in each.cuts if turn.purpose is Purpose.TIP) == sorted(names)
    for each in course:
        assert {turn.cut.tooling for turn in each.cuts} == {each.tooling}
        *_, last = each.cuts
        assert last.purpose is Purpose.DRIFT
        assert [turn.purpose for turn in each.cuts].count(Purpose.DRIFT) == 1
        assert last.cut == each.cuts[0].cut
        assert each.cuts[0].purpose is Purpose.TIP
        assert each.warm_up_speed == pytest.approx(np.sqrt(8000.0 * 20_000.0) * RPM)


def test_the_order_has_a_seed(toolings, course):
    def speeds(found):
        return [turn.cut.conditions.spindle_speed for each in found for turn in each.cuts]

    assert speeds(course_of(toolings)) == speeds(course)
    assert speeds(course_of(toolings, seed=2)) != speeds(course)


def test_six_cuts_have_half_the_feed_and_are_stable(course, toolings):
    further = [turn.cut for each in course for turn in each.cuts if turn.purpose is Purpose.FORCES]
    assert len(further) == 6
    across = 0
    for cut in further:
        made = cut.conditions
        assert made.feed_per_tooth == pytest.approx(5e-5)
        (tooling,) = (each for each in toolings if each.name == cut.tooling)
        around = made.spindle_speed * np.array([0.99, 1.0, 1.01])
        slow = replace(ALLOWED, feed_per_tooth=5e-5)
        limits = limits_at(machine_of(), tooling, slow, COEFFICIENTS, made.feed_angle, around)
        assert limits.min() >= ALLOWED.margin * made.axial_depth
        across += made.feed_angle != 0.0
    assert across == 6


@pytest.mark.parametrize(("along", "across"), [(0.0, 0.5 * np.pi), (0.5 * np.pi, np.pi)])
def test_across_only_where_that_is_stable(toolings, along, across):
    """Depths that both directions of the feed allow, or only that of the plan."""
    machine, (tooling, *_) = machine_of(), toolings
    speeds = np.array(SPEEDS) * RPM
    limits = [
        np.min([limits_at(machine, tooling, ALLOWED, COEFFICIENTS, angle, f * speeds) for f in (0.99, 1.0, 1.01)], axis=0)
        for angle in (along, across)
    ]
    k = int(np.argmax(np.abs(np.log(limits[0] / limits[1]))))
    between = float(np.sqrt(limits[0][k] * limits[1][k])) / ALLOWED.margin
    for depth in (0.5 * min(limits[0][k], limits[1][k]) / ALLOWED.margin, between):
        allowed = replace(ALLOWED, depths=(depth,), feed_angle=along)
        made = CuttingConditions(speeds[k], depth, 1e-4, ALLOWED.engagement, along)
        (found,) = course_of([tooling], cuts=[PlannedCut(tooling.name, made, 1e-3)], allowed=allowed)
        (further,) = (turn.cut for turn in found.cuts if turn.purpose is Purpose.FORCES)
        stable = limits[1][k] >= ALLOWED.margin * depth
        assert further.conditions.feed_angle == pytest.approx(across if stable else along)
