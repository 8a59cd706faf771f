"""NI TDMS recordings: channels by name, scaled as the file says; read by npTDMS, which comes with the extra `tdms`.

The library reads what a file declares and stops silently where it ends. So the segments are walked first: nothing may be
cut off, and objects, properties and samples have to fit into the file.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.io.channels import (
    LARGEST_STORED,
    RATE,
    Channel,
    Scratch,
    Signals,
    cannot_be_read,
    check_declared,
    check_lengths,
    lacks,
    snapped,
    the_only,
)
from rcsa_ident.io.files import Bytes, mapped
from rcsa_ident.io.validated_table import listed

COMPLETE = "a complete TDMS file"
#: Properties that name a channel's unit.
_UNITS = ("unit_string", "NI_UnitDescription")
MOST_SEGMENTS = 100_000
#: Objects over all segments, as the library lists them, and properties.
MOST_ENTRIES = 1_000_000
MOST_CHUNKS = 200_000
MOST_SCALES = 32
SCALES = ("Linear", "Polynomial", "Table", "Add", "Subtract", "Strain", "RTD", "Thermistor", "Thermocouple", "AdvancedAPI")
#: Of a sample: channels may start this far from each other.
_SAME_START = 0.5
_METADATA, _NEW_LIST, _BIG_ENDIAN = 1 << 1, 1 << 2, 1 << 6
_NO_DATA, _AS_BEFORE = 0xFFFFFFFF, 0
#: DAQmx raw data: bytes of one scaler's description.
_SCALERS = {0x1269: 20, 0x126A: 17}
_STRING = 0x20
_WIDTHS = {1: 1, 2: 2, 3: 4, 4: 8, 5: 1, 6: 2, 7: 4, 8: 8, 9: 4, 10: 8, 0x19: 4, 0x1A: 8, 0x21: 1, 0x44: 16}
_LEAD_IN = 28
#: From which LabVIEW counts seconds; it has no stamp where its clock was never set.
_EPOCH = datetime(1904, 1, 1, tzinfo=UTC)


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named channels in the file's own units, shape (n,) each; long ones on the disk.

    A channel is called by its name, or as ``group/channel`` where two groups have one of that name. The rate is the waveform's
    (``wf_increment``), else the campaign's.

    `names`: channels that are wanted
    `default_rate` [Hz]: for a file that carries no rate
    """
    with _opened(path) as (file, size):
        return _channels(file, names, default_rate, size, str(path))


def told_channels(path: Path) -> list[tuple[str, str]]:
    """Return the names of a file's channels that hold numbers, each with its unit, empty where the file says none."""
    with _opened(path) as (file, _):
        present = [channel for group in file.groups() for channel in group.channels()]
        units = [_unit(channel) for channel in present]
        held = [len(c) > 1 and c.dtype.kind in "iuf" for c in present]
        return [pair for pair, numbers in zip(zip(_plain_names(present), units, strict=True), held, strict=True) if numbers]


def _unit(channel: Any) -> str:
    return str(next((channel.properties[key] for key in _UNITS if key in channel.properties), ""))


def _plain_names(present: Sequence[Any]) -> list[str]:
    """Names of channels, with their group where another one has the same."""
    short = [channel.name for channel in present]
    return [f"{channel.group_name}/{channel.name}" if short.count(channel.name) > 1 else channel.name for channel in present]


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, int]]:
    """The file as the library has it, its structure checked before, and its size [bytes]."""
    where = str(path)
    raw = mapped(path, "recording", LARGEST_STORED)
    if raw[:4] != b"TDSm":
        raise InputError("recording", "a file that does not begin with TDSm", COMPLETE, where)
    _check_structure(raw, where)
    try:
        from nptdms import TdmsFile
        from nptdms.log import log_manager
    except ImportError:
        raise lacks("a TDMS file", "npTDMS", "tdms", where) from None
    # what the library only warns of is an error here
    log_manager.set_level(100)
    try:
        # opened here: given a path, the library would also read an index beside the file
        with np.errstate(all="ignore"), path.open("rb") as opened, TdmsFile.open(opened, raw_timestamps=True) as file:
            yield file, len(raw)
    except InputError:
        raise
    except Exception as error:
        raise cannot_be_read(error, COMPLETE, where) from None


