"""FRF.csv and LOBES.csv: curves that other programs draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.io.files import write_text
from rcsa_ident.io.text_columns import TextTable, read_table
from rcsa_ident.io.validated_table import listed
from rcsa_ident.machine.known_tip import measured_tip

AXES = ("X", "Y", "Z")
FREQUENCY = "frequency_hz"
LOBES = ("spindle_speed_rpm", "limit_depth_mm", "chatter_frequency_hz", "lobe")


class FrfCurves(NamedTuple):
    """Tip receptances per machine axis.

    `frequency` [Hz], shape (n,)
    `values`: dict of axis to complex array, shape (n,) [m/N]
    `bands`: dict of name to array, shape (n,); further columns
    """

    frequency: FloatArray
    values: dict[str, ComplexArray]
    bands: dict[str, FloatArray]


class LobeCurves(NamedTuple):
    """The lowest limit over spindle speed; NaN where the cut is stable up to the largest depth.

    `speed` [rev/min], shape (n,); `limit` [mm], shape (n,); `chatter_frequency` [Hz], shape (n,)
    `lobe`, shape (n,): whole numbers
    `extra`: dict of name to array, shape (n,); further columns
    """

    speed: FloatArray
    limit: FloatArray
    chatter_frequency: FloatArray
    lobe: FloatArray
    extra: dict[str, FloatArray]


def write_frf_csv(
    path: str | Path, frequency_hz: ArrayLike, values: Mapping[str, ArrayLike], bands: Mapping[str, ArrayLike] | None = None
) -> None:
    """Write tip receptances [m/N] of axes X, Y and Z, or some of them; numbers read back exactly.

    `frequency_hz`, shape (n,): rising
    `values`: mapping of axis to complex array, shape (n,)
    `bands`: mapping of column name to array, shape (n,)
    """
    where = str(path)
    if not values or any(axis not in AXES for axis in values):
        raise InputError("axes", ", ".join(values) or "none", "X, Y, Z or several of them", where)
    columns = {FREQUENCY: np.asarray(frequency_hz, dtype=float)}
    for axis in AXES:
        if axis in values:
            column = np.asarray(values[axis], dtype=complex)
            columns |= {f"{axis}_re": column.real, f"{axis}_im": column.imag}
    _check_rising(columns[FREQUENCY], where)
    _write(path, columns, bands or {}, finite=list(columns) + list(bands or {}))


def write_tip_csv(path: str | Path, tip: UncertainReceptance) -> None:
    """Write the receptances of a tip: the direct ones, with standard deviations and cross terms in further columns where there are some.

    ``XY`` is the motion in X under a force in Y.
    """
    deviation = tip.deviation()

    def spread(name: str, row: Coordinate, col: Coordinate) -> dict[str, ArrayLike]:
        real, imaginary = deviation.get((row, col), (None, None))
        return {} if real is None or imaginary is None else {f"{name}_re_std": real, f"{name}_im_std": imaginary}

    columns: dict[str, ArrayLike] = {}
    for row in tip.rows:
        columns |= spread(row.dof.upper(), row, row)
    for row, col in permutations(tip.rows, 2):
        cross = tip.between(str(row), str(col))
        if np.any(cross):
            name = f"{row.dof}{col.dof}".upper()
            columns |= {f"{name}_re": cross.real, f"{name}_im": cross.imag} | spread(name, row, col)
    curves = {c.dof.upper(): tip.between(str(c), str(c)) for c in tip.rows}
    # rad/s and back leaves a last digit that nobody asked for
    write_frf_csv(path, np.round(to_hz(tip.omega), 9), curves, columns)


def read_tip(path: str | Path) -> Receptance:
    """Return the tip's receptance of FRF.csv, cross terms included, taken for exact; a direction that is missing is rigid.

    Parameters
    ----------
    path : path

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> tip = ri.read_machine("RESULT.json").tip(ri.sample_tooling("S3-PG25-long"))
    >>> print(ri.read_tip(tip.save("FRF.csv")))
    tip.x, tip.y: 4167 frequencies, 100 to 4266 Hz
    """
    frequency, values, further = read_frf_csv(path)
    cross = {}
    for row, col in permutations(AXES, 2):
        parts = [further.get(f"{row}{col}_{part}") for part in ("re", "im")]
        if parts[0] is not None and parts[1] is not None:
            cross[Dof(row.lower()), Dof(col.lower())] = frequency, parts[0] + 1j * parts[1]
    try:
        return measured_tip({Dof(axis.lower()): (frequency, value) for axis, value in values.items()}, cross)
    except InputError as error:
        raise error.at(str(path)) from None


def read_frf_csv(path: str | Path) -> FrfCurves:
    """Return tip receptances and further columns of FRF.csv."""
    table = read_table(path, "FRF")
    axes = [axis for axis in AXES if f"{axis}_re" in table.header or f"{axis}_im" in table.header]
    parts = [f"{axis}_{part}" for axis in axes for part in ("re", "im")]
    columns = _columns(table, [FREQUENCY, *(parts or ["X_re"])])
    for name in columns:
        row = _first(~np.isfinite(columns[name]))
        if row is not None and name in (FREQUENCY, *parts):
            raise InputError(f"column {name}", "no finite number", "a finite number", table.at(row))
    row = _first(np.diff(columns[FREQUENCY], prepend=-1.0) <= 0.0)
    if row is not None or columns[FREQUENCY][0] < 0.0:
        row = row or 0
        raise InputError(f"column {FREQUENCY}", f"{columns[FREQUENCY][row]:g}", "increasing frequencies of 0 or more [Hz]", table.at(row))
    values = {}
    for axis in axes:
        column = np.empty(columns[FREQUENCY].size, dtype=complex)
        column.real, column.imag = columns.pop(f"{axis}_re"), columns.pop(f"{axis}_im")
        values[axis] = column
    return FrfCurves(columns.pop(FREQUENCY), values, columns)


def write_lobes_csv(
    path: str | Path,
    speed_rpm: ArrayLike,
    limit_mm: ArrayLike,
    chatter_hz: ArrayLike,
    lobe: ArrayLike,
    extra: Mapping[str, ArrayLike] | None = None,
    whole: Sequence[str] = (),
) -> None:
    """Write stability lobes; limit, chatter frequency and lobe are empty where the limit is NaN or infinite.

    `speed_rpm`, `limit_mm`, `chatter_hz`, `lobe`, shape (n,): a chatter frequency or lobe that is not known is NaN; so are stable places in
        `extra`
    `extra`: mapping of column name to array, shape (n,)
    `whole`: columns of `extra` that hold whole numbers
    """
    columns = {name: np.array(v, dtype=float) for name, v in zip(LOBES, (speed_rpm, limit_mm, chatter_hz, lobe), strict=True)}
    for name in LOBES[:3]:
        wrong = columns[name][columns[name] <= 0.0 if name == LOBES[0] else columns[name] < 0.0]
        if wrong.size:
            raise InputError(name, float(wrong[0]), "a number above 0" if name == LOBES[0] else "0 or more", str(path))
    if columns["limit_depth_mm"].shape == columns["chatter_frequency_hz"].shape == columns["lobe"].shape:
        stable = ~np.isfinite(columns["limit_depth_mm"])
        for name in LOBES[1:]:
            columns[name][stable] = np.nan
    lobes = columns["lobe"][np.isfinite(columns["lobe"])]
    if np.any(lobes != np.rint(lobes)):
        raise InputError("lobe", float(lobes[lobes != np.rint(lobes)][0]), "whole numbers", str(path))
    _write(path, columns, extra or {}, finite=[LOBES[0]], whole=["lobe", *whole])


def write_speed_csv(path: str | Path, speed_rpm: ArrayLike, columns: Mapping[str, ArrayLike]) -> None:
    """Write columns over spindle speed; a number that is not finite is an empty cell.

    `speed_rpm`, shape (n,): above 0
    `columns`: mapping of column name to array, shape (n,)
    """
    speed = np.asarray(speed_rpm, dtype=float)
    if not np.all(speed > 0.0):
        raise InputError(LOBES[0], float(speed[~(speed > 0.0)][0]), "a number above 0", str(path))
    _write(path, {LOBES[0]: speed}, columns, finite=[LOBES[0]])


def write_map_csv(path: str | Path, speed_rpm: FloatArray, depth_mm: FloatArray, growth: FloatArray) -> None:
    """Write a map of stable cuts, a row for each speed and depth: how fast a vibration grows per tooth, and 1 where none does.

    `speed_rpm`, shape (n,); `depth_mm`, shape (k,)
    `growth` [-], shape (n, k): logarithm of the growth per tooth period
    """
    n, k = growth.shape
    columns = {LOBES[0]: np.repeat(speed_rpm, k), "axial_depth_mm": np.tile(depth_mm, n)}
    further = {"growth_per_tooth": growth.ravel(), "stable": (growth.ravel() < 0.0).astype(float)}
    _write(path, columns, further, finite=list(columns), whole=["stable"])


def read_lobes_csv(path: str | Path) -> LobeCurves:
    """Return stability lobes and further columns of LOBES.csv; an empty cell is NaN."""
    table = read_table(path, "lobes")
    columns = _columns(table, LOBES)
    row = _first(~(columns[LOBES[0]] > 0.0))
    if row is not None:
        raise InputError(f"column {LOBES[0]}", f"{columns[LOBES[0]][row]:g}", "a speed above 0 [rev/min]", table.at(row))
    limit, chatter, lobe = (columns[name] for name in LOBES[1:])
    for name in LOBES[1:]:
        row = _first(~np.isnan(columns[name]) & (np.isnan(limit) | ~(columns[name] >= 0.0) | np.isinf(columns[name])))
        if row is not None:
            allowed = "a finite number of 0 or more, or empty; empty where limit_depth_mm is empty"
            raise InputError(f"column {name}", f"{columns[name][row]:g}", allowed, table.at(row))
    row = _first(~np.isnan(lobe) & (lobe != np.rint(lobe)))
    if row is not None:
        raise InputError("column lobe", f"{lobe[row]:g}", "a whole number, or empty", table.at(row))
    return LobeCurves(columns[LOBES[0]], limit, chatter, lobe, {k: v for k, v in columns.items() if k not in LOBES})


def _write(
    path: str | Path, columns: dict[str, FloatArray], further: Mapping[str, ArrayLike], finite: list[str], whole: Sequence[str] = ()
) -> None:
    """Write columns of one length; a number that is not finite is an empty cell, unless the column is in `finite`."""
    where = str(path)
    for name, values in further.items():
        # what begins like a formula is one where a spreadsheet opens the file
        if name in columns or not name.strip() or name.strip()[0] in "=+-@" or any(sign in name for sign in ',;\t\n\r"#'):
            raise InputError("column", name, "a name of its own without , ; tab, quotes or #, and without = + - @ in front", where)
        columns = columns | {name: np.asarray(values, dtype=float)}
    shapes = {name: values.shape for name, values in columns.items()}
    first = next(iter(shapes.values()))
    if len(set(shapes.values())) > 1 or len(first) != 1 or first[0] == 0:
        found = ", ".join(f"{name}: {shape}" for name, shape in shapes.items())
        raise InputError("columns", found, "1-D arrays of one length, at least one row", where)
    for name in finite:
        row = _first(~np.isfinite(columns[name]))
        if row is not None:
            raise InputError(f"column {name}", float(columns[name][row]), "finite numbers", f"{where} row {row + 1}")
    texts = []
    for name, values in columns.items():
        digits = str if name not in whole else _whole
        texts.append([digits(v) if v - v == 0.0 else "" for v in values.tolist()])
    rows = [",".join(columns), *(",".join(cells) for cells in zip(*texts, strict=True))]
    write_text(path, "\n".join(rows) + "\n")


def _whole(value: float) -> str:
    return str(int(value))


def _columns(table: TextTable, required: Sequence[str]) -> dict[str, FloatArray]:
    for name in required:
        if name not in table.header:
            raise InputError(f"column {name}", f"only {listed(table.header)}", f"columns {', '.join(required)}", table.where)
    names = [name for name in table.header if name]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"column {name}", "two columns of that name", "every name once", table.where)
    return dict(zip(names, table.columns(names), strict=True))


def _check_rising(frequency: FloatArray, where: str) -> None:
    row = _first(~(np.diff(frequency, prepend=-1.0) > 0.0)) if frequency.ndim == 1 else None
    if row is not None or (frequency.size and frequency.flat[0] < 0.0):
        raise InputError(FREQUENCY, float(frequency.flat[row or 0]), "increasing frequencies of 0 or more [Hz]", where)


def _first(wrong: np.ndarray) -> int | None:
    """Row of the first True, or None."""
    return int(np.argmax(wrong)) if wrong.any() else None
