"""Parquet recordings: one flat column of numbers a channel; read by pyarrow, which comes with the extra `parquet`.

A page of a few kilobytes may stand for gigabytes, and the library ends the whole process over some damaged descriptions. So
the description and the headers of all pages that would be read are looked at here before: how much they unpack to, and
that they lie inside of the file.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.io.channels import (
    LARGEST_DATA,
    LARGEST_FILE,
    RATE,
    Channel,
    Scratch,
    Signals,
    cannot_be_read,
    check_declared,
    check_lengths,
    lacks,
    placed,
    the_only,
    time_scale,
)
from rcsa_ident.io.files import MEGABYTE, Bytes, mapped
from rcsa_ident.io.time_base import Irregular
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.recording import BLOCK

COMPLETE = "a complete Parquet file"
LARGEST_FOOTER = 2 * MEGABYTE
LARGEST_PAGE = 64 * MEGABYTE
MOST_PAGES = 100_000
MOST_GROUPS = 10_000
_MAGIC = b"PAR1"
#: Physical types as the format numbers them, those that a channel may have, and whole numbers among the converted and logical types.
_TYPES = ("BOOLEAN", "INT32", "INT64", "INT96", "FLOAT", "DOUBLE", "BYTE_ARRAY", "FIXED_LEN_BYTE_ARRAY")
_NUMBERS = ("INT32", "INT64", "FLOAT", "DOUBLE")
_CONVERTED = range(11, 19)
_LOGICAL_INTEGER = 10
_REPEATED = 2
#: Kinds of values of Thrift's compact protocol.
_TRUE, _FALSE, _I8, _I16, _I32, _I64, _F64, _BYTES, _LIST, _SET, _MAP, _STRUCT = range(1, 13)
_DEEPEST = 8

#: A structure: values by their number and kind.
Struct = dict[tuple[int, int], Any]


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named columns as they stand in the file, shape (n,) each; a null is a lost sample.

    The rate comes from a column ``time`` in seconds, else from the file's metadata ``sampling_rate_hz``, else from the campaign.

    `names`: channels that are wanted
    `default_rate` [Hz]: for a file that carries no rate
    """
    where = str(path)
    raw = mapped(path, "recording", LARGEST_FILE)
    described = _described(raw, where)
    try:
        wanted, rate = _checked(described, names, default_rate, raw, where)
    except (IndexError, struct.error):
        raise InputError("recording", "a description that cannot be read", COMPLETE, where) from None
    try:
        import pyarrow
        from pyarrow.parquet import ParquetFile
    except ImportError:
        raise lacks("a Parquet file", "pyarrow", "parquet", where) from None
    try:
        # types that the file asks for beyond its numbers are not made
        options = {"arrow_extensions_enabled": False, "page_checksum_verification": True, "pre_buffer": False}
        with ParquetFile(pyarrow.BufferReader(raw), **options) as file:
            if file.metadata.num_rows != described[3, _I64]:
                raise InputError("recording", "two numbers of rows", COMPLETE, where)
            rows = [Scratch() for _ in wanted]
            for batch in file.iter_batches(BLOCK, columns=wanted, use_threads=False):
                for column, name in zip(rows, wanted, strict=True):
                    column.add(_numbers(batch, name, pyarrow))
            columns = [column.channel() for column in rows]
            told = [file.schema_arrow.field(name).metadata or {} for name in names]
            units = tuple((each.get(b"unit") or each.get(b"units") or b"").decode("utf-8", "replace") for each in told)
    except InputError:
        raise
    except Exception as error:
        raise cannot_be_read(error, COMPLETE, where) from None
    check_lengths(wanted, [column.size for column in columns], where)
    if len(wanted) == len(names):
        if rate is None:
            raise InputError(RATE, "nothing", f"a column 'time' [s], the file's metadata {RATE}, or the campaign's rate [Hz]", where)
        return positive(RATE, rate, "Hz"), Signals(columns, stored=units)
    try:
        rate, columns = placed(columns[-1][:] * (time_scale(wanted[-1]) or 1.0), columns[:-1], rate)
        return rate, Signals(columns, stored=units)
    except Irregular as error:
        raise InputError(f"column {wanted[-1]} row {error.row + 1}", error.found, error.allowed, where) from None


