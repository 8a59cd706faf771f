"""What a campaign's cuts leave open before anything is identified: axes and directions, and what would tell causes of errors apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rcsa_ident.base.units import from_hz
from rcsa_ident.cutting.force_directions import WORTH, gain_across, lines_of, turned
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.assemble_result import ANOTHER_FEED
from rcsa_ident.identification.diagnostics import NOTHING_JUDGES, one_axis
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import MAX_FREQUENCY, Reading
from rcsa_ident.workflows.cut_times import began

#: Toolings that judge each other well: each is predicted by two at least.
ENOUGH_TO_JUDGE = 3
#: Cuts of a tooling whose speeds may come in order by chance once in a hundred campaigns or less; and correlation of those that do.
_SERIES, _IN_ORDER = 6, 0.9
#: Speeds of two cuts that are the same one, made again.
_AGAIN = 2e-3
NO_TIMES = (
    "no cut has a time: the program takes cuts to follow each other every 90 s in the campaign's order, "
    "and follows a machine that warms up less exactly; give `started` of each cut"
)
NO_THERMOMETER = (
    "not every cut has a temperature: the program follows a machine that warms up by a model of the heat of friction; "
    "a thermometer near the bearings (`temperature_c`) leaves less open"
)
NO_REPEAT = (
    "no tooling cuts twice at one speed: only a model shows whether the machine drifts; "
    "cut once more at the first speed when all others are made"
)
IN_ORDER = (
    "the speeds come in order: a change with time looks like a change with the speed; cut in random order, after half an hour of warm-up"
)
ONE_FEED = "all cuts have one feed per tooth: errors of the chip's and of the edge's force look alike; make six or more cuts at half of it"


def left_open(campaign: Campaign, readings: Sequence[Reading]) -> tuple[str, ...]:
    """Return what the usable cuts cannot tell, and what it costs, in words: of coupled planes, causes of errors, the answer's validation.

    `readings`: of its cuts, with their verdicts
    """
    usable = [each for each in readings if each.measurements]
    used = {each.cut_id for each in usable}
    cuts = [cut for cut in campaign.cuts if cut.id in used]
    if not cuts:
        return ()
    axes = {axis for each in usable for measurement in each.measurements for axis in measurement.axes}
    judged = any(cut.validation for cut in cuts) or len({cut.tooling for cut in cuts}) >= ENOUGH_TO_JUDGE
    open_ = (*_of_causes(campaign, usable, cuts), *(() if judged else (NOTHING_JUDGES,)))
    if len(axes) == 1:
        return (one_axis(Dof(next(iter(axes)))), *open_)
    lines = [lines_of(campaign.toolings[cut.tooling].cutter, cut.conditions, campaign.coefficients, from_hz(MAX_FREQUENCY)) for cut in cuts]
    if not lines or gain_across(lines, turned(lines)) <= WORTH:
        return open_
    return (f"should X and Y of the machine feel each other: {ANOTHER_FEED}", *open_)


def _of_causes(campaign: Campaign, usable: Sequence[Reading], cuts: Sequence[Cut]) -> list[str]:
    """What is missing that would tell warming, drift and wrong forces from the machine."""
    learned, times = [cut for cut in cuts if not cut.validation], began(campaign, usable)
    found = [] if times else [NO_TIMES]
    if any(cut.temperature is None for cut in cuts):
        found.append(NO_THERMOMETER)
    series = [[cut for cut in learned if cut.tooling == name and cut.last_speed is None] for name in campaign.toolings]
    if any(_in_order(own, times) for own in series):
        found.append(IN_ORDER)
    if any(len(own) >= _SERIES for own in series) and not any(_repeats(own) for own in series):
        found.append(NO_REPEAT)
    if learned and np.ptp([cut.conditions.feed_per_tooth for cut in learned]) <= 0.1 * learned[0].conditions.feed_per_tooth:
        found.append(ONE_FEED)
    return found


def _in_order(cuts: Sequence[Cut], times: dict[str, float]) -> bool:
    """Whether the speeds rise or fall with the time; of those that are cut again the first time counts."""
    course = sorted(cuts, key=lambda cut: times[cut.id]) if times else cuts
    speeds = list(dict.fromkeys(cut.conditions.spindle_speed for cut in course))
    if len(speeds) < _SERIES:
        return False
    rank = np.argsort(np.argsort(speeds))
    return bool(abs(np.corrcoef(rank, np.arange(rank.size))[0, 1]) > _IN_ORDER)


def _repeats(cuts: Sequence[Cut]) -> bool:
    speeds = np.sort([cut.conditions.spindle_speed for cut in cuts])
    return bool(np.any(np.diff(speeds) <= _AGAIN * speeds[1:]))
