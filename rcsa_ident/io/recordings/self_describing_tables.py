"""Text tables that tell themselves: names, units and rate from the lines above the numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import Remark
from rcsa_ident.io import text_columns
from rcsa_ident.io.channels import Channel, Signals, StoredChannel, the_only
from rcsa_ident.io.files import MEGABYTE, existing_file, read_bytes
from rcsa_ident.io.recordings.text_rows import STAMP, beside, first_numbers, lines_of, numbers_of, rows_of
from rcsa_ident.io.text_columns import LARGEST_TEXT, Meant, decoded
from rcsa_ident.io.text_header import Head, columns_of, read_head, split, tells_rate, times_of
from rcsa_ident.io.time_base import Irregular, time_unit, uniform
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.recording import SI_UNITS, Quantity
from rcsa_ident.signals.told_units import UNITS_OF_TIME, is_untold, quantity_in, seconds_in, volts_in
from rcsa_ident.signals.verdict import RecordCode, assumed

#: Units of times without a unit, which the rate decides; and as a share, rates that agree.
_UNITLESS = {1.0: "seconds", 1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}
_ALIKE = 0.01
#: A line that begins a further measuring cycle, below the numbers of the one before.
_CYCLE = re.compile(r"\s*cycle (no|number)\b", re.IGNORECASE)
_FIRST_CYCLE = "only the first of {} measuring cycles was read"
#: Bytes of a file in which its first numbers stand.
_HEAD = MEGABYTE // 8


@dataclass(frozen=True, slots=True, eq=False)
class OpenChannel:
    """A channel as a file tells it.

    `name`, `unit`: empty where the file says no unit
    `quantity`: what the unit measures; None where it says none that is known
    `samples`, shape (n,): in SI where the quantity is known, full scale 1 of sound
    """

    name: str
    unit: str
    quantity: Quantity | None
    samples: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class OpenRecording:
    """A recording and what was taken as given.

    `rate` [Hz]
    `remarks`: what was assumed
    `lossy`: compressed with loss: lines stay where they are, decays do not
    """

    rate: float
    channels: tuple[OpenChannel, ...]
    remarks: tuple[Remark, ...] = ()
    lossy: bool = False

    def of(
        self, quantity: Quantity | None = None, names: Sequence[str] = (), sensitivity: float | None = None
    ) -> tuple[Quantity, tuple[OpenChannel, ...], tuple[Remark, ...]]:
        """Return the channels of one quantity, and what was assumed: those that are named, or all of the first quantity of acceleration,
        sound, force and motion.

        `quantity`: what channels measure whose unit does not say it
        `sensitivity`: signal per SI unit of such channels
        Raises `InputError`: a name is not there, nothing tells what a channel measures, or its unit asks for the sensitivity; the message
            names the option.
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
        unsaid = [each for each in kept if each.quantity is None]
        if sensitivity is not None:
            if not unsaid:
                raise InputError("sensitivity", f"{sensitivity:g}", f"none: channel {kept[0].name} has the unit {kept[0].unit}")
            gain = positive("sensitivity", sensitivity, "signal per SI unit")
            return quantity, tuple(replace(each, samples=each.samples / gain) for each in kept), self.remarks
        for each in unsaid:
            if not is_untold(each.unit):
                signal = "V" if volts_in(each.unit) is not None else each.unit
                found = f"nothing, and channel {each.name} is in {each.unit}"
                raise InputError("sensitivity", found, f"the sensor's [{signal} per SI unit]")
        units = tuple(assumed(each.name, "", f"{quantity} [{SI_UNITS[quantity]}]") for each in unsaid)
        return quantity, kept, (*self.remarks, *units)


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, Sequence[Channel]]:
    """Return the sampling rate [Hz] and the named channels of a recording, shape (n,) each.

    A table with one line of names, and nothing but them, above its numbers is read as `text_columns` does, as it stands. One with more
    (a preamble, a line of units) tells names, units and rate itself: channels of a known unit are turned into SI.

    `names`: channels that are wanted
    `default_rate` [Hz]: for a file that carries no rate
    """
    if _tells_more(path):
        opened = told_table(path, default_rate, names)
        present = [each.name for each in opened.channels]
        channels = [opened.channels[the_only(name, present, "")] for name in names]
        told = tuple((each.unit, each.quantity) for each in channels)
        return opened.rate, Signals([each.samples for each in channels], opened.remarks, told)
    units: list[str] = []
    notes: list[Remark] = []

    def meant(header: tuple[str, ...]) -> Meant:
        own, every = columns_of(header, [""] * len(header))
        places = [_place(name, own, header, str(path)) for name in names]
        units[:] = [every[i] for i in places]
        times = [i for i in times_of(own, every) if i not in places]
        if len(times) > 1:
            raise InputError("time", f"columns {' and '.join(header[i] for i in times)}", "one time column", str(path))
        seconds = [_seconds(own[i], every[i], notes, str(path)) for i in times]
        return Meant(tuple(header[i] for i in times), seconds[0] if seconds else 1.0, tuple(header[i] for i in places))

    rate, signals = text_columns.read_channels(path, meant, default_rate)
    scales = [quantity_in(unit) for unit in units]
    scaled = [_scaled(signal, factor) for signal, (factor, _) in zip(signals, scales, strict=True)]
    return rate, Signals(scaled, tuple(notes), tuple((unit, quantity) for unit, (_, quantity) in zip(units, scales, strict=True)))


