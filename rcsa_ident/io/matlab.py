"""MATLAB recordings: plain numeric vectors named as the channels, of MAT-files version 5 (-v6, -v7) and 7.3.

Version 5 is read here: a few kilobytes of compressed zeros may stand for gigabytes, so a variable is unpacked no further
than its own header declares, and that is looked at before. Version 7.3 is HDF5 and goes through the same checks as HDF5.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError, positive
from rcsa_ident.io.channels import LARGEST_FILE, RATE, TIME_COLUMNS, Channel, check_declared, check_lengths, placed, the_only
from rcsa_ident.io.files import existing_file, read_bytes
from rcsa_ident.io.time_base import Irregular

COMPLETE = "a complete MAT-file, version 5 or 7.3"
#: Variables that hold the rate [Hz].
RATES = (RATE, "Fs", "fs")
MOST_VARIABLES = 10_000
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_CLASSES = {
    1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "double", 7: "single", 8: "int8", 9: "uint8", 10: "int16",
    11: "uint16", 12: "int32", 13: "uint32", 14: "int64", 15: "uint64", 16: "function_handle", 17: "opaque",
}  # fmt: skip
_NUMBERS = tuple(_CLASSES[i] for i in range(6, 16))
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_COMPLEX = 0x0800
#: Of a variable's own header, and around its samples.
_LARGEST_HEAD = 4096


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named vectors as they stand in the file, shape (n,) each.

    The rate comes from a vector ``time`` in seconds, else from a number ``sampling_rate_hz`` or ``Fs``, else from the campaign.

    Parameters
    ----------
    path : path
    names : sequence of str
        Channels that are wanted.
    default_rate : float or None [Hz]
        For a file that carries no rate.
    """
    where = str(path)
    with existing_file(path, "recording", 1 << 62).open("rb") as file:
        newer = file.read(_HEADER + 512 + len(_HDF5))[512 : 512 + len(_HDF5)] == _HDF5
    wished = [name for name in (*TIME_COLUMNS, *RATES) if name not in names]
    if newer:
        from rcsa_ident.io.hdf5 import read_vectors

        found = read_vectors(path, names, wished, (*_NUMBERS, "logical"))
    else:
        found = _read_version_5(read_bytes(path, "recording", LARGEST_FILE), names, wished, where)
    channels: list[Channel] = [found[name] for name in names]
    check_lengths(names, [values.size for values in channels], where)
    rates = {name: values for name, values in found.items() if name in wished and name in RATES}
    for name, values in rates.items():
        if values.size != 1:
            raise InputError(f"variable {name}", f"{values.size} numbers", "one number [Hz]", where)
    known = [positive(f"variable {name}", float(values[0]), "Hz") for name, values in rates.items()]
    if len(set(known)) > 1:
        raise InputError(RATE, f"different rates ({', '.join(rates)})", "one rate [Hz]", where)
    rate = known[0] if known else default_rate
    times = [name for name in TIME_COLUMNS if name in found and name in wished]
    if times:
        check_lengths([*times[:1], *names[:1]], [found[times[0]].size, channels[0].size], where)
        try:
            return placed(found[times[0]].astype(float), channels, rate)
        except Irregular as error:
            raise InputError(f"{times[0]}({error.row + 1})", error.found, error.allowed, where) from None
    if rate is None:
        raise InputError(RATE, "nothing", f"a vector 'time' [s], a number {' or '.join(RATES)}, or the campaign's rate [Hz]", where)
    return positive(RATE, rate, "Hz"), channels


