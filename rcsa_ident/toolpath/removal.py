"""Material that a tool takes out of a field of dexels along a path."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.shown import Shown
from rcsa_ident.toolpath._kernels.dexel import cut_leaning, sweep_upright
from rcsa_ident.toolpath._kernels.engagement import distance_at
from rcsa_ident.toolpath._kernels.surface import last_move, moves_by_square
from rcsa_ident.toolpath.dexel import GRIDS, DexelField
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.solid import ToolSolid

#: Sine of the angle by which a tool stands upright.
_UPRIGHT = 1e-9
#: By which ridges between substeps may stand, by default, as a share of the distance between lines.
TOLERANCE = 0.01
#: Squares along the longer side of a surface whose moves are looked up, at most.
_SQUARES = 128
_AXES = tuple(np.array(axes) for axes in GRIDS)


@dataclass(slots=True, eq=False, repr=False)
class Sweep(Shown):
    """A tool that takes its swept volume out of a field, move by move.

    An upright tool whose outline rises to one peak is exact on level and vertical moves, a convex one on ramps, too; all other moves
    are cut up into places, within a tolerance.

    `field`: cut in place
    `tolerance` [m], default a hundredth of the distance between lines: by which the cut surface may stand off the exact one

    Examples
    --------
    A slot of 10 mm, 2 mm deep, through a block of 60 mm:

    >>> from rcsa_ident.cutting.cutter import Cutter
    >>> block = DexelField.block([0.0, 0.0, 0.0], [0.06, 0.03, 0.01], cell=0.25e-3)
    >>> before = block.volume
    >>> path = ToolPath(np.array([[-0.006, 0.015, 0.008], [0.066, 0.015, 0.008]]))
    >>> sweep = Sweep(block, ToolSolid.of(Cutter(2, 0.01)), path)
    >>> sweep.run()
    >>> round(1e9 * (before - block.volume), 3)
    1200.0
    """

    field: DexelField
    solid: ToolSolid
    path: ToolPath
    tolerance: float = None  # type: ignore[assignment]
    #: Lengths taken along x, y, z [m] and lines met, of each move.
    told: FloatArray = dataclass_field(init=False)
    #: Which moves are made by an upright tool in one piece, shape (k - 1,).
    upright: np.ndarray = dataclass_field(init=False)
    #: Of field and tool, as kernels take them.
    lattice: FloatArray = dataclass_field(init=False)
    outline: FloatArray = dataclass_field(init=False)
    #: The outline with as few points as the tolerance asks for.
    rough: FloatArray = dataclass_field(init=False)
    _peak: int = dataclass_field(init=False)
    #: The rough outline in convex pieces.
    _pieces: list[FloatArray] = dataclass_field(init=False)

    def __post_init__(self) -> None:
        default = TOLERANCE * float(self.field.cell.max())
        self.tolerance = default if self.tolerance is None else positive("tolerance", self.tolerance, "m")
        self.told = np.zeros((max(len(self.path) - 1, 0), 4))
        self.lattice, self.outline, self._peak = self.field.lattice, self.solid.outline, self.solid.peak
        rough = self.solid.coarser(0.1 * self.tolerance)
        self.rough = rough.outline
        self._pieces = (
            [self.rough] if rough.convex else [np.ascontiguousarray(self.rough[:, k : k + 2]) for k in range(rough.heights.size - 1)]
        )
        stands = (np.hypot(self.path.axes[:, 0], self.path.axes[:, 1]) < _UPRIGHT) & (self.path.axes[:, 2] > 0.0)
        ways = self.path.moves
        ramp = (ways[:, 2] != 0.0) & np.any(ways[:, :2] != 0.0, axis=1)
        self.upright = stands[1:] & stands[:-1] & (self.solid.convex | (self.solid.rises_to_one_peak & ~ramp))

    @property
    def updates(self) -> int:
        """Lines met so far."""
        return int(self.told[:, 3].sum())

    @property
    def shares(self) -> FloatArray:
        """Volume that each move has taken, shape (k - 1,) [m^3]: by the lines along its direction, which see a thin chip squarely."""
        way = self.path.moves**2
        weight = np.divide(
            way, way.sum(axis=1, keepdims=True), out=np.full_like(way, 1.0 / 3.0), where=way.sum(axis=1, keepdims=True) > 0.0
        )
        cell = self.field.cell
        area = np.prod(cell) / cell
        return np.sum(weight * self.told[:, :3] * area, axis=1)

    def run(self, start: int = 0, stop: int | None = None, been: bool = False) -> None:
        """Make the moves from `start` to before `stop`; `been` says that the tool has cut where the first one begins."""
        stop, upright = len(self.path) - 1 if stop is None else stop, self.upright
        while start < stop:
            behind = start + 1
            while behind < stop and upright[behind] == upright[start]:
                behind += 1
            if upright[start]:
                self._run_upright(start, behind, been)
            else:
                for move in range(start, behind):
                    self._run_leaning(move)
            start, been = behind, True

    def stands_in(self, tip: FloatArray, axis: FloatArray, radius: float, height: float) -> bool:
        """Return whether the rim of a disc about the tool's axis, at a height above its tip, is anywhere in material."""
        field, frame = self.field, frame_of(axis)
        for angle in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):
            point = tip + frame @ np.array([radius * np.cos(angle), radius * np.sin(angle), height])
            # the distance says how deep it stands, half a cell of doubt aside
            if distance_at(field.segs, field.counts, self.lattice, *point) > 0.5 * float(field.cell.max()):
                return True
        return False

    def _run_upright(self, start: int, stop: int, been: bool) -> None:
        field, moves = self.field, np.array([start, stop])
        while moves[0] < stop:
            done = sweep_upright(field.segs, field.counts, self.lattice, self.path.places, moves, self.outline, self._peak, been, self.told)
            if done < stop:
                # what is cut already stays so, and gives nothing a second time
                field.make_room()
                been = been or done > moves[0]
                moves[0] = done
            else:
                break

    def _run_leaning(self, move: int) -> None:
        poses = list(poses_between(self.path, move, self.solid, self.tolerance))
        for (tip, frame), (next_tip, next_frame) in pairwise(poses):
            tips, frames = np.stack([tip, next_tip]), np.stack([frame, next_frame])
            for piece in self._pieces:
                for grid, axes in enumerate(_AXES):
                    seg, count = self.field.segs[grid], self.field.counts[grid]
                    while not cut_leaning(seg, count, axes, self.lattice, frames, tips, piece, self.told[move]):
                        self.field.make_room()
                        seg = self.field.segs[grid]


