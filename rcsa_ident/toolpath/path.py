"""Where a tool's tip goes, move by move."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import Remark

#: Feed of a rapid move: as fast as the machine goes.
RAPID = np.inf
#: Moves that are shorter count as none [m].
_NOWHERE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class ToolPath:
    """Where a tool's tip goes, on straight moves from place to place.

    What is told of a move stands with the place that it ends at; of the first place it says how the tool came there, which nobody asks.

    Parameters
    ----------
    places : array, shape (k, 3) [m]
    axes : array, shape (k, 3), default upwards
        Of the tool, from its tip into the spindle; made unit vectors.
    feed : array, shape (k,) [m/s], default not told
        `RAPID` where the move is a rapid one, nan where nobody told.
    speed : array, shape (k,) [rad/s], default not told
        Of the spindle; 0 where it stands, nan where nobody told.
    tool : array of int, shape (k,), default 0
        Number of the tool in its magazine.
    line : array of int, shape (k,), default 0
        Of the file that the move stands in; several share one where an arc was cut up.
    remarks : tuple of Remark
        What its file does not state and was assumed.

    Examples
    --------
    Two moves around a corner at 3 m/min:

    >>> path = ToolPath(np.array([[0.0, 0.0, 0.0], [0.09, 0.0, 0.0], [0.09, 0.03, 0.0]]), feed=np.full(3, 0.05))
    >>> path.length, path.times.round(6).tolist(), len(path.resampled(0.03))
    (0.12, [0.0, 1.8, 2.4], 5)
    """

    places: FloatArray
    axes: FloatArray = field(default=None)  # type: ignore[arg-type]
    feed: FloatArray = field(default=None)  # type: ignore[arg-type]
    speed: FloatArray = field(default=None)  # type: ignore[arg-type]
    tool: np.ndarray = field(default=None)  # type: ignore[arg-type]
    line: np.ndarray = field(default=None)  # type: ignore[arg-type]
    remarks: tuple[Remark, ...] = ()

    def __post_init__(self) -> None:
        places = frozen(self.places)
        if places.ndim != 2 or places.shape[1] != 3 or not len(places) or not np.all(np.isfinite(places)):
            raise InputError("places", np.shape(places), "one or more finite places, shape (k, 3) [m]")
        object.__setattr__(self, "places", places)
        axes = np.tile([0.0, 0.0, 1.0], (len(places), 1)) if self.axes is None else np.asarray(self.axes, dtype=float)
        size = np.linalg.norm(axes, axis=-1, keepdims=True)
        if axes.shape != places.shape or not np.all(size > 0.0) or not np.all(np.isfinite(axes)):
            raise InputError("axes", np.shape(axes), f"a direction for each place, shape {places.shape}")
        object.__setattr__(self, "axes", frozen(axes / size))
        for name, default, kind in (("feed", np.nan, float), ("speed", np.nan, float), ("tool", 0, int), ("line", 0, int)):
            given = getattr(self, name)
            values = np.full(len(places), default, dtype=kind) if given is None else np.array(given, dtype=kind)
            if values.shape != (len(places),) or np.any(values < 0):
                raise InputError(name, np.shape(values), f"a value of 0 or more for each place, shape {(len(places),)}")
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        return len(self.places)

    @property
    def moves(self) -> FloatArray:
        """From each place to the next one, shape (k - 1, 3) [m]."""
        return np.diff(self.places, axis=0)

    @property
    def lengths(self) -> FloatArray:
        """Of the moves, shape (k - 1,) [m]."""
        return np.linalg.norm(self.moves, axis=1)

    @property
    def length(self) -> float:
        """Of the whole path [m]."""
        return float(self.lengths.sum())

    @property
    def cutting(self) -> np.ndarray:
        """Which moves are made at a feed, shape (k - 1,)."""
        return ~np.isinf(self.feed[1:])

    @property
    def beside_cutting(self) -> np.ndarray:
        """At which places a move at a feed begins or ends, shape (k,)."""
        cutting = self.cutting
        return np.append(cutting, False) | np.append(False, cutting)

    @property
    def times(self) -> FloatArray:
        """When the tool is at each place, shape (k,) [s]: corners are not slowed down for, rapid moves take no time.

        Raises
        ------
        InputError
            If a move has no feed.
        """
        lengths, feed = self.lengths, self.feed[1:]
        untold = np.flatnonzero((lengths > _NOWHERE) & ~(feed > 0.0))
        if untold.size:
            k = int(untold[0]) + 1
            where = f"line {self.line[k]}" if self.line[k] else f"place {k + 1}"
            raise InputError("feed", f"none at {where}", "a feed above 0 for every move")
        taken = np.divide(lengths, feed, out=np.zeros_like(lengths), where=lengths > _NOWHERE)
        return np.concatenate([[0.0], np.cumsum(taken)])

    def resampled(self, step: float, rapid: bool = True) -> ToolPath:
        """Return the same path with places nowhere further apart than a step [m]; all places of this one stay.

        Between them a tool's axis turns evenly with the way. Rapid moves stay whole where `rapid` is false.
        """
        pieces = np.maximum(np.ceil(self.lengths / positive("step", step, "m") - 1e-9).astype(int), 1)
        if not rapid:
            pieces[~self.cutting] = 1
        # the move that each new place belongs to, and how far along it stands
        move = np.repeat(np.arange(pieces.size), pieces)
        share = (np.arange(move.size) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 1.0) / pieces[move]
        # the end of a move is its place itself, not what rounding makes of it
        share = share[:, None]
        places = np.where(share == 1.0, self.places[move + 1], self.places[move] + share * self.moves[move])
        axes = np.where(share == 1.0, self.axes[move + 1], self.axes[move] + share * (self.axes[move + 1] - self.axes[move]))
        of = np.concatenate([[0], move + 1])
        return ToolPath(
            np.concatenate([self.places[:1], places]),
            np.concatenate([self.axes[:1], axes]),
            *(values[of] for values in (self.feed, self.speed, self.tool, self.line)),
        )

    def through(self, places: FloatArray) -> ToolPath:
        """Return the path with other places, shape (k, 3) [m], and all else as it is: a compensated one."""
        return replace(self, places=places)
