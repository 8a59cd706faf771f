"""The cutter: teeth, pitch, helix, run-out, and its shape."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import lru_cache

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, non_negative
from rcsa_ident.base.plausibility import DIAMETER, HELIX, RUNOUT, TEETH, Range
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.outlines import Dimensions, key_of, missing
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.serration import Serration
from rcsa_ident.cutting.shape import IGNORED_CORNER, CutterShape, cylinder_remark


class HelixKind(StrEnum):
    """What is constant along an edge: the lead, or the angle between the edge and the axis."""

    LEAD = "lead"
    ANGLE = "angle"


#: Steepest helix [rad].
_STEEPEST = 0.45 * np.pi


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cutter(Shown):
    """A milling cutter.

    Parameters
    ----------
    teeth : int
    diameter : float [m]
        DC; of a face mill that where the edge meets the floor.
    helix : float [rad], or array, shape (teeth,), default 0
        A point of an edge at height z above the tip lags the tip by 2 z tan(helix) / diameter, see `helix_kind`.
    pitch : array, shape (teeth,) [rad], default equal
        `pitch[j]` is the angle from tooth j to tooth j + 1, which runs ahead of it and has cut there before.
    runout : array, shape (teeth,) [m], default none
        Radial offset of each edge.
    shape : CutterShape or its name, default flat
        Without a `profile` what is computed is a cylinder whatever it is; `cylinder_remarks` say so.
    corner_radius : float [m], default 0
        Of the edge's corner, or of its arc where the shape is one; 0 where it is sharp or not known.
    profile : Profile or None
        What the edges sweep over; None is the cylinder of the diameter.
    helix_kind : HelixKind or its name, default lead
    serration : Serration or None
    axial_runout : array, shape (teeth,) [m], default none
        By which each edge stands nearer to the spindle.
    tilt : float [rad], default 0
        Of the cutter's axis in the spindle, away from tooth 1: the teeth run out in proportion to the height above the tip.
    dimensions : Dimensions
        What the profile was drawn from, or what is told of one that could not be drawn.

    Examples
    --------
    Three teeth, unequally spaced:

    >>> cutter = Cutter(3, diameter=0.012, helix=np.radians(30.0), pitch=np.radians([110.0, 120.0, 130.0]))
    >>> np.degrees(cutter.tooth_angle).round(6).tolist(), cutter.equally_spaced
    ([0.0, 110.0, 230.0], False)
    """

    teeth: int
    diameter: float
    helix: float | FloatArray = 0.0
    pitch: FloatArray = field(default=None)  # type: ignore[arg-type]
    runout: FloatArray = field(default=None)  # type: ignore[arg-type]
    shape: CutterShape = CutterShape.FLAT
    corner_radius: float = 0.0
    profile: Profile | None = None
    helix_kind: HelixKind = HelixKind.LEAD
    serration: Serration | None = None
    axial_runout: FloatArray = field(default=None)  # type: ignore[arg-type]
    tilt: float = 0.0
    dimensions: Dimensions = field(default_factory=Dimensions)

    def __post_init__(self) -> None:
        if isinstance(self.teeth, bool) or int(self.teeth) != self.teeth or not 1 <= self.teeth <= 100:
            raise InputError("teeth", self.teeth, "a whole number from 1 to 100")
        DIAMETER.checked("diameter", self.diameter)
        object.__setattr__(self, "helix", self._checked_helix())
        equal = np.full(self.teeth, 2.0 * np.pi / self.teeth)
        pitch = frozen(equal if self.pitch is None else self.pitch)
        runout = frozen(np.zeros(self.teeth) if self.runout is None else self.runout)
        if pitch.shape != (self.teeth,) or not np.all(pitch > 0.0) or not abs(pitch.sum() - 2.0 * np.pi) <= 1e-6:
            raise InputError("pitch", pitch.tolist(), f"{self.teeth} positive angles that add up to a full turn")
        if runout.shape != (self.teeth,) or not np.all(np.isfinite(runout)):
            raise InputError("runout", runout.tolist(), f"{self.teeth} finite radial offsets [m]")
        for offset in runout.tolist():
            RUNOUT.checked("runout", offset)
        if self.shape not in tuple(CutterShape):
            raise InputError("shape", self.shape, f"one of {', '.join(CutterShape)}")
        shape = CutterShape(self.shape)
        corner = non_negative("corner_radius", self.corner_radius, "m")
        if not shape.has_room(corner, self.diameter):
            raise InputError("corner_radius", corner, f"at most half of the diameter, {0.5 * self.diameter:g} m")
        axial = frozen(np.zeros(self.teeth) if self.axial_runout is None else self.axial_runout)
        if axial.shape != (self.teeth,) or not np.all(np.isfinite(axial)):
            raise InputError("axial_runout", axial.tolist(), f"{self.teeth} finite axial offsets [m]")
        for offset in axial.tolist():
            RUNOUT.checked("axial_runout", offset)
        if not abs(self.tilt) <= 0.02:
            raise InputError("tilt", self.tilt, "an angle from -0.02 to 0.02 [rad]")
        if self.helix_kind not in tuple(HelixKind):
            raise InputError("helix_kind", self.helix_kind, f"one of {', '.join(HelixKind)}")
        if self.serration is not None and self.serration.shifts(self.teeth).shape != (self.teeth,):
            raise InputError("serration shift", self.serration.shifts(self.teeth).tolist(), f"{self.teeth} shares of the wavelength")
        object.__setattr__(self, "helix_kind", HelixKind(self.helix_kind))
        object.__setattr__(self, "axial_runout", axial)
        object.__setattr__(self, "shape", shape)
        object.__setattr__(self, "pitch", pitch)
        object.__setattr__(self, "runout", runout)

    def _checked_helix(self) -> float | FloatArray:
        """A number where all teeth have the same helix."""
        if np.ndim(self.helix) == 0:
            if not 0.0 <= non_negative("helix", float(self.helix), "rad") < _STEEPEST:
                raise InputError("helix", self.helix, "0 to 81 degrees")
            return float(self.helix)
        each = frozen(self.helix)
        if each.shape != (self.teeth,) or not np.all((each >= 0.0) & (each < _STEEPEST)):
            raise InputError("helix", np.degrees(each).tolist(), f"one angle, or {self.teeth} of them, 0 to 81 degrees")
        return each if np.ptp(each) > 0.0 else float(each[0])

    @property
    def values(self) -> tuple[tuple[str, Range, float], ...]:
        """What may be unusual about it: field, range and value, named as in a tooling's file."""
        ends = {float(end) for offsets in (self.runout, self.axial_runout) for end in (offsets.min(), offsets.max())}
        return (
            ("cutter.teeth", TEETH, self.teeth),
            ("cutter.diameter_mm", DIAMETER, self.diameter),
            ("cutter.helix_deg", HELIX, float(self.helices.max())),
            *(("cutter run-out", RUNOUT, end) for end in sorted(ends)),
        )

    @property
    def helices(self) -> FloatArray:
        """Helix of each tooth, shape (teeth,) [rad]."""
        return np.full(self.teeth, self.helix)

    @property
    def is_cylinder(self) -> bool:
        """True where everything along the edges is constant but their lag, which all teeth have in common: closed forms are for it."""
        return self.profile is None and self.serration is None and self.tilt == 0.0 and not isinstance(self.helix, np.ndarray)

    def running_true(self) -> Cutter:
        """Return the same without any run-out or tilt; waves stay.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> cutter = ri.Cutter(2, 0.012, runout=[5e-6, -5e-6])
        >>> cutter.running_true().runout.tolist()
        [0.0, 0.0]
        """
        if self.tilt == 0.0 and not self.runout.any() and not self.axial_runout.any():
            return self
        none = np.zeros(self.teeth)
        return replace(self, runout=none, axial_runout=none, tilt=0.0)

    @property
    def repeats(self) -> int:
        """How often a turn its force repeats itself where it runs true: once a tooth where teeth are alike, else once."""
        return self.teeth if self.running_true().equally_spaced else 1

    @property
    def symmetry(self) -> int:
        """How often its teeth come round alike in a turn, with all that makes them unlike: 2 of teeth whose pitch alternates."""
        if self.equally_spaced:
            return self.teeth
        if self.tilt != 0.0:
            return 1
        shifts = np.zeros(self.teeth) if self.serration is None else np.mod(self.serration.shifts(self.teeth), 1.0)
        teeth = np.stack(
            [self.pitch, self.helices, self.runout, self.axial_runout, np.cos(2.0 * np.pi * shifts), np.sin(2.0 * np.pi * shifts)]
        )
        scale = np.array([1.0, 1.0, self.diameter, self.diameter, 1.0, 1.0])[:, None]
        for count in range(self.teeth, 1, -1):
            if self.teeth % count == 0 and np.all(np.abs(np.roll(teeth, self.teeth // count, axis=1) - teeth) < 1e-9 * scale):
                return count
        return 1

    @property
    def offset(self) -> bool:
        """Whether teeth are offset from each other, so that one may cut what the one ahead of it left standing."""
        plain = self.tilt == 0.0 and not _differ(self.runout) and not _differ(self.axial_runout)
        return (self.serration is not None or not plain) and not self.equally_spaced

    @property
    def outline(self) -> Profile:
        """What the edges sweep over."""
        return _wall(self.diameter) if self.profile is None else self.profile

    @property
    def largest_lag(self) -> float:
        """By which the edge lags the tip per height, of the steepest tooth [rad/m]."""
        return 2.0 * float(np.max(np.tan(self.helices))) / self.diameter

    @property
    def tooth_angle(self) -> FloatArray:
        """Angle of each tooth ahead of tooth 1, shape (teeth,) [rad]."""
        return np.concatenate([[0.0], np.cumsum(self.pitch)[:-1]])

    @property
    def equally_spaced(self) -> bool:
        """True where all teeth are alike, so that only multiples of the tooth-passing frequency are excited."""
        if self.tilt != 0.0 or isinstance(self.helix, np.ndarray) or self.pitch.max() - self.pitch.min() >= 1e-9:
            return False
        if _differ(self.runout) or _differ(self.axial_runout):
            return False
        return self.serration is None or bool(np.ptp(np.mod(self.serration.shifts(self.teeth), 1.0)) == 0.0)

    def cylinder_remarks(self, depth: float | None = None, forces: bool = False) -> tuple[Remark, ...]:
        """Return what to make of an answer that took the cutter for a cylinder; nothing where it is one.

        Parameters
        ----------
        depth : float or None [m]
            The smallest that counts, which a corner radius is seen beside; None leaves corner radii aside.
        forces : bool
            Whether the answer was found from cutting forces.
        """
        if self.profile is not None:
            return ()
        sharp = depth is None or self.corner_radius <= IGNORED_CORNER * depth
        if self.shape is CutterShape.FLAT and sharp:
            return ()
        lacking = tuple(key_of(name) if name != "profile" else name for name in missing(self.shape, self.corner_radius, self.dimensions))
        return (cylinder_remark(self.shape, forces, lacking),)

    def __str__(self) -> str:
        parts = [f"{self.teeth} {'tooth' if self.teeth == 1 else 'teeth'}", f"Ø{1e3 * self.diameter:.4g} mm"]
        parts += (
            ["helix " + "/".join(f"{angle:.3g}" for angle in np.degrees(np.atleast_1d(self.helix))) + "°"] if np.any(self.helix) else []
        )
        parts += [] if np.ptp(self.pitch) < 1e-9 else ["pitch " + "/".join(f"{angle:.4g}" for angle in np.degrees(self.pitch)) + "°"]
        parts += [f"run-out {1e6 * np.ptp(self.runout):.2g} µm"] if np.any(self.runout) else []
        parts += [] if self.shape is CutterShape.FLAT else [f"shape {self.shape}"]
        parts += [f"corner radius {1e3 * self.corner_radius:.4g} mm"] if self.corner_radius else []
        parts += [] if self.serration is None else [str(self.serration)]
        parts += [f"axial run-out {1e6 * np.ptp(self.axial_runout):.2g} µm"] if np.any(self.axial_runout) else []
        return ", ".join(parts)


def _differ(offsets: FloatArray) -> bool:
    """Whether teeth are offset from each other."""
    return bool(offsets.any() and offsets.max() > offsets.min())


@lru_cache(maxsize=64)
def _wall(diameter: float) -> Profile:
    """The outline of a plain cylinder: asked for at every limit, and checked once."""
    return Profile.flat(diameter)
