"""FRFs as text columns: numbers by numpy, their meaning by the header (`frf_header`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.io.curves.frf_header import QUANTITIES, Column, Header, read_header
from rcsa_ident.io.text_columns import decoded
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.told_units import UNITS_ALLOWED, FrfUnit
from rcsa_ident.signals.verdict import RecordCode, assumed

#: Last frequency [Hz] below which more lines than hertz are samples over time.
_LOWEST_END = 60.0
#: Lines of names and remarks in front of the numbers.
_MOST_HEADER = 200
#: Delimiters (empty for blanks) and decimal signs, in the order in which they are tried.
_LAYOUTS = (("\t", "."), ("\t", ","), (";", "."), (";", ","), ("", "."), ("", ","), (",", "."))
#: Phases without a unit: what is larger is degrees, what is smaller throughout is radians, between them nobody knows.
_RADIANS, _DEGREES = 6.3, 30.0
_SI = {(0, False): "m/N", (1, False): "m/s/N", (2, False): "m/s²/N", (0, True): "N/m", (1, True): "N s/m", (2, True): "kg"}
_NAMES = {(0, False): "receptance", (1, False): "mobility", (2, False): "accelerance",
          (0, True): "dynamic stiffness", (1, True): "impedance", (2, True): "apparent mass"}  # fmt: skip


class TextFrf(NamedTuple):
    """An FRF of a text.

    `frequency` [Hz], shape (n,)
    `values`, shape (n,): in the unit, with time as e^{+iωt}
    `axis`: X of a direct one, XY of one with the force in Y; empty where the file says none
    `told`: whether the file or the user says which quantity it is
    `remarks`: what the file does not state and was assumed, and which columns are not read
    """

    frequency: FloatArray
    values: ComplexArray
    unit: FrfUnit
    axis: str
    told: bool
    remarks: tuple[Remark, ...]


def read_frf_text(raw: bytes, unit: FrfUnit | None, where: str) -> list[TextFrf]:
    """Return the FRFs of a text of columns.

    `unit`: of its values, whatever the file says; None believes the file
    `where`: the file, for the messages
    Raises `InputError`, which names the line, or what is said and not understood.
    """
    if b"\0" in raw and not raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("FRF", "binary data", "an FRF.csv, a universal file, or text columns frequency, real, imaginary", where)
    lines = decoded(raw, "FRF", where).splitlines()
    start, delimiter, decimal, width, tail = _first_numbers(lines, where)
    header = read_header(lines[:start], tail, width, where)
    table = _table(lines, start, delimiter, decimal, width, where)
    return _frfs(header, table, unit, where)


def _cells(line: str, delimiter: str) -> list[str]:
    line = line.strip()
    cells = [cell.strip() for cell in line.split(delimiter)] if delimiter else line.split()
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _numbers_of(cells: Sequence[str], decimal: str) -> list[float]:
    """The numbers that a line begins with."""
    found = []
    for cell in cells:
        if "_" in cell or (decimal == "," and "." in cell):
            break
        try:
            found.append(float(cell.replace(",", ".") if decimal == "," else cell))
        except ValueError:
            break
    return found


def _first_numbers(lines: Sequence[str], where: str) -> tuple[int, str, str, int, str]:
    """Index of the first line of numbers, delimiter, decimal sign, number of columns, and the words behind its numbers."""
    for i, line in enumerate(lines[: _MOST_HEADER + 1]):
        for delimiter, decimal in _LAYOUTS:
            cells = _cells(line, delimiter)
            width = len(_numbers_of(cells, decimal))
            tail = cells[width:]
            if width >= 3 and not any(_numbers_of([cell], decimal) for cell in tail):
                return i, delimiter, decimal, width, " ".join(tail)
    if len(lines) > _MOST_HEADER:
        raise InputError("FRF", lines[_MOST_HEADER].strip() or "nothing", _ALLOWED, f"{where} line {_MOST_HEADER + 1}")
    raise InputError("FRF", "0 lines of numbers", f"two or more of {_ALLOWED}", where)


_ALLOWED = "three numbers: frequency [Hz], real, imaginary, or as the header names them"


def _table(lines: Sequence[str], start: int, delimiter: str, decimal: str, width: int, where: str) -> FloatArray:
    """The numbers, shape (n, width)."""
    first = _cells(lines[start], delimiter)[:width]
    rows = [(delimiter or " ").join(first), *(line for line in lines[start + 1 :] if line and not line.isspace())]
    if len(rows) < 2:
        raise InputError("FRF", f"{len(rows)} lines of numbers", f"two or more of {_ALLOWED}", where)
    plain = [row.lstrip().rstrip(" \t\r" + delimiter) for row in rows]
    plain = [row.replace(",", ".") for row in plain] if decimal == "," else plain
    try:
        table = np.loadtxt(plain, delimiter=delimiter or None, comments=None, ndmin=2)
        if table.shape[1] != width or any("_" in row for row in plain):
            raise ValueError
    except ValueError:
        for number, line in enumerate(lines[start + 1 :], start=start + 2):
            cells = _cells(line, delimiter)
            if line.strip() and (len(cells) != width or len(_numbers_of(cells, decimal)) != width):
                allowed = _ALLOWED if width == 3 else f"{width} numbers as in the first line"
                raise InputError("FRF", line.strip(), allowed, f"{where} line {number}") from None
        raise
    if not np.all(np.isfinite(table)):
        raise InputError("FRF", "numbers that are not finite", "finite numbers", where)
    return table


def _frfs(header: Header, table: FloatArray, unit: FrfUnit | None, where: str) -> list[TextFrf]:
    """The FRF of each axis that the columns name; most files name none."""
    found = [i for i, column in enumerate(header.columns) if column.role == "frequency"]
    if len(found) != 1:
        raise InputError("FRF header", f"{len(found)} columns of frequencies", "one", where)
    place = found[0]
    said = list[Remark]()
    if not header.named:
        said.append(Remark(RecordCode.ASSUMED, "the table names no columns: frequency [Hz], real part, imaginary part are assumed"))
    factor = header.columns[place].factor or header.hertz
    if factor is None and header.named:
        said.append(assumed("the frequency", "", "Hz"))
    frequency = table[:, place] * (factor or 1.0)
    if frequency[-1] < _LOWEST_END and frequency.size > frequency[-1] - frequency[0] > 0:
        words = f"{frequency.size} lines up to {frequency[-1]:g}: samples over time?"
        raise InputError("FRF", words, "frequencies [Hz] of a machine; hits of a hammer are read by tap", where)
    groups: dict[str, dict[str, int]] = {}
    unread = [column.told for column in header.columns if column.role == "coherence"]
    for i, column in enumerate(header.columns):
        if column.role in ("real", "imaginary", "magnitude", "phase"):
            group = groups.setdefault(column.axis, {})
            if column.role in group:
                raise InputError(
                    "FRF header", f"two columns of the {column.role}: {column.told}", "one of each, or axes in their names", where
                )
            group[column.role] = i
    if not groups:
        raise InputError("FRF header", "no column of values", "real and imaginary part, or magnitude and phase", where)
    frfs = []
    for axis, group in groups.items():
        pair = ("real", "imaginary") if "real" in group and "imaginary" in group else ("magnitude", "phase")
        if not all(role in group for role in pair):
            raise InputError("FRF header", f"only {' and '.join(group)}", "real and imaginary part, or magnitude and phase", where)
        unread += [header.columns[i].told for role, i in group.items() if role not in pair]
        first, second = ((header.columns[group[role]], table[:, group[role]]) for role in pair)
        own, remarks = _unit(header, first[0], second[0], unit, where)
        values, assumed_ = _complex(first, second, own, pair[0] == "real", where)
        values = np.conj(values) if header.conjugated else values
        told = bool(unit or first[0].unit or second[0].unit or header.unit or header.quantities or first[0].quantities)
        frfs.append(TextFrf(frequency, values, own, axis, told, (*remarks, *assumed_, *said)))
    if unread:
        frfs = [each._replace(remarks=(*each.remarks, Remark(RecordCode.ASSUMED, f"not read: {listed(unread)}"))) for each in frfs]
    return frfs


def _unit(header: Header, first: Column, second: Column, unit: FrfUnit | None, where: str) -> tuple[FrfUnit, tuple[Remark, ...]]:
    """Unit of the values, and what was assumed; what the header calls them must agree with it."""
    told = [column.unit for column in (first, second) if column.unit]
    if len({(each.order, each.inverse) for each in told}) > 1:
        raise InputError("FRF header", f"two quantities: {first.told} and {second.told}", "one unit of both", where)
    own = unit or (told[0] if told else header.unit)
    meant = {QUANTITIES[name]: name for name in (*header.quantities, *first.quantities, *second.quantities)}
    if own is None and len(meant) > 1:
        raise InputError("FRF header", f"{listed(list(meant.values()))}, and no unit", UNITS_ALLOWED, where)
    if own is not None:
        if unit is None and len(meant) == 1 and (own.order, own.inverse) not in meant:
            found = f"{next(iter(meant.values()))} in a unit of {_NAMES[own.order, own.inverse]}"
            raise InputError("FRF header", found, "a unit of what it is called, or the unit told", where)
        return own, ()
    order, inverse = next(iter(meant), (0, False))
    return FrfUnit(1.0, order, inverse), (assumed("the table", "", f"{_NAMES[order, inverse]} [{_SI[order, inverse]}]"),)


def _complex(
    first: tuple[Column, FloatArray], second: tuple[Column, FloatArray], unit: FrfUnit, parts: bool, where: str
) -> tuple[ComplexArray, tuple[Remark, ...]]:
    """Values in the unit from real and imaginary part, or from magnitude and phase."""
    if parts:
        # each column may have a prefix of its own
        scales = [(column.unit or first[0].unit or unit).factor / (first[0].unit or unit).factor for column in (first[0], second[0])]
        return first[0].sign * scales[0] * first[1] + 1j * (second[0].sign * scales[1] * second[1]), ()
    magnitude, said = first[1], list[Remark]()
    if first[0].decibel is not None:
        magnitude = first[0].decibel * 10.0 ** (magnitude / 20.0)
        if first[0].unit is None:
            said.append(Remark(RecordCode.ASSUMED, "0 dB has no unit: 1 of the FRF's unit is assumed"))
    elif np.any(magnitude < 0.0):
        raise InputError(f"column {first[0].told}", f"{magnitude.min():g}", "0 or more, or dB in its name", where)
    factor, largest = second[0].factor, float(np.abs(second[1]).max())
    if factor is None:
        if _RADIANS < largest < _DEGREES:
            raise InputError(f"unit of column {second[0].told}", "none", "deg or rad", where)
        factor, name = (1.0, "rad") if largest <= _RADIANS else (np.pi / 180.0, "deg")
        said.append(assumed("the phase", "", name))
    return magnitude * np.exp(1j * second[0].sign * factor * second[1]), tuple(said)
