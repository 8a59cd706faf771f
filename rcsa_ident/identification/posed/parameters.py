"""A robot's unknowns as one vector: log stiffness (n) and log damping (n) of all its freedoms, then the spindle's own part.

The spindle's part is that of `coupled.parameters`, of modes that do not change with speed or posture; behind it stands what
`parameters.Layout` has there: the joint's four logarithms, the forces' coefficients, the clampings' tooth angles. Masses and lengths of the
arm are known. With springs and dampers above zero, D = L L^T and R = R_f R_f^T, every vector is a passive machine at every posture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.identification.coupled.parameters import CoupledLayout, CoupledParameters, pack, unpack
from rcsa_ident.identification.parameters import Unknowns


@dataclass(frozen=True)
class PosedLayout(Unknowns):
    """Which unknown of a robot stands where in the vector.

    Parameters
    ----------
    freedoms : int
        Of the arm, joints and tilts.
    spindle : CoupledLayout
        Modes and fixture; no softening, no skew. Its coefficients and clampings are the vector's.
    """

    freedoms: int
    spindle: CoupledLayout

    @property
    def coefficients(self) -> int:
        """Cutting coefficients whose scale is unknown."""
        return self.spindle.coefficients

    @property
    def clampings(self) -> int:
        """Clampings whose tooth angle at the trigger's edge is unknown."""
        return self.spindle.clampings

    @property
    def tail(self) -> int:
        """Place in the vector at which begins what is not the machine's."""
        return 2 * self.freedoms + self.spindle.tail

    @property
    def modes_of_axes(self) -> tuple[int, ...]:
        """The spindle's modes may be exchanged with each other."""
        return self.spindle.modes_of_axes

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
    def own(self) -> slice:
        """Places of the spindle's own part."""
        return slice(2 * self.freedoms, self.tail)

    @property
    def machine(self) -> np.ndarray:
        """Places of all that describes the flange: without the fixture, the forces and the tooth angles, but with the joint."""
        core = np.arange(2 * self.freedoms + self.spindle.core)
        return np.concatenate([core, np.arange(self.joint.start, self.joint.stop)])


@dataclass(frozen=True, slots=True, eq=False)
class PosedParameters:
    """A robot in physical units.

    Parameters
    ----------
    stiffness, damping : arrays, shape (n,) [N m/rad], [N m s/rad]
    spindle : CoupledParameters
    """

    stiffness: FloatArray
    damping: FloatArray
    spindle: CoupledParameters


def unpack_robot(theta: FloatArray, layout: PosedLayout) -> PosedParameters:
    """Return the physics of a vector."""
    own = unpack(theta[layout.own], layout.spindle)
    return PosedParameters(np.exp(theta[layout.stiffness]), np.exp(theta[layout.damping]), own)


def pack_robot(robot: PosedParameters, layout: PosedLayout) -> FloatArray:
    """Return the machine's own part of the vector; the inverse of `unpack_robot`."""
    return np.concatenate([np.log(robot.stiffness), np.log(robot.damping), pack(robot.spindle, layout.spindle)])
