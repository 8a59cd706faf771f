"""What the lines above an FRF's numbers say: which column holds what, in which unit; its grammar stands in docs/formats/frf.md."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NoReturn

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.told_units import UNITS_ALLOWED, FrfUnit, frf_unit, hertz_in, is_untold, radians_in, told_unit

#: What a column may hold, and the words that say so, in small letters.
ROLES = {
    "frequency": ("frequency", "frequencies", "freq", "f", "frequenz", "omega", "ω", "w", "kreisfrequenz"),
    "real": ("real", "re", "realteil"),
    "imaginary": ("imaginary", "imag", "im", "img", "imaginärteil", "imaginaerteil"),
    "magnitude": ("magnitude", "mag", "amplitude", "ampl", "amp", "modulus", "abs", "absolute", "betrag"),
    "phase": ("phase", "angle", "arg", "argument", "phasenwinkel"),
    "coherence": ("coherence", "coh", "kohärenz", "kohaerenz"),
    "line number": ("line", "lines", "index", "idx", "no", "nr", "number", "bin", "point", "row", "zeile", "#"),
}
_ROLE_OF = {word: role for role, words in ROLES.items() for word in words}
#: Frequencies that are angular by their name alone.
_ANGULAR = ("omega", "ω", "w", "kreisfrequenz", "angular", "circular")
#: Words of a column's name that say nothing further.
_FILLERS = (
    *("part", "anteil", "frf", "of", "in", "the", "spectral", "linear", "lin", "angular", "circular"),
    *("transfer", "function", "dynamic", "mechanical"),
)
#: A function's own name: H, H1, G12, H11.
_FUNCTION = re.compile(r"[hg]?\d{0,3}")
#: Quantities: how many times the motion is differentiated, and whether the force stands above it.
QUANTITIES = {
    "receptance": (0, False), "compliance": (0, False), "flexibility": (0, False), "displacement/force": (0, False),
    "mobility": (1, False), "velocity/force": (1, False),
    "accelerance": (2, False), "inertance": (2, False), "acceleration/force": (2, False),
    "dynamic stiffness": (0, True), "force/displacement": (0, True),
    "impedance": (1, True), "force/velocity": (1, True),
    "apparent mass": (2, True), "dynamic mass": (2, True), "force/acceleration": (2, True),
}  # fmt: skip
_AXIS = re.compile(r"[xyz]{1,2}")
_QUANTITY = re.compile(
    r"\b(" + "|".join(sorted((q.replace(" ", r"\s+") for q in QUANTITIES), key=len, reverse=True)) + r")\b", re.IGNORECASE
)
#: e^{-iωt}, exp(-j*2*pi*f*t) and their like.
_TIME = re.compile(r"\b(?:exp\s*[({\[]|e\s*\^\s*[({\[]?)\s*(?P<sign>[+\-−]?)(?P<rest>[\w\s*·πω]*)", re.IGNORECASE)
_CONVENTION = re.compile(r"\bconvention\b|\btime dependence\b|\bconjugat", re.IGNORECASE)
_UNIT_LINE = re.compile(
    r"^\W*(?:(?P<of>frequency|abscissa|x[- ]axis|x)\s+)?(?:units?|einheit(?:en)?)\s*[:=]\s*(?P<units>.+)$", re.IGNORECASE
)
#: Words of columns that unnamed ones cannot have; the frequency and the parts of a complex number are what is assumed.
_OTHERS = re.compile(r"\b(magnitude|amplitude|modulus|phase|dB|rad/s|kHz|deg(rees?)?)\b", re.IGNORECASE)
_DECIBEL = re.compile(
    r"^\s*dB\b\s*(?:(?:re|ref|rel)\b\.?\s*(?:to\s+)?[:=]?)?\s*"
    r"(?:(?P<number>\d+(?:\.\d+)?(?:e[+-]?\d+)?)(?=\s|$|\*))?\s*\*?\s*(?P<unit>.*)$",
    re.IGNORECASE,
)
_GROUP = re.compile(r"\s*(?:\[[^\[\]]*\]|\((?:[^()]|\([^()]*\))*\)|\{[^{}]*\}|<[^<>]*>)")
#: What a function is of: the H(f) of Re(H(f)).
_ARGUMENT = re.compile(r"^[hgHG]?(?:\w{0,2}\d{0,3})(?:\(\s*[ij]?\s*[fωw]\s*\))?$")
_BARS = re.compile(r"\|\s*[HGhg]\w{0,2}\s*(?:\(\w*\)\s*)?\|")
_DELIMITERS = ("\t", ";", ",", "  ")


@dataclass(frozen=True, slots=True)
class Column:
    """A column of an FRF's table.

    `role`: one of `ROLES`
    `told`: as the header says it
    `unit`: of a part of the FRF; None where the column says none
    `factor`: Hertz or radians per unit; None where the column says none
    `decibel`: what 0 dB is, in the unit; None of linear numbers
    `axis`: X of a direct FRF, XY of one with the force in Y; empty where the name says none
    `sign`: -1 of a column that is called minus something
    `quantities`: that the name says
    """

    role: str
    told: str = ""
    unit: FrfUnit | None = None
    factor: float | None = None
    decibel: float | None = None
    axis: str = ""
    sign: float = 1.0
    quantities: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Header:
    """What the header says.

    `named`: whether the header names them; else they are frequency, real and imaginary part
    `unit`: of the file as a whole
    `quantities`: that the lines above the names say
    `hertz`: per unit of the frequency, where a line above the names says it
    `conjugated`: time runs as e^{-iωt}
    """

    columns: tuple[Column, ...]
    named: bool = True
    unit: FrfUnit | None = None
    quantities: tuple[str, ...] = field(default=())
    hertz: float | None = None
    conjugated: bool = False


def read_header(lines: Sequence[str], tail: str, width: int, where: str) -> Header:
    """Return what the lines above the numbers say.

    `lines`: in front of the numbers
    `tail`: words behind the first line of numbers, as MetalMAX writes them
    `width`: number of columns
    `where`: the file, for the messages
    Raises `InputError`, which names what is said and not understood.
    """
    above = [line for line in lines if re.search(r"\w", line)]
    columns = _of_tail(tail, width, where) if tail.strip() else None
    if columns is None:
        columns, above = _named_columns(above, width, where)
    if columns is None:
        if width != 3:
            _refuse(f"{width} columns without names", where)
        others = next((line for line in above if _OTHERS.search(line)), None)
        if others is not None:
            _refuse(others.strip(), where)
        columns, named = tuple(Column(role) for role in ("frequency", "real", "imaginary")), False
    else:
        named = True
    return _with_statements(Header(columns, named), above, where)


def _refuse(found: str, where: str) -> NoReturn:
    allowed = (
        "a line with a name for each column: frequency, then real and imaginary, or magnitude and phase, each with its unit in brackets"
    )
    raise InputError("FRF header", listed([found[:120]]), allowed, where)


def _named_columns(above: list[str], width: int, where: str) -> tuple[tuple[Column, ...] | None, list[str]]:
    """The columns that one of the last lines names, perhaps with a line of units below it, and the lines that are left."""
    for i in range(len(above) - 1, max(len(above) - 3, -1), -1):
        roles = sum(_has_role(word) for word in _words(above[i]))
        if roles < (1 if len(_delimited(above[i], width)) == width else 2) or _UNIT_LINE.match(above[i]):
            continue
        cells, below = _cells(above[i], width), above[i + 1 :]
        if not any(_role(word) == "frequency" for word in _words(above[i])):
            _refuse(above[i].strip(), where)
        if len(cells) != width:
            _refuse(f"{len(cells)} names for {width} columns: {above[i].strip()}", where)
        columns = [_column(cell, where) for cell in cells]
        if below:
            units = _cells(below[0], width)
            if len(units) != width or not all(
                is_untold(u.strip("()[]# ")) or _unit_of(c.role, u.strip("[]# ")) for c, u in zip(columns, units, strict=False)
            ):
                _refuse(below[0].strip(), where)
            columns = [_with_unit(column, unit.strip("[]# "), where) for column, unit in zip(columns, units, strict=True)]
        return tuple(columns), above[:i]
    return None, above


def _of_tail(tail: str, width: int, where: str) -> tuple[Column, ...]:
    """Columns as MetalMAX names them behind the first line: ``Freq Hz Real m/N Imag Real``; its last word is the real part's unit."""
    words = tail.split()
    if len(words) > 2 and words[-2:] == ["Imag", "Real"]:
        words.pop()
    columns = [_column(cell, where) for cell in _scanned(" ".join(words))]
    if len(columns) > width:
        _refuse(tail.strip(), where)
    rest = ("frequency", "real", "imaginary")[len(columns) : width]
    return (*columns, *(Column(role) for role in rest))


