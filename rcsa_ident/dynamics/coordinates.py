"""Coordinates: where and in which direction something moves."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from rcsa_ident.base.errors import InputError


class Dof(StrEnum):
    """A direction of motion.

    `SLOPE_X` is the rotation of the cross-section in the X bending plane, positive as dx/dz with z from the tip
    towards the spindle; a moment in its direction is its work conjugate. `SLOPE_Y` likewise. Of a right-handed turn
    (theta_x, theta_y, theta_z) they are theta_y and -theta_x; `TORSION` is theta_z.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> ri.Dof("x'")
    <Dof.SLOPE_X: "x'">
    >>> ri.Dof.SLOPE_X.plane
    <Dof.X: 'x'>
    """

    X = "x"
    Y = "y"
    Z = "z"
    SLOPE_X = "x'"
    SLOPE_Y = "y'"
    TORSION = "z'"

    @property
    def is_slope(self) -> bool:
        """True for a rotation."""
        return self in (Dof.SLOPE_X, Dof.SLOPE_Y, Dof.TORSION)

    @property
    def plane(self) -> Dof:
        """The translation of the bending plane that it belongs to; a direction without one stands for itself."""
        return {Dof.SLOPE_X: Dof.X, Dof.SLOPE_Y: Dof.Y}.get(self, self)


@dataclass(frozen=True, slots=True)
class Coordinate:
    """A named point and a direction, written as engineers do: ``tip.x``.

    Parameters
    ----------
    point : str
    dof : Dof

    Examples
    --------
    >>> str(Coordinate.parse("flange.x'"))
    "flange.x'"
    """

    point: str
    dof: Dof

    @classmethod
    def parse(cls, text: str) -> Coordinate:
        """Read ``point.dof``.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> ri.Coordinate.parse("tip.x")
        Coordinate(point='tip', dof=<Dof.X: 'x'>)
        """
        point, _, dof = text.rpartition(".")
        try:
            return cls(point, Dof(dof))
        except ValueError:
            raise InputError("coordinate", text, "point.dof with dof one of " + ", ".join(Dof)) from None

    def __str__(self) -> str:
        return f"{self.point}.{self.dof}"


def plane(point: str, axis: Dof = Dof.X) -> tuple[Coordinate, Coordinate]:
    """Return translation and slope of `point` in the bending plane of `axis` (X or Y)."""
    slopes = {Dof.X: Dof.SLOPE_X, Dof.Y: Dof.SLOPE_Y}
    if axis not in slopes:
        raise InputError("axis", axis, "x or y: a bending plane")
    return Coordinate(point, axis), Coordinate(point, slopes[axis])
