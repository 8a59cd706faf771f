"""What the geometry of a library's tool says of its outline: by the types of Fusion 360 and HSM, and by the properties of ISO 13399.

A library's diameter is DC; of tapered, face and radius mills that is the lower one, of chamfer mills the upper one. Nothing is guessed: a
type whose outline the library does not tell is refused by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.io.validated_table import Table

Keys = dict[str, Any]


class NotRead(Exception):
    """An entry of a library is no milling tool, or one of which the library does not tell enough."""


class _Told(NamedTuple):
    """A tool's geometry, its size of a millimetre, and the notes so far."""

    geometry: Table
    scale: float
    notes: list[str]

    def length(self, name: str) -> float:
        """A length in millimetres that must be there."""
        return float(self.geometry.number(name, "", above=0.0)) * self.scale

    def maybe(self, name: str) -> float:
        """A length in millimetres, 0 where there is none."""
        return float(self.geometry.number(name, "", None, least=0.0) or 0.0) * self.scale

    def angle(self, name: str, most: float = 90.0) -> float:
        return float(self.geometry.number(name, "deg", least=0.0, most=most))

    def some(self, **keys: str) -> Keys:
        """Keys of a cutter for those lengths that are there."""
        return {key: value for key, name in keys.items() if (value := self.maybe(name))}


def _flat(told: _Told) -> Keys:
    return told.some(corner_radius_mm="RE")


def _rough(told: _Told) -> Keys:
    told.notes.append(
        "the library says nothing of waves along the edges: if this rougher has some, write [cutter] serration = { amplitude_mm, "
        "wavelength_mm }; with smooth edges its stability limits were told at 0.24 to 0.47 times the true ones"
    )
    return _flat(told)


def _slot(told: _Told) -> Keys:
    return told.some(corner_radius_mm="RE") | {"cutting_depth_mm": told.length("LCF")}


def _bull(told: _Told) -> Keys:
    if "RE" not in told.geometry and "tip-diameter" in told.geometry:
        corner = 0.5 * (told.length("DC") - told.maybe("tip-diameter"))
        told.notes.append(f"corner radius {corner:.6g} mm, from the tip's diameter")
    else:
        corner = told.geometry.number("RE", "", least=0.0) * told.scale
    return {"shape": CutterShape.BULL_NOSE, "corner_radius_mm": corner} if corner > 0.0 else {}


def _ball(told: _Told) -> Keys:
    return {"shape": CutterShape.BALL} | told.some(corner_radius_mm="RE")


def _tapered(told: _Told) -> Keys:
    taper = told.angle("TA", 89.0)
    if taper == 0.0:
        return _slot(told)
    keys = {"shape": CutterShape.TAPERED, "taper_deg": taper, "cutting_depth_mm": told.length("LCF")}
    return keys | told.some(corner_radius_mm="RE")


def _face(told: _Told) -> Keys:
    # TA is from the axis
    kappa = 90.0 - told.angle("TA", 89.0)
    upper = told.maybe("upper-radius")
    if upper:
        told.notes.append(f"upper radius {upper:.6g} mm left out: it lies above the edge that cuts")
    wide = kappa < 90.0 and told.maybe("DCX") > told.length("DC")
    end = {"largest_diameter_mm": told.maybe("DCX")} if wide else {"cutting_depth_mm": told.length("LCF")}
    return {"shape": CutterShape.FACE, "cutting_edge_angle_deg": kappa} | end | told.some(corner_radius_mm="RE")


def _radius(told: _Told) -> Keys:
    return {"shape": CutterShape.RADIUS, "corner_radius_mm": told.length("RE")} | told.some(tip_length_mm="tip-length")


def _chamfer(told: _Told) -> Keys:
    return {"shape": CutterShape.CHAMFER, "taper_deg": told.angle("TA")} | told.some(tip_diameter_mm="tip-diameter")


