"""Between which angles, at which heights, a tool is in the material all along a path, and how thick its chips are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.cutting.conditions import EngagementMap
from rcsa_ident.toolpath._kernels.engagement import distance_at, engage_upright, leaning_arcs
from rcsa_ident.toolpath._kernels.layer import layer_arcs, material_ahead
from rcsa_ident.toolpath.removal import Sweep, frame_of
from rcsa_ident.toolpath.solid import ToolSolid

#: A move that is shorter has no direction [m].
_NOWHERE = 1e-9
#: Slices of an upright tool at a place, at most: deeper cuts have thicker ones.
_MOST_SLICES = 16
#: Arcs of a place, at most.
_MOST_ARCS = 4096
_TURN = 2.0 * np.pi


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PathEngagement(Shown):
    """Where a tool is in the material on the moves of a path: before each move, what its feed is about to cut.

    Angles are immersion angles, clockwise from the normal Y of the move seen from the spindle; the move's part across the tool's axis is X.

    `move`: array of int, shape (n,); of each arc the move that it belongs to, ascending; move i goes from place i to place i + 1 of the
        path
    `height` [m], shape (n,): of the slice across the tool's axis, above its tip; never falling within a move
    `start`, `end` [rad], shape (n,): 0 to a full turn; arcs through 0 are two
    `extent` [m], shape (k, 2): between which heights above the tip each move meets material; where it meets none, the first is above the
        second
    `feed_rise` [rad], shape (k,): by which each move climbs along the tool's axis
    `volume` [m^3], shape (k,): that each move takes out
    """

    move: np.ndarray
    height: FloatArray
    start: FloatArray
    end: FloatArray
    extent: FloatArray
    feed_rise: FloatArray
    volume: FloatArray

    def __post_init__(self) -> None:
        for name in ("height", "start", "end", "extent", "feed_rise", "volume"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "move", frozen(self.move, dtype=np.intp))

    def arcs_of(self, move: int) -> slice:
        """Return which arcs belong to a move."""
        return slice(int(np.searchsorted(self.move, move)), int(np.searchsorted(self.move, move, side="right")))

    def at(self, move: int) -> EngagementMap | None:
        """Return the engagement of a move as a cut takes it; None where no edge is in the material.

        Below the lowest slice and above the highest one the arcs go on to where the material begins and ends.
        """
        own = self.arcs_of(move)
        z, start, end = self.height[own], self.start[own], self.end[own]
        if not z.size:
            return None
        low, high = max(float(self.extent[move, 0]), 0.0), float(self.extent[move, 1])
        parts = [(z, start, end)]
        if low < z[0]:
            first = z == z[0]
            parts.insert(0, (np.full(np.count_nonzero(first), low), start[first], end[first]))
        if high > z[-1]:
            last = z == z[-1]
            parts.append((np.full(np.count_nonzero(last), high), start[last], end[last]))
        z, start, end = (np.concatenate(each) for each in zip(*parts, strict=True))
        return EngagementMap(z, start, end, float(self.feed_rise[move]))

    def thickness(self, move: int) -> FloatArray:
        """Return the height of the material that each arc of a move stands for, shape (arcs,) [m]: up to half way to the slices beside."""
        z = self.height[self.arcs_of(move)]
        heights = np.unique(z)
        if not heights.size:
            return np.zeros(0)
        edges = np.concatenate([[max(self.extent[move, 0], 0.0)], 0.5 * (heights[1:] + heights[:-1]), [self.extent[move, 1]]])
        return np.maximum(np.diff(edges), 0.0)[np.searchsorted(heights, z)]

    def volumes(self, solid: ToolSolid) -> FloatArray:
        """Return the volume that each arc takes out, shape (n,) [m^3]: that of its move, shared by what passes through the arcs.

        A floor that is lowered counts with the arcs above it; where there are none, its volume is its move's alone.
        """
        radius = solid.radius_at(self.height)
        rise = self.feed_rise[self.move]
        slope = solid.slope_at(self.height)
        flow = radius * (np.cos(rise) * (np.cos(self.start) - np.cos(self.end)) - slope * np.sin(rise) * (self.end - self.start))
        moves = np.unique(self.move)
        flow = np.maximum(flow, 0.0) * (np.concatenate([self.thickness(k) for k in moves]) if moves.size else 0.0)
        total = np.bincount(self.move, flow, minlength=self.volume.size)
        return np.divide(flow * self.volume[self.move], total[self.move], out=np.zeros_like(flow), where=total[self.move] > 0.0)

    def __str__(self) -> str:
        cutting = np.unique(self.move).size
        return f"{self.move.size} arcs on {cutting} of {self.volume.size} moves, {1e9 * float(self.volume.sum()):.4g} mm³"


def engagement_along(
    sweep: Sweep, progress: Callable[[int, int], None] | None = None, look: Callable[[int], None] | None = None
) -> PathEngagement:
    """Return the engagement on all moves of a sweep, which is run: before each move it is found, then the move is made.

    Parameters
    ----------
    sweep : Sweep
        Fresh; its field is cut.
    progress : callable or None
        Called with how many of how many moves are done.
    look : callable or None
        Called with the number of each move before it is made.

    Notes
    -----
    Volumes of moves are shares of the field's: what the lines along each move lose says how it is shared. The circles of an upright
    tool cross the lines at places that are known exactly, and a wall between two of them is the straight line through the nearest
    ends of lines; those of a leaning one are found by distances between the nodes of the lattice.

    Examples
    --------
    Half-immersion down-milling, 2 mm deep: from 90 to 180 degrees

    >>> from rcsa_ident.cutting.cutter import Cutter
    >>> from rcsa_ident.toolpath.dexel import DexelField
    >>> from rcsa_ident.toolpath.path import ToolPath
    >>> block = DexelField.block([0.0, 0.0, 0.0], [0.03, 0.02, 0.01], cell=0.25e-3)
    >>> path = ToolPath(np.array([[-0.006, 0.02, 0.008], [0.015, 0.02, 0.008], [0.0151, 0.02, 0.008]]))
    >>> found = engagement_along(Sweep(block, ToolSolid.of(Cutter(2, 0.01)), path)).at(1)
    >>> np.degrees([found.start, found.end]).round(2)[:, 0].tolist(), (1e3 * found.z[[0, -1]]).round(6).tolist()
    ([90.0, 180.0], [0.0, 2.0])
    """
    path, field, axes = sweep.path, sweep.field, sweep.path.axes
    moves = len(path) - 1
    before = field.volume
    upright, ways, lengths = sweep.upright, path.moves, path.lengths
    extent, rise = np.tile([np.inf, -np.inf], (max(moves, 0), 1)), np.zeros(max(moves, 0))
    found: list[tuple[int, FloatArray]] = []
    rows, ends = np.empty((_MOST_ARCS, 3)), np.empty(2)
    for move in range(moves):
        if lengths[move] > _NOWHERE:
            feed = ways[move] / lengths[move]
            rise[move] = np.arcsin(np.clip(feed @ axes[move], -1.0, 1.0))
            held = _upright(sweep, move, feed, lengths[move], rows, ends) if upright[move] else _leaning(sweep, move, feed, rows, ends)
            extent[move] = ends
            if held:
                found.append((move, _within_a_turn(rows[:held])))
        if look is not None:
            look(move)
        sweep.run(move, move + 1, been=move > 0)
        if progress is not None and (move % 100 == 99 or move == moves - 1):
            progress(move + 1, moves)
    shares = sweep.shares
    total = before - field.volume
    volume = shares * (total / shares.sum()) if shares.sum() > 0.0 else shares
    all_rows = np.concatenate([each for _, each in found]) if found else np.empty((0, 3))
    which = np.repeat([move for move, _ in found], [len(each) for _, each in found]) if found else np.empty(0, dtype=int)
    return PathEngagement(which, all_rows[:, 0], all_rows[:, 1], all_rows[:, 2], extent, rise, volume)


def _upright(sweep: Sweep, move: int, feed: FloatArray, length: float, rows: FloatArray, extent: FloatArray) -> int:
    field, solid = sweep.field, sweep.solid
    here, cell = sweep.path.places[move], float(sweep.lattice[1].min())
    step = min(0.25 * cell, length)
    tips = np.stack([here, here + step * feed])
    # the material's top and bottom, a cell ahead
    probe = tips[1].copy()
    probe[:2] += max(cell - step, 0.0) * feed[:2]
    extent[:] = material_ahead(field.segs[2], field.counts[2], sweep.lattice, probe, sweep.rough, solid.edge)
    if not extent[1] > extent[0]:
        return 0
    held = engage_upright(field.segs, field.counts, sweep.lattice, tips, sweep.outline, solid.edge, feed, _MOST_SLICES, rows, extent)
    if held < 0:
        # a layer between two planes has one slice in its middle
        middle, level, arcs = 0.5 * (extent[0] + extent[1]), np.linalg.norm(feed[:2]), np.empty((16, 2))
        radius = float(solid.radius_at(middle))
        held = 0
        if radius > 0.0 and level > 1e-9:
            centre = here + middle * sweep.path.axes[move]
            held = layer_arcs(field.segs[2], field.counts[2], sweep.lattice, centre, radius, feed[:2] / level, arcs)
        rows[:held, 0], rows[:held, 1:] = middle, arcs[:held]
    return int(held)


def _leaning(sweep: Sweep, move: int, feed: FloatArray, rows: FloatArray, extent: FloatArray) -> int:
    """Slices a cell apart along the tool's axis, as long as they can meet the field."""
    field, cell, axis = sweep.field, float(sweep.field.cell.min()), sweep.path.axes[move]
    tip = sweep.path.places[move] + 0.5 * cell * feed
    corners = np.array([[(field.low, field.high)[(k >> a) & 1][a] for a in range(3)] for k in range(8)])
    # as far as a disc reaches across the field's corners
    reach = (corners - tip) @ axis
    heights = np.arange(0.5 * cell, sweep.solid.edge, cell)
    heights = heights[(heights > reach.min()) & (heights < reach.max())]
    frame = _feed_frame(axis, feed)
    held = _slices(sweep, tip, frame, feed, heights, rows)
    extent[:] = np.inf, -np.inf
    if held:
        extent[:] = _end_along(sweep, tip, frame, rows[0], -cell), _end_along(sweep, tip, frame, rows[held - 1], cell)
    return held


