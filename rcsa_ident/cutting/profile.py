"""The outline that a cutter's edges sweep over, by segments from the axis up, and those of the usual shapes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.segments import ROUNDING, Arc, Line, Segment

#: Length of a wall whose end nobody told, in diameters: deeper than anyone cuts.
_LONG = 10.0


@dataclass(frozen=True, slots=True, repr=False)
class Profile(Shown):
    """The outline that a cutter's edges sweep over, from the tip up.

    `segments`: each begins where the one before it ends; heights never fall, and the first one begins at the tip, z = 0

    Examples
    --------
    The corner of a bull nose, half a radius above the tip:

    >>> outline = Profile.bull_nose(diameter=0.016, corner_radius=0.003)
    >>> round(1e3 * outline.radius_at(0.0015), 6)
    7.598076
    """

    segments: tuple[Segment, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "segments", tuple(self.segments))
        if not self.segments:
            raise InputError("profile", "no segment", "at least one line or arc")
        ends = np.array([segment.ends for segment in self.segments])
        if not np.all(np.isfinite(ends)):
            raise InputError("profile", "a point that is not finite", "finite radii and heights [m]")
        size = max(float(np.max(np.abs(ends))), 1e-300)
        if abs(ends[0, 1]) > ROUNDING * size:
            raise InputError("profile", f"a tip at z = {1e3 * ends[0, 1]:g} mm", "a tip at z = 0")
        if np.min(ends[:, [0, 2]]) < -ROUNDING * size:
            raise InputError("profile", f"a radius of {1e3 * np.min(ends[:, [0, 2]]):g} mm", "radii of 0 or more")
        for k, segment in enumerate(self.segments):
            self._check(segment, k + 1, size)
        for k, (one, two) in enumerate(pairwise(ends)):
            if np.hypot(*(two[:2] - one[2:])) > 1e3 * ROUNDING * size:
                found = f"segment {k + 2} that begins at r {1e3 * two[0]:g}, z {1e3 * two[1]:g} mm"
                raise InputError("profile", found, f"one that begins where segment {k + 1} ends, r {1e3 * one[2]:g}, z {1e3 * one[3]:g} mm")
        if not self.height > 0.0:
            raise InputError("profile", "a floor alone", "an edge that rises above the tip")

    @staticmethod
    def _check(segment: Segment, number: int, size: float) -> None:
        if segment.length <= ROUNDING * size:
            raise InputError("profile", f"segment {number} without a length", "segments that are longer than rounding")
        if isinstance(segment, Arc):
            low, high = sorted((segment.kappa0, segment.kappa1))
            if low < -1e-12 or high > np.pi + 1e-12:
                raise InputError("profile", f"segment {number}: {segment}", "an arc whose normal stays between 0 and 180 degrees")
            if (segment.kappa1 - segment.kappa0) * segment.radius < 0.0:
                raise InputError("profile", f"segment {number}: {segment}", "an arc whose height does not fall on the way up")
        elif segment.z1 < segment.z0 - ROUNDING * size:
            raise InputError("profile", f"segment {number}: {segment}", "a line whose height does not fall on the way up")

    @property
    def height(self) -> float:
        """How far the edge reaches above the tip [m]."""
        return self.segments[-1].ends[3]

    @property
    def largest_radius(self) -> float:
        """The widest that it gets [m]."""
        return max(segment.widest for segment in self.segments)

    def pieces(self, depth: float, radii: tuple[float, ...] = (), heights: tuple[float, ...] = ()) -> list[tuple[Segment, float, float]]:
        """Return what stands below a depth, split at radii and heights: segments, each with the shares of its way.

        Floors are left out: nothing of them is cut by a tool that is fed sideways.

        `depth` [m]
        `radii`, `heights`: tuples of float [m], where something about the cut changes
        """
        found = []
        for segment in self.segments:
            _, low, _, high = segment.ends
            if low >= depth - ROUNDING * depth or high - low <= ROUNDING * segment.length:
                continue
            top = 1.0 if high <= depth * (1.0 + ROUNDING) else segment.share_at_height(depth)
            cuts = {0.0, top}
            cuts.update(share for r in radii for share in segment.shares_at_radius(r))
            cuts.update(segment.share_at_height(z) for z in heights if low < z < high)
            ordered = sorted(share for share in cuts if 0.0 <= share <= top)
            kept = [ordered[0]]
            kept += [share for share in ordered[1:] if share - kept[-1] > 1e-9]
            kept[-1] = top
            found += [(segment, a, b) for a, b in pairwise(kept)]
        return found

    def radius_at(self, z: float) -> float:
        """Return the radius at a height above the tip [m]; of a floor its outer one."""
        if not 0.0 <= z <= self.height * (1.0 + ROUNDING):
            raise InputError("height", z, f"0 to {self.height:g} m, where the edge ends")
        for segment in reversed(self.segments):
            _, low, end, high = segment.ends
            if low <= z and high > low:
                return float(segment.at(np.array([min(segment.share_at_height(z), 1.0)]))[0][0])
            if low <= z:
                return end
        raise AssertionError("an outline begins at the tip")

    def outline(self, most: float | None = None) -> FloatArray:
        """Return points along it, up to a height, for drawings: r and z, shape (n, 2) [m]."""
        points = [np.array([self.segments[0].ends[:2]])]
        for segment in self.segments:
            shares = np.linspace(0.0, 1.0, 2 if isinstance(segment, Line) else 33)[1:]
            points.append(np.stack(segment.at(shares)[:2], axis=1))
        found = np.concatenate(points)
        if most is None or most >= self.height:
            return found
        below = found[found[:, 1] <= most]
        return np.concatenate([below, [[self.radius_at(most), most]]])

    def __str__(self) -> str:
        return "; ".join(str(segment) for segment in self.segments)

    # The factories follow; diameters are those of the field's catalogues (DC, ISO 13399).

    @classmethod
    def flat(cls, diameter: float, length: float | None = None) -> Profile:
        """Return the outline of a cylinder with a sharp corner."""
        r = 0.5 * positive("diameter", diameter, "m")
        return cls((Line(0.0, 0.0, r, 0.0), Line(r, 0.0, r, _length(diameter, length))))

    @classmethod
    def bull_nose(cls, diameter: float, corner_radius: float, length: float | None = None) -> Profile:
        """Return the outline of an end mill with a corner radius."""
        return cls.tapered(diameter, 0.0, corner_radius, length)

    @classmethod
    def ball(cls, diameter: float, length: float | None = None) -> Profile:
        """Return the outline of a ball end mill."""
        return cls.tapered(diameter, 0.0, 0.5 * diameter, length)

    @classmethod
    def tapered(cls, diameter: float, taper: float, corner_radius: float = 0.0, length: float | None = None) -> Profile:
        """Return the outline of a cutter that widens by `taper` [rad] on each side above its corner.

        `diameter` [m]: at the tip; with a corner radius twice the radius of its arc's outermost point, as of a bull nose
        """
        r, high = 0.5 * positive("diameter", diameter, "m"), _length(diameter, length)
        _corner(corner_radius, r)
        if not 0.0 <= taper < 0.5 * np.pi:
            raise InputError("taper", f"{np.degrees(taper):g} degrees", "an angle from 0 to less than 90 degrees")
        if corner_radius == 0.0:
            return cls((Line(0.0, 0.0, r, 0.0), Line(r, 0.0, r + high * np.tan(taper), high)))
        arc = Arc(r - corner_radius, corner_radius, corner_radius, 0.0, 0.5 * np.pi - taper)
        return cls((*_floor(r - corner_radius), arc, *_onwards(arc, taper, high)))

    @classmethod
    def face(cls, diameter: float, cutting_edge_angle: float, depth: float, corner_radius: float = 0.0) -> Profile:
        """Return the outline of a cutter with a lead angle: face, high-feed and, beyond 90 degrees, dovetail mills.

        `diameter` [m]: where the edge's line meets the floor
        `cutting_edge_angle` [rad]: KAPR, from the floor to the edge
        `depth` [m]: height to which the edge reaches, APMX
        `corner_radius` [m]: between floor and edge, RE
        """
        r, kappa = 0.5 * positive("diameter", diameter, "m"), cutting_edge_angle
        if not 0.0 < kappa < np.pi:
            raise InputError("cutting_edge_angle", f"{np.degrees(kappa):g} degrees", "an angle above 0 and below 180 degrees")
        positive("depth", depth, "m")
        if r + depth / np.tan(kappa) < 0.0:
            allowed = f"at most {-1e3 * r * np.tan(kappa):g} mm, where the undercut ends in the axis"
            raise InputError("depth", f"{1e3 * depth:g} mm", allowed)
        if corner_radius == 0.0:
            return cls((Line(0.0, 0.0, r, 0.0), Line(r, 0.0, r + depth / np.tan(kappa), depth)))
        centre = r - corner_radius * np.tan(0.5 * kappa)
        if corner_radius < 0.0 or centre < 0.0:
            allowed = f"0 to {1e3 * r / np.tan(0.5 * kappa):g} mm, which the floor has room for"
            raise InputError("corner_radius", f"{1e3 * corner_radius:g} mm", allowed)
        arc = Arc(centre, corner_radius, corner_radius, 0.0, kappa)
        if arc.ends[3] >= depth:
            return cls((*_floor(centre), Arc(centre, corner_radius, corner_radius, 0.0, float(np.arccos(1.0 - depth / corner_radius)))))
        return cls((*_floor(centre), arc, *_onwards(arc, 0.5 * np.pi - kappa, depth)))

    @classmethod
    def chamfer(cls, diameter: float, tip_diameter: float, taper: float) -> Profile:
        """Return the outline of a cone from its tip to its largest diameter; `taper` is half of the point angle [rad]."""
        r, tip = 0.5 * positive("diameter", diameter, "m"), 0.5 * tip_diameter
        if not 0.0 <= tip < r:
            raise InputError("tip_diameter", f"{1e3 * tip_diameter:g} mm", f"0 to less than the diameter, {1e3 * diameter:g} mm")
        if not 0.0 < taper < 0.5 * np.pi:
            raise InputError("taper", f"{np.degrees(taper):g} degrees", "an angle above 0 and below 90 degrees")
        return cls((*_floor(tip), Line(tip, 0.0, r, (r - tip) / np.tan(taper))))

    @classmethod
    def lollipop(cls, diameter: float, neck: float) -> Profile:
        """Return the outline of a ball that goes on above its equator to a neck of this diameter [m]."""
        r = 0.5 * positive("diameter", diameter, "m")
        if not 0.0 < neck < diameter:
            raise InputError("neck", f"{1e3 * neck:g} mm", f"above 0 and below the diameter, {1e3 * diameter:g} mm")
        return cls((Arc(0.0, r, r, 0.0, float(np.pi - np.arcsin(0.5 * neck / r))),))

    @classmethod
    def hollow(cls, tip_diameter: float, corner_radius: float, tip_length: float = 0.0) -> Profile:
        """Return the outline of a corner-rounding cutter: a hollow quarter circle above a tip of this diameter and length [m]."""
        r = 0.5 * positive("tip_diameter", tip_diameter, "m")
        rho = positive("corner_radius", corner_radius, "m")
        wall = [Line(r, 0.0, r, tip_length)] if tip_length else []
        return cls((Line(0.0, 0.0, r, 0.0), *wall, Arc(r + rho, tip_length, -rho, 0.5 * np.pi, 0.0)))

    @classmethod
    def barrel(
        cls, diameter: float, profile_radius: float, height: float, corner_radius: float, length: float, upper_radius: float = 0.0
    ) -> Profile:
        """Return the outline of a barrel: an arc with its largest diameter at a height, above a corner that it touches.

        `diameter`, `profile_radius` [m]: the largest diameter, and the radius of the arc there
        `height`, `length` [m]: where it is widest, and where the edge ends
        `corner_radius`, `upper_radius` [m]: of the arcs between floor and barrel, and between barrel and the edge's upper end; without the
            latter it ends sharp
        """
        r, big = 0.5 * positive("diameter", diameter, "m"), positive("profile_radius", profile_radius, "m")
        between = big - corner_radius
        if not 0.0 <= corner_radius < big or not abs(height - corner_radius) < between:
            allowed = f"0 to less than the profile's radius, {1e3 * big:g} mm, within reach of its arc"
            raise InputError("corner_radius", f"{1e3 * corner_radius:g} mm", allowed)
        centre = r - big
        inner = centre + np.sqrt(between**2 - (height - corner_radius) ** 2)
        if inner < 0.0:
            raise InputError("diameter", f"{1e3 * diameter:g} mm", "one that leaves the corner on its own side of the axis")
        touch = float(np.arccos((height - corner_radius) / between))
        start = [Arc(inner, corner_radius, corner_radius, 0.0, touch)] if corner_radius > 0.0 else []
        return cls((*_floor(inner), *start, *_flank(centre, height, big, touch, length, upper_radius)))

    @classmethod
    def lens(cls, diameter: float, profile_radius: float, corner_radius: float, length: float | None = None) -> Profile:
        """Return the outline of a lens: an arc about the axis as its floor, a corner that touches it, and a wall."""
        r, big = 0.5 * positive("diameter", diameter, "m"), positive("profile_radius", profile_radius, "m")
        _corner(corner_radius, r)
        if not r < big:
            raise InputError("profile_radius", f"{1e3 * big:g} mm", f"above half of the diameter, {1e3 * r:g} mm")
        touch = float(np.arcsin((r - corner_radius) / (big - corner_radius)))
        floor = Arc(0.0, big, big, 0.0, touch)
        centre = big - (big - corner_radius) * np.cos(touch)
        corner = [Arc(r - corner_radius, centre, corner_radius, touch, 0.5 * np.pi)] if corner_radius > 0.0 else []
        end = (corner or [floor])[-1].ends
        return cls((floor, *corner, Line(end[2], end[3], end[2], _length(diameter, length))))

    @classmethod
    def oval(cls, diameter: float, profile_radius: float, tip_radius: float, length: float) -> Profile:
        """Return the outline of an oval: an arc that touches a ball about the axis and is widest where it stands upright."""
        r, big, ball = 0.5 * positive("diameter", diameter, "m"), profile_radius, positive("tip_radius", tip_radius, "m")
        if not ball < r < big:
            found, allowed = f"{1e3 * ball:g} and {1e3 * big:g} mm", f"a tip below and a profile above half of the diameter, {1e3 * r:g} mm"
            raise InputError("tip_radius and profile_radius", found, allowed)
        high = ball + float(np.sqrt((big - ball) ** 2 - (big - r) ** 2))
        touch = float(np.arccos((high - ball) / (big - ball)))
        return cls((Arc(0.0, ball, ball, 0.0, touch), *_flank(r - big, high, big, touch, length, 0.0)))

    @classmethod
    def taper_barrel(
        cls,
        profile_radius: float,
        tip_radius: float,
        taper: float,
        height: float,
        length: float,
        tip_diameter: float | None = None,
        upper_radius: float = 0.0,
    ) -> Profile:
        """Return the outline of a tapered barrel: an arc that touches the tip's and leans by `taper` at a height.

        `profile_radius`, `tip_radius` [m]: of the arcs of flank and tip
        `taper` [rad]
        `height`, `length` [m]: where the flank leans so, and where the edge ends
        `tip_diameter` [m]: twice the radius of the tip's arc, were it to go on to a wall; None is a ball
        `upper_radius` [m]: of the arc between the flank and the edge's upper end; without it the edge ends sharp
        """
        big, ball = positive("profile_radius", profile_radius, "m"), positive("tip_radius", tip_radius, "m")
        if not ball < big:
            raise InputError("tip_radius", f"{1e3 * ball:g} mm", f"below the profile's radius, {1e3 * big:g} mm")
        if not 0.0 <= taper < 0.5 * np.pi:
            raise InputError("taper", f"{np.degrees(taper):g} degrees", "an angle from 0 to less than 90 degrees")
        inner = 0.0 if tip_diameter is None else 0.5 * tip_diameter - ball
        if inner < -ROUNDING:
            raise InputError("tip_diameter", f"{2e3 * (inner + ball):g} mm", f"at least twice the radius of its arc, {2e3 * ball:g} mm")
        centre = height + big * np.sin(taper)
        if not abs(centre - ball) < big - ball:
            raise InputError("height", f"{1e3 * height:g} mm", "one at which the arc touches that of the tip")
        touch = float(np.arccos((centre - ball) / (big - ball)))
        across = max(inner, 0.0) - float(np.sqrt((big - ball) ** 2 - (centre - ball) ** 2))
        flank = _flank(across, centre, big, touch, length, upper_radius)
        return cls((*_floor(max(inner, 0.0)), Arc(max(inner, 0.0), ball, ball, 0.0, touch), *flank))

    @classmethod
    def seven(cls, d: float, r: float, r_r: float, r_z: float, alpha: float, beta: float, h: float) -> Profile:
        """Return the outline of the general cutter with seven parameters of APT [engin2001].

        `d` [m]: cutter diameter
        `r`, `r_r`, `r_z` [m]: corner radius, and radial and axial place of its centre
        `alpha`, `beta` [rad]: of the tip's cone from the floor, and of the flank from the axis
        `h` [m]: cutter height
        """
        positive("d", d, "m")
        if r <= 0.0:
            return cls((*_cone(0.5 * d, alpha), *_rise(0.5 * d, 0.5 * d * np.tan(alpha), beta, h)))
        arc = Arc(r_r, r_z, r, alpha, 0.5 * np.pi - beta)
        return cls((*_cone(arc.ends[0], alpha), arc, *_onwards(arc, beta, h)))


def _flank(r_c: float, z_c: float, big: float, touch: float, length: float, upper: float) -> tuple[Arc, ...]:
    """A long arc from where it touches the one below it up to the edge's end, there with an arc that meets the end's plane."""
    start = z_c - big * np.cos(touch)
    if not start < length < z_c + big:
        allowed = f"above {1e3 * max(start, 0.0):.6g} mm, where the long arc begins, and below {1e3 * (z_c + big):g} mm, where it closes"
        raise InputError("length", f"{1e3 * length:g} mm", allowed)
    if not upper:
        return (Arc(r_c, z_c, big, touch, float(np.arccos((z_c - length) / big))),)
    over = length - upper - z_c
    meet = float(np.arccos(-over / (big - upper))) if 0.0 < upper < big and abs(over) < big - upper else 0.0
    if not meet > touch:
        raise InputError("upper_radius", f"{1e3 * upper:g} mm", "a radius whose arc touches the long one below the edge's end")
    return Arc(r_c, z_c, big, touch, meet), Arc(r_c + (big - upper) * np.sin(meet), length - upper, upper, meet, float(np.pi))


def _length(diameter: float, length: float | None) -> float:
    return _LONG * diameter if length is None else positive("length", length, "m")


def _corner(corner_radius: float, r: float) -> None:
    if not 0.0 <= corner_radius <= r * (1.0 + ROUNDING):
        raise InputError("corner_radius", f"{1e3 * corner_radius:g} mm", f"0 to half of the diameter, {1e3 * r:g} mm")


def _floor(r: float) -> tuple[Line, ...]:
    """A floor from the axis to a radius; none where the outline begins at the axis."""
    return (Line(0.0, 0.0, r, 0.0),) if r > ROUNDING else ()


def _cone(r: float, alpha: float) -> tuple[Line, ...]:
    return (Line(0.0, 0.0, r, r * float(np.tan(alpha))),) if r > ROUNDING else ()


def _rise(r: float, z: float, taper: float, high: float) -> tuple[Line, ...]:
    return (Line(r, z, r + (high - z) * float(np.tan(taper)), high),) if high > z else ()


def _onwards(arc: Arc, taper: float, high: float) -> tuple[Line, ...]:
    """The line on which an arc goes on up to a height."""
    return _rise(arc.ends[2], arc.ends[3], taper, high)
