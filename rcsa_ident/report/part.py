"""A picture of a part that was cut: shaded at an angle with its sizes, and its heights from above with the path."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.report.style import STYLE
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import surface_made_by

#: Where one stands who looks at the part: azimuth from x, and elevation [rad].
_AZIMUTH, _ELEVATION = np.radians(-60.0), np.radians(35.0)
#: Pixels along the longer side of the shaded view.
_PIXELS = 900
_STEEL, _INK, _PATH = np.array([0.70, 0.76, 0.82]), "#1f2933", "#C8501A"
#: Places that a path is drawn with, or pieces of one in colours of their own, at most; and triangles of a surface in colours.
_DRAWN, _TRIANGLES = 5000, 200_000


def part_figure(field: DexelField, path: ToolPath | None = None) -> Figure:
    """Return the picture of what is left of a stock, axes in mm. `path`: drawn from above."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 4.8), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
        _shaded(left, field)
        _from_above(right, field, path)
    return figure


def save_part(path: str | Path, field: DexelField, tool_path: ToolPath | None = None) -> None:
    """Write the picture as the file's suffix says."""
    with mpl.rc_context(STYLE):
        part_figure(field, tool_path).savefig(path, dpi=150)


def coloured_part_figure(
    field: DexelField, path: ToolPath, values: FloatArray, label: str, limits: tuple[float, float] | None = None, reach: float = 0.0
) -> Figure:
    """Return a part whose surface has the colour of the move that made it, and the path from above in the same colours.

    `field`: what is left
    `values`, shape (k - 1,): of the moves; a surface that none of them made, or one without a value, is grey
    `limits`: of the colours, the lower one of what is worst; by default those of the values, of which the farthest from 0 is worst
    `reach` [m]: the tool's radius
    """
    known = values[np.isfinite(values)]
    low, high = limits if limits is not None else (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    colours = mpl.cm.ScalarMappable(mpl.colors.Normalize(low, high if high > low else low + 1.0), "RdYlGn" if limits else "coolwarm")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 4.8), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
        points, faces, made = surface_made_by(field, path, np.flatnonzero(np.isfinite(values)), reach, _TRIANGLES)
        value = np.where(made >= 0, np.append(values, np.nan)[made], np.nan)
        paint = np.where(np.isfinite(value)[:, None], colours.to_rgba(np.nan_to_num(value))[:, :3], _STEEL)
        _shaded(left, field, (points, faces), paint)
        right.add_collection(_stretches(path, values, np.abs(values) if limits is None else -values, colours))
        right.autoscale_view()
        figure.colorbar(colours, ax=right, label=label, shrink=0.85)
        right.set_aspect("equal", adjustable="datalim")
        right.set_title("the path from above")
        right.set_xlabel("x, mm")
        right.set_ylabel("y, mm")
    return figure


def _stretches(path: ToolPath, values: FloatArray, badness: FloatArray, colours: mpl.cm.ScalarMappable) -> LineCollection:
    """The moves that cut from above, each in its colour; of many, neighbours in that of the worst of them."""
    cutting, places = np.flatnonzero(path.cutting), 1e3 * path.places[:, :2]
    lines, told = [], []
    for moves in np.array_split(cutting, min(cutting.size, _DRAWN)) if cutting.size else []:
        # rapid moves between them are gaps
        runs = np.split(moves, np.flatnonzero(np.diff(moves) > 1) + 1)
        lines.append(np.concatenate([np.vstack([places[run[0] : run[-1] + 2], [[np.nan, np.nan]]]) for run in runs])[:-1])
        told.append(values[moves[np.argmax(np.where(np.isfinite(values[moves]), badness[moves], -np.inf))]])
    known = np.isfinite(told)
    paint = np.where(known[:, None], colours.to_rgba(np.nan_to_num(told)), (0.8, 0.8, 0.8, 1.0))
    return LineCollection(lines, colors=paint, linewidths=np.where(known, 2.5, 1.0), capstyle="round")


def save_coloured_part(
    file: str | Path, field: DexelField, path: ToolPath, values: FloatArray, label: str, limits: tuple[float, float] | None, reach: float
) -> None:
    """Write `coloured_part_figure` as the file's suffix says."""
    with mpl.rc_context(STYLE):
        coloured_part_figure(field, path, values, label, limits, reach).savefig(file, dpi=150)


