"""What the machinist sets: speed, depth, feed, immersion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError, non_negative, positive
from rcsa_ident.shown import Shown
from rcsa_ident.units import to_rpm


@dataclass(frozen=True, slots=True, repr=False)
class Engagement(Shown):
    """Between which immersion angles the teeth cut.

    Angles are measured clockwise from the normal direction Y (the feed is X), as in [inprocess]: half-immersion
    down-milling is pi/2 to pi, slotting 0 to pi.

    Parameters
    ----------
    entry, exit : float [rad], 0 <= entry < exit <= pi

    Examples
    --------
    >>> half = Engagement.from_immersion(0.5, "down")
    >>> [round(float(np.degrees(angle)), 6) for angle in (half.entry, half.exit)]
    [90.0, 180.0]
    """

    entry: float
    exit: float

    def __post_init__(self) -> None:
        if not (0.0 <= self.entry < self.exit <= np.pi + 1e-9):
            degrees = f"{np.degrees(self.entry):g} and {np.degrees(self.exit):g} degrees"
            raise InputError("entry and exit angle", degrees, "0 <= entry < exit <= 180 degrees")

    @classmethod
    def from_immersion(cls, immersion: float, strategy: str) -> Engagement:
        """Return the engagement of a radial immersion a_e/D in (0, 1] for ``up`` or ``down`` milling."""
        if not 0.0 < positive("immersion", immersion) <= 1.0:
            raise InputError("immersion", immersion, "radial depth over diameter, above 0 and not above 1")
        if strategy == "up":
            return cls(0.0, float(np.arccos(1.0 - 2.0 * immersion)))
        if strategy == "down":
            return cls(float(np.arccos(2.0 * immersion - 1.0)), float(np.pi))
        raise InputError("strategy", strategy, "up or down")

    @property
    def immersion(self) -> float:
        """Width of the cut over the cutter's diameter, (cos entry - cos exit) / 2 [-]."""
        return float(0.5 * (np.cos(self.entry) - np.cos(self.exit)))

    def __str__(self) -> str:
        return f"{np.degrees(self.entry):.4g}° to {np.degrees(self.exit):.4g}°"


#: An engagement that changes along the edge: spindle speed [rad/s] and axial depth [m] to an array, shape (k, 4), whose rows say
#: between which shares of the depth, counted from the tip, a part of the edge lies, and between which angles [rad] it cuts.
EngagementProfile = Callable[[float, float], FloatArray]


@dataclass(frozen=True, slots=True, repr=False)
class CuttingConditions(Shown):
    """A cut with constant conditions.

    Parameters
    ----------
    spindle_speed : float [rad/s]
    axial_depth : float [m]
    feed_per_tooth : float [m]
    engagement : Engagement
    feed_angle : float [rad], default 0
        Direction of the feed in the machine's X-Y plane, from +X towards +Y.
    """

    spindle_speed: float
    axial_depth: float
    feed_per_tooth: float
    engagement: Engagement
    feed_angle: float = 0.0

    def __post_init__(self) -> None:
        positive("spindle_speed", self.spindle_speed, "rad/s")
        non_negative("axial_depth", self.axial_depth, "m")
        non_negative("feed_per_tooth", self.feed_per_tooth, "m")
        if not np.isfinite(self.feed_angle):
            raise InputError("feed_angle", self.feed_angle, "a finite angle [rad]")

    @property
    def machine_from_feed(self) -> np.ndarray:
        """Rotation from (feed, normal) to machine (X, Y), shape (2, 2)."""
        c, s = np.cos(self.feed_angle), np.sin(self.feed_angle)
        return np.array([[c, -s], [s, c]])

    def __str__(self) -> str:
        depth, feed = 1e3 * self.axial_depth, 1e3 * self.feed_per_tooth
        cut = f"{to_rpm(self.spindle_speed):.0f} rev/min, depth {depth:.3g} mm, {feed:.3g} mm per tooth"
        return f"{cut}, {self.engagement}, feed {feed_direction(self.feed_angle)}"


def feed_direction(angle: float) -> str:
    """Return the direction of a feed in words, from its angle [rad]: an axis of the machine, or degrees from +X."""
    quarter = angle / (0.5 * np.pi)
    along = abs(quarter - round(quarter)) < 1e-9
    return ("+X", "+Y", "-X", "-Y")[round(quarter) % 4] if along else f"{np.degrees(angle):.4g}° from +X"