def _end_along(sweep: Sweep, tip: FloatArray, frame: FloatArray, row: FloatArray, way: float) -> float:
    """Height above the tip at which the material in front of an arc ends, on the way to the next slice, which has none."""
    field, solid, middle = sweep.field, sweep.solid, 0.5 * (row[1] + row[2])
    heights = np.clip([row[0], row[0] + way], 0.0, solid.edge)
    outwards = np.sin(middle) * frame[:, 0] + np.cos(middle) * frame[:, 1]
    points = tip + heights[:, None] * frame[:, 2] + solid.radius_at(heights)[:, None] * outwards
    here, there = (distance_at(field.segs, field.counts, sweep.lattice, *point) for point in points)
    if there >= 0.0 or here <= 0.0:
        return float(heights[1] if there > 0.0 else 0.5 * heights.sum())
    return float(heights[0] + (heights[1] - heights[0]) * here / (here - there))


def _slices(sweep: Sweep, tip: FloatArray, frame: FloatArray, feed: FloatArray, heights: FloatArray, rows: FloatArray) -> int:
    """Write the arcs at heights above a tip as rows; return how many."""
    field, arcs, held = sweep.field, np.empty((16, 2)), 0
    way = np.array([feed @ frame[:, 0], feed @ frame[:, 2]])
    for height, radius, slope in zip(heights, sweep.solid.radius_at(heights), sweep.solid.slope_at(heights), strict=True):
        if radius <= 0.0:
            continue
        centre = tip + height * frame[:, 2]
        count = leaning_arcs(field.segs, field.counts, sweep.lattice, centre, frame, float(radius), way, float(slope), arcs)
        count = min(count, len(rows) - held)
        rows[held : held + count, 0], rows[held : held + count, 1:] = height, arcs[:count]
        held += count
    return held


