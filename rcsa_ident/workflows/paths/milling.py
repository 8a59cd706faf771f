"""Milling in time along a path on any machine: what carries the tool, what happens turn by turn, and the walls that are left."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.machine.machine import TipSource
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.stability.lobes import all_directions
from rcsa_ident.stability.tip_modes import TipModes, fitted_modes
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.march import Carrier
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.path_march import MarchOptions, MilledPart, mill_along
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.surface import Roughness, roughness
from rcsa_ident.toolpath.walls import PathFrame, Walls
from rcsa_ident.workflows.paths.removal import solid_of
from rcsa_ident.workflows.paths.robot_milling import arm_carrier
from rcsa_ident.workflows.paths.stability import stations_along
from rcsa_ident.workflows.tool_change import ToolChange

#: Share of its swing by which the tip stands elsewhere after a turn where it chatters whatever the cut does; and where the cut stays as it
#: is, its mean force to a fiftieth: below the limit it comes back to a fifth of that (tests/workflows/paths/test_milling.py).
_FAR, _ELSEWHERE, _SAME = 0.15, 0.01, 0.02
#: What counts as standing still [m], turns that tell, and how much more it may stand elsewhere for how much the way bends a turn [1/rad].
_STILL, _FEWEST, _BENT = 1e-7, 9, 2.0
#: Turns that are looked at together at most, and bend that ends a run [rad].
_WINDOW, _CORNER = 60, np.radians(15.0)
#: Volume that counts as none [m^3].
_NOTHING = 1e-12
#: What falls further from the first third of a run to the last one dies out.
_DYING = 0.8
#: Share of instants that may stay unsettled: a tooth that comes in or not, as the tip stands, has no place between.
_UNSETTLED = 1e-3
#: Between places of walls that are told where they are asked for, and else [m].
_SURFACE, _COARSE = 2e-5, 5e-4
_ROWS = ("time", "places", "mean_force", "peak_force", "mean_tip", "once", "within", "swing")
_NO_WALLS = Walls(0.0, 1.0, np.zeros((2, 0, 0)), np.zeros((2, 0, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class PathMilling:
    """What happened along a path, turn by turn in material; axes of the machine, of a robot those of its base.

    `move`: array of int, shape (n,); that each turn belongs to
    `run`: array of int, shape (n,); which turns follow each other without a corner or a rest between, whatever lines of the program they
        stand in
    `bend` [rad], shape (n,): by which the way has turned since the turn before
    `time` [s], shape (n,)
    `places` [m], shape (n, 3): where the tip was sent
    `mean_force` [N], shape (n, 3): on the tool
    `peak_force` [N], shape (n,): across the axis
    `mean_tip` [m], shape (n, 3): by which the tip was off
    `swing` [m], shape (n,): from end to end of its way in a turn, across the axis
    `beside_turns` [m], shape (n,): by which the tip stands elsewhere than a turn before, as seen from its mean place in each turn: what is
        slow beside the tool's turns, as an arm's sway, hardly counts; or than where the tooth before stood as this one does, of teeth that
        are alike
    `surface`, shape (m, 6): of the walls: place (3) and height above the tip [m], error [m], positive where material is left, and move
    `roughness`: of the roughest wall that is long enough
    `lost`: whether the tool was ever so far off its path that nothing after it counts
    `unsettled`: share of the instants at which force and deflection did not agree, as where a tooth comes in at just that place
    `left_out`: what takes out material and is not marched
    """

    move: np.ndarray
    run: np.ndarray
    bend: FloatArray
    time: FloatArray
    places: FloatArray
    mean_force: FloatArray
    peak_force: FloatArray
    mean_tip: FloatArray
    swing: FloatArray
    beside_turns: FloatArray
    surface: FloatArray
    roughness: Roughness | None
    lost: bool
    unsettled: float
    left_out: tuple[str, ...] = ()

    @property
    def chattering(self) -> tuple[int, ...]:
        """Moves on which the tip does not come back to where it was a turn before: by much, or while the cut stays as it is.

        Beginning and end of a run, where the tool comes and goes, are left aside. Where the way bends the tip turns with it; where the
        cut changes it moves on; and what dies out is no chatter.
        """
        found: set[int] = set()
        for inner in self._windows():
            thirds = np.array_split(inner, 3)
            beside = np.array([np.median(self.beside_turns[third]) for third in thirds])
            swing = np.array([np.median(self.swing[third]) for third in thirds])
            force = np.array([np.median(np.linalg.norm(self.mean_force[third], axis=1)) for third in thirds])
            bent = _BENT * float(np.mean(self.bend[inner]))
            wild = beside > np.maximum((_FAR + bent) * swing, 10.0 * _STILL)
            steady = np.ptp(force) < _SAME * np.mean(force) and beside[2] > _DYING * beside[0]
            if steady and beside[2] > max((_ELSEWHERE + bent) * swing[2], _STILL):
                wild[2] = True
            for third, one in zip(thirds, wild, strict=True):
                found.update(self.move[third].tolist() if one else ())
        return tuple(sorted(found))

    def _windows(self) -> Iterator[np.ndarray]:
        """Turns in material that are looked at together: enough of them, and not so many that one cut hides in another."""
        for run in np.unique(self.run):
            own = np.flatnonzero((self.run == run) & (self.peak_force > 0.0))
            left = min(own.size // 5, _WINDOW)
            inner = own[left : own.size - left]
            if inner.size >= _FEWEST:
                yield from np.array_split(inner, int(np.ceil(inner.size / _WINDOW)))

    @property
    def status(self) -> str:
        """``stable``, ``chatter``, ``no cut``, ``lost``, or ``not converged``."""
        if self.lost:
            return "lost"
        if self.unsettled > _UNSETTLED:
            return "not converged"
        if not np.any(self.peak_force > 0.0):
            return "no cut"
        return "chatter" if self.chattering else "stable"

    @property
    def form_error(self) -> tuple[float, float] | None:
        """Smallest and largest error of the walls [m]; None where none is left."""
        error = self.surface[:, 4]
        return (float(error.min()), float(error.max())) if error.size else None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against it."""
        told = list(self.left_out)
        cutting = int(np.count_nonzero(self.peak_force > 0.0))
        judged = sum(window.size for window in self._windows())
        if cutting and judged < 0.3 * cutting:
            told.append(f"{cutting - judged} of {cutting} turns follow too few others to tell whether they chatter")
        if self.lost:
            told.append("the tool left its path by more than a tenth of its radius: what follows means nothing")
        if self.unsettled > _UNSETTLED:
            told.append(f"at {100.0 * self.unsettled:.2g} % of all instants force and deflection did not agree: take more steps a turn")
        return tuple(told)

    def described(self, path: ToolPath) -> str:
        """Return it in sentences."""
        if self.status == "no cut":
            return "nothing is cut: the tool meets no material on a level move at a feed"
        bent = 1e6 * float(np.max(np.linalg.norm(self.mean_tip, axis=1)))
        told = [
            f"forces up to {self.peak_force.max():.0f} N across the tool's axis, its tip off by up to {bent:.1f} µm on average of a turn"
        ]
        lines = sorted({int(path.line[move + 1]) for move in self.chattering})
        if lines:
            count = len(self.chattering)
            where = f"on line{'s' if len(lines) > 1 else ''} {', '.join(map(str, lines[:8]))}" if any(lines) else f"on {count} of its moves"
            told.append(f"it chatters {where}{' and others' if len(lines) > 8 else ''}")
        else:
            told.append("no move chatters")
        if self.form_error is not None:
            low, high = (1e6 * each for each in self.form_error)
            told.append(f"walls are off by {low:.1f} to {high:.1f} µm; above 0 material is left")
        if self.roughness is not None:
            r = self.roughness
            told.append(
                f"Ra {1e6 * r.mean:.2g}, Rq {1e6 * r.rms:.2g}, Rt {1e6 * r.total:.2g} µm on the roughest wall (ISO 21920-2, Gaussian "
                f"filter ISO 16610-21 of {1e3 * r.cutoff:g} mm, over {1e3 * r.length:.1f} mm)"
            )
        return "\n".join(told)


