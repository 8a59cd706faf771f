"""FORCES.csv along a path: the forces on the tool over the path's time; JOINTS.csv: the joints' angles along it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.files import write_text
from rcsa_ident.io.settings.robot_static import finite_columns, posture_columns
from rcsa_ident.io.text_columns import read_table
from rcsa_ident.toolpath.forces import ForceAlongPath
from rcsa_ident.toolpath.path import ToolPath

TIME, PLACE, FORCE = "time_s", ("x_mm", "y_mm", "z_mm"), ("force_x_n", "force_y_n", "force_z_n")


def read_path_forces(path: str | Path, tool_path: ToolPath) -> ForceAlongPath:
    """Return the forces on a tool along a path.

    Columns ``time_s``, rising, ``force_x_n``, ``force_y_n``, ``force_z_n`` of the workpiece on the tool, in the path's axes; and ``x_mm``,
    ``y_mm``, ``z_mm`` of the tool's tip where they stand there: forces of another path are refused.

    Raises `InputError`, which names the file and the line.
    """
    table = read_table(path, "forces")
    time, *force = finite_columns(table, (TIME, *FORCE)).T
    fallen = np.flatnonzero(np.diff(time) <= 0.0)
    if fallen.size:
        raise InputError(f"column {TIME}", f"{time[fallen[0] + 1]:g}", "instants that rise [s]", table.at(int(fallen[0]) + 1))
    found = ForceAlongPath(time, np.stack(force, axis=1))
    if any(name in table.header for name in PLACE):
        try:
            found.check_places(1e-3 * finite_columns(table, PLACE), tool_path)
        except InputError as error:
            raise error.at(str(path)) from None
    return found


def write_joints(path: str | Path, times: FloatArray, postures: FloatArray) -> None:
    """Write JOINTS.csv: instants [s] and the joints' angles, shape (k, j) [rad], in degrees; numbers read back to a nanodegree."""
    rows = np.column_stack([times, np.degrees(postures)]).round(9) + 0.0
    lines = [",".join((TIME, *posture_columns(postures.shape[1]))), *(",".join(map(str, row)) for row in rows.tolist())]
    write_text(path, "\n".join(lines) + "\n")
