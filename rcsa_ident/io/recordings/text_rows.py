"""Lines of numbers of a text table: where they begin, what divides their cells, and their values, clocks in seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.text_header import DELIMITERS, is_number, split, tells_rate

#: A clock, with a date before it or not; of two numbers it is minutes and seconds where the seconds have decimals. And a date alone.
STAMP = re.compile(
    r"(?:\d{4}[-/.]\d{1,2}[-/.]\d{1,2}[T ]+|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}[T ]+)?"
    r"(?:(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2}(?:[.,:]\d+)?)|(?P<minutes>\d{1,4}):(?P<seconds>\d{2}[.,]\d+))"
    r"\s*(?P<noon>[AP]M)?(?:Z|[+-]\d{2}:?\d{2})?",
    re.IGNORECASE,
)
_DATE = re.compile(r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}")
_DATE_AND_CLOCK = re.compile(rf"({_DATE.pattern}) (?=\d{{1,2}}:)")
_DAY = 86_400.0
#: Lines of remarks in front of the names, at most.
_MOST_HEADER = 200


def lines_of(text: str) -> list[str]:
    """Return the lines of a text without what divides cells behind the last one."""
    return [line.rstrip(" \t;,") for line in text.splitlines()]


def beside(lines: list[str]) -> list[str]:
    """Return an oscilloscope's file, whose settings stand beside its numbers channel by channel, with them above; others as they are."""
    first = split(lines[0], ",") if lines else []
    begins = [i for i, cell in enumerate(first) if cell.lower() == "record length"]
    if begins[:1] != [0] or not all(len(first) > i + 4 and is_number(first[i + 3]) for i in begins):
        return lines
    cells = [split(line, ",") for line in lines]
    above, blocks, units = [], [], []
    for i, begin in enumerate(begins):
        settings = {row[begin].lower(): row[begin + 1] for row in cells if len(row) > begin + 1 and row[begin]}
        above += [f"{key}: {value}" for key, value in settings.items() if tells_rate(key)]
        units += [settings.get("horizontal units", ""), settings.get("vertical units", "")]
        names = ["Time", settings.get("source") or f"CH{i + 1}"]
        blocks.append([names, *(row[begin + 3 : begin + 5] for row in cells if len(row) > begin + 4)])
    table = [",".join(cell for cells in row for cell in cells) for row in zip(*blocks, strict=False)]
    return [*above, table[0], ",".join(units), *table[1:]]


def first_numbers(lines: Sequence[str], where: str) -> tuple[int, str, bool]:
    """Return the index of the first line of numbers, the delimiter ('' for blanks), and whether the decimal sign is a comma.

    Two lines of two or more numbers follow each other there, cells between them may be empty; failing that, two lines of one number each.
    """
    for least in (2, 1):
        for i, line in enumerate(lines[:_MOST_HEADER]):
            for delimiter in (*DELIMITERS, "") if least == 2 else ("",):
                if delimiter and delimiter not in line:
                    continue
                following = next((later for later in lines[i + 1 : _MOST_HEADER + 2] if later), "")
                for comma in (False, True) if delimiter != "," else (False,):
                    if all(_has_numbers(each, delimiter, comma, least) for each in (line, following)):
                        while i and lines[i - 1] and _has_numbers(lines[i - 1], delimiter, comma, 1):
                            i -= 1
                        return i, delimiter, comma
    raise InputError("recording", "no two lines of numbers that follow each other", "a table of numbers with names above it", where)


def _has_numbers(line: str, delimiter: str, comma: bool, least: int) -> bool:
    cells = row_of(line, delimiter)
    filled = [cell for cell in cells if cell]
    return len(filled) >= least and (least > 1 or len(cells) == 1 or bool(delimiter)) and all(_is_cell(cell, comma) for cell in filled)