def _dovetail(told: _Told) -> Keys:
    keys = {"shape": CutterShape.DOVETAIL, "taper_deg": told.angle("TA"), "cutting_depth_mm": told.length("LCF")}
    return keys | told.some(corner_radius_mm="RE")


def _lollipop(told: _Told) -> Keys:
    keys = {"shape": CutterShape.LOLLIPOP, "neck_diameter_mm": told.length("shoulder-diameter")}
    return keys | told.some(corner_radius_mm="RE")


def _barrel(told: _Told) -> Keys:
    keys = {
        "shape": CutterShape.BARREL,
        "profile_radius_mm": told.length("profile-radius"),
        "axial_distance_mm": told.length("axial-distance"),
        "cutting_depth_mm": told.length("LCF"),
    }
    return keys | told.some(corner_radius_mm="lower-radius", upper_radius_mm="upper-radius")


def _lens(told: _Told) -> Keys:
    # the long arc is the lower one
    long = "lower-radius" if "lower-radius" in told.geometry else "profile-radius"
    keys = {"shape": CutterShape.LENS, "profile_radius_mm": told.length(long), "cutting_depth_mm": told.length("LCF")}
    return keys | told.some(corner_radius_mm="RE")


def _oval(told: _Told) -> Keys:
    return {
        "shape": CutterShape.OVAL,
        "profile_radius_mm": told.length("profile-radius"),
        "corner_radius_mm": told.length("lower-radius"),
        "cutting_depth_mm": told.length("LCF"),
    }


def _taper_barrel(told: _Told) -> Keys:
    keys = {
        "shape": CutterShape.TAPER_BARREL,
        "profile_radius_mm": told.length("profile-radius"),
        "corner_radius_mm": told.length("lower-radius"),
        "taper_deg": told.angle("TA", 89.0),
        "axial_distance_mm": told.length("axial-distance"),
        "cutting_depth_mm": told.length("LCF"),
    }
    return keys | told.some(tip_diameter_mm="tip-diameter", upper_radius_mm="upper-radius")


#: What draws a tool of each type; HSM calls two of them otherwise.
_TYPES: Mapping[str, Callable[[_Told], Keys]] = {
    "flat end mill": _flat,
    "rough end mill": _rough,
    "slot mill": _slot,
    "slot/key cutter": _slot,
    "bull nose end mill": _bull,
    "ball end mill": _ball,
    "tapered mill": _tapered,
    "face mill": _face,
    "radius mill": _radius,
    "circle segment barrel": _barrel,
    "circle segment lens": _lens,
    "circle segment oval": _oval,
    "circle segment taper": _taper_barrel,
    "lollipop mill": _lollipop,
    "chamfer mill": _chamfer,
    "dovetail mill": _dovetail,
    "dovetail": _dovetail,
}


def check_type(kind: str) -> None:
    """Refuse what is no milling tool, and milling tools whose outline a library does not tell."""
    if kind in _TYPES:
        return
    if not kind:
        raise NotRead("an entry without a type")
    if kind == "form mill":
        raise NotRead('a form mill, whose outline the library does not tell: write it as shape = "profile" with its points')
    if kind == "thread mill":
        raise NotRead("a thread mill, not a milling tool with an outline")
    raise NotRead(f"a {kind}, a shape that is not known here" if "mill" in kind else f"a {kind}, not a milling tool")


def shape_keys(kind: str, geometry: Table, scale: float, notes: list[str]) -> Keys:
    """Return the keys of ``[cutter]`` that draw a tool of a type; none of a plain cylinder.

    `kind`: one that `check_type` lets through
    `scale` [mm]: of the library's unit
    `notes`: where to say what was assumed
    """
    keys = _TYPES[kind](_Told(geometry, scale, notes))
    return {key: str(value) if isinstance(value, CutterShape) else value for key, value in keys.items()}


