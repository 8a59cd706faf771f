"""What all formats of recordings have in common: how much may be declared, what is missing, which rate is meant."""

from __future__ import annotations

import errno
import os
import re
import tempfile
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.io.files import MEGABYTE
from rcsa_ident.io.time_base import uniform
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.recording import LONGEST, Quantity
from rcsa_ident.signals.told_units import seconds_in

RATE, STARTED = "sampling_rate_hz", "started"
#: Columns of times in files of columns with names and nothing else: ``time`` in seconds, or with its unit behind.
_TIME = re.compile(r"(?:time|t(?=_))(?:_(?P<unit>s|ms|us|ns))?", re.IGNORECASE)
#: Of a file that is read as a whole, and of its channels as float64.
LARGEST_FILE = 512 * MEGABYTE
LARGEST_DATA = 512 * MEGABYTE
#: Of channels that stay in the file, as float64.
LARGEST_STORED = 2048 * MEGABYTE
#: Declared bytes per byte on disk: measured signals hardly shrink at all.
LARGEST_RATIO = 200


@dataclass(frozen=True, slots=True)
class StoredChannel:
    """A channel that stays in its file: parts of it are read where they are asked for.

    `size`: number of samples
    `read`: callable of (first, end); returns these samples, shape (end - first,)
    """

    size: int
    read: Callable[[int, int], FloatArray]

    def __getitem__(self, part: slice) -> FloatArray:
        first, end, _ = part.indices(self.size)
        return self.read(first, max(first, end))

    def __array__(self, dtype: object = None, copy: bool | None = None) -> FloatArray:
        return self.read(0, self.size)


#: A channel's samples: an array, or what reads parts of one.
Channel = FloatArray | StoredChannel


class Signals(list[Channel]):
    """Channels of a recording with what the user should know of them.

    `units`: tuple of (str, Quantity or None). The unit that the file says of each channel, and what it measures: samples of a known
        quantity are in SI already, those of a voltage in volts. Empty where the file says none.
    `stored`: the unit that the file says of each channel whose samples stand in it, not in SI. Empty where the file says none.
    `started`: when the first sample was taken, where the file says it
    """

    def __init__(
        self,
        channels: Sequence[Channel],
        notes: tuple[Remark, ...] = (),
        units: tuple[tuple[str, Quantity | None], ...] = (),
        stored: tuple[str, ...] = (),
        started: datetime | None = None,
    ) -> None:
        super().__init__(channels)
        self.notes = notes
        self.units = units
        self.stored = stored
        self.started = started


def moment_of(text: str, form: str) -> datetime | None:
    """Return the date and time of a text of that form, as `datetime.strptime` takes it; None where it holds none.

    Examples
    --------
    >>> print(moment_of("18-Apr-16 13:49:58", "%d-%b-%y %H:%M:%S"))
    2016-04-18 13:49:58
    """
    try:
        return datetime.strptime(text, form)
    except ValueError:
        return None


def started_of(channels: Sequence[Channel]) -> datetime | None:
    """Return when a recording's first sample was taken, where its file says it."""
    return channels.started if isinstance(channels, Signals) else None


def notes_of(channels: Sequence[Channel]) -> tuple[Remark, ...]:
    """Return what the user should know of a recording's channels."""
    return channels.notes if isinstance(channels, Signals) else ()


class Scratch:
    """A channel of a format that cannot be read in parts, as it comes: in memory, and a long one in a file that has no name.

    The file stands in the folder for temporary files and is gone with the last who reads it.
    """

    def __init__(self) -> None:
        self.size = self._waiting = 0
        self._held: list[FloatArray] = []
        self._file: int | None = None

    def add(self, values: FloatArray) -> None:
        """Add further samples, shape (n,)."""
        self._held.append(np.array(values, dtype=float))
        self.size, self._waiting = self.size + len(values), self._waiting + len(values)
        if self._waiting > LONGEST:
            self._write()

    def channel(self) -> Channel:
        """Return the channel; nothing may be added any more."""
        if self._file is None:
            return np.concatenate([np.empty(0), *self._held])
        self._write()
        return StoredChannel(self.size, self._read)

    def _write(self) -> None:
        if self._file is None:
            self._file, name = tempfile.mkstemp()
            os.unlink(name)
            weakref.finalize(self, os.close, self._file)
        left = np.concatenate([np.empty(0), *self._held]).data.cast("B")
        self._held, self._waiting = [], 0
        while left:
            left = left[os.write(self._file, left) :]

    def _read(self, first: int, end: int) -> FloatArray:
        assert self._file is not None
        return np.frombuffer(os.pread(self._file, 8 * (end - first), 8 * first))


