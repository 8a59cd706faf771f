"""Robots as texts, and at a posture as machines: read by the reader of ROBOT.toml, described, and moved along a path."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from api.work.requests import LobeRequest, ToolingSource, TooLong
from api.work.toolings import tooling_from, weigh
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.io.settings import robots as files
from rcsa_ident.io.toml_text import keys_of_toml
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.model import RobotModel
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.report.robot_view import arm_geometry
from rcsa_ident.workflows.robot_postures import at_posture, following, limits_along

#: Largest text of a robot, joints of one, and springs across the axis of each: more axes than three turn nothing.
LARGEST, MOST_JOINTS, MOST_TILTS = 100_000, 12, 2
#: Places of a path, and limits of a map.
MOST_PLACES, MOST_LIMITS = 1000, 50_000
#: A robot at a posture as text begins so: RESULT.json has no such key.
_POSED = '{"posed_robot": '
#: Largest angle that anybody turns a joint to [deg].
_MOST_TURNED = 720.0


def parsed(text: str) -> dict[str, Any]:
    """Return the keys of a TOML text."""
    return keys_of_toml(text, "robot")


def robot_from(keys: Mapping[str, Any]) -> RobotModel:
    """Return the robot of the keys of ROBOT.toml; errors name the key."""
    found = files.robot_of(dict(keys), "")
    if len(found.joints) > MOST_JOINTS:
        raise InputError("joints", f"{len(found.joints)} of them", f"at most {MOST_JOINTS}")
    for joint in found.joints:
        if len(joint.tilts) > MOST_TILTS:
            raise InputError(f"tilts of {joint.name}", f"{len(joint.tilts)} of them", f"at most {MOST_TILTS}")
    return found


def summary(text: str) -> dict[str, Any]:
    """Return what a list tells; everything that the commands would refuse is refused, and what cannot be computed with, too."""
    robot = robot_from(parsed(text))
    machine = _posed(robot, [0.0] * len(robot.joints), False)
    mass = robot.mass if robot.weighed else None
    told = {"label": robot.name[:200], "joints": len(robot.joints), "degrees_of_freedom": machine.robot.model.freedoms()}
    return told | {"mass_kg": mass, "warnings": list(robot.warnings)}


def posed_text(keys: Mapping[str, Any], posture_deg: Sequence[float], joints_only: bool) -> str:
    """Return a robot at a posture as the text of a machine."""
    return json.dumps({"posed_robot": {"robot": keys, "posture_deg": list(posture_deg), "joints_only": joints_only}})


def is_posed(text: str) -> bool:
    """Return whether a machine's text is a robot at a posture."""
    return text.startswith(_POSED)


def posed(text: str) -> PosedRobot:
    """Return the robot at a posture of a text, one that can be computed with."""
    told = json.loads(text)["posed_robot"]
    return _posed(robot_from(told["robot"]), told["posture_deg"], told["joints_only"])


def _posed(robot: RobotModel, posture_deg: Sequence[float], joints_only: bool) -> PosedRobot:
    count = len(robot.joints)
    if len(posture_deg) != count or not all(isfinite(each) and abs(each) <= _MOST_TURNED for each in posture_deg):
        raise InputError("posture_deg", list(posture_deg), f"{count} angles within two turns, one a joint [°]")
    machine = PosedRobot(FlexibleRobot(robot, tilts=not joints_only), np.radians(posture_deg))
    if robot.weighed:
        try:
            with np.errstate(all="ignore"):
                flange = machine.flange
            usable = all(np.all(np.isfinite(part)) for part in (flange.omega_n, flange.damping, flange.psi))
        except InputError:
            raise
        except (ArithmeticError, ValueError):
            # LAPACK refuses a mass matrix that is none, and numbers without end
            usable = False
        if not usable:
            raise InputError("robot", "masses or springs of which no arm is made", "bodies with a mass and moments of inertia above 0")
    return machine


