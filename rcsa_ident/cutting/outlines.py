"""Which dimensions draw which shape of cutter, and outlines as rows of points with the radii of the arcs between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.segments import ROUNDING, Arc, Line, Segment
from rcsa_ident.cutting.shape import CutterShape

#: What libraries round a ball's radius by, as a share of it.
_ROUNDED = 1e-3
#: Share of the diameter below which a corner is sharp.
_SHARP = 1e-6


@dataclass(frozen=True, slots=True, repr=False)
class Dimensions(Shown):
    """What draws a cutter's shape beside its diameter and its corner radius; None is not told.

    `cutting_edge_angle` [rad]: KAPR, from the floor to the edge
    `taper` [rad]: from the axis to the edge; of a dovetail towards the shank, of a tapered barrel where its arc stands at `axial_distance`
    `largest_diameter` [m]: DCX, where the edge ends
    `cutting_depth` [m]: APMX, from the tip to where the edge ends
    `wiper` [m]: BS, length of the flat beside the corner
    `profile_radius` [m]: PRFRAD, of the long arc
    `axial_distance` [m]: from the tip to where a barrel is widest, or a tapered one leans by its taper
    `upper_radius` [m]: of the arc between a barrel and its upper end, which lies at the cutting depth
    `tip_diameter`, `neck_diameter` [m]: of the floor, and of what carries a lollipop
    `tip_length` [m]: of the straight edge below a hollow radius
    """

    cutting_edge_angle: float | None = None
    taper: float | None = None
    largest_diameter: float | None = None
    cutting_depth: float | None = None
    wiper: float | None = None
    profile_radius: float | None = None
    axial_distance: float | None = None
    upper_radius: float | None = None
    tip_diameter: float | None = None
    neck_diameter: float | None = None
    tip_length: float | None = None

    @property
    def told(self) -> dict[str, float]:
        """Those that are told, by their names."""
        return {each.name: value for each in fields(self) if (value := getattr(self, each.name)) is not None}

    def __str__(self) -> str:
        return ", ".join(f"{key_of(name)} {in_files(name, value):.6g}" for name, value in self.told.items()) or "none"


#: Dimensions that are angles, in degrees in files.
ANGLES = ("cutting_edge_angle", "taper")


def key_of(name: str) -> str:
    """Return what files call a dimension or a corner radius."""
    return f"{name}_deg" if name in ANGLES else f"{name}_mm"


def in_files(name: str, value: float) -> float:
    """Return a dimension [SI] in degrees or millimetres."""
    return float(np.degrees(value)) if name in ANGLES else 1e3 * value


class Takes(NamedTuple):
    """What a shape is drawn by: what it needs, and what it may have beside that."""

    needs: tuple[str, ...]
    may: tuple[str, ...]


#: By shape. Of some a dimension may stand for one that is needed: see `missing`.
TAKES = {
    CutterShape.FLAT: Takes((), ("corner_radius", "cutting_depth")),
    CutterShape.BULL_NOSE: Takes(("corner_radius",), ("cutting_depth",)),
    CutterShape.BALL: Takes((), ("corner_radius", "cutting_depth")),
    CutterShape.TAPERED: Takes(("taper",), ("corner_radius", "cutting_depth", "largest_diameter")),
    CutterShape.FACE: Takes(("cutting_edge_angle", "cutting_depth"), ("corner_radius", "wiper", "largest_diameter")),
    CutterShape.HIGH_FEED: Takes(("cutting_edge_angle", "cutting_depth"), ("corner_radius", "wiper", "largest_diameter", "profile_radius")),
    CutterShape.RADIUS: Takes(("corner_radius",), ("tip_length",)),
    CutterShape.BARREL: Takes(("profile_radius", "axial_distance", "cutting_depth"), ("corner_radius", "upper_radius")),
    CutterShape.LENS: Takes(("profile_radius",), ("corner_radius", "cutting_depth")),
    CutterShape.OVAL: Takes(("profile_radius", "corner_radius", "cutting_depth"), ()),
    CutterShape.TAPER_BARREL: Takes(
        ("profile_radius", "corner_radius", "taper", "axial_distance", "cutting_depth"), ("tip_diameter", "upper_radius")
    ),
    CutterShape.LOLLIPOP: Takes(("neck_diameter",), ("corner_radius",)),
    CutterShape.CHAMFER: Takes(("taper",), ("tip_diameter",)),
    CutterShape.DOVETAIL: Takes(("taper", "cutting_depth"), ("corner_radius",)),
    CutterShape.PROFILE: Takes(("profile",), ("corner_radius",)),
}


def missing(shape: CutterShape, corner_radius: float, dimensions: Dimensions) -> tuple[str, ...]:
    """Return the names of the dimensions that are not told and without which a shape cannot be drawn.

    Examples
    --------
    >>> missing(CutterShape.FACE, 0.0, Dimensions(cutting_depth=0.006))
    ('cutting_edge_angle',)
    """
    told = dimensions.told
    stand_in = {"cutting_depth": "largest_diameter", "cutting_edge_angle": "profile_radius"}
    takes = TAKES[shape]

    def there(name: str) -> bool:
        if name == "corner_radius":
            return corner_radius > 0.0
        return name in told or (stand_in.get(name, "") in told and stand_in[name] in takes.may)

    return tuple(name for name in takes.needs if not there(name))


def outline_of(shape: CutterShape, diameter: float, corner_radius: float, dimensions: Dimensions) -> Profile | None:
    """Return the outline of a shape; None of a plain cylinder, and of a shape of which too little is told.

    `diameter`, `corner_radius` [m]
    Raises `InputError` if no cutter can have them.

    Examples
    --------
    A face mill of 45 degrees, 4 mm above its floor:

    >>> lead = Dimensions(cutting_edge_angle=0.25 * np.pi, cutting_depth=0.006)
    >>> outline = outline_of(CutterShape.FACE, 0.063, 0.0, lead)
    >>> round(1e3 * outline.radius_at(0.004), 9)
    35.5
    """
    if missing(shape, corner_radius, dimensions):
        return None
    d, depth = dimensions, dimensions.cutting_depth
    corner = corner_radius if shape is CutterShape.RADIUS else min(corner_radius, 0.5 * diameter)
    corner = corner if corner > _SHARP * diameter else 0.0
    match shape:
        case CutterShape.FLAT | CutterShape.BULL_NOSE:
            if corner == 0.0:
                return None if depth is None else Profile.flat(diameter, depth)
            return Profile.bull_nose(diameter, corner, depth)
        case CutterShape.BALL:
            _of_a_ball(corner, diameter)
            return Profile.ball(diameter, depth)
        case CutterShape.TAPERED:
            return Profile.tapered(diameter, d.taper or 0.0, corner, _tapered_depth(diameter, corner, d))
        case CutterShape.FACE | CutterShape.HIGH_FEED:
            return _face(diameter, corner, d)
        case CutterShape.RADIUS:
            return Profile.hollow(diameter, corner, d.tip_length or 0.0)
        case CutterShape.LENS:
            return Profile.lens(diameter, d.profile_radius or 0.0, corner, depth)
        case CutterShape.LOLLIPOP:
            _of_a_ball(corner, diameter)
            return Profile.lollipop(diameter, d.neck_diameter or 0.0)
        case CutterShape.CHAMFER:
            return Profile.chamfer(diameter, d.tip_diameter or 0.0, d.taper or 0.0)
        case CutterShape.DOVETAIL:
            return Profile.face(diameter, 0.5 * np.pi + (d.taper or 0.0), depth or 0.0, corner)
        case CutterShape.BARREL | CutterShape.OVAL | CutterShape.TAPER_BARREL:
            return _of_arcs(shape, diameter, corner, d, d.profile_radius or 0.0, depth or 0.0)
    return None


def _of_arcs(shape: CutterShape, diameter: float, corner: float, d: Dimensions, profile_radius: float, depth: float) -> Profile:
    """The outline of a cutter with a long arc in its flank."""
    if shape is CutterShape.OVAL:
        return Profile.oval(diameter, profile_radius, corner, depth)
    upper, high = d.upper_radius or 0.0, d.axial_distance or 0.0
    if shape is CutterShape.BARREL:
        return Profile.barrel(diameter, profile_radius, high, corner, depth, upper)
    return Profile.taper_barrel(profile_radius, corner, d.taper or 0.0, high, depth, d.tip_diameter, upper)


def _of_a_ball(corner: float, diameter: float) -> None:
    if corner and abs(corner - 0.5 * diameter) > _ROUNDED * diameter:
        allowed = f"nothing, or half of the diameter, {500.0 * diameter:g} mm: it is a ball"
        raise InputError("corner_radius", f"{1e3 * corner:g} mm", allowed)


def _tapered_depth(diameter: float, corner: float, d: Dimensions) -> float | None:
    """Where a cone ends [m]; None where nobody told."""
    if d.largest_diameter is None:
        return d.cutting_depth
    taper = d.taper or 0.0
    start = 0.5 * diameter - corner * (1.0 - np.cos(taper))
    rise = 0.5 * d.largest_diameter - start
    if not (taper > 0.0 and rise > 0.0):
        raise InputError("largest_diameter", f"{1e3 * d.largest_diameter:g} mm", "above the diameter, with a taper above 0")
    return _shorter(d.cutting_depth, corner * (1.0 - np.sin(taper)) + rise / float(np.tan(taper)))


def _face(diameter: float, corner: float, d: Dimensions) -> Profile:
    if d.profile_radius is not None:
        return _curved_face(diameter, d, d.profile_radius)
    kappa, depth = d.cutting_edge_angle or 0.0, d.cutting_depth
    if d.largest_diameter is not None:
        if not (0.0 < kappa < 0.5 * np.pi - 1e-9 and d.largest_diameter > diameter):
            found = f"{1e3 * d.largest_diameter:g} mm at a cutting edge angle of {np.degrees(kappa):g} degrees"
            raise InputError("largest_diameter", found, f"above the diameter, {1e3 * diameter:g} mm, at an angle below 90 degrees")
        depth = _shorter(depth, 0.5 * (d.largest_diameter - diameter) * float(np.tan(kappa)))
    outline = Profile.face(diameter, kappa, depth or 0.0, corner)
    _wiper(d.wiper, 0.5 * diameter - corner * float(np.tan(0.5 * kappa)))
    return outline


def _curved_face(diameter: float, d: Dimensions, radius: float) -> Profile:
    """A high-feed cutter whose edge is an arc that leaves the floor at the diameter."""
    if d.cutting_edge_angle is not None:
        found = f"{1e3 * radius:g} mm beside a cutting edge angle"
        raise InputError("profile_radius", found, "one of the two: the edge is an arc or a line")
    if d.cutting_depth is None or d.largest_diameter is not None:
        raise InputError("cutting_depth", "nothing", "the height at which the arc of the edge ends")
    if not d.cutting_depth < radius:
        raise InputError("cutting_depth", f"{1e3 * d.cutting_depth:g} mm", f"below the radius of the edge's arc, {1e3 * radius:g} mm")
    _wiper(d.wiper, 0.5 * diameter)
    r = 0.5 * diameter
    return Profile((Line(0.0, 0.0, r, 0.0), Arc(r, radius, radius, 0.0, float(np.arccos(1.0 - d.cutting_depth / radius)))))


def _wiper(wiper: float | None, room: float) -> None:
    """A wiper is a part of the floor: it makes the surface and cuts nothing else."""
    if wiper is not None and not 0.0 <= wiper <= room:
        raise InputError("wiper", f"{1e3 * wiper:g} mm", f"0 to {1e3 * room:g} mm, which the floor has room for")


def _shorter(told: float | None, drawn: float) -> float:
    """The depth that is told, where it is not beyond the one that a largest diameter draws."""
    if told is not None and told > drawn * (1.0 + _ROUNDED):
        raise InputError("cutting_depth", f"{1e3 * told:g} mm", f"at most {1e3 * drawn:g} mm, where the edge reaches its largest diameter")
    return drawn if told is None else min(told, drawn)


def outline_through(rows: Sequence[Sequence[float]]) -> Profile:
    """Return the outline through points, each reached on a line, or on an arc where a radius stands behind it.

    Parameters
    ----------
    rows : sequence of (r, z) or (r, z, radius) [m]
        From the tip up; an arc with a radius below 0 is hollow. An arc is the shorter one of its circle.

    Examples
    --------
    >>> print(outline_through([(0.0, 0.0), (0.005, 0.0), (0.008, 0.003, 0.003), (0.008, 0.02)]).segments[1])
    arc of 3 mm about r 5, z 3 mm, 0° to 90°
    """
    if len(rows) < 2:
        raise InputError("profile", f"{len(rows)} points", "two or more points (r, z)")
    segments: list[Segment] = []
    for k, row in enumerate(rows[1:], start=2):
        (r0, z0), (r1, z1) = (float(v) for v in rows[k - 2][:2]), (float(v) for v in row[:2])
        if len(row) == 2 or row[2] == 0.0:
            segments.append(Line(r0, z0, r1, z1))
            continue
        radius, chord = float(row[2]), float(np.hypot(r1 - r0, z1 - z0))
        if not 0.0 < chord <= 2.0 * abs(radius) * (1.0 + ROUNDING):
            allowed = f"at least half of the distance to the point before it, {500.0 * chord:g} mm"
            raise InputError("profile", f"point {k}: an arc of {1e3 * abs(radius):g} mm", allowed)
        away = float(np.sqrt(max(radius**2 - 0.25 * chord**2, 0.0))) * np.sign(radius) / chord
        r_c, z_c = 0.5 * (r0 + r1) - away * (z1 - z0), 0.5 * (z0 + z1) + away * (r1 - r0)
        kappa0, kappa1 = (float(np.arctan2((r - r_c) / radius, (z_c - z) / radius)) for r, z in ((r0, z0), (r1, z1)))
        segments.append(Arc(r_c, z_c, radius, _upright(kappa0), _upright(kappa1)))
    return Profile(tuple(segments))


def _upright(kappa: float) -> float:
    """An angle that rounding took out of 0 to pi."""
    if not -1e-6 < kappa < np.pi:
        return float(np.pi) if kappa < 1e-6 - np.pi else kappa
    return max(kappa, 0.0)


def rows_through(profile: Profile) -> FloatArray:
    """Return the points of an outline and the radii of the arcs to them, shape (n, 3) [m]; 0 where it is reached on a line."""
    first = profile.segments[0].ends
    rows = [(first[0], first[1], 0.0)]
    rows += [(s.ends[2], s.ends[3], s.radius if isinstance(s, Arc) else 0.0) for s in profile.segments]
    return np.array(rows)
