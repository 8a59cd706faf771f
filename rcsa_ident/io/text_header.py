"""What the lines above a text table's numbers say: which line names the columns, which gives their units, and the sampling rate.

The grammar stands in words in docs/formats/recordings.md; `tests/io/test_text_dialects.py` writes it and reads it back.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.channels import snapped
from rcsa_ident.io.time_base import time_unit
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.told_units import UNITS_OF_RATES, is_unit, rate_in, seconds_in

DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma"}
NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
#: ``name (unit)`` and ``name [unit]``; ``name in unit``, ``name / unit`` and ``name, unit`` where the unit is a known one.
_BRACKETED = re.compile(r"^(?P<name>.*?)\s*[(\[](?P<unit>[^()\[\]]*(?:\([^()]*\)[^()\[\]]*)?)[)\]]\s*$")
_DIVIDED = re.compile(r"^(?P<name>.*?)(?:(?:^|\s+)in\s+|\s*/\s+|\s*,\s+)(?P<unit>[^,]+)$")
#: What a column of sample numbers is called.
_COUNTS = re.compile(
    r"(?:sample|point|scan|row|record|sequence|index|idx|nr|no|num|number|count|#|n)s?\.?(?:[ _]?(?:no|nr|number|index|#)\.?)?", re.I
)
#: First cells of lines that say something of the columns: of their names, of their units, of the unit of time.
_NAMING = ("channel", "channels", "channel name", "channel names", "name", "names", "signal", "signals", "kanal", "kanalname", "source")
_UNITS = ("unit", "units", "y_unit_label", "channel unit", "channel units", "einheit", "einheiten", "vertical units", "vertical unit")
_TIME_UNITS = ("horizontal units", "horizontal unit", "x_unit_label", "x units", "time unit", "time units", "zeiteinheit")
#: Names behind the last column of numbers: of remarks, which stay empty, and of a first time and a step, whose values stand below.
_BEHIND = ("comment", "comments", "remark", "remarks", "note", "notes", "kommentar", "start", "increment", "")
_RATE = (
    r"fr[ée]quence d.[ée]chantillonnage|fre[qc]uen\w+ d[ei] (?:campionamento|muestreo)|tasa de muestreo|"
    r"(?:sampl\w*|abtast\w*|scan|acquisition|frame)[ _-]*(?:rate|freq\w*\.?)|abtast(?:rate|freq\w*)"
    r"|sampl\w*[ _]*(?:per|/)[ _]*s(?:ec(?:ond)?)?|fs"
)
#: No 'sampling time', which may be that of the whole record.
_STEP = (
    r"sampl\w*[ _-]*(?:interval|period|step)|abtast\w*(?:zeit|intervall)|time[ _](?:step|interval|increment)"
    r"|delta[ _]?[tx]|(?:[xt][ _]?)?increment|tinc|xinc|dt"
)
_TOLD = re.compile(rf"(?<![^\W_])(?:(?P<rate>{_RATE})|(?P<step>{_STEP}))(?:_(?P<unit>[kM]?Hz|[mun]?s))?(?![^\W])", re.IGNORECASE)
#: What the device could do is not what it did.
_NOT_TOLD = re.compile(r"(?:max|min|high|low)\w*\.?[ _]*$", re.IGNORECASE)
_CHANNEL = r"(?:ch|channel|chan|kanal|ai|analog)[ _]?\d+"
#: A line that begins with a channel and says hertz, where no other line tells a rate.
_RATE_OF_CHANNEL = re.compile(rf"\s*{_CHANNEL}\s*[(\[]\s*[kM]?Hz\s*[)\]]", re.IGNORECASE)
_BETWEEN = re.compile(
    rf"^(?:\s|\d{{1,3}}\s*[:=]|[:=,;\"']|is\b|of\b|per\b|all\b|channels?\b(?! ?\d)|{_CHANNEL}\b|[(\[](?P<unit>[^()\[\]]*)[)\]])*",
    re.IGNORECASE,
)
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:([,.' \u00a0\u202f])\d{3})(?:\1\d{3})*(?![\d])")
#: Digits from which on an interval is taken for a rounded one.
_ROUNDED = 5
RATES_ALLOWED = f"a number in {UNITS_OF_RATES}, or of a sampling interval in s, ms, us or ns"


@dataclass(frozen=True, slots=True)
class Head:
    """What stands above the numbers.

    `texts`: cells of the line of names, as they stand
    `names`, `units`: of the columns; the unit is empty where none is told
    `named`: whether a line names the columns; they are counted otherwise
    `rates`: list of float [Hz], what the lines tell, the first one first, none twice
    """

    texts: list[str]
    names: list[str]
    units: list[str]
    named: bool
    rates: list[float]

    @property
    def times(self) -> list[int]:
        """Return the places of columns of times."""
        return times_of(self.names, self.units)

    @property
    def counts(self) -> list[int]:
        """Return the places of columns that are called sample numbers."""
        told = zip(self.names, self.units, strict=True)
        return [i for i, (name, unit) in enumerate(told) if (_is_count(name) and not unit) or _is_count(unit)]


def read_head(
    above: Sequence[str], delimiter: str, comma: bool, width: int, wanted: Sequence[str], expected: float | None, where: str
) -> Head:
    """Return names and units of a table's columns, and the rates, from the lines above its numbers.

    `delimiter`: empty for blanks
    `comma`: whether the decimal sign of the table is a comma
    `width`: columns of the table
    `wanted`: names that tell the line of names where nothing else does
    `expected` [Hz]: the campaign's rate, which decides between those that an interval's digits leave open
    `where`: the file, for the messages
    Raises `InputError`: a line of names has another number of cells than the numbers below, or a rate is told in a unit that is not known.
    """
    lines = [line.lstrip("# \t" if delimiter != "\t" else "# ") for line in above]
    rows = [row for line in lines if any(row := split(line, delimiter))]
    if not delimiter:
        rows = [_joined(row, width) for row in rows]
    labels = [row[0].strip().rstrip(":").lower() for row in rows]
    marked = [
        label in (*_NAMING, *_UNITS, *_TIME_UNITS) or (_TOLD.match(label) is not None and any(map(is_number, row[1:])))
        for label, row in zip(labels, rows, strict=True)
    ]
    table = [i for i, row in enumerate(rows) if not marked[i] and _is_words(row, width)]
    mixed = [i for i, row in enumerate(rows) if not marked[i] and len(row) == width]
    texts, units = [f"column {i + 1}" for i in range(width)], [""] * width
    named = bool(table)
    if table:
        place = table[-1]
        first = next((i for i in (place - 1, place + 1) if i in table or (i in mixed and i == place - 1)), None)
        last, other = rows[place][:width], rows[first][:width] if first is not None else []
        if first is not None and first < place and _are_units(last, other, wanted):
            texts, units, place = other, last, first
        elif first is not None and first < place and all(map(_is_unit, other)) and not any(map(_is_unit, last)):
            texts, units = last, other
        else:
            # oscilloscopes may call columns by their units alone
            texts, units = last, last if all(map(_is_unit, last)) else units
    elif rows and not any(marked):
        _check_width(rows[-1], delimiter, width, where)
    for label, row in zip(labels, rows, strict=True):
        cells = [cell for cell in row[1:] if cell]
        if label in _NAMING and not named and len(cells) in (width, width - 1) and not any(map(is_number, cells)):
            texts[width - len(cells) :], named = cells, True
    _label_units(labels, rows, texts, units)
    names, units = columns_of(texts, units)
    rates = [*_rates(lines, delimiter, comma, expected, where), *_steps_behind(rows, width, expected, where)]
    return Head(texts, names, units, named, list(dict.fromkeys(rates)))


def columns_of(texts: Sequence[str], units: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return names and units of columns from the cells that name them, and from a line of units, empty cells where there is none.

    Where two names are one without what stands in brackets, the brackets are part of them.
    """
    found = [name_and_unit(text) for text in texts]
    names = [name for name, _ in found]
    told = [_plain(unit or own) for unit, (_, own) in zip(units, found, strict=True)]
    return (list(texts) if len(set(names)) < len(set(texts)) else names), told


