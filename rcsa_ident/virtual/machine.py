"""What a virtual machine is made of: shaft, bearings, housing, joint, and what its sensors add. Nouns only, no matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.errors import InputError, non_negative, positive
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.tool_holder.geometry import BeamSegment

#: A value for each of the machine's axes, X and Y.
PerAxis = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Bearing:
    """A radial spring and damper between shaft and housing.

    `position` [m]: distance from the spindle's flange face towards the rear
    `stiffness`: two floats [N/m], stiffness at standstill along the two principal directions, X and Y where these are not turned
    `damping`: two floats [N s/m], along the same
    `softening` [s/rad], default 0: share of the stiffness lost per spindle speed: k = k0 (1 - softening Omega)
    `angle` [rad], default 0: of the principal directions about the spindle's axis, from +X towards +Y
    """

    position: float
    stiffness: PerAxis
    damping: PerAxis
    softening: float = 0.0
    angle: float = 0.0

    def __post_init__(self) -> None:
        non_negative("bearings.position", self.position, "m")
        _pair("bearings.stiffness", self.stiffness, positive, "N/m")
        _pair("bearings.damping", self.damping, non_negative, "N s/m")
        if not np.isfinite(self.softening):
            raise InputError("bearings.softening", self.softening, "a finite number")
        _angle("bearings.angle", self.angle)


@dataclass(frozen=True, slots=True)
class Housing:
    """A rigid body, on springs and dampers to the ground.

    `position` [m]: of its centre of mass and of its support, from the flange face towards the rear
    `mass` [kg]; `inertia` [kg m^2]
    `stiffness`, `damping`: two floats [N/m], [N s/m]; along the two principal directions, X and Y where these are not turned
    `tilting_stiffness`, `tilting_damping`: two floats [N m/rad], [N m s/rad]; in the planes of the same
    `angle` [rad], default 0: of the principal directions about the spindle's axis, from +X towards +Y
    """

    position: float
    mass: float
    inertia: float
    stiffness: PerAxis
    damping: PerAxis
    tilting_stiffness: PerAxis
    tilting_damping: PerAxis
    angle: float = 0.0

    def __post_init__(self) -> None:
        positive("housing.mass", self.mass, "kg")
        positive("housing.inertia", self.inertia, "kg m^2")
        for name in ("stiffness", "tilting_stiffness"):
            _pair(f"housing.{name}", getattr(self, name), positive)
        for name in ("damping", "tilting_damping"):
            _pair(f"housing.{name}", getattr(self, name), non_negative)
        _angle("housing.angle", self.angle)


@dataclass(frozen=True, slots=True)
class FlangeJoint:
    """The clamped face between spindle and holder, lumped.

    `translational_stiffness` [N/m]; `translational_damping` [N s/m]; `rotational_stiffness` [N m/rad]; `rotational_damping` [N m s/rad]
    """

    translational_stiffness: float
    translational_damping: float
    rotational_stiffness: float
    rotational_damping: float

    def __post_init__(self) -> None:
        for name in ("translational_stiffness", "rotational_stiffness"):
            positive(f"joint.{name}", getattr(self, name))
        for name in ("translational_damping", "rotational_damping"):
            non_negative(f"joint.{name}", getattr(self, name))


@dataclass(frozen=True, slots=True)
class VirtualSpindle:
    """A spindle in its housing, as far as the flange face.

    `shaft`: segments from the flange face to the rear end
    `gyroscopic`: bool, default True; whether the moments of the spinning parts couple the two bending planes, as those of every real
        spindle do
    `fixture_position` [m]: where on the housing the flange sensor is held, from the flange face towards the rear
    `housing_positions`: tuple of float [m], where on it further accelerometers stand, a pair for X and Y at each
    `seen_at` [m]: where the flange sensors look, from the flange face towards the rear; negative: on the holder
    """

    shaft: tuple[BeamSegment, ...]
    bearings: tuple[Bearing, ...]
    housing: Housing
    joint: FlangeJoint
    gyroscopic: bool = True
    fixture_position: float = 0.0
    housing_positions: tuple[float, ...] = ()
    seen_at: float = 0.0

    def __post_init__(self) -> None:
        if not self.shaft:
            raise InputError("shaft.segments", "none", "at least one segment")
        if not self.bearings:
            raise InputError("bearings", "none", "at least one bearing")
        length = self.shaft_length
        for bearing in self.bearings:
            if bearing.position > length + 1e-9:
                raise InputError("bearings.position_mm", bearing.position * 1e3, f"0 to the shaft's length, {length * 1e3:g} mm")
        if not self.seen_at <= length:
            raise InputError("sensors.flange_position_mm", self.seen_at * 1e3, f"at most the shaft's length, {length * 1e3:g} mm")

    @property
    def shaft_length(self) -> float:
        """Length from the flange face to the rear end [m]."""
        return sum(s.length for s in self.shaft)

    @property
    def speed_dependent(self) -> bool:
        """True where the dynamics change with the spindle's speed."""
        return self.gyroscopic or any(b.softening != 0.0 for b in self.bearings)

    @property
    def coupled(self) -> bool:
        """True where a force in X also moves the tool in Y."""
        return self.gyroscopic or any(angle != 0.0 for angle in (self.housing.angle, *(b.angle for b in self.bearings)))


