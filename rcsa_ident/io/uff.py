"""Universal files: functions at nodal degrees of freedom, dataset 58 in text and 58b in binary.

Own reader and writer, since lobes from tap tests and the export belong to every installation; a damaged file is refused with its line.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.channels import moment_of
from rcsa_ident.io.files import MEGABYTE, read_bytes, replacing

LARGEST_UFF = 512 * MEGABYTE
#: Function types, as dataset 58 numbers them.
KINDS = {
    0: "general", 1: "time response", 2: "auto spectrum", 3: "cross spectrum", 4: "frequency response function", 5: "transmissibility",
    6: "coherence", 9: "power spectral density", 12: "spectrum",
}  # fmt: skip
FRF = 4
#: What an axis holds, as dataset 58 numbers it.
DISPLACEMENT, REACTION_FORCE, VELOCITY, ACCELERATION, EXCITATION_FORCE, FREQUENCY = 8, 9, 11, 12, 13, 18
_DATA = {2: ("f4", 1), 4: ("f8", 1), 5: ("f4", 2), 6: ("f8", 2)}
_ASCII = str.maketrans({"µ": "u", "μ": "u", "²": "2"})
_END = b"-1"
_HEADER = 11
_BLOCK = 10_000


@dataclass(frozen=True, slots=True)
class UffAxis:
    """What an axis holds: its data type and the label of its unit, empty where the file names none."""

    kind: int = 0
    unit: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class UffFunction:
    """A function of one dataset 58.

    `kind`: one of `KINDS`
    `abscissa`, shape (n,)
    `values`, shape (n,): real or complex
    `response`, `reference`: (int, int); node and direction: 0 none, 1 to 3 the axes X to Z, negative against them, beyond 3 rotations
    `factors`: (float, float); the file's units of length and force in one SI unit (dataset 164)
    `where`: file and line
    `names`: what the file calls the function, the most particular first: response entity, label of the ordinate, title, place as ``3:-X``
    `step`: of an even abscissa, as the header rounds it to six digits; 0 where the abscissa stands in the file point by point
    `system`: whether the file states its system of units (dataset 164)
    `moment`: its date and time, None where the file has none
    """

    kind: int
    abscissa: FloatArray
    values: np.ndarray
    response: tuple[int, int] = (0, 0)
    reference: tuple[int, int] = (0, 0)
    abscissa_axis: UffAxis = UffAxis(FREQUENCY, "Hz")
    ordinate: UffAxis = UffAxis()
    denominator: UffAxis = UffAxis()
    title: str = ""
    factors: tuple[float, float] = (1.0, 1.0)
    where: str = ""
    names: tuple[str, ...] = ()
    step: float = 0.0
    system: bool = False
    moment: datetime | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "abscissa", frozen(self.abscissa))
        object.__setattr__(self, "values", frozen(self.values, complex if np.iscomplexobj(self.values) else float))
        if self.abscissa.ndim != 1 or self.values.shape != self.abscissa.shape or self.abscissa.size == 0:
            raise InputError("function", f"{self.abscissa.shape} and {self.values.shape}", "an abscissa and as many values", self.where)


def read_uff(path: str | Path) -> list[UffFunction]:
    """Return the functions of a universal file; datasets other than 58 and the units of 164 are passed over.

    Raises `InputError`, which names the file, the line, what was found and what is allowed.
    """
    lines = _Lines(read_bytes(path, "universal file", LARGEST_UFF), str(path))
    found: list[UffFunction] = []
    factors: tuple[float, float] | None = None
    while (line := lines.next()) is not None:
        if not line.strip():
            continue
        if line.strip() != _END:
            raise InputError("universal file", _shown(line), "-1 at the beginning of a dataset", lines.here)
        number = (lines.next() or b"").split()
        while number == [_END]:  # an end too many, as some write it
            number = (lines.next() or b"").split()
        if not number:
            raise InputError("universal file", "the end of the file", "the number of a dataset after -1", lines.here)
        if number[0].lower() in (b"58", b"58b") or number[:2] == [b"58", b"b"]:
            found.append(_function(lines, b"".join(number).lower().startswith(b"58b"), number, factors))
        elif number[0] == b"164":
            factors = _unit_factors(lines)
        else:
            lines.skip_dataset()
    if not found:
        raise InputError("universal file", "no dataset 58", "at least one function (dataset 58 or 58b)", str(path))
    return found


class _Lines:
    """Lines of a file whose datasets may turn binary."""

    def __init__(self, raw: bytes, where: str) -> None:
        self.raw, self.where, self.place, self.number = raw, where, 0, 0

    @property
    def here(self) -> str:
        return f"{self.where} line {max(self.number, 1)}"

    def next(self) -> bytes | None:
        if self.place >= len(self.raw):
            return None
        end = self.raw.find(b"\n", self.place)
        end = len(self.raw) if end < 0 else end
        line = self.raw[self.place : end]
        self.place, self.number = end + 1, self.number + 1
        return line.rstrip(b"\r")

    def text(self) -> str:
        """The next line of a dataset's header."""
        line = self.next()
        if line is None or line.strip() == _END:
            raise InputError(
                "dataset 58", "its end" if line else "the end of the file", f"{_HEADER} lines of header and the data", self.here
            )
        try:
            return line.decode("utf-8").ljust(80)
        except UnicodeDecodeError:
            return line.decode("cp1252", errors="replace").ljust(80)

    def skip_dataset(self) -> None:
        start = self.here
        while (line := self.next()) is not None:
            if line.strip() == _END:
                return
        raise InputError("dataset", "the end of the file", "-1 at the end of the dataset", start)