@dataclass(frozen=True, slots=True)
class _Variable:
    """What the header of a variable says.

    Parameters
    ----------
    start, size : int
        Place and bytes of its element in the file.
    packed : bool
    length : int
        Bytes of the element when unpacked, its tag included.
    data : int
        Place of the samples' own tag in these.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    is_complex: bool
    start: int
    size: int
    packed: bool
    length: int
    data: int


def _read_version_5(raw: bytes, names: Sequence[str], wished: Sequence[str], where: str) -> dict[str, FloatArray]:
    order = {b"IM": "<", b"MI": ">"}.get(raw[126:128], "")
    if not order or len(raw) < _HEADER or struct.unpack_from(f"{order}H", raw, 124)[0] != 0x0100:
        raise InputError("recording", "a file without the header of version 5", f"{COMPLETE} (save with -v7 or -v7.3)", where)
    try:
        variables = _variables(raw, order, where)
        present = [v.name for v in variables]
        found = [*names, *(name for name in wished if name in present)]
        chosen = [variables[the_only(name, present, where)] for name in found]
        for variable in chosen:
            _check(variable, where)
        check_declared(sum(math.prod(v.shape) for v in chosen), 1, len(raw), where)
        return {name: _samples(raw, order, variable, where) for name, variable in zip(found, chosen, strict=True)}
    except (struct.error, zlib.error, UnicodeDecodeError) as error:
        raise InputError("recording", f"one that cannot be read ({error})", COMPLETE, where) from None


def _variables(raw: bytes, order: str, where: str) -> list[_Variable]:
    """Headers of all variables; of a packed one no more is unpacked than its header takes."""
    found: list[_Variable] = []
    place = _HEADER
    while place < len(raw):
        kind, size = struct.unpack_from(f"{order}II", raw, place)
        start = place + 8
        if start + size > len(raw):
            raise InputError("recording", f"a variable that is cut off at byte {place}", COMPLETE, where)
        if kind == _COMPRESSED:
            head = zlib.decompressobj().decompress(raw[start : start + size], _LARGEST_HEAD)
            found.append(_header(head, order, start, size, True, where))
        elif kind == _MATRIX:
            found.append(_header(raw[place : place + _LARGEST_HEAD], order, place, size + 8, False, where))
        else:
            raise InputError("recording", f"an element of type {kind}", "variables", where)
        place = start + size
        if len(found) > MOST_VARIABLES:
            raise InputError("recording", f"more than {MOST_VARIABLES} variables", f"at most {MOST_VARIABLES}", where)
    return found


def _tag(raw: bytes, order: str, place: int) -> tuple[int, int, int, int]:
    """Type, place and size of an element's content, and where the next element stands."""
    kind, size = struct.unpack_from(f"{order}II", raw, place)
    if kind >> 16:
        return kind & 0xFFFF, place + 4, kind >> 16, place + 8
    return kind, place + 8, size, place + 8 + size + -size % 8


def _header(head: bytes, order: str, start: int, size: int, packed: bool, where: str) -> _Variable:
    outer, length = struct.unpack_from(f"{order}II", head)
    if outer != _MATRIX:
        raise InputError("recording", f"an element of type {outer}", "variables", where)
    _, place, _, after = _tag(head, order, 8)
    flags = struct.unpack_from(f"{order}I", head, place)[0]
    kind = _CLASSES.get(flags & 0xFF, "unknown")
    if kind in ("opaque", "unknown"):  # laid out in another way
        return _Variable("", kind, (), False, start, size, packed, length + 8, 0)
    _, place, count, after = _tag(head, order, after)
    if not 8 <= count <= 128:
        raise InputError("recording", f"a variable of {count // 4} dimensions", "from 2 to 32", where)
    shape = struct.unpack_from(f"{order}{count // 4}i", head, place)
    _, place, count, after = _tag(head, order, after)
    if place + count > len(head):
        raise InputError("recording", "a variable whose name is not terminated", COMPLETE, where)
    name = head[place : place + count].rstrip(b"\0").decode("utf-8", "replace")
    return _Variable(name, kind, shape, bool(flags & _COMPLEX), start, size, packed, length + 8, after)


def _check(variable: _Variable, where: str) -> None:
    field = f"channel {variable.name}"
    if variable.kind not in _NUMBERS or variable.is_complex:
        raise InputError(field, f"values of class {'complex ' * variable.is_complex}{variable.kind}", "real numbers", where)
    if min(variable.shape) < 1 or math.prod(variable.shape) != max(variable.shape):
        raise InputError(field, f"shape {variable.shape}", "a vector with at least one sample", where)


def _samples(raw: bytes, order: str, variable: _Variable, where: str) -> FloatArray:
    """The samples of a variable whose declaration was checked; a vector is stored in the narrowest type that holds it."""
    field, count = f"channel {variable.name}", math.prod(variable.shape)
    if variable.length > variable.data + 8 * count + 64:
        raise InputError(field, f"{variable.length} bytes for {count} samples", COMPLETE, where)
    whole = raw[variable.start : variable.start + variable.size]
    if variable.packed:
        whole = zlib.decompressobj().decompress(whole, variable.length)
    kind, place, size, _ = _tag(whole, order, variable.data)
    if kind not in _TYPES:
        raise InputError(field, f"samples of type {kind}", "real numbers", where)
    layout = np.dtype(order + _TYPES[kind])
    if size != count * layout.itemsize or place + size > len(whole):
        raise InputError(field, f"{min(size, len(whole) - place)} bytes", f"{count} samples of {layout.itemsize} bytes", where)
    return np.frombuffer(whole, layout, count, place).astype(float)
