"""Keys that people write, each declared once: readers, writers, schemas, bodies of the service, options and the page are made of these.

Commands read it before they compute anything: it imports nothing heavy, and names choices where their nouns would bring in more.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from rcsa_ident.base.plausibility import (
    AXIAL_DEPTH,
    AXIAL_RATIO,
    DENSITY,
    DIAMETER,
    EDGE,
    FEED_PER_TOOTH,
    INDENTATION,
    LOSS_FACTOR,
    MODULUS,
    RADIAL_RATIO,
    RUNOUT,
    SEGMENT_DIAMETER,
    SEGMENT_LENGTH,
    SIDE,
    SPINDLE_SPEED,
    TANGENTIAL,
    TEMPERATURE,
    WEAR_LAND,
    Range,
)
from rcsa_ident.base.plausibility import CONTACT as CONTACT_RANGES
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.tool_holder.spread import LARGEST_LENGTH, LARGEST_SHARE, LENGTHS, Spread

#: The default of a key that must be there.
NEEDED: Any = object()
_DEGREE = math.radians(1.0)


@dataclass(frozen=True, slots=True)
class Number:
    """A number that whoever reads it holds to its limits; a `Range` in its place is held to by the noun, which names the likely slip.

    `size`, `per`: the unit is `size` / `per` in SI; of the two one is 1, so that the last digit is that of one operation
    `least`, `most`, `above` [unit]: `above` is not allowed itself, the others are
    """

    unit: str = ""
    size: float = 1.0
    least: float | None = None
    most: float | None = None
    above: float | None = None
    whole: bool = False
    per: float = 1.0

    @classmethod
    def within(cls, kind: Range) -> Number:
        """What is possible of a quantity, as plain limits."""
        return cls(kind.unit, kind.size, *kind.possible)


@dataclass(frozen=True, slots=True)
class Many:
    """A list of numbers, so many of them at most if there is a limit."""

    each: Number
    most: int | None = None


@dataclass(frozen=True, slots=True)
class Named:
    """One of some names, or a number, which `what` calls in words."""

    names: tuple[str, ...]
    number: Number
    what: str


#: What may stand under a key; a tuple are choices, `str` and `bool` themselves, and `list` what its reader reads by hand.
Kind = Range | Number | Many | Named | tuple[str, ...] | type


@dataclass(frozen=True, slots=True)
class Field:
    """A key of a noun.

    `name`: of the noun's field, which is in SI
    `key`: in files and bodies of the service; options have ``-`` in place of ``_``
    `kind`: Range, Number, Many, Named, tuple of str, or str, bool or list themselves
    `default`: as the key has it, in its unit; None is not told
    `described`, `help`, `label`, `hint`: what the service, the option of a command (keys in braces are options, too) and the field of the
        page say of it
    """

    name: str
    key: str
    kind: Kind
    default: Any = NEEDED
    described: str = ""
    help: str = ""
    label: str = ""
    hint: str = ""

    @property
    def number(self) -> Range | Number:
        """Of the unit and the limits of its numbers; without either where it has none."""
        kind = self.kind
        kind = kind.each if isinstance(kind, Many) else kind.number if isinstance(kind, Named) else kind
        return kind if isinstance(kind, Range | Number) else Number()

    def in_si(self, value: Any) -> Any:
        """Return a value of the key as the noun has it; texts and None stay."""
        if isinstance(value, list | tuple):
            return tuple(self.in_si(each) for each in value)
        if value is None or isinstance(value, str) or not isinstance(self.kind, Range | Number | Many | Named):
            return value
        number = self.number
        return value * number.size if isinstance(number, Range) or number.per == 1.0 else value / number.per

    def in_unit(self, value: Any) -> Any:
        """Return a number of the noun as the key has it; what is none stays."""
        if value is None or not isinstance(self.kind, Range | Number):
            return value
        return value * (1.0 / self.kind.size) if isinstance(self.kind, Range) or self.kind.per == 1.0 else value * self.kind.per

    @property
    def limits(self) -> tuple[float | None, float | None, float | None]:
        """Least and most number [unit], and that which it lies above."""
        number = self.number
        return (*number.possible, None) if isinstance(number, Range) else (number.least, number.most, number.above)

    @property
    def choices(self) -> tuple[str, ...]:
        """Texts that are allowed, where not any is."""
        kind = self.kind.names if isinstance(self.kind, Named) else self.kind
        return kind if isinstance(kind, tuple) else ()

    @property
    def needed(self) -> Field:
        """The same, where other keys ask for it."""
        return replace(self, default=NEEDED)

    def up_to(self, most: float) -> Field:
        """Return the same, whose largest number hangs on other keys."""
        if isinstance(self.kind, Named):
            return replace(self, kind=replace(self.kind, number=replace(self.kind.number, most=most)))
        assert isinstance(self.kind, Number)
        return replace(self, kind=replace(self.kind, most=most))


def keys_of(fields: Iterable[Field]) -> tuple[str, ...]:
    """Return the keys of a noun, as its file has them."""
    return tuple(each.key for each in fields)


def told_in_si(fields: Iterable[Field], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is told of a noun, by the names of its fields."""
    return {each.name: each.in_si(keys[each.key]) for each in fields if keys.get(each.key) is not None}


