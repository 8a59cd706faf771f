"""An arm as round bodies that a picture is made of: limbs from joint to joint, joints, spindle and tool, seen from any side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.robot.model import Frame, Joint, RobotModel
from rcsa_ident.tool_holder.geometry import ToolAssembly

#: Radius of the first and of the last limb over the arm's reach, and of a joint over that of its limb.
_THICK, _THIN, _JOINT = 0.055, 0.02, 1.12
#: A link whose route along both axes is so many times as long as itself is drawn straight.
_DETOUR = 2.0


class PartKind(StrEnum):
    """What a part of an arm's picture is."""

    BASE = "base"
    LIMB = "limb"
    JOINT = "joint"
    SPINDLE = "spindle"
    TOOL = "tool"


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A round body along a line: limbs and spindles with rounded ends, others with flat ones.

    `carrier`: what moves it: 0 is the base, k the k-th joint
    `points` [m], shape (k, 3): in the carrier's axes
    `radius` [m]
    """

    kind: PartKind
    carrier: int
    points: FloatArray
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points))


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A direction of sight, without perspective: rows are right, up and towards who looks, in the base's axes.

    `axes`, shape (3, 3)

    Examples
    --------
    >>> View.from_angles(-90.0, 0.0).seen(np.array([1.0, 2.0, 3.0])).round(12).tolist()
    [1.0, 3.0, -2.0]
    """

    axes: FloatArray

    @classmethod
    def from_angles(cls, azimuth: float, elevation: float) -> View:
        """Return the view of someone who stands at an azimuth from the base's x and looks down by an elevation [deg]."""
        a, e = np.radians([azimuth, elevation])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        return cls(frozen([right, np.cross(towards, right), towards]))

    def seen(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) as right, up and nearness, in their unit."""
        return points @ self.axes.T


def arm_parts(robot: RobotModel, assembly: ToolAssembly | None = None) -> tuple[Part, ...]:
    """Return the parts of an arm's picture, each in the axes of what moves it: they hold at any posture.

    A limb leaves its joint along that joint's axis and arrives along the next one's, as links do: between both it runs along their common
    normal.

    `assembly`: tool-holder and tool at the tool point
    """
    joints = robot.joints
    reach = reach_of(robot)
    radii = reach * _THICK * (_THIN / _THICK) ** (np.arange(len(joints) + 1) / len(joints))
    origin, first = np.zeros(3), joints[0].frame
    height, parts = float(first.offset[2]), []
    if height > 0.0:
        parts.append(Part(PartKind.BASE, 0, np.array([[*first.offset[:2], 0.0], first.offset]), 1.25 * radii[0]))
    for k, joint in enumerate(joints, start=1):
        last = k == len(joints)
        end = robot.flange.offset if last else joints[k].frame.offset
        arriving = joint.axis if last else joints[k].frame.turn @ joints[k].axis
        line, half = _route(origin, joint.axis, end, arriving), 1.25 * radii[k] * joint.axis
        barrel = np.stack([-half, half])
        if k == 1:
            # what turns on the ground does not reach into it
            upward = joint.axis if (first.turn @ joint.axis)[2] >= 0.0 else -joint.axis
            barrel = barrel + max(float(np.linalg.norm(half)) - height, 0.0) * upward
            line = np.concatenate([line[:1] + min(radii[1], 0.5 * float(np.linalg.norm(line[1] - line[0]))) * upward, line[1:]])
        parts.append(Part(PartKind.LIMB, k, line, radii[k]))
        parts.append(Part(PartKind.JOINT, k, barrel, _JOINT * radii[k - 1]))
    count, nose = len(joints), robot.flange.then(robot.tool_point)
    if np.any(robot.tool_point.offset):
        line = _route(robot.flange.offset, robot.flange.turn[:, 2], nose.offset, nose.turn[:, 2])
        # its rounded end stops where the tool-holder begins
        radius, step = 1.3 * radii[-1], line[-1] - line[-2]
        length = float(np.linalg.norm(step))
        line = np.concatenate([line[:-1], line[-1:] - min(radius / length, 0.9) * step])
        parts.append(Part(PartKind.SPINDLE, count, line, radius))
    return (*parts, *(_tool(nose, assembly, count) if assembly is not None else ()))


def reach_of(robot: RobotModel) -> float:
    """Return the length of an arm stretched out [m]: the sum of its links behind the first joint."""
    lengths = [*(j.frame.offset for j in robot.joints[1:]), robot.flange.offset, robot.tool_point.offset]
    return float(sum(np.linalg.norm(each) for each in lengths)) or float(np.linalg.norm(robot.joints[0].frame.offset)) or 1.0


def placed(robot: RobotModel, parts: Sequence[Part], angles: FloatArray) -> tuple[Part, ...]:
    """Return the parts of an arm at a posture (j,) [rad], all in the base's axes."""
    chain = posed(robot, angles)
    frames = [Frame(), *(Frame(turn, offset) for turn, offset in zip(chain.rotation, chain.origin, strict=True))]
    return tuple(replace(p, points=p.points @ frames[p.carrier].turn.T + frames[p.carrier].offset) for p in parts)


