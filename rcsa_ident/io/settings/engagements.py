"""MAP.csv: between which angles an edge cuts at which height, as CAM systems tell it; ENGAGEMENT.csv: the same all along a path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import EngagementMap
from rcsa_ident.io.files import write_text
from rcsa_ident.io.text_columns import read_table

if TYPE_CHECKING:
    from rcsa_ident.toolpath.engagement import PathEngagement
    from rcsa_ident.toolpath.path import ToolPath

COLUMNS = ("z_mm", "entry_angle_deg", "exit_angle_deg")
ALONG = ("x_mm", "y_mm", "z_mm", "slice_mm", "entry_angle_deg", "exit_angle_deg", "removed_volume_mm3")
#: Rows of a map, at most.
MOST_ROWS = 10_000


def read_engagement_map(path: str | Path, lead: float = 0.0) -> EngagementMap:
    """Return the engagement of a map; a height that stands several times has several arcs.

    `path`: with columns ``z_mm`` from the tip up, ``entry_angle_deg`` and ``exit_angle_deg``
    `lead` [rad]: by which the tool leans in the direction of the feed: so far the feed climbs towards the spindle
    Raises `InputError`, which names the file and the column.
    """
    table = read_table(path, "engagement map")
    for name in COLUMNS:
        if name not in table.header:
            raise InputError(f"column {name}", "nothing", f"columns {', '.join(COLUMNS)}", table.where)
    columns = table.columns(COLUMNS)
    if not 1 <= columns[0].size <= MOST_ROWS:
        raise InputError("engagement map", f"{columns[0].size} rows", f"1 to {MOST_ROWS}", table.where)
    try:
        return engagement_map_of(columns[0], columns[1], columns[2], lead)
    except InputError as error:
        raise error.at(table.where) from None


def engagement_map_of(z_mm: FloatArray, entry_deg: FloatArray, exit_deg: FloatArray, lead: float = 0.0) -> EngagementMap:
    """Return the engagement map of heights [mm] and angles [deg], each of shape (n,), for a tool that leads by an angle [rad]."""
    return EngagementMap(1e-3 * np.asarray(z_mm), np.radians(entry_deg), np.radians(exit_deg), lead)


def rows_of_map(engagement: EngagementMap) -> FloatArray:
    """Return heights [mm] and angles [deg] of a map, shape (n, 3)."""
    return np.stack([1e3 * engagement.z, np.degrees(engagement.start), np.degrees(engagement.end)], axis=1)


def write_engagement(path: str | Path, tool_path: ToolPath, engagement: PathEngagement, arc_volume: FloatArray) -> None:
    """Write ENGAGEMENT.csv: for each place that a move leaves, its arcs from the tip up, and what each of them takes out on the move.

    A move whose edges are nowhere in the material has one row without slice and angles, and the volume that its floor takes out.

    `arc_volume` [m^3], shape (n,): of each arc
    """
    lines = [",".join(ALONG)]
    degrees = np.degrees([engagement.start, engagement.end])
    for move, volume in enumerate(engagement.volume):
        place = ",".join(f"{value:.6g}" for value in 1e3 * tool_path.places[move])
        own = engagement.arcs_of(move)
        rows = range(own.start, own.stop)
        if (not arc_volume[own].sum() > 0.0 and volume > 0.0) or not rows:
            lines.append(f"{place},,,,{1e9 * volume:.6g}")
        lines += [
            f"{place},{1e3 * engagement.height[k]:.6g},{degrees[0, k]:.6g},{degrees[1, k]:.6g},{1e9 * arc_volume[k]:.6g}" for k in rows
        ]
    write_text(path, "\n".join(lines) + "\n")