def keys_told(fields: Iterable[Field], noun: object, usual: bool = True) -> dict[str, Any]:
    """Return what a noun says, by its keys; without `usual` not what counts where a key is left out."""
    told = ((each, getattr(noun, each.name)) for each in fields)
    return {each.key: each.in_unit(value) for each, value in told if usual or each.default is NEEDED or value != each.in_si(each.default)}


_ANGLE, _LEAN = Number("deg", _DEGREE, 0.0, 180.0), Number("deg", _DEGREE, -89.0, 89.0)
_SIDE, _FAR = Number.within(SIDE), Number("mm", 1e-3, -1e4, 1e4)
#: Of a hammer test, on the tooling; how far it may lie from the tip hangs on that.
_POINT = Named(("tip", "flange"), Number("mm", 1e-3, 0.0), "the distance from the tip")
#: Of the feed in the machine's X-Y plane.
DIRECTION = Named(("+X", "-X", "+Y", "-Y"), Number("deg", _DEGREE, -360.0, 360.0), "an angle from +X")
#: Cutting coefficients of a cut that is asked about.
COEFFICIENTS = (
    Field("tangential", "ktc_mpa", TANGENTIAL, None, label="Tangential coefficient",
          help="Tangential coefficient, MPa; default: the result's workpiece."),
    Field("radial_ratio", "krc", RADIAL_RATIO, None, label="Radial over tangential", help="Radial ratio; default: the result's workpiece."),
    Field("axial_ratio", "kac", AXIAL_RATIO, None, label="Axial over tangential",
          help="Axial ratio; default: the result's workpiece, or 0."),
    Field("tangential_edge", "kte_n_per_mm", EDGE, None, help="Tangential edge force, N/mm."),
    Field("radial_edge", "kre_n_per_mm", EDGE, None, help="Radial edge force, N/mm."),
)  # fmt: skip
OF_MATERIAL = Field(
    "material", "material", str, None, described="Of the library of materials.", help="Coefficients of a material of the library."
)
#: A cut that somebody asks about: `CutSpec`.
ASKED_CUT = (
    Field("immersion", "immersion", Number("", 1.0, 0.001, 1.0), 0.5, label="Radial immersion",
          described="Radial depth over diameter; 1 is a slot.", help="Radial depth over diameter, as 0.5 or 50%; 1 is a slot."),
    Field("strategy", "strategy", ("up", "down"), "down", help="Up or down milling."),
    Field("entry", "entry_deg", _ANGLE, None, described="With exit_deg in place of immersion.",
          help="Entry angle from the normal direction, instead of {immersion}."),
    Field("exit", "exit_deg", _ANGLE, None, help="Exit angle."),
    Field("stock", "stock", ("stepover", "block"), None,
          described="What stands around the cutter: a stepover of the immersion, as where the same cutter cut before, or a block.",
          help="What stands around the cutter: stepover of {immersion}, as where the same cutter cut before (the default), or a block."),
    Field("y_from", "y_from_mm", _SIDE, None, label="Block from",
          described="Of a block: its sides beside the path, along the normal direction.",
          help="One side of a block, mm beside the cutter's path along the normal."),
    Field("y_to", "y_to_mm", _SIDE, None, label="Block to", help="The other side, mm."),
    Field("engagement", "engagement", str, None, described="Rows of z_mm, entry_angle_deg, exit_angle_deg from the tip up.",
          help="Angles between which the edge cuts at each height: z_mm, entry_angle_deg, exit_angle_deg."),
    Field("lead", "lead_deg", _LEAN, None,
          described="By which the tool leans towards the feed, with engagement.",
          help="How far the tool leans towards the feed, degrees; with {engagement}."),
    Field("feed_angle", "feed_direction", DIRECTION, "+X", described="Or degrees from +X.", help="+X -X +Y -Y, or degrees from +X."),
    Field("feed_per_tooth", "feed_per_tooth_mm", FEED_PER_TOOTH, None, label="Feed per tooth",
          help="Feed per tooth, mm: power, run-out, surface error."),
    OF_MATERIAL,
    *COEFFICIENTS,
    Field("runout", "runout_um", Many(Number.within(RUNOUT), 100), None, label="Run-out, tooth by tooth",
          described="Radial offset of each edge.", help="Radial offset of each edge, um."),
    Field("wear_land", "wear_land_um", Number.within(WEAR_LAND), None, label="Wear land",
          described="Process damping, with indentation.", help="Width of the wear land behind the edge, um: adds process damping."),
    Field("indentation", "indentation", Number.within(INDENTATION), None, label="Indentation",
          described="[N/m^3], 1e14 for aluminium.", help="Indentation coefficient, N/m^3 (1e14 aluminium, 4e13 steel)."),
    Field("friction", "friction", Number("", 1.0, 0.0, 2.0), 0.3, label="Friction of the worn land",
          help="Coefficient of friction of the flank, with {wear_land_um}."),
)  # fmt: skip

