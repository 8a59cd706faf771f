"""Corner radii that a drawing does not tell exactly: what they do to the force of shallow cuts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray
from rcsa_ident.base.errors import non_negative
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.shape import CutterShape


def has_corner(cutter: Cutter) -> bool:
    """Whether its corner radius is a number that may be another: of a flat end mill, and of a bull nose with its outline."""
    return (cutter.shape is CutterShape.FLAT and (cutter.profile is None or cutter.corner_radius > 0.0)) or (
        cutter.shape is CutterShape.BULL_NOSE and cutter.profile is not None
    )


def with_corner(cutter: Cutter, radius: float) -> Cutter:
    """Return the same cutter with another corner radius [m], 0 for a sharp one; its length of cut stays.

    `cutter`: one that has a corner
    `radius` [m]
    """
    if non_negative("corner radius", radius, "m") == 0.0:
        return replace(cutter, corner_radius=0.0, profile=None)
    length = None if cutter.profile is None else cutter.profile.height
    return replace(cutter, corner_radius=radius, profile=Profile.bull_nose(cutter.diameter, radius, length))


def corner_change(
    cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray, wider: float
) -> ComplexArray:
    """Return the logarithm of the force's ratio with a corner radius that is larger by `wider` [m], shape (m, 2); 0 where there is none.

    A secant: lines go straight with the radius as long as it is below the depth, and logarithms of weak ones do not.
    """
    told, other = (
        force_lines(each, conditions, coefficients, orders) for each in (cutter, with_corner(cutter, cutter.corner_radius + wider))
    )
    both = (told != 0.0) & (other != 0.0)
    found: ComplexArray = np.log(np.divide(other, told, out=np.ones_like(told), where=both))
    return found