def times_of(names: Sequence[str], units: Sequence[str]) -> list[int]:
    """Return the places of columns of times: by their names, or the first column by its unit."""
    told = [i for i, (name, unit) in enumerate(zip(names, units, strict=True)) if time_unit(name, unit) is not None]
    return told or ([0] if units and seconds_in(units[0]) is not None else [])


def tells_rate(line: str) -> bool:
    """Return whether a line speaks of a rate or an interval of samples."""
    return _TOLD.search(line) is not None


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; a delimiter inside of quotes divides nothing."""
    if '"' in line and delimiter:
        line_cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
        return [cell.strip() for cell in line_cells]
    return [cell.strip() for cell in (line.split(delimiter) if delimiter else line.replace('"', "").split())]


def is_number(text: str) -> bool:
    """Return whether a cell of the lines above is a number, its decimal sign a point or a comma."""
    return re.fullmatch(NUMBER, text.strip().replace(",", ".")) is not None


def name_and_unit(text: str) -> tuple[str, str]:
    """Return both of ``name (unit)``, ``name [unit]``, ``name in unit``, ``name / unit`` or ``name, unit``; the unit is empty where none is
    told. What has no letter is no unit: ``channel (1)`` is a name."""
    found = _BRACKETED.match(text)
    if found and re.search(r"[^\W\d_]|[%°-]", found["unit"]):
        return found["name"].strip() or found["unit"].strip(), found["unit"].strip()
    found = _DIVIDED.match(text)
    if found and is_unit(found["unit"]):
        return (found["name"] or text).strip(), found["unit"].strip()
    return text, ""


def _plain(unit: str) -> str:
    """A unit without brackets around it."""
    plain = unit.strip()
    return plain[1:-1].strip() if plain[:1] + plain[-1:] in ("()", "[]") else plain


def _is_unit(text: str) -> bool:
    """Whether a cell may stand in a line of units."""
    plain = text.strip("()[] ")
    return is_unit(plain) or _is_count(plain)


def _is_count(text: str) -> bool:
    return _COUNTS.fullmatch(text.strip()) is not None


def _joined(cells: list[str], width: int) -> list[str]:
    """Cells between blanks, where they are more than there are columns: a unit in brackets belongs to the name before it."""
    found: list[str] = []
    for cell in cells:
        if found and len(cells) > width and cell[0] in "([":
            found[-1] += f" {cell}"
        else:
            found.append(cell)
    return found


def _is_words(row: list[str], width: int) -> bool:
    """Whether a line may hold names or units: a cell for each column, none of them a number."""
    if len(row) < width or any(cell.lower() not in _BEHIND and not is_number(cell) and "=" not in cell for cell in row[width:]):
        return False
    cells = row[:width]
    return any(cells) and not any(is_number(cell) for cell in cells)


def _are_units(last: list[str], above: list[str], wanted: Sequence[str]) -> bool:
    """Whether the lower of two lines gives units to the names in the upper one."""
    filled = [cell for cell in last if cell]
    if all(cell[:1] + cell[-1:] in ("()", "[]") for cell in filled) or all(_is_unit(cell) or cell in ("-", "%", "rpm") for cell in filled):
        return True
    timed = any(cell and time_unit(name, "") == "" and seconds_in(cell.strip("()[]")) for name, cell in zip(above, last, strict=True))
    return timed or bool(wanted and set(wanted) <= set(above) - set(last))


def _label_units(labels: Sequence[str], rows: Sequence[list[str]], texts: Sequence[str], units: list[str]) -> None:
    """Write units from lines that begin with a word for them: of all columns, of those that are no times, or of all but the first."""
    channels = [i for i, text in enumerate(texts) if time_unit(text) is None]
    for label, row in zip(labels, rows, strict=True):
        cells = [cell for cell in row[1:] if cell]
        places = next((p for p in (range(len(texts)), channels, range(1, len(texts))) if len(p) == len(cells)), ())
        if label in _TIME_UNITS and cells and not units[0]:
            units[0] = cells[0]
        elif label in _UNITS and not any(map(is_number, cells)) and not any(units[i] for i in places):
            for i, cell in zip(places, cells, strict=bool(places)):
                units[i] = cell


def _check_width(row: list[str], delimiter: str, width: int, where: str) -> None:
    """Refuse a line above the numbers that names columns, but not as many as there are."""
    if any(map(is_number, row)):
        return
    names = len(row) > 1 if delimiter else any(name_and_unit(cell)[1] for cell in row)
    if len(row) != width and (names or (delimiter == "," and len(row) == 1)):
        found = f"{len(row)} in '{listed([' '.join(row)[:80]])}' above {width} columns of numbers"
        between = f", divided by {DELIMITERS[delimiter]} as these are" if delimiter else ""
        raise InputError("names of columns", found, f"a name for each column{between}", where)


def _steps_behind(rows: Sequence[list[str]], width: int, expected: float | None, where: str) -> Iterator[float]:
    """Rates of a step that stands below ``Increment``, behind the names of an oscilloscope's columns."""
    for names, values in pairwise(rows):
        for name, value in zip(names[width:], values[width:], strict=False):
            if name.lower() == "increment" and is_number(value):
                yield _in_hertz(value, "s", True, expected, where)