def _function(lines: _Lines, binary: bool, head: Sequence[bytes], system: tuple[float, float] | None) -> UffFunction:
    where = lines.here
    title, *more = (lines.text().strip() for _ in range(5))
    dof = lines.text()
    kind = _whole(dof[:5], "function type", lines)
    response = _whole(dof[41:51], "response node", lines), _whole(dof[51:55], "response direction", lines)
    reference = _whole(dof[66:76], "reference node", lines), _whole(dof[76:80], "reference direction", lines)
    form = lines.text()
    data_type, count, even = (_whole(form[10 * i : 10 * i + 10], name, lines) for i, name in enumerate(("data type", "points", "spacing")))
    if data_type not in _DATA:
        raise InputError("ordinate data type", data_type, "2 or 4 (real), 5 or 6 (complex)", lines.here)
    if not 1 <= count <= 100_000_000:
        raise InputError("number of points", count, "from 1 to 100000000", lines.here)
    if even not in (0, 1):
        raise InputError("abscissa spacing", even, "0 (uneven) or 1 (even)", lines.here)
    first, step = (_number(form[30 + 13 * i : 43 + 13 * i], name, lines) for i, name in enumerate(("abscissa start", "abscissa step")))
    labels = [lines.text() for _ in range(4)]
    axes = [UffAxis(_whole(line[:10], "axis type", lines), _unit(line[47:])) for line in labels]
    numbers = _binary(lines, head, data_type, count, bool(even)) if binary else _ascii(lines, data_type, count, bool(even))
    columns = numbers.reshape(count, -1)
    abscissa = first + step * np.arange(count) if even else columns[:, 0]
    ordinate = columns if even else columns[:, 1:]
    values = ordinate[:, 0] if _DATA[data_type][1] == 1 else ordinate[:, 0] + 1j * ordinate[:, 1]
    if not (np.all(np.isfinite(abscissa)) and np.all(np.isfinite(values))):
        raise InputError("dataset 58", "values that are not finite", "finite numbers", where)
    known = "" if title.upper() == "NONE" else title
    names = [dof[30:41].strip(), labels[1][25:46].strip(), known, _place(*response)]
    names = [name for name in dict.fromkeys(names) if name and name.upper() != "NONE"]
    factors, spacing = (1.0, 1.0) if system is None else system, step if even else 0.0
    return UffFunction(
        kind,
        abscissa,
        values,
        response,
        reference,
        axes[0],
        axes[1],
        axes[2],
        known,
        factors,
        where,
        tuple(names),
        spacing,
        system is not None,
        next((moment for line in more if (moment := moment_of(line, "%d-%b-%y %H:%M:%S")) is not None), None),
    )


