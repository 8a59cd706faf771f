"""A robot's unknowns as one vector, and the vector as physics.

log stiffness (n) and log damping (n) of all the arm's freedoms; then the spindle in its hand, as modes of shaft and bearings in a housing
that is held: log natural frequencies (m); shapes at the flange (4 m: translation and lever x slope in X, then in Y); what a motion of the
housing pulls each mode with (4 m, the same directions); the lower triangle of the damping factor L by rows (diagonal as logarithm); the
lower triangle of the residual compliance's factor (10). Behind them stands what `parameters.Layout` has there: the joint's four logarithms,
the forces' coefficients, the clampings' tooth angles. Masses and lengths of the arm and of its whole payload are known.

The housing's mass is the hand's; a mode whose pull is P takes P P^T of the payload's mass with it when the housing moves slowly. So the
same few modes hold at every posture, whatever the wrist weighs there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.identification.parameters import DAMPING_UNIT, RESIDUAL_UNIT, Unknowns, lower_triangle

#: Directions of the flange in which the spindle's modes move: translation and slope in X, then in Y.
DIRECTIONS = 4
_RESIDUAL = DIRECTIONS * (DIRECTIONS + 1) // 2


@dataclass(frozen=True)
class PosedLayout(Unknowns):
    """Which unknown of a robot stands where in the vector.

    Parameters
    ----------
    freedoms : int
        Of the arm, joints and tilts.
    modes : int
        Of the spindle.
    coefficients, clampings : int
        As in `parameters.Layout`.
    """

    freedoms: int
    modes: int = 0
    coefficients: int = 0
    clampings: int = 0

    @property
    def tail(self) -> int:
        """Place in the vector at which begins what is not the machine's."""
        return self.factor.stop + _RESIDUAL

    @property
    def modes_of_axes(self) -> tuple[int, ...]:
        """The spindle's modes may be exchanged with each other."""
        return (self.modes,)

    def axis(self, i: int) -> slice:
        """Return what an axis' lines depend on: the whole machine."""
        del i
        return slice(0, self.tail)

    @property
    def stiffness(self) -> slice:
        """Places of the logarithms of the arm's stiffnesses."""
        return slice(0, self.freedoms)

    @property
    def damping(self) -> slice:
        """Places of the logarithms of the arm's dampers."""
        return slice(self.freedoms, 2 * self.freedoms)

    @property
    def frequencies(self) -> slice:
        """Places of the logarithms of the spindle's natural frequencies."""
        return slice(2 * self.freedoms, 2 * self.freedoms + self.modes)

    @property
    def shapes(self) -> slice:
        """Places of its shapes."""
        return slice(self.frequencies.stop, self.frequencies.stop + DIRECTIONS * self.modes)

    @property
    def pulls(self) -> slice:
        """Places of what the housing's motion pulls its modes with."""
        return slice(self.shapes.stop, self.shapes.stop + DIRECTIONS * self.modes)

    @property
    def factor(self) -> slice:
        """Places of its damping factor's lower triangle."""
        return slice(self.pulls.stop, self.pulls.stop + self.modes * (self.modes + 1) // 2)

    @property
    def residual(self) -> slice:
        """Places of the residual compliance's factor."""
        return slice(self.factor.stop, self.tail)


@dataclass(frozen=True, slots=True, eq=False)
class SpindleParameters:
    """A spindle on a held housing in scaled units, as the kernel takes it.

    Parameters
    ----------
    omega_n : array, shape (m,) [rad/s]
    psi : array, shape (m, 4) [1/sqrt(kg)]
    pull : array, shape (m, 4) [sqrt(kg)]
    factor : array, shape (m, m) [sqrt(rad/s)]
        L of the damping matrix D = L L^T in modal coordinates.
    residual : array, shape (4, 4) [sqrt(m/N)]
    """

    omega_n: FloatArray
    psi: FloatArray
    pull: FloatArray
    factor: FloatArray
    residual: FloatArray

    @property
    def order(self) -> int:
        """Number of modes."""
        return self.omega_n.size

    def of(self, modes: np.ndarray) -> SpindleParameters:
        """Return the spindle with some of its modes (a mask or indices), their damping as it was."""
        own = self.factor[modes]
        factor = np.linalg.cholesky(own @ own.T) if own.size else np.zeros((0, 0))
        return SpindleParameters(self.omega_n[modes], self.psi[modes], self.pull[modes], factor, self.residual)

    def with_mode(self, omega_n: float, psi: FloatArray, zeta: float) -> SpindleParameters:
        """Return the spindle with one more mode in front, uncoupled to the others, which the housing does not pull.

        Parameters
        ----------
        omega_n : float [rad/s]
        psi : array, shape (4,) [1/sqrt(kg)]
        zeta : float [-]
            Damping ratio.
        """
        factor = np.zeros((self.order + 1,) * 2)
        factor[0, 0], factor[1:, 1:] = np.sqrt(2.0 * zeta * omega_n), self.factor
        pull = np.concatenate([np.zeros((1, DIRECTIONS)), self.pull])
        return SpindleParameters(np.append(omega_n, self.omega_n), np.concatenate([psi[None], self.psi]), pull, factor, self.residual)


@dataclass(frozen=True, slots=True, eq=False)
class PosedParameters:
    """A robot in physical units.

    Parameters
    ----------
    stiffness, damping : arrays, shape (n,) [N m/rad], [N m s/rad]
    spindle : SpindleParameters
    """

    stiffness: FloatArray
    damping: FloatArray
    spindle: SpindleParameters


def unpack(theta: FloatArray, layout: PosedLayout) -> PosedParameters:
    """Return the physics of a vector."""
    m = layout.modes
    rows, cols, diagonal = lower_triangle(m)
    lower = DAMPING_UNIT * theta[layout.factor]
    lower[diagonal] = DAMPING_UNIT * np.exp(theta[layout.factor][diagonal])
    factor, residual = np.zeros((m, m)), np.zeros((DIRECTIONS, DIRECTIONS))
    factor[rows, cols] = lower
    residual[np.tril_indices(DIRECTIONS)] = RESIDUAL_UNIT * theta[layout.residual]
    shapes, pulls = (theta[part].reshape(m, DIRECTIONS) for part in (layout.shapes, layout.pulls))
    spindle = SpindleParameters(np.exp(theta[layout.frequencies]), shapes, pulls, factor, residual)
    return PosedParameters(np.exp(theta[layout.stiffness]), np.exp(theta[layout.damping]), spindle)


def pack(robot: PosedParameters) -> FloatArray:
    """Return the machine's own part of the vector; the inverse of `unpack`."""
    spindle = robot.spindle
    rows, cols, diagonal = lower_triangle(spindle.order)
    lower = spindle.factor[rows, cols] / DAMPING_UNIT
    lower = np.where(diagonal, np.log(np.where(diagonal, np.abs(lower), 1.0)), lower)
    residual = spindle.residual[np.tril_indices(DIRECTIONS)] / RESIDUAL_UNIT
    own = np.log(spindle.omega_n), spindle.psi.ravel(), spindle.pull.ravel(), lower, residual
    return np.concatenate([np.log(robot.stiffness), np.log(robot.damping), *own])


def chain(robot: PosedParameters) -> FloatArray:
    """Return d physics / d vector for each entry, in the vector's order."""
    spindle = robot.spindle
    rows, cols, diagonal = lower_triangle(spindle.order)
    factor = np.where(diagonal, spindle.factor[rows, cols], DAMPING_UNIT)
    own = np.ones((1 + 2 * DIRECTIONS) * spindle.order), factor, np.full(_RESIDUAL, RESIDUAL_UNIT)
    return np.concatenate([robot.stiffness, robot.damping, *own])