def _words(line: str) -> list[str]:
    outside = _GROUP.sub(lambda group: f" {_inside(group)} " if _has_role(_inside(group)) else " ", _BARS.sub("magnitude", line))
    return re.findall(r"[^\W\d_]+|#", outside)


def _inside(group: re.Match[str]) -> str:
    return group[0].strip()[1:-1].strip()


def _has_role(word: str) -> bool:
    return bool(_role(word))


def _role(word: str) -> str:
    """What a word says that a column holds; empty where it says nothing of it."""
    return _ROLE_OF.get(word.strip(".,:").lower(), "")


def _cells(line: str, width: int) -> list[str]:
    """A line of names or units, cut into columns: by the delimiter that gives as many as there are, else at the words that begin one."""
    line = re.sub(r"^\s*(?:%|//|!|#(?=\s*\w{2}))+", "", line.replace('"', "")).strip()
    line = _BARS.sub("magnitude", line)
    words = line.split()
    return _delimited(line, width) or (words if len(words) == width else _scanned(line))


def _delimited(line: str, width: int) -> list[str]:
    """The cells by a delimiter that gives as many as there are columns; none without one."""
    for delimiter in _DELIMITERS:
        cells = re.split(r"\s{2,}", line.strip()) if delimiter == "  " else line.rstrip(delimiter).split(delimiter)
        if len(cells) == width:
            return [cell.strip() for cell in cells]
    return []


