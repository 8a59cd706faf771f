"""What the posterior says about a derived quantity: linear propagation of the unknowns' covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.errors import InputError
from rcsa_ident.identification.parameters import axis_size, joint_of, modes_of, unpack
from rcsa_ident.machine.spindle import Spindle


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Unknowns of one axis and the joint with their covariance.

    Parameters
    ----------
    theta : array, shape (p,)
    covariance : array, shape (p, p)
    """

    theta: FloatArray
    covariance: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "theta", frozen(self.theta))
        object.__setattr__(self, "covariance", frozen(self.covariance))
        if self.covariance.shape != (self.theta.size,) * 2:
            raise InputError("covariance", self.covariance.shape, f"a square matrix for {self.theta.size} unknowns")

    @property
    def order(self) -> int:
        """Number of modes that the unknowns describe."""
        for m in range(1, 200):
            if axis_size(m) + 4 == self.theta.size:
                return m
        raise InputError("unknowns", self.theta.size, "a number that belongs to a whole number of modes")

    def machine(self, axis: Dof, theta: FloatArray | None = None) -> tuple[ModalModel, LumpedJoint]:
        """Return modes and joint at `theta`, by default at the optimum."""
        vector = self.theta if theta is None else theta
        return modes_of(unpack(vector[:-4], self.order), axis), joint_of(vector[-4:])


@dataclass(frozen=True, slots=True)
class MachineAxis:
    """One axis of an identified machine.

    Parameters
    ----------
    spindle : Spindle
    joint : LumpedJoint
    posterior : Posterior or None
        Where the identification gave one.
    """

    spindle: Spindle
    joint: LumpedJoint
    posterior: Posterior | None = None


def spread(posterior: Posterior, axis: Dof, response: Callable[[ModalModel, LumpedJoint], ComplexArray]) -> ComplexArray:
    """Return the response's change per standard deviation along each of the covariance's own axes, shape (p, n).

    Sums of its rows with independent standard normal weights are draws of the linearised response.

    Parameters
    ----------
    response : callable
        Modes and joint to a complex array, shape (n,).
    """
    values, vectors = np.linalg.eigh(posterior.covariance)
    slopes = []
    for size, direction in zip(np.sqrt(np.maximum(values, 0.0)), vectors.T, strict=True):
        # stiff directions take a full deviation, loose ones a step that stays linear
        step = min(size, 0.05)
        if step == 0.0:
            continue
        ahead = response(*posterior.machine(axis, posterior.theta + step * direction))
        behind = response(*posterior.machine(axis, posterior.theta - step * direction))
        slopes.append((ahead - behind) / (2.0 * step) * size)
    return np.array(slopes) if slopes else np.zeros((1, response(*posterior.machine(axis)).size), dtype=complex)
