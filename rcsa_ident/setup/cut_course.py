"""The course of a campaign by what it tells of its cuts: when each was made, and how warm the machine was; and what of that cannot be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from itertools import pairwise

from rcsa_ident.base.remarks import Remark, RemarkCode
from rcsa_ident.setup.cut import Cut

#: Between two cuts that hardly belong to one campaign.
_LONGEST_PAUSE = timedelta(days=30)
#: Cuts of which all have one temperature by a thermometer that does not follow.
_FEW = 3


class CourseCode(RemarkCode):
    """What a remark on the course of a campaign is about."""

    TIMES = "cut-times"
    """Times of cuts that are missing, or that do not fit each other."""
    TEMPERATURES = "cut-temperatures"
    """Temperatures of cuts that are missing, or that do not change."""


def course_remarks(cuts: Sequence[Cut]) -> list[Remark]:
    """Return what is unusual about the times and temperatures that a campaign tells of its cuts.

    Examples
    --------
    >>> course_remarks([])
    []
    """
    told = [(cut.id, cut.started) for cut in cuts if cut.started is not None]
    found = [*_in_some_only(cuts, "started", CourseCode.TIMES, lambda cut: cut.started), *_times(told)]
    found += _in_some_only(cuts, "temperature_c", CourseCode.TEMPERATURES, lambda cut: cut.temperature)
    warm = [cut.temperature for cut in cuts if cut.temperature is not None]
    if len(warm) >= _FEW and len(set(warm)) == 1:
        words = f"temperature_c is {warm[0]:g} °C in all cuts: a thermometer near the bearings follows them; without one, leave the key out"
        found.append(Remark(CourseCode.TEMPERATURES, words))
    return found


def _in_some_only(cuts: Sequence[Cut], key: str, code: CourseCode, value: Callable[[Cut], object]) -> list[Remark]:
    without = [cut.id for cut in cuts if value(cut) is None]
    if not 0 < len(without) < len(cuts):
        return []
    given = f"{len(cuts) - len(without)} of {len(cuts)} cuts"
    missing = without[0] + (f" and {len(without) - 1} more" if len(without) > 1 else "")
    instead = "; a recording's own time stamp counts in its place" if code is CourseCode.TIMES else ""
    return [Remark(code, f"{key} is given for {given} and counts only where all have it: it is missing in {missing}{instead}")]


def _times(told: Sequence[tuple[str, datetime]]) -> list[Remark]:
    """Of cuts that tell when they were made, in the campaign's order."""
    found = []
    if back := [(one, two) for (one, first), (two, second) in pairwise(told) if second < first]:
        more = f" and {len(back) - 1} more" if len(back) > 1 else ""
        words = f"started: {back[0][1]} was made before {back[0][0]}, which stands above it{more}: the times count, not the order"
        found.append(Remark(CourseCode.TIMES, words))
    alike = [moment for moment, count in Counter(moment for _, moment in told).items() if count > 1]
    if alike:
        names = [id for id, moment in told if moment == alike[0]]
        words = f"started: {' and '.join(names[:2])} have the same time, {alike[0].isoformat()}: each cut has a time of its own"
        found.append(Remark(CourseCode.TIMES, words))
    course = sorted(told, key=lambda each: each[1])
    if far := [(one, two, (second - first).days) for (one, first), (two, second) in pairwise(course) if second - first > _LONGEST_PAUSE]:
        one, two, days = max(far, key=lambda each: each[2])
        words = f"started: {days} days lie between {one} and {two}: check the dates; a machine changes more in that time than by its warmth"
        found.append(Remark(CourseCode.TIMES, words))
    return found