def _shaded(axes: Axes, field: DexelField, surface: tuple[FloatArray, np.ndarray] | None = None, paint: FloatArray | None = None) -> None:
    """All triangles from an angle, the nearest one of each pixel, in the light from above left."""
    axes.set_title("what is left")
    axes.set_axis_off()
    axes.set_aspect("equal")
    right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    towards = np.array([np.cos(_ELEVATION) * np.cos(_AZIMUTH), np.cos(_ELEVATION) * np.sin(_AZIMUTH), np.sin(_ELEVATION)])
    up = np.cross(towards, right)
    view = np.stack([right, up, towards])
    corners = np.array([[(field.low, field.high)[(k >> a) & 1][a] for a in range(3)] for k in range(8)]) * 1e3
    flat = corners @ view[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    points, faces = field.mesh() if surface is None else surface
    if len(faces):
        size = float(np.max(high - low)) / _PIXELS
        image = _rendered(1e3 * points, faces, view, low, high, size, _STEEL if paint is None else paint)
        axes.imshow(image, origin="lower", extent=(low[0], low[0] + size * image.shape[1], low[1], low[1] + size * image.shape[0]))
    ends = ((0, 1, "x"), (1, 3, "y"), (3, 7, "z"))
    for one, two, name in ends:
        a, b = flat[one], flat[two]
        axes.plot(*np.stack([a, b], axis=1), color=_INK, linewidth=0.8)
        length = float(np.linalg.norm(corners[two] - corners[one]))
        out = 0.5 * (a + b) - flat.mean(axis=0)
        place = 0.5 * (a + b) + 0.05 * float(np.max(high - low)) * out / np.linalg.norm(out)
        axes.text(
            float(place[0]),
            float(place[1]),
            f"{name} {length:.4g} mm",
            ha="left" if out[0] > 0.0 else "right",
            va="center",
            color=_INK,
            fontsize=9.0,
        )
    margin = 0.16 * (high - low)
    axes.set_xlim(low[0] - margin[0], high[0] + margin[0])
    axes.set_ylim(low[1] - margin[1], high[1] + margin[1])


def _rendered(
    points: FloatArray, faces: np.ndarray, view: FloatArray, low: FloatArray, high: FloatArray, size: float, paint: FloatArray
) -> FloatArray:
    """Image, shape (rows, columns, 4): points spread over each triangle, drawn from the farthest to the nearest."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(area, 1e-300)[:, None]
    facing = normal @ view[2] > 0.0
    paint = np.broadcast_to(paint, (len(faces), 3))
    a, b, c, normal, area, paint = (each[facing] for each in (a, b, c, normal, area, paint))
    light = np.array([-0.35, -0.25, 0.9])
    shade = 0.30 + 0.70 * np.clip(normal @ (light / np.linalg.norm(light)), 0.0, 1.0)
    shape = np.ceil((high - low) / size).astype(int)[::-1] + 1
    depth, value = np.full(shape, -np.inf), np.zeros((*shape, 3))
    # as many points on each side of a triangle that no pixel inside it is left out
    longest = np.sqrt(np.max([np.sum((q - p) ** 2, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0))
    for pieces in np.unique(np.ceil(1.5 * longest / size)).astype(int):
        own = np.ceil(1.5 * longest / size) == pieces
        for i in range(pieces + 1):
            for j in range(pieces + 1 - i):
                u, v = i / max(pieces, 1), j / max(pieces, 1)
                spot = (1.0 - u - v) * a[own] + u * b[own] + v * c[own]
                column, row = (((spot @ view[k]) - low[k]) / size for k in range(2))
                rows, columns = np.clip(row.astype(int), 0, shape[0] - 1), np.clip(column.astype(int), 0, shape[1] - 1)
                near = spot @ view[2]
                order = np.argsort(near)
                rows, columns, near, lit = rows[order], columns[order], near[order], (shade[:, None] * paint)[own][order]
                nearer = near > depth[rows, columns]
                depth[rows[nearer], columns[nearer]] = near[nearer]
                value[rows[nearer], columns[nearer]] = lit[nearer]
    value = _with_edges(value, depth, size)
    image = np.zeros((*shape, 4))
    image[..., :3], image[..., 3] = np.clip(1.25 * value, 0.0, 1.0), np.isfinite(depth)
    return image


def _with_edges(value: FloatArray, depth: FloatArray, size: float) -> FloatArray:
    """Brightness, or colours, with a line where the surface turns or hides what is behind: surfaces of one slope are equally bright."""
    seen = np.isfinite(depth)
    filled, colours = np.where(seen, depth, 0.0), value.reshape(*depth.shape, -1)
    bright, edge = colours.mean(axis=2), np.zeros(depth.shape, dtype=bool)
    for along, here, before in ((0, np.s_[1:, :], np.s_[:-1, :]), (1, np.s_[:, 1:], np.s_[:, :-1])):
        jumps = (np.abs(np.diff(filled, axis=along)) > 6.0 * size) | (np.abs(np.diff(bright, axis=along)) > 0.1)
        edge[here] |= jumps & seen[here] & seen[before]
    return (colours * np.where(edge, 0.5, 1.0)[..., None]).reshape(value.shape)


def _from_above(axes: Axes, field: DexelField, path: ToolPath | None) -> None:
    heights = 1e3 * field.height_map().T
    extent = (1e3 * field.low[0], 1e3 * field.high[0], 1e3 * field.low[1], 1e3 * field.high[1])
    shown = axes.imshow(heights, origin="lower", extent=extent, cmap="cividis", interpolation="nearest")
    axes.figure.colorbar(shown, ax=axes, label="height z, mm", shrink=0.85)
    axes.set_title("from above")
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.grid(False)
    if path is not None and len(path) > 1:
        every = max(1, len(path) // _DRAWN)
        x, y = 1e3 * path.places[::every, 0], 1e3 * path.places[::every, 1]
        axes.plot(x, y, color=_PATH, linewidth=0.9, alpha=0.8)
    width, height = extent[1] - extent[0], extent[3] - extent[2]
    axes.set_xlim(extent[0] - 0.15 * width, extent[1] + 0.15 * width)
    axes.set_ylim(extent[2] - 0.15 * height, extent[3] + 0.15 * height)
