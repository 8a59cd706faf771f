"""Timoshenko beam elements: two nodes, deflection w and section rotation r = dw/dz + shear each.

Consistent matrices from shape functions that satisfy the static equations exactly [friedman1993], so a uniform beam under
end loads is exact with one element. Order of freedoms: w1, r1, w2, r2; z runs from the tip to the spindle, a positive rotation
lifts w with z.

These shapes leave out how inertia and contact, which load a beam along its length, bend it inside an element: in stubby parts
the error of a natural frequency falls with the second power of the length only. Two more freedoms inside, the static answers
to a constant force and a constant moment per length with both ends held, make it the fourth; their stiffness is coupled
to nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.tool_holder.geometry import BeamSegment

ShearCoefficient = Callable[[float, float], float]


def cowper(poisson: float, ratio: float) -> float:
    """Shear coefficient of a hollow circular section [cowper1966].

    kappa = 6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2), m = inner / outer diameter (`ratio`).

    >>> round(cowper(0.3, 0.0), 4), round(cowper(0.3, 0.5), 4)
    (0.8864, 0.6202)
    """
    square = (1.0 + ratio**2) ** 2
    return 6.0 * (1.0 + poisson) * square / ((7.0 + 6.0 * poisson) * square + (20.0 + 12.0 * poisson) * ratio**2)


def hutchinson(poisson: float, ratio: float) -> float:
    """Shear coefficient of a hollow circular section [hutchinson2001].

    kappa = 6 (1 + nu)^2 (1 + m^2)^2 / ((7 + 12 nu + 4 nu^2) (1 + m^2)^2 + 4 (5 + 6 nu + 2 nu^2) m^2); the tests'
    reference frequencies of solid sections were computed with it.
    """
    square = (1.0 + ratio**2) ** 2
    nu = poisson
    return 6.0 * (1.0 + nu) ** 2 * square / ((7.0 + 12.0 * nu + 4.0 * nu**2) * square + 4.0 * (5.0 + 6.0 * nu + 2.0 * nu**2) * ratio**2)


@dataclass(frozen=True, slots=True)
class Section:
    """Stiffness and inertia of a cross-section; or arrays of them, shape (n,), for n elements at once.

    `bending` [N m^2]: bending stiffness E I
    `shear` [N]: shear stiffness kappa G A
    `mass` [kg/m]
    `rotary` [kg m]: rotary inertia rho I per length
    `loss_factor` [-]
    `shear_loss_factor` [-], default `loss_factor`: where several materials bend as one, shear may lose another share than bending
    """

    bending: float | FloatArray
    shear: float | FloatArray
    mass: float | FloatArray
    rotary: float | FloatArray
    loss_factor: float | FloatArray
    shear_loss_factor: float | FloatArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.shear_loss_factor is None:
            object.__setattr__(self, "shear_loss_factor", self.loss_factor)


def together(sections: Sequence[Section]) -> Section:
    """Return the section of bodies that deflect and turn as one: stiffnesses and masses add up."""
    bending = sum(s.bending for s in sections)
    shear = sum(s.shear for s in sections)
    return Section(
        bending=bending,
        shear=shear,
        mass=sum(s.mass for s in sections),
        rotary=sum(s.rotary for s in sections),
        loss_factor=sum(s.bending * s.loss_factor for s in sections) / bending,
        shear_loss_factor=sum(s.shear * s.shear_loss_factor for s in sections) / shear,
    )


def stacked(sections: Sequence[Section]) -> Section:
    """Return the sections of n elements as one `Section` of arrays, shape (n,)."""
    return Section(*np.array([[getattr(s, f.name) for s in sections] for f in fields(Section)], dtype=float))


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


def shape_functions(position: FloatArray, length: float | FloatArray, shear_ratio: float | FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return deflection and rotation shape functions, each shape (n, 4), or (m, n, 4) for m elements.

    `position` [-], shape (n,): z / length in the element
    `length`: float, or array, shape (m,) [m]
    `shear_ratio`: float, or array, shape (m,) [-]; 12 E I / (kappa G A length^2)
    """
    x = np.asarray(position, dtype=float)
    length, p = np.asarray(length, dtype=float)[..., None], np.asarray(shear_ratio, dtype=float)[..., None]
    deflection = [
        2 * x**3 - 3 * x**2 - p * x + 1 + p,
        length * (x**3 - (2 + p / 2) * x**2 + (1 + p / 2) * x),
        -(2 * x**3 - 3 * x**2 - p * x),
        length * (x**3 - (1 - p / 2) * x**2 - p / 2 * x),
    ]
    rotation = [6 / length * (x**2 - x), 3 * x**2 - (4 + p) * x + 1 + p, -6 / length * (x**2 - x), 3 * x**2 - (2 - p) * x]
    scale = 1.0 / (1.0 + p)
    return np.stack([scale * f for f in deflection], axis=-1), np.stack([scale * f for f in rotation], axis=-1)


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_GAUSS_X, _GAUSS_W = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


def beam_matrices(beam: Section, length: float) -> tuple[FloatArray, FloatArray]:
    """Return consistent mass and stiffness of an element of a length [m], each shape (4, 4)."""
    mass, stiffness, _ = refined_beam_matrices(beam, length)
    return mass[..., :4, :4], stiffness[..., :4, :4]


