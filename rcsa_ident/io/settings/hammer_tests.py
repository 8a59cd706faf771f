"""Hammer tests of a campaign: the tables ``[[frfs]]``. What their files hold is read by `hammer`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.passivity import Correction
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.campaign import HammerTest
from rcsa_ident.setup.tooling import Tooling

HAMMER_TEST_KEYS = (
    "id",
    "tooling",
    "axis",
    "response",
    "force",
    "file",
    "record",
    "units",
    "standstill",
    "sensor_mass_g",
    "from_hz",
    "to_hz",
    "error_percent",
    "correction",
)
_POINTS = ("tip", "flange")


def hammer_test_of(table: Table, toolings: Mapping[str, Tooling], locate: Callable[[Table, str], Path]) -> HammerTest:
    """Return the hammer test of one table of ``[[frfs]]``.

    Parameters
    ----------
    table : Table
    toolings : mapping of str to Tooling
    locate : callable
        Given the table and its key ``file``, returns the file.

    Raises
    ------
    InputError
        Names the key, what was found and what is allowed.
    """
    name = table.text("id")
    tooling = table.text("tooling", choices=tuple(toolings), names_of="toolings")
    axis = Dof(table.text("axis", choices=("X", "Y")).lower())
    assembly = toolings[tooling].assembly
    longest = 1e3 * (assembly.stickout + assembly.holder_length)
    response, force = (_point(table, key, longest) for key in ("response", "force"))
    if response is None and force is None:
        allowed = "a point of the tool-holder, tip or mm from it, where the response is measured at the flange"
        table.refuse("force", "flange", allowed)
    low = table.number("from_hz", "Hz", 0.0, least=0.0, most=1e6)
    high = table.number("to_hz", "Hz", None, above=0.0, most=1e6)
    if high is not None and high <= low:
        table.refuse("to_hz", f"{high:g}", f"above from_hz, {low:g} [Hz]")
    return HammerTest(
        name,
        tooling,
        axis,
        response,
        force,
        locate(table, "file"),
        table.number("record", "", None, least=1, most=100_000, whole=True),
        table.text("units", None),
        table.flag("standstill", True),
        table.number("sensor_mass_g", "g", 0.0, least=0.0, most=1000.0) * 1e-3,
        (low, np.inf if high is None else high),
        table.number("error_percent", "%", 2.0, least=0.0, most=100.0) * 1e-2,
        Correction(table.text("correction", "auto", choices=tuple(Correction))),
    )


def _point(table: Table, key: str, longest: float) -> float | None:
    """Distance of a point from the tip [m]; None is the machine's side of the flange."""
    value = table.number_or(key, _POINTS, "the distance from the tip", "mm", 0.0, longest)
    if isinstance(value, str):
        return 0.0 if value == "tip" else None
    return value * 1e-3
