"""Entries of tool libraries as numbers: texts, units inside of expressions, presets of feeds and speeds."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

_MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "inch": 25.4, "inches": 25.4, '"': 25.4, "ft": 304.8}
_LIBRARY = {"millimeters": 1.0, "inches": 25.4}
_TEXT = re.compile(r"\s*(?P<whole>[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+))(?:\s*/\s*(?P<below>\d+))?\s*(?P<unit>[a-zA-Z°\"]*)\s*")
#: Expressions of Fusion 360 by the figures of a tool's geometry that they give.
_EXPRESSIONS = {
    "tool_diameter": "DC", "tool_numberOfFlutes": "NOF", "tool_fluteLength": "LCF", "tool_overallLength": "OAL", "tool_bodyLength": "LB",
    "tool_shaftDiameter": "SFDM", "tool_cornerRadius": "RE", "tool_taperAngle": "TA", "tool_tipDiameter": "tip-diameter",
    "tool_shoulderLength": "shoulder-length", "tool_shoulderDiameter": "shoulder-diameter",
}  # fmt: skip
_ALIKE = 1e-4
_MOST_PRESETS = 20
#: Tables in tables that anybody reads: segments of a holder.
_DEEPEST = 4


def plain_entry(entry: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Return an entry whose texts that are numbers are such, in the library's unit, and what was taken from expressions.

    ``"4"``, ``"12,7"``, ``"1/2 in"`` and ``"30 deg"`` are numbers; a text that is none stays, and is refused where a number is wanted. An
    expression is what its figure comes from: it counts where the figure is missing or says something else.

    >>> plain_entry({"unit": "millimeters", "geometry": {"DC": "1/2 in", "NOF": "4"}})[0]["geometry"]
    {'DC': 12.7, 'NOF': 4.0}
    """
    size = _LIBRARY.get(str(entry.get("unit", "")), 1.0)
    found = {key: _plain(value, size) if key in ("geometry", "holder", "shaft") or key.isupper() else value for key, value in entry.items()}
    if isinstance(entry.get("segments"), list):  # a holder by itself
        found |= {key: _plain(entry[key], size) for key in ("segments", "gaugeLength") if key in entry}
    notes = []
    geometry, expressions = found.get("geometry"), entry.get("expressions")
    if isinstance(geometry, dict) and isinstance(expressions, Mapping):
        for key, name in _EXPRESSIONS.items():
            value = _plain(expressions.get(key), size)
            if isinstance(value, float) and not _alike(geometry.get(name), value):
                before = f" in place of {geometry[name]:g}" if isinstance(geometry.get(name), int | float) else ""
                notes.append(f"{name} {value:g}{before} taken from the expression {key} = {str(expressions[key]).strip()[:40]}")
                geometry[name] = value
    return found, notes


def _plain(value: Any, size: float, depth: int = 0) -> Any:
    """A value with numbers in place of texts that are such, in the library's unit, which is `size` millimetres."""
    if depth > _DEEPEST:
        return value
    if isinstance(value, Mapping):
        # a holder may have a unit of its own
        size = _LIBRARY.get(str(value.get("unit", "")), size)
        return {key: each if key in ("unit", "description", "guid") else _plain(each, size, depth + 1) for key, each in value.items()}
    if isinstance(value, list):
        return [_plain(each, size, depth + 1) for each in value]
    match = _TEXT.fullmatch(value) if isinstance(value, str) and len(value) < 100 else None
    if match is None:
        return value
    number = float(match["whole"].replace(",", "."))
    if match["below"]:
        number = number / float(match["below"]) if float(match["below"]) else math.nan
    unit = match["unit"].lower()
    if unit in ("", "deg", "°") and math.isfinite(number):
        return number
    return number * _MILLIMETRES[unit] / size if unit in _MILLIMETRES and math.isfinite(number) else value


def _alike(told: Any, value: float) -> bool:
    return isinstance(told, int | float) and abs(told - value) <= _ALIKE * max(abs(told), abs(value))


def preset_notes(entry: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each preset of feeds and speeds: where an advice may start."""
    values = entry.get("start-values")
    presets = values.get("presets") if isinstance(values, Mapping) else None
    size = _LIBRARY.get(str(entry.get("unit", "")), 1.0)
    for preset in (presets if isinstance(presets, list) else [])[:_MOST_PRESETS]:
        if not isinstance(preset, Mapping):
            continue
        said = []
        for key, words, scale in (
            ("n", "{:.6g} rev/min", 1.0),
            ("f_z", "{:.4g} mm per tooth", size),
            ("v_f", "{:.6g} mm/min", size),
            ("stepdown", "depth {:.4g} mm", size),
            ("stepover", "width {:.4g} mm", size),
        ):
            value = _plain(preset.get(key), size)
            if isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < 1e9:
                said.append(words.format(value * scale))
        if said:
            name = " ".join(str(preset.get("name", "")).split())[:60] or "without a name"
            yield f"preset {name}, where an advice may start: {', '.join(said)}"
