"""What stands around a cutter of any shape: which engagement an immersion, a block or a stepover is to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.conditions import AnyEngagement, Block, Engagement, EngagementMap, Stepover
from rcsa_ident.cutting.cutter import Cutter


@dataclass(frozen=True, slots=True, repr=False)
class Immersion(Shown):
    """A radial immersion, asked for before the cutter is known.

    `share`: radial depth over the cutter's diameter, above 0 and not above 1, which is a slot
    `strategy`: ``up`` or ``down``
    """

    share: float
    strategy: str

    def __post_init__(self) -> None:
        Engagement.from_immersion(self.share, self.strategy)

    def __str__(self) -> str:
        return "slot" if self.share == 1.0 else f"{100.0 * self.share:.4g} % immersion, {self.strategy} milling"


#: What may be asked for.
AskedEngagement = AnyEngagement | Immersion


def engagement_with(asked: AskedEngagement, cutter: Cutter) -> AnyEngagement:
    """Return how a cutter is engaged by what is asked for.

    A cylinder is engaged alike at all heights, and so is every cutter in a slot. Another shape is as wide as its outline at each height:
    an immersion is the stepover that it is at its diameter.

    Raises `InputError` if the cutter does not reach the stock.

    Examples
    --------
    >>> print(engagement_with(Immersion(0.25, "down"), Cutter(2, 0.012)))
    120° to 180°
    >>> from rcsa_ident.cutting.profile import Profile
    >>> print(engagement_with(Immersion(0.25, "down"), Cutter(2, 0.012, profile=Profile.ball(0.012))))
    stepover of 3 mm, down
    """
    if isinstance(asked, Engagement | EngagementMap):
        return asked
    if isinstance(asked, Immersion):
        if cutter.profile is None or asked.share == 1.0:
            return Engagement.from_immersion(asked.share, asked.strategy)
        return Stepover(asked.share * cutter.diameter, asked.strategy)
    widest = cutter.outline.largest_radius
    if isinstance(asked, Block) and not (asked.y_from < widest and asked.y_to > -widest):
        raise InputError("y_from and y_to", str(asked), f"a block that the cutter reaches, with a radius of {1e3 * widest:g} mm")
    if cutter.profile is not None:
        return asked
    if isinstance(asked, Stepover):
        return Engagement.from_immersion(min(asked.width / cutter.diameter, 1.0), asked.strategy)
    entry, leave = (float(np.arccos(np.clip(y / widest, -1.0, 1.0))) for y in (asked.y_to, asked.y_from))
    return Engagement(entry, leave)


def engagement_between(entry: float, leave: float, cutter: Cutter) -> AnyEngagement:
    """Return how a cutter is engaged that cuts between two angles at its diameter: up and down milling of a shape is a stepover.

    `entry`, `leave` [rad]
    """
    up, down = entry <= 1e-9, leave >= np.pi - 1e-9
    if cutter.profile is None or up == down:
        return Engagement(entry, leave)
    share = 0.5 * (np.cos(entry) - np.cos(leave))
    return Stepover(float(share) * cutter.diameter, "up" if up else "down")


def check_cut(cutter: Cutter, engagement: AnyEngagement, depth: float, feed_per_tooth: float | None) -> None:
    """Refuse a cut that a cutter cannot make: deeper than its edge, with teeth that meet, or where none of them cuts.

    `depth` [m]; `feed_per_tooth` [m]
    """
    if cutter.is_cylinder and isinstance(engagement, Engagement):
        return
    from rcsa_ident.cutting.rows import rows_of  # compiled kernels: cuts of walls are read without them

    if rows_of(cutter, engagement, depth, feed_per_tooth).count == 0:
        raise InputError("engagement", f"{engagement}, depth {1e3 * depth:g} mm", "a cut in which some tooth cuts")
