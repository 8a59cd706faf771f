"""A robot at a posture as a structure: six directions where the tool-holder sits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.structure import Structure
from rcsa_ident.machine.mode_synthesis import WHOLE_FLANGE
from rcsa_ident.machine.robot.inertia import mass_matrix
from rcsa_ident.machine.robot.kinematics import PosedChain, posed
from rcsa_ident.machine.robot.model import Frame, RobotModel

#: From a robot's tool axes, z out of the spindle, to the spindle's, z from the tip into it.
_INTO_SPINDLE = np.diag([1.0, -1.0, -1.0])
#: Translations and turns (x, y, z each) as the spindle's directions, in the order of `WHOLE_FLANGE`: a slope in X is a turn about y, one in
#: Y a turn about -x.
_DIRECTIONS = np.zeros((6, 6))
for _row, (_turn, _sign) in enumerate([(0, 1.0), (4, 1.0), (1, 1.0), (3, -1.0), (2, 1.0), (5, 1.0)]):
    _DIRECTIONS[_row, _turn] = _sign


@dataclass(frozen=True, slots=True, eq=False)
class FlexibleRobot:
    """A robot whose joints give way, about a posture that its drives hold.

    Parameters
    ----------
    model : RobotModel
    tilts : bool
        With the springs across the joints' axes; without them only the drives give way.

    Examples
    --------
    One joint that turns a rod about the base's z; where its tool sits, 1 m out along x, it moves along y:

    >>> import rcsa_ident.machine.robot.model as m
    >>> rod = m.Body(10.0, np.array([1.0, 0.0, 0.0]), 0.1 * np.eye(3))
    >>> joint = m.Joint("J1", m.Frame(), np.array([0.0, 0.0, 1.0]), rod, stiffness=1e6)
    >>> robot = FlexibleRobot(m.RobotModel("one", (joint,), flange=m.Frame(offset=np.array([1.0, 0.0, 0.0]))))
    >>> still = robot.at([0.0]).receptance(np.array([1e-3]))
    >>> float(still.between("flange.y", "flange.y")[0].real.round(9))
    1e-06
    """

    model: RobotModel
    tilts: bool = True

    def at(self, posture: FloatArray, turn: float = 0.0) -> Structure:
        """Return the structure over six directions where the tool-holder sits, M(q), C and K of all freedoms.

        Parameters
        ----------
        posture : array, shape (j,) [rad]
        turn : float [rad]
            Of the feed from the tool's x, about the tool's axis: the spindle's x is the feed then.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> import numpy as np
        >>> robot = ri.FlexibleRobot(ri.sample_robot("tx200"))
        >>> structure = robot.at(np.radians([0.0, 20.0, 100.0, 0.0, 60.0, 0.0]))
        >>> [str(each) for each in structure.coordinates]
        ['flange.x', "flange.x'", 'flange.y', "flange.y'", 'flange.z', "flange.z'"]
        """
        chain = posed(self.model, posture, self.tilts)
        tool = chain.flange.then(self.model.tool_point).then(Frame(_about_z(turn)))
        return _structure(chain, tool.offset, tool.turn @ _INTO_SPINDLE)

    def bare(self, posture: FloatArray) -> Structure:
        """Return the structure at the robot's own flange, in the base's axes, nothing hanging on it."""
        chain = posed(self.model, posture, self.tilts, payload=False)
        return _structure(chain, chain.flange.offset, np.eye(3))


def modes_of(structure: Structure) -> tuple[FloatArray, FloatArray]:
    """Return undamped natural frequencies, ascending [rad/s], and the damping ratio of each, shape (n,) both.

    The ratio is phi^T C phi / (2 omega): what of the damping stays within the mode.
    """
    squares, shapes = scipy.linalg.eigh(structure.stiffness, structure.mass)
    omega = np.sqrt(squares)
    return omega, np.einsum("im,ij,jm->m", shapes, structure.damping, shapes) / (2.0 * omega)


def _structure(chain: PosedChain, point: FloatArray, axes: FloatArray) -> Structure:
    if chain.chain.mass[-1] <= 0.0:
        raise InputError("link masses", "nothing", "mass, centre and inertia of the links: without them nothing vibrates")
    motion = chain.jacobian(point)
    seen = _DIRECTIONS @ np.concatenate([axes.T @ motion[:3], axes.T @ motion[3:]])
    mass = mass_matrix(chain)
    damping, stiffness = np.diag(chain.chain.damping), np.diag(chain.chain.stiffness)
    return Structure(mass, damping, stiffness, np.zeros_like(mass), WHOLE_FLANGE, shapes=seen.T)


def _about_z(turn: float) -> FloatArray:
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
