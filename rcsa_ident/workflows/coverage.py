"""What a campaign's cuts leave open before anything is identified: axes that were not recorded, directions that nobody pushed in."""

from __future__ import annotations

from collections.abc import Sequence

from rcsa_ident.base.units import from_hz
from rcsa_ident.cutting.force_directions import WORTH, gain_across, lines_of, turned
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.assemble_result import ANOTHER_FEED
from rcsa_ident.identification.diagnostics import NOTHING_JUDGES, one_axis
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.signals.measurement import MAX_FREQUENCY, Reading

#: Toolings that judge each other well: each is predicted by two at least.
ENOUGH_TO_JUDGE = 3


def left_open(campaign: Campaign, readings: Sequence[Reading]) -> tuple[str, ...]:
    """Return what the usable cuts cannot tell of planes that feel each other, and whether nothing judges the answer, in words.

    `readings`: of its cuts, with their verdicts
    """
    usable = {each.cut_id for each in readings if each.measurements}
    axes = {axis for each in readings for measurement in each.measurements for axis in measurement.axes}
    made = {cut.tooling for cut in campaign.cuts if cut.id in usable}
    judged = any(cut.validation for cut in campaign.cuts if cut.id in usable) or len(made) >= ENOUGH_TO_JUDGE
    open_ = () if judged or not made else (NOTHING_JUDGES,)
    if len(axes) == 1:
        return (one_axis(Dof(next(iter(axes)))), *open_)
    lines = [
        lines_of(campaign.toolings[cut.tooling].cutter, cut.conditions, campaign.coefficients, from_hz(MAX_FREQUENCY))
        for cut in campaign.cuts
        if cut.id in usable
    ]
    if not lines or gain_across(lines, turned(lines)) <= WORTH:
        return open_
    return (f"should X and Y of the machine feel each other: {ANOTHER_FEED}", *open_)