def mill_path(
    change: ToolChange,
    path: ToolPath,
    field: DexelField,
    steps: int = 360,
    play: bool = True,
    weight: bool = True,
    cutoff: float = 0.8e-3,
    surface: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> PathMilling:
    """Mill along a path in time.

    Parameters
    ----------
    change : ToolChange
        The tooling on its machine, and the material; where the path has no spindle speed its only one counts.
    path : ToolPath
    field : DexelField
        The stock; it is cut.
    steps : int
        Of a turn, at least; more where modes swing fast.
    play : bool
        With the play of a robot's drives.
    weight : bool
        Whether the arm's weight holds that play.
    cutoff : float [m]
        Of the filter for roughness.
    surface : bool
        Whether walls are told every fiftieth of a millimetre, and not every half.
    progress : callable, optional
        Told how far along the path it is, in tenths of a millimetre.

    Raises
    ------
    InputError
        If a move at a feed has no spindle speed, or the robot does not reach a place.
    """
    tooling = change.tooling
    if change.speeds.size == 1:
        path = replace(path, speed=np.where(np.isnan(path.speed), change.speeds[0], path.speed))
    stations = stations_along(change.machine, tooling, path)
    carriers = carriers_of(change, lambda move: stations(move).machine, path.speed[1:], play, weight)
    sweep = Sweep(field, solid_of(tooling), path)
    done = np.concatenate([[0.0], np.cumsum(path.lengths)])
    parts, surfaces, worst, marched = [], [], None, set[int]()
    for part in mill_along(sweep, tooling.cutter, change.process.coefficients, carriers, MarchOptions(steps)):
        parts.append(part)
        for side, x, error in part.surfaces():
            surfaces.append(_surface_rows(part, side, x, error, _SURFACE if surface else _COARSE))
            if x[-1] - x[0] > 2.5 * cutoff and x.size == round((x[-1] - x[0]) / part.walls.spacing) + 1:
                found = roughness(error[len(error) // 2], part.walls.spacing, cutoff)
                worst = found if worst is None or found.mean > worst.mean else worst
        marched.add(part.move)
        # walls take far more memory than what is told of a turn
        parts[-1] = replace(part, walls=_NO_WALLS, cut=_NO_WALLS.tops)
        if progress is not None:
            progress(int(1e4 * done[part.move + 1]), int(1e4 * done[-1]))
    rows = [np.concatenate([getattr(part, name) for part in parts]) if parts else np.zeros((0, 3)) for name in _ROWS]
    time, places, mean_force, peak_force, mean_tip, once, within, swing = rows
    time = time.ravel()
    move = np.repeat([part.move for part in parts], [part.time.size for part in parts]) if parts else np.zeros(0, dtype=int)
    seen = once[:, :2] - mean_tip[:, :2]
    beside = np.linalg.norm(np.diff(seen, axis=0, prepend=seen[:1]), axis=1)
    way = np.arctan2(path.moves[move, 1], path.moves[move, 0])
    bend = np.abs(np.angle(np.exp(1j * np.diff(way, prepend=way[:1]))))
    gap = np.diff(time, prepend=time[:1])
    turn = 2.0 * np.pi / np.maximum(path.speed[move + 1], 1e-3)
    run = np.cumsum((bend > _CORNER) | (gap > 1.5 * turn))
    # at corners and after a rest it stands elsewhere for another reason
    beside[np.flatnonzero(np.diff(run)) + 1] = 0.0
    beside = np.maximum(beside, within.ravel())
    columns = [run, bend, time, places, mean_force, peak_force.ravel(), mean_tip, swing.ravel(), beside]
    move, columns = _with_rests(path, move, columns, np.flatnonzero(gap > 1.5 * turn), turn)
    run, bend, time, places, mean_force, peak_force, mean_tip, swing, beside = columns
    return PathMilling(
        move,
        run,
        bend,
        time,
        places,
        mean_force,
        peak_force,
        mean_tip,
        swing,
        beside,
        _still_there(np.concatenate(surfaces), field) if surfaces else np.zeros((0, 6)),
        worst,
        any(part.lost for part in parts),
        sum(part.unsettled for part in parts) / max(move.size * steps, 1),
        tuple(_left_out(path, sweep.shares, marched)),
    )


def _with_rests(
    path: ToolPath, move: np.ndarray, columns: list[FloatArray], gaps: np.ndarray, turn: FloatArray
) -> tuple[np.ndarray, list[FloatArray]]:
    """Rows without a force where turns in material begin and end, so that nobody draws a line from one cut to the next."""
    if not move.size:
        return move, columns
    time, last = columns[2], move.size
    ends = np.concatenate([gaps, [last]])
    begins = np.concatenate([[0], gaps])
    at = np.concatenate([begins, ends])
    of = np.concatenate([begins, ends - 1])
    when = np.concatenate([time[begins] - turn[begins], time[ends - 1] + turn[ends - 1]])
    when = np.clip(when, 0.0, max(float(path.times[-1]), float(time[-1])))
    # ends of a cut stand before the beginnings of the next one
    order = np.lexsort((when, at))
    at, of, when = at[order], of[order], when[order]
    rests = [np.zeros((at.size, *values.shape[1:])) for values in columns]
    rests[0], rests[2] = columns[0][of], when
    rests[3] = np.stack([np.interp(when, path.times, path.places[:, k]) for k in range(3)], axis=1)
    return np.insert(move, at, move[of]), [np.insert(values, at, rest, axis=0) for values, rest in zip(columns, rests, strict=True)]


def _left_out(path: ToolPath, shares: FloatArray, marched: set[int]) -> Iterator[str]:
    """Sentences about moves that take out material and are not marched, and about tools that are not this one."""
    left = [move for move in np.flatnonzero(path.cutting & (shares > _NOTHING)).tolist() if move not in marched]
    if left:
        lines = sorted({int(path.line[move + 1]) for move in left} - {0})
        where = f", lines {', '.join(map(str, lines[:5]))}{' and others' if len(lines) > 5 else ''}" if lines else ""
        yield f"{len(left)} moves that climb, plunge, lean or lower a floor alone take out material and are not simulated{where}"
    tools = sorted(set(path.tool[1:][path.cutting].tolist()) - {0})
    if len(tools) > 1:
        yield f"the path cuts with tools {', '.join(map(str, tools))}: all of it was taken for this one's"


def _still_there(rows: FloatArray, field: DexelField) -> FloatArray:
    """Rows of walls that no later pass has taken away: behind them stands material."""
    first, cell = field.lattice
    at = np.round((rows[:, :3] - first) / cell).astype(int)
    kept = np.zeros(len(rows), dtype=bool)
    # a wall's own node may lie on either side of it
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            m, n = at[:, 0] + i, at[:, 1] + j
            inside = (m >= 0) & (m < field.shape[0]) & (n >= 0) & (n < field.shape[1])
            seg, count = field.segs[2][m[inside], n[inside]], field.counts[2][m[inside], n[inside]]
            z = rows[inside, 2][:, None]
            held = (np.arange(seg.shape[1]) < count[:, None]) & (seg[..., 0] <= z) & (z <= seg[..., 1])
            kept[inside] |= held.any(axis=1)
    return rows[kept]


def _surface_rows(part: MilledPart, side: int, x: FloatArray, error: FloatArray, spacing: float) -> FloatArray:
    """Rows of `PathMilling.surface`."""
    every = max(round(spacing / part.walls.spacing), 1)
    x, error = x[::every], error[:, ::every]
    slices, count = error.shape
    off = (-1.0 if side == 0 else 1.0) * (part.radii[:, None] - error)
    beside = np.stack([np.broadcast_to(x, error.shape), off], axis=-1).reshape(-1, 2)
    places = part.frame.back(beside)
    height = np.repeat(part.heights, count)
    tip = part.level
    return np.column_stack([places, tip + height, height, error.ravel(), np.full(slices * count, part.move)])


def carriers_of(
    change: ToolChange, stations: Callable[[int], TipSource], speeds: FloatArray, play: bool = True, weight: bool = True
) -> Callable[[int, PathFrame], Carrier]:
    """Return who carries a tool on the moves of a path, as `toolpath.path_march.mill_along` asks for it.

    `change`: the tooling
    `stations`: the machine of a move; a robot's tip has the base's x and y
    `speeds` [rad/s], shape (k,): of the spindle on each move
    `play`: with the play of a robot's drives
    `weight`: whether the arm's weight holds its play. The sag of the first move counts as known: the workpiece was touched with it.
    """
    known: dict[tuple[int, float], Carrier] = {}

    def carrier(move: int, frame: PathFrame) -> Carrier:
        machine, speed = stations(move), float(speeds[move])
        key = id(machine), speed
        if key not in known:
            found = _carrier(replace(change, machine=machine, speeds=np.array([speed])), play, weight)
            known[key] = replace(found, zero=next(iter(known.values())).zero if known else found.sag)
        return seen_from(known[key], frame)

    return carrier


def seen_from(carrier: Carrier, frame: PathFrame) -> Carrier:
    """Return a carrier of the machine's axes in those of a path."""
    turn = np.eye(3)
    turn[:2, :2] = frame.turn
    modes = carrier.modes
    if modes is not None:
        modes = PoleResidue(modes.pole, turn @ modes.outputs, modes.inputs @ turn.T, turn @ modes.constant @ turn.T)
    return replace(carrier, motion=turn @ carrier.motion, zero=turn @ carrier.zero, modes=modes)


def tip_modes(change: ToolChange) -> PoleResidue:
    """Return the tip's modes along X, Y and Z, 3 by 3; a direction that is not known is rigid."""
    ((_, tip),) = change.tips(change.speeds)
    modes = tip if isinstance(tip, TipModes) else fitted_modes(all_directions(tip))[0]
    count = min(modes.directions, 3)
    outputs, inputs, constant = (
        np.zeros((3, modes.pole.size), dtype=complex),
        np.zeros((modes.pole.size, 3), dtype=complex),
        np.zeros((3, 3)),
    )
    outputs[:count], inputs[:, :count], constant[:count, :count] = (
        modes.outputs[:count],
        modes.inputs[:, :count],
        modes.constant[:count, :count],
    )
    return PoleResidue(modes.pole, outputs, inputs, constant)


def _carrier(change: ToolChange, play: bool, weight: bool) -> Carrier:
    machine, modes = change.machine, tip_modes(change)
    if not (play and isinstance(machine, PosedRobot) and any(joint.backlash for joint in machine.robot.model.joints)):
        return Carrier(modes=modes)
    # the arm by its freedoms, for their play; modes tell what tool and spindle add to it
    assembly = machine.fitted(change.tooling).assembly
    lever = assembly.stickout + assembly.holder_length
    arm = arm_carrier(machine.robot, machine.angles, machine.turn, lever, weight=weight)
    alone = arm.poles
    return replace(arm, modes=PoleResidue.joined([modes, PoleResidue(alone.pole, -alone.outputs, alone.inputs, alone.constant)]))
