"""[cutter] of a tooling file: teeth, and the outline that their edges sweep over; read and written."""

from __future__ import annotations

from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.cutter import Cutter, HelixKind
from rcsa_ident.cutting.outlines import TAKES, Dimensions, in_files, key_of, outline_of, outline_through, rows_through
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.serration import Serration, WaveShape
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.io.validated_table import Table, as_number, describe
from rcsa_ident.setup.fields import CUTTER, keys_of, told_in_si
from rcsa_ident.setup.fields import DIMENSIONS as DIMENSION_FIELDS

#: Dimensions by the keys of files, each with its field.
DIMENSIONS = {each.key: each.name for each in DIMENSION_FIELDS}
CUTTER_KEYS = keys_of(CUTTER)
_OWN = {each.key: each for each in CUTTER}
_SERRATION = ("amplitude_mm", "wavelength_mm", "shape", "shift", "table")
#: Points of an outline of one's own, at most.
MOST_POINTS = 500
#: Fields of nouns and arguments of outlines whose keys are called otherwise.
_NAMES = {
    **{name: f"cutter.{key}" for key, name in DIMENSIONS.items()},
    "corner_radius": "cutter.corner_radius_mm",
    "neck": "cutter.neck_diameter_mm",
    "depth": "cutter.cutting_depth_mm",
    "length": "cutter.cutting_depth_mm",
    "height": "cutter.axial_distance_mm",
    "tip_radius": "cutter.corner_radius_mm",
    "tip_radius and profile_radius": "cutter.corner_radius_mm and cutter.profile_radius_mm",
    "diameter": "cutter.diameter_mm",
    "helix": "cutter.helix_deg",
    "tilt": "cutter.tilt_deg",
    "runout": "cutter.runout_mm",
    "axial_runout": "cutter.axial_runout_mm",
    **{f"serration {key}": f"cutter.serration.{key}" for key in ("shape", "shift", "table")},
    **{f"serration {name}": f"cutter.serration.{name}_mm" for name in ("amplitude", "wavelength")},
}


def cutter_of(table: Table) -> Cutter:
    """Return the cutter of a table ``[cutter]``.

    `table`: of `CUTTER_KEYS`
    Raises `InputError`, which names the file, the key, what was found and what is allowed: also of outlines that cannot be, and of keys
        that a shape has not.
    """
    teeth = table.field(_OWN["teeth"])
    diameter = table.field(_OWN["diameter_mm"]) * 1e-3
    shape = CutterShape(table.field(_OWN["shape"]))
    corner = table.field(_OWN["corner_radius_mm"]) * 1e-3
    if not shape.has_room(corner, diameter):
        table.refuse("corner_radius_mm", f"{1e3 * corner:g}", f"at most half of the diameter, {500.0 * diameter:g} [mm]")
    dimensions = Dimensions(**told_in_si(DIMENSION_FIELDS, table.fields(DIMENSION_FIELDS)))
    rows = _rows(table)
    _check_keys(table, shape)
    # None of pitch and run-out is what the cutter takes by default
    given: dict[str, Any] = {
        "helix": _helix(table, teeth),
        "pitch": _pitch(table, teeth),
        "runout": _offsets(table, "runout_mm", teeth),
        "axial_runout": _offsets(table, "axial_runout_mm", teeth),
        "helix_kind": HelixKind(table.field(_OWN["helix_kind"])),
        "tilt": float(np.radians(table.field(_OWN["tilt_deg"]))),
    }
    wave = _wave(table, teeth)
    with table.naming(_NAMES):
        # points are refused beside any other shape
        profile = outline_of(shape, diameter, corner, dimensions) if rows is None else outline_through(rows)
        serration = None if wave is None else Serration(**wave)
        cutter = Cutter(
            teeth, diameter, shape=shape, corner_radius=corner, profile=profile, serration=serration, dimensions=dimensions, **given
        )
    _check_width(table, profile, diameter)
    return cutter


def _check_keys(table: Table, shape: CutterShape) -> None:
    """Refuse keys that a shape is not drawn by."""
    takes = TAKES[shape]
    known = [name if name == "profile" else key_of(name) for name in (*takes.needs, *takes.may)]
    for key in (*DIMENSIONS, "profile", "corner_radius_mm"):
        # a corner of 0 is none
        if key in table and key not in known and not (key == "corner_radius_mm" and table.data[key] == 0.0):
            table.refuse(key, f"given for the shape {shape}", f"what draws that shape, {', '.join(known)}")


def _check_width(table: Table, profile: Profile | None, diameter: float) -> None:
    """Refuse an outline so far from the diameter that one of the two is meant otherwise."""
    if profile is None:
        return
    widest = 2.0 * profile.largest_radius
    if not 0.5 * diameter < widest:
        found = f"{1e3 * diameter:g}, of an outline that is {1e3 * widest:g} mm wide"
        table.refuse("diameter_mm", found, "less than twice that width [mm]")


