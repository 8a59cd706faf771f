"""Modal files of CutPro (.cmp): the modes of one point in one direction, as lines of a key and a number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.files import MEGABYTE, read_bytes
from rcsa_ident.io.settings.modes import ModesFile, modes_of, read_modes_file
from rcsa_ident.io.text_columns import decoded
from rcsa_ident.io.validated_table import listed

SUFFIX = ".cmp"
_MODE = ("WN", "ZETA", "MASS", "STIFK")
#: What the file says of its structure: one point, real modes.
_ONE = ("PNTS", "REALM")
_MOST_MODES = 200
#: Digits of a stiffness, a mass and a frequency that say the same twice.
_SAME = 0.01


def read_modes_files(texts: Sequence[str]) -> ModesFile:
    """Return the modes of MODES.toml, or of modal files, each named with its direction.

    `texts`: ``MODES.toml`` alone, or ``X=FILE.cmp`` and others
    Raises `InputError`, which names the file, the line, what was found and what is allowed.
    """
    found: dict[str, list[dict[str, float]]] = {}
    for text in texts:
        before, sign, after = text.partition("=")
        axis = before.lower() if sign and before.upper() in ("X", "Y", "Z") else ""
        path = Path(after if axis else text)
        if not axis and path.suffix.lower() != SUFFIX and len(texts) == 1:
            return read_modes_file(path)
        if not axis or path.suffix.lower() != SUFFIX:
            raise InputError("modes", text, f"MODES.toml alone, or modal files with their directions, as X=FILE{SUFFIX}")
        if axis in found:
            raise InputError("modes", f"{axis.upper()} twice", "one file for each direction", str(path))
        found[axis] = read_cmp(path)
    return modes_of(dict(sorted(found.items())), listed(list(texts)))


def read_cmp(path: str | Path) -> list[dict[str, float]]:
    """Return the modes of a modal file as the tables of MODES.toml have them.

    Raises `InputError`, which names the line; a mass, a stiffness, a frequency and a mode shape that contradict each other are refused.
    """
    where = str(path)
    told: dict[str, list[tuple[float, int]]] = {}
    for number, key, value in _lines(decoded(read_bytes(path, "modal file", MEGABYTE), "modal file", where), where):
        told.setdefault(key, []).append((value, number))

    def refuse(field: str, found: object, allowed: str, line: int | None = None) -> NoReturn:
        raise InputError(field, found, allowed, where if line is None else f"{where} line {line}")

    for key in ("MODES", *_ONE):
        if len(told.get(key, [])) != 1:
            refuse(key, f"{len(told.get(key, []))} lines", "one")
    for key in _ONE:
        value, line = told[key][0]
        if value != 1.0:
            refuse(key, f"{value:g}", "1: one point with real modes", line)
    count = int(told["MODES"][0][0])
    if not 1 <= count <= _MOST_MODES or told["MODES"][0][0] != count:
        refuse("MODES", f"{told['MODES'][0][0]:g}", f"a whole number from 1 to {_MOST_MODES}", told["MODES"][0][1])
    for key in (*_MODE, "MODSH"):
        if len(told.get(key, [])) != count and (key != "MODSH" or key in told):
            refuse(key, f"{len(told.get(key, []))} lines", f"{count}, as MODES says")
    modes = []
    for k in range(count):
        (hertz, line), (zeta, _), (mass, _), (stiffness, _) = (told[key][k] for key in _MODE)
        for key in _MODE:
            value, at = told[key][k]
            if not value > 0.0:
                refuse(key, f"{value:g}", "a number above 0", at)
        implied = mass * (2.0 * np.pi * hertz) ** 2
        if abs(implied / stiffness - 1.0) > _SAME:
            allowed = f"{implied:.6g} N/m, as MASS {mass:g} kg and WN {hertz:g} Hz have it: in which units are they?"
            refuse("STIFK", f"{stiffness:g}", allowed, told["STIFK"][k][1])
        if "MODSH" in told and abs(abs(told["MODSH"][k][0]) * np.sqrt(mass) - 1.0) > _SAME:
            shape, at = told["MODSH"][k]
            refuse("MODSH", f"{shape:g}", f"{1.0 / np.sqrt(mass):.6g}, as MASS {mass:g} kg has it at this point", at)
        modes.append({"natural_frequency_hz": hertz, "damping_ratio": zeta, "stiffness_n_per_m": stiffness})
    return modes


def _lines(text: str, where: str) -> Iterator[tuple[int, str, float]]:
    """Line number, key and number of each line."""
    known = ("MODES", *_ONE, *_MODE, "LOCNS", "MODSH")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.replace(",", ".").split()
        if not words:
            continue
        try:
            value = float(words[1]) if len(words) == 2 and "_" not in words[1] else np.nan
        except ValueError:
            value = np.nan
        if words[0].upper() not in known or not np.isfinite(value):
            raise InputError(
                "modal file", listed([line.strip()[:80]]), f"one of {', '.join(known)}, and a number", f"{where} line {number}"
            )
        yield number, words[0].upper(), value
