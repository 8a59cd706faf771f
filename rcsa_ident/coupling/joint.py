"""The lumped joint between holder and spindle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import non_negative, positive
from rcsa_ident.dynamics.coordinates import Dof


@dataclass(frozen=True, slots=True)
class LumpedJoint:
    """Springs and dampers in translation and rotation ([inprocess], eq. 11).

    Parameters
    ----------
    translational_stiffness : float [N/m]
    rotational_stiffness : float [N m/rad]
    translational_damping : float [N s/m]
    rotational_damping : float [N m s/rad]

    Examples
    --------
    >>> joint = LumpedJoint(translational_stiffness=5e8, rotational_stiffness=2e6)
    >>> joint.compliance_along([0.0], [Dof.X, Dof.SLOPE_X]).real.tolist()
    [[2e-09, 5e-07]]
    """

    translational_stiffness: float
    rotational_stiffness: float
    translational_damping: float = 0.0
    rotational_damping: float = 0.0

    def __post_init__(self) -> None:
        positive("joint translational_stiffness", self.translational_stiffness, "N/m")
        positive("joint rotational_stiffness", self.rotational_stiffness, "N m/rad")
        non_negative("joint translational_damping", self.translational_damping, "N s/m")
        non_negative("joint rotational_damping", self.rotational_damping, "N m s/rad")

    def compliance_along(self, omega: FloatArray, directions: Sequence[Dof]) -> ComplexArray:
        """Return the diagonal of K(omega)^-1 over the given directions, shape (n, d) [m/N, rad/(N m)]."""
        omega = np.asarray(omega, dtype=float)
        translation = 1.0 / (self.translational_stiffness + 1j * omega * self.translational_damping)
        slope = 1.0 / (self.rotational_stiffness + 1j * omega * self.rotational_damping)
        return np.stack([slope if dof.is_slope else translation for dof in directions], axis=1)
