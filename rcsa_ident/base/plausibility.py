"""What values a quantity usually has, what values it can have at all, and which slip of the unit explains others.

Every range that a tooling, a workpiece or a cut is held to stands here: nouns refuse what is impossible and remark on what is unusual,
so that library, command line and service say the same.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from rcsa_ident.base.errors import InputError, finite
from rcsa_ident.base.remarks import Remark, RemarkCode
from rcsa_ident.base.units import from_rpm

_UNIT = re.compile("_(rpm|mm|um|mpa|n_per_mm|deg|hz|kw|nm)$")


class PlausibilityCode(RemarkCode):
    """What a remark on somebody's input is about."""

    UNUSUAL = "unusual"
    """A value outside its usual range."""
    PROPORTION = "proportion"
    """Two values that do not fit each other."""
    ASSUMED = "assumed"
    """A value that nobody has measured, taken as if it were known better."""


@dataclass(frozen=True, slots=True)
class Range:
    """Where the values of a quantity lie.

    `unit`: of the limits, as a file has it
    `size`: of the unit in SI
    `usual`, `possible`: (float, float) [unit]; outside the first is a remark, outside the second an error; both ends belong to them
    `slips`: tuple of (str, float) or (str, float, float); questions with a place for the value that may have been meant, and what leads to
        it from the one that was given: a factor, and what is then added

    Examples
    --------
    >>> print(DIAMETER.remark("cutter.diameter_mm", 300e-3))
    cutter.diameter_mm is 300 mm, but usual are 0.5 to 250 mm
    >>> DIAMETER.remark("cutter.diameter_mm", 12e-3) is None
    True
    """

    unit: str
    size: float
    usual: tuple[float, float]
    possible: tuple[float, float]
    slips: tuple[tuple[str, float] | tuple[str, float, float], ...] = ()

    def checked(self, field: str, value: float) -> float:
        """Return a value [SI] that is possible. Raises `InputError` with what is usual, and the slip that would explain the value."""
        value, (low, high) = finite(field, value, self.unit), self.possible
        if not low <= self._given(value) <= high:
            allowed = f"a number at least {low:g} and at most {high:g}" + (f" [{self.unit}]" if self.unit else "")
            raise InputError(field, self.told(value), f"{allowed}; usual are {self._usual()}{self._slip(value)}")
        return value

    def remark(self, field: str, value: float) -> Remark | None:
        """Return a remark where a value [SI] is not usual, else None."""
        low, high = self.usual
        if low <= self._given(value) <= high:
            return None
        return Remark(
            PlausibilityCode.UNUSUAL, f"{_in_words(field)} is {self.told(value)}, but usual are {self._usual()}{self._slip(value)}"
        )

    @property
    def most(self) -> float:
        """The largest value that is possible [SI]."""
        return self.possible[1] * self.size

    def told(self, value: float) -> str:
        """Return a value [SI] in the unit of files."""
        return f"{self._given(value):.6g} {self.unit}".rstrip()

    def _given(self, value: float) -> float:
        # 1e-3 x 12 / 1e-3 is not 12, and nobody wrote the last digit
        return float(f"{value / self.size:.12g}")

    def _usual(self) -> str:
        return f"{self.usual[0]:g} to {self.usual[1]:g} {self.unit}".rstrip()

    def _slip(self, value: float) -> str:
        for question, factor, *more in self.slips:
            meant = self._given(value) * factor + sum(more)
            if self.usual[0] <= meant <= self.usual[1]:
                return ": " + question.format(f"{meant:.6g} {self.unit}".rstrip())
        return ""


def _in_words(field: str) -> str:
    """A key as people say it, its unit stands behind the value; one with a path names a place in a file and stays."""
    return field if "." in field else _UNIT.sub("", field).replace("_", " ")


def remarks_of(values: Iterable[tuple[str, Range, float]]) -> list[Remark]:
    """Return what is not usual among values, each a field, its range and the value [SI].

    Raises `InputError` if one of them is not possible.
    """
    found = [kind.remark(field, kind.checked(field, value)) for field, kind, value in values]
    return [remark for remark in found if remark is not None]


def proportion(
    field: str, value: float, usual: tuple[float, float], possible: tuple[float, float], found: str, wanted: str
) -> Remark | None:
    """Return a remark where the ratio of two values is not usual, else None.

    `value` [-]
    `usual`, `possible`: (float, float) [-]
    `found`, `wanted`: both values, and what is asked of them, in words
    Raises `InputError` if the ratio is not possible.
    """
    if not possible[0] - 1e-9 <= value <= possible[1] + 1e-9:
        raise InputError(field, found, wanted)
    if usual[0] - 1e-9 <= value <= usual[1] + 1e-9:
        return None
    return Remark(PlausibilityCode.PROPORTION, f"{field} is {found}, but usual is {wanted}")