def _rates(lines: Sequence[str], delimiter: str, comma: bool, expected: float | None, where: str) -> Iterator[float]:
    """Every rate [Hz] that the lines tell, as a rate or as an interval, in their order; at most one a line."""
    found = False
    for line in lines:
        for match in _TOLD.finditer(line):
            if _NOT_TOLD.search(line[: match.start()]):
                continue
            told = _told_in(line[match.end() :], match["unit"] or "", delimiter, comma)
            if told is not None:
                found = True
                yield _in_hertz(*told, bool(match["step"]), expected, where)
                break
    for line in () if found else lines:
        told = _told_in(line, "", delimiter, comma) if _RATE_OF_CHANNEL.match(line) else None
        if told is not None:
            yield _in_hertz(*told, False, expected, where)


def _told_in(rest: str, unit: str, delimiter: str, comma: bool) -> tuple[str, str] | None:
    """The number, with a decimal point, and its unit that stand behind a word for a rate or an interval; None where something else does, as
    behind 'Sampling rate divider'."""
    between = _BETWEEN.match(rest)
    assert between is not None
    cells = [rest[between.end() :]]
    # where the delimiter divides the number from its name, it divides no thousands
    if delimiter and delimiter in rest[: between.end()]:
        cells = split(cells[0], delimiter)
    text, behind = _number(cells[0], comma)
    if not text:
        return None
    for other in cells[1:]:
        if is_number(other) and _number(other, comma)[0] != text:
            return listed([text, other]), "of several channels"
    named = re.match(r"[\s\"'(\[]*([^\s\"'()\[\],;|:]*)", re.sub(r"\s+per\s+", "/", behind))
    own = named[1].rstrip(".") if named and not is_number(named[1]) else ""
    further = cells[1] if len(cells) > 1 and not own and not is_number(cells[1]) else ""
    return text, own or (between["unit"] or "").strip() or unit or further


