"""Static tests of a robot: postures, forces and displacements in a table.

Columns ``q1_deg``, ``q2_deg`` and so on, ``fx_n``, ``fy_n``, ``fz_n`` and ``dx_mm``, ``dy_mm``, ``dz_mm`` in the base's axes, a row a
test, in the order in which they were made. They may have ``mx_nm``, ``my_nm``, ``mz_nm``, moments about the tool's place where the force
acts; ``rx_mrad``, ``ry_mrad``, ``rz_mrad``, how far the flange turns; and ``point_x_mm``, ``point_y_mm``, ``point_z_mm``, where the
displacement is measured, in the robot's flange.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.arm.static import StaticTests
from rcsa_ident.io.text_columns import TextTable, read_table

_FORCE, _MOMENT = ("fx_n", "fy_n", "fz_n"), ("mx_nm", "my_nm", "mz_nm")
_MOVED, _TURNED = ("dx_mm", "dy_mm", "dz_mm"), ("rx_mrad", "ry_mrad", "rz_mrad")
_POINT = ("point_x_mm", "point_y_mm", "point_z_mm")
#: Farther than a force pushes an arm that stands [m], and harder than anybody pushes it [N].
_FARTHEST, _STRONGEST = 0.05, 1e5


def is_static(path: Path) -> bool:
    """Return whether a file is a table of static tests, by its columns."""
    return path.suffix.lower() == ".csv" and bool({*_FORCE, *_MOVED} & {*read_table(path, "robot record").header})


def posture_columns(joints: int) -> tuple[str, ...]:
    """Return what the columns of a posture's angles are called."""
    return tuple(f"q{k}_deg" for k in range(1, joints + 1))


def read_static_tests(path: str | Path, joints: int) -> StaticTests:
    """Return the tests of a table, of an arm with so many joints.

    Raises `InputError`, which names the file, and the column or line that is missing or wrong.
    """
    table = read_table(path, "static tests")
    values = {}
    for names, asked in (
        (posture_columns(joints), True),
        (_FORCE, True),
        (_MOVED, True),
        (_MOMENT, False),
        (_TURNED, False),
        (_POINT, False),
    ):
        if asked or any(name in table.header for name in names):
            values[names] = finite_columns(table, names)
    force, moved = values[_FORCE], 1e-3 * values[_MOVED]
    for name, sizes, most, allowed in (
        (_FORCE[0], force, _STRONGEST, f"forces of at most {_STRONGEST:g} N"),
        (_MOVED[0], moved, _FARTHEST, f"displacements of at most {1e3 * _FARTHEST:g} mm; are these millimetres?"),
    ):
        beyond = np.flatnonzero(np.max(np.abs(sizes), axis=1) > most)
        if beyond.size:
            raise InputError(f"columns {name} and further", f"{np.max(np.abs(sizes)):g}", allowed, table.at(int(beyond[0])))
    return StaticTests(
        Path(path).name,
        np.radians(values[posture_columns(joints)]),
        np.hstack([force, values.get(_MOMENT, np.zeros_like(force))]),
        np.hstack([moved, 1e-3 * values[_TURNED]]) if _TURNED in values else moved,
        1e-3 * values[_POINT] if _POINT in values else None,
    )


def finite_columns(table: TextTable, names: tuple[str, ...]) -> FloatArray:
    """Return the named columns of a table, shape (t, k), finite numbers all. Raises `InputError`, which names the column and the line."""
    table.check_header(names, f"columns {', '.join(names)}")
    values = np.stack(table.columns(names), axis=1)
    wrong = np.argwhere(~np.isfinite(values))
    if wrong.size:
        raise InputError(f"column {names[wrong[0][1]]}", "an empty cell or no number", "a finite number", table.at(int(wrong[0][0])))
    return values