def _scaled(signal: Channel, factor: float) -> Channel:
    if factor == 1.0:
        return signal
    if isinstance(signal, StoredChannel):
        return StoredChannel(signal.size, lambda first, end: factor * signal.read(first, end))
    return factor * signal


def _place(name: str, names: Sequence[str], texts: Sequence[str], where: str) -> int:
    """Place of a channel that is called by its name or by the whole cell, its unit with it."""
    places = [i for i, told in enumerate(zip(names, texts, strict=True)) if name in told]
    if len(places) != 1:
        found = "two columns of that name" if places else "no such channel"
        raise InputError(f"channel {name}", found, f"one column of the file: {listed(list(texts))}", where)
    return places[0]


def _seconds(name: str, unit: str, notes: list[Remark], where: str) -> float:
    """Seconds per unit of a column of times; one that nothing tells is said, but of a column 'time' in a campaign's table."""
    told = time_unit(name, unit)
    seconds = seconds_in(told or unit or "s")
    if seconds is None:
        raise InputError(f"unit of column {name}", told or unit, UNITS_OF_TIME, where)
    if not told and not unit and name.lower() != "time":
        notes.append(assumed(name, "", "time [s]"))
    return seconds


def _tells_more(path: Path) -> bool:
    """Whether more than a line of names stands above the first numbers, comments aside, or the numbers are no plain table."""
    existing_file(path, "recording", LARGEST_TEXT)
    with path.open("rb") as file:
        raw = file.read(_HEAD)
    try:
        text = decoded(raw, "recording", str(path))
        lines = lines_of(text)[:-1]
        start, delimiter, _ = first_numbers(lines, str(path))
    except InputError:
        return False
    above = [line for line in lines[:start] if line]
    head = [line for line in above if not line.startswith("#")]
    if len(head) > 1 or not delimiter or any(tells_rate(line) for line in above if line.startswith("#")):
        return True
    # what a spreadsheet would not take for a table: names in quotes around the delimiter, lines of several lengths
    unlike = len({line.count(delimiter) for line in text.splitlines()[start - 1 : start + 1]}) > 1
    cells = split(head[-1], delimiter) if head else []
    names, units = columns_of(cells, [""] * len(cells))
    return unlike or len(times_of(names, units)) > 1 or any(STAMP.fullmatch(cell) for cell in split(lines[start], delimiter))


def told_table(path: Path, default_rate: float | None, wanted: Sequence[str] = ()) -> OpenRecording:
    """Return a text table as its own lines tell it.

    `default_rate` [Hz]: rate of a file that carries none
    `wanted`: channels that are there though they hold one value throughout, or have a unit that nobody knows
    Raises `InputError` as `open_recording`.
    """
    where = str(path)
    lines = beside(lines_of(decoded(read_bytes(path, "recording", LARGEST_TEXT), "recording", where)))
    start, delimiter, comma = first_numbers(lines, where)
    cycles = [i for i in range(start, len(lines)) if _CYCLE.match(lines[i])]
    rows, width = rows_of(lines[: cycles[0] if cycles else None], start, delimiter)
    comma = comma or (delimiter != "," and any("," in row for row in rows))
    head = read_head(lines[:start], delimiter, comma, width, wanted, default_rate, where)
    values, stamped = numbers_of(rows, delimiter, comma, width, where)
    remarks = [Remark(RecordCode.ASSUMED, _FIRST_CYCLE.format(len(cycles) + 1))] if cycles else []
    if not head.named:
        remarks.append(Remark(RecordCode.ASSUMED, f"no line above the numbers names their {width} columns: they are counted"))
    counts = {i for i in head.counts if _steps_of_one(values[:, i])}
    time = stamped[:1] or [i for i in head.times if i not in counts and not np.all(np.isnan(values[:, i]))]
    told = head.rates[0] if head.rates else default_rate
    if time and not stamped and told and not _unit_of(head, time[0]) and _steps_of_one(values[:, time[0]]) and told != 1.0:
        counts, time = counts | set(time), []
    if not time and told is None and 0 not in counts and np.all(np.diff(values[:, 0]) > 0.0) and not _steps_of_one(values[:, 0]):
        time = [0]
        remarks.append(Remark(RecordCode.ASSUMED, f"{head.names[0]}, which rises throughout, was taken as the time [s]"))
    if time:
        rate, values = _timed(head, values, time[0], bool(stamped), told, None if wanted else default_rate, remarks, where)
        _check_one_time(head, values, time[0], where)
    elif told is not None:
        rate = told
        if len(head.rates) > 1:
            words = f"the lines above the numbers tell {listed([f'{each:.6g} Hz' for each in head.rates])}: the first one counts"
            remarks.append(Remark(RecordCode.ASSUMED, words))
    else:
        found = f"nothing, and column {head.names[min(counts)]} counts samples" if counts else "nothing"
        raise InputError("sampling_rate_hz", found, "a column 'time' with its unit, or the rate [Hz], told", where)
    called = {_place(name, head.names, head.texts, where): name for name in wanted}
    channels = []
    for i, (name, unit) in enumerate(zip(head.names, head.units, strict=True)):
        if i in counts and i not in called:
            remarks.append(Remark(RecordCode.ASSUMED, f"column {name} counts samples and was left out"))
        elif i in (*time, *stamped, *head.times) and i not in called:
            continue
        elif i in called or np.ptp(np.nan_to_num(values[:, i])) > 0.0:
            factor, quantity = quantity_in(unit)
            channels.append(OpenChannel(called.get(i, name), unit, quantity, np.ascontiguousarray(values[:, i] * factor)))
    if not channels:
        raise InputError("recording", f"columns {listed(head.names)}", "a column of numbers that move beside the time", where)
    return OpenRecording(float(rate), tuple(channels), tuple(remarks))