def told_channels(path: Path) -> list[tuple[str, str]]:
    """Return the names of the columns of numbers but the time, each with an empty unit: the format names none."""
    where = str(path)
    try:
        columns = _structs(_described(mapped(path, "recording", LARGEST_FILE), where), 2)[1:]
        names = [each[4, _BYTES].decode("utf-8", "replace") for each in columns if (4, _BYTES) in each and _kind(each) in _NUMBERS]
    except IndexError:
        raise InputError("recording", "a description that cannot be read", COMPLETE, where) from None
    return [(name, "") for name in names if time_scale(name) is None]


def _described(raw: Bytes, where: str) -> Struct:
    """The description at the file's end."""
    if len(raw) < 12 or raw[:4] != _MAGIC or raw[-4:] != _MAGIC:
        raise InputError("recording", "a file that does not begin and end with PAR1", COMPLETE, where)
    footer = struct.unpack_from("<I", raw, len(raw) - 8)[0]
    if footer > min(LARGEST_FOOTER, len(raw) - 12):
        allowed = f"at most {LARGEST_FOOTER // MEGABYTE} MB, inside of the file"
        raise InputError("recording", f"a description of {footer} bytes", allowed, where)
    try:
        return _struct(raw, len(raw) - 8 - footer)[0]
    except (IndexError, struct.error):
        raise InputError("recording", "a description that cannot be read", COMPLETE, where) from None


def _numbers(table: Any, name: str, pyarrow: Any) -> FloatArray:
    # a null becomes NaN on the way to numpy
    return table.column(name).cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)


def _checked(described: Struct, names: Sequence[str], default: float | None, raw: Bytes, where: str) -> tuple[list[str], float | None]:
    """Columns to read, the time last where there is one, and the rate that the file or the campaign says."""
    schema = _structs(described, 2)
    if not schema or any(column.get((5, _I32)) for column in schema[1:]) or schema[0].get((5, _I32)) != len(schema) - 1:
        raise InputError("recording", "nested columns", "one number per row and column", where)
    columns = schema[1:]
    present = [column[4, _BYTES].decode("utf-8", "replace") for column in columns if (4, _BYTES) in column]
    if len(present) < len(columns):
        raise IndexError
    time = [name for name in present if time_scale(name) is not None and name not in names]
    if len(time) > 1:
        raise InputError("time", f"columns {' and '.join(time)}", "one time column", where)
    wanted = [*names, *time]
    places = [the_only(name, present, where) for name in wanted]
    for name, place in zip(wanted, places, strict=True):
        kind = _kind(columns[place])
        if kind not in _NUMBERS:
            raise InputError(f"column {name}", f"values of type {kind}", f"numbers ({', '.join(_NUMBERS)})", where)
    rows = described.get((3, _I64), -1)
    if rows < 1:
        raise InputError("recording", f"{rows} rows", "at least one row", where)
    check_declared(rows, len(wanted), len(raw), where)
    _check_groups(_structs(described, 4), places, rows, raw, where)
    return wanted, _rate(_structs(described, 5), default, where)


def _kind(column: Struct) -> str:
    """Physical type, or what keeps a column from being numbers."""
    if column.get((3, _I32)) == _REPEATED:
        return "lists"
    converted, logical = column.get((6, _I32)), column.get((10, _STRUCT), {})
    if (converted is not None and converted not in _CONVERTED) or any(number != _LOGICAL_INTEGER for number, _ in logical):
        return "times, texts or decimals"
    number = column.get((1, _I32), -1)
    return _TYPES[number] if 0 <= number < len(_TYPES) else f"number {number}"


def _rate(pairs: Sequence[Struct], default: float | None, where: str) -> float | None:
    for pair in pairs:
        if pair.get((1, _BYTES)) == RATE.encode():
            text = pair.get((2, _BYTES), b"")[:40].decode("utf-8", "replace")
            try:
                return positive(RATE, float(text), "Hz")
            except ValueError:
                raise InputError(RATE, listed([text]), "a finite number greater than 0 [Hz]", where) from None
    return default


