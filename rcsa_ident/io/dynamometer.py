"""Calibrated coefficients as the [workpiece] table that a campaign, a machine file or a result carries."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rcsa_ident.io.files import write_text
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table
from rcsa_ident.io.workpieces import WORKPIECE_KEYS, workpiece_keys, workpiece_of
from rcsa_ident.machining_setup import Workpiece


def write_workpiece(path: str | Path, workpiece: Workpiece, remarks: Sequence[str] = ()) -> None:
    """Write ``[workpiece]`` with all its spreads, to be pasted into a campaign or read by `read_workpiece`.

    Parameters
    ----------
    path : path
    workpiece : Workpiece
    remarks : sequence of str
        Comments above it, a line each.
    """
    lines = [f"# {' '.join(remark.split())}" for remark in remarks] + ["[workpiece]"]
    for key, value in workpiece_keys(workpiece, all_spreads=True).items():
        lines.append(f"{key} = {_quoted(value) if isinstance(value, str) else format(value, '.7g')}")
    write_text(path, "\n".join(lines) + "\n")


def read_workpiece(path: str | Path) -> Workpiece:
    """Return the workpiece of a file with a ``[workpiece]`` table; other tables are left alone."""
    top = Table(read_toml(path, "workpiece"), str(path))
    return workpiece_of(top.table("workpiece", WORKPIECE_KEYS))


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
