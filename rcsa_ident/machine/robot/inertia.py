"""What moves a robot: mass matrix, torques of a motion, gravity, and the motion that torques make."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.machine.robot import _kernels
from rcsa_ident.machine.robot.kinematics import PosedChain, posed
from rcsa_ident.machine.robot.model import RobotModel


def mass_matrix(chain: PosedChain) -> FloatArray:
    """Return the mass matrix over all freedoms, shape (n, n) [kg m^2]."""
    n = chain.origin.shape[0]
    out = np.empty((n, n))
    own = chain.chain
    _kernels.mass_matrix(chain.rotation, chain.origin, chain.direction, own.mass, own.centre, own.inertia, out)
    return out


def torques(chain: PosedChain, rate: FloatArray, acceleration: FloatArray, gravity: FloatArray) -> FloatArray:
    """Return the torques of a motion, M q'' + c(q, q') + g(q), shape (n,) [N m].

    `rate`, `acceleration` [rad/s, rad/s^2], shape (n,); `gravity` [m/s^2], shape (3,)
    """
    own, out = chain.chain, np.empty(chain.origin.shape[0])
    spin, gain, fall = (np.asarray(each, dtype=float) for each in (rate, acceleration, gravity))
    posture = chain.rotation, chain.origin, chain.direction
    _kernels.inverse_dynamics(*posture, own.mass, own.centre, own.inertia, spin, gain, fall, out)
    return out


def gravity_torques(robot: RobotModel, angles: FloatArray, tilts: bool = False, payload: bool = True) -> FloatArray:
    """Return the torques that hold the arm against its weight, shape (n,) [N m]."""
    chain = posed(robot, angles, tilts, payload)
    still = np.zeros(chain.origin.shape[0])
    return torques(chain, still, still, robot.gravity)


def accelerations(chain: PosedChain, rate: FloatArray, torque: FloatArray, gravity: FloatArray) -> FloatArray:
    """Return what torques (n,) [N m] at the freedoms accelerate, shape (n,) [rad/s^2]."""
    right = np.asarray(torque, dtype=float) - torques(chain, rate, np.zeros(chain.origin.shape[0]), gravity)
    matrix = mass_matrix(chain)
    _kernels.solve_symmetric(matrix, right)
    return right
