"""Hammer tests of a campaign: the tables ``[[frfs]]``, and the receptances that they name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.io.frf_files import parse_units, read_frfs
from rcsa_ident.io.validated_table import Table
from rcsa_ident.machining_setup import HammerTest, Tooling

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
    high = table.number("to_hz", "Hz", np.inf, above=0.0, most=1e6)
    if high <= low:
        table.refuse("to_hz", f"{high:g}", f"above from_hz, {low:g} [Hz]")
    units = table.text("units", None)
    if units is not None:
        parse_units(units, table.name("units"), table.where)
    return HammerTest(
        name,
        tooling,
        axis,
        response,
        force,
        locate(table, "file"),
        table.number("record", "", None, least=1, most=100_000, whole=True),
        units,
        table.flag("standstill", True),
        table.number("sensor_mass_g", "g", 0.0, least=0.0, most=1000.0) * 1e-3,
        (low, high),
        table.number("error_percent", "%", 2.0, least=0.0, most=100.0) * 1e-2,
    )


def _point(table: Table, key: str, longest: float) -> float | None:
    """Distance of a point from the tip [m]; None is the machine's side of the flange."""
    value = table.number_or(key, _POINTS, "the distance from the tip", "mm", 0.0, longest)
    if isinstance(value, str):
        return 0.0 if value == "tip" else None
    return value * 1e-3


def read_hammer_test(test: HammerTest) -> tuple[FloatArray, ComplexArray]:
    """Return the frequencies [Hz] and the receptance [m/N] of a test's file, shape (n,) both.

    Raises
    ------
    InputError
        Names the file, and its records where the test names none of several.
    """
    found = read_frfs(test.file, test.units)
    if test.record is not None:
        found = [each for each in found if each.record == test.record]
    elif len(found) > 1:
        axis = test.axis.upper()
        found = [each for each in found if (each.response, each.force) == (axis, axis)] or found
    if len(found) != 1:
        told = "no such record" if not found else f"{len(found)} FRFs"
        raise InputError("record", told, "the number of one FRF of the file", str(test.file))
    return found[0].frequency, found[0].values
