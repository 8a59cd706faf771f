"""How what a robot does changes with its springs, dampers and masses: closed forms, to first order.

Springs and dampers stand on the diagonal, J the motion of the tool's place with each freedom, j_i its columns, M(q) linear in what the
bodies weigh:

    C = J K^-1 J^T                    dC/dk_i = -j_i j_i^T / k_i^2
    H = J Z^-1 J^T, Z = K + i w D - w^2 M, x = Z^-1 J^T
                                      dH/dk_i = -x_i x_i^T, dH/dd_i = -i w x_i x_i^T, dH/dm = w^2 x^T (dM/dm) x
    M phi w^2 = K phi, phi^T M phi = 1   dw/dk_i = phi_i^2 / (2 w), dw/dm = -(w / 2) phi^T (dM/dm) phi
    tau = Y(q, q', q'') pi            pi: mass, first moment and inertia about the frame's origin, body by body

Of a body that weighs more the centre stays, and its inertia grows with the mass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.machine.robot import _kernels
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.kinematics import PosedChain, posed
from rcsa_ident.machine.robot.model import Body, RobotModel


def compliance_slopes(robot: RobotModel, angles: FloatArray, tilts: bool = True) -> FloatArray:
    """Return the change of `static_compliance` with each stiffness, shape (n, 6, 6) [per N m/rad].

    `angles` [rad], shape (j,)
    `tilts`: with the springs across the joints' axes; n freedoms in the order of the chain
    """
    chain = posed(robot, angles, tilts)
    motion = chain.jacobian(chain.flange.point(robot.tool_point.offset)) / chain.chain.stiffness
    return -np.einsum("ai,bi->iab", motion, motion)


@dataclass(frozen=True, slots=True, eq=False)
class ReceptanceSlopes:
    """How a receptance changes, its directions as those of `FlexibleRobot.at`.

    `stiffness`, `damping`, shape (n, w, 6, 6): with each freedom's [per N m/rad, per N m s/rad]
    `mass`, shape (b, w, 6, 6): with the mass of each body [per kg]: links from the base on, then the payload where there is one
    """

    stiffness: ComplexArray
    damping: ComplexArray
    mass: ComplexArray


def receptance_slopes(robot: FlexibleRobot, angles: FloatArray, omega: FloatArray, turn: float = 0.0) -> ReceptanceSlopes:
    """Return the change of the receptance where the tool-holder sits.

    `angles` [rad], shape (j,); `omega` [rad/s], shape (w,)
    `turn` [rad]: as in `FlexibleRobot.at`
    """
    own, w = robot.at(angles, turn), np.asarray(omega, dtype=float)[:, None, None]
    dynamic = own.stiffness + 1j * w * own.damping - w**2 * own.mass
    x = np.linalg.solve(dynamic, np.broadcast_to(own.ports.astype(complex), (len(w), *own.ports.shape)))
    springs = -np.einsum("wia,wib->iwab", x, x)
    masses = np.array([w**2 * (x.transpose(0, 2, 1) @ each @ x) for each in mass_slopes(robot.model, angles, robot.tilts)])
    return ReceptanceSlopes(springs, 1j * w * springs, masses)


def mass_slopes(robot: RobotModel, angles: FloatArray, tilts: bool = True) -> FloatArray:
    """Return the change of the mass matrix with the mass of each body, shape (b, n, n) [m^2]: of the links, then of the payload."""
    chain = posed(robot, angles, tilts)
    n, last = chain.origin.shape[0], _carriers(chain)
    bodies = [(k, joint.body) for k, joint in zip(last, robot.joints, strict=True)]
    if robot.payload is not None:
        bodies.append((n - 1, robot.payload.seen_from(robot.flange)))
    found = np.empty((len(bodies), n, n))
    for (k, body), out in zip(bodies, found, strict=True):
        mass, centre, inertia = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3))
        mass[k], centre[k] = 1.0, body.centre
        if body.mass > 0.0:
            inertia[k] = body.inertia / body.mass
        _kernels.mass_matrix(chain.rotation, chain.origin, chain.direction, mass, centre, inertia, out)
    return found


def frequency_slopes(robot: FlexibleRobot, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the change of each undamped natural frequency with the stiffnesses and with the bodies' masses, shapes (m, n) and (m, b).

    By Rayleigh's quotient, frequencies rising as `modes_of` has them [rad/s per N m/rad, rad/s per kg]. Of two that are the same neither
    has a slope of its own.
    """
    own = robot.at(angles)
    squares, shapes = scipy.linalg.eigh(own.stiffness, own.mass)
    omega = np.sqrt(squares)[:, None]
    heavier = np.einsum("im,bij,jm->mb", shapes, mass_slopes(robot.model, angles, robot.tilts), shapes)
    return shapes.T**2 / (2.0 * omega), -0.5 * omega * heavier


