"""A robot's unknowns as one vector, and the vector as physics.

Compliance over the data sheet's (n) and log damping (n) of all the arm's freedoms; logarithms of the masses of links and payload over the
data sheet's (b), with which their inertia goes; then the spindle in its hand, as modes of shaft and bearings in a housing that is held: log
natural frequencies (m); shapes at the flange (4 m: translation and lever x slope in X, then in Y); what a motion of the housing pulls each
mode with (4 m, the same directions); the lower triangle of the damping factor L by rows (diagonal as logarithm); the lower triangle of the
residual compliance's factor (10). Behind them stands what `parameters.Layout` has there: the joint's four logarithms, the forces'
coefficients, the clampings' tooth angles. Lengths of the arm are known.

Springs behind each other, about axes that coincide, show their sum alone: compliances add up, so that what is known of both stays a plane.
They keep above nothing by u = log(1 + e^{a t}) / a, the share of an unknown t that is one where it is large.

The housing's mass is the hand's; a mode whose pull is P takes P P^T of the payload's mass with it when the housing moves slowly. So the
same few modes hold at every posture, whatever the wrist weighs there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.parameters import DAMPING_UNIT, RESIDUAL_UNIT, Unknowns, lower_triangle

#: Directions of the flange in which the spindle's modes move: translation and slope in X, then in Y.
DIRECTIONS = 4
#: a of the compliances' unknowns: from a third of the data sheet's compliance on they go together.
SHARPNESS = 3.0
_RESIDUAL = DIRECTIONS * (DIRECTIONS + 1) // 2


@dataclass(frozen=True)
class PosedLayout(Unknowns):
    """Which unknown of a robot stands where in the vector.

    Parameters
    ----------
    springs : tuple of float, length n [N m/rad]
        The data sheet's stiffness of the arm's freedoms, joints and tilts.
    masses : int
        Of links and payload.
    modes : int
        Of the spindle.
    coefficients, clampings : int
        As in `parameters.Layout`.
    """

    springs: tuple[float, ...]
    masses: int
    modes: int = 0
    coefficients: int = 0
    clampings: int = 0

    @property
    def freedoms(self) -> int:
        """Of the arm."""
        return len(self.springs)

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
    def compliances(self) -> slice:
        """Places of the arm's compliances."""
        return slice(0, self.freedoms)

    @property
    def damping(self) -> slice:
        """Places of the logarithms of the arm's dampers."""
        return slice(self.freedoms, 2 * self.freedoms)

    @property
    def weights(self) -> slice:
        """Places of the logarithms of the masses' factors."""
        return slice(2 * self.freedoms, 2 * self.freedoms + self.masses)

    @property
    def frequencies(self) -> slice:
        """Places of the logarithms of the spindle's natural frequencies."""
        return slice(self.weights.stop, self.weights.stop + self.modes)

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

    @property
    def machine(self) -> slice:
        """Places of all but forces and tooth angles."""
        return slice(0, self.joint.stop)


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
    heavier : array, shape (b,) [-]
        Masses over those of the data sheet.
    spindle : SpindleParameters
    """

    stiffness: FloatArray
    damping: FloatArray
    heavier: FloatArray
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
    stiffness = np.array(layout.springs) / share_of(theta[layout.compliances])
    return PosedParameters(stiffness, np.exp(theta[layout.damping]), np.exp(theta[layout.weights]), spindle)


def share_of(unknown: FloatArray) -> FloatArray:
    """Return compliances over the data sheet's, above 0, of unknowns of any sign."""
    return np.logaddexp(0.0, SHARPNESS * unknown) / SHARPNESS


def unknown_of(share: FloatArray) -> FloatArray:
    """Return the unknowns of such compliances; the inverse of `share_of`."""
    return share + np.log(-np.expm1(-SHARPNESS * share)) / SHARPNESS


def stiffening(theta: FloatArray, layout: PosedLayout) -> FloatArray:
    """Return the change of the logarithms of the stiffnesses with their unknowns, below 0, shape (n,)."""
    unknown = theta[layout.compliances]
    found: FloatArray = -1.0 / (1.0 + np.exp(-SHARPNESS * unknown)) / share_of(unknown)
    return found


def pack(robot: PosedParameters, layout: PosedLayout) -> FloatArray:
    """Return the machine's own part of the vector; the inverse of `unpack`."""
    spindle = robot.spindle
    rows, cols, diagonal = lower_triangle(spindle.order)
    lower = spindle.factor[rows, cols] / DAMPING_UNIT
    lower = np.where(diagonal, np.log(np.where(diagonal, np.abs(lower), 1.0)), lower)
    residual = spindle.residual[np.tril_indices(DIRECTIONS)] / RESIDUAL_UNIT
    own = np.log(spindle.omega_n), spindle.psi.ravel(), spindle.pull.ravel(), lower, residual
    compliance = unknown_of(np.array(layout.springs) / robot.stiffness)
    return np.concatenate([compliance, np.log(robot.damping), np.log(robot.heavier), *own])


def chain(robot: PosedParameters, theta: FloatArray, layout: PosedLayout) -> FloatArray:
    """Return d physics / d vector for each entry, in the vector's order."""
    spindle = robot.spindle
    rows, cols, diagonal = lower_triangle(spindle.order)
    factor = np.where(diagonal, spindle.factor[rows, cols], DAMPING_UNIT)
    own = np.ones((1 + 2 * DIRECTIONS) * spindle.order), factor, np.full(_RESIDUAL, RESIDUAL_UNIT)
    return np.concatenate([robot.stiffness * stiffening(theta, layout), robot.damping, robot.heavier, *own])