#: Properties of ISO 13399 that are called otherwise in libraries, the first that is there counts.
_NAMES = {
    "NOF": ("ZEFP", "ZEFF", "NOF"),
    "LCF": ("LCF", "APMX"),
    "SFDM": ("DMM", "SFDM", "DCONMS"),
    "LB": ("LB", "LBX", "LB_1"),
}
_FINE = 1e-6
#: Lead angles up to which an edge is that of a high-feed mill [deg].
_HIGH_FEED = 25.0


def iso_geometry(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return properties of ISO 13399 with the names that libraries have for some of them."""
    found = {key: value for key, value in properties.items() if isinstance(value, int | float) and not isinstance(value, bool)}
    for name, others in _NAMES.items():
        known = next((found[other] for other in others if other in found), None)
        if known is not None:
            found[name] = known
    return found


def iso_shape_keys(shape: str | None, geometry: Table, scale: float, notes: list[str]) -> Keys:
    """Return the keys of ``[cutter]`` that properties of ISO 13399 draw.

    `shape`: one of `CutterShape`; None takes it from the properties
    `geometry`: DC, RE, KAPR or PSIR, APMX, DCX, BS, PRFRAD, CHW, KCH
    `scale` [mm]: of the unit of lengths
    `notes`: where to say what was taken for what
    """
    told = _Told(geometry, scale, notes)
    kappa = told.angle("KAPR", 179.0) if "KAPR" in geometry else 90.0 - told.angle("PSIR") if "PSIR" in geometry else None
    if shape is None:
        shape = _iso_shape(told, kappa)
        notes.append(f"shape {shape} taken from the properties")
    if told.maybe("CHW") and shape == CutterShape.FLAT:
        return _chamfered(told)
    lead: Keys = {} if kappa is None else {"cutting_edge_angle_deg": kappa}
    taper: Keys = {} if kappa is None else {"taper_deg": abs(90.0 - kappa)}
    keys = told.some(corner_radius_mm="RE", profile_radius_mm="PRFRAD")
    if shape in (CutterShape.FACE, CutterShape.HIGH_FEED):
        keys |= lead | told.some(wiper_mm="BS", cutting_depth_mm="APMX")
        if "cutting_depth_mm" not in keys:
            keys |= told.some(largest_diameter_mm="DCX")
    elif shape not in (CutterShape.FLAT, CutterShape.BULL_NOSE, CutterShape.BALL):
        depth = {} if shape == CutterShape.CHAMFER else told.some(cutting_depth_mm="APMX")
        keys |= depth | (taper if shape in (CutterShape.TAPERED, CutterShape.CHAMFER, CutterShape.DOVETAIL) else {})
    return keys if shape == CutterShape.FLAT else {"shape": shape} | keys


def _iso_shape(told: _Told, kappa: float | None) -> str:
    if told.maybe("PRFRAD"):
        raise InputError("PRFRAD", "a profile radius without a shape", f"a shape beside it: one of {', '.join(CutterShape)}")
    if kappa is not None:
        return str(CutterShape.DOVETAIL if kappa > 90.0 else CutterShape.FACE if kappa > _HIGH_FEED else CutterShape.HIGH_FEED)
    corner, half = told.maybe("RE"), 0.5 * told.length("DC")
    if corner > half * (1.0 - 1e-3):
        return str(CutterShape.BALL)
    return str(CutterShape.BULL_NOSE if corner else CutterShape.FLAT)


def _chamfered(told: _Told) -> Keys:
    """A cylinder with a chamfer of 45 degrees at its corner, whose width is measured across the axis."""
    width, angle = told.length("CHW"), told.geometry.number("KCH", "deg", 45.0, above=0.0, most=90.0)
    if abs(angle - 45.0) > _FINE:
        told.geometry.refuse("KCH", f"{angle:g}", "45 [deg]: of another chamfer the properties do not tell which side its width is")
    r, high = 0.5 * told.length("DC"), told.length("LCF")
    return {"shape": str(CutterShape.PROFILE), "profile": [[0.0, 0.0], [r - width, 0.0], [r, width], [r, high]]}
