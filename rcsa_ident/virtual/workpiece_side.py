"""What gives way on the workpiece's side of the cut: modes of the table, moved by the force that the tool gets back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.virtual.reduction import Poles

#: Point of the poles that moves with the workpiece.
WORKPIECE = "workpiece"
#: What its accelerometers may be fixed to.
ROLES = ("table", "workpiece")


@dataclass(frozen=True, slots=True)
class SideMode:
    """A spring, a mass and a damper under the workpiece.

    `natural_frequency` [rad/s]: undamped
    `damping_ratio` [-]: below 1
    `stiffness` [N/m]
    """

    natural_frequency: float
    damping_ratio: float
    stiffness: float

    def __post_init__(self) -> None:
        positive("natural_frequency", self.natural_frequency, "rad/s")
        positive("stiffness", self.stiffness, "N/m")
        if not 0.0 < self.damping_ratio < 1.0:
            raise InputError("damping_ratio", self.damping_ratio, "above 0 and below 1")


@dataclass(frozen=True, slots=True)
class VirtualWorkpieceSide:
    """Modes of the workpiece's side along each machine axis; X and Y feel nothing of each other.

    `x`, `y`: None where it is rigid
    `role`: what the pair of accelerometers is fixed to, ``table`` or ``workpiece``; it moves with the workpiece all the same
    """

    x: tuple[SideMode, ...]
    y: tuple[SideMode, ...]
    role: str = "table"

    def __post_init__(self) -> None:
        if self.role not in ROLES:
            raise InputError("workpiece_side.role", self.role, f"one of {', '.join(ROLES)}")

    def receptance(self, omega: FloatArray) -> ComplexArray:
        """Return what the workpiece gives way under a force on it: the sum of 1 / k_n / (1 - r_n^2 + 2 i zeta_n r_n), r_n = w / w_n.

        `omega` [rad/s], shape (n,)
        Returns a complex array of shape (n, 2, 2) [m/N]: motion in X and Y, then force in X and Y.
        """
        found = np.zeros((np.size(omega), 2, 2), dtype=complex)
        for i, modes in enumerate((self.x, self.y)):
            for mode in modes:
                ratio = np.asarray(omega) / mode.natural_frequency
                found[:, i, i] += 1.0 / mode.stiffness / (1.0 - ratio**2 + 2j * mode.damping_ratio * ratio)
        return found

    def under(self, machine: Poles) -> Poles:
        """Return the machine with the workpiece's side: ``tip`` is then the tool's motion relative to the workpiece, which is what a chip
        feels, and ``workpiece`` moves as the reaction of the force on the tool moves it.

        `machine`: with inputs ``tip.x``, ``tip.y``
        """
        axes = [i for i, modes in enumerate((self.x, self.y)) for _ in modes]
        modes = (*self.x, *self.y)
        zeta = np.array([mode.damping_ratio for mode in modes])
        natural = np.array([mode.natural_frequency for mode in modes])
        damped = natural * np.sqrt(1.0 - zeta**2)
        inputs = np.zeros((len(modes), 2), dtype=complex)
        inputs[np.arange(len(modes)), axes] = 1.0
        # of 1 / m / ((s - pole)(s - conj pole)), m = k / omega_n^2
        gives_way = inputs.T * (natural**2 / (2j * damped * np.array([mode.stiffness for mode in modes])))
        outputs = np.zeros((len(machine.coordinates), len(modes)), dtype=complex)
        names = [str(c) for c in machine.coordinates]
        outputs[[names.index("tip.x"), names.index("tip.y")]] = gives_way
        still = np.zeros((2, machine.pole.size), dtype=complex)
        return Poles(
            np.concatenate([machine.pole, -zeta * natural + 1j * damped]),
            np.concatenate([machine.inputs, inputs]),
            np.block([[machine.outputs, outputs], [still, -gives_way]]),
            (*machine.coordinates, Coordinate(WORKPIECE, Dof.X), Coordinate(WORKPIECE, Dof.Y)),
        )