def _place(node: int, direction: int) -> str:
    """Node and axis as ``3:-X``, empty without a node."""
    axis = ("", "X", "Y", "Z", "RX", "RY", "RZ")[min(abs(direction), 6)]
    return f"{node}:{'-' if direction < 0 else '+'}{axis}" if node and axis else f"{node}" * bool(node)


def _ascii(lines: _Lines, data_type: int, count: int, even: bool) -> FloatArray:
    wanted = count * (_DATA[data_type][1] + (0 if even else 1))
    rows: list[bytes] = []
    start = lines.number
    while (line := lines.next()) is not None and line.strip() != _END:
        rows.append(line)
    if line is None:
        raise InputError("dataset 58", "the end of the file", "-1 at the end of the dataset", lines.here)
    try:
        # in blocks: a word takes many times the memory of its number
        blocks = [_numbers(b" ".join(rows[i : i + _BLOCK])) for i in range(0, len(rows), _BLOCK)]
        numbers = np.concatenate([np.empty(0), *blocks])
    except ValueError:
        for i, row in enumerate(rows):
            try:
                _numbers(row)
            except ValueError:
                raise InputError("data", _shown(row), "numbers", f"{lines.where} line {start + i + 1}") from None
        raise
    if numbers.size != wanted:
        raise InputError(
            "data", f"{numbers.size} numbers", f"{wanted} for {count} points", f"{lines.where} lines {start + 1}-{lines.number - 1}"
        )
    return numbers


def _numbers(text: bytes) -> FloatArray:
    # fields of fixed width leave no blank in front of a minus; Fortran may write D for E
    words = re.sub(rb"(?<=[0-9.])-", b" -", text.translate(bytes.maketrans(b"Dd", b"EE"))).split()
    if any(b"_" in word for word in words):
        raise ValueError(text)
    return np.array(words, dtype=float)


def _binary(lines: _Lines, head: Sequence[bytes], data_type: int, count: int, even: bool) -> FloatArray:
    words = b" ".join(head).replace(b"58b", b"58 b").split()
    order, form, ascii_lines = (int(w) if w.isdigit() else -1 for w in [*words[2:5], b"", b"", b""][:3])
    if order not in (1, 2) or form != 2:
        raise InputError("58b", f"byte order {order}, format {form}", "byte order 1 or 2 and format 2 (IEEE 754)", lines.here)
    if ascii_lines != _HEADER:
        raise InputError("58b", f"{ascii_lines} lines of text", f"{_HEADER}", lines.here)
    sign = "<" if order == 1 else ">"
    kind, parts = _DATA[data_type]
    layouts = [np.dtype([(f"c{i}", sign + kind) for i in range(parts)])]
    if not even:
        # the abscissa may have a width of its own
        layouts = [np.dtype([("x", sign + width), *layouts[0].descr]) for width in dict.fromkeys((kind, "f4"))]
    # what stands in the header as number of bytes is wrong in too many files; the end of the dataset is not
    for layout in layouts:
        end = lines.place + count * layout.itemsize
        if re.match(rb"[\r\n ]*-1[ \r]*(\n|$)", lines.raw[end : end + 100]):
            table = np.frombuffer(lines.raw, layout, count, lines.place)
            lines.place = end
            lines.skip_dataset()
            return np.stack([table[name].astype(float) for name in layout.names or ()], axis=1).ravel()
    left = len(lines.raw) - lines.place
    raise InputError("58b", f"{left} bytes to the end of the file", f"{count} points of {layouts[0].itemsize} bytes, then -1", lines.here)


def _unit_factors(lines: _Lines) -> tuple[float, float]:
    """Units of length and force in one SI unit: a file's value over its factor is SI."""
    lines.text()
    try:
        length, force = (float(v) for v in lines.text().translate(str.maketrans("Dd", "EE")).split()[:2])
    except ValueError:
        raise InputError("dataset 164", "no factors", "factors of length and force", lines.here) from None
    if not (0.0 < length < 1e12 and 0.0 < force < 1e12):
        raise InputError("dataset 164", f"{length:g} and {force:g}", "factors above 0", lines.here)
    lines.skip_dataset()
    return length, force


