"""Lines and arcs in the plane of a cutter's axis and radius: what its outline is made of.

The angle kappa of a point is that of its outward normal (sin kappa, -cos kappa) in (r, z), from the axis pointing down: 0 is a floor,
90 degrees a wall, more an undercut. Along the outline dr = cos kappa db, dz = sin kappa db.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.shown import Shown

#: What rounding leaves of a length, as a share of the outline's size.
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, repr=False)
class Line(Shown):
    """A straight piece of the outline. `r0`, `z0`, `r1`, `z1` [m]: where it begins and ends; z1 is not below z0."""

    r0: float
    z0: float
    r1: float
    z1: float

    @property
    def kappa(self) -> float:
        """Angle of the outward normal [rad]."""
        return float(np.arctan2(self.z1 - self.z0, self.r1 - self.r0))

    @property
    def ends(self) -> tuple[float, float, float, float]:
        """Radius and height where it begins, and where it ends [m]."""
        return self.r0, self.z0, self.r1, self.z1

    @property
    def length(self) -> float:
        """Along the outline [m]."""
        return float(np.hypot(self.r1 - self.r0, self.z1 - self.z0))

    @property
    def widest(self) -> float:
        """The largest radius that it has [m]."""
        return max(self.r0, self.r1)

    def at(self, share: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return radius [m], height [m] and kappa [rad] at shares of the way, 0 to 1."""
        r, z = self.r0 + (self.r1 - self.r0) * share, self.z0 + (self.z1 - self.z0) * share
        return r, z, np.full(share.shape, self.kappa)

    def share_at_height(self, z: float) -> float:
        """Return the share of the way at a height between its ends."""
        return (z - self.z0) / (self.z1 - self.z0)

    def shares_at_radius(self, r: float) -> tuple[float, ...]:
        """Return the shares of the way, inside it, at which it has a radius."""
        width = self.r1 - self.r0
        found = () if abs(width) < ROUNDING * abs(self.r1) else ((r - self.r0) / width,)
        return tuple(share for share in found if 0.0 < share < 1.0)

    def __str__(self) -> str:
        r0, z0, r1, z1 = (1e3 * value for value in self.ends)
        return f"line from r {r0:.4g}, z {z0:.4g} to r {r1:.4g}, z {z1:.4g} mm"


@dataclass(frozen=True, slots=True, repr=False)
class Arc(Shown):
    """A piece of a circle: r = r_c + radius sin kappa, z = z_c - radius cos kappa.

    `r_c`, `z_c` [m]: its centre
    `radius` [m]: below zero where the outline is hollow there
    `kappa0`, `kappa1` [rad]: where it begins and ends, 0 to pi; ascending, or descending where it is hollow
    """

    r_c: float
    z_c: float
    radius: float
    kappa0: float
    kappa1: float

    @property
    def ends(self) -> tuple[float, float, float, float]:
        """Radius and height where it begins, and where it ends [m]."""
        r, z, _ = self.at(np.array([0.0, 1.0]))
        return float(r[0]), float(z[0]), float(r[1]), float(z[1])

    @property
    def length(self) -> float:
        """Along the outline [m]."""
        return abs(self.radius * (self.kappa1 - self.kappa0))

    @property
    def widest(self) -> float:
        """The largest radius that it has [m]."""
        low, high = sorted((self.kappa0, self.kappa1))
        return self.r_c + self.radius if self.radius > 0.0 and low <= 0.5 * np.pi <= high else max(self.ends[0], self.ends[2])

    def at(self, share: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return radius [m], height [m] and kappa [rad] at shares of the way, 0 to 1."""
        kappa = self.kappa0 + (self.kappa1 - self.kappa0) * share
        return self.r_c + self.radius * np.sin(kappa), self.z_c - self.radius * np.cos(kappa), kappa

    def share_at_height(self, z: float) -> float:
        """Return the share of the way at a height between its ends."""
        kappa = float(np.arccos(np.clip((self.z_c - z) / self.radius, -1.0, 1.0)))
        return (kappa - self.kappa0) / (self.kappa1 - self.kappa0)

    def shares_at_radius(self, r: float) -> tuple[float, ...]:
        """Return the shares of the way, inside it, at which it has a radius."""
        sine = (r - self.r_c) / self.radius
        if not -1.0 <= sine <= 1.0:
            return ()
        angle = float(np.arcsin(sine))
        shares = ((kappa - self.kappa0) / (self.kappa1 - self.kappa0) for kappa in (angle, np.pi - angle))
        return tuple(share for share in shares if 0.0 < share < 1.0)

    def __str__(self) -> str:
        angles = f"{np.degrees(self.kappa0):.4g}° to {np.degrees(self.kappa1):.4g}°"
        return f"arc of {1e3 * self.radius:.4g} mm about r {1e3 * self.r_c:.4g}, z {1e3 * self.z_c:.4g} mm, {angles}"


Segment = Line | Arc