#: A segment of a tool or of a holder: `BeamSegment`.
SEGMENT = (
    Field("length", "length_mm", Number("mm", 1e-3, above=0.0, most=SEGMENT_LENGTH.possible[1]), label="Length"),
    Field("diameter", "outer_diameter_mm", SEGMENT_DIAMETER, label="Diameter"),
    Field("inner_diameter", "inner_diameter_mm", Number("mm", 1e-3, 0.0), 0.0, label="Bore", hint="none"),
    Field("end_diameter", "end_diameter_mm", SEGMENT_DIAMETER, None, label="End diameter", hint="same"),
    Field("material", "material", str),
    Field("area", "area_mm2", Number("mm^2", 1e-6, above=0.0), None),
    Field("second_moment", "second_moment_mm4", Number("mm^4", 1e-12, above=0.0), None),
)
#: What holds a tool in its holder, per metre of insertion: `Contact`.
CONTACT = tuple(
    Field(key, key, kind, 0.0 if "damping" in key else NEEDED, label=key.replace("_", " ").capitalize(), hint=kind.unit)
    for key, kind in CONTACT_RANGES.items()
)
#: What a segment is made of: `Material`.
MATERIAL = (
    Field("youngs_modulus", "youngs_modulus_gpa", MODULUS),
    Field("density", "density", DENSITY),
    Field("poisson", "poisson", Number("", 1.0, 0.0, 0.499)),
    Field("loss_factor", "loss_factor", LOSS_FACTOR, 0.0),
)


def _spread(name: str, label: str, hint: str = "") -> Field:
    """How well a drawing is known, in millimetres or percent; the default is what an honest drawing is good for."""
    unit, size, most = ("mm", 1e-3, LARGEST_LENGTH) if name in LENGTHS else ("%", 1e-2, LARGEST_SHARE)
    key = f"{name}_{'mm' if name in LENGTHS else 'percent'}"
    return Field(name, key, Number(unit, size, 0.0, round(most / size, 9)), getattr(Spread(), name) / size, label=f"± {label}", hint=hint)


#: How well a drawing is known: `Spread`.
SPREAD = (
    _spread("stickout", "Stickout", "A presetter's; 0.3 mm with a ruler"),
    _spread("fluted_diameter", "Fluted diameter", "Of an equivalent cylinder"),
    _spread("youngs_modulus", "Young's modulus", "Of the tool"),
    _spread("contact_stiffness", "Contact stiffness", "70 % where the contact is the catalogue's"),
    _spread("contact_damping", "Contact damping"),
    _spread("holder_diameter", "Holder diameters"),
    _spread("reclamping", "Reclamping", "Contact, from clamping to clamping"),
    _spread("spindle_joint", "Flange joint", "From clamping to clamping"),
    _spread("segment_length", "Segment lengths"),
    _spread("corner_radius", "Corner radius"),
)

