"""The cutter: teeth, pitch, helix, run-out, and the name of its shape."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rcsa_ident.arrays import FloatArray, frozen
from rcsa_ident.cutting.shape import IGNORED_CORNER, CutterShape, cylinder_remark
from rcsa_ident.errors import InputError, non_negative, positive
from rcsa_ident.remarks import Remark
from rcsa_ident.shown import Shown


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cutter(Shown):
    """A milling cutter, computed as the cylinder of its diameter.

    Parameters
    ----------
    teeth : int
    diameter : float [m]
    helix : float [rad], default 0
        A point of an edge at height z above the tip lags the tip by 2 z tan(helix) / diameter.
    pitch : array, shape (teeth,) [rad], default equal
        `pitch[j]` is the angle from tooth j to tooth j + 1, which runs ahead of it and has cut there before.
    runout : array, shape (teeth,) [m], default none
        Radial offset of each edge.
    shape : CutterShape or its name, default flat
        What is computed is a cylinder whatever it is; `cylinder_remarks` say so.
    corner_radius : float [m], default 0
        Of the edge's corner, or of its arc where the shape is one; 0 where it is sharp or not known.

    Examples
    --------
    Three teeth, unequally spaced:

    >>> cutter = Cutter(3, diameter=0.012, helix=np.radians(30.0), pitch=np.radians([110.0, 120.0, 130.0]))
    >>> np.degrees(cutter.tooth_angle).round(6).tolist(), cutter.equally_spaced
    ([0.0, 110.0, 230.0], False)
    """

    teeth: int
    diameter: float
    helix: float = 0.0
    pitch: FloatArray = field(default=None)  # type: ignore[arg-type]
    runout: FloatArray = field(default=None)  # type: ignore[arg-type]
    shape: CutterShape = CutterShape.FLAT
    corner_radius: float = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.teeth, bool) or int(self.teeth) != self.teeth or not 1 <= self.teeth <= 100:
            raise InputError("teeth", self.teeth, "a whole number from 1 to 100")
        positive("diameter", self.diameter, "m")
        if not 0.0 <= non_negative("helix", self.helix, "rad") < 0.45 * np.pi:
            raise InputError("helix", self.helix, "0 to 81 degrees")
        equal = np.full(self.teeth, 2.0 * np.pi / self.teeth)
        pitch = frozen(equal if self.pitch is None else self.pitch)
        runout = frozen(np.zeros(self.teeth) if self.runout is None else self.runout)
        if pitch.shape != (self.teeth,) or not np.all(pitch > 0.0) or not abs(pitch.sum() - 2.0 * np.pi) <= 1e-6:
            raise InputError("pitch", pitch.tolist(), f"{self.teeth} positive angles that add up to a full turn")
        if runout.shape != (self.teeth,) or not np.all(np.isfinite(runout)):
            raise InputError("runout", runout.tolist(), f"{self.teeth} finite radial offsets [m]")
        if self.shape not in tuple(CutterShape):
            raise InputError("shape", self.shape, f"one of {', '.join(CutterShape)}")
        shape = CutterShape(self.shape)
        corner = non_negative("corner_radius", self.corner_radius, "m")
        if not shape.has_room(corner, self.diameter):
            raise InputError("corner_radius", corner, f"at most half of the diameter, {0.5 * self.diameter:g} m")
        object.__setattr__(self, "shape", shape)
        object.__setattr__(self, "pitch", pitch)
        object.__setattr__(self, "runout", runout)

    @property
    def tooth_angle(self) -> FloatArray:
        """Angle of each tooth ahead of tooth 1, shape (teeth,) [rad]."""
        return np.concatenate([[0.0], np.cumsum(self.pitch)[:-1]])

    @property
    def equally_spaced(self) -> bool:
        """True where all teeth are alike, so that only multiples of the tooth-passing frequency are excited."""
        return bool(np.ptp(self.pitch) < 1e-9 and np.ptp(self.runout) == 0.0)

    def cylinder_remarks(self, depth: float | None = None, forces: bool = False) -> tuple[Remark, ...]:
        """Return what to make of an answer that took the cutter for a cylinder; nothing where it is one.

        Parameters
        ----------
        depth : float or None [m]
            The smallest that counts, which a corner radius is seen beside; None leaves corner radii aside.
        forces : bool
            Whether the answer was found from cutting forces.
        """
        sharp = depth is None or self.corner_radius <= IGNORED_CORNER * depth
        return () if self.shape is CutterShape.FLAT and sharp else (cylinder_remark(self.shape, forces),)

    def __str__(self) -> str:
        parts = [f"{self.teeth} {'tooth' if self.teeth == 1 else 'teeth'}", f"Ø{1e3 * self.diameter:.4g} mm"]
        parts += [f"helix {np.degrees(self.helix):.3g}°"] if self.helix else []
        parts += [] if np.ptp(self.pitch) < 1e-9 else ["pitch " + "/".join(f"{angle:.4g}" for angle in np.degrees(self.pitch)) + "°"]
        parts += [f"run-out {1e6 * np.ptp(self.runout):.2g} µm"] if np.any(self.runout) else []
        parts += [] if self.shape is CutterShape.FLAT else [f"shape {self.shape}"]
        parts += [f"corner radius {1e3 * self.corner_radius:.4g} mm"] if self.corner_radius else []
        return ", ".join(parts)
