"""FLANGE.csv: the receptance block of a spindle's flange over frequency, measured or decoupled, with what is known of its errors.

With columns of the joint it is the flange alone, and the joint stands in front of it; without them the joint's compliance is part of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, fields, replace
from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.files import write_text
from rcsa_ident.io.text_columns import TextTable, read_table, table_of
from rcsa_ident.io.unread_columns import left_aside, reading_tables
from rcsa_ident.machine.axial_flange import AxialFlange
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.machine.measured import MeasuredFlange

#: Entries of [[tF, tM], [rF, rM]]; a flange is reciprocal, so rF is tM.
_ENTRIES = {"tF": (0, 0), "tM": (0, 1), "rM": (1, 1)}
#: Columns along the axis.
_AXIAL = ("Z_tF_re", "Z_tF_im")
#: Columns of the joint, the same in every line, by the names that they have in RESULT.json.
_JOINT = tuple(f"joint_{each.name}" for each in fields(LumpedJoint))


def write_flange_csv(
    path: str | Path,
    frequency_hz: FloatArray,
    values: Mapping[Dof, ComplexArray],
    std: Mapping[Dof, FloatArray] | None = None,
    joints: Mapping[Dof, LumpedJoint] | None = None,
    axial: ComplexArray | None = None,
) -> None:
    """Write flange receptances: ``frequency_hz, X_tF_re, X_tF_im, X_tM_re, ..., Y_rM_im`` in m/N, rad/N and rad/(N m).

    `frequency_hz`, shape (n,)
    `values`: mapping of Dof to complex array, shape (n, 2, 2)
    `std`: mapping of Dof to array, shape (n, 2, 2); columns ``X_tF_std`` and so on: of the real and of the imaginary part each
    `joints`: columns ``X_joint_translational_stiffness`` and so on [N/m, N m/rad, N s/m, N m s/rad], of the joint in front of `values`; an
        axis without them has its joint's compliance in `values`
    `axial`, shape (n,): columns ``Z_tF_re`` and ``Z_tF_im``: along the axis, with the joint's compliance in it
    """
    columns: dict[str, FloatArray] = {"frequency_hz": np.asarray(frequency_hz, dtype=float)}
    for axis, block in values.items():
        for name, (i, j) in _ENTRIES.items():
            head = f"{axis.upper()}_{name}"
            columns |= {f"{head}_re": block[:, i, j].real, f"{head}_im": block[:, i, j].imag}
            if std is not None:
                columns[f"{head}_std"] = std[axis][:, i, j]
        if joints is not None and axis in joints:
            parts = zip(_JOINT, astuple(joints[axis]), strict=True)
            columns |= {f"{axis.upper()}_{name}": np.full(columns["frequency_hz"].size, value) for name, value in parts}
    if axial is not None:
        columns |= dict(zip(_AXIAL, (axial.real, axial.imag), strict=True))
    table = np.stack(list(columns.values()), axis=1)
    if not np.all(np.isfinite(table)):
        raise InputError("flange receptance", "not finite", "finite numbers", str(path))
    write_text(path, "\n".join([",".join(columns), *(",".join(str(v) for v in row) for row in table.tolist())]) + "\n")


def write_flange_machine(path: str | Path, machine: FlangeMachine) -> None:
    """Write the flange of a machine, and the joint in front of it where there is one apart from it.

    Raises `InputError` if its bending planes feel each other: the file has no columns for that.
    """
    omega, values, joints = machine.lines(), {}, {}
    for part in machine.parts:
        if len(part.coordinates) > 2:
            raise InputError("flange", "bending planes that feel each other", "planes apart from each other", str(path))
        axis, believed = part.coordinates[0].dof, part.believed
        values[axis] = believed.flange.receptance(omega).values
        if believed.joint is not None:
            joints[axis] = believed.joint
    axial = None if machine.axial is None else machine.axial.receptance(omega).values[:, 0, 0]
    write_flange_csv(path, np.round(to_hz(omega), 9), values, joints=joints, axial=axial)


def read_flange_csv(path: str | Path) -> dict[Dof, MeasuredFlange]:
    """Return the flange of each axis in a file, without the joint that may stand in front of it; further columns are left alone.

    Raises `InputError`: a column is missing, or the frequencies do not rise.
    """
    return _flanges(read_table(path, "flange"))


def read_flange_machine(path: str | Path) -> FlangeMachine:
    """Return a machine that is known by the flange of such a file, with its joint; without one the flange holds the joint's compliance.

    Raises `InputError` as `read_flange_csv`; or the columns of a joint are not complete, or change from line to line.
    """
    return _machine(read_table(path, "flange"), Path(path).stem)


def flange_machine_of(text: str, name: str = "flange") -> FlangeMachine:
    """Return the same of a text, columns that are left aside among its remarks; errors name its lines."""
    with reading_tables():
        machine = _machine(table_of(text, "flange", ""), name)
        return replace(machine, assumed=tuple(left_aside()))


def _machine(table: TextTable, name: str) -> FlangeMachine:
    flanges = tuple(_flanges(table).values())
    return FlangeMachine(flanges, flanges[0].band, _joints(table), name, ends=True, axial=_axial(table))


def _axial(table: TextTable) -> AxialFlange | None:
    """What stands along the axis, where the file has its columns."""
    if not any(name in table.header for name in _AXIAL):
        return None
    missing = [name for name in _AXIAL if name not in table.header]
    if missing:
        raise InputError(f"column {missing[0]}", "nothing", "real and imaginary part of Z_tF", table.where)
    frequency, real, imaginary = table.columns(["frequency_hz", *_AXIAL])
    try:
        return AxialFlange.fitted(from_hz(frequency), real + 1j * imaginary)
    except InputError as error:
        raise error.at(table.where) from None


def _joints(table: TextTable) -> dict[Dof, LumpedJoint] | None:
    """The joint of each axis that has one."""
    found = {}
    for axis in (Dof.X, Dof.Y):
        names = [f"{axis.upper()}_{name}" for name in _JOINT]
        if not any(name in table.header for name in names):
            continue
        missing = [name for name in names if name not in table.header]
        if missing:
            raise InputError(f"column {missing[0]}", "nothing", "stiffness and damping of a joint, all four", table.where)
        columns = table.columns(names)
        for name, column in zip(names, columns, strict=True):
            if np.any(column != column[0]):
                raise InputError(f"column {name}", "different numbers", "the same number in every line", table.where)
        try:
            found[axis] = LumpedJoint(*(float(column[0]) for column in columns))
        except InputError as error:
            raise error.at(table.where) from None
    return found or None


def _flanges(table: TextTable) -> dict[Dof, MeasuredFlange]:
    flanges = {}
    for axis in (Dof.X, Dof.Y):
        names = [f"{axis.upper()}_{name}_{part}" for name in _ENTRIES for part in ("re", "im")]
        if not any(name in table.header for name in names):
            continue
        missing = [name for name in ("frequency_hz", *names) if name not in table.header]
        if missing:
            raise InputError(f"column {missing[0]}", "nothing", "real and imaginary parts of tF, tM and rM", table.where)
        frequency, *parts = table.columns(["frequency_hz", *names])
        block = np.zeros((frequency.size, 2, 2), dtype=complex)
        for k, (i, j) in enumerate(_ENTRIES.values()):
            block[:, i, j] = block[:, j, i] = parts[2 * k] + 1j * parts[2 * k + 1]
        rows = plane("flange", axis)
        try:
            flanges[axis] = MeasuredFlange(Receptance(from_hz(frequency), block, rows, rows))
        except InputError as error:
            raise error.at(table.where) from None
    if not flanges:
        raise InputError("flange", "no columns X_tF_re or Y_tF_re", "a flange's receptances", table.where)
    return flanges