_PERCENT, _KNOWN = Number("%", 1e-2, 0.0, 50.0), Number("%", per=100.0, least=0.0, most=100.0)
#: A material and its cutting coefficients: `CuttingCoefficients`, between the other two keys of `Workpiece`.
WORKPIECE = (
    Field("name", "name", str),
    Field("tangential", "tangential_coefficient_mpa", TANGENTIAL, label="Tangential coefficient"),
    Field("radial_ratio", "radial_ratio", RADIAL_RATIO, label="Radial over tangential"),
    Field("axial_ratio", "axial_ratio", AXIAL_RATIO, 0.0),
    Field("tangential_edge", "tangential_edge_n_per_mm", EDGE, 0.0),
    Field("radial_edge", "radial_edge_n_per_mm", EDGE, 0.0),
    Field("axial_edge", "axial_edge_n_per_mm", EDGE, 0.0),
    Field("tangential_spread", "tangential_coefficient_spread_percent", _KNOWN, 5.0),
    Field("ratio_spread", "radial_ratio_spread_percent", _KNOWN, 5.0),
    Field("edge_spread", "edge_spread_percent", _KNOWN, 10.0),
    Field("edge_force_spread", "edge_force_spread_n_per_mm", Number("N/mm", 1e3, 0.0, 200.0), 10.0,
          described="Standard deviation of edge forces that nobody tells; 10."),
)  # fmt: skip
#: A channel and what stands behind it: `Sensor`; a trigger has some of these keys.
SENSOR = (
    Field("quantity", "quantity", ("displacement", "acceleration", "trigger", "force")),
    Field("axis", "axis", ("X", "Y", "Z"), None),
    Field("sensitivity", "sensitivity", Number("signal per SI unit"), label="Sensitivity",
          described="Signal per quantity: V/m, V/(m/s^2), V/N; 1 where the file is in SI."),
    Field("delay", "delay_s", Number("s", 1.0, -1.0, 1.0), 0.0),
    Field("bandwidth", "bandwidth_hz", Number("Hz", above=0.0), None),
    Field("role", "role", ("spindle", "fixture", "table", "workpiece"), None, described="What an accelerometer is fixed to."),
    Field("mount_resonance", "mount_resonance_hz", Number("Hz", above=0.0), None, described="Of the sensor on its mount, a magnet or wax."),
    Field("rotation", "rotation_deg", Number("deg", _DEGREE, -180.0, 180.0), 0.0,
          described="Of what the sensor measures from its axis, about the spindle's, from +X towards +Y."),
    Field("pulses_per_revolution", "pulses_per_revolution", Number("", 1, 1, 100_000, whole=True), 1),
    Field("tooth_angle", "tooth_angle_deg", Number("deg", _DEGREE, -360.0, 360.0), None),
    Field("gain_spread", "gain_spread_percent", _PERCENT, 2.0,
          described="Standard deviation of the gain; 2. Counts where drawings are rough."),
    Field("cross_talk_spread", "cross_talk_percent", _PERCENT, 1.5,
          described="Standard deviation of what it feels of the other axis; 1.5."),
    Field("delay_spread", "delay_spread_us", Number("us", least=0.0, most=1000.0, per=1e6), 5.0,
          described="Standard deviation of its delay; 5."),
    Field("distance", "distance_behind_flange_mm", Number("mm", 1e-3, -100.0, 300.0), None, label="Behind the flange",
          described="How far a displacement sensor looks behind the face between holder and spindle; negative: at the holder."),
    Field("distance_spread", "distance_spread_mm", Number("mm", 1e-3, 0.0, 100.0), 1.0,
          described="Standard deviation of that distance; 1."),
)  # fmt: skip
#: What counts for a whole campaign: `Campaign`.
CAMPAIGN = (
    Field("name", "name", str, None),
    Field("sampling_rate", "sampling_rate_hz", Number("Hz", above=0.0, most=1e8), None, label="Sampling rate",
          described="For files without a sampling rate.", hint="For files that carry none"),
    Field("clock_error", "clock_error_percent", Number("%", 1e-2, -2.0, 2.0), 0.0,
          described="By how much the recorder's clock runs fast: it takes that many more samples in a second."),
    Field("depth_spread", "axial_depth_spread_mm", Number("mm", 1e-3, 0.0, 1.0), 0.02,
          described="Standard deviation of the depth, common to a tooling's cuts; 0.02."),
    Field("softening_spread", "speed_softening_percent", Number("%", 1e-2, above=0.0, most=50.0), 3.0,
          described="Standard deviation of the stiffness's change from the middle of the speeds to their end."),
)  # fmt: skip
#: How a cutter was engaged, in files: by angles, by a radial depth, by a block's sides, or by a map.
ENGAGEMENT = (
    Field("entry", "entry_angle_deg", _ANGLE, None, described="At the cutter's diameter; with a shape, down and up milling are stepovers."),
    Field("exit", "exit_angle_deg", _ANGLE, None),
    Field("radial_depth", "radial_depth_mm", Number("mm", 1e-3, above=0.0), None, described="With strategy, instead of the angles."),
    Field("strategy", "strategy", ("up", "down"), None),
    Field("stock", "stock", ("stepover", "block"), None, described="What stood around the cutter."),
    Field("y_from", "y_from_mm", _FAR, None, described="Of a block: its sides beside the cutter's path, along the normal direction."),
    Field("y_to", "y_to_mm", _FAR, None),
    Field("engagement", "engagement", str, None, described="Rows of z_mm, entry_angle_deg, exit_angle_deg from the tip up."),
    Field("lead", "lead_deg", _LEAN, 0.0, described="By which the tool leans in the direction of the feed, with engagement."),
    Field("tilt", "tilt_deg", _LEAN, 0.0),
)
#: Recordings of a cut that was made.
RECORDINGS = (
    Field("recording", "cut", str, described="Recording of the cut; only the last part of a path counts, and its suffix is the format."),
    Field("air", "air", str, None, described="Recording at the same speed without cutting; may serve several cuts."),
)
#: A cut that was made: `Cut` and its `CuttingConditions`.
CUT = (
    Field("id", "id", str),
    Field("tooling", "tooling", str),
    Field("spindle_speed", "spindle_speed_rpm", SPINDLE_SPEED),
    Field("last_speed", "spindle_speed_to_rpm", SPINDLE_SPEED, None,
          described="At which a pass ends whose speed changes evenly; null keeps the speed."),
    Field("axial_depth", "axial_depth_mm", AXIAL_DEPTH),
    Field("feed_per_tooth", "feed_per_tooth_mm", FEED_PER_TOOTH),
    *ENGAGEMENT,
    Field("feed_angle", "feed_direction", DIRECTION, described="+X, -X, +Y, -Y, or an angle from +X in degrees."),
    Field("posture", "posture_deg", Many(Number("deg", _DEGREE)), None,
          described="Of a robot's joints; an identification of the robot asks for it."),
    Field("started", "started", str, None, described="When the recording began, as 2026-11-27T08:15:00."),
    Field("temperature", "temperature_c", TEMPERATURE, None, described="Near the spindle's bearings."),
    Field("validation", "validation", bool, False, described="The cut is predicted, and nothing is learned from it."),
)  # fmt: skip
#: What is done to a measured FRF, and what that is.
CORRECTIONS = ("auto", "none", "reverse", "conjugate", "conjugate-reverse", "exchange", "exchange-reverse")
CORRECTION = "Of a reversed sensor or hammer, of time as e^(-iωt), of exchanged columns; auto turns what is certain and says so."
#: A receptance that a hammer has shown: `HammerTest`, whose band is told by its two ends.
HAMMER_TEST = (
    Field("id", "id", str),
    Field("tooling", "tooling", str),
    Field("axis", "axis", ("X", "Y")),
    Field("response", "response", _POINT, described="tip, flange (the machine's side of it), or mm from the tip."),
    Field("force", "force", _POINT, described="As response; one of the two is a point of tool or holder."),
    Field("file", "file", str, described="File of the FRF; only the last part of a path counts, and its content says what it is."),
    Field("record", "record", Number("", 1, 1, 100_000, whole=True), None, described="Which of several FRFs in the file."),
    Field("units", "units", str, None, described="Of a file that tells none: a motion over a force, such as um/N."),
    Field("standstill", "standstill", bool, True),
    Field("sensor_mass", "sensor_mass_g", Number("g", 1e-3, 0.0, 1000.0), 0.0),
    Field("low", "from_hz", Number("Hz", 1.0, 0.0, 1e6), 0.0),
    Field("high", "to_hz", Number("Hz", 1.0, above=0.0, most=1e6), None),
    Field("error", "error_percent", Number("%", 1e-2, 0.0, 100.0), 2.0,
          described="By how much each line may be wrong beside its noise; 2 if left out."),
    Field("correction", "correction", CORRECTIONS, "auto", described=CORRECTION),
)  # fmt: skip