def _check_structure(raw: Bytes, where: str) -> None:
    """Walk all segments: every one is complete, and the library's lists of objects stay small."""
    place, segments, entries = 0, 0, 0
    present: set[bytes] = set()
    try:
        while place < len(raw):
            if raw[place : place + 4] != b"TDSm":
                raise InputError("recording", f"no segment at byte {place}", COMPLETE, where)
            flags = struct.unpack_from("<I", raw, place + 4)[0]
            order = ">" if flags & _BIG_ENDIAN else "<"
            whole, metadata = struct.unpack_from(f"{order}QQ", raw, place + 12)
            start = place + _LEAD_IN
            if start + whole > len(raw) or metadata > whole:
                found = f"a segment that is cut off, {len(raw) - place} bytes left of it"
                raise InputError("recording", found, COMPLETE, where)
            if flags & _METADATA:
                paths, properties = _segment_paths(raw[start : start + metadata], order, len(raw), MOST_ENTRIES - entries, where)
                present = set(paths) if flags & _NEW_LIST else present | set(paths)
                entries += properties
            entries, segments, place = entries + len(present), segments + 1, start + whole
            if entries > MOST_ENTRIES or segments > MOST_SEGMENTS:
                raise _too_many(where)
    except (struct.error, IndexError):
        raise InputError("recording", f"a segment at byte {place} that is cut off", COMPLETE, where) from None


def _too_many(where: str) -> InputError:
    allowed = f"at most {MOST_SEGMENTS} segments with at most {MOST_ENTRIES} objects and properties"
    return InputError("recording", "more segments, objects and properties than any recording has", allowed, where)


def _segment_paths(raw: bytes, order: str, size: int, most: int, where: str) -> tuple[list[bytes], int]:
    """Paths of a segment's objects and the number of their properties; nothing reaches beyond the metadata."""
    place = 0

    def number() -> int:
        nonlocal place
        place += 4
        return int(struct.unpack_from(f"{order}I", raw, place - 4)[0])

    def text() -> bytes:
        nonlocal place
        length = number()
        place += length
        if place > len(raw):
            raise IndexError
        return raw[place - length : place]

    paths: list[bytes] = []
    properties = 0
    for _ in range(number()):
        paths.append(text())
        index = number()
        if index not in (_NO_DATA, _AS_BEFORE):
            kind, _, count = struct.unpack_from(f"{order}IIQ", raw, place)
            place += 16
            if count > size:
                raise InputError("recording", f"{count} samples declared in a file of {size} bytes", COMPLETE, where)
            if index in _SCALERS:
                scalers = number()
                place += _SCALERS[index] * scalers
                widths = number()
                place += 4 * widths
            elif kind == _STRING:
                place += 8
        for _ in range(number()):
            text()
            kind = number()
            if kind == _STRING:
                text()
            elif kind in _WIDTHS:
                place += _WIDTHS[kind]
            else:
                raise InputError("recording", f"a property of type {kind}", "properties that are numbers, texts, times or booleans", where)
            properties += 1
        if place > len(raw):
            raise IndexError
        if len(paths) + properties > most:
            raise _too_many(where)
    if len(set(paths)) < len(paths):
        raise InputError("recording", "an object twice in one segment", COMPLETE, where)
    return paths, properties


def _channels(file: Any, names: Sequence[str], default: float | None, size: int, where: str) -> tuple[float, list[Channel]]:
    present = [channel for group in file.groups() for channel in group.channels()]
    plain = _plain_names(present)
    found = []
    for name in names:
        full = [f"{channel.group_name}/{channel.name}" for channel in present]
        found.append(present[full.index(name) if full.count(name) == 1 else the_only(name, plain, where)])
    for name, channel in zip(names, found, strict=True):
        for properties in (channel.properties, file[channel.group_name].properties, file.properties):
            _check_scales(properties, f"channel {name}", where)
        if channel.dtype.kind not in "biuf":
            raise InputError(f"channel {name}", f"values of type {channel.dtype}", "real numbers", where)
    check_lengths(names, [len(channel) for channel in found], where)
    check_declared(len(found[0]), len(found), size, where, LARGEST_STORED)
    rate = _rate(found, names, default, where)
    if file.file_status.incomplete_final_segment or file.file_status.channel_statuses:
        raise InputError("recording", "a last segment that is not complete", COMPLETE, where)
    channels = [_values(channel, f"channel {name}", where) for name, channel in zip(names, found, strict=True)]
    return rate, Signals(channels, stored=tuple(_unit(channel) for channel in found), started=_moment(found[0].properties))


def _values(channel: Any, field: str, where: str) -> Channel:
    """A channel's samples; its chunks lie between those of the others, so that a long one is written down as they come."""
    values = Scratch()
    for count, chunk in enumerate(channel.data_chunks()):
        if count >= MOST_CHUNKS:
            raise InputError(field, f"more than {MOST_CHUNKS} chunks", f"at most {MOST_CHUNKS} chunks", where)
        values.add(chunk[:])
    if values.size != len(channel):
        raise InputError(field, f"{values.size} of {len(channel)} samples", COMPLETE, where)
    return values.channel()


