"""Calibrated coefficients as the [workpiece] table that a campaign, a machine file or a result carries."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rcsa_ident.io.files import write_text
from rcsa_ident.io.settings.workpieces import WORKPIECE_KEYS, workpiece_keys, workpiece_of
from rcsa_ident.io.toml_text import read_toml, toml_of
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.cut import Workpiece


def write_workpiece(path: str | Path, workpiece: Workpiece, remarks: Sequence[str] = ()) -> None:
    """Write ``[workpiece]`` with all its spreads, to be pasted into a campaign or read by `read_workpiece`.

    `remarks`: comments above it, a line each
    """
    write_text(path, toml_of({"workpiece": workpiece_keys(workpiece, all_spreads=True)}, remarks, digits=7))


def read_workpiece(path: str | Path) -> Workpiece:
    """Return the workpiece of a file with a ``[workpiece]`` table; other tables are left alone."""
    top = Table(read_toml(path, "workpiece"), str(path))
    return workpiece_of(top.table("workpiece", WORKPIECE_KEYS))