def kept(channel: StoredChannel) -> Channel:
    """Return a channel as it is where it is long, else its samples."""
    return channel if channel.size > LONGEST else channel[:]


def check_declared(samples: int, channels: int, size: int, where: str, largest: int = LARGEST_DATA) -> None:
    """Refuse what no file of `size` bytes holds, before memory is asked for it.

    `samples`, `channels`: declared number of samples of each channel, and of channels
    `size`: bytes of the file
    `where`: the file, for the messages
    `largest`: bytes that are allowed, as float64
    """
    declared = 8 * samples * channels
    if declared > largest:
        found = f"{declared / MEGABYTE:.3g} MB of declared samples"
        raise InputError("recording", found, f"at most {largest / MEGABYTE:.0f} MB", where)
    if declared > LARGEST_RATIO * size:
        found = f"{declared} bytes declared in a file of {size} bytes"
        raise InputError("recording", found, f"at most {LARGEST_RATIO} times the file's size", where)


def the_only(name: str, present: Sequence[str], where: str) -> int:
    """Return the place of a channel; one that is missing or stands there twice is refused.

    `present`: names of all channels, in the file's order
    `where`: the file, for the messages
    """
    places = [i for i, each in enumerate(present) if each == name]
    if len(places) != 1:
        found = "two of that name" if places else "no such channel"
        raise InputError(f"channel {name}", found, f"one channel of the file: {listed(list(present)) or 'it has none'}", where)
    return places[0]


def check_lengths(names: Sequence[str], lengths: Sequence[int], where: str) -> None:
    """Refuse channels of several lengths and channels without a sample.

    `lengths`: number of samples of each
    `where`: the file, for the messages
    """
    for name, length in zip(names, lengths, strict=True):
        if length == 0:
            raise InputError(f"channel {name}", "no samples", "at least one sample", where)
    if len(set(lengths)) > 1:
        found = ", ".join(f"{n}: {length}" for n, length in zip(names, lengths, strict=True))
        raise InputError("channels", f"different lengths ({found})", "channels of one length", where)


def snapped(rate: float, spread: float, expected: float | None = None) -> float:
    """Return the rate that was meant: the campaign's or the roundest number of hertz within `spread`, relative, else the rate itself.

    `rate` [Hz]
    `spread` [-]: relative error that the file's digits leave
    `expected` [Hz]: the campaign's rate
    """
    for candidate in (expected, *(round(rate / unit) * unit for unit in (100.0, 10.0, 1.0))):
        if candidate and abs(candidate / rate - 1.0) <= spread:
            return float(candidate)
    return rate


def placed(time: FloatArray, channels: Sequence[Channel], expected: float | None) -> tuple[float, list[Channel]]:
    """Return the rate [Hz] that times tell and the channels at their places; samples that the times skip are NaN.

    `time` [s], shape (n,)
    `channels`: sequence of Channel, shape (n,) each
    `expected` [Hz]: the campaign's rate
    Raises `Irregular`: the times are no multiples of one step.
    """
    rate, index = uniform(time, expected)
    if index[-1] + 1 == index.size:
        return rate, list(channels)
    padded: list[Channel] = []
    for values in channels:
        full = np.full(index[-1] + 1, np.nan)
        full[index] = values[:]
        padded.append(full)
    return rate, padded


def time_scale(name: str) -> float | None:
    """Return the seconds per unit of a column of times by its name alone; None of another column.

    >>> time_scale("time"), time_scale("time_ms"), time_scale("t")
    (1.0, 0.001, None)
    """
    found = _TIME.fullmatch(name)
    return seconds_in(found["unit"] or "s") if found else None


def lacks(what: str, package: str, extra: str, where: str) -> InputError:
    """Return the error of a format whose package is not installed.

    `what`: the file, in words
    `package`, `extra`: package that reads it, and the extra of this one that brings it
    `where`: the file, for the messages
    """
    return InputError(
        "recording", f"{what}, and {package} is not installed", f'an installation with pip install "rcsa-ident[{extra}]"', where
    )


def cannot_be_read(error: Exception, allowed: str, where: str) -> InputError:
    """Return one sentence for whatever a library raised on a broken file.

    `allowed`: what would have been read, in words
    `where`: the file, for the messages
    """
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        # a full disk is no fault of the file
        raise error
    reason = " ".join((str(error) or type(error).__name__).split())
    return InputError("recording", f"one that cannot be read ({listed([reason[:90]])})", allowed, where)
