"""Where a robot's links are, how its flange moves with the angles, and which angles bring it to a place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.machine.robot import _kernels
from rcsa_ident.machine.robot.model import Chain, Frame, RobotModel, turned_within

#: How far two lines may pass each other and count as crossing, or be from parallel [m, -].
_CROSSING = 1e-6
#: What rounding may add to a cosine that is one.
_BEYOND_ONE = 1e-9


@dataclass(frozen=True, eq=False)
class PosedChain:
    """A chain of freedoms whose frames have been worked out at some angles, in the axes of the base.

    `rotation`, `origin`, `direction`: arrays, shapes (n, 3, 3), (n, 3), (n, 3); each frame's axes as columns, its origin, and its joint's
        axis
    """

    chain: Chain
    rotation: FloatArray
    origin: FloatArray
    direction: FloatArray
    flange: Frame

    def jacobian(self, point: FloatArray) -> FloatArray:
        """Return the motion of a point of the last link with each angle, translations [m/rad] before rotations, shape (6, n).

        `point` [m], shape (3,): in the axes of the base
        """
        out = np.empty((6, self.origin.shape[0]))
        _kernels.jacobian(self.origin, self.direction, np.asarray(point, dtype=float), out)
        return out


def posed(robot: RobotModel, angles: FloatArray, tilts: bool = False, payload: bool = True) -> PosedChain:
    """Return a robot's frames at some angles.

    `angles`: array, shape (j,) or (n,) [rad]; of the joints, nothing tilting; or of all freedoms
    `tilts`, `payload`: as in `RobotModel.chain`
    """
    chain = robot.chain(tilts, payload)
    angles = np.asarray(angles, dtype=float)
    n = chain.mass.size
    if angles.shape != (n,):
        angles = chain.angles(robot.posture(angles))
    rotation, origin, direction = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    _kernels.frames(chain.turn, chain.offset, chain.axis, angles, rotation, origin, direction)
    return PosedChain(chain, rotation, origin, direction, Frame(rotation[-1], origin[-1]).then(robot.flange))


def flange_at(robot: RobotModel, angles: FloatArray) -> Frame:
    """Return the robot's flange at a posture, as seen from the base."""
    return posed(robot, angles).flange


def tool_point_at(robot: RobotModel, angles: FloatArray) -> Frame:
    """Return the place where the tool-holder's flange sits, as seen from the base; its z points along the tool."""
    return flange_at(robot, angles).then(robot.tool_point)


def postures_of(robot: RobotModel, flange: Frame, within_limits: bool = True, near: FloatArray | None = None) -> FloatArray:
    """Return all postures that bring the flange to a place, shape (s, 6) [rad], s = 0 where it is out of reach.

    For arms of six joints whose last three axes cross in one point and whose second and third axis are parallel, as nearly all are. The
    first angle brings the wrist to its distance from the plane of the second link, the third to its distance from the second axis, and the
    fifth turns the last axis to its angle with the fourth; each has two solutions.

    `flange`: as seen from the base
    `within_limits`: only postures that the joints' limits allow; else angles within half a turn
    `near`: array, shape (6,) [rad], default zero; of the whole turns that limits leave to an angle, those nearest to this posture
    Raises `InputError` if the arm is not of that kind.
    """
    arm = _Arm.of(robot)
    rotation = flange.turn @ arm.zero.turn.T
    wrist = flange.point(arm.zero.inverse.point(arm.wrist))
    found = [
        (one, two, three, *last)
        for one in _meeting(arm.axes[1], arm.axes[0], wrist - arm.points[0], arm.axes[1] @ (arm.wrist - arm.points[0]), -1.0)
        for two, three in arm.elbows(_turn(arm.axes[0], -one) @ (wrist - arm.points[0]) + arm.points[0])
        for last in arm.wrists((_turn(arm.axes[0], one) @ _turn(arm.axes[1], two) @ _turn(arm.axes[2], three)).T @ rotation)
    ]
    limits = [j.limits if within_limits else (-np.pi, np.pi) for j in robot.joints]
    middle = np.zeros(6) if near is None else near
    kept = np.array([[turned_within(*own) for own in zip(each, limits, middle, strict=True)] for each in found]).reshape(-1, 6)
    kept = kept[np.all(np.isfinite(kept), axis=1)]
    # where the wrist is stretched, both of its solutions are one
    alike = np.array([[np.max(np.abs(a - b), initial=0.0) < _CROSSING for b in kept] for a in kept]).reshape(len(kept), len(kept))
    return kept[~np.any(np.tril(alike, -1), axis=1)]


