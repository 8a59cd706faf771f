"""Text tables: comma, semicolon or tab, with the decimal comma of German spreadsheets; recordings as such tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError, positive
from rcsa_ident.io.channels import TIME_COLUMNS, placed
from rcsa_ident.io.files import MEGABYTE, read_bytes
from rcsa_ident.io.time_base import Irregular
from rcsa_ident.io.validated_table import listed

LARGEST_TEXT = 256 * MEGABYTE
DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma"}


@dataclass(frozen=True, slots=True)
class TextTable:
    """Lines of a text table, split no further than needed.

    Parameters
    ----------
    where : str
        The file.
    header : tuple of str
    delimiter : str
    lines : list of str
        Without header and empty lines; the decimal sign is a point.
    numbers : list of int
        Line number of each, from 1, as an editor counts.
    """

    where: str
    header: tuple[str, ...]
    delimiter: str
    lines: list[str]
    numbers: list[int]

    def at(self, row: int) -> str:
        """Return file and line of a row."""
        return f"{self.where} line {self.numbers[row]}"

    def columns(self, names: Sequence[str]) -> list[FloatArray]:
        """Return the named columns, shape (n,) each; an empty cell is NaN.

        Raises
        ------
        InputError
            A cell is no number; the message names its line and column.
        """
        places = [self.header.index(name) for name in names]
        try:
            values = np.loadtxt(self.lines, delimiter=self.delimiter, usecols=places, comments=None, ndmin=2)
        except ValueError:
            # empty cells, or one that is wrong and must be found
            values = np.array([self._cells(row, names, places) for row in range(len(self.lines))])
        return [np.ascontiguousarray(values[:, i]) for i in range(len(names))]

    def _cells(self, row: int, names: Sequence[str], places: list[int]) -> list[float]:
        cells = self.lines[row].split(self.delimiter)
        values = []
        for name, place in zip(names, places, strict=True):
            text = cells[place].strip()
            try:
                # Python would read 1_000 as a number
                values.append(float("x" if "_" in text else text or "nan"))
            except ValueError:
                raise InputError(f"column {name}", text, "a number", self.at(row)) from None
        return values


def read_table(path: str | Path, field: str, largest: int = LARGEST_TEXT) -> TextTable:
    """Return a text table with its header; every row has as many cells as the header.

    Lines that start with # in front of the header are comments. With semicolons or tabs the decimal sign may be a comma.

    Parameters
    ----------
    path : path
    field : str
        What the file is, for the message.
    largest : int
        Bytes that are allowed.
    """
    return table_of(_text(read_bytes(path, field, largest), field, str(path)), field, str(path))


def table_of(text: str, field: str, where: str) -> TextTable:
    """Return the table of a text, as `read_table` does of a file; `where` is named in the messages."""
    lines = text.replace('"', "").splitlines()
    numbers = [i for i, line in enumerate(lines, start=1) if line and not line.isspace()]
    while numbers and lines[numbers[0] - 1].lstrip().startswith("#"):
        numbers.pop(0)
    if len(numbers) < 2:
        raise InputError(field, f"{len(numbers)} lines", "a line of column names and at least one line of numbers", where)
    first = lines[numbers.pop(0) - 1]
    delimiter = next((d for d in DELIMITERS if d in first), ",")
    header = tuple(name.strip() for name in first.split(delimiter))
    if _is_number(header[0]):
        raise InputError(f"{field} header", header[0], "column names in the first line", where)
    rows = [lines[i - 1] for i in numbers]
    width = len(header)
    for row, number in zip(rows, numbers, strict=True):
        if row.count(delimiter) != width - 1:
            found = f"{row.count(delimiter) + 1} cells"
            raise InputError(field, found, f"{width} cells as in the header, divided by {DELIMITERS[delimiter]}", f"{where} line {number}")
    if delimiter != ",":
        rows = _decimal_point(rows, numbers, field, where)
    return TextTable(where, header, delimiter, rows, numbers)


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, list[FloatArray]]:
    """Return the sampling rate [Hz] and the named channels of a recording, shape (n,) each.

    The rate comes from a column ``time`` in seconds, else from the campaign. Samples that the time column skips are NaN.

    Parameters
    ----------
    path : path
    names : sequence of str
        Channels that are wanted.
    default_rate : float or None [Hz]
        For a file that carries no rate.
    """
    table = read_table(path, "recording")
    for name in names:
        if table.header.count(name) != 1:
            found = "no such channel" if name not in table.header else "two columns of that name"
            raise InputError(f"channel {name}", found, f"one column of the file: {listed(table.header)}", table.where)
    time = [name for name in table.header if name.lower() in TIME_COLUMNS and name not in names]
    if len(time) > 1:
        raise InputError("time", f"columns {' and '.join(time)}", "one time column", table.where)
    columns = table.columns([*time, *names])
    if not time:
        if default_rate is None:
            raise InputError("sampling_rate_hz", "nothing", "a column 'time' [s], or the campaign's rate [Hz]", table.where)
        return positive("sampling_rate_hz", default_rate, "Hz"), columns
    try:
        return placed(columns[0], columns[1:], default_rate)
    except Irregular as error:
        raise InputError("column time", error.found, error.allowed, table.at(error.row)) from None


def _text(raw: bytes, field: str, where: str) -> str:
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        encodings = ["utf-16"]
    elif b"\0" in raw:
        raise InputError(field, "binary data", "a text table", where)
    else:
        encodings = ["utf-8-sig", "cp1252"]
    for encoding in encodings:
        try:
            return raw.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise InputError(field, "bytes that are not text", "a text table in UTF-8", where)


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _decimal_point(rows: list[str], numbers: list[int], field: str, where: str) -> list[str]:
    """Turn decimal commas into points; a file with both signs could mean thousands by either, so it is refused."""
    commas = next((i for i, row in enumerate(rows) if "," in row), None)
    if commas is None:
        return rows
    points = next((i for i, row in enumerate(rows) if "." in row), None)
    if points is not None:
        line = max(commas, points)
        raise InputError(field, rows[line].strip(), "one decimal sign in the whole file, comma or point", f"{where} line {numbers[line]}")
    return [row.replace(",", ".") for row in rows]
