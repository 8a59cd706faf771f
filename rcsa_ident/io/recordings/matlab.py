"""MATLAB recordings: vectors, rows of matrices and fields of structs, of MAT-files version 5 (-v6, -v7) and 7.3.

A channel is named as MATLAB writes it: ``x``, ``q(2)`` for the second signal of a matrix, whose longer side is time, ``rec.q(2)`` in a
struct, ``c{3}`` in a cell. Version 7.3 is HDF5 and goes through the same checks as HDF5; cells and arrays of structs are not read from it.
"""

from __future__ import annotations

import math
import re
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.io.channels import LARGEST_FILE, RATE, Channel, check_lengths, placed, snapped, the_only, time_scale
from rcsa_ident.io.files import existing_file, mapped
from rcsa_ident.io.recordings.matlab_elements import COMPLETE, EXPORTED, HEADER, NUMBERS, Version5
from rcsa_ident.io.time_base import Irregular, time_unit
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.told_units import seconds_in

#: Variables that hold the rate [Hz] or the interval [s], without signs and capitals.
_RATES = ("samplingratehz", "fs", "fshz", "fsamp", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "samplingfreq")
_STEPS = ("dt", "ts", "deltat", "sampleinterval", "samplinginterval", "sampleperiod", "samplingperiod", "timestep")
#: Signals of a matrix that are listed.
_MOST_LISTED = 16
_HDF5 = b"\x89HDF\r\n\x1a\n"


class Tables(Protocol):
    """What a file of either version tells."""

    def names(self, beside: str) -> list[str]:
        """Return the names on the root, and those in the struct that `beside` stands in."""

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape, as MATLAB has it, of a table of real numbers."""

    def table(self, name: str) -> FloatArray:
        """Return its values, in its shape."""


def read_channels(path: Path, names: Sequence[str], default_rate: float | None, time: str | None = None) -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named signals as they stand in the file, shape (n,) each.

    The rate comes from a vector ``time`` in seconds, or ``time_ms`` and the like (also ``t`` and what begins with ``time``, where it rises
    and is as long), else from a number ``sampling_rate_hz``, ``Fs``, ``SampleRate`` or an interval ``dt``, ``Ts``, both where the
    channel stands or around it, else from the campaign.

    `names`: channels that are wanted
    `default_rate` [Hz]: for a file that carries no rate; of several vectors of times the one that tells this rate is taken
    `time`: name of the vector of times, where the file's names do not tell it
    """
    with tables_of(path) as tables:
        return _read(tables, names, default_rate, time, str(path))


def told_channels(path: Path) -> list[tuple[str, str]]:
    """Return the vectors of numbers on the root, and the signals of its matrices, but times and rates, each with an empty unit."""
    found: list[tuple[str, str]] = []
    refused: list[InputError] = []
    with tables_of(path) as tables:
        for name in tables.names(""):
            if time_unit(name) is not None or _plain(name) in (*_RATES, *_STEPS):
                continue
            try:
                shape = tables.shape(name)
            except InputError as error:  # a text, a struct, a cell
                refused += [error] if error.allowed == EXPORTED else []
                continue
            signals, samples = min(shape), max(shape)
            if len(shape) == 2 and 0 < signals < samples:
                found += [(name if signals == 1 else f"{name}({i + 1})", "") for i in range(min(signals, _MOST_LISTED))]
    if refused and not found:
        raise refused[0]
    return found


@contextmanager
def tables_of(path: Path) -> Iterator[Tables]:
    """What a file of either version tells."""
    where = str(path)
    with existing_file(path, "recording", 1 << 62).open("rb") as file:
        newer = file.read(HEADER + 512 + len(_HDF5))[512 : 512 + len(_HDF5)] == _HDF5
    if newer:
        from rcsa_ident.io.recordings.hdf5 import matlab_tables

        with matlab_tables(path, (*NUMBERS, "logical")) as tables:
            yield tables
        return
    try:
        yield Version5(mapped(path, "recording", LARGEST_FILE), where)
    except (struct.error, zlib.error, UnicodeDecodeError) as error:
        raise InputError("recording", f"one that cannot be read ({error})", COMPLETE, where) from None


def _read(tables: Tables, names: Sequence[str], default: float | None, time: str | None, where: str) -> tuple[float, list[Channel]]:
    read: dict[str, FloatArray] = {}
    channels: list[Channel] = [_signal(tables, name, read, where) for name in names]
    check_lengths(names, [values.size for values in channels], where)
    grids = {name.rpartition(".")[0]: name for name in names}
    found = [_times(tables, name, channels[0].size, default, time, where) for name in grids.values()]
    if len({(str(times), rate) for times, rate in found}) > 1:
        told = ", ".join(f"{name}: {times or f'{rate} Hz'}" for name, (times, rate) in zip(grids.values(), found, strict=True))
        raise InputError("channels", f"several times or rates ({told})", "channels that were sampled together", where)
    times, rate = found[0]
    if times:
        values = _signal(tables, times, read, where)
        check_lengths([times, *names[:1]], [values.size, channels[0].size], where)
        try:
            return placed(values.astype(float) * _seconds(times), channels, rate)
        except Irregular as error:
            raise InputError(f"{times}({error.row + 1})", error.found, error.allowed, where) from None
    if rate is None:
        raise InputError(
            RATE, "nothing", f"a vector 'time' [s], a number {RATE}, Fs or SampleRate, or dt, or the campaign's rate [Hz]", where
        )
    return positive(RATE, rate, "Hz"), channels


