"""CUTS.csv: cuts that were tried, and what was seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rcsa_ident.errors import InputError
from rcsa_ident.io.text_columns import TextTable, read_table, table_of
from rcsa_ident.io.validated_table import listed
from rcsa_ident.stability.tested_cuts import TestedCuts, Verdict
from rcsa_ident.units import from_rpm

COLUMNS = ("spindle_speed_rpm", "axial_depth_mm", "verdict")


def read_tested_cuts(path: str | Path) -> TestedCuts:
    """Return the cuts of a table with the columns `COLUMNS`; further columns are left aside.

    Raises
    ------
    InputError
        Names the file and the line.
    """
    return _cuts_of(read_table(path, "tested cuts"))


def tested_cuts_of(text: str, where: str) -> TestedCuts:
    """Return the cuts of a text as `read_tested_cuts` finds them in a file; `where` is named in the messages."""
    return _cuts_of(table_of(text, "tested cuts", where))


def _cuts_of(table: TextTable) -> TestedCuts:
    for name in COLUMNS:
        if table.header.count(name) != 1:
            found = f"only {listed(table.header)}" if name not in table.header else "two columns of that name"
            raise InputError(f"column {name}", found, f"columns {', '.join(COLUMNS)}", table.where)
    speed, depth = table.columns(COLUMNS[:2])
    for name, values, unit in zip(COLUMNS, (speed, depth), ("rev/min", "mm"), strict=False):
        wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
        if wrong.size:
            row = int(wrong[0])
            raise InputError(f"column {name}", f"{values[row]:g}", f"a finite number above 0 [{unit}]", table.at(row))
    place = table.header.index(COLUMNS[2])
    verdicts = []
    for row, line in enumerate(table.lines):
        text = line.split(table.delimiter)[place].strip()
        if text.lower() not in list(Verdict):
            raise InputError(f"column {COLUMNS[2]}", text or "nothing", f"one of {', '.join(Verdict)}", table.at(row))
        verdicts.append(Verdict(text.lower()))
    return TestedCuts(from_rpm(speed), depth * 1e-3, tuple(verdicts))
