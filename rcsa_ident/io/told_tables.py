"""Text tables that tell themselves: names, units and rate from the lines above the numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.io import text_columns
from rcsa_ident.io.channels import Channel, Signals, the_only
from rcsa_ident.io.files import MEGABYTE, existing_file, read_bytes
from rcsa_ident.io.text_columns import DELIMITERS, LARGEST_TEXT, decoded
from rcsa_ident.io.time_base import Irregular, uniform
from rcsa_ident.io.validated_table import listed
from rcsa_ident.remarks import Remark
from rcsa_ident.signals.recording import SI_UNITS, Quantity
from rcsa_ident.signals.told_units import is_untold, quantity_in, seconds_in, told_unit
from rcsa_ident.signals.verdict import RecordCode, assumed

#: A time column, and its unit in seconds.
_TIME = re.compile(r"^\s*(?:time|t|timestamp|zeit|abscissa)\b", re.IGNORECASE)
_TIME_IN_SECONDS = ("time_s", "t_s")
#: ``name (unit)`` and ``name [unit]``.
_NAME_AND_UNIT = re.compile(r"^(?P<name>.*?)\s*[(\[](?P<unit>[^()\[\]]*(?:\([^()]*\)[^()\[\]]*)?)[)\]]\s*$")
#: A sampling rate in the lines above a table.
_RATE_WORDS = re.compile(r"(?:sampl\w*[ _]?(?:rate|freq\w*)|abtastrate)\D*(?P<value>\d+(?:[.,]\d+)?)", re.IGNORECASE)
#: A line that begins a further measuring cycle, below the numbers of the one before.
_CYCLE = re.compile(r"\s*cycle (no|number)\b", re.IGNORECASE)
_FIRST_CYCLE = "only the first of {} measuring cycles was read"
#: Lines of remarks in front of the names, at most.
_MOST_HEADER = 200
#: Bytes of a file in which its first numbers stand.
_HEAD = MEGABYTE // 8


@dataclass(frozen=True, slots=True, eq=False)
class OpenChannel:
    """A channel as a file tells it.

    Parameters
    ----------
    name, unit : str
        Empty where the file says no unit.
    quantity : Quantity or None
        What the unit measures; None where it says none that is known.
    samples : array, shape (n,)
        In SI where the quantity is known, full scale 1 of sound.
    """

    name: str
    unit: str
    quantity: Quantity | None
    samples: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class OpenRecording:
    """A recording and what was taken as given.

    Parameters
    ----------
    rate : float [Hz]
    channels : tuple of OpenChannel
    remarks : tuple of Remark
        What was assumed.
    lossy : bool
        Compressed with loss: lines stay where they are, decays do not.
    """

    rate: float
    channels: tuple[OpenChannel, ...]
    remarks: tuple[Remark, ...] = ()
    lossy: bool = False

    def of(
        self, quantity: Quantity | None = None, names: Sequence[str] = ()
    ) -> tuple[Quantity, tuple[OpenChannel, ...], tuple[Remark, ...]]:
        """Return the channels of one quantity, and what was assumed: those that are named, or all of the first quantity of acceleration,
        sound, force and motion.

        Raises
        ------
        InputError
            A name is not there, or nothing tells what a channel measures; the message names the option.
        """
        present = [each.name for each in self.channels]
        chosen = tuple(self.channels[the_only(name, present, "")] for name in names) or self.channels
        if quantity is None:
            order = (Quantity.ACCELERATION, Quantity.SOUND, Quantity.FORCE, Quantity.DISPLACEMENT)
            quantity = next((each for each in order if any(channel.quantity is each for channel in chosen)), None)
        if quantity is None:
            allowed = "acceleration, sound, displacement or force, told: no unit in the file says what is measured"
            raise InputError("quantity", listed([each.name for each in chosen]), allowed)
        # a unit that says something else is another channel, one that says nothing is taken at the user's word
        kept = tuple(each for each in chosen if each.quantity in (quantity, None))
        kept = tuple(each for each in kept if each.quantity is quantity) or kept
        if not kept:
            found = listed([f"{each.name} [{each.unit}]" for each in chosen])
            raise InputError("quantity", found, f"a channel that measures {quantity}")
        # lines stay where they are in any unit, amplitudes do not
        units = tuple(
            assumed(each.name, each.unit, f"{quantity} [{SI_UNITS[quantity]}]" if is_untold(each.unit) else f"{quantity}, in that unit,")
            for each in kept
            if each.quantity is None
        )
        return quantity, kept, (*self.remarks, *units)


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, Sequence[Channel]]:
    """Return the sampling rate [Hz] and the named channels of a recording, shape (n,) each.

    A table with one line of names, and nothing but them, above its numbers is read as `text_columns` does, as it stands. One with more
    (a preamble, a line of units) tells names, units and rate itself: channels of a known unit are turned into SI.

    Parameters
    ----------
    path : path
    names : sequence of str
        Channels that are wanted.
    default_rate : float or None [Hz]
        For a file that carries no rate.
    """
    if not _has_preamble(path):
        return text_columns.read_channels(path, names, default_rate)
    opened = told_table(path, default_rate, names)
    present = [each.name for each in opened.channels]
    channels = [opened.channels[the_only(name, present, "")] for name in names]
    return opened.rate, Signals([each.samples for each in channels], opened.remarks, tuple((each.unit, each.quantity) for each in channels))


def _has_preamble(path: Path) -> bool:
    """Whether more than one line, comments aside, stands above the first numbers."""
    existing_file(path, "recording", LARGEST_TEXT)
    with path.open("rb") as file:
        raw = file.read(_HEAD)
    try:
        lines = decoded(raw, "recording", str(path)).replace('"', "").splitlines()[:-1]
        start = _first_numbers([line.rstrip(" \t;,") for line in lines], str(path))[0]
    except InputError:
        return False
    return sum(bool(line.strip()) and not line.lstrip().startswith("#") for line in lines[:start]) > 1


def told_table(path: Path, default_rate: float | None, wanted: Sequence[str] = ()) -> OpenRecording:
    """Return a text table as its own lines tell it.

    Parameters
    ----------
    path : path
    default_rate : float or None [Hz]
        Rate of a file that carries none.
    wanted : sequence of str
        Channels that are there though they hold one value throughout, or have a unit that nobody knows.

    Raises
    ------
    InputError
        As `open_recording`.
    """
    where = str(path)
    lines = decoded(read_bytes(path, "recording", LARGEST_TEXT), "recording", where).replace('"', "").splitlines()
    lines = [line.rstrip(" \t;,") for line in lines]
    start, delimiter, comma = _first_numbers(lines, where)
    width = len(_cells(lines[start], delimiter))
    names, units, rate = _header(lines[:start], delimiter, width, wanted)
    cycles = [i for i in range(start, len(lines)) if _CYCLE.match(lines[i])]
    values = _numbers(lines[: cycles[0] if cycles else None], start, delimiter, comma, width, where)
    remarks = [Remark(RecordCode.ASSUMED, _FIRST_CYCLE.format(len(cycles) + 1))] if cycles else []
    time = [i for i, name in enumerate(names) if _TIME.match(name)]
    if time and not units[time[0]] and names[time[0]].lower() not in _TIME_IN_SECONDS:
        remarks.append(assumed(names[time[0]], "", "time [s]"))
    if not time and default_rate is None and rate is None and np.all(np.diff(values[:, 0]) > 0.0):
        time = [0]
        remarks.append(Remark(RecordCode.ASSUMED, f"{names[0]}, which rises throughout, was taken as the time [s]"))
    if time:
        seconds = _seconds(units[time[0]])
        if seconds is None:
            raise InputError(f"unit of column {names[time[0]]}", units[time[0]], "s, ms or us", where)
        try:
            rate, place = uniform(values[:, time[0]] * seconds, default_rate)
        except Irregular as error:
            even = _nearly_even(values[:, time[0]] * seconds)
            if even is None:
                raise InputError(f"column {names[time[0]]}", error.found, error.allowed, f"{where} row {error.row + 1}") from None
            rate, place = even, np.arange(values.shape[0])
            words = f"times that stand less than half a sample from their places were taken as even, {rate:.6g} Hz"
            remarks.append(Remark(RecordCode.ASSUMED, words))
        if place[-1] + 1 != place.size:
            full = np.full((place[-1] + 1, width), np.nan)
            full[place] = values
            values = full
    elif default_rate is not None or rate is not None:
        rate = default_rate or rate
    else:
        raise InputError("sampling_rate_hz", "nothing", "a column 'time' with its unit, or the rate [Hz], told", where)
    assert rate is not None
    channels = []
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        if i in time or not (name in wanted or np.ptp(np.nan_to_num(values[:, i])) > 0.0):
            continue
        factor, quantity = quantity_in(unit)
        channels.append(OpenChannel(name, unit, quantity, np.ascontiguousarray(values[:, i] * factor)))
    if not channels:
        raise InputError("recording", f"columns {listed(names)}", "a column of numbers that move beside the time", where)
    return OpenRecording(float(rate), tuple(channels), tuple(remarks))


def _nearly_even(time: FloatArray) -> float | None:
    """The rate [Hz] of times that jitter by less than half a sample about even ones; None of others."""
    if time.size < 3 or not np.all(np.isfinite(time)) or not np.all(np.diff(time) > 0.0):
        return None
    place = np.arange(time.size)
    step, start = np.polyfit(place, time, 1)
    return float(1.0 / step) if np.abs(time - start - step * place).max() < 0.5 * step else None


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in (line.split(delimiter) if delimiter else line.split())]


def _first_numbers(lines: Sequence[str], where: str) -> tuple[int, str, bool]:
    """Index of the first line of numbers, the delimiter ('' for blanks), and whether the decimal sign is a comma."""
    for i, line in enumerate(lines[:_MOST_HEADER]):
        for delimiter in (*DELIMITERS, ""):
            cells = _cells(line, delimiter)
            if len(cells) < 2:
                continue
            following = _cells(next((later for later in lines[i + 1 : _MOST_HEADER + 2] if later.strip()), ""), delimiter)
            for comma in (False, True) if delimiter != "," else (False,):
                if len(following) == len(cells) and all(_is_number(cell, comma) for cell in (*cells, *following)):
                    return i, delimiter, comma
    raise InputError("recording", "no two lines of numbers that follow each other", "a table of numbers with names above it", where)


def _is_number(cell: str, comma: bool) -> bool:
    text = cell.replace(",", ".") if comma else cell
    if "_" in text:
        return False
    try:
        float(text)
    except ValueError:
        return False
    return True


def _header(above: Sequence[str], delimiter: str, width: int, wanted: Sequence[str]) -> tuple[list[str], list[str], float | None]:
    """Names and units of the columns, and a rate, from the lines above them: the last ones of the table's width are names, then units."""
    tables = [cells for line in above if len(cells := _cells(line.lstrip("# "), delimiter)) == width and any(cells)]
    names = tables[-1] if tables else [f"column {i + 1}" for i in range(width)]
    units = [""] * width
    known = len(tables) > 1 and all(_known_unit(cell) for cell in tables[-1])
    if known or (len(tables) > 1 and wanted and set(wanted) <= set(tables[-2]) - set(tables[-1])):
        names, units = tables[-2], tables[-1]
    found = [name_and_unit(name) for name in names]
    units = [unit or own for (_, own), unit in zip(found, units, strict=True)]
    names = [name for name, _ in found]
    rate = None
    for line in above:
        match = _RATE_WORDS.search(line)
        if match:
            rate = float(match["value"].replace(",", ".")) * (1e3 if "khz" in line.lower() else 1.0)
    return names, units, rate


