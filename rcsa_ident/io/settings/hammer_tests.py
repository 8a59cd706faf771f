"""Hammer tests of a campaign: the tables ``[[frfs]]``. What their files hold is read by `hammer`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.passivity import Correction
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.campaign import HammerTest
from rcsa_ident.setup.fields import HAMMER_TEST, keys_of, told_in_si
from rcsa_ident.setup.tooling import Tooling

HAMMER_TEST_KEYS = keys_of(HAMMER_TEST)
_OWN = {each.key: each for each in HAMMER_TEST}
#: Whose noun needs no other key.
_PLAIN = tuple(_OWN[key] for key in ("record", "units", "standstill", "sensor_mass_g", "error_percent"))


def hammer_test_of(table: Table, toolings: Mapping[str, Tooling], locate: Callable[[Table, str], Path]) -> HammerTest:
    """Return the hammer test of one table of ``[[frfs]]``.

    `locate`: given the table and its key ``file``, returns the file
    Raises `InputError`, which names the key, what was found and what is allowed.
    """
    name = table.text("id")
    tooling = table.text("tooling", choices=tuple(toolings), names_of="toolings")
    axis = Dof(table.field(_OWN["axis"]).lower())
    assembly = toolings[tooling].assembly
    longest = 1e3 * (assembly.stickout + assembly.holder_length)
    response, force = (_point(table, key, longest) for key in ("response", "force"))
    if response is None and force is None:
        allowed = "a point of the tool-holder, tip or mm from it, where the response is measured at the flange"
        table.refuse("force", "flange", allowed)
    low, high = table.field(_OWN["from_hz"]), table.field(_OWN["to_hz"])
    if high is not None and high <= low:
        table.refuse("to_hz", f"{high:g}", f"above from_hz, {low:g} [Hz]")
    return HammerTest(
        name,
        tooling,
        axis,
        response,
        force,
        locate(table, "file"),
        band=(low, np.inf if high is None else high),
        **told_in_si(_PLAIN, table.fields(_PLAIN)),
        correction=Correction(table.field(_OWN["correction"])),
    )


def _point(table: Table, key: str, longest: float) -> float | None:
    """Distance of a point from the tip [m]; None is the machine's side of the flange."""
    value = table.field(_OWN[key].up_to(longest))
    if isinstance(value, str):
        return 0.0 if value == "tip" else None
    return value * 1e-3
