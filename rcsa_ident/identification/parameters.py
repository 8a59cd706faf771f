"""The unknowns as one vector, and the vector as physics.

One axis with m modes: log natural frequencies (m), mass-normalised shapes (2 m: translation, lever x slope), the lower
triangle of the damping factor L by rows (diagonal as logarithm), the residual compliance's factor (3); for each other place
whose motion is in an output (a gap sensor's fixture, the housing) its shapes (m) and its residual to the flange (2); where
hammer tests at standstill stand beside cuts what that changes (2); where the machine changes with speed the lower triangle of
its softening by rows. All axes follow each other. What they share stands at the end: the joint's four logarithms, logarithms of
the cutting coefficients' scales, tooth angles of the clampings. With D = L L^T and R = R_f R_f^T every vector is a passive
machine with real modes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import accumulate, pairwise

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, damped_modes
from rcsa_ident.identification.data import LEVER

#: Units of the damping factor [sqrt(rad/s)], of the residual compliance's factor [sqrt(m/N)] and of another place's residual [m/N].
DAMPING_UNIT = 30.0
RESIDUAL_UNIT = np.sqrt(1e-9)
PLACE_UNIT = 1e-9
#: Unknowns of the joint.
JOINT = 4


@dataclass(frozen=True)
class AxisLayout:
    """What of an axis is unknown.

    Parameters
    ----------
    modes : int
    places : int
        Other places of the machine whose motion is in the outputs: the displacement sensor's fixture, the spindle's housing.
    softening : bool
        The stiffness changes with the spindle's speed.
    standstill : bool
        Some of the lines belong to a spindle that stands still: all natural frequencies and all damping may differ by a share there.
    """

    modes: int
    places: int = 0
    softening: bool = False
    standstill: bool = False

    @cached_property
    def core(self) -> int:
        """Length of the part that describes the flange at the campaign's middle speed."""
        return 3 * self.modes + self.pairs + 3

    @cached_property
    def pairs(self) -> int:
        """Number of entries of a lower triangle over the modes."""
        return self.modes * (self.modes + 1) // 2

    @cached_property
    def size(self) -> int:
        """Length of the axis' part of the vector."""
        return self.core + (self.modes + 2) * self.places + 2 * self.standstill + self.pairs * self.softening

    @cached_property
    def still(self) -> slice:
        """Places in the axis' part of what standing still changes."""
        first = self.core + (self.modes + 2) * self.places
        return slice(first, first + 2 * self.standstill)

    @cached_property
    def machine(self) -> np.ndarray:
        """Places in the axis' part of all that describes the flange while it turns: core and softening, but not the other places."""
        places = np.arange(self.size)
        return np.concatenate([places[: self.core], places[self.size - self.pairs * self.softening :]])


class Unknowns(ABC):
    """Which unknown stands where in a vector: those of machines first, then what all their lines share."""

    #: Cutting coefficients whose scale is unknown, and clampings whose tooth angle at the trigger's edge is.
    coefficients: int
    clampings: int

    @property
    @abstractmethod
    def tail(self) -> int:
        """Place in the vector at which begins what all axes share."""

    @property
    @abstractmethod
    def modes_of_axes(self) -> tuple[int, ...]:
        """Numbers of modes that may be exchanged with each other without changing anything."""

    @abstractmethod
    def axis(self, i: int) -> slice:
        """Return the part of the machines that the lines of an axis depend on."""

    @cached_property
    def size(self) -> int:
        """Length of the vector."""
        return self.tail + JOINT + self.coefficients + self.clampings

    @cached_property
    def joint(self) -> slice:
        """Places of the logarithms of the joint's stiffnesses and damping."""
        return slice(self.tail, self.tail + JOINT)

    @cached_property
    def force(self) -> slice:
        """Places of the logarithms of the cutting coefficients' scales."""
        return slice(self.tail + JOINT, self.size - self.clampings)

    @cached_property
    def clamping(self) -> slice:
        """Places of the clampings' tooth angles [rad]."""
        return slice(self.size - self.clampings, self.size)