def _feed_frame(axis: FloatArray, feed: FloatArray) -> FloatArray:
    """Return the feed's direction across an axis, the normal, and the axis, as columns; any two across where it goes along the axis."""
    across = feed - (feed @ axis) * axis
    level = np.linalg.norm(across)
    if level < 1e-9:
        return frame_of(axis)
    return np.ascontiguousarray(np.stack([across / level, np.cross(axis, across / level), axis], axis=1))


def _within_a_turn(rows: FloatArray) -> FloatArray:
    """Rows of height, start and end with angles from 0 to a turn: arcs through 0 become two."""
    full = rows[:, 2] - rows[:, 1] >= _TURN - 1e-9
    start = np.where(full, 0.0, np.mod(rows[:, 1], _TURN))
    # an angle that rounding put below 0
    start = np.where(start > _TURN - 1e-9, 0.0, start)
    end = np.where(full, _TURN, start + rows[:, 2] - rows[:, 1])
    through = end > _TURN + 1e-9
    once = np.stack([rows[:, 0], start, np.minimum(end, _TURN)], axis=1)
    if not np.any(through):
        return once
    again = np.stack([rows[through, 0], np.zeros(np.count_nonzero(through)), end[through] - _TURN], axis=1)
    both = np.concatenate([once, again])
    return both[np.lexsort((both[:, 1], both[:, 0]))]


