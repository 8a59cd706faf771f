"""Limits that are written down."""

from __future__ import annotations

import numpy as np

from rcsa_ident.stability.result import StabilityLobes


def lobes(depth, speed=None, drawn=None, deepest=10e-3, chatter=5e3) -> StabilityLobes:
    """Limits [m] at speeds [rad/s], by default from 500 on in steps of 100."""
    depth = np.asarray(depth, dtype=float)
    speed = 500.0 + 100.0 * np.arange(depth.size) if speed is None else np.asarray(speed)
    infinite = np.isinf(depth)
    return StabilityLobes(
        speed, depth, np.where(infinite, np.nan, chatter), np.where(infinite, -1, 2), deepest, "by hand", 1e-3, 5e3, drawn=drawn
    )
