"""MODES.toml: a modal model of the tip, from a tap test or a catalogue, and how well it is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import TANGENTIAL, TIP_DAMPING, TIP_FREQUENCY
from rcsa_ident.base.units import from_hz, from_rpm, to_hz
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.io.files import write_text
from rcsa_ident.io.toml_text import read_toml, toml_of
from rcsa_ident.io.validated_table import Table
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.stability.tip_modes import DIRECTIONS, TipModes

#: Direction cosines of modes along an axis; those of `_OBLIQUE` tell their own.
_ALONG = dict(zip("xyz", np.eye(3), strict=True))
_OBLIQUE = "modes"
_COSINES = "direction_cosines"
#: How far the length of written direction cosines may be from 1: three of them with two decimals.
_ROUNDED = 0.01
_TOP = (*_ALONG, _OBLIQUE, "coefficients", "softening_sd_percent_per_1000_rpm")
#: Values of a mode, each with the key of its standard deviation and its unit; of the last two a mode has one.
_VALUES = {
    "natural_frequency_hz": ("natural_frequency_sd_hz", "Hz"),
    "damping_ratio": ("damping_ratio_sd", ""),
    "modal_mass_kg": ("modal_mass_sd_kg", "kg"),
    "stiffness_n_per_m": ("stiffness_sd_n_per_m", "N/m"),
}
_WEIGHTS = ("modal_mass_kg", "stiffness_n_per_m")
_MODE = (*_VALUES, *(spread for spread, _ in _VALUES.values()))
_COEFFICIENTS = ("tangential_mpa", "tangential_sd_mpa", "radial_mpa", "radial_sd_mpa")
#: A standard deviation may be so many times the value.
_WIDEST = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class ModesFile:
    """What stands in MODES.toml.

    `modes`: in X and Y, and in Z where one of them moves along it; X before Y before Z before those of any direction
    `spreads`, shape (3, m): standard deviations of natural frequencies, damping ratios and stiffnesses (or masses) over the values; NaN
        where the file tells none
    `coefficient_spreads`: (float, float); standard deviations of K_tc and K_rc over the values, NaN where the file tells none
    `softening` [s/rad]: as of `UncertainTip`
    `missing`: the first standard deviation that the file does not tell; empty where it tells all
    """

    modes: TipModes
    spreads: FloatArray
    coefficients: CuttingCoefficients | None
    coefficient_spreads: tuple[float, float]
    softening: float
    missing: str
    where: str

    def uncertain_tip(self, coefficients: CuttingCoefficients | None = None) -> tuple[UncertainTip, CuttingCoefficients]:
        """Return modes and coefficients with their standard deviations, which labelled cuts go on from.

        `coefficients`: with their own spreads, where the file has none
        Raises `InputError` if a standard deviation is missing, or nothing tells the coefficients.
        """
        top = Table({}, self.where)
        if self.missing:
            top.refuse(
                self.missing, "nothing", "the value's standard deviation, 0 where it is taken for exact: labels move what is not known"
            )
        spreads = self.coefficient_spreads
        if self.coefficients is not None:
            coefficients = self.coefficients
        elif coefficients is not None:
            spreads = coefficients.tangential_spread, float(np.hypot(coefficients.tangential_spread, coefficients.ratio_spread))
        else:
            top.refuse("coefficients", "nothing", f"a table [coefficients] with {', '.join(_COEFFICIENTS)}")
        return UncertainTip.independent(self.modes, self.spreads, spreads, self.softening), coefficients


def read_modes_file(path: str | Path) -> ModesFile:
    """Return the modes with what is told of their spread and of the coefficients.

    Raises `InputError`, which names the file, the key, what was found and what is allowed.
    """
    return modes_of(read_toml(path, "modes"), str(path))


def write_modes(path: str | Path, tip: TipModes) -> None:
    """Write the modes of a tip to MODES.toml, each with its direction cosines and its stiffness.

    Raises `InputError` if a mode does not move along a line, or modes are not all: a residual compliance, slopes or a shape along the edge
        stand beside.
    """
    # of a normal mode the residue is psi psi^T / (2 i omega_d)
    square = 2j * tip.pole.imag[:, None, None] * tip.outputs.T[:, :, None] * tip.inputs[:, None, :]
    values, vectors = np.linalg.eigh(square.real)
    inverse_mass, along = values[:, -1], vectors[:, :, -1]
    other = square - inverse_mass[:, None, None] * along[:, :, None] * along[:, None, :]
    lines = np.all(inverse_mass > 0.0) and np.linalg.norm(other) <= 1e-6 * np.linalg.norm(square)
    if not lines or np.any(tip.constant) or tip.heights is not None or tip.directions > 3:
        allowed = "modes that move along lines, and nothing beside them: MODES.toml holds no others"
        raise InputError(
            "tip modes", "complex or overdamped modes, a residual compliance, slopes or a shape along the edge", allowed, str(path)
        )
    omega = np.abs(tip.pole)
    rows = [
        {
            "natural_frequency_hz": float(to_hz(omega[k])),
            "damping_ratio": float(-tip.pole[k].real / omega[k]),
            "stiffness_n_per_m": float(omega[k] ** 2 / inverse_mass[k]),
            _COSINES: [*along[k].tolist(), 0.0][:3],
        }
        for k in range(omega.size)
    ]
    write_text(path, toml_of({_OBLIQUE: rows}, digits=12))


def modes_of(data: Mapping[str, Any], where: str) -> ModesFile:
    """Return what a table of keys holds as `read_modes_file` finds it in a file; `where` is the file, for the messages."""
    top = Table(data, where, known=_TOP)
    missing = list[str]()
    tables = [(table, cosines) for axis, cosines in _ALONG.items() if axis in top for table in top.tables(axis, _MODE)]
    if _OBLIQUE in top:
        tables += [(table, _cosines(table)) for table in top.tables(_OBLIQUE, (*_MODE, _COSINES))]
    if not tables:
        top.refuse("x", "nothing", f"tables [[x]], [[y]], [[z]], [[{_OBLIQUE}]] or several of them")
    with top.naming({}):
        modes, spreads = _tip_modes(tables, missing)
    coefficients, shares = (
        _coefficients(top.table("coefficients", _COEFFICIENTS), missing) if "coefficients" in top else (None, (np.nan, np.nan))
    )
    softening = 1e-5 * top.number("softening_sd_percent_per_1000_rpm", "%", 0.0, least=0.0, most=20.0) / from_rpm(1.0)
    return ModesFile(modes, spreads, coefficients, shares, softening, next(iter(missing), ""), where)


def _cosines(table: Table) -> FloatArray:
    found = np.array(table.numbers(_COSINES, 3))
    length = float(np.linalg.norm(found))
    if abs(length - 1.0) > _ROUNDED:
        table.refuse(_COSINES, f"a length of {length:.4g}", "cosines of the angles to X, Y and Z: their squares add up to 1")
    return found / length


def _tip_modes(modes: Sequence[tuple[Table, FloatArray]], missing: list[str]) -> tuple[TipModes, FloatArray]:
    tables, cosines = [table for table, _ in modes], np.array([along for _, along in modes])
    omega = from_hz(np.array([t.quantity("natural_frequency_hz", TIP_FREQUENCY) for t in tables]))
    zeta = np.array([t.number("damping_ratio", "", least=TIP_DAMPING.possible[0], most=0.999) for t in tables])
    weights = [t.one_of(_WEIGHTS, "one of modal_mass_kg [kg] and stiffness_n_per_m [N/m]") for t in tables]
    weight = np.array([t.number(key, _VALUES[key][1], above=0.0) for t, key in zip(tables, weights, strict=True)])
    mass = np.where([key == "modal_mass_kg" for key in weights], weight, weight / omega**2)
    spreads = [
        [_spread(t, key, float(mean), missing) for key, mean in zip((*list(_VALUES)[:2], own), values, strict=True)]
        for t, own, values in zip(tables, weights, zip(to_hz(omega), zeta, weight, strict=True), strict=True)
    ]
    moved = DIRECTIONS[: 3 if np.any(cosines[:, 2]) else 2]
    found = TipModes.joined([normal_modes(omega, zeta, (cosines / np.sqrt(mass)[:, None])[:, : len(moved)], moved).pole_residue()])
    _ = found.remarks  # impossible ones are refused
    return found, np.array(spreads).T


def _spread(table: Table, key: str, mean: float, missing: list[str]) -> float:
    """Standard deviation over the value, NaN where none is told."""
    for other in _WEIGHTS:
        if key in _WEIGHTS and other != key and _VALUES[other][0] in table:
            table.refuse(_VALUES[other][0], "the standard deviation of a value that is not given", _VALUES[key][0])
    return _over_value(table, *_VALUES[key], mean, missing)


def _over_value(table: Table, name: str, unit: str, mean: float, missing: list[str]) -> float:
    """A standard deviation over its value, NaN where none is told."""
    found = table.number(name, unit, None, least=0.0)
    if found is None:
        missing.append(table.name(name))
        return float("nan")
    if found > _WIDEST * mean:
        table.refuse(name, f"{found:g}", f"at most {_WIDEST:g} times the value, {_WIDEST * mean:g} [{unit}]")
    return float(found / mean)


def _coefficients(table: Table, missing: list[str]) -> tuple[CuttingCoefficients, tuple[float, float]]:
    means = {"tangential": table.quantity("tangential_mpa", TANGENTIAL), "radial": table.number("radial_mpa", "MPa", above=0.0)}
    spreads = [_over_value(table, f"{name}_sd_mpa", "MPa", mean, missing) for name, mean in means.items()]
    with table.naming({"tangential coefficient": "coefficients.tangential_mpa", "radial_ratio": "coefficients.radial_mpa"}):
        found = CuttingCoefficients(1e6 * means["tangential"], means["radial"] / means["tangential"])
    return found, (spreads[0], spreads[1])