def _whole(text: str, name: str, lines: _Lines) -> int:
    try:
        return int(text.strip() or "0")
    except ValueError:
        raise InputError(name, text.strip(), "a whole number", lines.here) from None


def _number(text: str, name: str, lines: _Lines) -> float:
    try:
        return float(text.strip().upper().replace("D", "E") or "0")
    except ValueError:
        raise InputError(name, text.strip(), "a number", lines.here) from None


def _unit(text: str) -> str:
    unit = text[:20].strip()
    return "" if unit.upper() == "NONE" else unit


def _shown(line: bytes) -> str:
    text = line[:60].decode("utf-8", errors="replace").strip()
    return text if text.isprintable() else "binary data"


def write_uff(path: str | Path, functions: Sequence[UffFunction], binary: bool = False) -> None:
    """Write functions in SI units as datasets 58 (double precision), all or nothing.

    Parameters
    ----------
    path : path
    functions : sequence of UffFunction
    binary : bool
        58b, little endian.

    Notes
    -----
    The header keeps six digits of an even abscissa's start and step; where these do not give the abscissa back to 1e-6 of its
    largest value it is written point by point, in binary exactly.
    """
    if not functions:
        raise InputError("functions", "none", "at least one", str(path))
    parts = [_dataset(b"   164\n", f"{1:10d}{'SI: m, N':<20s}{2:10d}\n{1.0:25.17E}{1.0:25.17E}{1.0:25.17E}\n{273.15:25.17E}\n".encode())]
    parts += [_written(function, binary) for function in functions]
    with replacing(path) as part:
        part.write_bytes(b"".join(parts))


def _dataset(number: bytes, content: bytes) -> bytes:
    return b"    -1\n" + number + content + b"    -1\n"


def _written(function: UffFunction, binary: bool) -> bytes:
    x, values = function.abscissa, function.values
    is_complex = np.iscomplexobj(values)
    first, step = (float(f"{v:.5E}") for v in (x[0], (x[-1] - x[0]) / max(x.size - 1, 1)))
    even = bool(np.max(np.abs(first + step * np.arange(x.size) - x)) <= 1e-6 * np.max(np.abs(x))) and step != 0.0
    columns = [values.real, values.imag] if is_complex else [values]
    table = np.stack(columns if even else [x, *columns], axis=1)
    (response, along), (reference, against) = function.response, function.reference
    head = [
        *(f"{text[:80]:<80s}" for text in (function.title or "NONE", "NONE", "NONE", "NONE", "NONE")),
        f"{function.kind:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10s}{response:10d}{along:4d} {'NONE':<10s}{reference:10d}{against:4d}",
        f"{6 if is_complex else 4:10d}{x.size:10d}{int(even):10d}" + "".join(f"{v:13.5E}" for v in (first * even, step * even, 0.0)),
        *(
            f"{axis.kind:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20s} {axis.unit[:20] or 'NONE':<20s}"
            for axis in (function.abscissa_axis, function.ordinate, function.denominator, UffAxis())
        ),
    ]
    text = "".join(f"{line}\n" for line in head).translate(_ASCII).encode("ascii", errors="replace")
    if binary:
        data = table.astype("<f8").tobytes()
        return _dataset(f"    58b{1:6d}{2:6d}{_HEADER:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}\n".encode(), text + data + b"\n")
    if even:
        flat = table.ravel()
        rows: Any = (flat[i : i + 4] for i in range(0, flat.size, 4))
        data = "".join("".join(f"{v:20.12E}" for v in row) + "\n" for row in rows).encode()
    else:
        per_line = 1 if is_complex else 2
        cells = [f"{row[0]:13.5E}" + "".join(f"{v:20.12E}" for v in row[1:]) for row in table]
        data = "".join("".join(cells[i : i + per_line]) + "\n" for i in range(0, len(cells), per_line)).encode()
    return _dataset(b"    58\n", text + data)
