"""The unknowns as one vector, and the vector as physics.

One axis with m modes: log natural frequencies (m), mass-normalised shapes (2 m: translation, lever x slope), the lower
triangle of the damping factor L by rows (diagonal as logarithm), the residual compliance's factor (3). All axes follow each
other; the joint's four logarithms, shared by all axes, stand at the end. With D = L L^T and R = R_f R_f^T every vector is a
passive machine with real modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rcsa_ident.arrays import FloatArray, frozen
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, damped_modes
from rcsa_ident.identification.data import LEVER

#: Units of the damping factor [sqrt(rad/s)] and of the residual compliance's factor [sqrt(m/N)].
DAMPING_UNIT = 30.0
RESIDUAL_UNIT = np.sqrt(1e-9)


@dataclass(frozen=True, slots=True, eq=False)
class AxisParameters:
    """One axis in scaled physical units, as the kernel takes it.

    Parameters
    ----------
    stiffness : array, shape (m,) [rad^2/s^2]
        Squares of the natural frequencies.
    psi : array, shape (m, 2) [1/sqrt(kg)]
    factor : array, shape (m, m) [sqrt(rad/s)]
    residual : array, shape (2, 2) [sqrt(m/N)]
    """

    stiffness: FloatArray
    psi: FloatArray
    factor: FloatArray
    residual: FloatArray

    @property
    def order(self) -> int:
        """Number of modes."""
        return self.stiffness.size


def axis_size(order: int) -> int:
    """Return the length of an axis' part of the vector."""
    return 3 * order + order * (order + 1) // 2 + 3


@lru_cache
def lower_triangle(order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows and columns of the damping factor's entries in the vector's order, and which are on the diagonal."""
    rows, cols = (frozen(index, np.intp) for index in np.tril_indices(order))
    return rows, cols, frozen(rows == cols, np.bool_)


def split(theta: FloatArray, orders: tuple[int, ...]) -> tuple[list[FloatArray], FloatArray]:
    """Return the axes' parts and the joint's."""
    edges = np.cumsum([axis_size(m) for m in orders])
    parts = np.split(theta, edges)
    return parts[:-1], parts[-1]


def unpack(part: FloatArray, order: int) -> AxisParameters:
    """Return the physics of an axis' part of the vector."""
    m = order
    rows, cols, diagonal = lower_triangle(m)
    lower = part[3 * m : -3]
    factor = np.zeros((m, m))
    factor[rows, cols] = DAMPING_UNIT * np.where(diagonal, np.exp(np.where(diagonal, lower, 0.0)), lower)
    residual = np.zeros((2, 2))
    residual[np.tril_indices(2)] = RESIDUAL_UNIT * part[-3:]
    return AxisParameters(np.exp(2.0 * part[:m]), part[m : 3 * m].reshape(m, 2), factor, residual)


def pack(axis: AxisParameters) -> FloatArray:
    """Return the vector of an axis; the inverse of `unpack`."""
    m = axis.order
    rows, cols, diagonal = lower_triangle(m)
    lower = axis.factor[rows, cols] / DAMPING_UNIT
    lower = np.where(diagonal, np.log(np.where(diagonal, np.abs(lower), 1.0)), lower)
    tail = axis.residual[np.tril_indices(2)] / RESIDUAL_UNIT
    return np.concatenate([0.5 * np.log(axis.stiffness), axis.psi.ravel(), lower, tail])


def chain(axis: AxisParameters) -> FloatArray:
    """Return d physics / d vector for each entry of an axis (the map is entry by entry), in the kernel's order."""
    m = axis.order
    rows, cols, diagonal = lower_triangle(m)
    factor = np.where(diagonal, axis.factor[rows, cols], DAMPING_UNIT)
    return np.concatenate([2.0 * axis.stiffness, np.ones(2 * m), factor, np.full(3, RESIDUAL_UNIT)])


def selected(axis: AxisParameters, modes: np.ndarray) -> AxisParameters:
    """Return the axis with some of its modes, in the given order, their damping as it was.

    The damping's factor is that of L's rows, L_s L_s^T = R^T R from L_s^T = Q R: unlike a Cholesky factor of the product it
    exists for any damping, however light.
    """
    rows = axis.factor[modes]
    factor = np.asarray(np.linalg.qr(rows.T, mode="r")).T
    factor = factor * np.where(np.diag(factor) < 0.0, -1.0, 1.0)
    # a mode that hangs on another one's damper alone has a zero there, and no logarithm
    own = np.maximum(np.diag(factor), 1e-9 * np.linalg.norm(rows, axis=1) + 1e-150)
    np.fill_diagonal(factor, own)
    return AxisParameters(axis.stiffness[modes], axis.psi[modes], factor, axis.residual)


def without_mode(axis: AxisParameters, mode: int) -> AxisParameters:
    """Return the axis with one mode taken out, the others' damping as it was."""
    return selected(axis, np.flatnonzero(np.arange(axis.order) != mode))


def with_mode(axis: AxisParameters, omega_n: float, psi: tuple[float, float], zeta: float = 0.05) -> AxisParameters:
    """Return the axis with one more mode in front, whose damping is not coupled to the others'."""
    factor = np.zeros((axis.order + 1, axis.order + 1))
    factor[0, 0], factor[1:, 1:] = np.sqrt(2.0 * zeta * omega_n), axis.factor
    return AxisParameters(np.append(omega_n**2, axis.stiffness), np.concatenate([[psi], axis.psi]), factor, axis.residual)


def scaled_joint(logs: FloatArray) -> FloatArray:
    """Return k_t, k_r, c_t, c_r with the rotational ones per lever squared, as the kernel takes them."""
    return np.exp(logs) / np.array([1.0, LEVER**2, 1.0, LEVER**2])


def joint_of(logs: FloatArray) -> LumpedJoint:
    """Return the joint of the vector's last entries."""
    k_t, k_r, c_t, c_r = (float(v) for v in np.exp(logs))
    return LumpedJoint(k_t, k_r, c_t, c_r)


def modes_of(axis: AxisParameters, dof: Dof) -> ModalModel:
    """Return the axis as complex modes at the flange (the paper's form), in SI, sorted by frequency."""
    lever = np.array([1.0, 1.0 / LEVER])
    residual = axis.residual @ axis.residual.T * np.outer(lever, lever)
    return damped_modes(np.sqrt(axis.stiffness), axis.factor @ axis.factor.T, axis.psi * lever, residual, plane("flange", dof))
