"""A virtual robot that carries a spindle: its own multibody, and the finite-element rotor in place of a rigid payload.

Shared with the robot that is identified are its nouns alone (links, joints, springs); places and turns of the links come from here, and the
mass matrix is Kane's sum over the bodies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.machine.robot.model import Body, Frame, RobotModel
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.virtual.machine import VirtualSpindle
from rcsa_ident.virtual.rotor import Rotor, rotor, turned


@dataclass(frozen=True, slots=True, eq=False)
class VirtualRobot:
    """An arm and the spindle in its hand.

    `arm`: its payload is all of the spindle that does not turn
    `spindle`: shaft, bearings and joint. Its housing is the arm's payload: of the housing here only the place counts, from which the
        bearings are measured.
    """

    arm: RobotModel
    spindle: VirtualSpindle

    def drawn(self) -> RobotModel:
        """Return the arm as a data sheet has it: the payload is the whole spindle, its shaft as if it were rigid."""
        shaft = _along(self.spindle.shaft).seen_from(self.arm.tool_point)
        payload = shaft if self.arm.payload is None else self.arm.payload.beside(shaft)
        return replace(self.arm, payload=payload)


def robot_cut_id(tooling: str, posture: int, name: str) -> str:
    """Return the name of a tooling's cut at one of the postures; `name` as in `CutPlan.cuts`."""
    return f"{tooling}-q{posture:02d}-{name}"


def robot_rotor(robot: VirtualRobot, posture: FloatArray, tooling: ToolAssembly | None) -> Rotor:
    """Return the rotor on the arm at a posture, in the spindle's axes: shaft and tool in X, then in Y, then all angles of the arm.

    Parameters
    ----------
    robot : VirtualRobot
    posture : array, shape (j,) [rad]
    tooling : ToolAssembly or None

    Notes
    -----
    The housing's translation and slope in both planes are what the arm's hand does, u_h = T q with T from its Jacobian; its springs to the
    ground are taken away again. Along and about its axis the rotor moves as the hand does.
    """
    ground = rotor(robot.spindle, tooling)
    mass, damping, stiffness, hand = arm_matrices(robot.arm, posture)
    body = robot.spindle.housing
    # a point of the housing: x + z x', its slope; the same in y
    shift = np.array([[1.0, body.position, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, body.position], [0.0, 0.0, 0.0, 1.0]])
    half, freedoms = ground.mass.shape[0] // 2, ground.mass.shape[0]
    housing = np.array([half - 2, half - 1, freedoms - 2, freedoms - 1])
    free = np.setdiff1d(np.arange(freedoms), housing)
    change = scipy.sparse.lil_array((freedoms, free.size + mass.shape[0]))
    change[free, np.arange(free.size)] = 1.0
    change[np.ix_(housing, free.size + np.arange(mass.shape[0]))] = shift @ hand[:4]
    change = scipy.sparse.csc_array(change)

    def carried(matrix: scipy.sparse.csc_array, own: FloatArray | None = None, taken: FloatArray | None = None) -> scipy.sparse.csc_array:
        if taken is not None:
            matrix = matrix - scipy.sparse.csc_array((taken.ravel(), (np.repeat(housing, 4), np.tile(housing, 4))), matrix.shape)
        found = change.T @ matrix @ change
        if own is not None:
            found = found + scipy.sparse.block_diag([scipy.sparse.csc_array((free.size, free.size)), own])
        return scipy.sparse.csc_array(found)

    turning = _along(robot.spindle.shaft)
    if tooling is not None:
        turning = turning.beside(_along((*tooling.holder, *tooling.tool)))
    rigid = turning.mass * np.outer(hand[4], hand[4]) + turning.inertia[2, 2] * np.outer(hand[5], hand[5])
    springs, dampers = _ground(robot.spindle)
    along = np.concatenate([np.zeros(free.size), hand[4]])[None]
    weight = np.diag([body.mass, body.inertia, body.mass, body.inertia])
    return Rotor(
        mass=carried(ground.mass, mass + rigid, weight),
        damping=carried(ground.damping, damping, dampers),
        stiffness=carried(ground.stiffness, stiffness, springs),
        loss=carried(ground.loss),
        gyroscopic=carried(ground.gyroscopic),
        softening=carried(ground.softening),
        ports=frozen(np.concatenate([ground.ports @ change, along])),
        coordinates=(*ground.coordinates, Coordinate("tip", Dof.Z)),
    )


