"""What a cut asks of the spindle, and what the spindle has: torque, power, removal rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import FloatArray, frozen
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement, same_everywhere
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.errors import InputError, positive
from rcsa_ident.shown import Shown
from rcsa_ident.units import to_rpm


@dataclass(frozen=True, slots=True)
class SpindleLoad:
    """What a cut takes from the spindle, as means over a revolution.

    Parameters
    ----------
    torque : float [N m]
    power : float [W]
    removal_rate : float [m^3/s]
    """

    torque: float
    power: float
    removal_rate: float


def radial_depth(cutter: Cutter, engagement: Engagement) -> float:
    """Return the width of cut a_e [m]: slotting takes the diameter."""
    return 0.5 * cutter.diameter * float(np.cos(engagement.entry) - np.cos(engagement.exit))


def spindle_load(cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients) -> SpindleLoad:
    """Return what a cut takes from the spindle; the power that feeds the table is left out, it is a few thousandths.

    T = a D / (4 pi) (K_tc N c (cos phi_entry - cos phi_exit) + K_te N (phi_exit - phi_entry)) with the feed per tooth c;
    power T Omega, of which the chips take K_tc times the removal rate a a_e N c Omega / (2 pi). Pitch, helix and, for the
    chips' part, run-out change none of it.

    Parameters
    ----------
    cutter : Cutter
    conditions : CuttingConditions
    coefficients : CuttingCoefficients
    """
    engagement, teeth = same_everywhere(conditions.engagement), cutter.teeth
    chips = coefficients.tangential * conditions.feed_per_tooth * (np.cos(engagement.entry) - np.cos(engagement.exit))
    edges = coefficients.tangential_edge * (engagement.exit - engagement.entry)
    torque = conditions.axial_depth * cutter.diameter * teeth / (4.0 * np.pi) * float(chips + edges)
    per_second = teeth * conditions.feed_per_tooth * conditions.spindle_speed / (2.0 * np.pi)
    return SpindleLoad(torque, torque * conditions.spindle_speed, conditions.axial_depth * radial_depth(cutter, engagement) * per_second)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SpindleDrive(Shown):
    """What a spindle's motor has at each speed; between the given speeds straight lines, outside the nearest of them.

    Parameters
    ----------
    speed : array, shape (k,) [rad/s]
        Rising.
    power : array, shape (k,) [W]
        Infinite where nothing is known.
    torque : array, shape (k,) [N m]
    max_speed : float [rad/s]
    """

    speed: FloatArray
    power: FloatArray
    torque: FloatArray
    max_speed: float = float("inf")

    def __post_init__(self) -> None:
        for name in ("speed", "power", "torque"):
            object.__setattr__(self, name, frozen(np.atleast_1d(getattr(self, name))))
            if getattr(self, name).shape != self.speed.shape or not np.all(getattr(self, name) > 0.0):
                raise InputError(name, getattr(self, name).tolist(), f"{self.speed.size} numbers above 0")
        if not np.all(np.isfinite(self.speed)) or np.any(np.diff(self.speed) <= 0.0):
            raise InputError("speed", self.speed.tolist(), "finite, increasing speeds [rad/s]")
        if not self.max_speed > 0.0:
            raise InputError("max_speed", self.max_speed, "a speed above 0 [rad/s]")

    @classmethod
    def flat(cls, power: float | None = None, torque: float | None = None, max_speed: float | None = None) -> SpindleDrive:
        """Return a drive with the same power and torque at all speeds; None is no limit.

        Parameters
        ----------
        power : float or None [W]
        torque : float or None [N m]
        max_speed : float or None [rad/s]
        """
        numbers = (("power", power, "W"), ("torque", torque, "N m"), ("max_speed", max_speed, "rad/s"))
        values = [np.inf if value is None else positive(name, value, unit) for name, value, unit in numbers]
        return cls(np.ones(1), np.array([values[0]]), np.array([values[1]]), values[2])

    def limited(self, other: SpindleDrive) -> SpindleDrive:
        """Return the drive that has what both have."""
        speed = np.union1d(self.speed, other.speed)
        for name in ("power", "torque"):
            with np.errstate(invalid="ignore"):
                above = _between(speed, self.speed, getattr(self, name)) - _between(speed, other.speed, getattr(other, name))
            crosses = np.flatnonzero(np.isfinite(above[:-1] + above[1:]) & (above[:-1] * above[1:] < 0.0))
            share = above[crosses] / (above[crosses] - above[crosses + 1])
            speed = np.union1d(speed, speed[crosses] + share * (speed[crosses + 1] - speed[crosses]))
        power, torque = (
            np.minimum(_between(speed, self.speed, getattr(self, name)), _between(speed, other.speed, getattr(other, name)))
            for name in ("power", "torque")
        )
        return SpindleDrive(speed, power, torque, min(self.max_speed, other.max_speed))

    def power_at(self, speed: FloatArray) -> FloatArray:
        """Return the power at some speeds [W], 0 beyond the highest speed."""
        return np.where(np.asarray(speed) <= self.max_speed * (1.0 + 1e-12), _between(speed, self.speed, self.power), 0.0)

    def torque_at(self, speed: FloatArray) -> FloatArray:
        """Return the torque at some speeds [N m], 0 beyond the highest speed."""
        return np.where(np.asarray(speed) <= self.max_speed * (1.0 + 1e-12), _between(speed, self.speed, self.torque), 0.0)

    def __str__(self) -> str:
        parts = ((1e-3 * float(self.power.max()), "kW"), (float(self.torque.max()), "N m"), (to_rpm(self.max_speed), "rev/min"))
        return ", ".join(f"up to {value:.5g} {unit}" for value, unit in parts if np.isfinite(value)) or "no limit"


def _between(at: FloatArray, speed: FloatArray, values: FloatArray) -> FloatArray:
    """Straight lines; where one end is unknown nothing limits."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(np.shape(at), np.inf)
    line = np.interp(at, speed[known], values[known])
    if known.all():
        return line
    return np.where(np.interp(at, speed, (~known).astype(float)) > 0.0, np.inf, line)
