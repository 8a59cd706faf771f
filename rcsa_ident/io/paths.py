"""PATH.csv: where a tool's tip goes, and which way the tool points; limits along it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.io.curves import write_speed_csv
from rcsa_ident.io.text_columns import TextTable, read_table, table_of
from rcsa_ident.units import to_hz, to_rpm

PLACE, AXIS = ("x_mm", "y_mm", "z_mm"), ("i", "j", "k")
#: Farther than any arm reaches [m]: the lengths are in another unit.
_FARTHEST = 20.0


def read_path(path: str | Path) -> tuple[FloatArray, FloatArray]:
    """Return the places of a tool's tip, shape (k, 3) [m], and the tool's axis at each, from the tip into the spindle, shape (k, 3).

    Columns ``x_mm``, ``y_mm``, ``z_mm``, and ``i``, ``j``, ``k`` of the axis, by default upwards; further ones are left aside.

    Raises
    ------
    InputError
        Names the file and the line.
    """
    return _path_of(read_table(path, "path"))


def path_of(text: str, where: str) -> tuple[FloatArray, FloatArray]:
    """Return places and axes of a text as `read_path` finds them in a file; `where` is named in the messages."""
    return _path_of(table_of(text, "path", where))


def _path_of(table: TextTable) -> tuple[FloatArray, FloatArray]:
    axis = AXIS if any(name in table.header for name in AXIS) else ()
    table.check_header((*PLACE, *axis), f"columns {', '.join(PLACE)}, and {', '.join(AXIS)} of the tool's axis")
    if not table.lines:
        raise InputError("path", "no row", "one or more places", table.where)
    columns = dict(zip((*PLACE, *axis), table.columns((*PLACE, *axis)), strict=True))
    for name, values in columns.items():
        wrong = np.flatnonzero(~np.isfinite(values))
        if wrong.size:
            raise InputError(f"column {name}", "an empty cell or no number", "a finite number", table.at(int(wrong[0])))
    places = np.stack([columns[name] for name in PLACE], axis=1) * 1e-3
    far = np.flatnonzero(np.linalg.norm(places, axis=1) > _FARTHEST)
    if far.size:
        found = f"{np.linalg.norm(places[far[0]]):g} m from the robot's base"
        raise InputError("path", found, f"places within {_FARTHEST:g} m; are these millimetres?", table.at(int(far[0])))
    if not axis:
        return places, np.tile([0.0, 0.0, 1.0], (len(places), 1))
    axes = np.stack([columns[name] for name in AXIS], axis=1)
    size = np.linalg.norm(axes, axis=1)
    none = np.flatnonzero(size == 0.0)
    if none.size:
        raise InputError(", ".join(AXIS), "0, 0, 0", "a direction", table.at(int(none[0])))
    return places, axes / size[:, None]


def write_limits_along(path: str | Path, places: FloatArray, speeds: FloatArray, limits: FloatArray, chatter: FloatArray) -> None:
    """Write MAP.csv: a limit for each place and speed; an empty cell where the cut is stable up to the largest depth.

    Parameters
    ----------
    path : path
    places : array, shape (k, 3) [m]
    speeds : array, shape (n,) [rad/s]
    limits, chatter : arrays, shape (k, n) [m, rad/s]
    """
    k, n = limits.shape
    # metres and back leave a last digit that nobody asked for
    columns = {name: np.repeat((1e3 * places[:, i]).round(9), n) for i, name in enumerate(PLACE)}
    columns |= {"limit_depth_mm": 1e3 * limits.ravel(), "chatter_frequency_hz": to_hz(chatter.ravel())}
    write_speed_csv(path, np.tile(to_rpm(speeds, 9), k), columns)