def _pair(field: str, values: PerAxis, check: Callable[[str, float, str], float], unit: str = "") -> None:
    if len(values) != 2:
        raise InputError(field, list(values), "two numbers, X and Y")
    for value in values:
        check(field, value, unit)


def _angle(field: str, value: float) -> None:
    if not -np.pi <= value <= np.pi:
        raise InputError(field, value, "-pi to pi [rad]")


@dataclass(frozen=True, slots=True, eq=False)
class CutPlan:
    """The cuts of a simulated campaign: every tooling at every speed, and in every pass.

    `spindle_speeds`: tuple of float [rad/s], programmed speeds of the cuts at one speed; none where there are passes
    `axial_depth`, `feed_per_tooth` [m]
    `feed_angle` [rad]: direction of the feed in the machine's X-Y plane, from +X towards +Y
    `duration` [s]: length of each record
    `settling` [s]: time that is simulated before it and dropped
    `entry`, `leave` [s]: of the record, in the air and while the depth rises and falls again, half each; 0 where all of it is in the
        material
    `passes`: tuple of (float, float) [rad/s]; programmed first and last speed of passes whose speed changes evenly in time
    `pass_duration` [s]: length of the record of each
    """

    spindle_speeds: tuple[float, ...]
    axial_depth: float
    feed_per_tooth: float
    engagement: Engagement
    feed_angle: float = 0.0
    duration: float = 0.3
    settling: float = 0.15
    entry: float = 0.0
    leave: float = 0.0
    passes: tuple[tuple[float, float], ...] = ()
    pass_duration: float = 4.0

    def __post_init__(self) -> None:
        if not self.spindle_speeds and not self.passes:
            raise InputError("cuts.spindle_speeds_rpm", "none", "at least one speed, or passes_rpm")
        positive("cuts.duration_s", self.duration, "s")
        positive("cuts.pass_duration_s", self.pass_duration, "s")
        non_negative("cuts.settling_s", self.settling, "s")
        non_negative("cuts.entry_s", self.entry, "s")
        non_negative("cuts.exit_s", self.leave, "s")
        if self.entry + self.leave >= self.duration:
            raise InputError("cuts.duration_s", self.duration, f"above entry_s and exit_s together, {self.entry + self.leave:g} s")
        for speed in self.programmed:
            self.conditions(speed)

    @property
    def programmed(self) -> tuple[float, ...]:
        """All speeds that are programmed, those at which passes begin and end among them [rad/s]."""
        return (*self.spindle_speeds, *(speed for both in self.passes for speed in both))

    @property
    def cuts(self) -> tuple[tuple[str, float, float | None, float], ...]:
        """What tells the cuts of a tooling apart: end of their names, first and last speed [rad/s] (None: as the first), length [s]."""
        constant = [(f"{i:02d}", speed, None, self.duration) for i, speed in enumerate(self.spindle_speeds)]
        return (*constant, *((f"p{i:02d}", first, last, self.pass_duration) for i, (first, last) in enumerate(self.passes)))

    def conditions(self, spindle_speed: float) -> CuttingConditions:
        """Return the conditions of one cut at this speed."""
        return CuttingConditions(spindle_speed, self.axial_depth, self.feed_per_tooth, self.engagement, self.feed_angle)