@dataclass(frozen=True)
class Layout(Unknowns):
    """Each axis has its own machine.

    Parameters
    ----------
    axes : tuple of AxisLayout
    coefficients : int
        Cutting coefficients whose scale is unknown.
    clampings : int
        Clampings whose tooth angle at the trigger's edge is unknown.
    """

    axes: tuple[AxisLayout, ...]
    coefficients: int = 0
    clampings: int = 0

    @cached_property
    def tail(self) -> int:
        """Place in the vector at which begins what all axes share."""
        return sum(a.size for a in self.axes)

    @cached_property
    def modes_of_axes(self) -> tuple[int, ...]:
        """Modes of each axis: those of one may be exchanged with each other without changing anything."""
        return tuple(a.modes for a in self.axes)

    def axis(self, i: int) -> slice:
        """Return the part of an axis."""
        return self._places[i]

    @cached_property
    def _places(self) -> tuple[slice, ...]:
        ends = list(accumulate((a.size for a in self.axes), initial=0))
        return tuple(slice(first, last) for first, last in pairwise(ends))


def planes(layout: Unknowns) -> Layout:
    """Return the layout as one whose axes have their own machines, which it is known to be."""
    assert isinstance(layout, Layout)
    return layout


def flange_layout(*modes: int, places: int = 0) -> Layout:
    """Return the layout of axes with so many modes each, as many other places, and a joint."""
    return Layout(tuple(AxisLayout(m, places) for m in modes))


@dataclass(frozen=True, slots=True, eq=False)
class AxisParameters:
    """One axis in scaled physical units, as the kernel takes it.

    Parameters
    ----------
    omega_n : array, shape (m,) [rad/s]
    psi : array, shape (m, 2) [1/sqrt(kg)]
        Mass-normalised shapes at the flange: translation, and slope times the lever.
    factor : array, shape (m, m) [sqrt(rad/s)]
        L of the damping matrix D = L L^T in modal coordinates.
    residual : array, shape (2, 2) [sqrt(m/N)]
        Factor R_f of the residual compliance R_f R_f^T, the modes above the band.
    places : array, shape (m, e) [1/sqrt(kg)]
        The modes' shapes at other places of the machine.
    place_residual : array, shape (e, 2) [m/N]
        Residual compliance between each of them and the flange's translation and slope.
    softening : array, shape (m, m) or (0, 0) [-]
        Symmetric: K_ij = omega_i omega_j (delta_ij + x softening_ij) at relative speed x.
    standstill : array, shape (2,) or (0,) [-]
        Shares by which natural frequencies and damping matrix differ where the spindle stands still; empty where no line tells it.
    """

    omega_n: FloatArray
    psi: FloatArray
    factor: FloatArray
    residual: FloatArray
    places: FloatArray
    place_residual: FloatArray
    softening: FloatArray
    standstill: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def order(self) -> int:
        """Number of modes."""
        return self.omega_n.size

    @property
    def shapes(self) -> FloatArray:
        """Shapes at the flange and at other places, and the residual behind them, as the kernel takes them, shape (m + 2, 2 + e)."""
        residual = np.vstack([self.residual, self.place_residual])
        return np.ascontiguousarray(np.vstack([np.hstack([self.psi, self.places]), residual.T]))

    def at(self, x: float) -> AxisParameters:
        """Return the machine at relative speed x (-1 and 1 are the campaign's lowest and highest), in its own modes there."""
        if self.softening.size == 0:
            return self
        stiffness = np.outer(self.omega_n, self.omega_n) * (np.eye(self.order) + x * self.softening)
        squares, turn = np.linalg.eigh(stiffness)
        # far outside the measured speeds the straight line may cross zero: a machine does not
        omega_n = np.sqrt(np.maximum(squares, 1e-6 * np.min(self.omega_n) ** 2))
        factor = lower_factor(turn.T @ self.factor)
        return AxisParameters(
            omega_n, turn.T @ self.psi, factor, self.residual, turn.T @ self.places, self.place_residual, np.zeros((0, 0))
        )


def simple_axis(omega_n: FloatArray, psi: FloatArray, factor: FloatArray, residual: FloatArray) -> AxisParameters:
    """Return an axis whose only output is the flange and which does not change with speed.

    Parameters
    ----------
    omega_n, psi, factor, residual : arrays, shapes (m,), (m, 2), (m, m), (2, 2)
        As in `AxisParameters`.
    """
    return AxisParameters(omega_n, psi, factor, residual, np.zeros((omega_n.size, 0)), np.zeros((0, 2)), np.zeros((0, 0)))


