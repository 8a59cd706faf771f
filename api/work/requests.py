"""What a query asks, in SI: plain nouns that cross processes."""

from __future__ import annotations

from dataclasses import dataclass, field

from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.process import ProcessDamping
from rcsa_ident.errors import InputError


class TooLong(InputError):
    """Work that is too much for one answer.

    Parameters
    ----------
    seconds : float [s]
        That it takes, estimated.
    """

    def __init__(self, field: str, found: object, allowed: str, where: str = "", seconds: float = 0.0) -> None:
        super().__init__(field, found, allowed, where)
        self.seconds = seconds

    def __reduce__(self) -> tuple[type[TooLong], tuple[object, ...]]:
        return type(self), (self.field, self.found, self.allowed, self.where, self.seconds)


METHODS = ("zero-order", "multi-frequency", "semi-discretisation", "full-discretisation", "time-domain")


@dataclass(frozen=True, slots=True)
class MachineText:
    """An identification as it is kept; the digest tells a worker whether it knows it already."""

    digest: str
    text: str


@dataclass(frozen=True, slots=True)
class ToolingText:
    """A tooling's TOML, and what the answer calls it."""

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class TipQuestion:
    """Tooltip FRF.

    Parameters
    ----------
    low, step : float [Hz]
    high : float or None [Hz]
        None is the end of the identified band.
    speed : float or None [rad/s]
    bands : bool
    stiffness_spread : float
        As a share.
    work_seconds : float [s]
        Longer work is refused.
    """

    low: float
    high: float | None
    step: float
    speed: float | None
    bands: bool
    stiffness_spread: float
    work_seconds: float


@dataclass(frozen=True, slots=True)
class CutQuestion:
    """What cuts, and how.

    Parameters
    ----------
    engagement : Engagement
    feed_angle : float [rad]
    feed_per_tooth : float or None [m]
    material : str or None
        Of the library; None is the identification's workpiece.
    coefficients : tuple of (field of CuttingCoefficients, value in SI)
        Over those.
    runout : tuple of float or None [m]
    damping : ProcessDamping or None
    """

    engagement: Engagement
    feed_angle: float = 0.0
    feed_per_tooth: float | None = None
    material: str | None = None
    coefficients: tuple[tuple[str, float], ...] = ()
    runout: tuple[float, ...] | None = None
    damping: ProcessDamping | None = None


@dataclass(frozen=True, slots=True)
class LobeQuestion:
    """Stability limits.

    Parameters
    ----------
    cut : CutQuestion
    speeds : tuple of float [rad/s], rising
    max_depth : float [m]
    method : str
        One of `METHODS`.
    bands : bool
    stiffness_spread : float
    work_seconds : float [s]
        Longer work is refused.
    tested : tuple of (speed [rad/s], depth [m], "stable", "chatter" or "marginal")
        Cuts that were tried.
    """

    cut: CutQuestion
    speeds: tuple[float, ...]
    max_depth: float
    method: str
    bands: bool
    stiffness_spread: float
    work_seconds: float
    tested: tuple[tuple[float, float, str], ...] = ()


@dataclass(frozen=True, slots=True)
class AdviceQuestion:
    """What a machinist asks of lobes.

    Parameters
    ----------
    lobes : LobeQuestion
    max_power : float or None [W]
    max_torque : float or None [N m]
    max_speed : float or None [rad/s]
    tolerance, probability, reserve : float
        Shares.
    depth : float or None [m]
        At which speeds may one cut so deep?
    planned : tuple of (speed [rad/s], depth [m])
    """

    lobes: LobeQuestion
    max_power: float | None = None
    max_torque: float | None = None
    max_speed: float | None = None
    tolerance: float = 0.01
    probability: float = 0.95
    reserve: float = 0.1
    depth: float | None = None
    planned: tuple[tuple[float, float], ...] = field(default=())
