"""``workpiece_side`` of RESULT.json: what accelerometers on table and workpiece showed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.io.results.parts import AXES, check_covariance, matrix_of
from rcsa_ident.io.validated_table import Table
from rcsa_ident.machine.workpiece_side import WorkpieceAxis, WorkpieceSide
from rcsa_ident.signals.recording import Role

#: What the rows of a covariance are logarithms of, each for all modes.
_LOGS = ("natural_frequency", "damping_ratio", "stiffness")


def workpiece_side_to_json(side: WorkpieceSide) -> dict[str, Any]:
    """Return what gives way on the workpiece's side, as it stands in the file."""
    return {axis.upper(): _axis_to_json(each) for axis, each in side.axes.items()}


def _axis_to_json(axis: WorkpieceAxis) -> dict[str, Any]:
    frequency_std, damping_std, stiffness_std = axis.deviations
    columns: Mapping[str, FloatArray] = {
        "natural_frequency_hz": to_hz(axis.omega_n),
        "natural_frequency_std_hz": to_hz(frequency_std),
        "damping_ratio": axis.zeta,
        "damping_ratio_std": damping_std,
        "stiffness_n_per_m": axis.stiffness,
        "stiffness_std_n_per_m": stiffness_std,
    }
    names = [f"log {name} of mode {n + 1}" for name in _LOGS for n in range(axis.omega_n.size)]
    return {
        "sensor": axis.sensor,
        "role": str(axis.role),
        "lines": axis.lines,
        "modes": [dict(zip(columns, row, strict=True)) for row in np.array(list(columns.values())).T.tolist()],
        "covariance": {"parameters": names, "matrix": axis.covariance.tolist()},
        "misfit": {"chi2_per_point": axis.chi2_per_point},
        "model_error": axis.model_error,
    }


def workpiece_side_of(top: Table) -> WorkpieceSide | None:
    """Return what a result file says, None where it says nothing.

    Raises `InputError`, which names the key, what was found and what is allowed.
    """
    if "workpiece_side" not in top:
        return None
    axes = top.named_tables("workpiece_side")
    for name in axes:
        if name not in AXES:
            top.refuse("workpiece_side", name, "X, Y or both")
    return WorkpieceSide({AXES[name]: _axis(each) for name, each in axes.items()})


def _axis(table: Table) -> WorkpieceAxis:
    modes = table.tables("modes") if table.data.get("modes") else []
    omega_n = from_hz(np.array([mode.number("natural_frequency_hz", "Hz", above=0.0) for mode in modes]))
    zeta = np.array([mode.number("damping_ratio", "", above=0.0, most=0.999) for mode in modes])
    stiffness = np.array([mode.number("stiffness_n_per_m", "N/m", above=0.0) for mode in modes])
    covariance = table.table("covariance")
    matrix = matrix_of(covariance, "matrix", 3 * len(modes))
    check_covariance(covariance, matrix)
    role = Role(table.text("role", choices=(Role.TABLE, Role.WORKPIECE)))
    lines = table.number("lines", least=0, whole=True)
    chi2 = table.table("misfit").number("chi2_per_point", least=0.0)
    return WorkpieceAxis(table.text("sensor"), role, omega_n, zeta, stiffness, matrix, lines, chi2, table.number("model_error", least=0.0))
