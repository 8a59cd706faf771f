"""In which order planned cuts are made, and which further ones tell warming, drift and wrong forces from the machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.workflows.plan import CutConstraints, PlannedCut, limits_at
from rcsa_ident.workflows.prospects import SPACING

#: For which the spindle turns before the first cut of each tooling [s].
WARM_UP = 1800.0
#: Cuts at the second feed that are enough to have forces of their own, and that feed over the first.
SECOND_FEED, FEED_RATIO = 6, 0.5


class Purpose(StrEnum):
    """What a cut is made for."""

    TIP = "tooltip"
    FORCES = "second feed"
    DRIFT = "repeat"


@dataclass(frozen=True, slots=True)
class CourseCut:
    """A cut in its turn."""

    id: str
    cut: PlannedCut
    purpose: Purpose


@dataclass(frozen=True, slots=True)
class Course:
    """What is made with one tooling, in this order.

    `warm_up_speed` [rad/s]: at which the spindle turns for `WARM_UP` before the first cut
    """

    tooling: str
    warm_up_speed: float
    cuts: tuple[CourseCut, ...]


def names_of(cuts: Sequence[PlannedCut]) -> list[str]:
    """Return an id for each cut: tooling and place in the plan."""
    return [f"{cut.tooling}-plan-{i:02d}" for i, cut in enumerate(cuts, start=1)]


def in_course(
    cuts: Sequence[PlannedCut],
    machine: IdentifiedMachine,
    toolings: Sequence[Tooling],
    allowed: CutConstraints,
    coefficients: CuttingCoefficients,
    seed: int,
) -> tuple[Course, ...]:
    """Return planned cuts in the order in which they are made: tooling by tooling, speeds in random order, the first once more at the end.

    Among them are `SECOND_FEED` cuts at half the feed per tooth, across the first feed where that is stable.

    `machine`, `toolings`, `allowed`, `coefficients`: as of `plan_cuts`
    `seed`: of the order
    """
    rng, found = np.random.default_rng(seed), []
    warm_up = float(np.sqrt(allowed.lowest * allowed.highest))
    named = list(zip(names_of(cuts), cuts, strict=True))
    present = [tooling for tooling in toolings if any(cut.tooling == tooling.name for cut in cuts)]
    for number, tooling in enumerate(present):
        own = [CourseCut(name, cut, Purpose.TIP) for name, cut in named if cut.tooling == tooling.name]
        share = SECOND_FEED // len(present) + (number < SECOND_FEED % len(present))
        further = _at_second_feed([each.cut for each in own], machine, tooling, allowed, coefficients, share)
        own += [CourseCut(f"{tooling.name}-feed-{i:02d}", cut, Purpose.FORCES) for i, cut in enumerate(further, start=1)]
        course = [own[k] for k in rng.permutation(len(own))]
        # what shall be comparable at the end has the feed of the plan
        first = next(k for k, each in enumerate(course) if each.purpose is Purpose.TIP)
        course[0], course[first] = course[first], course[0]
        if len(course) > 1:
            course.append(CourseCut(f"{tooling.name}-repeat", course[0].cut, Purpose.DRIFT))
        found.append(Course(tooling.name, warm_up, tuple(course)))
    return tuple(found)


def _at_second_feed(
    cuts: Sequence[PlannedCut],
    machine: IdentifiedMachine,
    tooling: Tooling,
    allowed: CutConstraints,
    coefficients: CuttingCoefficients,
    count: int,
) -> list[PlannedCut]:
    """Some of the cuts over all their speeds, with half the feed per tooth, and across where that is stable."""
    course = sorted(cuts, key=lambda cut: cut.conditions.spindle_speed)
    places = np.unique(np.round(np.linspace(0, len(course) - 1, min(count, len(course)))).astype(int)).tolist()
    return [_slower(course[k], machine, tooling, allowed, coefficients) for k in places]


def _slower(
    cut: PlannedCut, machine: IdentifiedMachine, tooling: Tooling, allowed: CutConstraints, coefficients: CuttingCoefficients
) -> PlannedCut:
    made = cut.conditions
    across = made.feed_angle + (0.5 if made.feed_angle == allowed.feed_angle else -0.5) * np.pi
    feed = FEED_RATIO * made.feed_per_tooth
    slower = replace(allowed, feed_per_tooth=feed, chip_thickness=None)
    around = made.spindle_speed * np.array([1.0 - SPACING, 1.0, 1.0 + SPACING])
    for angle in (across, made.feed_angle):
        limit = float(limits_at(machine, tooling, slower, coefficients, angle, around).min())
        if allowed.margin * made.axial_depth <= limit:
            break
    chosen = CuttingConditions(made.spindle_speed, made.axial_depth, feed, made.engagement, angle)
    return PlannedCut(tooling.name, chosen, limit)