def _check_scales(properties: Mapping[str, Any], field: str, where: str) -> None:
    """Every scaling is one that the library knows, and takes its input from an earlier one: else the samples would be raw ones."""
    if properties.get("NI_Scaling_Status") == "scaled":
        return
    count = properties.get("NI_Number_Of_Scales", 0)
    if not isinstance(count, int | np.integer) or not 0 <= count <= MOST_SCALES:
        raise InputError(field, f"{listed([str(count)])} scalings", f"from 0 to {MOST_SCALES}", where)
    sums = 0
    for key, value in properties.items():
        match = re.fullmatch(r"NI_Scale\[(\d{1,9})\]_(.+)", key)
        if match is None:
            continue
        number, what = int(match[1]), match[2]
        if number >= MOST_SCALES:
            raise InputError(field, f"a scaling of number {number}", f"a number below {MOST_SCALES}", where)
        if what == "Scale_Type" and value not in SCALES:
            raise InputError(field, f"a scaling of type {listed([str(value)])}", f"one of {', '.join(SCALES)}", where)
        sums += what == "Scale_Type" and value in ("Add", "Subtract")
        raw = isinstance(value, int | np.integer) and value == _NO_DATA
        if what.endswith("Input_Source") and not raw and not (isinstance(value, int | np.integer) and 0 <= value < number):
            raise InputError(
                field, f"scaling {number} of scaling {listed([str(value)])}", "the input of a scaling before its output", where
            )
        if what.endswith("_Size") and not (isinstance(value, int | np.integer) and 0 <= value <= len(properties)):
            raise InputError(field, f"a scaling of {listed([str(value)])} values", f"at most {len(properties)}", where)
    # each may double the work of those before it
    if sums > 4:
        raise InputError(field, f"{sums} sums of scalings", "at most 4", where)


def _rate(found: Sequence[Any], names: Sequence[str], default: float | None, where: str) -> float:
    """The waveform's increment, else the campaign's rate; all channels agree and start together."""
    rates = []
    for name, channel in zip(names, found, strict=True):
        step = channel.properties.get("wf_increment")
        if step is None:
            if default is None:
                raise InputError(RATE, "nothing", "the property wf_increment of the channels, or the campaign's rate [Hz]", where)
            rates.append(positive(RATE, default, "Hz"))
            continue
        if not isinstance(step, int | float) or not 0.0 < step < math.inf or not 0.0 < 1.0 / step < math.inf:
            raise InputError(f"wf_increment of channel {name}", listed([str(step)]), "a finite number above 0 [s]", where)
        rates.append(snapped(1.0 / step, 1e-9, default))
    if len(set(rates)) > 1:
        shown = ", ".join(f"{n}: {r:g}" for n, r in zip(names, rates, strict=True))
        raise InputError(RATE, f"different rates ({shown})", "one rate for all channels [Hz]", where)
    starts = [_start(channel.properties, name, where) for name, channel in zip(names, found, strict=True)]
    for name, (seconds, fraction, timed) in zip(names, starts, strict=True):
        apart = (seconds - starts[0][0]) + (fraction - starts[0][1])
        if timed and starts[0][2] and abs(apart) * rates[0] > _SAME_START:
            allowed = f"channels that start together, within half a sample of {names[0]} [s]"
            raise InputError(f"start of channel {name}", f"{apart:.3g} s later", allowed, where)
    return rates[0]


def _start(properties: Mapping[str, Any], name: str, where: str) -> tuple[int, float, bool]:
    """Whole seconds and the rest of a channel's start, and whether the file says when that was."""
    offset = properties.get("wf_start_offset", 0.0)
    if not isinstance(offset, int | float) or not math.isfinite(offset):
        raise InputError(f"wf_start_offset of channel {name}", listed([str(offset)]), "a finite number [s]", where)
    stamp = properties.get("wf_start_time")
    if stamp is None:
        return 0, offset, "wf_start_offset" in properties
    return int(stamp.seconds), stamp.second_fractions * 2.0**-64 + offset, True


def _moment(properties: Mapping[str, Any]) -> datetime | None:
    """When a channel's first sample was taken; None where the file does not say it, or no date is so far away."""
    stamp = properties.get("wf_start_time")
    if stamp is None:
        return None
    try:
        seconds = int(stamp.seconds) + float(stamp.second_fractions) * 2.0**-64 + properties.get("wf_start_offset", 0.0)
        return _EPOCH + timedelta(seconds=seconds) if seconds > 0.0 else None
    except OverflowError:
        return None