def _length(usual: tuple[float, float], possible: tuple[float, float]) -> Range:
    slips = (("was it given in metres ({})?", 1e3), ("was it given in inches ({})?", 25.4), ("was it given in µm ({})?", 1e-3))
    return Range("mm", 1e-3, usual, possible, slips)


# -- tool and holder ---------------------------------------------------------------------------------------------------------------

TEETH = Range("", 1.0, (1.0, 30.0), (1.0, 100.0))
DIAMETER = _length((0.5, 250.0), (0.05, 1000.0))
HELIX = Range("deg", math.radians(1.0), (0.0, 65.0), (0.0, 81.0))
STICKOUT = _length((2.0, 500.0), (0.5, 5000.0))
SEGMENT_DIAMETER = _length((0.1, 400.0), (0.001, 1000.0))
#: What a library's rounded figures leave may be a micrometre.
SEGMENT_LENGTH = _length((1e-9, 1000.0), (1e-9, 5000.0))
RUNOUT = Range("µm", 1e-6, (-100.0, 100.0), (-1000.0, 1000.0), (("was it given in µm ({})?", 1e-6), ("was it given in mm ({})?", 1e-3)))
MODULUS = Range("GPa", 1e9, (40.0, 750.0), (0.5, 2000.0), (("was it given in MPa ({})?", 1e-3), ("was it given in TPa ({})?", 1e3)))
DENSITY = Range("kg/m^3", 1.0, (1200.0, 20_000.0), (100.0, 30_000.0), (("was it given in g/cm^3 ({})?", 1e3),))
LOSS_FACTOR = Range("", 1.0, (0.0, 0.1), (0.0, 1.0), (("was it given in percent ({})?", 1e-2),))
_SOFTER = (
    ("was it given in N/m per mm ({})?", 1e3),
    ("was it given in N/µm per m ({})?", 1e6),
    ("was it given in N/µm per mm ({})?", 1e9),
)
CONTACT = {
    "translational_stiffness": Range("N/m per m", 1.0, (2e8, 2e13), (1e6, 1e17), _SOFTER),
    # 0 leaves the moment to the springs along the insertion
    "rotational_stiffness": Range("N m/rad per m", 1.0, (0.0, 1e10), (0.0, 1e14)),
    "translational_damping": Range("N s/m per m", 1.0, (0.0, 1e8), (0.0, 1e12)),
    "rotational_damping": Range("N m s/rad per m", 1.0, (0.0, 1e5), (0.0, 1e9)),
}
#: Loss factor of a contact at `CONTACT_FREQUENCY` [rad/s], damping times frequency over stiffness, as (usual, possible), of translation and
#: rotation: joints of tools lose 0.01 to 0.1 of the energy, and none moves as in oil.
CONTACT_FREQUENCY = 2.0 * math.pi * 1000.0
CONTACT_LOSS = {"translational": ((0.0, 0.15), (0.0, 3.0)), "rotational": ((0.0, 2.0), (0.0, 30.0))}

# -- the cut -----------------------------------------------------------------------------------------------------------------------

