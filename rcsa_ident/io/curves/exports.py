"""Curves and modes for other programs: universal files, CSV, JSON, HDF5."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import ModalModel, directions
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.curves.tips import AXES, write_frf_csv
from rcsa_ident.io.files import replacing, write_text
from rcsa_ident.io.uff import DISPLACEMENT, EXCITATION_FORCE, FRF, UffAxis, UffFunction, write_uff
from rcsa_ident.signals.tap import TapFrf

#: Directions as universal files number them; a slope dy/dz is a rotation about -X.
_DIRECTIONS = {Dof.X: 1, Dof.Y: 2, Dof.Z: 3, Dof.SLOPE_X: 5, Dof.SLOPE_Y: -4}
#: Points as universal files number them.
_NODES = {"tip": 1, "spindle": 2, "flange": 2, "fixture": 3}
_KIND = {False: "t", True: "r"}
_LOAD = {False: "F", True: "M"}
#: Files that a receptance of hammer hits is written to.
TAP_SUFFIXES = (".csv", ".uff", ".unv", ".frf")


def write_tap(path: str | Path, found: TapFrf) -> None:
    """Write a receptance of hammer hits, as the path's suffix says: FRF.csv, UFF 58, or text columns as CutPro's."""
    path = Path(path)
    suffix, frequency = path.suffix.lower(), to_hz(found.omega)
    if suffix not in TAP_SUFFIXES:
        raise InputError("path", suffix or "no suffix", ", ".join(TAP_SUFFIXES), str(path))
    if suffix == ".csv":
        write_frf_csv(path, frequency, {found.axis: found.receptance})
    elif suffix == ".frf":
        rows = (f"{f:.9g} {h.real:.9e} {h.imag:.9e}" for f, h in zip(frequency, found.receptance, strict=True))
        write_text(path, "\n".join(["Frequency [Hz] Real [m/N] Imaginary [m/N]", *rows]) + "\n")
    else:
        tip = Coordinate("tip", Dof(found.axis.lower()))
        write_receptances_uff(path, {found.axis: Receptance(found.omega, found.receptance[:, None, None], (tip,), (tip,))}, "hammer hits")


def write_receptances_uff(path: str | Path, receptances: Mapping[str, Receptance], title: str, binary: bool = False) -> None:
    """Write every entry of receptances as a frequency response function; node 1 is the tip, node 2 the flange.

    `receptances`: mapping of axis (X or Y, or both as XY) to Receptance
    `title`: written into each header
    `binary`: dataset 58b
    """
    functions = [
        UffFunction(
            FRF,
            to_hz(receptance.omega),
            receptance.values[:, i, j],
            _place(row),
            _place(col),
            ordinate=UffAxis(DISPLACEMENT, "rad" if row.dof.is_slope else "m"),
            denominator=UffAxis(EXCITATION_FORCE, "N m" if col.dof.is_slope else "N"),
            title=f"{title}: {row} / {col}",
        )
        for receptance in receptances.values()
        for i, row in enumerate(receptance.rows)
        for j, col in enumerate(receptance.cols)
    ]
    write_uff(path, functions, binary)


def _place(coordinate: Coordinate) -> tuple[int, int]:
    return _NODES.get(coordinate.point, 9), _DIRECTIONS[coordinate.dof]


def named_entries(receptances: Mapping[str, Receptance]) -> dict[str, ComplexArray]:
    """Return every entry by its name: ``X`` for motion per force, ``X_tM``, ``X_rF``, ``X_rM`` for those with a slope or a moment.

    Where both planes are one receptance, ``XY`` is the motion in X under a force in Y.
    """
    found: dict[str, ComplexArray] = {}
    for receptance in receptances.values():
        for i, row in enumerate(receptance.rows):
            for j, col in enumerate(receptance.cols):
                axes = "".join(dict.fromkeys((row.dof.plane.upper(), col.dof.plane.upper())))
                kind = _KIND[row.dof.is_slope] + _LOAD[col.dof.is_slope]
                found[axes if kind == "tF" else f"{axes}_{kind}"] = receptance.values[:, i, j]
    return found


def write_receptances_csv(path: str | Path, receptances: Mapping[str, Receptance], further: Mapping[str, FloatArray] | None = None) -> None:
    """Write FRF.csv with all entries: motion per force first, as every reader of FRF.csv wants it.

    `receptances`: mapping of axis (X or Y, or both as XY) to Receptance
    `further`: mapping of column name to array, shape (n,); columns behind them
    """
    entries = named_entries(receptances)
    frequency = to_hz(next(iter(receptances.values())).omega)
    direct = [axis for axis in AXES if axis in entries]
    rest = {name: values for name, values in entries.items() if name not in direct}
    columns = {
        f"{name}_{part}": getattr(values, which) for name, values in rest.items() for part, which in (("re", "real"), ("im", "imag"))
    }
    write_frf_csv(path, frequency, {axis: entries[axis] for axis in direct}, {**columns, **(further or {})})


def write_receptances_json(path: str | Path, receptances: Mapping[str, Receptance], title: str) -> None:
    """Write every entry as lists of real and imaginary parts. `receptances`: mapping of axis (X or Y, or both as XY) to Receptance."""
    frequency = to_hz(next(iter(receptances.values())).omega)
    entries = {name: {"re": v.real.tolist(), "im": v.imag.tolist()} for name, v in named_entries(receptances).items()}
    data = {"title": title, "units": _UNITS, "frequency_hz": frequency.tolist(), "receptances": entries}
    write_text(path, json.dumps(data, ensure_ascii=False, allow_nan=False) + "\n")


_UNITS = {"X, Y": "m/N", "tM": "m/(N m)", "rF": "rad/N", "rM": "rad/(N m)"}


def write_receptances_hdf5(path: str | Path, receptances: Mapping[str, Receptance], title: str) -> None:
    """Write every entry as a complex dataset beside ``frequency_hz``.

    `receptances`: mapping of axis (X or Y, or both as XY) to Receptance
    """
    import h5py

    with replacing(path) as part, h5py.File(part, "w") as file:
        file.attrs["title"] = title
        file.attrs["units"] = json.dumps(_UNITS)
        file["frequency_hz"] = to_hz(next(iter(receptances.values())).omega)
        for name, values in named_entries(receptances).items():
            file[name] = values


def mode_records(axes: Mapping[str, ModalModel]) -> list[dict[str, Any]]:
    """Return the modes of each axis with their shapes at all coordinates; those of both planes together with their directions."""
    return [
        {
            "axis": axis,
            "natural_frequency_hz": to_hz(float(omega)),
            "damping_ratio": float(zeta),
            **({} if direction is None else {"direction_deg": float(np.degrees(direction))}),
            **{
                f"phi_{'' if direction is None else c.dof.plane + '_'}{_KIND[c.dof.is_slope]}_{part}": float(getattr(value, which))
                for c, value in zip(model.coordinates, shape, strict=True)
                for part, which in (("re", "real"), ("im", "imag"))
            },
        }
        for axis, model in axes.items()
        for omega, zeta, shape, direction in zip(model.omega_n, model.zeta, model.phi, _directions(model), strict=True)
    ]


def _directions(model: ModalModel) -> Sequence[float | None]:
    """Direction of each mode of both planes; None for those of one [rad]."""
    both = {c.dof.plane for c in model.coordinates} == {Dof.X, Dof.Y}
    return directions(model).tolist() if both else [None] * model.omega_n.size


def write_modes(path: str | Path, axes: Mapping[str, ModalModel], as_json: bool) -> None:
    """Write modes as CSV or JSON: h_pq = sum phi_p phi_q / (i omega - lambda) + its mirror.

    `axes`: mapping of axis (X or Y, or both as XY) to ModalModel
    `as_json`: JSON, else CSV
    """
    records: Sequence[dict[str, Any]] = mode_records(axes)
    if not records:
        raise InputError("modes", "none", "at least one mode", str(path))
    if as_json:
        residual = {axis: model.residual.tolist() for axis, model in axes.items()}
        write_text(path, json.dumps({"modes": records, "residual_compliance": residual}, indent=1, allow_nan=False) + "\n")
        return
    rows = [",".join(records[0]), *(",".join(str(v) for v in record.values()) for record in records)]
    write_text(path, "\n".join(rows) + "\n")
