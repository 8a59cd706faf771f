"""Files of a tool's path, G-code programs and PATH.csv, read and written; limits along a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.units import from_rpm, to_hz, to_rpm
from rcsa_ident.io.curves.tips import write_speed_csv
from rcsa_ident.io.files import write_text
from rcsa_ident.io.paths.gcode import Kept, read_gcode, write_gcode
from rcsa_ident.io.text_columns import TextTable, read_table, table_of
from rcsa_ident.io.unread_columns import left_aside, reading_tables
from rcsa_ident.signals.verdict import RecordCode
from rcsa_ident.toolpath.path import ToolPath

PLACE, AXIS = ("x_mm", "y_mm", "z_mm"), ("i", "j", "k")
FEED, SPEED = "feed_mm_per_min", "spindle_speed_rpm"
PROGRAMS = (".nc", ".gcode", ".ngc", ".tap", ".mpf", ".eia", ".cnc", ".txt")
#: Programs in plain text of Heidenhain, which are told as what they are.
_PLAIN = ".h"
_ALLOWED = f"a program, {', '.join(PROGRAMS)}, or a table, .csv"
#: Farther than any arm reaches [m]: the lengths are in another unit.
_FARTHEST = 20.0


def read_tool_path(path: str | Path) -> ToolPath:
    r"""Return a tool's path: of a program (`read_gcode`), or of a table.

    A table has columns ``x_mm``, ``y_mm``, ``z_mm``; ``i``, ``j``, ``k`` of the tool's axis from the tip into the spindle, by default
    upwards; ``feed_mm_per_min``, ``inf`` for a rapid move, and ``spindle_speed_rpm`` of the move that ends at the row's place, empty where
    nobody told.

    Raises
    ------
    InputError
        Names the file and the line.

    Examples
    --------
    >>> from rcsa_ident.io.paths.tool_paths import read_tool_path
    >>> from pathlib import Path
    >>> _ = Path("SLOT.nc").write_text("G21 G90 G0 X0 Y0 Z0\nG1 X60 F1200\nY20\n")
    >>> path = read_tool_path("SLOT.nc")
    >>> len(path), round(1e3 * path.length, 1)
    (3, 80.0)
    """
    kind = Path(path).suffix.lower()
    if kind in (*PROGRAMS, _PLAIN):
        found = read_gcode(path)
        _check_reach(found, lambda row: f"{path} line {found.line[row]}")
        return found
    if kind != ".csv":
        raise InputError("path", Path(path).name, _ALLOWED)
    return _path_of(read_table(path, "path"))


def tool_path_of(text: str, where: str) -> ToolPath:
    """Return the path of a table's text as `read_tool_path` finds it in a file, columns that are left aside among its remarks; `where` is
    named in the messages."""
    with reading_tables():
        found = _path_of(table_of(text, "path", where))
        return replace(found, remarks=tuple(Remark(RecordCode.ASSUMED, sentence) for sentence in left_aside()))


def _path_of(table: TextTable) -> ToolPath:
    axis = AXIS if any(name in table.header for name in AXIS) else ()
    told = tuple(name for name in (FEED, SPEED) if name in table.header)
    allowed = f"columns {', '.join(PLACE)}, {', '.join(AXIS)} of the tool's axis, {FEED} and {SPEED}"
    table.check_header((*PLACE, *axis, *told), allowed)
    columns = dict(zip((*PLACE, *axis, *told), table.columns((*PLACE, *axis, *told)), strict=True))
    for name in (*PLACE, *axis):
        _check(table, name, columns[name], np.isfinite(columns[name]), "a finite number")
    if FEED in columns:
        _check(table, FEED, columns[FEED], ~(columns[FEED] <= 0.0), "a feed above 0, inf for a rapid move, or nothing [mm/min]")
    if SPEED in columns:
        right = np.isnan(columns[SPEED]) | ((columns[SPEED] >= 0.0) & np.isfinite(columns[SPEED]))
        _check(table, SPEED, columns[SPEED], right, "0 or more, or nothing [rev/min]")
    given: dict[str, Any] = {"line": np.array(table.numbers)}
    if axis:
        given["axes"] = np.stack([columns[name] for name in axis], axis=1)
        none = np.flatnonzero(np.linalg.norm(given["axes"], axis=1) == 0.0)
        if none.size:
            raise InputError(", ".join(AXIS), "0, 0, 0", "a direction", table.at(int(none[0])))
    if FEED in columns:
        given["feed"] = columns[FEED] / 6e4
    if SPEED in columns:
        given["speed"] = from_rpm(columns[SPEED])
    found = ToolPath(1e-3 * np.stack([columns[name] for name in PLACE], axis=1), **given)
    _check_reach(found, table.at)
    return found


def _check(table: TextTable, name: str, values: FloatArray, right: np.ndarray, allowed: str) -> None:
    wrong = np.flatnonzero(~right)
    if wrong.size:
        value = values[wrong[0]]
        found = "an empty cell or no number" if np.isnan(value) else f"{value:g}"
        raise InputError(f"column {name}", found, allowed, table.at(int(wrong[0])))


def _check_reach(path: ToolPath, at: Callable[[int], str]) -> None:
    far = np.flatnonzero(np.linalg.norm(path.places, axis=1) > _FARTHEST)
    if far.size:
        found = f"{np.linalg.norm(path.places[far[0]]):g} m from the origin"
        raise InputError("path", found, f"places within {_FARTHEST:g} m; are these millimetres?", at(int(far[0])))


def check_path_name(path: str | Path) -> None:
    """Refuse a file whose name says none of the forms that a path is written in."""
    if Path(path).suffix.lower() not in (*PROGRAMS, ".csv"):
        raise InputError("output file", Path(path).name, _ALLOWED)


def write_tool_path(path: str | Path, tool_path: ToolPath, decimals: int = 4, kept: Sequence[Kept] = ()) -> None:
    """Write a path in the form that the file's name says; `read_tool_path` gives it back, line numbers aside.

    `decimals`: of the places in millimetres; those of a program only, a table has them to a picometre
    `kept`: what else a program says, of which a table has nothing
    """
    check_path_name(path)
    if Path(path).suffix.lower() in PROGRAMS:
        write_gcode(path, tool_path, decimals, kept)
        return
    # metres and back leave a last digit that nobody asked for
    columns = dict(zip(PLACE, (1e3 * tool_path.places).round(9).T, strict=True))
    if np.any(tool_path.axes != [0.0, 0.0, 1.0]):
        columns |= dict(zip(AXIS, tool_path.axes.T, strict=True))
    for name, values in ((FEED, (6e4 * tool_path.feed).round(9)), (SPEED, to_rpm(tool_path.speed, 9))):
        if not np.all(np.isnan(values)):
            columns[name] = values
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    text = [",".join(columns), *(",".join("" if np.isnan(v) else str(v) for v in row) for row in rows)]
    write_text(path, "\n".join(text) + "\n")


def write_limits_along(path: str | Path, places: FloatArray, speeds: FloatArray, limits: FloatArray, chatter: FloatArray) -> None:
    """Write MAP.csv: a limit for each place and speed; an empty cell where the cut is stable up to the largest depth.

    `places` [m], shape (k, 3); `speeds` [rad/s], shape (n,); `limits`, `chatter` [m, rad/s], shape (k, n)
    """
    k, n = limits.shape
    # metres and back leave a last digit that nobody asked for
    columns = {name: np.repeat((1e3 * places[:, i]).round(9), n) for i, name in enumerate(PLACE)}
    columns |= {"limit_depth_mm": 1e3 * limits.ravel(), "chatter_frequency_hz": to_hz(chatter.ravel())}
    write_speed_csv(path, np.tile(to_rpm(speeds, 9), k), columns)
