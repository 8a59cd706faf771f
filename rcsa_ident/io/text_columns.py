"""Text tables: comma, semicolon or tab, with the decimal comma of German spreadsheets; recordings as such tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.io.channels import Channel, Scratch, placed
from rcsa_ident.io.files import MEGABYTE, existing_file, read_bytes
from rcsa_ident.io.text_header import DELIMITERS
from rcsa_ident.io.time_base import Irregular
from rcsa_ident.io.unread_columns import unread_of
from rcsa_ident.io.validated_table import listed

LARGEST_TEXT = 256 * MEGABYTE
#: Bytes of a part, in which recordings are read.
_PART = 4 * MEGABYTE
_UTF16 = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, slots=True)
class TextTable:
    """Lines of a text table, split no further than needed.

    `where`: the file
    `lines`: without header and empty lines; the decimal sign is a point
    `numbers`: line number of each, from 1, as an editor counts
    `unread`: columns that nobody has asked for yet
    """

    where: str
    header: tuple[str, ...]
    delimiter: str
    lines: list[str]
    numbers: list[int]
    unread: list[str] = field(default_factory=list)

    def at(self, row: int) -> str:
        """Return file and line of a row."""
        return f"{self.where} line {self.numbers[row]}"

    def check_header(self, names: Sequence[str], allowed: str) -> None:
        """Refuse a table in which one of the columns is missing or stands twice; `allowed` says in words which there should be."""
        for name in names:
            if self.header.count(name) != 1:
                found = f"only {listed(self.header)}" if name not in self.header else "two columns of that name"
                raise InputError(f"column {name}", found, allowed, self.where)

    def columns(self, names: Sequence[str]) -> list[FloatArray]:
        """Return the named columns, shape (n,) each; an empty cell is NaN.

        Raises `InputError`: a cell is no number; the message names its line and column.
        """
        if not self.lines:  # a part of a long file that is empty lines alone
            return [np.empty(0) for _ in names]
        places = self._places(names)
        try:
            values = np.loadtxt(self.lines, delimiter=self.delimiter, usecols=places, comments=None, ndmin=2)
        except ValueError:
            # empty cells, or one that is wrong and must be found
            values = np.array([self._cells(row, names, places) for row in range(len(self.lines))])
        return [np.ascontiguousarray(values[:, i]) for i in range(len(names))]

    def texts(self, name: str) -> list[str]:
        """Return the cells of the named column."""
        (place,) = self._places([name])
        return [line.split(self.delimiter)[place].strip() for line in self.lines]

    def _places(self, names: Sequence[str]) -> list[int]:
        self.unread[:] = [name for name in self.unread if name not in names]
        return [self.header.index(name) for name in names]

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

    `field`: what the file is, for the message
    `largest`: bytes that are allowed
    """
    return table_of(decoded(read_bytes(path, field, largest), field, str(path)), field, str(path))


def table_of(text: str, field: str, where: str) -> TextTable:
    """Return the table of a text, as `read_table` does of a file; `where` is named in the messages."""
    table = _Parts(field, where).next(text)
    return replace(table, unread=unread_of(where, table.header))