def chip_between_circles(shift: FloatArray, radius: float, angle: FloatArray) -> FloatArray:
    """Return the chip thickness along a tooth's radius, between its circle and that of the tooth before [bauer2013].

    rho = D n + sqrt(R^2 - |D|^2 + (D n)^2), h = max(0, R - rho), n the direction of the angle.

    `shift` [m], shape (2,): D, from where the centre is to where it was when the tooth before cut, along feed X and normal Y
    `radius` [m]
    `angle` [rad]: immersion angles, clockwise from Y

    Examples
    --------
    Feed of 0.1 mm per tooth with a radius of 5 mm: f sin(phi), and a little more

    >>> (1e3 * chip_between_circles(np.array([-1e-4, 0.0]), 0.005, np.radians([0.0, 30.0, 90.0]))).round(5).tolist()
    [0.001, 0.05075, 0.1]
    """
    shift = np.asarray(shift, dtype=float)
    if not np.hypot(*shift) < radius:
        raise InputError("shift", f"{1e3 * np.hypot(*shift):g} mm", f"less than the radius, {1e3 * radius:g} mm")
    outwards = shift[0] * np.sin(angle) + shift[1] * np.cos(angle)
    return np.maximum(radius - outwards - np.sqrt(radius**2 - shift @ shift + outwards**2), 0.0)


def chip_thickness(solid: ToolSolid, feed: FloatArray, angle: FloatArray, height: FloatArray) -> FloatArray:
    """Return the chip thickness square to the edge, of a feed per tooth in any direction: its part along the surface's normal.

    `feed` [m], shape (3,): per tooth, along X, Y and the tool's axis, towards the spindle
    `angle`, `height`: arrays that go together [rad, m]; immersion angles, and heights above the tip

    Examples
    --------
    A ball of 10 mm, level, at half of its radius:

    >>> from rcsa_ident.cutting.cutter import Cutter
    >>> from rcsa_ident.cutting.profile import Profile
    >>> ball = ToolSolid.of(Cutter(2, 0.01, profile=Profile.ball(0.01)))
    >>> (1e3 * chip_thickness(ball, np.array([1e-4, 0.0, 0.0]), np.radians([30.0, 90.0]), np.array([0.0025]))).round(3).tolist()
    [0.043, 0.087]
    """
    slope = solid.slope_at(height)
    level = feed[0] * np.sin(angle) + feed[1] * np.cos(angle)
    return np.maximum((level - slope * feed[2]) / np.sqrt(1.0 + slope**2), 0.0)