def _scanned(line: str) -> list[str]:
    """Cells of a line whose delimiter does not tell them: each begins with the word that says what it holds, or in front of it."""
    cells: list[list[str]] = [[]]
    for token in re.findall(r"[\[({<](?:[^\[\](){}<>]|\([^()]*\))*[\])}>]|[^\s,;\[({<]+", line):
        last = cells[-1]
        begun = any(_has_role(word) for word in last)
        begins = _has_role(token) and token.lower() != "angle"
        if begun and (begins or (token[0].isalpha() and token.lower() not in (*_FILLERS, "angle") and told_unit(token) is None)):
            cells.append([])
        cells[-1].append(token)
    return [" ".join(cell) for cell in cells]


def _column(cell: str, where: str) -> Column:
    """A column by its name, with or without unit: ``Re(H) [m/N]``, ``Magnitude (dB re 1 m/N)``, ``freq_hz``, ``|H|``, ``f/Hz``."""
    name, units = cell, list[str]()
    while found := _GROUP.search(name):
        inside = _inside(found)
        before = re.search(r"[^\W\d_]+$", name[: found.start()])
        if _has_role(inside) and not any(_has_role(word) for word in re.findall(r"[^\W\d_]+", _GROUP.sub(" ", name))):
            name = f"{name[: found.start()]} {inside} {name[found.end() :]}"
            continue
        if not (before and _has_role(before[0]) and _ARGUMENT.match(inside) and _unit_of(_role(before[0]), inside) is None):
            units.append(inside)
        name = name[: found.start()] + " " + name[found.end() :]
    sign = -1.0 if re.match(r"\s*[-−]\s*\w", name) else 1.0
    quantities = tuple(" ".join(each.lower().split()) for each in _QUANTITY.findall(name))
    name = _QUANTITY.sub(" ", name)
    roles, axis, angular = list[str](), "", False
    for token in name.replace("_", " ").lstrip(" -−").split():
        word = token.strip(".,:").lower()
        angular = angular or word in _ANGULAR
        if _has_role(word):
            roles.append(_role(word))
        elif _AXIS.fullmatch(word):
            axis = word.upper()
        elif word in _FILLERS or _FUNCTION.fullmatch(word):
            continue
        elif "/" in word and _has_role(word.partition("/")[0]):
            roles.append(_role(word.partition("/")[0]))
            angular = angular or word.partition("/")[0] in _ANGULAR
            units.append(token.partition("/")[2])
        elif told_unit(token) is not None or word == "db":
            units.append(token)
        else:
            _refuse(cell, where)
    if len(roles) == 2 and roles[1] == "frequency":
        roles = roles[1:] if roles[0] == "line number" else roles
    # a quantity and nothing else is its magnitude
    roles = list(dict.fromkeys(roles)) or ["magnitude"] * bool(quantities)
    units = [unit for unit in units if not is_untold(unit)]
    if len(roles) != 1 or len(units) > 1:
        _refuse(cell, where)
    column = Column(roles[0], cell.strip(), axis=axis, sign=sign, quantities=quantities)
    if units:
        return _with_unit(column, units[0], where)
    return replace(column, factor=hertz_in("rad/s")) if angular and column.role == "frequency" else column


