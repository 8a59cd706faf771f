"""Parquet recordings: one flat column of numbers a channel; read by pyarrow, which comes with the extra `parquet`.

A page of a few kilobytes may stand for gigabytes. So the headers of all pages that would be read are looked at before:
how much they unpack to, and that they lie inside of the file.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError, positive
from rcsa_ident.io.channels import (
    LARGEST_DATA,
    LARGEST_FILE,
    RATE,
    TIME_COLUMNS,
    cannot_be_read,
    check_declared,
    check_lengths,
    lacks,
    placed,
    the_only,
)
from rcsa_ident.io.files import MEGABYTE, read_bytes
from rcsa_ident.io.time_base import Irregular

COMPLETE = "a complete Parquet file"
LARGEST_FOOTER = 16 * MEGABYTE
LARGEST_PAGE = 64 * MEGABYTE
MOST_PAGES = 100_000
MOST_GROUPS = 10_000
_MAGIC = b"PAR1"
_NUMBERS = ("INT32", "INT64", "FLOAT", "DOUBLE")


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, list[FloatArray]]:
    """Return the sampling rate [Hz] and the named columns as they stand in the file, shape (n,) each; a null is a lost sample.

    The rate comes from a column ``time`` in seconds, else from the file's metadata ``sampling_rate_hz``, else from the campaign.
    """
    where = str(path)
    raw = read_bytes(path, "recording", LARGEST_FILE)
    if len(raw) < 12 or raw[:4] != _MAGIC or raw[-4:] != _MAGIC:
        raise InputError("recording", "a file that does not begin and end with PAR1", COMPLETE, where)
    footer = struct.unpack_from("<I", raw, len(raw) - 8)[0]
    if footer > min(LARGEST_FOOTER, len(raw) - 12):
        allowed = f"at most {LARGEST_FOOTER // MEGABYTE} MB, inside of the file"
        raise InputError("recording", f"a description of {footer} bytes", allowed, where)
    try:
        import pyarrow
        from pyarrow.parquet import ParquetFile
    except ImportError:
        raise lacks("a Parquet file", "pyarrow", "parquet", where) from None
    try:
        # types that the file asks for beyond its numbers are not made
        options = {"arrow_extensions_enabled": False, "page_checksum_verification": True, "pre_buffer": False}
        with ParquetFile(pyarrow.BufferReader(raw), **options) as file:
            wanted, rate = _checked(file.metadata, names, default_rate, raw, where)
            table = file.read(columns=wanted, use_threads=False)
            columns = [_numbers(table, name, pyarrow) for name in wanted]
    except InputError:
        raise
    except Exception as error:
        raise cannot_be_read(error, COMPLETE, where) from None
    check_lengths(wanted, [column.size for column in columns], where)
    if len(wanted) == len(names):
        if rate is None:
            raise InputError(RATE, "nothing", f"a column 'time' [s], the file's metadata {RATE}, or the campaign's rate [Hz]", where)
        return positive(RATE, rate, "Hz"), columns
    try:
        return placed(columns[-1], columns[:-1], rate)
    except Irregular as error:
        raise InputError(f"column {wanted[-1]} row {error.row + 1}", error.found, error.allowed, where) from None


def _numbers(table: Any, name: str, pyarrow: Any) -> FloatArray:
    # a null becomes NaN on the way to numpy
    return table.column(name).cast(pyarrow.float64(), safe=False).to_numpy()


def _checked(
    metadata: Any, names: Sequence[str], default: float | None, raw: bytes, where: str
) -> tuple[list[str], float | None]:
    """Columns to read, the time last where there is one, and the rate that the file or the campaign says."""
    schema = [metadata.schema.column(i) for i in range(metadata.num_columns)]
    present = [column.path for column in schema]
    time = [name for name in present if name.lower() in TIME_COLUMNS and name not in names]
    if len(time) > 1:
        raise InputError("time", f"columns {' and '.join(time)}", "one time column", where)
    wanted = [*names, *time]
    places = [the_only(name, present, where) for name in wanted]
    for place in places:
        column = schema[place]
        field = f"column {column.path}"
        if column.max_repetition_level or column.max_definition_level > 1 or column.path != column.name:
            raise InputError(field, "a nested column", "one number a row", where)
        if column.physical_type not in _NUMBERS or column.logical_type.type not in ("NONE", "INT"):
            kind = column.logical_type.type if column.logical_type.type != "NONE" else column.physical_type
            raise InputError(field, f"values of type {kind}", f"numbers ({', '.join(_NUMBERS)})", where)
    if not 0 < metadata.num_rows:
        raise InputError("recording", f"{metadata.num_rows} rows", "at least one row", where)
    check_declared(metadata.num_rows, len(set(wanted)), len(raw), where)
    _check_groups(metadata, places, raw, where)
    return wanted, _rate(metadata, default, where)


def _rate(metadata: Any, default: float | None, where: str) -> float | None:
    text = (metadata.metadata or {}).get(RATE.encode())
    if text is None:
        return default
    try:
        return positive(RATE, float(text[:40]), "Hz")
    except ValueError:
        raise InputError(RATE, text[:40].decode("utf-8", "replace"), "a finite number greater than 0 [Hz]", where) from None


def _check_groups(metadata: Any, places: Sequence[int], raw: bytes, where: str) -> None:
    """The pages of every wanted column lie in the file, hold as many rows as there are, and unpack to what a recording may have."""
    if metadata.num_row_groups > MOST_GROUPS:
        raise InputError("recording", f"{metadata.num_row_groups} row groups", f"at most {MOST_GROUPS}", where)
    unpacked, pages, rows = 0, 0, 0
    for i in range(metadata.num_row_groups):
        group = metadata.row_group(i)
        rows += group.num_rows
        for place in places:
            chunk = group.column(place)
            if chunk.num_values != group.num_rows or chunk.file_path:
                found = f"{chunk.num_values} values in {group.num_rows} rows" if not chunk.file_path else "values in another file"
                raise InputError("recording", found, COMPLETE, where)
            sizes = _page_sizes(raw, chunk, where)
            unpacked, pages = unpacked + sum(sizes), pages + len(sizes)
            if unpacked > LARGEST_DATA or pages > MOST_PAGES or max(sizes, default=0) > LARGEST_PAGE:
                found = f"{pages} pages of up to {max(sizes) / MEGABYTE:.3g} MB, together {unpacked / MEGABYTE:.3g} MB"
                allowed = f"at most {MOST_PAGES} of {LARGEST_PAGE // MEGABYTE} MB, together {LARGEST_DATA // MEGABYTE} MB"
                raise InputError("recording", found, allowed, where)
    if rows != metadata.num_rows:
        raise InputError("recording", f"{rows} rows in groups", f"{metadata.num_rows} as the file says", where)


def _page_sizes(raw: bytes, chunk: Any, where: str) -> list[int]:
    """What each page of a column's chunk unpacks to [bytes]."""
    starts = [chunk.data_page_offset, chunk.dictionary_page_offset if chunk.has_dictionary_page else None]
    place = min(start for start in starts if start)
    end = place + chunk.total_compressed_size
    if not 4 <= place <= end <= len(raw) - 8:
        raise InputError("recording", f"pages from byte {place} to {end}", f"pages inside of a file of {len(raw)} bytes", where)
    sizes: list[int] = []
    while place < end:
        try:
            header, place = _struct(raw, place)
        except (IndexError, struct.error, RecursionError):
            raise InputError("recording", "a page without a header", COMPLETE, where) from None
        full, packed = header.get(2, -1), header.get(3, -1)
        if full < 0 or packed < 0 or place + packed > end:
            raise InputError("recording", f"a page of {packed} bytes that unpack to {full}", "pages inside of their column", where)
        sizes.append(full)
        place += packed
        if len(sizes) > MOST_PAGES:
            raise InputError("recording", f"more than {MOST_PAGES} pages", f"at most {MOST_PAGES} pages", where)
    return sizes


