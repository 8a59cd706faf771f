"""Toolings as texts: read by the reader of tooling files, written from the same keys in JSON, and weighed before they cost anything."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

import numpy as np

from rcsa_ident.errors import InputError
from rcsa_ident.io import setups
from rcsa_ident.machining_setup import Tooling
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.model import ELEMENTS_PER_DIAMETER, ELEMENTS_PER_TAPER, ELEMENTS_PER_WAVELENGTH
from rcsa_ident.tool_holder.timoshenko import cowper, section

#: Largest text of a tooling.
LARGEST = 256_000
#: Finite elements of a tooling; an ordinary one has 30 to 100.
MOST_ELEMENTS = 400


def tooling_of(text: str) -> Tooling:
    """Return the tooling of a TOML text; errors name key or line."""
    return setups.tooling_of(parsed(text), "", "tooling")


def parsed(text: str) -> dict[str, Any]:
    """Return the keys of a TOML text."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError("tooling", "lists in lists without end", "TOML") from None
    except ValueError as error:
        raise InputError("tooling", f"a TOML error ({error})", "TOML") from None


def weigh(assembly: ToolAssembly, highest_hz: float) -> None:
    """Refuse a tooling whose finite elements at the highest frequency would be too many."""
    count = sum(_elements(segment, highest_hz) for segment in (*assembly.tool, *assembly.holder))
    if not count <= MOST_ELEMENTS:
        found = f"about {count:.3g} finite elements up to {highest_hz:.0f} Hz"
        raise InputError("segments", found, f"at most {MOST_ELEMENTS}: fewer tapers, or nothing so thin for its length")


def _elements(segment: BeamSegment, highest_hz: float) -> float:
    beam = section(segment.part(0.0, segment.length), cowper)
    wavelength = 2.0 * np.pi * float((beam.bending / beam.mass) ** 0.25) / np.sqrt(2.0 * np.pi * highest_hz)
    # a taper is as fine as its thinner end asks for
    density = max(ELEMENTS_PER_WAVELENGTH / wavelength, ELEMENTS_PER_DIAMETER / min(segment.diameter, segment.end))
    return max(segment.length * density, 2.0 if segment.end_diameter is None else ELEMENTS_PER_TAPER)


def toml_of(data: Mapping[str, Any]) -> str:
    """Return keys as TOML: a table for each table at the top, inline ones below.

    Examples
    --------
    >>> print(toml_of({"name": "S1", "cutter": {"teeth": 4, "pitch_deg": [80.0, 100.0]}}), end="")
    name = "S1"
    [cutter]
    teeth = 4
    pitch_deg = [80.0, 100.0]
    """
    tables = {key: value for key, value in data.items() if isinstance(value, Mapping)}
    lines = [f"{_key(key)} = {_inline(value)}" for key, value in data.items() if key not in tables]
    for key, table in tables.items():
        lines += [f"[{_key(key)}]", *(f"{_key(k)} = {_inline(v)}" for k, v in table.items())]
    return "\n".join(lines) + "\n"


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _quoted(key)


def _quoted(text: str) -> str:
    # JSON's escapes are TOML's, but for DEL
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_inline(v) for v in value) + "]"
    return _quoted(value) if isinstance(value, str) else json.dumps(value)
