"""Toolings as texts: read by the reader of tooling files, written from the same keys in JSON, and weighed before they cost anything."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from api.work.requests import ToolingSource
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings import setups
from rcsa_ident.io.settings.toolings import tooling_keys, tooling_text
from rcsa_ident.io.toml_text import keys_of_toml
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import expected_elements

#: Largest text of a tooling.
LARGEST = 256_000
#: Finite elements of a tooling; an ordinary one has 30 to 100.
MOST_ELEMENTS = 400


def tooling_of(text: str) -> Tooling:
    """Return the tooling of a TOML text; errors name key or line."""
    return setups.tooling_of(parsed(text), "", "tooling")


def tooling_from(source: ToolingSource, tip_known: bool = False) -> Tooling:
    """Return a tooling of a query, called as there; errors name key or line. Where its tip is known it may be a cutter alone."""
    keys = parsed(source.text) if source.keys is None else source.keys
    return setups.tooling_of({**keys, "name": source.name}, "", "tooling", tip_known)


def parsed(text: str) -> dict[str, Any]:
    """Return the keys of a TOML text."""
    return keys_of_toml(text, "tooling")


def keys_of(tooling: Tooling) -> dict[str, Any]:
    """Return the keys of a tooling, to the last digit as its file would have them."""
    return parsed(tooling_text(tooling_keys(tooling)))


def summary(text: str) -> dict[str, Any]:
    """Return what a list tells of a tooling; everything that the commands would refuse is refused."""
    tooling = tooling_of(text)
    cutter = tooling.cutter
    own = parsed(text).get("name", "")
    told = {"teeth": cutter.teeth, "diameter_mm": cutter.diameter * 1e3, "stickout_mm": tooling.assembly.stickout * 1e3}
    return told | {"shape": str(cutter.shape), "label": own[:200]}


def weigh(assembly: ToolAssembly, highest_hz: float) -> None:
    """Refuse a tooling whose finite elements at the highest frequency would be too many."""
    count = expected_elements(assembly, highest_hz)
    if not count <= MOST_ELEMENTS:
        found = f"about {count:.3g} finite elements up to {highest_hz:.0f} Hz"
        raise InputError("segments", found, f"at most {MOST_ELEMENTS}: fewer tapers, or nothing so thin for its length")


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[tuple[str, Any, Any]]:
    """Return field, old and new value of every key in which two toolings differ; None where one does not have it.

    Examples
    --------
    >>> differences({"cutter": {"teeth": 4}}, {"cutter": {"teeth": 3, "helix_deg": 30}})
    [('cutter.teeth', 4, 3), ('cutter.helix_deg', None, 30)]
    """
    before, after = dict(_leaves(old)), dict(_leaves(new))
    fields = dict.fromkeys([*before, *after])
    return [(field, before.get(field), after.get(field)) for field in fields if before.get(field) != after.get(field)]


def _leaves(value: Any, field: str = "") -> Iterator[tuple[str, Any]]:
    tables = isinstance(value, list) and any(isinstance(each, Mapping) for each in value)
    if isinstance(value, Mapping) or tables:
        for key, inner in value.items() if isinstance(value, Mapping) else enumerate(value):
            yield from _leaves(inner, f"{field}.{key}" if field else str(key))
    else:
        yield field, value
