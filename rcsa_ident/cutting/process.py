"""What cuts what, and how: everything about a milling cut but its speed and its depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.errors import InputError, non_negative
from rcsa_ident.base.plausibility import FEED_ANGLE, FEED_PER_TOOTH, IMMERSION, INDENTATION, WEAR_LAND, Range, remarks_of
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import AnyEngagement, CuttingConditions, Engagement, EngagementProfile, feed_direction, widest
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.teeth import deepest


@dataclass(frozen=True, slots=True, repr=False)
class ProcessDamping(Shown):
    """The flank rubs on the wave that it leaves: a viscous force, the indentation model for small waves [ahmadi2012].

    A width b of edge that moves into the workpiece with the velocity u feels F_r = K_sp w^2 b u / (4 v), v its cutting speed, and
    the friction mu F_r against the cut.

    Parameters
    ----------
    indentation : float [N/m^3]
        K_sp, force per displaced volume: 1e14 for aluminium, 4e13 for steel.
    wear_land : float [m]
        w, width of the flat behind the edge.
    friction : float [-]
        mu, coefficient of friction between flank and workpiece.

    Examples
    --------
    A slow cut with a sharp edge, and with one that is worn by 0.02 mm:

    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cutter, slot = ri.Cutter(2, 0.012), ri.Engagement.from_immersion(1.0, "up")
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> for damping in (None, ri.ProcessDamping(indentation=1e14, wear_land=0.02e-3)):
    ...     cut = ri.MillingProcess(cutter, ri.CuttingCoefficients(7e8, 0.3), slot, damping=damping)
    ...     lobes = ri.stability_lobes(tip, cut, ri.rpm(1500, 1600, 100), 10e-3, ri.FullDiscretisation())
    ...     print((1e3 * lobes.limit_depth).round(2))
    [0.72 0.85]
    [1.1  1.22]
    """

    indentation: float
    wear_land: float
    friction: float = 0.3

    def __post_init__(self) -> None:
        INDENTATION.checked("indentation", self.indentation)
        WEAR_LAND.checked("wear_land", self.wear_land)
        if not 0.0 <= non_negative("friction", self.friction) <= 2.0:
            raise InputError("friction", self.friction, "a coefficient from 0 to 2")

    @property
    def values(self) -> tuple[tuple[str, Range, float], ...]:
        """What may be unusual about it: field, range and value."""
        return ("indentation", INDENTATION, self.indentation), ("wear_land", WEAR_LAND, self.wear_land)

    @property
    def strength(self) -> float:
        """K_sp w^2 / 4: viscous damping per width of edge, times the cutting speed [N/m]."""
        return 0.25 * self.indentation * self.wear_land**2

    def __str__(self) -> str:
        return f"wear land {1e6 * self.wear_land:.3g} µm"


@dataclass(frozen=True, slots=True, repr=False)
class SpeedVariation(Shown):
    """A spindle whose speed swings about its mean: Omega(t) = Omega_0 (1 + amplitude sin(ratio Omega_0 t)).

    Parameters
    ----------
    amplitude : float [-]
        RVA, above 0 and below 0.9.
    ratio : float [-]
        RVF, swings per revolution.

    Examples
    --------
    The speed swings by a tenth, once in five turns:

    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cutter, slot = ri.Cutter(2, 0.012), ri.Engagement.from_immersion(1.0, "up")
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> for swing in (None, ri.SpeedVariation(amplitude=0.1, ratio=0.2)):
    ...     cut = ri.MillingProcess(cutter, ri.CuttingCoefficients(7e8, 0.3), slot, speed_variation=swing)
    ...     lobes = ri.stability_lobes(tip, cut, ri.rpm(3000, 3100, 100), 10e-3, ri.FullDiscretisation())
    ...     print((1e3 * lobes.limit_depth).round(2))
    [1.35 0.61]
    [1.15 1.33]
    """

    amplitude: float
    ratio: float

    def __post_init__(self) -> None:
        if not 0.0 < self.amplitude < 0.9:
            raise InputError("amplitude", self.amplitude, "a share of the mean speed above 0 and below 0.9")
        if not 0.001 <= self.ratio <= 10.0:
            raise InputError("ratio", self.ratio, "swings per revolution, 0.001 to 10")

    def __str__(self) -> str:
        return f"speed swings by {100.0 * self.amplitude:.3g} %, {self.ratio:.3g} times a revolution"


@dataclass(frozen=True, slots=True, repr=False)
class MillingProcess(Shown):
    """What cuts what, and how.

    Parameters
    ----------
    cutter : Cutter
    coefficients : CuttingCoefficients
    engagement : Engagement, Block, Stepover or EngagementMap
    feed_angle : float [rad], default 0
        Direction of the feed in the machine's X-Y plane, from +X towards +Y.
    feed_per_tooth : float or None [m]
        Matters to stability only with run-out: it decides which teeth cut, and what they regenerate.
    damping : ProcessDamping or None
    speed_variation : SpeedVariation or None
    engagement_profile : EngagementProfile or None
        How the engagement changes along the edge, as with a deflected tool; `engagement` is then the programmed one.

    Examples
    --------
    A two-tooth end mill of 12 mm in EN AW-6082, half-immersion down-milling:

    >>> cutter, coefficients = Cutter(2, 0.012), CuttingCoefficients(902e6, 0.26)
    >>> process = MillingProcess(cutter, coefficients, Engagement.from_immersion(0.5, "down"), feed_per_tooth=0.1e-3)
    >>> process.conditions(speed=1000.0, depth=0.002).axial_depth
    0.002
    """

    cutter: Cutter
    coefficients: CuttingCoefficients
    engagement: AnyEngagement
    feed_angle: float = 0.0
    feed_per_tooth: float | None = None
    damping: ProcessDamping | None = None
    speed_variation: SpeedVariation | None = None
    engagement_profile: EngagementProfile | None = None

    def __post_init__(self) -> None:
        FEED_ANGLE.checked("feed_angle", self.feed_angle)
        if self.feed_per_tooth is not None:
            FEED_PER_TOOTH.checked("feed_per_tooth", self.feed_per_tooth)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about coefficients, feed, immersion and cutter, as a wrong unit would make it."""
        feed = () if self.feed_per_tooth is None else (("feed_per_tooth", FEED_PER_TOOTH, self.feed_per_tooth),)
        damping = () if self.damping is None else self.damping.values
        immersion = ("radial immersion", IMMERSION, self.widest.immersion)
        return *self.coefficients.remarks, *remarks_of((*feed, immersion, *damping, *self.cutter.values))

    @property
    def is_plain(self) -> bool:
        """True where every point of the edge cuts alike but for its lag: a cylinder that is engaged at all heights as at the tip."""
        return self.cutter.is_cylinder and isinstance(self.engagement, Engagement)

    @property
    def widest(self) -> Engagement:
        """The smallest engagement that holds those of all points of the edge."""
        return widest(self.engagement, self.cutter.outline, self.cutter.outline.height)

    def within_reach(self, depth: float) -> float:
        """Return a depth [m], or how deep the cutter cuts where that is less."""
        return min(depth, deepest(self.cutter))

    @property
    def machine_from_feed(self) -> np.ndarray:
        """Rotation from (feed, normal) to machine (X, Y), shape (2, 2)."""
        c, s = np.cos(self.feed_angle), np.sin(self.feed_angle)
        return np.array([[c, -s], [s, c]])

    def conditions(self, speed: float, depth: float) -> CuttingConditions:
        """Return the cut at a speed [rad/s] and a depth [m]; without a feed it is 0.

        Raises
        ------
        InputError
            If the engagement changes along the edge.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
        >>> conditions = cut.conditions(ri.rpm(12_000), 1e-3)
        >>> round(conditions.spindle_speed, 1), conditions.axial_depth
        (1256.6, 0.001)
        """
        if self.engagement_profile is not None:
            raise InputError("engagement_profile", "an engagement that changes along the edge", "one engagement for the whole edge")
        return CuttingConditions(speed, depth, self.feed_per_tooth or 0.0, self.engagement, self.feed_angle)

    def __str__(self) -> str:
        parts = [f"{self.cutter}; {self.coefficients}; {self.engagement}", f"feed {feed_direction(self.feed_angle)}"]
        parts += [] if self.feed_per_tooth is None else [f"{1e3 * self.feed_per_tooth:.3g} mm per tooth"]
        return ", ".join([*parts, *(str(each) for each in (self.damping, self.speed_variation) if each is not None)])
