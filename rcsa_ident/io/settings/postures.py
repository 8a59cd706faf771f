"""POSTURES.csv: angles of an arm's joints, a row a posture, and where they bring its tool."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.files import write_text
from rcsa_ident.io.settings.robot_static import finite_columns, posture_columns
from rcsa_ident.io.text_columns import read_table
from rcsa_ident.machine.robot.kinematics import tool_point_at
from rcsa_ident.machine.robot.model import RobotModel

#: Digits of a written angle [deg] and length [mm].
_DIGITS = 4


def read_postures(path: str | Path, robot: RobotModel) -> FloatArray:
    """Return the postures of a table, shape (k, j) [rad], all within the joints' limits.

    Columns ``q1_deg``, ``q2_deg`` and so on.

    Raises `InputError`, which names the file, the line, and the joint that does not get there.
    """
    table = read_table(path, "postures")
    found = np.radians(finite_columns(table, posture_columns(len(robot.joints))))
    for row, posture in enumerate(found):
        beyond = robot.beyond_limits(posture)
        if beyond:
            raise InputError("posture", beyond[0], "angles within the joints' limits", table.at(row))
    return found


def write_postures(path: str | Path, postures: FloatArray, robot: RobotModel) -> None:
    """Write postures (k, j) [rad] in degrees, and the places of the tool in the base's axes in millimetres."""
    lines = [",".join((*posture_columns(postures.shape[1]), "x_mm", "y_mm", "z_mm"))]
    for posture in postures:
        cells = np.concatenate([np.degrees(posture), 1e3 * tool_point_at(robot, posture).offset]).round(_DIGITS) + 0.0
        lines.append(",".join(f"{cell:.{_DIGITS}f}" for cell in cells))
    write_text(path, "\n".join(lines) + "\n")
