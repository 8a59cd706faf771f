"""A machine's modes in scaled physical units, as kernels take them: of one bending plane, of both, or of the spindle in a robot's hand.

Slopes are multiplied and moments divided by a lever, so that all receptances are in m/N. With D = L L^T, R = R_f R_f^T and a skew G every
value is a passive machine at every speed: the damping's Hermitian part is D, and i omega W G takes and gives nothing in the mean.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, damped_modes
from rcsa_ident.identification.data import LEVER


def _none() -> FloatArray:
    return np.zeros((0, 0))


@dataclass(frozen=True, slots=True, eq=False)
class ModalParameters:
    """Modes and what goes with them; what a machine does not have is empty.

    `omega_n` [rad/s], shape (m,)
    `psi` [1/sqrt(kg)], shape (m, d): mass-normalised shapes at the flange: translation, and slope times the lever; of both planes (d = 4)
        those of X, then those of Y
    `factor` [sqrt(rad/s)], shape (m, m): L of the damping matrix D = L L^T in modal coordinates
    `residual` [sqrt(m/N)], shape (d, d): lower triangular factor R_f of the residual compliance R_f R_f^T, the modes above the band
    `places` [1/sqrt(kg)], shape (m, e): the modes' shapes at other places of the machine: a gap sensor's fixture (of both planes in X, then
        in Y), the housing
    `place_residual` [m/N], shape (e, d): residual compliance between each of them and the flange
    `softening`: array, shape (m, m) or (0, 0) [-]; symmetric: K_ij = omega_i omega_j (delta_ij + x softening_ij) at relative speed x
    `standstill`: array, shape (2,) or (0,) [-]; shares by which natural frequencies and damping matrix differ where the spindle stands
        still
    `skew`: array, shape (m, m) or (0, 0) [-]; G: a velocity of mode j at spindle speed W pushes mode i with W G_ij
    `pull`: array, shape (m, d) or (0, 0) [sqrt(kg)]; what a motion of the housing in the flange's directions pulls each mode with
    `warming`: array, shape (m, m) or (0, 0) [-]; as softening, with `IdentificationData.warmth`
    """

    omega_n: FloatArray
    psi: FloatArray
    factor: FloatArray
    residual: FloatArray
    places: FloatArray
    place_residual: FloatArray
    softening: FloatArray = field(default_factory=_none)
    standstill: FloatArray = field(default_factory=lambda: np.zeros(0))
    skew: FloatArray = field(default_factory=_none)
    pull: FloatArray = field(default_factory=_none)
    warming: FloatArray = field(default_factory=_none)

    @property
    def order(self) -> int:
        """Number of modes."""
        return self.omega_n.size

    @property
    def shapes(self) -> FloatArray:
        """Shapes at the flange and at other places, and the residual behind them: as the plane's kernel takes them, (m + d, d + e)."""
        residual = np.vstack([self.residual, self.place_residual])
        return np.ascontiguousarray(np.vstack([np.hstack([self.psi, self.places]), residual.T]))

    @property
    def changes(self) -> FloatArray:
        """What the stiffness changes by with each state, one below the other as the plane's kernel takes it, shape (s m, m) or (0, 0)."""
        known = [each for each in (self.warming, self.softening) if each.size]
        return np.vstack(known) if known else _none()

    def at(self, x: float, w: float = 0.0) -> ModalParameters:
        """Return the machine at relative speed x (-1 and 1 are the campaign's lowest and highest) and warmth w, in its own modes there.

        The warm machine has the warmth 0, the coldest one -1.
        """
        moved = [state * change for state, change in ((x, self.softening), (w, self.warming)) if change.size]
        if not moved:
            return self
        stiffness = np.outer(self.omega_n, self.omega_n) * (np.eye(self.order) + sum(moved))
        squares, turn = np.linalg.eigh(stiffness)
        return replace(
            self,
            # far outside the measured speeds the straight line may cross zero: a machine does not
            omega_n=np.sqrt(np.maximum(squares, 1e-6 * np.min(self.omega_n) ** 2)),
            psi=turn.T @ self.psi,
            factor=lower_factor(turn.T @ self.factor),
            places=turn.T @ self.places,
            softening=_none(),
            warming=_none(),
            standstill=np.zeros(0),
            skew=turn.T @ self.skew @ turn if self.skew.size else self.skew,
            pull=turn.T @ self.pull if self.pull.size else self.pull,
        )

    def selected(self, modes: np.ndarray) -> ModalParameters:
        """Return the machine with some of its modes (places or a mask), in the given order, their damping as it was."""
        block = np.ix_(modes, modes)
        return replace(
            self,
            omega_n=self.omega_n[modes],
            psi=self.psi[modes],
            factor=lower_factor(self.factor[modes]),
            places=self.places[modes],
            softening=self.softening[block] if self.softening.size else self.softening,
            warming=self.warming[block] if self.warming.size else self.warming,
            skew=self.skew[block] if self.skew.size else self.skew,
            pull=self.pull[modes] if self.pull.size else self.pull,
        )

    def without_mode(self, mode: int) -> ModalParameters:
        """Return the machine with one mode taken out, the others' damping as it was."""
        return self.selected(np.flatnonzero(np.arange(self.order) != mode))

    def with_mode(self, omega_n: float, psi: FloatArray | tuple[float, ...], zeta: float = 0.05) -> ModalParameters:
        """Return the machine with one more mode in front, uncoupled to the others, which moves neither other places nor the housing.

        `omega_n` [rad/s]; `psi` [1/sqrt(kg)], shape (d,)
        `zeta` [-]: damping ratio
        """
        factor = np.pad(self.factor, ((1, 0), (1, 0)))
        factor[0, 0] = np.sqrt(2.0 * zeta * omega_n)
        return replace(
            self,
            omega_n=np.append(omega_n, self.omega_n),
            psi=np.concatenate([[psi], self.psi]),
            factor=factor,
            places=np.pad(self.places, ((1, 0), (0, 0))),
            softening=np.pad(self.softening, ((1, 0), (1, 0))) if self.softening.size else self.softening,
            warming=np.pad(self.warming, ((1, 0), (1, 0))) if self.warming.size else self.warming,
            skew=np.pad(self.skew, ((1, 0), (1, 0))) if self.skew.size else self.skew,
            # a spindle without a mode has no pull to tell from one that is not asked for
            pull=np.pad(self.pull, ((1, 0), (0, 0))) if self.pull.shape[1] else self.pull,
        )