def refined_beam_matrices(beam: Section, length: float | FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mass, stiffness and structural damping with the two inner freedoms, each shape (6, 6), or (m, 6, 6).

    The inner freedoms are a parabola of pure shear, w = 4 x (1 - x) L, and r = 4 x (1 - x) with the deflection that keeps
    the shear strain constant, w = L (2 x^2 - 4 x^3 / 3 - 2 x / 3).
    """
    size = np.asarray(length, dtype=float)
    ratio = 12.0 * beam.bending / (beam.shear * size**2)
    deflection, rotation = _refined_shapes(size, ratio)
    weight = _GAUSS_W[:, None] * size[..., None, None]
    mass = _moment(beam.mass, deflection, weight) + _moment(beam.rotary, rotation, weight)
    one, zero, half = np.ones_like(ratio), np.zeros_like(ratio), 0.5 * size
    # strains are a constant and a part linear in x: shear w' - r, and curvature times the length
    nodal = ratio / (1.0 + ratio) / size
    constant = np.stack([-nodal, -half * nodal, nodal, -half * nodal, zero, -2.0 / 3.0 * one], axis=-1)
    linear = np.stack([zero, zero, zero, zero, 4.0 * one, zero], axis=-1)
    shear = np.asarray(beam.shear * size)[..., None, None] * (_outer(constant) + _outer(linear) / 3.0)
    nodal = 2.0 / ((1.0 + ratio) * size)
    constant = np.stack([zero, -one, zero, one, zero, zero], axis=-1)
    linear = np.stack([3.0 * nodal, 3.0 * half * nodal, -3.0 * nodal, 3.0 * half * nodal, zero, -4.0 * one], axis=-1)
    bending = np.asarray(beam.bending / size)[..., None, None] * (_outer(constant) + _outer(linear) / 3.0)
    damping = np.asarray(beam.loss_factor)[..., None, None] * bending + np.asarray(beam.shear_loss_factor)[..., None, None] * shear
    return mass, bending + shear, damping


def refined_rotary_matrices(beam: Section, length: float | FloatArray) -> FloatArray:
    """Return the rotary inertia's share of the mass of `refined_beam_matrices`, shape (6, 6), or (m, 6, 6)."""
    size = np.asarray(length, dtype=float)
    _, rotation = _refined_shapes(size, 12.0 * beam.bending / (beam.shear * size**2))
    return _moment(beam.rotary, rotation, _GAUSS_W[:, None] * size[..., None, None])


def _refined_shapes(length: FloatArray, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shape functions at the Gauss points with the two inner ones behind, shape (5, 6), or (m, 5, 6)."""
    deflection, rotation = shape_functions(_GAUSS_X, length, ratio)
    x, size = _GAUSS_X, length[..., None]
    parabola = 4.0 * x * (1.0 - x)
    inner_w = np.stack([parabola * size, (2.0 * x**2 - 4.0 / 3.0 * x**3 - 2.0 / 3.0 * x) * size], axis=-1)
    inner_r = np.stack([0.0 * x * size, parabola + 0.0 * size], axis=-1)
    return np.concatenate([deflection, inner_w], axis=-1), np.concatenate([rotation, inner_r], axis=-1)


def _outer(shape: FloatArray) -> FloatArray:
    return shape[..., :, None] * shape[..., None, :]


def _moment(density: float | FloatArray, shape: FloatArray, weight: FloatArray) -> FloatArray:
    """Integral of density shape^T shape."""
    return np.asarray(density)[..., None, None] * (np.swapaxes(shape * weight, -1, -2) @ shape)


def layer_matrices(inner: Section, outer: Section, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the matrices of unit distributed springs between two parallel elements, each shape (8, 8).

    First for a unit translational stiffness per metre, then for a unit rotational one; freedoms of `inner`, then of
    `outer`. The relative motion is integrated with both bodies' own shape functions.

    `inner`, `outer`: of the elements that lie side by side
    `length` [m]
    """
    nodal = np.ix_([0, 1, 2, 3, 6, 7, 8, 9], [0, 1, 2, 3, 6, 7, 8, 9])
    gap, turn = refined_layer_matrices(inner, outer, length)
    return gap[nodal], turn[nodal]


def refined_layer_matrices(inner: Section, outer: Section, length: float | FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what `layer_matrices` does with both bodies' inner freedoms, each shape (12, 12), or (m, 12, 12).

    `inner`, `outer`: of the elements that lie side by side; arrays, shape (m,), for m pairs at once
    `length`: float, or array, shape (m,) [m]
    """
    size = np.asarray(length, dtype=float)
    inner_w, inner_r = _refined_shapes(size, 12.0 * inner.bending / (inner.shear * size**2))
    outer_w, outer_r = _refined_shapes(size, 12.0 * outer.bending / (outer.shear * size**2))
    gap = np.concatenate([inner_w, -outer_w], axis=-1)
    turn = np.concatenate([inner_r, -outer_r], axis=-1)
    weight = _GAUSS_W[:, None] * size[..., None, None]
    return _moment(1.0, gap, weight), _moment(1.0, turn, weight)
