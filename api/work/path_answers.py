"""What answers about paths through stock hold for a page: rows, the part that is left, the line of the path and the tool's outline."""

from __future__ import annotations

from itertools import pairwise
from math import isfinite
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import surface_made_by
from rcsa_ident.toolpath.solid import ToolSolid
from rcsa_ident.workflows.paths.milling import PathMilling

#: Rows, places of the line that is drawn, triangles of the part, and points of the tool's outline that an answer has at most.
MOST_ROWS, MOST_DRAWN, MOST_TRIANGLES, MOST_OUTLINE = 10_000, 10_000, 60_000, 60
#: How exact places are drawn [mm], and the outline of a tool [m].
_DECIMALS, _CHORD = 3, 1e-5


def wall_errors(found: PathMilling, moves: int) -> FloatArray:
    """Return the mean error of the walls that each move leaves, shape (moves,) [µm]; nan where it leaves none."""
    of = found.surface[:, 5].astype(int)
    count = np.bincount(of, minlength=moves)
    return np.divide(1e6 * np.bincount(of, found.surface[:, 4], minlength=moves), count, out=np.full(moves, np.nan), where=count > 0)


def way_along(path: ToolPath) -> FloatArray:
    """Return the way up to the end of each move, shape (k - 1,) [mm]."""
    return 1e3 * np.cumsum(path.lengths)


def sentences_of(text: str) -> list[str]:
    """Return the lines of a text as sentences."""
    return [f"{line[:1].upper()}{line[1:]}." for line in text.splitlines()]


def thinned(columns: dict[str, FloatArray], worst: FloatArray) -> tuple[dict[str, list[float | None]], np.ndarray]:
    """Return columns of at most `MOST_ROWS` rows, of neighbours the one whose `worst` is least; and which of these each row is told by."""
    count = worst.size
    groups = np.array_split(np.arange(count), min(count, MOST_ROWS)) if count else []
    kept = np.array([own[np.argmin(worst[own])] for own in groups], dtype=int)
    row = np.repeat(np.arange(len(groups)), [own.size for own in groups])
    return {name: _or_none(values[kept]) for name, values in columns.items()}, row


def _or_none(values: FloatArray) -> list[float | None]:
    return [float(f"{each:.6g}") if isfinite(each) else None for each in values.tolist()]


def part_of(field: DexelField, path: ToolPath, moves: np.ndarray, row: np.ndarray, radius: float) -> dict[str, Any] | None:
    """Return the surface that is left, each triangle with the `row` of the one of some moves that made it, -1 where none did.

    None where nothing is left.
    """
    points, faces, made = surface_made_by(field, path, moves, radius, MOST_TRIANGLES)
    if not len(faces):
        return None
    rows = np.where(made >= 0, np.append(row, -1)[np.searchsorted(moves, made)], -1)
    return {"points_mm": (1e3 * points).round(_DECIMALS).ravel().tolist(), "triangles": faces.ravel().tolist(), "rows": rows.tolist()}


def drawn_path(path: ToolPath) -> dict[str, Any]:
    """Return the line that is drawn, with what it is told by: of many places every so many, and the last one."""
    every = max(1, -(-len(path) // MOST_DRAWN))
    kept = np.unique(np.append(np.arange(0, len(path), every), len(path) - 1))
    way = np.concatenate([[0.0], way_along(path)])[kept]
    return {
        "places_mm": rounded(1e3 * path.places[kept]),
        "axes": rounded(path.axes[kept]),
        "way_mm": way.round(_DECIMALS).tolist(),
        "line": path.line[kept].tolist(),
        "rapid": [False, *(bool(np.all(~path.cutting[a:b])) for a, b in pairwise(kept))],
    }


def rounded(values: FloatArray) -> list[list[float]]:
    """Return rows as exact as they are drawn."""
    found: list[list[float]] = (values.round(_DECIMALS) + 0.0).tolist()
    return found


def outline_of(solid: ToolSolid) -> list[list[float]]:
    """Return radii and heights of a tool, from its tip up [mm]."""
    coarse = solid.coarser(_CHORD)
    points = 1e3 * np.column_stack([coarse.radii, coarse.heights])
    every = max(1, -(-len(points) // MOST_OUTLINE))
    return rounded(points[np.unique(np.append(np.arange(0, len(points), every), len(points) - 1))])
