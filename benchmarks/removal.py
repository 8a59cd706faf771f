"""Material removal: lines updated a second, time and error beside exact booleans of manifold3d, arcs beside closed forms, memory.

A tool of 10 mm and lines every twentieth of its radius, 0.25 mm, where nothing else is said. Volumes beside closed forms and, where there
is none, beside booleans of polyhedra so fine that their own chords matter less.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import manifold3d
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.timing import Race, row
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.toolpath.dexel import DexelField, memory_of
from rcsa_ident.toolpath.engagement import engagement_along
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep, frame_of
from rcsa_ident.toolpath.solid import ToolSolid

RADIUS, CELL, HIGH = 0.005, 0.25e-3, np.array([0.06, 0.03, 0.012])
FLAT = ToolSolid.of(Cutter(2, 2.0 * RADIUS), 0.04)
BALL = ToolSolid.of(Cutter(2, 2.0 * RADIUS, profile=Profile.ball(2.0 * RADIUS)), 0.04)
#: Of the cuts whose volumes are compared [m].
DEPTH = 3.3e-3
#: How far apart places on a path are [m].
STEP = 1e-4


def run() -> list[dict[str, Any]]:
    """Volumes, arcs, times, memory."""
    return [*volumes(), *arcs(), *times(), *memory()]


def removed(solid: ToolSolid, path: ToolPath, cell: float = CELL) -> float:
    """Volume that a path takes out of the block [m^3]."""
    field = DexelField.block(np.zeros(3), HIGH, cell)
    before = field.volume
    Sweep(field, solid, path).run()
    return before - field.volume


def polyhedron(solid: ToolSolid, chord: float, pieces: int) -> Any:
    """The tool as a polyhedron."""
    solid = solid.coarser(chord)
    z, r = np.concatenate([[0.0], solid.heights, [solid.length]]), np.concatenate([[0.0], solid.radii, [0.0]])
    return manifold3d.Manifold.revolve(manifold3d.CrossSection([np.stack([r, z], axis=1)]), pieces)


def boolean(tool: Any, path: ToolPath) -> float:
    """Volume by booleans: the hull of the tool at both ends of each move, taken out of the block [m^3]."""
    stock = manifold3d.Manifold.cube(HIGH)
    for k in range(len(path) - 1):
        ends = [tool.transform(np.column_stack([frame_of(path.axes[i]), path.places[i]])) for i in (k, k + 1)]
        stock -= manifold3d.Manifold.batch_hull(ends)
    return float(np.prod(HIGH) - stock.volume())


class Cut(NamedTuple):
    """What is taken out: places about the middle, axes, the closed form of the shift across where there is one."""

    solid: ToolSolid
    places: FloatArray
    axes: FloatArray | None = None
    form: Callable[[float], float] | None = None

    def exact(self, path: ToolPath, shift: float) -> float:
        """The volume in closed form, of a ball of no shift alone; else by booleans [m^3]."""
        if self.form is None or (self.solid is BALL and shift):
            return boolean(polyhedron(self.solid, 2e-7, 1024), path)
        return self.form(shift) * (1.0 + 0.37 * shift / DEPTH)

    def lays(self) -> list[tuple[float, float]]:
        """Exact volume and what is taken out on lays of the lattice."""
        found = []
        for shift in np.linspace(0.0, CELL, 9, endpoint=False) if self.axes is None else (0.0, 0.11e-3):
            path = ToolPath(self.places + np.array([0.03, 0.015 + shift, HIGH[2] - DEPTH - 0.37 * shift]), axes=self.axes)
            found.append((self.exact(path, float(shift)), removed(self.solid, path)))
        return found


def cuts() -> dict[str, Cut]:
    """All of them by name."""
    across = RADIUS**2 * np.arccos(1.0 - DEPTH / RADIUS) - (RADIUS - DEPTH) * np.sqrt(2.0 * RADIUS * DEPTH - DEPTH**2)
    turn = np.linspace(0.0, 2.0 * np.pi, 721)
    ring = np.stack([7.1e-3 * np.cos(turn), 7.1e-3 * np.sin(turn), 0.0 * turn], axis=1)
    sideways, forward = (np.tile(axis, (2, 1)) for axis in ([0.0, np.sin(0.26), np.cos(0.26)], [np.sin(0.26), 0.0, np.cos(0.26)]))
    line = np.array([[-0.036, 0.0, 0.0], [0.036, 0.0, 0.0]])
    return {
        "slot": Cut(FLAT, line, form=lambda s: 0.06 * 2.0 * RADIUS * DEPTH),
        "shoulder": Cut(FLAT, line - [0.0, 0.014, 0.0], form=lambda s: 0.06 * (RADIUS + 0.001 + s) * DEPTH),
        "plunge": Cut(FLAT, np.array([[0.0, 0.0, 0.01], [0.0, 0.0, 0.0]]), form=lambda s: np.pi * RADIUS**2 * DEPTH),
        "ramp of 5 degrees": Cut(FLAT, np.array([[-0.038, 0.0, 0.0033], [0.038, 0.0, -0.0033]])),
        "ball's groove": Cut(BALL, line, form=lambda s: 0.06 * across),
        "ball down a ramp of 5 degrees": Cut(BALL, np.array([[-0.038, 0.0, 0.0033], [0.038, 0.0, -0.0033]])),
        "circular pocket": Cut(FLAT, ring, form=lambda s: np.pi * ((7.1e-3 + RADIUS) ** 2 - (7.1e-3 - RADIUS) ** 2) * DEPTH),
        "slanting slot": Cut(FLAT, line @ Rotation.from_euler("z", 0.4).as_matrix().T),
        "leaning sideways by 15 degrees": Cut(FLAT, line, sideways),
        "ball leaning forward by 15 degrees": Cut(BALL, line, forward),
    }


def volumes() -> list[dict[str, Any]]:
    """Errors of volumes, mean and largest of nine lays of the lattice [%]."""
    rows = []
    for name, cut in cuts().items():
        errors = [100.0 * (found / exact - 1.0) for exact, found in cut.lays()]
        told = f"mean {np.mean(np.abs(errors)):.4f} %"
        rows.append(row(f"removal: volume of {name}, largest error", float(np.max(np.abs(errors))), None, "%", told))
    return rows


def leaning_turns(count: int = 8) -> list[FloatArray]:
    """Ways to turn a cut in space."""
    return [Rotation.from_rotvec(np.random.default_rng(seed).normal(size=3) * 0.4).as_matrix() for seed in range(count)]


def beside(solid: ToolSolid, seed: int, turn: FloatArray | None) -> FloatArray:
    """Errors of the arcs of a pass beside one that was cut, anywhere on the lattice [deg]."""
    rng = np.random.default_rng(seed)
    ae, angle, side, ap = rng.uniform(3e-4, 9.7e-3), rng.uniform(0.0, 2.0 * np.pi), (-1) ** seed, rng.uniform(1.5e-3, 4e-3)
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    centre = np.array([0.02, 0.02, 0.01 - ap]) + rng.uniform(-1e-3, 1e-3, 3) * [1.0, 1.0, 0.0]
    first = centre - side * ae * np.array([-way[1], way[0], 0.0])
    field = DexelField.block(np.zeros(3), np.array([0.04, 0.04, 0.01]), CELL)
    axis = np.array([0.0, 0.0, 1.0])
    if turn is not None:
        low, high = np.zeros(3), np.array([0.04, 0.04, 0.01])
        corners = np.array([[(low, high)[(k >> a) & 1][a] for a in range(3)] for k in range(8)])
        sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        faces = np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
        field, axis = DexelField.from_mesh(corners @ turn.T, faces, CELL), turn[:, 2]
    frame = np.eye(3) if turn is None else turn
    Sweep(field, solid, ToolPath(np.array([first - 0.04 * way, first + 0.04 * way]) @ frame.T, axes=np.tile(axis, (2, 1)))).run()
    places = np.array([centre - 0.04 * way, centre, centre + STEP * way]) @ frame.T
    sweep = Sweep(field, solid, ToolPath(places[1:], axes=np.tile(axis, (2, 1))))
    Sweep(field, solid, ToolPath(places[:2], axes=np.tile(axis, (2, 1)))).run()
    found = engagement_along(sweep).at(0)
    if found is None:
        return np.array([180.0])
    radius = solid.radius_at(found.z)
    whole = (radius > 0.55 * ae) & (found.z > 2.0 * CELL) & (found.z < ap - 1.5 * CELL)
    wanted = np.arccos(np.clip(1.0 - ae / radius[whole], -1.0, 1.0))
    start, end = (0.0 * wanted, wanted) if side > 0 else (np.pi - wanted, np.pi + 0.0 * wanted)
    return np.degrees(np.maximum(np.abs(found.start[whole] - start), np.abs(found.end[whole] - end)))


def arcs() -> list[dict[str, Any]]:
    """Errors of entry and exit beside a wall [deg]: upright tools, and the same cuts turned in space."""
    rows = []
    for name, solid in (("flat", FLAT), ("ball", BALL)):
        upright = np.concatenate([beside(solid, seed, None) for seed in range(100)])
        leaning = np.concatenate([beside(solid, seed, turn) for seed, turn in enumerate(leaning_turns())])
        for lay, errors in (("upright", upright), ("leaning", leaning)):
            told = f"{errors.size} arcs, root mean square {np.sqrt(np.mean(errors**2)):.2g} deg"
            rows.append(row(f"removal: arcs of a {lay} {name} tool beside a wall, largest error", float(errors.max()), None, "deg", told))
    return rows


def times() -> list[dict[str, Any]]:
    """Updates a second, and time a place beside booleans; of three runs the fastest."""
    rows = []
    path = ToolPath(np.array([[0.01005, 0.01503, 0.0104], [0.05005, 0.01503, 0.0104]])).resampled(STEP)
    for cell in (CELL, 1e-4):
        cuts, both = [], []
        for _ in range(4):
            sweep = Sweep(DexelField.block(np.zeros(3), HIGH, cell), FLAT, path)
            start = time.perf_counter()
            sweep.run()
            cuts.append(time.perf_counter() - start)
            fresh = Sweep(DexelField.block(np.zeros(3), HIGH, cell), FLAT, path)
            start = time.perf_counter()
            engagement_along(fresh)
            both.append(time.perf_counter() - start)
        name, places = f"cell {1e3 * cell:g} mm", len(path) - 1
        rows.append(row(f"removal: lines updated a second, {name}", 1e-6 * sweep.updates / min(cuts), None, "million", "one core"))
        for told, seconds in (("without", min(cuts)), ("with", min(both))):
            peer = 1e3 * booleans(path) if cell == CELL else None
            rows.append(
                row(
                    f"removal: a place {told} its arcs, {name} (peer: manifold3d, volume alone)",
                    1e3 * seconds / places,
                    peer,
                    "ms",
                    "every 0.1 mm",
                )
            )
    return rows


def booleans(path: ToolPath, places: int = 40) -> float:
    """Seconds a place of manifold3d."""
    start = time.perf_counter()
    march(path, places)
    return (time.perf_counter() - start) / places


def march(path: ToolPath, places: int) -> float:
    """Volume after so many places by manifold3d: the tool as a prism of 64 sides, off by 0.2 % in its area [m^3]."""
    tool = polyhedron(FLAT, 1e-6, 64)
    stock = manifold3d.Manifold.cube(HIGH)
    for k in range(places):
        stock -= manifold3d.Manifold.batch_hull([tool.translate(path.places[i]) for i in (k, k + 1)])
        stock.volume()
    return float(stock.volume())


def races() -> list[Race]:
    """A place every 0.1 mm on a slot of 40 mm, lines every 0.25 mm, with and without the arcs of the tool."""
    path = ToolPath(np.array([[0.01005, 0.01503, 0.0104], [0.05005, 0.01503, 0.0104]])).resampled(STEP)
    part = ToolPath(path.places[:41])

    def sweep(way: ToolPath = path) -> Sweep:
        return Sweep(DexelField.block(np.zeros(3), HIGH, CELL), FLAT, way)

    def taken(way: ToolPath) -> float:
        each = sweep(way)
        each.run()
        return each.field.volume

    before = float(np.prod(HIGH))
    exact = RADIUS**2 * np.pi * 1.6e-3 + 2.0 * RADIUS * 1.6e-3 * 40 * STEP
    errors = [100.0 * abs((before - volume) / exact - 1.0) for volume in (taken(part), march(path, 40))]
    told = f"volume of 4 mm: ours within {errors[0]:.2f} %, peer {errors[1]:.2f} %"
    places, peer = len(path) - 1, "manifold3d, prism of 64 sides, volume alone"
    theirs = partial(march, path, 40)
    return [
        Race("removal: a place every 0.1 mm", peer, "manifold3d", lambda: sweep().run(), theirs, told, (places, 40)),
        Race("removal and arcs: a place every 0.1 mm", peer, "manifold3d", lambda: engagement_along(sweep()), theirs, told, (places, 40)),
    ]


def memory() -> list[dict[str, Any]]:
    """Of a block of 200 x 200 x 50 mm [MB]."""
    size = np.array([0.2, 0.2, 0.05])
    found = partial(memory_of, size)
    return [
        row(f"removal: memory of 200 x 200 x 50 mm, cell {1e3 * c:g} mm", found(c) / 1e6, None, "MB", "two segments a line")
        for c in (CELL, 1e-4)
    ]
