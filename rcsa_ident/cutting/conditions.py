"""What the machinist sets: speed, depth, feed, immersion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, non_negative, positive
from rcsa_ident.base.plausibility import HEIGHT, SIDE, STEPOVER
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.profile import Profile


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
        """Return the engagement of a radial immersion a_e/D in (0, 1] for ``up`` or ``down`` milling.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> import numpy as np
        >>> half = ri.Engagement.from_immersion(0.5, "down")
        >>> np.degrees([half.entry, half.exit]).round(6).tolist()
        [90.0, 180.0]
        """
        if not 0.0 < positive("immersion", immersion) <= 1.0:
            raise InputError("immersion", immersion, "radial depth over diameter, above 0 and not above 1")
        if strategy == "up":
            return cls(0.0, float(np.arccos(1.0 - 2.0 * immersion)))
        if strategy == "down":
            return cls(float(np.arccos(2.0 * immersion - 1.0)), float(np.pi))
        raise InputError("strategy", strategy, "up or down")

    def arcs(self, r: FloatArray, z: FloatArray) -> FloatArray:
        """Return start and end of the arcs at points of the edge, shape (1, n, 2) [rad]: the same everywhere."""
        return np.broadcast_to(np.array([self.entry, self.exit]), (1, r.size, 2))

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii at which something changes: none [m]."""
        return ()

    @property
    def heights(self) -> tuple[float, ...]:
        """Heights at which something changes: none [m]."""
        return ()

    @property
    def angles(self) -> tuple[float, float]:
        """Entry and exit [rad]."""
        return self.entry, self.exit

    @property
    def immersion(self) -> float:
        """Width of the cut over the cutter's diameter, (cos entry - cos exit) / 2 [-]."""
        return float(0.5 * (np.cos(self.entry) - np.cos(self.exit)))

    def __str__(self) -> str:
        return f"{np.degrees(self.entry):.4g}° to {np.degrees(self.exit):.4g}°"


@dataclass(frozen=True, slots=True, repr=False)
class Block(Shown):
    """A cutter that goes into a block with straight sides: slots, face mills over a plate, a first pass at a wall.

    `y_from`, `y_to` [m]: its sides beside the cutter's path, along the normal direction Y; y_from below y_to

    Examples
    --------
    A plate under a face mill of 63 mm:

    >>> plate = Block(-0.0189, 0.0252)
    >>> np.degrees(plate.arcs(np.array([0.0315]), np.array([0.0]))[0]).round(2).tolist()
    [[36.87, 126.87]]
    """

    y_from: float
    y_to: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.y_from) and np.isfinite(self.y_to) and self.y_from < self.y_to):
            raise InputError("y_from and y_to", (self.y_from, self.y_to), "two finite places, the first one smaller [m]")
        SIDE.checked("y_from", self.y_from)
        SIDE.checked("y_to", self.y_to)

    def arcs(self, r: FloatArray, z: FloatArray) -> FloatArray:
        """Return start and end of the arcs at points of the edge, shape (k, n, 2) [rad]; empty ones end where they begin."""
        with np.errstate(divide="ignore", invalid="ignore"):
            high, low = (np.where(r > 0.0, y / r, np.sign(y) * np.inf) for y in (self.y_to, self.y_from))
        return np.stack([np.arccos(np.clip(high, -1.0, 1.0)), np.arccos(np.clip(low, -1.0, 1.0))], axis=-1)[None]

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii at which the edge begins or ends to reach a side [m]."""
        return tuple(abs(y) for y in (self.y_from, self.y_to) if y != 0.0)

    @property
    def heights(self) -> tuple[float, ...]:
        """Heights at which something changes: none [m]."""
        return ()

    def __str__(self) -> str:
        return f"block from y {1e3 * self.y_from:.4g} to {1e3 * self.y_to:.4g} mm"


@dataclass(frozen=True, slots=True, repr=False)
class Stepover(Shown):
    """The same radial width at every height, as where the pass before was cut by the same cutter.

    `width` [m]: a_e; where the cutter is narrower, it cuts all round
    `strategy`: ``up`` or ``down``
    """

    width: float
    strategy: str

    def __post_init__(self) -> None:
        STEPOVER.checked("width", self.width)
        if self.strategy not in ("up", "down"):
            raise InputError("strategy", self.strategy, "up or down")

    def arcs(self, r: FloatArray, z: FloatArray) -> FloatArray:
        """Return start and end of the arcs at points of the edge, shape (k, n, 2) [rad]; empty ones end where they begin."""
        with np.errstate(divide="ignore"):
            angle = np.arccos(np.clip(1.0 - np.where(r > 0.0, self.width / r, np.inf), -1.0, 1.0))
        start, end = (np.zeros_like(angle), angle) if self.strategy == "up" else (np.pi - angle, np.full_like(angle, np.pi))
        return np.stack([start, end], axis=-1)[None]

    @property
    def radii(self) -> tuple[float, ...]:
        """Radius below which the cutter is narrower than the stepover [m]."""
        return (0.5 * self.width,)

    @property
    def heights(self) -> tuple[float, ...]:
        """Heights at which something changes: none [m]."""
        return ()

    def __str__(self) -> str:
        return f"stepover of {1e3 * self.width:.4g} mm, {self.strategy}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EngagementMap(Shown):
    """A table of arcs over the height, as CAM systems and removal simulations give it, and leaning tools need it.

    `z` [m], shape (n,): heights above the tip, never falling; one that stands several times has several arcs
    `start`, `end` [rad], shape (n,): of each arc. Between heights that have as many arcs they change on straight lines, else those of the
        lower one go on; below the first height and above the last one nothing is cut.
    `feed_rise` [rad], default 0: angle between the feed and the plane across the tool's axis, towards the spindle
    """

    z: FloatArray
    start: FloatArray
    end: FloatArray
    feed_rise: float = 0.0

    def __post_init__(self) -> None:
        for name in ("z", "start", "end"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.z.ndim != 1 or self.z.size == 0 or self.start.shape != self.z.shape or self.end.shape != self.z.shape:
            raise InputError(
                "engagement map", [self.z.shape, self.start.shape, self.end.shape], "three lists of one length, one or more rows"
            )
        if not np.all(np.isfinite(self.z)) or np.any(np.diff(self.z) < 0.0) or self.z[0] < 0.0:
            raise InputError("engagement map heights", self.z.tolist(), "heights of 0 or more that never fall [m]")
        HEIGHT.checked("engagement map heights", float(self.z[-1]))
        if not np.all((self.start >= 0.0) & (self.start <= self.end) & (self.end <= 2.0 * np.pi + 1e-9)):
            raise InputError(
                "engagement map angles", "an arc outside 0 to 360 degrees or with its end before its start", "0 <= start <= end"
            )

    def arcs(self, r: FloatArray, z: FloatArray) -> FloatArray:
        """Return start and end of the arcs at points of the edge, shape (k, n, 2) [rad]; empty ones end where they begin."""
        heights = self.heights
        groups = [np.flatnonzero(self.z == height) for height in heights]
        found = np.zeros((max(group.size for group in groups), z.size, 2))
        place = np.clip(np.searchsorted(heights, z, side="right") - 1, 0, len(heights) - 1)
        for i, height in enumerate(z):
            if not heights[0] * (1.0 - 1e-9) <= height <= heights[-1] * (1.0 + 1e-9):
                continue
            low = groups[place[i]]
            high = groups[min(int(place[i]) + 1, len(groups) - 1)]
            above, below = float(self.z[high[0]]), float(self.z[low[0]])
            share = np.clip((height - below) / (above - below), 0.0, 1.0) if high.size == low.size and above > below else 0.0
            other = high if high.size == low.size else low
            for k, (a, b) in enumerate(zip(low, other, strict=True)):
                found[k, i] = [(1.0 - share) * values[a] + share * values[b] for values in (self.start, self.end)]
        return found

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii at which something changes: none [m]."""
        return ()

    @property
    def heights(self) -> tuple[float, ...]:
        """Its heights [m]."""
        return tuple(np.unique(self.z).tolist())

    def __str__(self) -> str:
        return f"engagement map of {self.z.size} arcs up to {1e3 * float(self.z[-1]):.4g} mm"


