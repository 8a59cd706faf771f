"""Import of tool libraries of CAM programs."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import NamedTuple

from api.work.toolings import summary, tooling_of
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.tool_libraries import Assumptions, import_tools
from rcsa_ident.setup.tooling import BareCutter

#: Largest library [bytes], and most entries in one.
LARGEST_LIBRARY, MOST_TOOLS = 8_000_000, 2000
#: The service keeps whole toolings.
_ALONE = "a cutter without a holder: name one of the library's holders, or send [cutter] beside the modes or FRFs of its tip"


class Imported(NamedTuple):
    """An entry of a library: name, text, summary (JSON) and assumptions of its tooling, and the reason where there is none."""

    name: str
    text: str
    summary: str
    assumed: tuple[str, ...]
    reason: str


def imported(raw: bytes, assumptions: Assumptions, contact: str | None) -> list[Imported]:
    """Return the entries of a library.

    `raw`: JSON, or a .tools container
    `contact`: text of the tooling whose contact parameters all toolings get
    """
    if contact is not None:
        known = tooling_of(contact)
        if known.assembly.contact is None:
            raise InputError("contact", "a tooling without one", "a tooling with a table [contact]")
        assumptions = replace(assumptions, contact=known.assembly.contact, spread=known.spread)
    entries = import_tools(raw, "", assumptions, MOST_TOOLS)
    names = library_names([entry.name for entry in entries])
    found = []
    for name, entry in zip(names, entries, strict=True):
        told, reason = "", entry.reason or _ALONE * isinstance(entry.tooling, BareCutter)
        try:
            told = "" if reason else json.dumps(summary(entry.text))
        except InputError as error:
            reason = str(error)
        found.append(Imported(name, entry.text, told, entry.notes, reason))
    return found


def library_names(names: list[str]) -> list[str]:
    """Return unique names that the library of toolings accepts.

    Examples
    --------
    >>> library_names(["Ø12 R0 / long", "", "T 5", "T 5"])
    ['12 R0 - long', 'tool', 'T 5', 'T 5-2']
    """
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9 ._+()-]+", "-", name).strip(" ._+()-")[:56].rstrip() or "tool"
        count, free = 1, plain
        while free in taken:
            count += 1
            free = f"{plain}-{count}"
        taken.add(free)
        found.append(free)
    return found