def flange_of(omega_n: FloatArray, psi: FloatArray, factor: FloatArray, residual: FloatArray) -> ModalParameters:
    """Return a machine whose only output is the flange and which does not change with speed; arrays as in `ModalParameters`."""
    return ModalParameters(omega_n, psi, factor, residual, np.zeros((omega_n.size, 0)), np.zeros((0, psi.shape[1])))


def side_by_side(x: ModalParameters, y: ModalParameters) -> ModalParameters:
    """Return two planes that feel nothing of each other as one machine, the modes of X first; of other places the first one of each."""
    both = bool(x.places.size and y.places.size)
    return ModalParameters(
        np.concatenate([x.omega_n, y.omega_n]),
        _apart(x.psi, y.psi),
        _apart(x.factor, y.factor),
        _apart(x.residual, y.residual),
        _apart(x.places[:, :both], y.places[:, :both]),
        _apart(x.place_residual[:both], y.place_residual[:both]),
        _apart(x.softening, y.softening) if x.softening.size else _none(),
    )


def _apart(x: FloatArray, y: FloatArray) -> FloatArray:
    """[[x, 0], [0, y]]."""
    rows, columns = x.shape
    found = np.zeros((rows + y.shape[0], columns + y.shape[1]))
    found[:rows, :columns], found[rows:, columns:] = x, y
    return found


def residual_turn(factor: FloatArray) -> FloatArray:
    """Return the change of R = factor factor^T, its upper triangle by rows, with the factor's lower triangle by rows, shape (r, r)."""
    size = factor.shape[0] * (factor.shape[0] + 1) // 2
    return (_turn_by_entry(factor.shape[0]) @ factor.ravel()).reshape(size, size)


@lru_cache
def _turn_by_entry(size: int) -> FloatArray:
    """What each entry of the factor, shape (size^2,), gives to `residual_turn`, shape (r^2, size^2)."""
    entries = np.eye(size**2).reshape(-1, size, size)
    rows, cols = np.tril_indices(size)
    change = np.zeros((entries.shape[0], rows.size, size, size))
    change[:, np.arange(rows.size), rows] = entries[:, :, cols].transpose(0, 2, 1)
    change += change.transpose(0, 1, 3, 2)
    return frozen(change[:, :, *np.triu_indices(size)].transpose(2, 1, 0).reshape(-1, size**2))


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


def flange_modes(machine: ModalParameters, dof: Dof) -> ModalModel:
    """Return a plane as complex modes at the flange ([inprocess], eq. 13), in SI, sorted by frequency."""
    lever = np.array([1.0, 1.0 / LEVER])
    residual = machine.residual @ machine.residual.T * np.outer(lever, lever)
    return damped_modes(machine.omega_n, machine.factor @ machine.factor.T, machine.psi * lever, residual, plane("flange", dof))