def regressor(chain: PosedChain, rate: FloatArray, acceleration: FloatArray, gravity: FloatArray) -> FloatArray:
    """Return the matrix Y that gives the torques of a motion from what the bodies weigh, Y pi, shape (n, 10 j).

    Of each link, in its frame's axes, pi holds the mass, the first moment m c (x, y, z) and the inertia about the frame's origin (xx, yy,
    zz, xy, yz, zx, the tensor's own signs): `inertial_parameters`. What hangs on the flange is part of the last link.

    `rate`, `acceleration` [rad/s, rad/s^2], shape (n,); `gravity` [m/s^2], shape (3,)
    """
    n, last = chain.origin.shape[0], _carriers(chain)
    found = np.empty((n, 10 * last.size))
    spin, turning, rising, before = np.zeros(3), np.zeros(3), -np.asarray(gravity, dtype=float), np.zeros(3)
    link = 0
    for k in range(n):
        arm, axis = chain.origin[k] - before, chain.direction[k]
        rising = rising + np.cross(turning, arm) + np.cross(spin, np.cross(spin, arm))
        turning = turning + acceleration[k] * axis + rate[k] * np.cross(spin, axis)
        spin, before = spin + rate[k] * axis, chain.origin[k]
        if k == last[link]:
            found[:, 10 * link : 10 * link + 10] = _wrench_torques(chain, k, spin, turning, rising)
            link += 1
    return found


def inertial_parameters(bodies: tuple[Body, ...]) -> FloatArray:
    """Return pi of `regressor` for bodies, one a link, each in its link's axes, shape (10 j,)."""
    found = []
    for body in bodies:
        c = body.centre
        about = body.inertia + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
        found += [body.mass, *(body.mass * c), *np.diag(about), about[0, 1], about[1, 2], about[2, 0]]
    return np.array(found)


def _wrench_torques(chain: PosedChain, k: int, spin: FloatArray, turning: FloatArray, rising: FloatArray) -> FloatArray:
    """Torques (n, 10) that a body of frame k asks of the joints, per mass, first moment and inertia about the frame's origin."""
    axes = chain.rotation[k]
    # in the body's own axes, where its parameters stay
    w, a, g = axes.T @ spin, axes.T @ turning, axes.T @ rising
    swing = _skew(a) + _skew(w) @ _skew(w)
    wrench = np.zeros((6, 10))
    wrench[:3, 0], wrench[:3, 1:4], wrench[3:, 1:4] = g, swing, -_skew(g)
    wrench[3:, 4:] = _inertia_columns(a) + _skew(w) @ _inertia_columns(w)
    motion = chain.jacobian(chain.origin[k])
    # what comes behind the body does not move it
    motion[:, k + 1 :] = 0.0
    return motion[:3].T @ (axes @ wrench[:3]) + motion[3:].T @ (axes @ wrench[3:])


def _inertia_columns(v: FloatArray) -> FloatArray:
    """I v = columns times (xx, yy, zz, xy, yz, zx), shape (3, 6)."""
    x, y, z = v
    return np.array([[x, 0.0, 0.0, y, 0.0, z], [0.0, y, 0.0, x, z, 0.0], [0.0, 0.0, z, 0.0, y, x]])


def _skew(v: FloatArray) -> FloatArray:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _carriers(chain: PosedChain) -> np.ndarray:
    """The freedom of each joint that carries its link: the last one before the next joint."""
    return np.append(chain.chain.driven[1:], chain.origin.shape[0]) - 1
