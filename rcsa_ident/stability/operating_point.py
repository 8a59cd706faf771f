"""A cut that is recommended: its speed and depth, what it takes from the spindle, and how the depth follows from the stability limit."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_cm3_per_min, to_rpm
from rcsa_ident.cutting.power import spindle_load
from rcsa_ident.cutting.process import MillingProcess


class Bound(StrEnum):
    """What ends the depth at a speed."""

    CHATTER = "chatter"
    POWER = "power"
    TORQUE = "torque"
    SPEED = "speed"
    DEPTH = "depth"
    #: The depth is beyond the tool's cutting edge, or the vibration at the limit outside of the frequencies that are known.
    EDGE = "edge"
    FREQUENCY = "frequency"


@dataclass(frozen=True, slots=True, repr=False)
class HeldBack(Shown):
    """How a recommended depth follows from the stability limit, step by step.

    `limit` [m]: at the speed itself
    `within_tolerance` [m]: the lowest limit within the tolerance of the speed
    `with_probability` [m]: up to which so large a share of the possible machines is stable within that tolerance; None where none were
        drawn
    `depth` [m]: less the reserve
    `tolerance`, `probability`, `reserve`: shares
    """

    limit: float
    within_tolerance: float
    with_probability: float | None
    depth: float
    tolerance: float
    probability: float
    reserve: float

    def __str__(self) -> str:
        steps = [
            f"stability limit {1e3 * self.limit:.2f} mm",
            f"{1e3 * self.within_tolerance:.2f} mm within ±{100.0 * self.tolerance:g} % of the speed",
        ]
        if self.with_probability is not None:
            steps.append(f"{1e3 * self.with_probability:.2f} mm with a probability of {100.0 * self.probability:g} %")
        return " → ".join([*steps, f"{1e3 * self.depth:.2f} mm less {100.0 * self.reserve:g} %"])


@dataclass(frozen=True, slots=True, repr=False)
class OperatingPoint(Shown):
    """A cut that is recommended.

    Parameters
    ----------
    spindle_speed : float [rad/s]
    depth : float [m]
        Infinite where nothing limits the cut up to the depth that was searched: no depth is recommended.
    limit : float [m]
        The stability limit there, up to the largest depth.
    bound : Bound
        What stands against more depth.
    removal_rate : float or None [m^3/s]
        None without a feed or a depth, as are power and torque.
    power : float or None [W]
    torque : float or None [N m]
    held : HeldBack or None
        How the depth follows from the limit, where chatter limits it.
    why : str
        Why no depth is recommended; empty where one is.
    """

    spindle_speed: float
    depth: float
    limit: float
    bound: Bound
    removal_rate: float | None
    power: float | None
    torque: float | None
    held: HeldBack | None = None
    why: str = ""

    def __str__(self) -> str:
        if self.depth == np.inf:
            return f"{to_rpm(self.spindle_speed):.0f} rev/min: {self.unlimited}"
        depths = f"stability limit {1e3 * self.limit:.2f} mm, recommended {1e3 * self.depth:.2f} mm"
        ended = "" if self.bound is Bound.CHATTER else f" (ended by {self.bound})"
        removed = "" if self.removal_rate is None else f", {to_cm3_per_min(self.removal_rate):.0f} cm³/min"
        taken = "" if self.power is None else f", {1e-3 * self.power:.2g} kW"
        return f"{to_rpm(self.spindle_speed):.0f} rev/min: {depths}{ended}{removed}{taken}"

    @property
    def unlimited(self) -> str:
        """What is said in place of a depth where none is recommended."""
        return self.why or f"nothing up to {1e3 * self.limit:g} mm limits the cut, so no depth is recommended"

    def without_depth(self, bound: Bound, why: str) -> OperatingPoint:
        """Return the same speed and limit, where for a reason no depth is recommended."""
        return OperatingPoint(self.spindle_speed, np.inf, self.limit, bound, None, None, None, None, why)


def operating_point(
    process: MillingProcess, speed: float, depth: float, limit: float, bound: Bound, held: HeldBack | None = None
) -> OperatingPoint:
    """Return a recommended cut with what it takes from the spindle, as far as a feed and a depth tell it."""
    if process.feed_per_tooth is None or depth == np.inf:
        return OperatingPoint(speed, depth, limit, bound, None, None, None, held)
    load = spindle_load(process.cutter, process.conditions(speed, depth), process.coefficients)
    return OperatingPoint(speed, depth, limit, bound, load.removal_rate, load.power, load.torque, held)