def _signal(tables: Tables, name: str, read: dict[str, FloatArray], where: str) -> FloatArray:
    """A vector, or one signal of a matrix."""
    field, present = f"channel {name}", tables.names(name)
    base, number = name, 0
    if name not in present and (match := re.fullmatch(r"(.+)\(([0-9]{1,9})\)", name)):
        base, number = match[1], int(match[2])
    if base not in present:
        the_only(name, present, where)
    shape = tables.shape(base)
    signals, samples = min(shape), max(shape)
    if not number:
        if (len(shape) > 2 and sorted(shape)[-2] > 1) or signals != 1:
            several = f", or one of its signals: {name}(1) to {name}({signals})" if len(shape) == 2 and 1 < signals < samples else ""
            raise InputError(field, f"shape {shape}", f"a vector with at least one sample{several}", where)
        number = 1
    if len(shape) != 2 or signals < 1 or (signals == samples and signals > 1):
        raise InputError(field, f"{base} of shape {shape}", "a matrix whose longer side is time", where)
    if not 1 <= number <= signals:
        raise InputError(field, f"number {number}", f"{base}(1) to {base}({signals})", where)
    if base not in read:
        read[base] = tables.table(base)
    return read[base][number - 1] if shape[1] == samples else read[base][:, number - 1]


def _times(tables: Tables, name: str, samples: int, default: float | None, time: str | None, where: str) -> tuple[str | None, float | None]:
    """Name of the vector of times, and the rate, of a channel: what stands nearest around it."""
    if time is not None:
        return time, default
    present, scope = tables.names(name), name
    while scope:
        scope = scope.rpartition(".")[0]
        inside = scope + "." if scope else ""
        beside = [each for each in present if each.startswith(inside) and "." not in each[len(inside) :] and each != name]
        times = [each for each in beside if time_scale(each[len(inside) :]) is not None and each[len(inside) :].lower().startswith("time")]
        if len(times) != 1:
            like = [each for each in beside if each[len(inside) :].startswith("time") or time_unit(each[len(inside) :]) is not None]
            times = _fitting(tables, times or [each for each in like if _rises(tables, each, samples)], default, where)
        known = _rates(tables, [each for each in beside if _plain(each[len(inside) :]) in (*_RATES, *_STEPS)], default, where)
        if times or known:
            return times[0] if times else None, known[0] if known else default
    return None, default


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _seconds(name: str) -> float:
    """Seconds per unit of a vector of times, by its name."""
    return seconds_in(time_unit(name.rpartition(".")[2]) or "s") or 1.0


def _rises(tables: Tables, name: str, samples: int) -> bool:
    """Whether a variable may be the times of a channel: as long, and rising."""
    try:
        shape = tables.shape(name)
    except InputError:  # a text, a struct, a cell
        return False
    return bool(max(shape) == samples == math.prod(shape) and np.all(np.diff(tables.table(name).ravel()) > 0.0))


def _rates(tables: Tables, names: list[str], default: float | None, where: str) -> list[float]:
    """Rates [Hz] that numbers tell, as rates or as intervals; they have to agree."""
    told: dict[str, float] = {}
    for name in names:
        interval = _plain(name.rpartition(".")[2]) in _STEPS
        try:
            values = tables.table(name).ravel() if min(tables.shape(name)) else np.empty(0)
        except InputError:  # a text or a struct of that name
            continue
        if values.size == 1:
            value = positive(f"variable {name}", float(values[0]), "s" if interval else "Hz")
            told[name] = snapped(1.0 / value, 1e-9, default) if interval else value
        elif values.size and not interval:
            raise InputError(f"variable {name}", f"{values.size} numbers", "one number [Hz]", where)
    found = list(told.values())
    if found and max(found) > min(found) * (1.0 + 1e-6):
        raise InputError(RATE, f"different rates ({', '.join(told)})", "one rate [Hz]", where)
    return found


def _fitting(tables: Tables, times: list[str], default: float | None, where: str) -> list[str]:
    """Of several vectors of times the one that tells the campaign's rate."""
    if len(times) < 2:
        return times
    told: list[str] = []
    for each in times:
        try:
            rate, _ = placed(tables.table(each).ravel().astype(float) * _seconds(each), [], default)
        except Irregular:
            continue
        if default is None or abs(rate / default - 1.0) < 1e-3:
            told.append(each)
    if len(told) != 1:
        allowed = "one that tells the campaign's sampling_rate_hz, or the argument 'time' that names it"
        raise InputError("time", f"several vectors of times: {listed(times)}", allowed, where)
    return told