def _known_unit(text: str) -> bool:
    return told_unit(text) is not None or is_untold(text) or text == "%"


def _seconds(unit: str) -> float | None:
    return 1.0 if is_untold(unit) else seconds_in(unit)


def name_and_unit(text: str) -> tuple[str, str]:
    """Return both of ``name (unit)`` or ``name [unit]``; the unit is empty where none is told."""
    found = _NAME_AND_UNIT.match(text)
    return (found["name"].strip(), found["unit"].strip()) if found else (text, "")


def _numbers(lines: Sequence[str], start: int, delimiter: str, comma: bool, width: int, where: str) -> FloatArray:
    """All lines of numbers, shape (n, width); a header that comes again is left out, an empty cell is NaN."""
    rows = [line for line in lines[start:] if line and not line.isspace()]
    # two equal rows are two rows, also where something stands between the first one and the others
    repeated = {line for line in lines[:start] if not all(_is_number(cell, comma) for cell in _cells(line, delimiter))}
    rows = [row for row in rows if row not in repeated]
    if comma:
        rows = [row.replace(",", ".") for row in rows]
    try:
        values = np.loadtxt(rows, delimiter=delimiter or None, comments=None, ndmin=2)
        if values.shape[1] == width:
            return values
    except ValueError:
        pass
    full = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        cells = _cells(row, delimiter)
        if len(cells) > width or any(cell and not _is_number(cell, False) for cell in cells):
            raise InputError("recording", row, f"{width} numbers", f"{where}, row {i + 1} of numbers")
        full[i, : len(cells)] = [float(cell) if cell else np.nan for cell in cells]
    return full