def _check_groups(groups: Sequence[Struct], places: Sequence[int], rows: int, raw: Bytes, where: str) -> None:
    """The pages of every wanted column lie in the file, hold as many rows as there are, and unpack to what a recording may have."""
    if len(groups) > MOST_GROUPS:
        raise InputError("recording", f"{len(groups)} row groups", f"at most {MOST_GROUPS}", where)
    unpacked, pages, found = 0, 0, 0
    for group in groups:
        count = group.get((3, _I64), -1)
        found += count
        for place in places:
            chunk = _structs(group, 1)[place]
            data = chunk.get((3, _STRUCT), {})
            if data.get((5, _I64)) != count or (1, _BYTES) in chunk:
                shown = "values in another file" if (1, _BYTES) in chunk else f"{data.get((5, _I64))} values in {count} rows"
                raise InputError("recording", shown, COMPLETE, where)
            sizes = _page_sizes(raw, data, where)
            unpacked, pages = unpacked + sum(sizes), pages + len(sizes)
            if unpacked > LARGEST_DATA or pages > MOST_PAGES or max(sizes, default=0) > LARGEST_PAGE:
                shown = f"{pages} pages of up to {max(sizes) / MEGABYTE:.3g} MB, together {unpacked / MEGABYTE:.3g} MB"
                allowed = f"at most {MOST_PAGES} of {LARGEST_PAGE // MEGABYTE} MB, together {LARGEST_DATA // MEGABYTE} MB"
                raise InputError("recording", shown, allowed, where)
    if found != rows:
        raise InputError("recording", f"{found} rows in groups", f"{rows}, as the file states", where)


def _page_sizes(raw: Bytes, chunk: Struct, where: str) -> list[int]:
    """What each page of a column's chunk unpacks to [bytes]."""
    place, dictionary = chunk.get((9, _I64), -1), chunk.get((11, _I64), 0)
    # as the library does it
    place = dictionary if 0 < dictionary < place else place
    end = place + chunk.get((7, _I64), -1)
    if not 4 <= place <= end <= len(raw) - 8:
        raise InputError("recording", f"pages from byte {place} to {end}", f"pages inside of a file of {len(raw)} bytes", where)
    sizes: list[int] = []
    while place < end:
        header, place = _struct(raw, place)
        full, packed = header.get((2, _I32), -1), header.get((3, _I32), -1)
        if full < 0 or packed < 0 or place + packed > end:
            raise InputError("recording", f"a page of {packed} bytes that unpack to {full}", "pages inside of their column", where)
        sizes.append(full)
        place += packed
        if len(sizes) > MOST_PAGES:
            raise InputError("recording", f"more than {MOST_PAGES} pages", f"at most {MOST_PAGES} pages", where)
    return sizes


def _structs(outer: Struct, number: int) -> list[Struct]:
    """The structures of a list, none where there is no such list."""
    kind, items = outer.get((number, _LIST), (_STRUCT, []))
    if kind != _STRUCT and items:
        raise IndexError
    return items


def _struct(raw: Bytes, place: int, depth: int = 0) -> tuple[Struct, int]:
    """Read a structure in Thrift's compact protocol; returns where it ends, too."""
    found: Struct = {}
    number = 0
    while (head := raw[place]) != 0:
        place, kind = place + 1, head & 15
        if head >> 4:
            number += head >> 4
        else:
            number, place = _zigzag(raw, place)
        if kind in (_TRUE, _FALSE):
            found[number, kind] = kind == _TRUE
        else:
            found[number, kind], place = _value(raw, place, kind, depth)
    return found, place + 1


def _value(raw: Bytes, place: int, kind: int, depth: int) -> tuple[Any, int]:
    if depth > _DEEPEST:
        raise IndexError
    if kind in (_TRUE, _FALSE, _I8):
        return raw[place], place + 1
    if kind in (_I16, _I32, _I64):
        return _zigzag(raw, place)
    if kind == _F64:
        return struct.unpack_from("<d", raw, place)[0], place + 8
    if kind == _BYTES:
        length, place = _varint(raw, place)
        if place + length > len(raw):
            raise IndexError
        return raw[place : place + length], place + length
    if kind == _STRUCT:
        return _struct(raw, place, depth + 1)
    if kind not in (_LIST, _SET):
        raise IndexError
    head = raw[place]
    length, place = (head >> 4, place + 1) if head >> 4 != 15 else _varint(raw, place + 1)
    items = []
    for _ in range(length):
        item, place = _value(raw, place, head & 15, depth + 1)
        items.append(item)
    return (head & 15, items), place


def _zigzag(raw: Bytes, place: int) -> tuple[int, int]:
    value, place = _varint(raw, place)
    return (value >> 1) ^ -(value & 1), place


def _varint(raw: Bytes, place: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        value |= (raw[place] & 0x7F) << shift
        place += 1
        if not raw[place - 1] & 0x80:
            return value, place
    raise IndexError