@lru_cache
def lower_triangle(order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows and columns of a lower triangle's entries in the vector's order, and which are on the diagonal."""
    rows, cols = (frozen(index, np.intp) for index in np.tril_indices(order))
    return rows, cols, frozen(rows == cols, np.bool_)


def parameter_names(layout: AxisLayout) -> tuple[str, ...]:
    """Return the names of the unknowns of an axis' flange and the joint, in the vector's order."""
    m = layout.modes
    pairs = [(i, j) for i in range(m) for j in range(i + 1)]
    names = [f"log natural_frequency_rad_s[{n}]" for n in range(m)]
    names += [f"psi_{k}[{n}]" for n in range(m) for k in ("t", "lever*r")]
    names += [f"log damping_factor[{i},{j}]" if i == j else f"damping_factor[{i},{j}]" for i, j in pairs]
    names += [f"residual_factor[{i},{j}]" for i, j in ((0, 0), (1, 0), (1, 1))]
    names += [f"softening[{i},{j}]" for i, j in pairs if layout.softening]
    return (*names, "log joint.k_t", "log joint.k_r", "log joint.c_t", "log joint.c_r")


def split(theta: FloatArray, layout: Layout) -> tuple[list[FloatArray], FloatArray]:
    """Return the axes' parts and the joint's."""
    return [theta[layout.axis(i)] for i in range(len(layout.axes))], theta[layout.joint]


def unpack(part: FloatArray, layout: AxisLayout) -> AxisParameters:
    """Return the physics of an axis' part of the vector."""
    m, core = layout.modes, layout.core
    rows, cols, diagonal = lower_triangle(m)
    lower = DAMPING_UNIT * part[3 * m : core - 3]
    lower[diagonal] = DAMPING_UNIT * np.exp(part[3 * m : core - 3][diagonal])
    factor = np.zeros((m, m))
    factor[rows, cols] = lower
    a, b, c = RESIDUAL_UNIT * part[core - 3 : core]
    beside = part[core : core + (m + 2) * layout.places].reshape(layout.places, m + 2)
    places, place_residual, softening = beside[:, :m].T, PLACE_UNIT * beside[:, m:], np.zeros((0, 0))
    if layout.softening:
        softening = np.zeros((m, m))
        softening[rows, cols] = softening[cols, rows] = part[-layout.pairs :]
    residual = np.array([[a, 0.0], [b, c]])
    still = part[layout.still]
    return AxisParameters(np.exp(part[:m]), part[m : 3 * m].reshape(m, 2), factor, residual, places, place_residual, softening, still)


def pack(axis: AxisParameters, layout: AxisLayout | None = None) -> FloatArray:
    """Return the vector of an axis; the inverse of `unpack`. By default of its flange alone, at the middle speed.

    Of other places the layout's first ones are told, and those that the axis does not know rest.
    """
    layout = AxisLayout(axis.order) if layout is None else layout
    rows, cols, diagonal = lower_triangle(axis.order)
    lower = axis.factor[rows, cols] / DAMPING_UNIT
    lower = np.where(diagonal, np.log(np.where(diagonal, np.abs(lower), 1.0)), lower)
    parts = [np.log(axis.omega_n), axis.psi.ravel(), lower, axis.residual[[0, 1, 1], [0, 0, 1]] / RESIDUAL_UNIT]
    beside = np.zeros((layout.places, axis.order + 2))
    told = min(layout.places, axis.places.shape[1])
    beside[:told] = np.hstack([axis.places.T, axis.place_residual / PLACE_UNIT])[:told]
    parts.append(beside.ravel())
    if layout.standstill:
        parts.append(axis.standstill if axis.standstill.size else np.zeros(2))
    if layout.softening:
        parts.append(axis.softening[rows, cols] if axis.softening.size else np.zeros(layout.pairs))
    return np.concatenate(parts)


def chain(axis: AxisParameters, layout: AxisLayout) -> FloatArray:
    """Return d physics / d vector for each entry of an axis (the map is entry by entry), in the kernel's order."""
    m = axis.order
    rows, cols, diagonal = lower_triangle(m)
    factor = np.where(diagonal, axis.factor[rows, cols], DAMPING_UNIT)
    parts = [np.ones(3 * m), factor, np.full(3, RESIDUAL_UNIT)]
    parts += [np.ones(m), np.full(2, PLACE_UNIT)] * layout.places
    if layout.standstill:
        parts.append(np.ones(2))
    if layout.softening:
        parts.append(np.ones(layout.pairs))
    return np.concatenate(parts)


def residual_turn(factor: FloatArray) -> FloatArray:
    """Return d (tt, tr, rr) / d (factor 00, 10, 11) of R = factor factor^T, shape (3, 3)."""
    a, b, c = factor[0, 0], factor[1, 0], factor[1, 1]
    return np.array([[2.0 * a, 0.0, 0.0], [b, a, 0.0], [0.0, 2.0 * b, 2.0 * c]])


def lower_factor(rows: FloatArray) -> FloatArray:
    """Return the lower triangular L with L L^T = rows rows^T and a diagonal above zero.

    From rows^T = Q R: unlike a Cholesky factor of the product it exists for any damping, however light.
    """
    factor = np.asarray(np.linalg.qr(rows.T, mode="r")).T
    factor = factor * np.where(np.diag(factor) < 0.0, -1.0, 1.0)
    # a mode that hangs on another one's damper alone has a zero there, and no logarithm
    own = np.maximum(np.diag(factor), 1e-9 * np.linalg.norm(rows, axis=1) + 1e-150)
    np.fill_diagonal(factor, own)
    return factor


def selected(axis: AxisParameters, modes: np.ndarray) -> AxisParameters:
    """Return the axis with some of its modes, in the given order, their damping as it was."""
    softening = axis.softening[np.ix_(modes, modes)] if axis.softening.size else axis.softening
    return AxisParameters(
        axis.omega_n[modes],
        axis.psi[modes],
        lower_factor(axis.factor[modes]),
        axis.residual,
        axis.places[modes],
        axis.place_residual,
        softening,
        axis.standstill,
    )


def without_mode(axis: AxisParameters, mode: int) -> AxisParameters:
    """Return the axis with one mode taken out, the others' damping as it was."""
    return selected(axis, np.flatnonzero(np.arange(axis.order) != mode))


def with_mode(axis: AxisParameters, omega_n: float, psi: tuple[float, float], zeta: float = 0.05) -> AxisParameters:
    """Return the axis with one more mode in front, uncoupled to the others, which other places do not feel.

    Parameters
    ----------
    axis : AxisParameters
    omega_n : float [rad/s]
    psi : (float, float) [1/sqrt(kg)]
        Mass-normalised shape: translation, and slope times the lever.
    zeta : float [-]
        Damping ratio.
    """
    factor = np.zeros((axis.order + 1, axis.order + 1))
    factor[0, 0], factor[1:, 1:] = np.sqrt(2.0 * zeta * omega_n), axis.factor
    softening = np.pad(axis.softening, ((1, 0), (1, 0))) if axis.softening.size else axis.softening
    return AxisParameters(
        np.append(omega_n, axis.omega_n),
        np.concatenate([[psi], axis.psi]),
        factor,
        axis.residual,
        np.concatenate([np.zeros((1, axis.places.shape[1])), axis.places]),
        axis.place_residual,
        softening,
        axis.standstill,
    )


def scaled_joint(logs: FloatArray) -> FloatArray:
    """Return k_t, k_r, c_t, c_r with the rotational ones per lever squared, as the kernel takes them."""
    return np.exp(logs) / np.array([1.0, LEVER**2, 1.0, LEVER**2])


def joint_of(logs: FloatArray) -> LumpedJoint:
    """Return the joint of the vector's last entries."""
    k_t, k_r, c_t, c_r = (float(v) for v in np.exp(logs))
    return LumpedJoint(k_t, k_r, c_t, c_r)


def flange_modes(axis: AxisParameters, dof: Dof) -> ModalModel:
    """Return the axis as complex modes at the flange ([inprocess], eq. 13), in SI, sorted by frequency."""
    lever = np.array([1.0, 1.0 / LEVER])
    residual = axis.residual @ axis.residual.T * np.outer(lever, lever)
    return damped_modes(axis.omega_n, axis.factor @ axis.factor.T, axis.psi * lever, residual, plane("flange", dof))