#: How a cutter may be engaged: between the same angles at all heights, or as its shape meets the stock.
AnyEngagement = Engagement | Block | Stepover | EngagementMap


def widest(engagement: AnyEngagement, profile: Profile, depth: float) -> Engagement:
    """Return the smallest engagement that holds all arcs of an outline up to a depth [m]. Raises `InputError` if nothing is cut."""
    if isinstance(engagement, Engagement):
        return engagement
    parts = [segment.at(np.linspace(a, b, 17)) for segment, a, b in profile.pieces(depth, engagement.radii, engagement.heights)]
    arcs = np.concatenate([engagement.arcs(r, z).reshape(-1, 2) for r, z, _ in parts])
    arcs = arcs[arcs[:, 1] > arcs[:, 0]]
    if not arcs.size:
        raise InputError("engagement", str(engagement), f"one that the cutter reaches with a radius up to {profile.largest_radius:g} m")
    return Engagement(float(arcs[:, 0].min()), float(min(arcs[:, 1].max(), np.pi)))


def same_everywhere(engagement: AnyEngagement) -> Engagement:
    """Return the engagement of a cut whose edge is in the material between the same angles at all heights.

    Raises `InputError` if it changes along the edge.
    """
    if isinstance(engagement, Engagement):
        return engagement
    raise InputError("engagement", str(engagement), "one engagement for the whole edge")


#: An engagement that changes along the edge: spindle speed [rad/s] and axial depth [m] to an array, shape (k, 4), whose rows say
#: between which shares of the depth, counted from the tip, a part of the edge lies, and between which angles [rad] it cuts.
EngagementProfile = Callable[[float, float], FloatArray]


@dataclass(frozen=True, slots=True, repr=False)
class CuttingConditions(Shown):
    """A cut with constant conditions.

    `spindle_speed` [rad/s]; `axial_depth` [m]; `feed_per_tooth` [m]
    `feed_angle` [rad], default 0: direction of the feed in the machine's X-Y plane, from +X towards +Y
    """

    spindle_speed: float
    axial_depth: float
    feed_per_tooth: float
    engagement: AnyEngagement
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
