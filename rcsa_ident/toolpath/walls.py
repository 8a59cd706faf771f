"""The walls that a cutter leaves beside its path, as columns a few micrometres apart in slices across its axis.

Each slice has two walls, the material below the path and the material above, and each is single-valued: a cutter that goes along them takes
columns down to where its edges pass [huynh2018].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError, positive

#: Where a column without material ends: farther from the path than any tool reaches [m].
NOTHING = -1.0
#: Columns that are kept at most, all slices together: 800 MB.
_MOST = 100_000_000


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

        Parameters
        ----------
        length : float [m]
        y_from, y_to : float [m]
            Its sides; infinite where the tool does not come to them.
        slices : int
        margin : float [m]
            Of columns before and behind it: as far as the cutter reaches.
        spacing : float [m]

        Examples
        --------
        A wall of which a cutter of 10 mm takes 4 mm, below the path (down-milling):

        >>> walls = Walls.block(0.09, -np.inf, -0.001, slices=6, margin=0.006)
        >>> walls.tops.shape, round(float(walls.top_at(0.05)[0, 0]), 6)
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

    @property
    def x(self) -> FloatArray:
        """Of the columns, shape (n,) [m]."""
        return self.start + self.spacing * np.arange(self.tops.shape[-1])

    def top_at(self, x: float) -> FloatArray:
        """Return the column nearest to a place, shape (2, slices) [m]."""
        i = round((x - self.start) / self.spacing)
        if not 0 <= i < self.tops.shape[-1]:
            raise InputError("x", x, f"a place between {self.start:g} and {self.x[-1]:g} m")
        return self.tops[:, :, i]

    def copy(self) -> Walls:
        """Return walls of their own."""
        return Walls(self.start, self.spacing, self.tops.copy(), self.feet)
