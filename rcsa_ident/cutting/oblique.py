"""Cutting coefficients of any edge from orthogonal cutting tests: shear stress, friction, chip ratio, turned to the edge [altintas2012].

An edge that is inclined to the cutting speed and raked otherwise than another has other coefficients of the same material: of a ball the
axial one falls to nothing at the tip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter, HelixKind
from rcsa_ident.cutting.rows import Rows, rows_of

#: Range of rake angles for which orthogonal tests are asked at all [rad].
_RAKE = np.radians(60.0)


@dataclass(frozen=True, slots=True, repr=False)
class OrthogonalData(Shown):
    """What orthogonal cutting of a material has told, over rake angle alpha and chip thickness h.

    `shear_stress` [N/m^2]: in the shear plane
    `friction`, `friction_rake`: float [rad], [-]; friction angle beta = friction + friction_rake alpha
    `ratio`, `ratio_rake`: float [-], [1/rad]; chip ratio r = (ratio + ratio_rake alpha) (h / 1 mm)^(power + power_rake alpha)
    `power`, `power_rake`: float [-], [1/rad]
    `source`: who has measured it

    Examples
    --------
    An edge that stands square to the cutting speed pushes nothing along itself:

    >>> data = OrthogonalData(600e6, friction=0.35, friction_rake=0.0, ratio=0.8, ratio_rake=0.0, power=0.0, power_rake=0.0)
    >>> t, r, a = data.coefficients(rake=0.0, inclination=0.0, chip=0.1e-3)
    >>> round(float(r / t), 6) == round(float(np.tan(0.35)), 6), float(a)
    (True, 0.0)
    """

    shear_stress: float
    friction: float
    friction_rake: float
    ratio: float
    ratio_rake: float
    power: float
    power_rake: float
    source: str = ""

    def __post_init__(self) -> None:
        positive("shear_stress", self.shear_stress, "N/m^2")

    def coefficients(self, rake: FloatArray | float, inclination: FloatArray | float, chip: FloatArray | float) -> FloatArray:
        """Return K_tc, K_rc and K_ac of edges, shape (3, ...) [N/m^2].

        `rake` [rad]: normal to the edge
        `inclination` [rad]: of the edge out of what stands square to the cutting speed; the chip flows off at the same angle (Stabler)
        `chip` [m]
        Raises `InputError` if the chip is not above zero, an angle is out of range, or no shear angle belongs to them.
        """
        alpha, i, h = (np.asarray(values, dtype=float) for values in (rake, inclination, chip))
        if not np.all(h > 0.0):
            raise InputError("chip", float(np.min(h)), "chip thicknesses above 0 [m]")
        if not np.all(np.abs(alpha) <= _RAKE) or not np.all(np.abs(i) < 0.5 * np.pi):
            raise InputError(
                "rake and inclination", np.degrees([np.max(np.abs(alpha)), np.max(np.abs(i))]).tolist(), "angles below 60 and 90°"
            )
        ratio = (self.ratio + self.ratio_rake * alpha) * (1e3 * h) ** (self.power + self.power_rake * alpha)
        shear = np.arctan2(ratio * np.cos(alpha), 1.0 - ratio * np.sin(alpha))
        if not np.all((ratio > 0.0) & (shear < 0.5 * np.pi)):
            raise InputError("rake and chip", np.degrees(float(np.max(alpha))), "a rake at which chips get thicker than they were")
        friction = np.arctan(np.tan(self.friction + self.friction_rake * alpha) * np.cos(i))
        lean = friction - alpha
        # the chip flows at the edge's own angle
        along = np.tan(i)
        plane = np.sqrt(np.cos(shear + lean) ** 2 + (along * np.sin(friction)) ** 2)
        stress = self.shear_stress / (plane * np.sin(shear))
        tangential = np.cos(lean) + along**2 * np.sin(friction)
        axial = along * (np.cos(lean) - np.sin(friction))
        return stress * np.stack(np.broadcast_arrays(tangential, np.sin(lean) / np.cos(i), axial))

    def __str__(self) -> str:
        return f"shear stress {1e-6 * self.shear_stress:.4g} MPa, friction angle {np.degrees(self.friction):.3g}°"


def inclinations(cutter: Cutter, rows: Rows) -> FloatArray:
    """Return by which angle the edge is inclined at rows, shape (rows,) [rad]: tan i = r (d lag / dz) sin kappa.

    Of teeth with helices of their own the mean.
    """
    lead = float(np.mean(np.tan(cutter.helices)))
    if cutter.helix_kind is HelixKind.ANGLE:
        return np.full(rows.count, np.arctan(lead))
    return np.asarray(np.arctan(2.0 * rows.r / cutter.diameter * lead * np.sin(rows.kappa)))


def insert_angles(axial_rake: float, radial_rake: float, kappa: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return true rake and inclination of an insert's edge from the rakes that makers print [rad].

    `axial_rake`, `radial_rake` [rad]
    `kappa` [rad]: of the edge, 90 degrees less the corner angle C: tan T = tan R cos C + tan A sin C, tan I = tan A cos C - tan R sin C
    """
    sine, cosine = np.sin(kappa), np.cos(kappa)
    a, r = np.tan(axial_rake), np.tan(radial_rake)
    return np.arctan(r * sine + a * cosine), np.arctan(a * sine - r * cosine)


def coefficients_at(cutter: Cutter, rows: Rows, data: OrthogonalData, rake: float) -> FloatArray:
    """Return K_tc, K_rc and K_ac of each row at the mean chip along its arc, shape (3, rows) [N/m^2].

    `rake` [rad]: normal to the edge, the same everywhere
    """
    return data.coefficients(rake, inclinations(cutter, rows), _mean_chip(rows))


def coefficients_of_cut(cutter: Cutter, conditions: CuttingConditions, data: OrthogonalData, rake: float) -> CuttingCoefficients:
    """Return the constant coefficients that stand for those of all rows of a cut, each weighed by the chip that it cuts.

    `rake` [rad]: normal to the edge
    """
    rows = rows_of(cutter, conditions.engagement, conditions.axial_depth, conditions.feed_per_tooth)
    weight = rows.width * (rows.end - rows.start) * _mean_chip(rows)
    tangential, radial, axial = (float(value) for value in coefficients_at(cutter, rows, data, rake) @ (weight / weight.sum()))
    return CuttingCoefficients(tangential, radial / tangential, axial / tangential)


def _mean_chip(rows: Rows) -> FloatArray:
    """Mean thickness of the chip along each row's arc [m]."""
    mean = rows.feed * (np.cos(rows.start) - np.cos(rows.end)) / (rows.end - rows.start) + rows.step
    return np.asarray(np.sin(rows.kappa) * mean)