def _unit_of(head: Head, place: int) -> str:
    return time_unit(head.names[place], head.units[place]) or head.units[place]


def _steps_of_one(values: FloatArray) -> bool:
    """Whether a column counts samples."""
    return values.size > 2 and bool(np.all(np.diff(values) == 1.0) and values[0] == np.rint(values[0]))


def _timed(
    head: Head,
    values: FloatArray,
    place: int,
    stamped: bool,
    told: float | None,
    asked: float | None,
    remarks: list[Remark],
    where: str,
) -> tuple[float, FloatArray]:
    """The rate [Hz] that a column of times tells, and the rows at their places; samples that the times skip are NaN. Uneven times are left
    aside for a rate that the user asks for."""
    name, time = head.names[place], values[:, place]
    seconds = 1.0
    if not stamped:
        notes: list[Remark] = []
        seconds = _seconds(name, head.units[place], notes, where)
        untold = not _unit_of(head, place)
        fitting = [
            s for s in _UNITLESS if untold and head.rates and abs(float(np.median(np.diff(time))) * s * head.rates[0] - 1.0) < _ALIKE
        ]
        if fitting and fitting[0] != 1.0:
            seconds = fitting[0]
            words = f"{name} has no unit: {_UNITLESS[seconds]} are assumed, which the rate that the file tells asks for"
            remarks.append(Remark(RecordCode.ASSUMED, words))
        elif untold and not fitting and not any(name in note for note in remarks):
            remarks.append(assumed(name, "", "time [s]"))
    try:
        rate, index = uniform(time * seconds, told)
    except Irregular as error:
        even = _nearly_even(time * seconds)
        if even is None and asked is not None:
            words = f"the times in column {name} are uneven and were left aside: the rate that was told counts, {asked:.6g} Hz"
            remarks.append(Remark(RecordCode.ASSUMED, words))
            return asked, values
        if even is None:
            allowed = f"{error.allowed}, or for a recording without settings its rate [Hz], told"
            raise InputError(f"column {name}", error.found, allowed, f"{where} row {error.row + 1}") from None
        rate, index = even, np.arange(values.shape[0])
        words = f"times that stand less than half a sample from their places were taken as even, {rate:.6g} Hz"
        remarks.append(Remark(RecordCode.ASSUMED, words))
    if head.rates and abs(rate / head.rates[0] - 1.0) > _ALIKE:
        words = f"the times give {rate:.6g} Hz, the lines above them tell {head.rates[0]:.6g} Hz: the times count"
        remarks.append(Remark(RecordCode.ASSUMED, words))
    if index[-1] + 1 == index.size:
        return rate, values
    full = np.full((index[-1] + 1, values.shape[1]), np.nan)
    full[index] = values
    return rate, full


def _check_one_time(head: Head, values: FloatArray, place: int, where: str) -> None:
    """Refuse columns that stand side by side, each with its own times, where the times are not the same."""
    alike = [i for i in head.times if i != place and (head.names[i], head.units[i]) == (head.names[place], head.units[place])]
    for other in alike:
        if np.nanmax(np.abs(values[:, other] - values[:, place])) > 1e-3 * np.nanmedian(np.diff(values[:, place])):
            found = f"columns {place + 1} and {other + 1} of different times"
            raise InputError("time", found, "channels that were sampled together: one file each, or one time for all", where)


def _nearly_even(time: FloatArray) -> float | None:
    """The rate [Hz] of times that jitter by less than half a sample about even ones; None of others."""
    if time.size < 3 or not np.all(np.isfinite(time)) or not np.all(np.diff(time) > 0.0):
        return None
    place = np.arange(time.size)
    step, start = np.polyfit(place, time, 1)
    return float(1.0 / step) if np.abs(time - start - step * place).max() < 0.5 * step else None