def arm_geometry(robot: RobotModel, assembly: ToolAssembly | None = None) -> dict[str, Any]:
    """Return what a page needs to draw an arm at any posture: joints with their frames, and parts that these carry, in mm and degrees.

    Joint k stands in the axes of joint k - 1, the first one in the base's: x' = offset + turn (rotation about axis by the angle) x.
    """
    nose = robot.flange.then(robot.tool_point)
    length = 0.0 if assembly is None else assembly.stickout + assembly.holder_length
    return {
        "reach_mm": 1e3 * reach_of(robot),
        "joints": [
            {
                "name": j.name,
                "offset_mm": _mm(j.frame.offset),
                "turn": j.frame.turn.tolist(),
                "axis": j.axis.tolist(),
                "limits_deg": _limits(j),
            }
            for j in robot.joints
        ],
        "parts": [
            {"kind": str(p.kind), "carrier": p.carrier, "points_mm": _mm(p.points), "radius_mm": round(1e3 * p.radius, 4)}
            for p in arm_parts(robot, assembly)
        ],
        "tip_mm": _mm(nose.offset + length * nose.turn[:, 2]),
        "tool_axis": nose.turn[:, 2].tolist(),
    }


def _limits(joint: Joint) -> list[float] | None:
    return np.degrees(joint.limits).round(9).tolist() if np.all(np.isfinite(joint.limits)) else None


def _mm(points: FloatArray) -> list[Any]:
    found: list[Any] = (1e3 * points).round(4).tolist()
    return found


def _route(start: FloatArray, leaving: FloatArray, end: FloatArray, arriving: FloatArray) -> FloatArray:
    """A line from a joint to the next along both axes and their common normal, shape (k, 3)."""
    gap = end - start
    straight = float(np.linalg.norm(gap))
    if straight == 0.0:
        # axes that cross in one point
        return np.array([start, end])
    along = float(leaving @ arriving)
    if abs(along) > 1.0 - 1e-9:
        # parallel axes: the whole distance along them at once
        out, back = float(leaving @ gap), 0.0
    else:
        out, back = np.linalg.solve([[1.0, along], [along, 1.0]], [leaving @ gap, arriving @ gap])
    line = np.array([start, start + out * leaving, end - back * arriving, end])
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    if np.sum(steps) > _DETOUR * straight:
        return np.array([start, end])
    return line[np.concatenate([[True], steps > 1e-3 * straight])]


def _tool(nose: Frame, assembly: ToolAssembly, carrier: int) -> list[Part]:
    """Holder and what of the tool stands out of it, as cylinders."""
    total, place, found = assembly.stickout + assembly.holder_length, 0.0, []
    for segment in assembly.tool:
        length = min(segment.length, assembly.stickout - place)
        if length > 0.0:
            found.append((place, place + length, max(segment.diameter, segment.end)))
            place += length
    place = assembly.stickout
    for segment in assembly.holder:
        found.append((place, place + segment.length, max(segment.diameter, segment.end)))
        place += segment.length
    axis = nose.turn[:, 2]
    ends = [(nose.offset + np.outer([total - first, total - last], axis), 0.5 * diameter) for first, last, diameter in found]
    return [Part(PartKind.TOOL, carrier, points, radius) for points, radius in ends]
