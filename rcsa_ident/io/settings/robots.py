"""ROBOT.toml: an arm's joints, links, springs and what its flange carries; millimetres and degrees."""

from __future__ import annotations

from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import JOINT_STIFFNESS
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table
from rcsa_ident.machine.robot.model import Body, Frame, Joint, RobotModel, Tilt

_TOP = ("robot", "joints", "flange", "tool_point", "payload")
_ROBOT = ("name", "source", "gravity_m_per_s2", "base_mass_kg")
_FRAME = ("offset_mm", "turn_deg")
_BODY = ("mass_kg", "center_of_mass_mm", "inertia_kg_m2")
_SPRING = ("stiffness_nm_per_rad", "damping_nms_per_rad")
_JOINT = ("name", *_FRAME, "axis", "limits_deg", *_SPRING, "backlash_rad", "gravity_compensated", "link", "tilts")
_TILT = ("axis", *_SPRING)
#: Digits that a turn in degrees, or a vector of unit length, is written with.
_DIGITS = 12
_STANDARD_GRAVITY = (0.0, 0.0, -9.81)


def read_robot(path: str | Path) -> RobotModel:
    """Return the robot that a file describes.

    Turns are roll, pitch and yaw: about x, then y, then z of the frame before. Moments of inertia are xx, yy, zz, xy, yz, zx of the
    tensor about the centre of mass, in the joint's axes.

    Parameters
    ----------
    path : path

    Raises
    ------
    InputError
        That names the key, what stands there and what may.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> print(ri.read_robot("data/robots/tx200.toml"))
    Stäubli TX200: 6 joints, 18 freedoms, 1045 kg
    """
    return robot_of(read_toml(path, "robot"), str(path))


def robot_of(data: dict[str, Any], where: str) -> RobotModel:
    """Return the robot that keys describe, as a file holds them."""
    top = Table(data, where, known=_TOP)
    robot = top.table("robot", _ROBOT)
    joints = top.tables("joints", _JOINT)
    gravity = robot.numbers("gravity_m_per_s2", 3, "m/s²") if "gravity_m_per_s2" in robot else _STANDARD_GRAVITY
    flange, tool_point = (_frame(top.table(key, _FRAME, {})) for key in ("flange", "tool_point"))
    payload = top.table("payload", _BODY) if "payload" in top else None
    _check_size(joints, where)
    try:
        return RobotModel(
            robot.text("name"),
            tuple(_joint(each) for each in joints),
            flange,
            tool_point,
            None if payload is None else _body(payload),
            np.array(gravity),
            robot.number("base_mass_kg", "kg", 0.0, least=0.0),
            robot.text("source", ""),
        )
    except InputError as error:
        raise (error if error.where else error.at(where)) from None


def robot_keys(robot: RobotModel) -> dict[str, Any]:
    """Return the keys that a file of this robot holds: `robot_of` brings it back."""
    head: dict[str, Any] = {"name": robot.name}
    if robot.source:
        head["source"] = robot.source
    if tuple(robot.gravity) != _STANDARD_GRAVITY:
        head["gravity_m_per_s2"] = robot.gravity.tolist()
    if robot.base_mass:
        head["base_mass_kg"] = robot.base_mass
    keys: dict[str, Any] = {"robot": head, "joints": [_joint_keys(each) for each in robot.joints]}
    for name, frame in (("flange", robot.flange), ("tool_point", robot.tool_point)):
        if found := _frame_keys(frame):
            keys[name] = found
    if robot.payload is not None:
        keys["payload"] = _body_keys(robot.payload)
    return keys


def _check_size(joints: list[Table], where: str) -> None:
    """Refuse an arm that would fit into a hand, or not into a hall: its lengths are in another unit."""
    reach = sum(float(np.linalg.norm(_frame(each).offset)) for each in joints)
    if len(joints) > 1 and not 0.1 <= reach <= 20.0:
        raise InputError("offset_mm of the joints", f"{1e3 * reach:g} mm in all", "100 to 20 000 mm in all; are these millimetres?", where)


