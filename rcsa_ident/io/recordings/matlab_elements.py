"""Elements of MAT-files version 5: what their headers declare, the structs and cells, the samples.

A few kilobytes of compressed zeros may stand for gigabytes, so a variable is unpacked no further than its own header declares, and that is
looked at before. Opaque variables (tables, objects of classes) are laid out in another way and passed over.
"""

from __future__ import annotations

import math
import re
import struct
import zlib
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.channels import check_declared, the_only
from rcsa_ident.io.files import Bytes

COMPLETE = "a complete MAT-file, version 5 or 7.3"
MOST_VARIABLES = 10_000
HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_CLASSES = {
    1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "double", 7: "single", 8: "int8", 9: "uint8", 10: "int16",
    11: "uint16", 12: "int32", 13: "uint32", 14: "int64", 15: "uint64", 16: "function_handle", 17: "opaque",
}  # fmt: skip
NUMBERS = tuple(_CLASSES[i] for i in range(6, 16))
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_COMPLEX = 0x0800
#: Of a variable's own header, and around its samples.
_LARGEST_HEAD = 4096
#: Classes of objects that hold a recording in a layout that nobody publishes, and what is wanted in their place.
_TABLES = ("table", "timetable")
EXPORTED = "real numbers; of a timetable TT write vectors: t = seconds(TT.Time - TT.Time(1)); x = TT.x"
#: Kinds that hold others.
NESTED = ("struct", "cell")
_DEEPEST = 16