def _number(text: str, comma: bool) -> tuple[str, str]:
    """A number in front of a text, its decimal sign a point and its thousands together, and what stands behind; empty where none does."""
    grouped = _THOUSANDS.match(text)
    if grouped and grouped[1] != ("," if comma else "."):
        sign = "" if grouped[1] in ",." and grouped[1] == text[grouped.end() : grouped.end() + 1] else r"[.,]"
        fraction = re.match(rf"{sign}\d+", text[grouped.end() :]) if sign else None
        behind = text[grouped.end() :]
        whole = re.sub(r"[^\d+-]", "", grouped[0])
        return (whole + fraction[0].replace(",", "."), behind[fraction.end() :]) if fraction else (whole, behind)
    found = re.match(NUMBER.replace(r"\.", "[.,]"), text)
    return (found[0].replace(",", "."), text[found.end() :]) if found else ("", text)


def _in_hertz(text: str, unit: str, interval: bool, expected: float | None, where: str) -> float:
    """A rate [Hz] from a number, which is an interval unless its unit says otherwise."""
    hertz = rate_in(unit or ("" if interval else "Hz"))
    seconds = seconds_in(unit or "s") if interval and hertz is None else None
    try:
        value = float(text) * (hertz or seconds or np.nan)
    except ValueError:
        value = np.nan
    if not 1e-12 < value < 1e15:
        raise InputError("sampling_rate_hz", f"{text} {unit}".strip(), RATES_ALLOWED, where)
    if hertz:
        return value
    digits = Decimal(text).as_tuple()
    rounding = 0.5 * 10.0 ** int(digits.exponent) / float(text)
    if expected and abs(expected * value - 1.0) <= rounding:
        return expected
    # few digits are rather exact, as of 3 ms
    return snapped(1.0 / value, rounding) if len(digits.digits) >= _ROUNDED else 1.0 / value
