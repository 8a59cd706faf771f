"""The walls that a cutter leaves beside its path, as columns a few micrometres apart in slices across its axis.

Each slice has two walls, the material below the path and the material above, and each is single-valued: a cutter that goes along them takes
columns down to where its edges pass [huynh2018].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.toolpath._kernels import wall as kernels
from rcsa_ident.toolpath.dexel import DexelField

#: Where a column without material ends: farther from the path than any tool reaches [m].
NOTHING = -1.0
#: Columns that are kept at most, all slices together: 800 MB.
_MOST = 100_000_000


class PathFrame(NamedTuple):
    """Axes in the plane: x along a path, y to its left. `origin` [m], shape (2,). `angle` [rad]: of x, counterclockwise."""

    origin: FloatArray
    angle: float

    @property
    def turn(self) -> FloatArray:
        """Rows are x and y, shape (2, 2)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, s], [-s, c]])

    def to(self, places: FloatArray) -> FloatArray:
        """Return places (k, 2) as seen from here."""
        return (places - self.origin) @ self.turn.T

    def back(self, places: FloatArray) -> FloatArray:
        """Return places (k, 2) that are seen from here."""
        return self.origin + places @ self.turn


@dataclass(slots=True, eq=False)
class Walls:
    """Columns of material on both sides of a path that goes along x, in the path's own axes.

    Parameters
    ----------
    start, spacing : float [m]
        Place of the first column, and from one to the next.
    tops : array, shape (2, slices, n) [m]
        Where the material below the path ends upwards, y < tops[0]; and, mirrored at the path's line, where the material above it does,
        y > -tops[1]. `NOTHING` where there is none. A march takes it down.
    feet : array, shape (2, slices, n) [m]
        Where that material ends on its other side, mirrored likewise; at or below `NOTHING` where the tool does not come to it.
    """

    start: float
    spacing: float
    tops: FloatArray
    feet: FloatArray

    @classmethod
    def block(cls, length: float, y_from: float, y_to: float, slices: int, margin: float, spacing: float = 4e-6) -> Walls:
        """Return the walls of a block that begins at x = 0, the path being y = 0.

        `length` [m]
        `y_from`, `y_to` [m]: its sides; infinite where the tool does not come to them
        `margin` [m]: of columns before and behind it: as far as the cutter reaches
        `spacing` [m]

        Examples
        --------
        A wall of which a cutter of 10 mm takes 4 mm, below the path (down-milling):

        >>> walls = Walls.block(0.09, -np.inf, -0.001, slices=6, margin=0.006)
        >>> walls.tops.shape, round(float(walls.tops[0, 0, np.searchsorted(walls.x, 0.05)]), 6)
        ((2, 6, 25501), -0.001)
        """
        count = int(np.ceil((positive("length", length, "m") + 2.0 * margin) / positive("spacing", spacing, "m"))) + 1
        if 2 * slices * count > _MOST:
            raise InputError(
                "spacing", f"{2 * slices * count} columns in all", f"at most {_MOST}: wider spacing, fewer slices or a shorter path"
            )
        if not y_from < y_to:
            raise InputError("sides of the block", (y_from, y_to), "the first one smaller [m]")
        x = spacing * np.arange(count) - margin
        inside = (x >= 0.0) & (x <= length)
        tops, feet = np.full((2, 2, slices, count), NOTHING)
        # what the block has on each side of the path's line
        for side, (near, far) in enumerate(((y_to, y_from), (-y_from, -y_to))):
            if far < 0.0:
                tops[side][:, inside], feet[side][:, inside] = min(near, 0.0), max(far, NOTHING)
        return cls(-margin, spacing, tops, feet)

    @classmethod
    def beside(
        cls, field: DexelField, frame: PathFrame, heights: FloatArray, span: tuple[float, float], reach: float, spacing: float = 4e-6
    ) -> Walls:
        """Return the walls of a field of dexels beside a path.

        Parameters
        ----------
        field : DexelField
        frame : PathFrame
            Whose x the path goes along.
        heights : array, shape (slices,) [m]
            Where the slices are, in the field's z.
        span : tuple of float [m]
            First and last column, along x.
        reach : float [m]
            As far beside the path as the cutter comes.
        spacing : float [m]

        Notes
        -----
        A layer is bordered by straight pieces between the ends of its lines: exact for straight walls, and to d^2 / (8 r) for round
        ones, d being the distance between lines.
        """
        count = int(np.ceil((span[1] - span[0]) / spacing)) + 1
        if 2 * len(heights) * count > _MOST:
            raise InputError(
                "spacing", f"{2 * len(heights) * count} columns", f"at most {_MOST}: wider spacing, fewer slices or a shorter path"
            )
        tops, feet = np.full((2, 2, len(heights), count), NOTHING)
        corners = frame.back(np.array([[x, y] for x in span for y in (-reach, reach)]))
        lattice = field.lattice
        nodes = (corners - lattice[0, :2]) / lattice[1, :2]
        window = np.array([*np.floor([nodes[:, 0].min(), nodes[:, 0].max()]), *np.floor([nodes[:, 1].min(), nodes[:, 1].max()])], dtype=int)
        pieces, within = np.empty((4096, 4)), np.empty(count, dtype=np.bool_)
        line = frame.back(np.column_stack([span[0] + spacing * np.arange(count), np.zeros(count)]))
        for k, z in enumerate(np.asarray(heights, dtype=float).tolist()):
            if not field.low[2] <= z < field.high[2]:
                continue
            at = min(int((z - field.low[2]) / field.cell[2]), field.shape[2] - 1)
            layer = kernels.Layer(
                field.segs[0][at], field.counts[0][at], field.segs[1][at], field.counts[1][at], field.segs[2], field.counts[2], lattice, z
            )
            held = kernels.contour(layer, window, pieces)
            if held > len(pieces):
                pieces = np.empty((2 * held, 4))
                kernels.contour(layer, window, pieces)
            ends = frame.to(pieces[:held].reshape(-1, 2)).reshape(-1, 4)
            kernels.inside(layer, line, within)
            kernels.columns(np.ascontiguousarray(ends), within, span[0], spacing, NOTHING, tops[:, k], feet[:, k])
        return cls(span[0], spacing, tops, feet)

    @property
    def x(self) -> FloatArray:
        """Of the columns, shape (n,) [m]."""
        return self.start + self.spacing * np.arange(self.tops.shape[-1])

    def copy(self) -> Walls:
        """Return walls of their own."""
        return Walls(self.start, self.spacing, self.tops.copy(), self.feet)
