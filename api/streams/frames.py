"""Binary frames of a force stream in both directions, little endian.

In: uint64 index of the first sample, uint32 samples, uint32 channels, float32[samples, channels].
Out: uint64 index of the first sample, uint32 rows, uint32 axes, float32[rows, axes] newtons; with an envelope a row is a bucket,
float32[rows, axes, 2]: lowest and highest force of so many samples.
As JSON both are {"first": index, "samples": [[...], ...]}, with all digits.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError

HEADER = struct.Struct("<QII")
#: Most samples of a frame, and the highest index: the largest integer that doubles, and so JSON readers, count exactly.
MOST_SAMPLES, MOST_INDEX = 65_536, 2**53


class TooLarge(InputError):
    """A frame or message that is too large."""


class WrongKind(InputError):
    """A message of the wrong kind for its session."""


def packed(first: int, values: FloatArray) -> bytes:
    """Return a frame of samples, forces or buckets, shape (n, c) or (n, a, 2)."""
    return HEADER.pack(first, values.shape[0], values.shape[1]) + np.ascontiguousarray(values, dtype="<f4").tobytes()


def unpacked(raw: bytes, buckets: bool = False) -> tuple[int, FloatArray]:
    """Return first index and values of a frame that the service has sent, shape (n, a) or (n, a, 2)."""
    first, rows, axes = HEADER.unpack_from(raw)
    shape = (rows, axes, 2) if buckets else (rows, axes)
    return first, np.frombuffer(raw, "<f4", offset=HEADER.size).reshape(shape).astype(float)


def samples_of(raw: bytes, channels: int) -> tuple[int, FloatArray]:
    """Return first index and samples, float32, shape (n, channels), of a frame that a client has sent.

    Raises `InputError` if header and length do not agree, with each other or the session, or a sample is not finite.
    Raises `TooLarge` of more than 65 536 samples.
    """
    if len(raw) < HEADER.size:
        raise InputError("frame", f"{len(raw)} bytes", f"a header of {HEADER.size} bytes and samples")
    first, count, width = HEADER.unpack_from(raw)
    _size(first, count, width, channels)
    if len(raw) != HEADER.size + 4 * count * width:
        found = f"{len(raw)} bytes for {count} samples of {width} channels"
        raise InputError("frame", found, f"{HEADER.size + 4 * count * width} bytes")
    return first, _finite(np.frombuffer(raw, "<f4", offset=HEADER.size).reshape(count, width))


def samples_of_text(text: str, channels: int) -> tuple[int, FloatArray]:
    """Return the same for a frame in JSON."""
    data = object_of(text)
    first, rows = data.get("first"), data.get("samples")
    if not isinstance(first, int) or isinstance(first, bool) or not 0 <= first <= MOST_INDEX:
        raise InputError("first", first, f"a whole number from 0 to {MOST_INDEX}")
    if not isinstance(rows, list) or not all(isinstance(row, list) for row in rows):
        raise InputError("samples", rows, "a list of lists of numbers")
    _size(first, len(rows), max((len(row) for row in rows), default=channels), channels)
    if not all(len(row) == channels and all(type(v) in (int, float) for v in row) for row in rows):
        raise InputError("samples", "rows of unequal length, or entries that are not numbers", f"{channels} numbers in every row")
    try:
        values = np.array(rows, dtype=float).reshape(len(rows), channels)
    except OverflowError:
        raise InputError("samples", "a number out of range", "finite numbers") from None
    return first, _finite(values)


def object_of(text: str) -> dict[str, Any]:
    """Return the JSON object of a text; raises `InputError` for any other text."""

    def no_number(word: str) -> None:
        raise InputError("message", word, "finite numbers")

    try:
        data = json.loads(text, parse_constant=no_number)
    except RecursionError:
        raise InputError("message", "lists nested too deeply", "a JSON object") from None
    except ValueError:
        raise InputError("message", "no JSON", "a JSON object") from None
    if not isinstance(data, dict):
        raise InputError("message", "JSON that is no object", "a JSON object")
    return data


def _size(first: int, count: int, width: int, channels: int) -> None:
    if width != channels:
        raise InputError("channels", width, f"{channels}, as declared in the first message")
    if count == 0:
        raise InputError("samples", 0, "one or more")
    if count > MOST_SAMPLES:
        raise TooLarge("samples", count, f"at most {MOST_SAMPLES} in a frame")
    if first > MOST_INDEX:
        raise InputError("first", first, f"at most {MOST_INDEX}")


def _finite(values: FloatArray) -> FloatArray:
    # larger values, which no sensor has, would overflow when squared
    if not np.all(np.abs(values) < 1e30):
        raise InputError("samples", "a value that is not finite", "finite numbers; lost samples are omitted, and the index continues")
    return values