TANGENTIAL = Range(
    "MPa",
    1e6,
    (50.0, 10_000.0),
    (30.0, 50_000.0),
    (
        ("was it given in GPa ({})?", 1e3),
        ("was it given in Pa ({})?", 1e-6),
        ("was it given in MPa where Pa is asked for ({})?", 1e6),
    ),
)
RADIAL_RATIO = Range("", 1.0, (-0.1, 1.5), (-1.0, 5.0), (("was it given in percent ({})?", 1e-2),))
AXIAL_RATIO = Range("", 1.0, (-1.0, 1.5), (-1.0, 5.0), (("was it given in percent ({})?", 1e-2),))
EDGE = Range("N/mm", 1e3, (0.0, 200.0), (0.0, 1000.0), (("was it given in N/m ({})?", 1e-3),))
FEED_PER_TOOTH = Range("mm", 1e-3, (0.001, 2.0), (1e-5, 10.0), (("was it given in metres ({})?", 1e3), ("was it given in µm ({})?", 1e-3)))
IMMERSION = Range("%", 1e-2, (1.5, 100.0), (0.0, 100.0), (("was {} meant?", 1e2),))
JOINT_STIFFNESS = Range(
    "N m/rad", 1.0, (1e4, 1e8), (1e2, 1e10), (("was it given in N m/° ({})?", 180.0 / math.pi), ("was it given in kN m/rad ({})?", 1e3))
)
#: Of the feed, from +X.
FEED_ANGLE = Range(
    "deg", math.radians(1.0), (-360.0, 360.0), (-720.0, 720.0), (("were degrees given as radians ({})?", math.radians(1.0)),)
)
#: Of the rows of a map of engagement.
HEIGHT = _length((0.0, 60.0), (0.0, 500.0))
#: Of a block's side beside the cutter's path, and of a stepover.
SIDE, STEPOVER = _length((-500.0, 500.0), (-2000.0, 2000.0)), _length((0.005, 500.0), (1e-9, 2000.0))
SPINDLE_SPEED = Range(
    "rev/min",
    from_rpm(1.0),
    (150.0, 80_000.0),
    (10.0, 500_000.0),
    (("were rev/min given as rad/s ({})?", from_rpm(1.0)), ("was rad/s given in rev/s ({})?", 2.0 * math.pi)),
)
#: Near a spindle's bearings.
TEMPERATURE = Range(
    "°C",
    1.0,
    (0.0, 100.0),
    (-40.0, 200.0),
    (("was it given in kelvin ({})?", 1.0, -273.15), ("was it given in degrees Fahrenheit ({})?", 5.0 / 9.0, -160.0 / 9.0)),
)
#: Of the widest point of an edge.
CUTTING_SPEED = Range("m/min", 1.0 / 60.0, (0.5, 2500.0), (0.0, 1e6), (("were rev/min given as rad/s ({})?", from_rpm(1.0)),))
WEAR_LAND = Range("µm", 1e-6, (1.0, 500.0), (0.01, 1000.0), (("was it given in µm ({})?", 1e-6), ("was it given in mm ({})?", 1e-3)))
INDENTATION = Range("N/m^3", 1.0, (1e12, 1e16), (1e9, 1e17), (("was it given in N/mm^3 ({})?", 1e9),))
POWER = Range("kW", 1e3, (0.05, 200.0), (0.001, 10_000.0), (("was it given in kW ({})?", 1e3), ("was it given in W ({})?", 1e-3)))
TORQUE = Range("N m", 1.0, (0.01, 3000.0), (0.001, 1e6), (("was it given in N mm ({})?", 1e-3),))
#: Least and largest change of the speed within a pass, as a share of its first.
LEAST_SWEEP, LARGEST_SWEEP = 0.005, 2.0
AXIAL_DEPTH = _length((0.01, 60.0), (1e-4, 500.0))
#: Up to which limits are looked for: proportions of drawn machines and the windows of a depth look further than the deepest cut.
SEARCHED_DEPTH = _length((0.01, 60.0), (1e-4, 5000.0))

# -- a tip's modes and recordings --------------------------------------------------------------------------------------------------

#: Of the tip's highest mode.
TIP_FREQUENCY = Range(
    "Hz",
    2.0 * math.pi,
    (100.0, 50_000.0),
    (0.5, 1e6),
    (("was it given in Hz where rad/s is asked for ({})?", 2.0 * math.pi), ("was it given in kHz ({})?", 1e3)),
)
#: Of the tip's softest mode: a micro-mill of 0.1 mm has about 1e4 N/m, a heavy tip 1e9.
TIP_STIFFNESS = Range(
    "N/m",
    1.0,
    (1e5, 2e9),
    (1e3, 1e15),
    (
        ("were natural frequencies given in Hz where rad/s is asked for ({})?", 4.0 * math.pi**2),
        ("was it given in N/µm ({})?", 1e6),
        ("was it given in N/mm ({})?", 1e3),
        ("were modal masses given in g ({})?", 1e-3),
    ),
)
#: Of any mode of a tip: one that seems stiffer hardly moves, and limits without it are too high; one that is rigid stands for no motion.
MODE_STIFFNESS = replace(TIP_STIFFNESS, usual=(1e5, 2e10), possible=(1e3, 1e18))
TIP_DAMPING = Range("", 1.0, (0.001, 0.5), (1e-6, 1.0), (("was it given in percent ({})?", 1e-2),))
RATE = Range("Hz", 1.0, (200.0, 5e6), (0.1, 1e8), (("was it given in kHz ({})?", 1e3),))
SENSOR_MASS = Range("g", 1e-3, (0.0, 100.0), (0.0, 1000.0), (("was it given in g ({})?", 1e-3),))
