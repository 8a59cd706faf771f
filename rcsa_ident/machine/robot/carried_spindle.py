"""A spindle in a robot's hand: shaft and bearings as modes of a housing that is held, which the hand's motion pulls along [craig1968].

With u the hand's motion, eta the modes and f a force at the flange: eta'' + D eta' + W^2 eta = psi f - P u'', and the hand feels -P^T eta''
beside its payload's own inertia; the flange moves by u + psi^T eta.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.structure import Structure

#: Directions in which its modes move: translation and slope in X, then in Y.
_BENDING = 4


@dataclass(frozen=True, slots=True, eq=False)
class CarriedSpindle:
    """Modes of a spindle whose housing is held.

    The housing's mass, and the shaft's as if it were rigid, are the payload's. The modes are the same at every posture: what the wrist
    weighs there comes in by the pull.

    `omega_n` [rad/s], shape (m,)
    `damping` [rad/s], shape (m, m): in modal coordinates, symmetric
    `psi`: array, shape (m, 4) [1/sqrt(kg)], [1/(m sqrt(kg))]; mass-normalised shapes at the flange, against the housing: translation and
        slope in X, then in Y
    `pull`: array, shape (m, 4) [sqrt(kg)], [m sqrt(kg)]; psi^T M of a unit motion of the whole spindle in these directions: its squares sum
        up to the mass that can swing
    `residual`: array, shape (4, 4) [m/N], [rad/N], [rad/(N m)]; compliance of all higher modes, symmetric

    Examples
    --------
    A shaft of 4 kg that swings as a whole on its bearings, 400 Hz:

    >>> one = np.array([[1.0, 0.0, 0.0, 0.0]])
    >>> spindle = CarriedSpindle([800.0 * np.pi], [[50.0]], 0.5 * one, 2.0 * one, np.zeros((4, 4)))
    >>> float(spindle.mass_along(0))
    4.0
    """

    omega_n: FloatArray
    damping: FloatArray
    psi: FloatArray
    pull: FloatArray
    residual: FloatArray

    def __post_init__(self) -> None:
        for name in ("omega_n", "damping", "psi", "pull", "residual"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        m = self.omega_n.size
        shapes = {"damping": (m, m), "psi": (m, _BENDING), "pull": (m, _BENDING), "residual": (_BENDING, _BENDING)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise InputError(f"spindle {name}", getattr(self, name).shape, f"shape {shape} for {m} modes")

    def mass_along(self, direction: int) -> float:
        """Return how much swings when the housing moves in one of the four directions [kg or kg m^2]."""
        return float(np.sum(self.pull[:, direction] ** 2))

    def turned(self, turn: float) -> CarriedSpindle:
        """Return the same in axes of which x is the tool's, turned about the tool's axis by an angle [rad] (`FlexibleRobot.at`)."""
        c, s = np.cos(turn), np.sin(turn)
        into = np.kron([[c, -s], [s, c]], np.eye(2))
        return CarriedSpindle(self.omega_n, self.damping, self.psi @ into.T, self.pull @ into.T, into @ self.residual @ into.T)

    def on(self, arm: Structure) -> Structure:
        """Return arm and spindle as one structure over the arm's six directions; without the residual.

        `arm`: over six directions where the tool-holder sits, the bending ones first
        Raises `InputError` if the modes would swing more mass than the hand carries.
        """
        hand = arm.ports
        n, m = hand.shape[0], self.omega_n.size
        across = hand[:, :_BENDING] @ self.pull.T
        mass = np.block([[arm.mass, across], [across.T, np.eye(m)]])
        rest = np.linalg.eigvalsh(arm.mass - across @ across.T)
        if rest[0] <= 0.0:
            told = f"modes that swing {self.mass_along(0):.3g} kg in X and {self.mass_along(2):.3g} kg in Y"
            raise InputError("spindle", told, "less than what the hand carries, its housing left aside")
        stiffness = scipy.linalg.block_diag(arm.stiffness, np.diag(self.omega_n**2))
        damping = scipy.linalg.block_diag(arm.damping, self.damping)
        shapes = np.concatenate([hand, np.pad(self.psi, ((0, 0), (0, hand.shape[1] - _BENDING)))])
        return Structure(mass, damping, stiffness, np.zeros((n + m, n + m)), arm.coordinates, shapes=shapes)
