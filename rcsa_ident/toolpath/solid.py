"""What a cutter sweeps as it turns: a solid about the tool's axis, by the outline of its edges and the shank above them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.segments import Arc

#: By which the chords that stand for an arc of an outline leave it [m].
_CHORD = 1e-7
#: Slightest step of a radius that is a corner, as a share of the largest one.
_STEP = 1e-9

#: Angle by which an outline turns at a corner, and not along an arc that chords stand for [rad].
_CORNER = 0.3


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ToolSolid(Shown):
    """A solid of revolution about the tool's axis, from its tip up.

    `heights` [m], shape (p,): above the tip, from 0, never falling
    `radii` [m], shape (p,): at these heights; between them they change on straight lines
    `edge` [m]: height up to which there are edges; what is above is shank

    Examples
    --------
    A bull nose of 12 mm that stands out by 40 mm:

    >>> from rcsa_ident.cutting.profile import Profile
    >>> solid = ToolSolid.of(Cutter(2, 0.012, profile=Profile.bull_nose(0.012, 0.002, length=0.02)), length=0.04)
    >>> round(1e3 * solid.radius, 6), solid.length, round(1e3 * solid.edge, 6), solid.convex
    (6.0, 0.04, 20.0, True)
    """

    heights: FloatArray
    radii: FloatArray
    edge: float

    def __post_init__(self) -> None:
        for name in ("heights", "radii"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        wrong = self.heights.ndim != 1 or self.heights.size < 2 or self.radii.shape != self.heights.shape
        if wrong or not (np.all(np.isfinite(self.heights)) and np.all(np.isfinite(self.radii))):
            raise InputError("tool outline", [self.heights.shape, self.radii.shape], "two or more finite heights, and a radius at each [m]")
        if self.heights[0] != 0.0 or np.any(np.diff(self.heights) < 0.0) or not self.heights[-1] > 0.0:
            raise InputError("tool outline", "heights that fall or do not begin at the tip", "heights from 0 up")
        if np.any(self.radii < 0.0) or not np.any(self.radii > 0.0):
            raise InputError("tool outline", f"radii from {self.radii.min():g} to {self.radii.max():g} m", "radii of 0 or more, not all 0")

    @classmethod
    def of(cls, cutter: Cutter, length: float | None = None, chord: float = _CHORD) -> ToolSolid:
        """Return the solid of a cutter that runs true.

        `length` [m]: from the tip to where the shank ends, which is as wide as the edges are where they end; None ends it with the edges.
            Edges of which nobody told where they end are as long as that.
        `chord` [m]: by which the chords that stand for an arc may leave it
        """
        points: list[tuple[float, float]] = []
        for segment in cutter.outline.segments:
            pieces = 1
            if isinstance(segment, Arc):
                step = np.sqrt(8.0 * positive("chord", chord, "m") / abs(segment.radius))
                pieces = max(int(np.ceil(abs(segment.kappa1 - segment.kappa0) / step)), 2)
            r, z, _ = segment.at(np.linspace(0.0, 1.0, pieces + 1))
            points += zip(z.tolist(), r.tolist(), strict=True)
        z, r = np.maximum.accumulate([z for z, _ in points]), np.maximum([r for _, r in points], 0.0)
        # a floor is where the tool begins: its widest point alone is needed
        begin = int(np.flatnonzero(z <= z[0] + _STEP * z[-1])[-1])
        z, r = z[begin:] - z[begin], r[begin:]
        edge = float(z[-1])
        if length is not None:
            if positive("length", length, "m") < edge:
                r = np.append(r[z < length], np.interp(length, z, r))
                z, edge = np.append(z[z < length], length), length
            elif length > edge:
                z, r = np.append(z, length), np.append(r, r[-1])
        kept = np.concatenate([[True], (np.diff(z) > 0.0) | (np.abs(np.diff(r)) > _STEP * r.max())])
        return cls(z[kept], r[kept], edge)

    @property
    def radius(self) -> float:
        """The widest that it gets [m]."""
        return float(self.radii.max())

    @property
    def length(self) -> float:
        """From the tip to its upper end [m]."""
        return float(self.heights[-1])

    @property
    def outline(self) -> FloatArray:
        """Heights and radii, shape (2, p) [m]."""
        return np.ascontiguousarray(np.stack([self.heights, self.radii]))

    @property
    def peak(self) -> int:
        """The last of its points that has the largest radius."""
        return int(np.flatnonzero(self.radii >= self.radius * (1.0 - _STEP))[-1])

    @property
    def rises_to_one_peak(self) -> bool:
        """Whether its radius rises up to its largest one and falls from there: level moves are then exact."""
        change = np.diff(self.radii)
        slack = _STEP * self.radius
        return bool(np.all(change[: self.peak] >= -slack) and np.all(change[self.peak :] <= slack))

    @property
    def convex(self) -> bool:
        """Whether any two of its points have all between them inside, so that what it sweeps on a straight move is convex, too."""
        rise, change = np.diff(self.heights), np.diff(self.radii)
        # from the floor's end on, the outline turns towards the axis, never away from it
        turn = rise[1:] * change[:-1] - rise[:-1] * change[1:]
        return bool(self.rises_to_one_peak and self.radii[-1] >= self.radius * (1.0 - _STEP) and np.all(turn >= -_STEP * self.radius**2))

    @property
    def sharpest(self) -> float:
        """The smallest radius of curvature of its outline, its upper end left aside; 0 where it has a corner [m]."""
        z, r = np.concatenate([[0.0], self.heights]), np.concatenate([[0.0], self.radii])
        kept = np.concatenate([[True], np.hypot(np.diff(z), np.diff(r)) > _STEP * self.radius])
        dz, dr = np.diff(z[kept]), np.diff(r[kept])
        turn, length = np.abs(np.diff(np.unwrap(np.arctan2(dz, dr)))), np.hypot(dz, dr)
        if dr[0] > 0.0 and dz[0] > _CORNER * dr[0]:
            # a point at the axis
            return 0.0
        if np.any(turn > _CORNER):
            return 0.0
        bent = turn > 1e-6
        # a chord beside a straight piece turns by half as much
        return float(np.min(np.minimum(length[1:], length[:-1])[bent] / turn[bent], initial=self.radius))

    def radius_at(self, height: FloatArray) -> FloatArray:
        """Return the radius at heights above the tip [m]; 0 where the tool does not reach."""
        return np.interp(height, self.heights, self.radii, left=0.0, right=0.0)

    def slope_at(self, height: FloatArray) -> FloatArray:
        """Return by how much the radius grows with the height, at heights above the tip."""
        k = np.clip(np.searchsorted(self.heights, height, side="right") - 1, 0, self.heights.size - 2)
        rise = self.heights[k + 1] - self.heights[k]
        return np.divide(self.radii[k + 1] - self.radii[k], rise, out=np.zeros_like(rise), where=rise > 0.0)

    def coarser(self, chord: float) -> ToolSolid:
        """Return the same with as few points as leave it within a distance [m]."""
        kept, last = [0], self.heights.size - 1
        while kept[-1] < last:
            a, b = kept[-1], last
            while b > a + 1:
                rise = self.heights[b] - self.heights[a]
                run = np.hypot(rise, self.radii[b] - self.radii[a])
                between = slice(a + 1, b)
                away = (self.radii[between] - self.radii[a]) * rise - (self.heights[between] - self.heights[a]) * (
                    self.radii[b] - self.radii[a]
                )
                if np.max(np.abs(away)) <= chord * run:
                    break
                b -= 1
            kept.append(b)
        return ToolSolid(self.heights[kept], self.radii[kept], self.edge)

    def __str__(self) -> str:
        return f"tool of Ø{2e3 * self.radius:.4g} mm, {1e3 * self.length:.4g} mm long"