def _varint(raw: bytes, place: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        value |= (raw[place] & 0x7F) << shift
        place += 1
        if not raw[place - 1] & 0x80:
            return value, place
    raise IndexError


def _struct(raw: bytes, place: int, depth: int = 0) -> tuple[dict[int, int], int]:
    """32-bit numbers of a structure in Thrift's compact protocol by their ids, and where it ends; the rest is passed over."""
    found: dict[int, int] = {}
    field = 0
    while (head := raw[place]) != 0:
        place += 1
        if head >> 4:
            field += head >> 4
        else:
            number, place = _varint(raw, place)
            field = (number >> 1) ^ -(number & 1)
        kind = head & 15
        if kind == 5:
            number, place = _varint(raw, place)
            found[field] = (number >> 1) ^ -(number & 1)
        elif kind not in (1, 2):
            place = _skip(raw, place, kind, depth)
    return found, place + 1


def _skip(raw: bytes, place: int, kind: int, depth: int) -> int:
    if depth > 8:
        raise IndexError
    if kind in (1, 2, 3):
        return place + 1
    if kind in (4, 5, 6):
        return _varint(raw, place)[1]
    if kind == 7:
        return place + 8
    if kind == 8:
        length, place = _varint(raw, place)
        return place + length
    if kind == 12:
        return _struct(raw, place, depth + 1)[1]
    if kind in (9, 10):
        head = raw[place]
        length, place = (head >> 4, place + 1) if head >> 4 != 15 else _varint(raw, place + 1)
        for _ in range(length):
            place = _skip(raw, place, head & 15, depth + 1)
            if place > len(raw):
                raise IndexError
        return place
    raise IndexError
