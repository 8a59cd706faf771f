"""MODES.toml: a modal model of the tip, from a tap test or a catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import ModalModel, normal_modes
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table
from rcsa_ident.units import from_hz

_MODE = ("natural_frequency_hz", "damping_ratio", "modal_mass_kg", "stiffness_n_per_m")


def read_modes(path: str | Path) -> dict[Dof, ModalModel]:
    """Return the modes of each direction at ``tip.x`` or ``tip.y``; a direction without tables is rigid and missing here.

    Raises
    ------
    InputError
        Names the file, the key, what was found and what is allowed.
    """
    return modes_of(read_toml(path, "modes"), str(path))


def modes_of(data: Mapping[str, Any], where: str) -> dict[Dof, ModalModel]:
    """Return the modes of a table of keys as `read_modes` finds them in a file; `where` is the file, for the messages."""
    top = Table(data, where, known=("x", "y"))
    models = {axis: _model(top, axis) for axis in (Dof.X, Dof.Y) if axis in top}
    if not models:
        top.refuse("x", "nothing", "tables [[x]], [[y]] or both")
    return models


def _model(top: Table, axis: Dof) -> ModalModel:
    tables = top.tables(axis, _MODE)
    omega = from_hz(np.array([t.number("natural_frequency_hz", "Hz", above=0.0, most=1e6) for t in tables]))
    zeta = np.array([t.number("damping_ratio", "", above=0.0, most=0.999) for t in tables])
    mass = np.array([_mass(t, w) for t, w in zip(tables, omega, strict=True)])
    return normal_modes(omega, zeta, 1.0 / np.sqrt(mass)[:, None], (Coordinate("tip", axis),))


def _mass(table: Table, omega: float) -> float:
    """The modal mass as given, or k / omega_n^2."""
    given = table.one_of(_MODE[2:], "one of modal_mass_kg [kg] and stiffness_n_per_m [N/m]")
    if given == "modal_mass_kg":
        return table.number("modal_mass_kg", "kg", above=0.0)
    return table.number("stiffness_n_per_m", "N/m", above=0.0) / omega**2