class _Parts:
    """A table that comes in parts, each of whole lines; the first one has the header.

    `field`, `where`: what the file is, and the file, for the messages
    """

    def __init__(self, field: str, where: str) -> None:
        self.field, self.where, self.lines = field, where, 0
        self.header: tuple[str, ...] = ()
        self.delimiter = ","
        self.comma: tuple[int, str] | None = None
        self.point: tuple[int, str] | None = None

    def next(self, text: str) -> TextTable:
        """Return the next part; its rows are checked against the header and the signs of the parts before."""
        lines = text.replace('"', "").splitlines()
        behind, self.lines = self.lines, self.lines + len(lines)
        numbers = [i for i, line in enumerate(lines, start=1) if line and not line.isspace()]
        if not self.header:
            self._read_header(lines, numbers)
        rows = [lines[i - 1] for i in numbers]
        numbers = [behind + i for i in numbers]
        width, delimiter = len(self.header), self.delimiter
        for row, number in zip(rows, numbers, strict=True):
            if row.count(delimiter) != width - 1:
                found, allowed = f"{row.count(delimiter) + 1} cells", f"{width} cells as in the header, divided by {DELIMITERS[delimiter]}"
                raise InputError(self.field, found, allowed, f"{self.where} line {number}")
        if delimiter != ",":
            rows = self._decimal_point(rows, numbers)
        return TextTable(self.where, self.header, delimiter, rows, numbers)

    def plain(self, block: bytes, names: Sequence[str]) -> tuple[np.ndarray, list[FloatArray]] | None:
        """Return line numbers and named columns of a part, shape (n,) each, as `next` and `TextTable.columns` would.

        At a fifth of their time; None where something in it is not plain, and where decimal signs stand for the first time.
        """
        comma, point = (sign in block for sign in (b",", b"."))
        comma = comma and self.delimiter != ","
        if not self.header or (comma and (self.comma is None or point)) or (point and self.delimiter != "," and self.point is None):
            return None
        # the compiler is no business of those who read a short file
        from rcsa_ident.io import _kernels

        raw = np.frombuffer(block if block.endswith(b"\n") else block + b"\n", np.uint8)
        places = np.array([names.index(name) if name in names else -1 for name in self.header])
        values = np.empty((np.count_nonzero(raw == ord("\n")), len(names)))
        sign = "," if self.comma else "."
        if _kernels.decimal_rows(raw, ord(self.delimiter), ord(sign), places, values) < 0:
            return None
        behind, self.lines = self.lines, self.lines + len(values)
        return np.arange(behind + 1, self.lines + 1, dtype=np.int32), list(values.T)

    def _read_header(self, lines: list[str], numbers: list[int]) -> None:
        """Take comments and the header away from the numbers of the lines."""
        while numbers and lines[numbers[0] - 1].lstrip().startswith("#"):
            numbers.pop(0)
        if len(numbers) < 2:
            raise InputError(self.field, f"{len(numbers)} lines", "a line of column names and at least one line of numbers", self.where)
        first = lines[numbers.pop(0) - 1]
        self.delimiter = next((d for d in DELIMITERS if d in first), ",")
        self.header = tuple(name.strip() for name in first.split(self.delimiter))
        if _is_number(self.header[0]):
            raise InputError(f"{self.field} header", self.header[0], "column names in the first line", self.where)

    def _decimal_point(self, rows: list[str], numbers: list[int]) -> list[str]:
        """Turn decimal commas into points; a file with both signs could mean thousands by either, so it is refused."""
        self.comma = self.comma or _first(",", rows, numbers)
        self.point = self.point or _first(".", rows, numbers)
        if self.comma is None:
            return rows
        if self.point is not None:
            number, text = max(self.comma, self.point)
            raise InputError(self.field, text, "one decimal sign in the whole file, comma or point", f"{self.where} line {number}")
        return [row.replace(",", ".") for row in rows]


def _first(sign: str, rows: list[str], numbers: list[int]) -> tuple[int, str] | None:
    return next(((number, row.strip()) for row, number in zip(rows, numbers, strict=True) if sign in row), None)


def _blocks(path: Path, field: str, largest: int) -> Iterator[bytes]:
    """Yield a file's bytes in blocks of whole lines, a few megabytes each."""
    existing_file(path, field, largest)
    try:
        with path.open("rb") as file:
            while block := file.read(_PART):
                # UTF-16 has no byte that is a line's end
                yield block + (file.read() if block.startswith(_UTF16) else file.readline())
    except OSError as error:
        raise InputError(field, error.strerror or "an error on reading", "a file that can be read", str(path)) from None


class Meant(NamedTuple):
    """Which columns of a header are meant.

    `time`: the column of times, if there is one
    `seconds`: its unit in seconds
    `channels`: names in the header
    """

    time: tuple[str, ...]
    seconds: float
    channels: tuple[str, ...]


def read_channels(path: Path, meant: Callable[[tuple[str, ...]], Meant], default_rate: float | None) -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and channels of a recording whose first line is its header, shape (n,) each; long ones on the disk.

    The rate comes from the column of times, else from the campaign. Samples that the times skip are NaN.

    `meant`: says of the header which columns are read
    `default_rate` [Hz]: for a file that carries no rate
    """
    where = str(path)
    parts = _Parts("recording", where)
    read: Meant | None = None
    scratch: list[Scratch] = []
    numbers: list[np.ndarray] = []
    for block in _blocks(path, "recording", LARGEST_TEXT):
        found = parts.plain(block, [*read.time, *read.channels]) if read else None
        if found is None:
            table = parts.next(decoded(block, "recording", where))
            if read is None:
                read = meant(table.header)
                scratch = [Scratch() for _ in (*read.time, *read.channels)]
            found = np.array(table.numbers, dtype=np.int32), table.columns([*read.time, *read.channels])
        numbers.append(found[0])
        for column, values in zip(scratch, found[1], strict=True):
            column.add(values)
    columns = [column.channel() for column in scratch]
    if read is None or not read.time:
        if default_rate is None:
            raise InputError("sampling_rate_hz", "nothing", "a column 'time' [s], or the campaign's rate [Hz]", where)
        return positive("sampling_rate_hz", default_rate, "Hz"), columns
    try:
        return placed(columns[0][:] * read.seconds, columns[1:], default_rate)
    except Irregular as error:
        line = np.concatenate(numbers)[error.row]
        raise InputError(f"column {read.time[0]}", error.found, error.allowed, f"{where} line {line}") from None


def decoded(raw: bytes, field: str, where: str) -> str:
    if raw.startswith(_UTF16):
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
