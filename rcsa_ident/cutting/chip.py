"""How thick the chip of a cut is, and which feed makes it so: flat edges take a far larger one."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.cutting.conditions import AnyEngagement
from rcsa_ident.cutting.cutter import Cutter

#: Points of a piece of the outline.
_POINTS = 65


def thickest_share(cutter: Cutter, engagement: AnyEngagement, depth: float) -> float:
    """Return the largest chip thickness over the feed per tooth, sin(phi) sin(kappa) somewhere in the cut, of equal teeth.

    `depth` [m]
    Raises `InputError` if nothing cuts.

    Examples
    --------
    A high-feed cutter whose edge lies at 12 degrees takes 4.8 times the feed of a wall:

    >>> from rcsa_ident.cutting.conditions import Engagement
    >>> from rcsa_ident.cutting.profile import Profile
    >>> cutter = Cutter(3, 0.032, profile=Profile.face(0.032, np.radians(12.0), 0.002))
    >>> round(1.0 / thickest_share(cutter, Engagement(0.0, np.pi), 0.8e-3), 2)
    4.81
    """
    most = 0.0
    for segment, low, high in cutter.outline.pieces(depth, engagement.radii, engagement.heights):
        r, z, kappa = segment.at(np.linspace(low, high, _POINTS))
        start, end = np.moveaxis(engagement.arcs(r, z), 2, 0)
        nearest = np.clip(0.5 * np.pi, start, end)
        most = max(most, float(np.max(np.where(end > start, np.sin(nearest), 0.0) * np.sin(kappa))))
    if not most > 0.0:
        raise InputError("engagement", f"{engagement}, depth {1e3 * depth:g} mm", "a cut in which some tooth cuts")
    return most


def feed_for_chip(cutter: Cutter, engagement: AnyEngagement, depth: float, chip: float) -> float:
    """Return the feed per tooth [m] at which a cut's chip is nowhere thicker than `chip` [m]; parameters as in `thickest_share`."""
    return positive("chip thickness", chip, "m") / thickest_share(cutter, engagement, depth)
