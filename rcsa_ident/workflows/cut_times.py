"""When the cuts of a campaign were made: by its file, or by time stamps of their recordings; and where these contradict each other."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np

from rcsa_ident.base.remarks import Remark
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut_course import CourseCode
from rcsa_ident.signals.measurement import Reading

#: By which the two clocks may drift apart within a campaign; that one of them is off, or in another time zone, does no harm [s].
_APART = 120.0


def began(campaign: Campaign, readings: Sequence[Reading]) -> dict[str, float]:
    """Return when each cut's recording began, since the first one [s]; empty where that is not known of every cut that was read.

    A cut of which the campaign tells no time has that of its recording's time stamp, by the campaign's clock.
    """
    told, stamps = _told(campaign), _stamps(readings)
    known: dict[str, datetime] = told
    if missing := [each.cut_id for each in readings if each.cut_id not in told]:
        offset = _offsets(told, stamps)
        if any(id not in stamps for id in missing) or (any(each.cut_id in told for each in readings) and not offset):
            return {}
        shift = timedelta(seconds=float(np.median(list(offset.values()))) if offset else 0.0)
        # all on one clock: that of the campaign where it has one
        known = {id: _plain(moment) + shift for id, moment in stamps.items()} | {id: _plain(moment) for id, moment in told.items()}
    moments = {each.cut_id: known[each.cut_id] for each in readings}
    first = min(moments.values())
    return {id: (moment - first).total_seconds() for id, moment in moments.items()}


def time_remarks(campaign: Campaign, readings: Sequence[Reading]) -> list[Remark]:
    """Return where the times of cuts contradict the lengths or the time stamps of their recordings."""
    found, told = [], _told(campaign)
    lasts = {each.cut_id: each.seconds for each in readings}
    course = sorted(((moment, id) for id, moment in told.items() if id in lasts), key=lambda each: each[0])
    early = [(one, two, (second - first).total_seconds()) for (first, one), (second, two) in pairwise(course) if second > first]
    over = [(one, two, pause) for one, two, pause in early if pause < lasts[one]]
    if over:
        one, two, pause = over[0]
        more = f" and {len(over) - 1} more" if len(over) > 1 else ""
        words = f"started: {two} begins {pause:.3g} s after {one}, whose recording lasts {lasts[one]:.3g} s{more}: check the times"
        found.append(Remark(CourseCode.TIMES, words))
    apart = _offsets(told, _stamps(readings))
    middle = float(np.median(list(apart.values()))) if apart else 0.0
    off = {id: value - middle for id, value in apart.items() if abs(value - middle) > _APART}
    if off:
        id = max(off, key=lambda each: abs(off[each]))
        more = f"; {len(off) - 1} more" if len(off) > 1 else ""
        words = (
            f"started: {id} differs by {abs(off[id]) / 60.0:.3g} min from the time stamp of its recording, all clocks set alike{more}: "
            "the campaign's time counts; check whether recordings were mixed up"
        )
        found.append(Remark(CourseCode.TIMES, words))
    return found


def _told(campaign: Campaign) -> dict[str, datetime]:
    return {cut.id: cut.started for cut in campaign.cuts if cut.started is not None}


def _stamps(readings: Sequence[Reading]) -> dict[str, datetime]:
    return {each.cut_id: each.started for each in readings if each.started is not None}


def _plain(moment: datetime) -> datetime:
    """The moment by its own clock, whatever zone that is in."""
    return moment.replace(tzinfo=None) if moment.tzinfo is None else (moment - (moment.utcoffset() or timedelta(0))).replace(tzinfo=None)


def _offsets(told: dict[str, datetime], stamps: dict[str, datetime]) -> dict[str, float]:
    """By how much the campaign's clock is ahead of that of the recordings, for each cut that has both [s]."""
    return {id: (_plain(told[id]) - _plain(moment)).total_seconds() for id, moment in stamps.items() if id in told}
