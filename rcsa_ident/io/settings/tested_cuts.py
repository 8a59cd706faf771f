"""CUTS.csv: cuts that were tried, and what was seen; TESTS.csv: the same with the probability that each is stable."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, from_rpm, to_hz, to_rpm
from rcsa_ident.io.files import write_text
from rcsa_ident.io.text_columns import TextTable, read_table, table_of
from rcsa_ident.io.validated_table import listed
from rcsa_ident.stability.labels.coverage import TestedAnswers
from rcsa_ident.stability.labels.tested_cuts import EDGE_STATES, ORDINAL, STRATEGIES, OwnConditions, TestedCuts, Verdict

COLUMNS = ("spindle_speed_rpm", "axial_depth_mm", "verdict")
#: May stand beside them; empty where nothing was measured.
CHATTER = "chatter_frequency_hz"
#: May stand beside them, too, with what each cut tells of itself; empty where it is as of the cut that is asked about.
_NUMBERS = {
    "radial_width_mm": ("radial_width", 1e-3),
    "radial_immersion": ("radial_immersion", 1.0),
    "feed_per_tooth_mm": ("feed_per_tooth", 1e-3),
}
_WORDS = {"strategy": STRATEGIES, "edge_state": EDGE_STATES, "session": ()}
FURTHER = ("verdict_2", "verdict_3")
OWN = (*_NUMBERS, *_WORDS, *FURTHER)
#: Verdicts as numbers, as tables of others have them.
_CODES = dict(zip("012", ORDINAL, strict=True))


def read_tested_cuts(path: str | Path) -> TestedCuts:
    """Return the cuts of a table with the columns `COLUMNS`, with or without `CHATTER` and `OWN`.

    Raises `InputError`, which names the file and the line.
    """
    return _cuts_of(read_table(path, "tested cuts"))


def read_candidates(path: str | Path) -> TestedCuts:
    """Return cuts that may be tested: the first two of `COLUMNS`; verdicts, where there are any, are not looked at."""
    table = read_table(path, "cuts to choose from")
    speed, depth = _conditions(table, COLUMNS[:2])
    return TestedCuts(from_rpm(speed), depth * 1e-3, (Verdict.MARGINAL,) * speed.size, own=_own(table))


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
        try:
            verdicts.append(_verdict(text, COLUMNS[2]))
        except InputError as error:
            raise InputError(f"column {error.field}", error.found, error.allowed, table.at(row)) from None
    return TestedCuts(from_rpm(speed), depth * 1e-3, tuple(verdicts), from_hz(_chatter(table)), _own(table))


def _verdict(text: str, column: str) -> Verdict:
    """A verdict as a word, or as 0, 1 or 2."""
    word = _CODES.get(text, text.lower())
    if word not in list(Verdict):
        raise InputError(column, text or "nothing", f"one of {', '.join(Verdict)}, or 0, 1, 2")
    return Verdict(word)


def _own(table: TextTable) -> tuple[OwnConditions, ...]:
    """What each cut tells of itself."""
    _one_tooling(table)
    columns = {name: table.texts(name) for name in OWN if name in table.header}
    found = []
    for row in range(len(table.lines)):
        try:
            found.append(own_conditions({name: texts[row] for name, texts in columns.items()}))
        except InputError as error:
            raise InputError(f"column {error.field}", error.found, error.allowed, table.at(row)) from None
    return tuple(found)


def own_conditions(cells: Mapping[str, str]) -> OwnConditions:
    """Return what the cells of one row, by their columns of `OWN`, tell of a cut; an empty cell tells nothing.

    Raises `InputError`, which names the column.
    """
    row: dict[str, Any] = {}
    for column, (name, unit) in _NUMBERS.items():
        if cells.get(column):
            row[name] = _positive(cells[column], column) * unit
    for column, allowed in _WORDS.items():
        word = cells.get(column, "")
        row[column] = word.lower() if allowed else word
        if allowed and row[column] not in ("", *allowed):
            raise InputError(column, word, f"one of {', '.join(allowed)}, or nothing")
    votes = [_verdict(cells[column], column) for column in FURTHER if cells.get(column)]
    return OwnConditions(**row, further=tuple(votes))


def _positive(text: str, column: str) -> float:
    allowed = f"a finite number above 0{' [mm]' if column.endswith('_mm') else ''}, or nothing"
    try:
        value = float("x" if "_" in text else text)
    except ValueError:
        raise InputError(column, text, allowed) from None
    if not 0.0 < value < np.inf:
        raise InputError(column, text, allowed)
    return value


def _one_tooling(table: TextTable) -> None:
    """Refuse a table of several toolings: a learnt tip answers for one."""
    names = dict.fromkeys(table.texts("tooling")) if "tooling" in table.header else {}
    if len(names) > 1:
        raise InputError(
            "column tooling", f"{len(names)} toolings: {listed(tuple(names))}", "one tooling: each learns by itself", table.where
        )


def _chatter(table: TextTable) -> FloatArray:
    """Measured frequencies [Hz], NaN where none is told."""
    if CHATTER not in table.header:
        return np.full(len(table.lines), np.nan)
    (found,) = table.columns((CHATTER,))
    wrong = np.flatnonzero(~(np.isnan(found) | ((found > 0.0) & np.isfinite(found))))
    if wrong.size:
        raise InputError(f"column {CHATTER}", f"{found[wrong[0]]:g}", "a finite number above 0 [Hz], or nothing", table.at(int(wrong[0])))
    return found


def write_tests(path: str | Path, cuts: TestedCuts, answers: TestedAnswers) -> None:
    """Write TESTS.csv: each tested cut with all that is read of it, the probability that it is stable, and whether labels cover it."""
    columns = {
        COLUMNS[0]: [f"{speed:.10g}" for speed in to_rpm(cuts.spindle_speed)],
        COLUMNS[1]: [f"{depth:.10g}" for depth in 1e3 * cuts.axial_depth],
        COLUMNS[2]: [str(each) for each in cuts.verdict],
    }
    if np.isfinite(cuts.chatter_frequency).any():
        columns[CHATTER] = ["" if np.isnan(each) else f"{each:.10g}" for each in to_hz(cuts.chatter_frequency)]
    # a session named with a comma, in a table that had semicolons, is no two cells
    columns |= {column: [cell_of(own, column).replace(",", ";") for own in cuts.own] for column in own_columns(cuts)}
    columns["probability_stable"] = [f"{p:.6g}" for p in answers.stable]
    columns["covered"] = [str(each) for each in answers.covered]
    write_text(path, "\n".join([",".join(columns), *map(",".join, zip(*columns.values(), strict=True)), ""]))


def own_columns(cuts: TestedCuts) -> list[str]:
    """Return the columns of `OWN` in which any cut tells something of itself."""
    return [column for column in OWN if any(cell_of(own, column) for own in cuts.own)]


def cell_of(own: OwnConditions, column: str) -> str:
    """Return the cell of a column of `OWN`, as `own_conditions` reads it."""
    if column in FURTHER:
        at = FURTHER.index(column)
        return str(own.further[at]) if at < len(own.further) else ""
    if column in _WORDS:
        return str(getattr(own, column))
    name, unit = _NUMBERS[column]
    value = getattr(own, name)
    return "" if value is None else f"{value / unit:.10g}"