def _dimension(name: str, label: str, hint: str, described: str = "") -> Field:
    """What draws a cutter's shape, in degrees or millimetres."""
    angle = name in ("cutting_edge_angle", "taper")
    kind = Number("deg", _DEGREE, above=0.0, most=179.0) if angle else Number("mm", 1e-3, above=0.0, most=10_000.0)
    return Field(name, f"{name}_{'deg' if angle else 'mm'}", kind, None, label=label, hint=hint, described=described)


#: What draws a cutter's shape beside its diameter and its corner radius: `Dimensions`.
DIMENSIONS = (
    _dimension("cutting_edge_angle", "Cutting edge angle", "KAPR, from the floor to the edge", "KAPR, from the floor to the edge."),
    _dimension("taper", "Angle from the axis", "Taper of each side", "From the axis to the edge."),
    _dimension("largest_diameter", "Largest diameter", "DCX, where the edge ends", "DCX, where the edge ends."),
    _dimension("cutting_depth", "Edge height", "APMX, from the tip to its end", "APMX, from the tip to where the edge ends."),
    _dimension("wiper", "Wiper", "BS, the flat beside the corner", "BS, length of the flat beside the corner."),
    _dimension("profile_radius", "Profile radius", "Of the long arc", "PRFRAD, of the long arc."),
    _dimension("axial_distance", "Axial distance", "From the tip to where it is widest", "From the tip to where a barrel is widest."),
    _dimension("upper_radius", "Upper radius", "At the edge's upper end"),
    _dimension("tip_diameter", "Tip diameter", "Of the floor; empty: a point or a ball"),
    _dimension("neck_diameter", "Neck diameter", "Behind the ball"),
    _dimension("tip_length", "Tip length", "Of the straight edge below the arc"),
)
#: What cuts: `Cutter`; lists of one number a tooth are read by hand.
CUTTER = (
    Field("teeth", "teeth", Number("", 1, 1, 100, whole=True), label="Teeth"),
    Field("diameter", "diameter_mm", DIAMETER, label="Cutting diameter"),
    Field("helix", "helix_deg", list, 0.0, described="One angle, or one a tooth."),
    Field("helix_kind", "helix_kind", ("lead", "angle"), "lead",
          described="lead, or angle where the edge stands at one angle to the axis at any radius."),
    Field("pitch", "pitch_deg", list, None),
    Field("shape", "shape", tuple(str(each) for each in CutterShape), "flat",
          described=f"One of {', '.join(CutterShape)}; flat without it. Without the keys that draw it, it is computed as a cylinder."),
    Field("corner_radius", "corner_radius_mm", Number("mm", 1e-3, 0.0, 1000.0), 0.0, label="Corner radius", hint="RE"),
    *DIMENSIONS,
    Field("profile", "profile", list, None,
          described="Points r, z from the tip up, and the radius of the arc to each where it is one."),
    Field("serration", "serration", list, None),
    Field("runout", "runout_mm", list, None),
    Field("axial_runout", "axial_runout_mm", list, None),
    Field("tilt", "tilt_deg", Number("deg", _DEGREE, -1.0, 1.0), 0.0),
)  # fmt: skip

#: Nouns whose keys are declared, by what they are called where all are told.
NOUNS = {
    "cut": ASKED_CUT,
    "cutter": CUTTER,
    "segment": SEGMENT,
    "contact": CONTACT,
    "material": MATERIAL,
    "spread": SPREAD,
    "workpiece": WORKPIECE,
    "sensor": SENSOR,
    "campaign": CAMPAIGN,
    "cuts": (*CUT, *RECORDINGS),
    "frfs": HAMMER_TEST,
}