def _rows(table: Table) -> list[tuple[float, ...]] | None:
    """Points of an outline of one's own, in metres."""
    allowed = f"a list of 2 to {MOST_POINTS} points [r, z] or [r, z, radius of the arc to it], from the tip up [mm]"
    number = {"type": "number"}
    point = {"type": "array", "items": number, "minItems": 2, "maxItems": 3}
    schema = {"type": "array", "items": point, "minItems": 2, "maxItems": MOST_POINTS, "description": allowed}
    found = table.value("profile", allowed, None, schema)
    if found is None:
        return None
    if not isinstance(found, list) or not 2 <= len(found) <= MOST_POINTS:
        table.refuse("profile", describe(found), allowed)
    rows = []
    for k, row in enumerate(found, start=1):
        values = [as_number(value) for value in row] if isinstance(row, list) and len(row) in (2, 3) else [None]
        if not all(value is not None and abs(value) <= 1e4 for value in values):
            table.refuse("profile", f"point {k}: {describe(row)}", allowed)
        rows.append(tuple(1e-3 * value for value in values if value is not None))
    return rows


def _helix(table: Table, teeth: int) -> float | FloatArray:
    """One angle, or one a tooth."""
    one = {"type": "number", "minimum": 0.0, "maximum": 80.0, "description": "In deg"}
    allowed = f"one angle at least 0 and at most 80 [deg], or a list of {teeth} of them, one a tooth"
    each = {"type": "array", "items": one, "maxItems": 100, "minItems": 1}
    found = table.value("helix_deg", allowed, 0.0, {"anyOf": [one, each], "description": "One angle, or one a tooth, in deg"})
    angles = found if isinstance(found, list) else [found]
    numbers = [as_number(angle) for angle in angles]
    if not all(number is not None and 0.0 <= number <= 80.0 for number in numbers) or len(numbers) not in {1, teeth}:
        table.refuse("helix_deg", describe(found), allowed)
    radians = np.radians(np.array(numbers, dtype=float))
    return radians if isinstance(found, list) and radians.size == teeth else float(radians[0])


def _pitch(table: Table, teeth: int) -> FloatArray | None:
    if "pitch_deg" not in table:
        return None
    degrees = np.array(table.numbers("pitch_deg", teeth, "deg"))
    if np.any(degrees <= 0.0) or abs(degrees.sum() - 360.0) > 0.01 * teeth:
        table.refuse("pitch_deg", f"{degrees.tolist()}, sum {degrees.sum():g}", f"{teeth} angles above 0 that add up to 360 [deg]")
    # angles written with few decimals add up to nearly a turn
    return degrees * (2.0 * np.pi / degrees.sum())


def _offsets(table: Table, key: str, teeth: int) -> FloatArray | None:
    return 1e-3 * np.array(table.numbers(key, teeth, "mm")) if key in table else None


def _wave(outer: Table, teeth: int) -> dict[str, Any] | None:
    """What a serration is made of."""
    if "serration" not in outer:
        return None
    table = outer.table("serration", _SERRATION)
    return {
        "amplitude": 1e-3 * table.number("amplitude_mm", "mm", above=0.0, most=10.0),
        "wavelength": 1e-3 * table.number("wavelength_mm", "mm", above=0.0, most=100.0),
        "shape": WaveShape(table.text("shape", WaveShape.SINE, choices=tuple(WaveShape))),
        "shift": np.array(table.numbers("shift", teeth, "wavelengths")) if "shift" in table else None,
        "table": np.array(table.numbers("table", None, "amplitudes")) if "table" in table else None,
    }


def cutter_keys(cutter: Cutter) -> dict[str, Any]:
    """Return a cutter as ``[cutter]`` of a file holds it."""
    helix = np.degrees(np.atleast_1d(cutter.helix)).tolist()
    found: dict[str, Any] = {
        "teeth": cutter.teeth,
        "diameter_mm": 1e3 * cutter.diameter,
        "helix_deg": helix if len(helix) > 1 else helix[0],
    }
    if cutter.helix_kind is not HelixKind.LEAD:
        found["helix_kind"] = str(cutter.helix_kind)
    if np.ptp(cutter.pitch) > 1e-9:
        found["pitch_deg"] = np.degrees(cutter.pitch).tolist()
    found |= _shape_keys(cutter)
    if cutter.serration is not None:
        found["serration"] = _serration_keys(cutter.serration)
    for key, offsets in (("runout_mm", cutter.runout), ("axial_runout_mm", cutter.axial_runout)):
        if np.any(offsets):
            found[key] = (1e3 * offsets).tolist()
    return found | ({"tilt_deg": float(np.degrees(cutter.tilt))} if cutter.tilt else {})


def _shape_keys(cutter: Cutter) -> dict[str, Any]:
    """The keys that draw its outline; an outline that none of them draws is written point by point."""
    drawn = outline_of(cutter.shape, cutter.diameter, cutter.corner_radius, cutter.dimensions)
    own = cutter.profile is not None and cutter.profile != drawn
    shape = CutterShape.PROFILE if own else cutter.shape
    found: dict[str, Any] = {} if shape is CutterShape.FLAT else {"shape": str(shape)}
    if cutter.corner_radius:
        found["corner_radius_mm"] = 1e3 * cutter.corner_radius
    if own and cutter.profile is not None:
        rows = 1e3 * rows_through(cutter.profile)
        return found | {"profile": [row if row[2] else row[:2] for row in rows.tolist()]}
    return found | {key_of(name): in_files(name, value) for name, value in cutter.dimensions.told.items()}


def _serration_keys(wave: Serration) -> dict[str, Any]:
    found: dict[str, Any] = {"amplitude_mm": 1e3 * wave.amplitude, "wavelength_mm": 1e3 * wave.wavelength, "shape": str(wave.shape)}
    return found | {key: value.tolist() for key in ("shift", "table") if (value := getattr(wave, key)) is not None}