def posture(text: str, tooling: ToolingSource | None, drawing: bool) -> dict[str, Any]:
    """Return what a robot is at a posture, in the terms of ``robot check``, and what a page draws it from."""
    machine = posed(text)
    model = machine.robot.model
    assembly = None if tooling is None else tooling_from(tooling).assembly
    found = at_posture(machine.robot, machine.angles)
    told = {
        "name": model.name,
        "degrees_of_freedom": model.freedoms(machine.robot.tilts),
        "mass_kg": model.mass if model.weighed else None,
        "tcp_m": found.tool_point.offset.tolist(),
        "tcp_axes": found.tool_point.turn.tolist(),
        "natural_frequencies_hz": to_hz(found.natural_frequencies).tolist(),
        "damping_ratios": found.damping_ratios.tolist(),
        "gravity_torque_nm": found.gravity_torques.tolist(),
        "tcp_compliance_m_per_n": found.compliance.tolist(),
        "postures_deg": np.degrees(found.postures).tolist(),
        "warnings": list(machine.remarks),
    }
    return told | {"drawing": arm_geometry(model, assembly) if drawing else None}


def along(text: str, tooling: ToolingSource, rows: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Return a posture for each place of a tool's tip."""
    machine = posed(text)
    found = _postures(machine, tooling, rows)
    warnings = dict.fromkeys(said for each in found for said in machine.robot.model.beyond_limits(each))
    return {"postures_deg": np.degrees(found).tolist(), "warnings": [*warnings, *machine.robot.model.warnings]}


def limit_map(text: str, tooling: ToolingSource, rows: Sequence[Sequence[float]], request: LobeRequest) -> dict[str, Any]:
    """Return a limit at each place of a path and each speed; None where a cut is stable up to the largest depth."""
    machine = posed(text)
    change = request.change(machine, tooling_from(tooling))
    weigh(change.tooling.assembly, to_hz(float(change.omega[-1])))
    seconds = change.seconds * len(rows)
    if seconds > request.work_seconds:
        found = f"{len(rows)} places at {len(request.speeds)} speeds by {request.method}, about {seconds:.0f} s of work"
        raise TooLong("places", found, f"at most {request.work_seconds:g} s (fewer of both, zero-order)", seconds=seconds)
    postures = _postures(machine, tooling, rows)
    limits, chatter = limits_along(change, postures)
    worst = np.min(limits, axis=0)
    best = int(np.argmax(worst))
    return {
        "tooling": tooling.name,
        "method": request.method,
        "postures_deg": np.degrees(postures).tolist(),
        "spindle_speed_rpm": [to_rpm(speed, 6) for speed in request.speeds],
        "limit_depth_mm": [_or_none(1e3 * row) for row in limits],
        "chatter_frequency_hz": [_or_none(to_hz(row)) for row in chatter],
        "best_speed_rpm": to_rpm(request.speeds[best], 6),
        "limit_everywhere_mm": _or_none(1e3 * worst[best : best + 1])[0],
        "warnings": list(machine.remarks),
    }


def _or_none(values: FloatArray) -> list[float | None]:
    return [float(each) if isfinite(each) else None for each in values]


def _postures(machine: PosedRobot, tooling: ToolingSource, rows: Sequence[Sequence[float]]) -> FloatArray:
    places, axes = path_from(rows)
    return following(machine.robot.model, machine.angles, places, axes, tooling_from(tooling).assembly)


def path_from(rows: Sequence[Sequence[float]]) -> tuple[FloatArray, FloatArray]:
    """Return places [m] and axes of rows x, y, z [mm], or x, y, z, i, j, k, shapes (k, 3) both."""
    if len({len(row) for row in rows}) != 1 or len(rows[0]) not in (3, 6):
        raise InputError(
            "places", f"rows of {sorted({len(row) for row in rows})} numbers", "x, y, z [mm] in all of them, or x, y, z, i, j, k"
        )
    table = np.array(rows, dtype=float)
    places = 1e-3 * table[:, :3]
    if table.shape[1] == 3:
        return places, np.tile([0.0, 0.0, 1.0], (len(places), 1))
    size = np.linalg.norm(table[:, 3:], axis=1)
    if not np.all(size > 0.0):
        raise InputError("places", f"no direction in row {int(np.argmin(size)) + 1}", "an axis i, j, k that is not zero")
    return places, table[:, 3:] / size[:, None]