def made_by(points: FloatArray, path: ToolPath, moves: np.ndarray, radius: float, near: float) -> np.ndarray:
    """Return the last of some moves that passed each point of a surface, shape (v,); -1 where none did.

    `points` [m], shape (v, 3)
    `path`: of an upright tool
    `moves`: ascending
    `radius` [m]: of the tool
    `near` [m]: how far a point may lie beside the tool's wall or below its tip
    """
    found = np.full(len(points), -1, dtype=np.int64)
    if not len(points) or not len(moves):
        return found
    points, places, reach = np.ascontiguousarray(points), np.ascontiguousarray(path.places), radius + near
    low = points[:, :2].min(axis=0)
    size = points[:, :2].max(axis=0) - low
    side = max(reach, float(size.max()) / _SQUARES)
    shape = (size / side).astype(np.int64) + 1
    sorting = places, np.asarray(moves), reach, low, side, shape
    start = np.zeros(int(np.prod(shape)) + 1, dtype=np.int64)
    moves_by_square(*sorting, start, np.empty(0, dtype=np.int64))
    start = np.cumsum(start)
    held = np.empty(start[-1], dtype=np.int64)
    if held.size:
        moves_by_square(*sorting, start, held)
        last_move(points, places, reach, near, low, side, shape, start, held, found)
    return found


def surface_made_by(
    field: DexelField, path: ToolPath, moves: np.ndarray, radius: float, most: int
) -> tuple[FloatArray, np.ndarray, np.ndarray]:
    """Return the surface that is left, as `DexelField.mesh`, and of each triangle the last of some moves that made it, shape (f,).

    `path`: of an upright tool
    `moves`: ascending
    `radius` [m]: of the tool
    `most`: triangles
    """
    points, faces = field.mesh(most)
    corners = points[faces]
    # a surface drawn through few lines stands off the one that was cut
    size = float(np.median(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1))) if len(faces) else 0.0
    near = 1.5 * max(size, float(field.cell.max()))
    return points, faces, made_by(corners.mean(axis=1), path, moves, radius, near)


def frame_of(axis: FloatArray) -> FloatArray:
    """Return two directions across an axis, and the axis, as columns, shape (3, 3)."""
    across = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
    across /= np.linalg.norm(across)
    return np.ascontiguousarray(np.stack([across, np.cross(axis, across), axis], axis=1))


def poses_between(path: ToolPath, move: int, solid: ToolSolid, tolerance: float) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield tips and frames so near to each other on a move that ridges between them stand no higher than a tolerance.

    Places a distance d apart leave ridges of d^2 / (8 r) where the tool has the radius of curvature r, and of d sin a cos a at most at a
    sharp corner, a the angle between the move and the plane across the axis. What turns moves the tool's ends, too.
    """
    (here, there), (one, two) = path.places[move : move + 2], path.axes[move : move + 2]
    ends = [there - here + height * (two - one) for height in (0.0, solid.length)]
    way = max(float(np.linalg.norm(each)) for each in ends)
    if way == 0.0:
        pieces = 1
    else:
        bent = solid.sharpest
        sharp = 0.0
        if bent == 0.0:
            sines = [abs(float(each @ axis)) / way for each in ends for axis in (one, two)]
            sharp = max(sine * np.sqrt(max(1.0 - sine**2, 0.0)) for sine in sines)
        fewest = (way / np.sqrt(8.0 * (bent or solid.radius) * tolerance), way * sharp / tolerance, 1.0)
        pieces = int(np.ceil(max(fewest)))
    for share in np.linspace(0.0, 1.0, pieces + 1):
        axis = (1.0 - share) * one + share * two
        size = np.linalg.norm(axis)
        if size < 1e-6:
            raise InputError(
                "axes", f"two that stand opposite at place {move + 2}", "axes that turn by less than half a turn between places"
            )
        yield here + share * (there - here), frame_of(axis / size)