@dataclass(frozen=True, eq=False)
class _Arm:
    """An arm of six joints at angle zero: axes (6, 3), a point on each (6, 3), the wrist's centre and the flange."""

    axes: FloatArray
    points: FloatArray
    wrist: FloatArray
    zero: Frame

    @classmethod
    def of(cls, robot: RobotModel) -> _Arm:
        allowed = "an arm of six joints whose last three axes cross and whose second and third are parallel and across the first"
        if len(robot.joints) != 6:
            raise InputError("robot", f"{len(robot.joints)} joints", allowed)
        rest = posed(robot, np.zeros(6))
        axes, points = rest.direction, rest.origin
        # the point of the fourth axis that the fifth goes through
        a, b, gap = axes[3], axes[4], points[4] - points[3]
        along = float(a @ b)
        if abs(along) > 1.0 - _CROSSING:
            raise InputError("robot", f"{robot.joints[4].name} in line with {robot.joints[3].name}", allowed)
        wrist = points[3] + (a @ gap - along * (b @ gap)) / (1.0 - along**2) * a
        misses = [np.linalg.norm(np.cross(axes[k], wrist - points[k])) for k in (3, 4, 5)]
        across = (np.linalg.norm(np.cross(axes[1], axes[2])), abs(axes[0] @ axes[1]))
        if max(*misses, *across) > _CROSSING:
            raise InputError("robot", "axes of another kind", allowed)
        return cls(axes, points, wrist, rest.flange)

    def elbows(self, wrist: FloatArray) -> list[tuple[float, float]]:
        """Second and third angle that bring the wrist to a point, the first being done."""
        shoulder, elbow, axis = self.points[1], self.points[2], self.axes[1]
        sense = float(axis @ self.axes[2])
        flat = np.eye(3) - np.outer(axis, axis)
        upper, fore, reach = flat @ (elbow - shoulder), flat @ (self.wrist - elbow), flat @ (wrist - shoulder)
        cosine_sum = 0.5 * (reach @ reach - upper @ upper - fore @ fore)
        found = []
        for bend in _meeting(upper, axis, fore, cosine_sum):
            whole = upper + _turn(axis, bend) @ fore
            found.append((_between(axis, whole, reach), sense * bend))
        return found

    def wrists(self, rotation: FloatArray) -> list[tuple[float, float, float]]:
        """Fourth, fifth and sixth angle that turn the flange as wanted, the first three being done."""
        four, five, six = self.axes[3], self.axes[4], self.axes[5]
        last = rotation @ six
        found = []
        for bend in _meeting(four, five, six, float(four @ last)):
            bent = _turn(five, bend) @ six
            first = _between(four, bent, last)
            rest = (_turn(four, first) @ _turn(five, bend)).T @ rotation
            across = np.cross(six, four) if abs(six @ four) < 0.9 else np.cross(six, five)
            found.append((first, bend, _between(six, across, rest @ across)))
        return found


def _turn(axis: FloatArray, angle: float) -> FloatArray:
    """Matrix that turns about an axis."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * (skew @ skew)


def _between(axis: FloatArray, first: FloatArray, second: FloatArray) -> float:
    """Angle that turns one vector about an axis towards another."""
    return float(np.arctan2(axis @ np.cross(first, second), first @ second - (axis @ first) * (axis @ second)))


def _meeting(onto: FloatArray, axis: FloatArray, moved: FloatArray, value: float, sense: float = 1.0) -> list[float]:
    """Angles at which onto . (moved turned about the axis by sense times the angle) has a value: two, or none."""
    along = (axis @ moved) * (onto @ axis)
    cosine, sine = onto @ moved - along, sense * (onto @ np.cross(axis, moved))
    size = float(np.hypot(cosine, sine))
    if size == 0.0 or abs(value - along) > size * (1.0 + _BEYOND_ONE):
        return []
    middle, half = float(np.arctan2(sine, cosine)), float(np.arccos(np.clip((value - along) / size, -1.0, 1.0)))
    return [middle + half, middle - half]
