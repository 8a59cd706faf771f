"""What a cut asks of the spindle, and what the spindle has: torque, power, removal rate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.plausibility import POWER, SPINDLE_SPEED, TORQUE, Range, remarks_of
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.rows import rows_of


@dataclass(frozen=True, slots=True)
class SpindleLoad:
    """What a cut takes from the spindle, as means over a revolution.

    `torque` [N m]; `power` [W]; `removal_rate` [m^3/s]
    """

    torque: float
    power: float
    removal_rate: float


def radial_depth(cutter: Cutter, engagement: Engagement) -> float:
    """Return the width of cut a_e [m]: slotting takes the diameter."""
    return 0.5 * cutter.diameter * float(np.cos(engagement.entry) - np.cos(engagement.exit))


def spindle_load(cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients) -> SpindleLoad:
    """Return what a cut takes from the spindle; the power that feeds the table is left out, it is a few thousandths.

    T = (K_tc V + K_te W) / (2 pi) with the chip volume V and the area W over which edges rub, both in a turn; power T Omega, of which
    the chips take K_tc times the removal rate V Omega / (2 pi). V is the feed per turn times the area that it sweeps, whatever the
    shape; of a wall V = N c a a_e with the feed per tooth c, and W = N a (phi_exit - phi_entry) D / 2. Pitch, helix and, for the chips'
    part, run-out change none of it.

    `cutter`: its run-out is left aside
    """
    volume, rubbed = _in_a_turn(cutter, conditions)
    torque = (coefficients.tangential * volume + coefficients.tangential_edge * rubbed) / (2.0 * np.pi)
    return SpindleLoad(torque, torque * conditions.spindle_speed, volume * conditions.spindle_speed / (2.0 * np.pi))


def _in_a_turn(cutter: Cutter, conditions: CuttingConditions) -> tuple[float, float]:
    """Chip volume [m^3], and the area over which edges rub [m^2]."""
    engagement, feed, depth = conditions.engagement, conditions.feed_per_tooth, conditions.axial_depth
    if cutter.is_cylinder and isinstance(engagement, Engagement):
        rubbed = 0.5 * cutter.diameter * (engagement.exit - engagement.entry)
        return cutter.teeth * depth * feed * radial_depth(cutter, engagement), cutter.teeth * depth * rubbed
    if depth == 0.0:
        return 0.0, 0.0
    rows = rows_of(cutter.running_true(), engagement, depth, feed)
    swept = rows.end - rows.start
    chip = np.sin(rows.kappa) * (rows.feed * (np.cos(rows.start) - np.cos(rows.end)) + rows.step * swept)
    around = rows.r * rows.width * (2.0 * np.pi / rows.spacing)
    return float(around @ chip), float(around @ swept)


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

    Examples
    --------
    32 N m up to 6000 rev/min, 20 kW from there on:

    >>> import rcsa_ident as ri
    >>> drive = ri.SpindleDrive(ri.rpm(1000, 6000, 5000), [3.35e3, 20.1e3], [32.0, 32.0], max_speed=ri.rpm(18_000))
    >>> print(drive)
    up to 20.1 kW, up to 32 N m, up to 18000 rev/min
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
        for name, kind, value in self._values:
            kind.checked(name, value)

    @property
    def _values(self) -> Iterator[tuple[str, Range, float]]:
        """The limits that are known: field, range and value."""
        for name, kind in (("power", POWER), ("torque", TORQUE), ("max_speed", SPINDLE_SPEED)):
            values = np.atleast_1d(getattr(self, name))
            known = values[np.isfinite(values)]
            yield from ((name, kind, value) for value in sorted({known.min(), known.max()} if known.size else set()))

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about it, as a wrong unit would make it."""
        return tuple(dict.fromkeys(remarks_of(self._values)))

    @classmethod
    def flat(cls, power: float | None = None, torque: float | None = None, max_speed: float | None = None) -> SpindleDrive:
        """Return a drive with the same power and torque at all speeds; None is no limit.

        Parameters
        ----------
        power : float or None [W]
        torque : float or None [N m]
        max_speed : float or None [rad/s]

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> print(ri.SpindleDrive.flat(power=15e3, max_speed=ri.rpm(24_000)))
        up to 15 kW, up to 24000 rev/min
        """
        numbers = (("power", power, "W"), ("torque", torque, "N m"), ("max_speed", max_speed, "rad/s"))
        values = [np.inf if value is None else positive(name, value, unit) for name, value, unit in numbers]
        return cls(np.ones(1), np.array([values[0]]), np.array([values[1]]), values[2])

    def limited(self, other: SpindleDrive) -> SpindleDrive:
        """Return the drive that has what both have.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> drive = ri.SpindleDrive.flat(power=15e3)
        >>> print(drive.limited(ri.SpindleDrive.flat(torque=40.0)))
        up to 15 kW, up to 40 N m
        """
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
        """Return the power at some speeds [W], 0 beyond the highest speed.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> drive = ri.SpindleDrive(ri.rpm(1000, 6000, 5000), [3e3, 18e3], [30.0, 30.0], max_speed=ri.rpm(18_000))
        >>> drive.power_at(ri.rpm(2000, 20_000, 9000)).round(1).tolist()
        [6000.0, 18000.0, 0.0]
        """
        return np.where(np.asarray(speed) <= self.max_speed * (1.0 + 1e-12), _between(speed, self.speed, self.power), 0.0)

    def torque_at(self, speed: FloatArray) -> FloatArray:
        """Return the torque at some speeds [N m], 0 beyond the highest speed.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> drive = ri.SpindleDrive(ri.rpm(1000, 6000, 5000), [3e3, 18e3], [30.0, 20.0])
        >>> drive.torque_at(ri.rpm(1000, 6000, 2500)).round(1).tolist()
        [30.0, 25.0, 20.0]
        """
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