def arm_matrices(arm: RobotModel, posture: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return mass, damping and stiffness over all angles of an arm, shape (n, n), and what its hand does with them, shape (6, n).

    The hand is where the tool-holder's flange sits, in the spindle's axes (z from the tip into the spindle): translation and slope in X, in
    Y, translation along Z, turn about it. A slope in X is a turn about y, one in Y a turn about -x.

    `posture` [rad], shape (j,)
    """
    axes, places, bodies, springs, dampers = [], [], [], [], []
    here = Frame()
    for joint, angle in zip(arm.joints, posture, strict=True):
        here = here.then(joint.frame)
        for axis, turn in ((joint.axis, angle), *((tilt.axis, 0.0) for tilt in joint.tilts)):
            axes.append(here.turn @ axis)
            places.append(here.offset)
            here = here.then(Frame(_turned(axis, turn)))
        springs += [joint.stiffness, *(tilt.stiffness for tilt in joint.tilts)]
        dampers += [joint.damping, *(tilt.damping for tilt in joint.tilts)]
        bodies.append((len(axes), joint.body.seen_from(here)))
    flange = here.then(arm.flange)
    if arm.payload is not None:
        bodies.append((len(axes), arm.payload.seen_from(flange)))
    mass = np.zeros((len(axes), len(axes)))
    for moved, body in bodies:
        if body.mass == 0.0:
            continue
        way, turn = np.zeros((2, 3, len(axes)))
        for k in range(moved):
            way[:, k], turn[:, k] = np.cross(axes[k], body.centre - places[k]), axes[k]
        mass += body.mass * way.T @ way + turn.T @ body.inertia @ turn
    hand = flange.then(arm.tool_point)
    x, y, z = hand.turn[:, 0], -hand.turn[:, 1], -hand.turn[:, 2]
    turn = np.array(axes)
    way = np.cross(turn, hand.offset - np.array(places))
    return mass, np.diag(dampers), np.diag(springs), np.stack([way @ x, turn @ y, way @ y, -turn @ x, way @ z, turn @ z])


def _turned(axis: FloatArray, angle: float) -> FloatArray:
    """Turn about an axis, after Rodrigues."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across


def _along(segments: tuple[BeamSegment, ...]) -> Body:
    """A row of segments as a rigid body, the first of them at the origin, the others behind it along -z."""
    whole, start = Body(0.0), 0.0
    for segment in segments:
        mass, length = segment.mass, segment.length
        squares = (0.5 * (segment.diameter + segment.end)) ** 2 + segment.inner_diameter**2
        across = mass * (squares / 16.0 + length**2 / 12.0)
        centre = np.array([0.0, 0.0, -start - 0.5 * length])
        whole = Body(mass, centre, np.diag([across, across, mass * squares / 8.0])).beside(whole)
        start += length
    return whole


def _ground(spindle: VirtualSpindle) -> tuple[FloatArray, FloatArray]:
    """Springs and dampers between housing and ground, over its translation and slope in X, then in Y, shape (4, 4)."""
    body = spindle.housing
    found = []
    for along, about in ((body.stiffness, body.tilting_stiffness), (body.damping, body.tilting_damping)):
        matrix = np.zeros((4, 4))
        matrix[::2, ::2], matrix[1::2, 1::2] = turned(along, body.angle), turned(about, body.angle)
        found.append(matrix)
    return found[0], found[1]