@dataclass(frozen=True, slots=True)
class Variable:
    """What the header of a variable says.

    `start`, `size`: place and bytes of its element in the file
    `length`: bytes of the element when unpacked, its tag included
    `data`: place of the samples' own tag in these
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


def variables(raw: Bytes, order: str, where: str) -> list[Variable]:
    """Return the headers of all variables; of a packed one no more is unpacked than its header takes."""
    found: list[Variable] = []
    place = HEADER
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


def _header(head: bytes, order: str, start: int, size: int, packed: bool, where: str) -> Variable:
    outer, length = struct.unpack_from(f"{order}II", head)
    if outer != _MATRIX:
        raise InputError("recording", f"an element of type {outer}", "variables", where)
    _, place, _, after = _tag(head, order, 8)
    flags = struct.unpack_from(f"{order}I", head, place)[0]
    kind = _CLASSES.get(flags & 0xFF, "unknown")
    if kind in ("opaque", "unknown"):  # laid out in another way
        name, kind = _object(head, order, after) if kind == "opaque" else ("", kind)
        return Variable(name, kind, (), False, start, size, packed, length + 8, 0)
    _, place, count, after = _tag(head, order, after)
    if not 8 <= count <= 128:
        raise InputError("recording", f"a variable of {count // 4} dimensions", "from 2 to 32", where)
    shape = struct.unpack_from(f"{order}{count // 4}i", head, place)
    _, place, count, after = _tag(head, order, after)
    if place + count > len(head):
        raise InputError("recording", "a variable whose name is not terminated", COMPLETE, where)
    name = head[place : place + count].rstrip(b"\0").decode("utf-8", "replace")
    return Variable(name, kind, shape, bool(flags & _COMPLEX), start, size, packed, length + 8, after)


def _object(head: bytes, order: str, place: int) -> tuple[str, str]:
    """Name and class of an object; the name is empty where it is no table."""
    texts = []
    for _ in range(3):  # its name, the system of types, its class
        _, at, count, place = _tag(head, order, place)
        texts.append(head[at : at + count].rstrip(b"\0").decode("utf-8", "replace"))
    name, _, kind = texts
    return name if kind in _TABLES else "", kind


def wanted(kind: str) -> str:
    """Return what is allowed in the place of values of a class."""
    return EXPORTED if kind in _TABLES else "real numbers"


def check(variable: Variable, where: str) -> None:
    """Refuse what is no table of real numbers."""
    field = f"channel {variable.name}"
    if variable.kind not in NUMBERS or variable.is_complex:
        raise InputError(field, f"values of class {'complex ' * variable.is_complex}{variable.kind}", wanted(variable.kind), where)


def members(raw: Bytes, order: str, variable: Variable, where: str) -> tuple[bytes, list[Variable]]:
    """Return a struct or cell unpacked and the numbers in it, named by their paths as MATLAB writes them: ``a.b``, ``a(2).b``, ``c{3}``."""
    whole = unpacked(raw, variable, where)
    found: list[Variable] = []
    _walk(whole, order, replace(variable, start=0, size=len(whole), packed=False), found, 0, where)
    return whole, found


def _walk(whole: bytes, order: str, outer: Variable, found: list[Variable], depth: int, where: str) -> None:
    if depth > _DEEPEST or len(found) > MOST_VARIABLES:
        raise InputError(f"variable {outer.name}", "structs in structs without end", f"{_DEEPEST} levels, {MOST_VARIABLES} numbers", where)
    place, count, fields = outer.start + outer.data, math.prod(outer.shape), [""]
    if outer.kind == "struct":
        _, at, _, place = _tag(whole, order, place)
        width = struct.unpack_from(f"{order}i", whole, at)[0]
        _, at, size, place = _tag(whole, order, place)
        if width < 1 or at + size > len(whole):
            raise InputError(f"variable {outer.name}", f"names of fields of {width} bytes", COMPLETE, where)
        fields = [whole[i : i + width].split(b"\0")[0].decode("utf-8", "replace") for i in range(at, at + size, width)]
    # without fields a struct holds nothing, however large it says to be
    for i in range(count if fields else 0):
        for field in fields:
            if place + 8 > len(whole):
                raise InputError(f"variable {outer.name}", "a struct or cell that is cut off", COMPLETE, where)
            kind, size = struct.unpack_from(f"{order}II", whole, place)
            if kind != _MATRIX or place + 8 + size > len(whole):
                raise InputError(f"variable {outer.name}", f"an element of type {kind}, {size} bytes", "variables", where)
            name = f"{outer.name}{{{i + 1}}}" if outer.kind == "cell" else f"{outer.name}{f'({i + 1})' * (count > 1)}.{field}"
            if size:  # an empty one has no header either
                inner = replace(_header(whole[place : place + _LARGEST_HEAD], order, place, size + 8, False, where), name=name)
                if inner.kind in NESTED:
                    _walk(whole, order, inner, found, depth + 1, where)
                else:
                    found.append(inner)
            place += 8 + size


def unpacked(raw: Bytes, variable: Variable, where: str) -> bytes:
    """Return the element of a variable, no longer than it declares and no more than a file of its size holds."""
    check_declared(-(-variable.length // 8), 1, len(raw), where)
    whole = raw[variable.start : variable.start + variable.size]
    return _inflated(whole, variable, where) if variable.packed else whole


def _inflated(packed: bytes, variable: Variable, where: str) -> bytes:
    """A packed element as long as its header declares, whose checksum holds: one flipped bit may otherwise make any number."""
    unpacker = zlib.decompressobj()
    whole = unpacker.decompress(packed, variable.length)
    # the checksum stands behind the last byte, and is looked at only where one more is asked for
    further = unpacker.decompress(unpacker.unconsumed_tail, 1)
    if len(whole) != variable.length or further or not unpacker.eof or unpacker.unused_data:
        found = "more" if further or unpacker.unused_data else f"{len(whole)} bytes, cut off,"
        raise InputError(f"channel {variable.name}", f"{found} than the {variable.length} bytes that it declares", COMPLETE, where)
    return whole


def samples(raw: Bytes, order: str, variable: Variable, where: str) -> FloatArray:
    """Return the samples of a variable whose declaration was checked, column by column; stored in the narrowest type that holds them."""
    field, count = f"channel {variable.name}", math.prod(variable.shape)
    if variable.length > variable.data + 8 * count + 64:
        raise InputError(field, f"{variable.length} bytes for {count} samples", COMPLETE, where)
    whole = raw[variable.start : variable.start + variable.size]
    if variable.packed:
        whole = _inflated(whole, variable, where)
    kind, place, size, _ = _tag(whole, order, variable.data)
    if kind not in _TYPES:
        raise InputError(field, f"samples of type {kind}", "real numbers", where)
    layout = np.dtype(order + _TYPES[kind])
    if size != count * layout.itemsize or place + size > len(whole):
        raise InputError(field, f"{min(size, len(whole) - place)} bytes", f"{count} samples of {layout.itemsize} bytes", where)
    return np.frombuffer(whole, layout, count, place).astype(float)


class Version5:
    """Variables of a file of version 5, and the numbers in its structs and cells. `where`: the file, for the messages."""

    def __init__(self, raw: Bytes, where: str) -> None:
        self.order = {b"IM": "<", b"MI": ">"}.get(raw[126:128], "")
        if not self.order or len(raw) < HEADER or struct.unpack_from(f"{self.order}H", raw, 124)[0] != 0x0100:
            raise InputError("recording", "a file without the header of version 5", f"{COMPLETE} (save with -v7 or -v7.3)", where)
        self.raw, self.where, self.top = raw, where, [each for each in variables(raw, self.order, where) if each.name]
        self._inside: dict[str, tuple[bytes, list[Variable]]] = {}

    def names(self, beside: str) -> list[str]:
        """Return the names on the root, in the struct of `beside` those of its numbers, too."""
        return [*(each.name for each in self._members(beside)[1]), *(each.name for each in self.top)]

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of a table of real numbers; what is none is refused."""
        variable = self._found(name)[1]
        check(variable, self.where)
        return variable.shape

    def table(self, name: str) -> FloatArray:
        """Return its values, in its shape."""
        raw, variable = self._found(name)
        check_declared(math.prod(variable.shape), 1, len(self.raw), self.where)
        return samples(raw, self.order, variable, self.where).reshape(variable.shape, order="F")

    def _found(self, name: str) -> tuple[Bytes, Variable]:
        whole, inside = self._members(name)
        every = [(whole, each) for each in inside] + [(self.raw, each) for each in self.top]
        return every[the_only(name, self.names(name), self.where)]

    def _members(self, name: str) -> tuple[bytes, list[Variable]]:
        root = re.split(r"[.({]", name)[0]
        outer = [each for each in self.top if each.name == root and each.kind in NESTED and name != root]
        if len(outer) != 1:
            return b"", []
        if root not in self._inside:
            self._inside[root] = members(self.raw, self.order, outer[0], self.where)
        return self._inside[root]