def row_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line of numbers; a date and a clock with a blank between them are one."""
    return split(line, delimiter) if delimiter else split(_DATE_AND_CLOCK.sub(r"\1T", line), "")


def _is_cell(cell: str, comma: bool) -> bool:
    return _is_number(cell, comma) or STAMP.fullmatch(cell) is not None or _DATE.fullmatch(cell) is not None


def _is_number(cell: str, comma: bool) -> bool:
    text = cell.replace(",", ".") if comma else cell
    if "_" in text:
        return False
    try:
        float(text)
    except ValueError:
        return False
    return True


def rows_of(lines: Sequence[str], start: int, delimiter: str) -> tuple[list[str], int]:
    """Return lines of numbers, without a header that comes again, and their columns."""
    rows = [line for line in lines[start:] if line]
    # two equal rows are two rows, also where something stands between the first one and the others
    repeated = {
        line for line in lines[:start] if not all(_is_cell(cell, False) or _is_cell(cell, True) for cell in row_of(line, delimiter) if cell)
    }
    rows = [row.replace('"', "") for row in rows if row not in repeated]
    return rows, max(len(row_of(row, delimiter)) for row in rows[:_MOST_HEADER])


def numbers_of(rows: list[str], delimiter: str, comma: bool, width: int, where: str) -> tuple[FloatArray, list[int]]:
    """Return all lines of numbers, shape (n, width), and which columns hold clocks, in seconds from the first; an empty cell is NaN."""
    first = row_of(rows[0], delimiter)
    clocks = [i for i, cell in enumerate(first) if STAMP.fullmatch(cell)]
    dates = [i for i, cell in enumerate(first) if _DATE.fullmatch(cell) and not _is_number(cell, comma)]
    if clocks or dates:
        rows = _without_stamps(rows, delimiter, clocks, dates, where)
    if comma:
        rows = [row.replace(",", ".") for row in rows]
    try:
        values = np.loadtxt(rows, delimiter=delimiter or None, comments=None, ndmin=2)
        if values.shape[1] == width:
            return values, clocks
    except ValueError:
        pass
    full = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        cells = split(row, delimiter)
        if len(cells) > width or any(cell and not _is_number(cell, False) for cell in cells):
            raise InputError("recording", row, f"{width} numbers", f"{where}, row {i + 1} of numbers")
        full[i, : len(cells)] = [float(cell) if cell else np.nan for cell in cells]
    return full, clocks


def _without_stamps(rows: list[str], delimiter: str, clocks: list[int], dates: list[int], where: str) -> list[str]:
    """Rows whose clocks are seconds from the first row on, past midnight, too, and whose dates are zero."""
    begin, before, days = dict.fromkeys(clocks, np.nan), dict.fromkeys(clocks, -np.inf), dict.fromkeys(clocks, 0)
    found = []
    for number, row in enumerate(rows, start=1):
        cells = row_of(row, delimiter)
        for i in clocks:
            stamp = STAMP.fullmatch(cells[i]) if i < len(cells) else None
            if stamp is None:
                raise InputError("time", cells[i] if i < len(cells) else "nothing", "a clock as h:m:s", f"{where}, row {number} of numbers")
            value = _seconds_of(stamp)
            days[i] += value < before[i] - 0.5 * _DAY
            before[i] = value
            begin[i] = value if number == 1 else begin[i]
            # a clock has nine decimals at most
            cells[i] = repr(round(days[i] * _DAY + value - begin[i], 9))
        for i in dates:
            if i < len(cells):
                cells[i] = "0"
        found.append((delimiter or " ").join(cells))
    return found


def _seconds_of(stamp: re.Match[str]) -> float:
    if stamp["minutes"]:
        return 60.0 * float(stamp["minutes"]) + float(stamp["seconds"].replace(",", "."))
    hours = float(stamp["h"])
    if stamp["noon"]:
        hours = hours % 12.0 + (12.0 if stamp["noon"].upper() == "PM" else 0.0)
    return 3600.0 * hours + 60.0 * float(stamp["m"]) + float(stamp["s"].replace(",", ".").replace(":", "."))