def turn_of(roll_pitch_yaw: FloatArray) -> FloatArray:
    """Return the matrix of turns about x, then y, then z of fixed axes, shape (3, 3), of angles (3,) [rad]."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(roll_pitch_yaw), np.sin(roll_pitch_yaw)
    found = np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )
    # a quarter of a turn is one
    whole = np.round(found)
    return np.where(np.abs(found - whole) < 1e-15, whole, found)


def _angles_of(turn: FloatArray) -> FloatArray:
    """Roll, pitch and yaw of a turn, shape (3,) [rad]."""
    flat = np.hypot(turn[0, 0], turn[1, 0])
    if flat < 1e-12:
        return np.array([np.arctan2(-turn[1, 2], turn[1, 1]), np.arctan2(-turn[2, 0], flat), 0.0])
    return np.array([np.arctan2(turn[2, 1], turn[2, 2]), np.arctan2(-turn[2, 0], flat), np.arctan2(turn[1, 0], turn[0, 0])])


def _frame(table: Table) -> Frame:
    offset = np.array(table.numbers("offset_mm", 3, "mm")) * 1e-3 if "offset_mm" in table else np.zeros(3)
    turn = turn_of(np.radians(table.numbers("turn_deg", 3, "°"))) if "turn_deg" in table else np.eye(3)
    return Frame(turn, offset)


def _frame_keys(frame: Frame) -> dict[str, Any]:
    keys: dict[str, Any] = {}
    if np.any(frame.offset):
        keys["offset_mm"] = (1e3 * frame.offset).round(_DIGITS).tolist()
    if not np.array_equal(frame.turn, np.eye(3)):
        keys["turn_deg"] = np.degrees(_angles_of(frame.turn)).round(_DIGITS).tolist()
    return keys


def _body(table: Table) -> Body:
    mass = table.number("mass_kg", "kg", least=0.0)
    centre = np.array(table.numbers("center_of_mass_mm", 3, "mm")) * 1e-3 if "center_of_mass_mm" in table else np.zeros(3)
    moments = table.numbers("inertia_kg_m2", 6, "kg m²") if "inertia_kg_m2" in table else [0.0] * 6
    xx, yy, zz, xy, yz, zx = moments
    return Body(mass, centre, np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]))


def _body_keys(body: Body) -> dict[str, Any]:
    i = body.inertia
    moments = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[1, 2], i[2, 0]]
    centre = (1e3 * body.centre).round(_DIGITS).tolist()
    return {"mass_kg": body.mass, "center_of_mass_mm": centre, "inertia_kg_m2": [float(v) for v in moments]}


def _spring(table: Table) -> tuple[float, float]:
    stiffness = table.quantity("stiffness_nm_per_rad", JOINT_STIFFNESS)
    return stiffness, table.number("damping_nms_per_rad", "N m s/rad", 0.0, least=0.0)


def _axis(table: Table) -> FloatArray:
    axis = np.array(table.numbers("axis", 3))
    size = float(np.linalg.norm(axis))
    if size == 0.0:
        table.refuse("axis", axis.tolist(), "a vector of three that is not zero")
    return axis / size


def _joint(table: Table) -> Joint:
    low, high = -np.inf, np.inf
    if "limits_deg" in table:
        low, high = (radians(each) for each in table.numbers("limits_deg", 2, "°"))
        if not low < high:
            table.refuse("limits_deg", [degrees(low), degrees(high)], "the lower limit, then a higher one [°]")
    tilts = [Tilt(_axis(each), *_spring(each)) for each in table.tables("tilts", _TILT)] if "tilts" in table else []
    stiffness, damping = _spring(table)
    return Joint(
        table.text("name"),
        _frame(table),
        _axis(table),
        _body(table.table("link", _BODY)) if "link" in table else Body(0.0),
        stiffness,
        damping,
        # play that shows: half a degree would be 9 mm at a metre
        table.number("backlash_rad", "rad", 0.0, least=0.0, most=0.01),
        tuple(tilts),
        (low, high),
        table.flag("gravity_compensated", False),
    )


def _joint_keys(joint: Joint) -> dict[str, Any]:
    keys = {"name": joint.name, **_frame_keys(joint.frame), "axis": joint.axis.round(_DIGITS).tolist()}
    if np.all(np.isfinite(joint.limits)):
        keys["limits_deg"] = [round(degrees(each), _DIGITS) for each in joint.limits]
    keys |= {"stiffness_nm_per_rad": joint.stiffness, "damping_nms_per_rad": joint.damping}
    if joint.backlash:
        keys["backlash_rad"] = joint.backlash
    if joint.gravity_compensated:
        keys["gravity_compensated"] = True
    if joint.body.mass:
        keys["link"] = _body_keys(joint.body)
    if joint.tilts:
        keys["tilts"] = [
            {"axis": t.axis.round(_DIGITS).tolist(), "stiffness_nm_per_rad": t.stiffness, "damping_nms_per_rad": t.damping}
            for t in joint.tilts
        ]
    return keys
