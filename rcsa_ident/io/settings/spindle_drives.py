"""SPINDLE.csv: what a spindle's motor has over its speed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.power import SpindleDrive
from rcsa_ident.io.text_columns import read_table
from rcsa_ident.io.validated_table import listed

SPEED, POWER, TORQUE = "spindle_speed_rpm", "power_kw", "torque_nm"


def read_spindle_drive(path: str | Path) -> SpindleDrive:
    """Return the drive of a table with `SPEED` and `POWER`, `TORQUE` or both; its highest speed is the spindle's.

    Raises `InputError`, which names the file and the line.
    """
    table = read_table(path, "spindle")
    names = [name for name in (POWER, TORQUE) if name in table.header]
    if SPEED not in table.header or not names:
        raise InputError("columns", f"only {listed(table.header)}", f"{SPEED} and {POWER}, {TORQUE} or both", table.where)
    for name in (SPEED, *names):
        if table.header.count(name) > 1:
            raise InputError(f"column {name}", "two columns of that name", "every name once", table.where)
    speed, *found = table.columns([SPEED, *names])
    for name, values in zip((SPEED, *names), (speed, *found), strict=True):
        wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
        if wrong.size:
            raise InputError(f"column {name}", f"{values[wrong[0]]:g}", "a finite number above 0", table.at(int(wrong[0])))
    falls = np.flatnonzero(np.diff(speed) <= 0.0)
    if falls.size:
        raise InputError(f"column {SPEED}", f"{speed[falls[0] + 1]:g}", "increasing speeds [rev/min]", table.at(int(falls[0]) + 1))
    columns = dict(zip(names, found, strict=True))
    unknown = np.full(speed.size, np.inf)
    power = 1e3 * columns[POWER] if POWER in columns else unknown
    return SpindleDrive(from_rpm(speed), power, columns.get(TORQUE, unknown), float(from_rpm(speed[-1])))
