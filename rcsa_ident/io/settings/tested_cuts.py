"""CUTS.csv: cuts that were tried, and what was seen; TESTS.csv: the same with the probability that each is stable."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, from_rpm, to_rpm
from rcsa_ident.io.files import write_text
from rcsa_ident.io.text_columns import TextTable, read_table, table_of
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict

COLUMNS = ("spindle_speed_rpm", "axial_depth_mm", "verdict")
#: May stand beside them; empty where nothing was measured.
CHATTER = "chatter_frequency_hz"


def read_tested_cuts(path: str | Path) -> TestedCuts:
    """Return the cuts of a table with the columns `COLUMNS`, with or without `CHATTER`.

    Raises `InputError`, which names the file and the line.
    """
    return _cuts_of(read_table(path, "tested cuts"))


def read_candidates(path: str | Path) -> TestedCuts:
    """Return cuts that may be tested: the first two of `COLUMNS`; verdicts, where there are any, are not looked at."""
    table = read_table(path, "cuts to choose from")
    speed, depth = _conditions(table, COLUMNS[:2])
    return TestedCuts(from_rpm(speed), depth * 1e-3, (Verdict.MARGINAL,) * speed.size)


def tested_cuts_of(text: str, where: str) -> TestedCuts:
    """Return the cuts of a text as `read_tested_cuts` finds them in a file; `where` is named in the messages."""
    return _cuts_of(table_of(text, "tested cuts", where))


def _conditions(table: TextTable, wanted: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Speeds [rev/min] and depths [mm] of a table that has all the columns that are wanted."""
    table.check_header(wanted, f"columns {', '.join(wanted)}")
    speed, depth = table.columns(COLUMNS[:2])
    for name, values, unit in zip(COLUMNS, (speed, depth), ("rev/min", "mm"), strict=False):
        wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
        if wrong.size:
            row = int(wrong[0])
            raise InputError(f"column {name}", f"{values[row]:g}", f"a finite number above 0 [{unit}]", table.at(row))
    return speed, depth


def _cuts_of(table: TextTable) -> TestedCuts:
    speed, depth = _conditions(table, COLUMNS)
    verdicts = []
    for row, text in enumerate(table.texts(COLUMNS[2])):
        if text.lower() not in list(Verdict):
            raise InputError(f"column {COLUMNS[2]}", text or "nothing", f"one of {', '.join(Verdict)}", table.at(row))
        verdicts.append(Verdict(text.lower()))
    return TestedCuts(from_rpm(speed), depth * 1e-3, tuple(verdicts), from_hz(_chatter(table)))


def _chatter(table: TextTable) -> FloatArray:
    """Measured frequencies [Hz], NaN where none is told."""
    if CHATTER not in table.header:
        return np.full(len(table.lines), np.nan)
    (found,) = table.columns((CHATTER,))
    wrong = np.flatnonzero(~(np.isnan(found) | ((found > 0.0) & np.isfinite(found))))
    if wrong.size:
        raise InputError(f"column {CHATTER}", f"{found[wrong[0]]:g}", "a finite number above 0 [Hz], or nothing", table.at(int(wrong[0])))
    return found


def write_tests(path: str | Path, cuts: TestedCuts, probability: FloatArray) -> None:
    """Write TESTS.csv: each tested cut with the probability that it is stable. `probability`, shape (n,)."""
    rows = zip(to_rpm(cuts.spindle_speed), 1e3 * cuts.axial_depth, cuts.verdict, probability, strict=True)
    lines = [f"{speed:.10g},{depth:.10g},{verdict},{p:.6g}" for speed, depth, verdict, p in rows]
    write_text(path, "\n".join([",".join((*COLUMNS, "probability_stable")), *lines, ""]))
