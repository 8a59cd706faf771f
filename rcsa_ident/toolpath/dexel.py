"""A workpiece as lines of material along three directions: tri-dexels [vanhook1986] [muller2003]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Shown
from rcsa_ident.toolpath._kernels.surface import crossings, nodes_and_rest, occupied, segments_between, surface_net

#: Of each grid the axis of its lines and those of its two indices.
GRIDS = ((0, 2, 1), (1, 2, 0), (2, 0, 1))
#: Segments that a line has room for in the beginning.
_ROOM = 2
#: Nodes of the lattice, at most; beyond, indices and memory are no longer those of a workpiece.
MOST_NODES = 2e10
#: Nodes that a surface is drawn through, at most; finer fields leave out lines.
_DRAWN = 3e7
#: Bytes of a line: two segments and their number.
_LINE = 16 * _ROOM + 2


class Surface(NamedTuple):
    """A closed surface of triangles.

    `points` [m], shape (v, 3)
    `faces`: array of int, shape (f, 3); counterclockwise from outside
    `remarks`: what was remarked as its file was read
    """

    points: FloatArray
    faces: np.ndarray
    remarks: tuple[Remark, ...] = ()


def memory_of(size: FloatArray, cell: float) -> int:
    """Return the bytes that a block of a size, shape (3,) [m], takes at a distance between lines [m].

    Examples
    --------
    >>> round(memory_of(np.array([0.2, 0.2, 0.05]), 0.25e-3) / 1e6)
    33
    """
    n = _nodes(np.asarray(size), cell)
    return int(_LINE * (n[0] * n[1] + n[1] * n[2] + n[0] * n[2]))


def _nodes(size: FloatArray, cell: float) -> FloatArray:
    """Nodes along each side; of absurdly small cells 1e100, so that what is computed of them are numbers that can be compared."""
    with np.errstate(over="ignore"):
        return np.clip(np.ceil(size / cell - 1e-9), 1.0, 1e100)


@dataclass(slots=True, eq=False, repr=False)
class DexelField(Shown):
    """Material along three grids of lines through the nodes of one lattice.

    The lattice fills a block evenly, each node in the middle of its cell, so that a block has its own volume. What removes material
    shortens the lines in place.

    `low`, `high` [m], shape (3,): of the block that the lattice fills
    `shape`: tuple of three int, nodes along x, y, z
    `segs`: tuple of three arrays, shape (m, n, room, 2) [m]; where the segments of each line begin and end, of the lines along x, which
        stand by (z, y), along y, by (z, x), and along z, by (x, y)
    `counts`: tuple of three arrays of int, shape (m, n); segments of each line
    `remarks`: what was remarked as the file was read from which it came

    Examples
    --------
    A block of 40 x 20 x 10 mm:

    >>> block = DexelField.block([0.0, 0.0, 0.0], [0.04, 0.02, 0.01], cell=0.5e-3)
    >>> block.shape, round(1e9 * block.volume, 6)
    ((80, 40, 20), 8000.0)
    """

    low: FloatArray
    high: FloatArray
    shape: tuple[int, int, int]
    segs: tuple[FloatArray, FloatArray, FloatArray]
    counts: tuple[FloatArray, FloatArray, FloatArray]
    remarks: tuple[Remark, ...] = ()

    @classmethod
    def block(cls, low: FloatArray, high: FloatArray, cell: float) -> DexelField:
        """Return a full block. `low`, `high` [m], shape (3,). `cell` [m]: between lines, at most."""
        field = cls._empty(low, high, cell)
        for (along, _, _), seg, count in zip(GRIDS, field.segs, field.counts, strict=True):
            seg[:, :, 0, 0], seg[:, :, 0, 1] = field.low[along], field.high[along]
            count[:] = 1
        return field

    @classmethod
    def from_mesh(cls, points: FloatArray, faces: FloatArray, cell: float) -> DexelField:
        """Return the inside of a closed surface of triangles.

        `points` [m], shape (v, 3)
        `faces`: array of int, shape (f, 3); counterclockwise from outside
        `cell` [m]: between lines, at most
        Raises `InputError` if the surface is not closed: says how many edges belong to one triangle alone.
        """
        points, faces = np.ascontiguousarray(points, dtype=float), np.ascontiguousarray(faces, dtype=np.int64)
        check_closed(points, faces)
        field = cls._empty(points.min(axis=0), points.max(axis=0), cell)
        origin, step = field.lattice
        size = np.array(field.shape)
        segs = []
        for axes, count in zip(GRIDS, field.counts, strict=True):
            told = np.array(axes)
            start = np.zeros(count.size + 1, dtype=np.int64)
            crossings(points, faces, told, origin, step, size, start, np.empty(0), np.empty(0, dtype=np.int8))
            start = np.cumsum(start)
            place, sense = np.empty(start[-1]), np.empty(start[-1], dtype=np.int8)
            if start[-1]:
                crossings(points, faces, told, origin, step, size, start, place, sense)
            room = max(_ROOM, segments_between(start, place, sense, np.empty((*count.shape, 0, 2)), count))
            seg = np.zeros((*count.shape, room, 2))
            segments_between(start, place, sense, seg, count)
            segs.append(seg)
        field.segs = (segs[0], segs[1], segs[2])
        return field

    @classmethod
    def _empty(cls, low: FloatArray, high: FloatArray, cell: float) -> DexelField:
        low, high = np.array(low, dtype=float), np.array(high, dtype=float)
        if low.shape != (3,) or high.shape != (3,) or not np.all(np.isfinite([low, high])) or not np.all(high > low):
            found = f"{(1e3 * low).tolist()} to {(1e3 * high).tolist()} mm"
            raise InputError("stock", found, "a block whose corners are finite, the second one above the first in x, y and z")
        shape = _nodes(high - low, positive("cell", cell, "m"))
        if np.prod(shape) > MOST_NODES:
            raise InputError("cell", f"{1e3 * cell:g} mm", f"larger cells: the stock would have {np.prod(shape):.2g} of them")
        nx, ny, nz = (int(n) for n in shape)
        sizes = ((nz, ny), (nz, nx), (nx, ny))
        segs = tuple(np.zeros((*size, _ROOM, 2)) for size in sizes)
        counts = tuple(np.zeros(size, dtype=np.int16) for size in sizes)
        return cls(low, high, (nx, ny, nz), segs, counts)  # type: ignore[arg-type]

    @property
    def cell(self) -> FloatArray:
        """Between lines along x, y, z, shape (3,) [m]."""
        return (self.high - self.low) / self.shape

    @property
    def lattice(self) -> FloatArray:
        """The first node, and from node to node, shape (2, 3) [m]."""
        return np.stack([self.low + 0.5 * self.cell, self.cell])

    @property
    def memory(self) -> int:
        """Of all lines [bytes]."""
        return sum(each.nbytes for each in (*self.segs, *self.counts))

    @property
    def volume(self) -> float:
        """Of the material [m^3].

        The cells of all nodes in the material, and what lies between them and the surface, which the ends of the lines know: exact to the
        first order for walls, floors and slopes however they lie to the lattice.
        """
        nodes, rest = 0, 0.0
        step = self.cell
        for (along, one, two), seg, count in zip(GRIDS, self.segs, self.counts, strict=True):
            found = nodes_and_rest(seg, count, self.low[along] + 0.5 * step[along], step[along], step[one], step[two])
            # all grids go through the same nodes
            nodes, rest = found[0], rest + found[1]
        return float((nodes + rest) * np.prod(step))

    def copy(self) -> DexelField:
        """Return the same material, to be cut on its own."""
        segs, counts = (tuple(each.copy() for each in arrays) for arrays in (self.segs, self.counts))
        return DexelField(self.low, self.high, self.shape, segs, counts)  # type: ignore[arg-type]

    def make_room(self) -> None:
        """Give every line room for twice as many segments."""
        self.segs = tuple(np.concatenate([seg, np.zeros_like(seg)], axis=2) for seg in self.segs)  # type: ignore[assignment]

    def height_map(self) -> FloatArray:
        """Return the highest material of each line along z, shape (nx, ny) [m]; nan where there is none."""
        seg, count = self.segs[2], self.counts[2]
        last = np.maximum(count.astype(np.intp) - 1, 0)[:, :, None, None]
        return np.where(count > 0, np.take_along_axis(seg[..., 1:], last, axis=2)[:, :, 0, 0], np.nan)

    def heights_beside(self, start: FloatArray, stop: FloatArray, reach: float, level: float) -> tuple[float, float] | None:
        """Return between which heights there is material above a level near a line in the plane, [m]; None where there is none.

        `start`, `stop` [m], shape (2,)
        `reach` [m]: from the line
        `level` [m]
        """
        ends = np.stack([start, stop])
        first, step = self.lattice[0, :2], self.lattice[1, :2]
        low = np.maximum(np.ceil((ends.min(axis=0) - reach - first) / step), 0).astype(int)
        high = np.minimum(np.floor((ends.max(axis=0) + reach - first) / step), np.array(self.shape[:2]) - 1).astype(int)
        if np.any(high < low):
            return None
        x, y = (first[k] + step[k] * np.arange(low[k], high[k] + 1) for k in range(2))
        way = ends[1] - ends[0]
        square = float(way @ way)
        along = (x[:, None] - start[0]) * way[0] + (y - start[1]) * way[1]
        share = np.clip(along / square, 0.0, 1.0) if square > 0.0 else np.zeros_like(along)
        near = np.hypot(x[:, None] - start[0] - share * way[0], y - start[1] - share * way[1]) <= reach
        seg, count = (each[low[0] : high[0] + 1, low[1] : high[1] + 1] for each in (self.segs[2], self.counts[2]))
        held = near[..., None] & (np.arange(seg.shape[2]) < count[..., None]) & (seg[..., 1] > level)
        if not held.any():
            return None
        return max(float(seg[..., 0][held].min()), level), float(seg[..., 1][held].max())

    def mesh(self, most: int | None = None) -> tuple[FloatArray, FloatArray]:
        """Return the material's surface: points, shape (v, 3) [m], and triangles, shape (f, 3), counterclockwise from outside.

        Dual contours [ju2002]: a point in each cell of the lattice that the surface goes through, nearest to the planes in which it
        crosses the cell's edges, so that edges stay sharp. It is closed whatever was cut, and leaves lines out where it would get too
        large, or have more triangles than `most`.
        """
        every = max(1, int(np.ceil((np.prod(np.array(self.shape, dtype=float)) / _DRAWN) ** (1.0 / 3.0))))
        while True:
            shape = [(n - 1) // every + 1 for n in self.shape]
            filled = np.zeros([n + 2 for n in shape], dtype=np.bool_)
            lattice = self.lattice
            occupied(self.segs[2], self.counts[2], lattice[0, 2], lattice[1, 2], every, filled)
            given = self.segs, self.counts, lattice, every, filled
            points, triangles = surface_net(*given, np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
            if most is None or triangles <= most or max(shape) == 1:
                break
            # there are as many as squares of this size on the surface
            every = max(every + 1, int(every * np.sqrt(triangles / most)))
        vertices, faces = np.empty((points, 3)), np.empty((triangles, 3), dtype=np.int64)
        if points:
            surface_net(*given, vertices, faces)
        return vertices, faces

    def __str__(self) -> str:
        nx, ny, nz = self.shape
        return f"material of {1e9 * self.volume:.4g} mm³ on {nx} x {ny} x {nz} lines"


def check_closed(points: FloatArray, faces: FloatArray) -> None:
    """Refuse a surface of triangles that is not closed, or whose triangles do not all face outwards.

    Raises `InputError`: says how many edges stand alone.
    """
    if points.ndim != 2 or points.shape[1:] != (3,) or faces.ndim != 2 or faces.shape[1:] != (3,) or not len(faces):
        raise InputError("mesh", [points.shape, faces.shape], "points, shape (v, 3), and one or more triangles, shape (f, 3)")
    if not np.all(np.isfinite(points)):
        raise InputError("mesh", "a point that is not finite", "finite coordinates")
    if faces.min() < 0 or faces.max() >= len(points):
        raise InputError("mesh", f"a triangle with point {faces.max()}", f"points 0 to {len(points) - 1}")
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    keys, ways = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    # each edge is passed as often one way as the other
    balance = np.zeros(len(keys), dtype=np.int64)
    np.add.at(balance, ways.ravel(), np.where(edges[:, 0] < edges[:, 1], 1, -1))
    alone = int(np.count_nonzero(balance))
    if alone:
        raise InputError(
            "mesh", f"a surface with {alone} edges that only one triangle has, or two that face unlike sides", "a closed surface"
        )
    corners = points[faces]
    enclosed = float(np.sum(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * (corners[:, 0] - points[0])) / 6.0)
    if not enclosed > 0.0:
        raise InputError("mesh", f"a surface around {1e9 * enclosed:.4g} mm³", "triangles that are counterclockwise from outside")
