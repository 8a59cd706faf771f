"""Timoshenko beam elements: two nodes, deflection w and section rotation r = dw/dz + shear each.

Consistent matrices from shape functions that satisfy the static equations exactly (Friedman & Kosmatka, Computers &
Structures 47 (1993) 473), so a uniform beam under end loads is exact with one element. Order of freedoms: w1, r1, w2, r2;
z runs from the tip to the spindle, a positive rotation lifts w with z.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.dynamics.arrays import FloatArray
from rcsa_ident.tool_holder.geometry import BeamSegment

ShearCoefficient = Callable[[float, float], float]


def cowper(poisson: float, ratio: float) -> float:
    """Shear coefficient of a hollow circular section (Cowper, J. Appl. Mech. 33 (1966) 335).

    kappa = 6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2), m = inner / outer diameter.
    """
    square = (1.0 + ratio**2) ** 2
    return 6.0 * (1.0 + poisson) * square / ((7.0 + 6.0 * poisson) * square + (20.0 + 12.0 * poisson) * ratio**2)


def hutchinson(poisson: float, ratio: float) -> float:
    """Shear coefficient of a hollow circular section (Hutchinson, J. Appl. Mech. 68 (2001) 87).

    kappa = 6 (1 + nu)^2 (1 + m^2)^2 / ((7 + 12 nu + 4 nu^2) (1 + m^2)^2 + 4 (5 + 6 nu + 2 nu^2) m^2); with it the
    solid section's frequencies are those of tables/stability_benchmarks.toml.
    """
    square = (1.0 + ratio**2) ** 2
    nu = poisson
    return 6.0 * (1.0 + nu) ** 2 * square / ((7.0 + 12.0 * nu + 4.0 * nu**2) * square + 4.0 * (5.0 + 6.0 * nu + 2.0 * nu**2) * ratio**2)


@dataclass(frozen=True, slots=True)
class Section:
    """Stiffness and inertia of a cross-section.

    Parameters
    ----------
    bending : float [N m^2]
        E I.
    shear : float [N]
        kappa G A.
    mass : float [kg/m]
    rotary : float [kg m]
        rho I.
    loss_factor : float [-]
    """

    bending: float
    shear: float
    mass: float
    rotary: float
    loss_factor: float


def section(segment: BeamSegment, shear_coefficient: ShearCoefficient = cowper) -> Section:
    """Return the mean section of a segment: area and second moment averaged exactly over a taper."""
    material = segment.material
    d1, d2, inner = segment.diameter, segment.end, segment.inner_diameter
    if segment.area is not None and segment.second_moment is not None:
        area, second_moment = segment.area, segment.second_moment
    else:
        area = np.pi / 4.0 * ((d1**2 + d1 * d2 + d2**2) / 3.0 - inner**2)
        second_moment = np.pi / 64.0 * (sum(d1 ** (4 - k) * d2**k for k in range(5)) / 5.0 - inner**4)
    kappa = shear_coefficient(material.poisson, inner / (0.5 * (d1 + d2)))
    return Section(
        bending=material.youngs_modulus * second_moment,
        shear=kappa * material.shear_modulus * area,
        mass=material.density * area,
        rotary=material.density * second_moment,
        loss_factor=material.loss_factor,
    )


def shape_functions(position: FloatArray, length: float, shear_ratio: float) -> tuple[FloatArray, FloatArray]:
    """Return deflection and rotation shape functions, each shape (n, 4).

    Parameters
    ----------
    position : array, shape (n,) [-]
        z / length in the element.
    length : float [m]
    shear_ratio : float [-]
        12 E I / (kappa G A length^2).
    """
    x, p = np.asarray(position, dtype=float), shear_ratio
    scale = 1.0 / (1.0 + p)
    deflection = scale * np.stack(
        [
            2 * x**3 - 3 * x**2 - p * x + 1 + p,
            length * (x**3 - (2 + p / 2) * x**2 + (1 + p / 2) * x),
            -(2 * x**3 - 3 * x**2 - p * x),
            length * (x**3 - (1 - p / 2) * x**2 - p / 2 * x),
        ],
        axis=-1,
    )
    rotation = scale * np.stack(
        [
            6 / length * (x**2 - x),
            3 * x**2 - (4 + p) * x + 1 + p,
            -6 / length * (x**2 - x),
            3 * x**2 - (2 - p) * x,
        ],
        axis=-1,
    )
    return deflection, rotation


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_GAUSS_X, _GAUSS_W = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


def beam_matrices(beam: Section, length: float) -> tuple[FloatArray, FloatArray]:
    """Return consistent mass and stiffness of an element, each shape (4, 4)."""
    ratio = 12.0 * beam.bending / (beam.shear * length**2)
    deflection, rotation = shape_functions(_GAUSS_X, length, ratio)
    weight = _GAUSS_W * length
    mass = beam.mass * (deflection.T * weight) @ deflection + beam.rotary * (rotation.T * weight) @ rotation
    a, b, c = 6.0 * length, (4.0 + ratio) * length**2, (2.0 - ratio) * length**2
    stiffness = np.array([[12.0, a, -12.0, a], [a, b, -a, c], [-12.0, -a, 12.0, -a], [a, c, -a, b]])
    return mass, stiffness * beam.bending / (length**3 * (1.0 + ratio))


def layer_matrices(inner: Section, outer: Section, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the matrices of unit distributed springs between two parallel elements, each shape (8, 8).

    First for a unit translational stiffness per metre, then for a unit rotational one; freedoms of `inner`, then of
    `outer`. The relative motion is integrated with both bodies' own shape functions.
    """
    weight = _GAUSS_W * length
    inner_w, inner_r = shape_functions(_GAUSS_X, length, 12.0 * inner.bending / (inner.shear * length**2))
    outer_w, outer_r = shape_functions(_GAUSS_X, length, 12.0 * outer.bending / (outer.shear * length**2))
    gap = np.hstack([inner_w, -outer_w])
    turn = np.hstack([inner_r, -outer_r])
    return (gap.T * weight) @ gap, (turn.T * weight) @ turn
