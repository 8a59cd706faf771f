"""FORCES.csv: estimated forces over time, and the sensors that a result file remembers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.files import write_text
from rcsa_ident.io.settings.setups import sensor_of
from rcsa_ident.io.text_columns import read_table
from rcsa_ident.io.validated_table import Table, listed
from rcsa_ident.observer.force import ForceEstimate
from rcsa_ident.signals.recording import Sensor

TIME = "time_s"
AXES = ("X", "Y")


def write_forces_csv(path: str | Path, time: ArrayLike, force: Mapping[str, ArrayLike], deviation: Mapping[str, ArrayLike]) -> None:
    """Write forces [N] of axes X, Y or both over time [s], standard deviations in further columns; numbers read back exactly.

    `time`, shape (n,): rising
    `force`, `deviation`: mappings of axis to array, shape (n,)
    """
    where = str(path)
    names = [axis for axis in AXES if axis in force]
    if not names or set(force) - set(AXES) or set(deviation) - set(force):
        raise InputError("axes", ", ".join([*force, *deviation]) or "none", "X, Y or both, standard deviations of the same axes", where)
    columns = {TIME: np.asarray(time, dtype=float)}
    columns |= {f"F{axis.lower()}_n": np.asarray(force[axis], dtype=float) for axis in names}
    columns |= {f"F{axis.lower()}_std_n": np.asarray(deviation[axis], dtype=float) for axis in names if axis in deviation}
    count = columns[TIME].shape
    for name, values in columns.items():
        if values.shape != count or len(count) != 1 or count[0] == 0 or not np.all(np.isfinite(values)):
            raise InputError(f"column {name}", f"shape {values.shape}, or not finite", "finite numbers, as many as times", where)
    rows = [",".join(columns), *(",".join(map(str, row)) for row in zip(*(v.tolist() for v in columns.values()), strict=True))]
    write_text(path, "\n".join(rows) + "\n")


def read_forces_csv(path: str | Path) -> tuple[FloatArray, dict[str, FloatArray], dict[str, FloatArray]]:
    """Return time [s], forces [N] and standard deviations [N] of FORCES.csv, by axis."""
    table = read_table(path, "forces")
    axes = [axis for axis in AXES if f"F{axis.lower()}_n" in table.header]
    if TIME not in table.header or not axes:
        raise InputError("columns", listed(table.header), f"{TIME} and Fx_n, Fy_n or both", str(path))
    stds = [axis for axis in axes if f"F{axis.lower()}_std_n" in table.header]
    wanted = [TIME, *(f"F{axis.lower()}_n" for axis in axes), *(f"F{axis.lower()}_std_n" for axis in stds)]
    found = dict(zip(wanted, table.columns(wanted), strict=True))
    for name, values in found.items():
        bad = ~np.isfinite(values)
        if bad.any():
            raise InputError(f"column {name}", "no finite number", "a finite number", table.at(int(np.argmax(bad))))
    forces = {axis: found[f"F{axis.lower()}_n"] for axis in axes}
    return found[TIME], forces, {axis: found[f"F{axis.lower()}_std_n"] for axis in stds}


def write_forces(path: str | Path, estimate: ForceEstimate) -> None:
    """Write estimated forces with their standard deviations."""
    force, deviation = (dict(zip(map(str.upper, estimate.axes), v.T, strict=True)) for v in (estimate.force, estimate.standard_deviation))
    write_forces_csv(path, estimate.time, force, deviation)


def read_forces(path: str | Path) -> ForceEstimate:
    """Return the forces of FORCES.csv; standard deviations that it does not hold are zero.

    Parameters
    ----------
    path : path

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> found, campaign = ri.read_result("RESULT.json"), ri.read_campaign("sample_runs")
    >>> forces = ri.estimate_forces(found, campaign.toolings["S2-PG25"], campaign.cuts[15])
    >>> print(ri.read_forces(forces.save("FORCES.csv")))  # doctest: +ELLIPSIS
    X 6... N rms (± 3... N), Y 12... N rms (± 3... N) over 0.14 s
    """
    time, force, deviation = read_forces_csv(path)
    step = float(np.mean(np.diff(time))) if time.size > 1 else 0.0
    if step <= 0.0 or np.any(np.abs(np.diff(time) - step) > 1e-3 * step):
        raise InputError(f"column {TIME}", "steps that differ", "two equal steps or more that rise [s]", str(path))
    columns = [np.stack([each.get(axis, np.zeros_like(time)) for axis in force], axis=1) for each in (force, deviation)]
    axes = tuple(Dof(axis.lower()) for axis in force)
    return ForceEstimate(axes, step, frozen(columns[0]), frozen(columns[1]), start=float(time[0]))


def sensors_of_result(data: Mapping[str, Any], where: str) -> tuple[Sensor, ...]:
    """Return the sensors of the campaign that a result came from.

    `data`: the result as `read_result` returns it
    `where`: the file, for the messages
    """
    tables = Table(data, where).named_tables("sensors")
    sensors = tuple(sensor_of(name, table.data, where) for name, table in tables.items())
    if not sensors:
        raise InputError("sensors", "none", "at least one sensor", where)
    return sensors