def _unit_of(role: str, text: str) -> tuple[FrfUnit | None, float | None, float | None] | None:
    """Unit, factor and decibel of a column with this unit, None where the unit is none of it."""
    if role in ("frequency", "phase"):
        factor = hertz_in(text) if role == "frequency" else radians_in(text)
        return None if factor is None else (None, factor, None)
    if role in ("coherence", "line number"):
        return None, None, None
    decibel = _DECIBEL.match(text) if role == "magnitude" else None
    if decibel:
        reference, unit = float(decibel["number"] or 1.0), decibel["unit"]
        found = frf_unit(unit)
        return None if (unit and found is None) or reference <= 0.0 else (found, None, reference)
    found = frf_unit(text)
    return None if found is None else (found, None, None)


def _with_unit(column: Column, text: str, where: str) -> Column:
    if is_untold(text.strip("()")):
        return column
    found = _unit_of(column.role, text)
    if found is None:
        allowed = {"frequency": "Hz, kHz, rad/s or rpm", "phase": "deg or rad"}.get(column.role, UNITS_ALLOWED)
        raise InputError(f"unit of column {listed([column.told])}", listed([text]), allowed, where)
    return replace(column, unit=found[0], factor=found[1], decibel=found[2])


def _with_statements(header: Header, above: Sequence[str], where: str) -> Header:
    """The header with what the free lines say of the file as a whole: unit, quantity, sign of time."""
    for line in above:
        units = _UNIT_LINE.match(line)
        if units:
            for text in re.split(r"[,;]", units["units"]):
                header = _with_file_unit(header, text.strip(" .\"'[]"), (units["of"] or "").lower(), where)
        elif header.unit is None:
            texts = [_inside(group) for group in _GROUP.finditer(line)] + re.split(r"[\s,;]+", line)
            header = replace(header, unit=next((unit for text in texts if "/" in text and (unit := frf_unit(text))), None))
        header = replace(header, quantities=(*header.quantities, *(" ".join(q.lower().split()) for q in _QUANTITY.findall(line))))
        time = _TIME.search(line)
        if time and re.search(r"[ij].*t\s*$|^\s*[ij]", time["rest"], re.IGNORECASE):
            header = replace(header, conjugated=time["sign"] in ("-", "−"))
        elif _CONVENTION.search(line):
            raise InputError("FRF header", listed([line.strip()[:120]]), "the sign of time as e^(+iωt) or e^(-iωt)", where)
    return header


def _with_file_unit(header: Header, text: str, of: str, where: str) -> Header:
    unit, hertz = frf_unit(text), hertz_in(text)
    if hertz is not None:
        return replace(header, hertz=hertz)
    if unit is not None and not of:
        return replace(header, unit=unit)
    if is_untold(text) or (radians_in(text) is not None and not of):
        return header
    raise InputError("unit in the header", listed([text[:60]]), "Hz, kHz or rad/s" if of else UNITS_ALLOWED, where)
