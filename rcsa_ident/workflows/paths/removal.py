"""A tooling along a path through stock: what it takes out, where its edges are in the material, and what speaks against it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.shown import Shown
from rcsa_ident.setup.tooling import BareCutter, Tooling
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.toolpath.dexel import DexelField, Surface, memory_of
from rcsa_ident.toolpath.engagement import PathEngagement, engagement_along
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.solid import ToolSolid

#: Distance between lines over the tool's radius, and between places on the path.
CELL, STEP = 0.05, 0.1
#: Bytes of lines that nobody asked for, and those that are taken when told.
_MEMORY, _MOST_MEMORY = 5e8, 1.6e10
#: Places on a path, at most.
MOST_PLACES = 2_000_000
#: Volume that counts as none [m^3].
_NOTHING = 1e-12
#: Depth to which something that does not cut may stand in material [m].
_TOUCH = 1e-5

#: A block's lower and upper corner [m].
Block = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PathRemoval(Shown):
    """What a path has taken out of its stock.

    `path`: with all places between which moves were made
    `arc_volume` [m^3], shape (n,): that each arc takes out
    `part`: what is left
    `removed` [m^3]
    `updates`: lines of material that were met
    """

    path: ToolPath
    engagement: PathEngagement
    arc_volume: FloatArray
    part: DexelField
    removed: float
    updates: int
    seconds: float
    warnings: tuple[str, ...]

    def __str__(self) -> str:
        return f"{1e9 * self.removed:.4g} mm³ on {len(self.path)} places, {self.updates} updates of lines in {self.seconds:.2f} s"


def default_cell(radius: float, size: FloatArray) -> float:
    """Return the distance between lines for a tool's radius and a block's size, shape (3,) [m]: a twentieth of the radius.

    Where lines would take more than half a gigabyte they stand farther apart.

    Examples
    --------
    >>> default_cell(0.005, np.array([0.1, 0.1, 0.02])), round(1e3 * default_cell(0.001, np.array([1.0, 1.0, 0.2])), 2)
    (0.00025, 0.31)
    """
    cell = CELL * radius
    while memory_of(size, cell) > _MEMORY:
        cell *= 1.02
    return cell


def solid_of(tooling: Tooling) -> ToolSolid:
    """Return what a tooling sweeps up to its stickout; of a cutter alone, up to where its edges end."""
    return ToolSolid.of(tooling.cutter, None if isinstance(tooling, BareCutter) else tooling.assembly.stickout)


def field_of(tooling: Tooling, block: Block | None = None, surface: Surface | None = None, cell: float | None = None) -> DexelField:
    """Return stock for a tooling: a block, or the inside of a surface.

    `block`: pair of arrays, shape (3,) [m]
    `surface`: instead of the block
    `cell` [m]: between lines of material, by default a twentieth of the tool's radius (`default_cell`)
    Raises `InputError` if the lines would not fit into memory, or the surface is not closed.
    """
    if (block is None) == (surface is None):
        raise InputError("stock", "none" if block is None else "two", "a block or a surface")
    if block is not None:
        low, high = (np.asarray(corner, dtype=float) for corner in block)
    else:
        assert surface is not None
        low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    cell = default_cell(solid_of(tooling).radius, high - low) if cell is None else positive("cell", cell, "m")
    if memory_of(high - low, cell) > _MOST_MEMORY:
        found = f"{1e3 * cell:g} mm, for which the stock takes {memory_of(high - low, cell) / 1e9:.3g} GB"
        raise InputError("cell", found, f"cells for which it takes at most {_MOST_MEMORY / 1e9:g} GB")
    if surface is None:
        return DexelField.block(low, high, cell)
    field = DexelField.from_mesh(surface.points, surface.faces, cell)
    field.remarks = surface.remarks
    return field


def remove_along(
    tooling: Tooling,
    path: ToolPath,
    field: DexelField,
    step: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PathRemoval:
    """Return what a tooling takes out of its stock along a path.

    Parameters
    ----------
    tooling : Tooling
        Its cutter takes out what its outline sweeps up to the stickout; its holder should touch nothing.
    path : ToolPath
        Of its tip.
    field : DexelField
        The stock (`field_of`); it is cut.
    step : float or None [m]
        Between places at which the engagement is found, by default a tenth of the tool's radius.
    progress : callable or None
        Called with how many of how many moves are done.

    Raises
    ------
    InputError
        If path and stock lie so far apart that a unit or an origin is wrong.
    """
    solid = solid_of(tooling)
    warnings = list(_misplaced(solid, path, field.low, field.high))
    cell = float(field.cell.max())
    if cell > CELL * solid.radius * 1.001:
        warnings.append(
            f"the distance between lines, {1e3 * cell:.3g} mm, is more than a twentieth of the tool's radius: less exact angles"
        )
    step = STEP * solid.radius if step is None else positive("step", step, "m")
    if path.length / step > MOST_PLACES:
        raise InputError("step", f"{1e3 * step:g} mm on a path of {path.length:g} m", f"steps that make at most {MOST_PLACES} places")
    start = time.perf_counter()
    fine = path.resampled(step)
    before = field.volume
    sweep = Sweep(field, solid, fine)
    guard = _Guard(sweep, tooling)
    engagement = engagement_along(sweep, progress, guard.look)
    removed = before - field.volume
    seconds = time.perf_counter() - start
    warnings += [*_rapid(fine, engagement), *guard.warnings, *_odd_outcome(removed, before, warnings)]
    return PathRemoval(
        fine, engagement, engagement.volumes(solid), field, removed, sweep.updates, seconds, (*path.remarks, *field.remarks, *warnings)
    )


def _misplaced(solid: ToolSolid, path: ToolPath, low: FloatArray, high: FloatArray) -> list[str]:
    """What is odd about where path and stock lie, and how large the tool is beside the stock."""
    upright = np.all(path.axes[:, 2] > 1.0 - 1e-12)
    # what the tool reaches around its tips
    aside = np.full(3, solid.radius if upright else np.hypot(solid.radius, solid.length))
    first, last = path.places.min(axis=0) - aside * [1.0, 1.0, not upright], path.places.max(axis=0) + aside
    last[2] += solid.length
    gap = float(np.linalg.norm(np.maximum(np.maximum(low - last, first - high), 0.0)))
    size = float(np.linalg.norm(high - low))
    if gap > 3.0 * size:
        found = f"{1e3 * gap:.4g} mm away from a stock of {' x '.join(f'{1e3 * side:.4g}' for side in high - low)} mm"
        raise InputError("path", found, "one that comes near the stock; are both in millimetres, and from the same origin?")
    told = []
    if gap > 0.0:
        told.append(f"the path never meets the stock: the tool stays {1e3 * gap:.3g} mm or more away from it")
    if 2.0 * solid.radius > float(np.max(high[:2] - low[:2])):
        wide = " x ".join(f"{1e3 * side:.4g}" for side in high[:2] - low[:2])
        told.append(f"the tool, Ø{2e3 * solid.radius:.4g} mm, is larger than the stock, {wide} mm; is the stock in millimetres?")
    return told


def _odd_outcome(removed: float, before: float, told: Sequence[str]) -> list[str]:
    if removed <= _NOTHING and not any("never meets" in text for text in told):
        return ["the path never meets the stock: nothing is taken out"]
    if removed > 0.999 * before:
        return ["the path takes out all of the stock"]
    return []


def _rapid(path: ToolPath, engagement: PathEngagement) -> list[str]:
    """Rapid moves that take out material, each line of the program told once."""
    bad = np.flatnonzero(~path.cutting & (engagement.volume > _NOTHING))
    told: dict[str, float] = {}
    for move in bad:
        where = f"line {path.line[move + 1]}" if path.line[move + 1] else f"place {move + 1}"
        told[where] = told.get(where, 0.0) + float(engagement.volume[move])
    return [f"RAPID MOVE THROUGH MATERIAL at {where}: {1e9 * volume:.3g} mm³" for where, volume in _few(told)]


def _few(told: dict[str, float], most: int = 5) -> list[tuple[str, float]]:
    """The first ones, and how much all others come to."""
    items = list(told.items())
    if len(items) <= most:
        return items
    return [*items[:most], (f"{len(items) - most} more lines", sum(volume for _, volume in items[most:]))]


def _holder(assembly: ToolAssembly) -> list[tuple[str, float, float]]:
    """What stands above the tool: name, height of its lower face above the tip and radius, segment by segment."""
    heights = assembly.stickout + np.concatenate([[0.0], np.cumsum([each.length for each in assembly.holder])])
    return [("the holder", float(heights[k]), 0.5 * max(each.diameter, each.end)) for k, each in enumerate(assembly.holder)]


class _Guard:
    """Looks before each move whether what does not cut would stand in material: shank and holder of an upright tool.

    Of a leaning tool the holder's face is looked at on its rim.
    """

    def __init__(self, sweep: Sweep, tooling: Tooling) -> None:
        self._sweep = sweep
        self._parts = [] if isinstance(tooling, BareCutter) else _holder(tooling.assembly)
        solid = sweep.solid
        if solid.edge < solid.length - 1e-9:
            self._parts.insert(0, ("the shank above the edges", solid.edge, float(solid.radii[-1])))
        self._found: dict[str, int] = {}

    def look(self, move: int) -> None:
        """Look at where a move ends."""
        field, path = self._sweep.field, self._sweep.path
        place = path.places[move + 1]
        for name, height, radius in self._parts:
            if name in self._found:
                continue
            if self._sweep.upright[move]:
                reached = place[2] + height < field.high[2] - _TOUCH and _stands_over(field, place[:2], radius, place[2] + height)
            else:
                reached = self._sweep.stands_in(place, path.axes[move + 1], radius, height)
            if reached:
                self._found[name] = move

    @property
    def warnings(self) -> list[str]:
        """One for each part that touches."""
        path, told = self._sweep.path, []
        for name, move in self._found.items():
            x, y, z = 1e3 * path.places[move + 1]
            line = f", line {path.line[move + 1]}" if path.line[move + 1] else ""
            told.append(f"COLLISION: {name} stands in material from x {x:.4g}, y {y:.4g}, z {z:.4g} mm on{line}")
        return told


def _stands_over(field: DexelField, centre: FloatArray, radius: float, height: float) -> bool:
    """Whether a disc has material above its height."""
    origin, cell = field.lattice
    first = np.maximum(np.ceil((centre - radius - origin[:2]) / cell[:2]), 0).astype(int)
    last = np.minimum(np.floor((centre + radius - origin[:2]) / cell[:2]), np.array(field.shape[:2]) - 1).astype(int)
    if np.any(last < first):
        return False
    m, n = np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1)
    seg, count = field.segs[2][m[0] : m[-1] + 1, n[0] : n[-1] + 1], field.counts[2][m[0] : m[-1] + 1, n[0] : n[-1] + 1]
    within = np.hypot((origin[0] + m * cell[0] - centre[0])[:, None], origin[1] + n * cell[1] - centre[1]) < radius - _TOUCH
    held = np.arange(seg.shape[2]) < count[..., None]
    return bool(np.any(held & within[..., None] & (seg[..., 1] > height + _TOUCH)))
