"""Milling in time along a path through a workpiece of dexels: move by move, from turn to turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.toolpath._kernels import wall as kernels
from rcsa_ident.toolpath.march import Carrier, Cut, March, march, start_of
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.removal import Sweep
from rcsa_ident.toolpath.walls import NOTHING, PathFrame, Walls

#: Longest part of a move that is marched at once, and its most instants: walls and histories are in memory [m].
_PART, _INSTANTS = 0.05, 1e6
#: Thickness of a slice [m], and how many there are.
_SLICE, _FEWEST, _MOST = 0.3e-3, 6, 24
#: Instants of the fastest mode's period, and of a turn at most.
_WAVE, _MOST_STEPS = 16.0, 20000
#: Turn between moves up to which teeth find what teeth left before it; beyond, what a rigid tool would have left [rad].
_BEND = np.radians(30.0)
#: Material that is thinner counts as none [m].
_THIN = 1e-6
#: Share of the radius by which a wall may stand off the path's own.
_OTHER_WALL = 0.1
#: A move shorter than this is none, and level is one that climbs no more than this, and by no more than this share of its length.
_NOWHERE, _LEVEL, _SLOPE = 1e-7, 2e-5, 0.01


@dataclass(frozen=True, slots=True, eq=False)
class MilledPart:
    """What happened on a part of a move, turn by turn; axes of the machine.

    `places` [m], shape (n, 3): where the tip was sent in the middle of each turn
    `time` [s], shape (n,)
    `mean_force` [N], shape (n, 3): on the tool
    `peak_force` [N], shape (n,): across the axis
    `mean_tip` [m], shape (n, 3): by which the tip was off
    `once` [m], shape (n, 2): the tip at the same angle of each turn: it stands still where a cut repeats itself
    `within` [m], shape (n,): by which the tip stands elsewhere at angles of the turn at which the teeth stand alike; 0 of a cutter that has
        one such angle
    `swing` [m], shape (n,): from end to end of its way across the axis
    `walls`: what is left, in the frame's axes
    `cut`, shape (2, slices, columns): which columns of the walls the tool has cut
    `done` [m]: up to where along them the walls are finished
    `radii` [m], shape (slices,)
    `heights` [m], shape (slices,): of the slices above the tip
    `level` [m]: where the tip was sent along z
    """

    move: int
    places: FloatArray
    time: FloatArray
    mean_force: FloatArray
    peak_force: FloatArray
    mean_tip: FloatArray
    once: FloatArray
    within: FloatArray
    swing: FloatArray
    frame: PathFrame
    walls: Walls
    cut: np.ndarray
    done: float
    radii: FloatArray
    heights: FloatArray
    level: float
    unsettled: int
    lost: bool

    def surfaces(self) -> Iterator[tuple[int, FloatArray, FloatArray]]:
        """Yield the walls that this part finished: side (0 right of the path, 1 left of it), x (n,) and error (slices, n) [m].

        The error is positive where material is left beside a wall at the cutter's radius; farther than a tenth of it off stands another.
        """
        x = self.walls.x
        behind = (x >= 0.0) & (x <= self.done)
        for side in (0, 1):
            error = self.walls.tops[side][:, behind] + self.radii[:, None]
            own = np.all((np.abs(error) < _OTHER_WALL * self.radii[:, None]) & self.cut[side][:, behind], axis=0)
            if np.count_nonzero(own) > 1:
                yield side, x[behind][own], error[:, own]


@dataclass(frozen=True, slots=True)
class MarchOptions:
    """How finely a march goes.

    `steps`: a turn, at least: more where modes of the tip swing fast beside it
    `spacing` [m]: of the walls' columns
    """

    steps: int = 360
    spacing: float = 4e-6


#: What is marched with where nobody asks.
_USUAL = MarchOptions()


def mill_along(
    sweep: Sweep,
    cutter: Cutter,
    coefficients: CuttingCoefficients,
    carriers: Callable[[int, PathFrame], Carrier],
    options: MarchOptions = _USUAL,
) -> Iterator[MilledPart]:
    """March along the moves of a sweep, which is made part by part, and yield what happened.

    Level moves of an upright tool at a feed are marched; on all others, and where a tool is not near the material, it is taken to be at
    rest. A force beside the walls of the slices, of a floor that is lowered, is left out.

    `sweep`: fresh; its field is cut. Its path has feeds and spindle speeds on all moves that cut.
    `carriers`: what carries the tool on a move, along the frame's x, its y and the axis
    Raises `InputError` if a move at a feed has no spindle speed, or no feed is told.
    """
    path = sweep.path
    times, marcher = path.times, _Marcher(sweep, cutter, coefficients, carriers, options)
    for move in range(len(path) - 1):
        parts = marcher.parts(move) if _marched(path, sweep, move) else None
        if parts is None:
            marcher.rest()
            sweep.run(move, move + 1, been=move > 0)
            continue
        for start, stop in parts:
            found = marcher.march(move, start, stop, float(times[move]))
            if found is not None:
                yield found
        marcher.pending.append(move)
    marcher.rest()


def _marched(path: ToolPath, sweep: Sweep, move: int) -> bool:
    length = float(path.lengths[move])
    return bool(
        path.cutting[move] and sweep.upright[move] and length > _NOWHERE and abs(path.moves[move, 2]) <= min(_LEVEL, _SLOPE * length)
    )


class _Marcher:
    """Where a march along a path stands."""

    def __init__(
        self,
        sweep: Sweep,
        cutter: Cutter,
        coefficients: CuttingCoefficients,
        carriers: Callable[[int, PathFrame], Carrier],
        options: MarchOptions,
    ) -> None:
        self.sweep, self.cutter, self.coefficients, self.carriers, self.options = sweep, cutter, coefficients, carriers, options
        self.went: March | None = None
        self.before: tuple[PathFrame, Walls, np.ndarray, Cut] | None = None
        self.modes: object = None
        #: Time, place, force and tip at the instants of a turn that is not whole yet.
        self.rest_of_turn = np.empty((0, 10))
        #: Moves whose sweeps are not made yet: a rigid tool would take the chips that the teeth have still before them.
        self.pending: list[int] = []
        #: How often a turn the teeth stand alike.
        self.alike = cutter.symmetry
        #: Instants of a turn now, and time since the last one [s].
        self.steps, self.since = options.steps, 0.0

    def rest(self) -> None:
        """Let the tool come to rest."""
        self.went = self.before = None
        self.rest_of_turn, self.since = np.empty((0, 10)), 0.0
        self._sweep()

    def _sweep(self) -> None:
        for move in self.pending:
            self.sweep.run(move, move + 1, been=move > 0)
        self.pending = []

    def parts(self, move: int) -> list[tuple[float, float]]:
        """Shares of a move that are marched at once."""
        path = self.sweep.path
        length, feed, speed = float(path.lengths[move]), float(path.feed[move + 1]), float(path.speed[move + 1])
        instants = self.options.steps * speed / (2.0 * np.pi) * length / feed
        count = int(np.ceil(max(length / _PART, instants / _INSTANTS)))
        ends = np.linspace(0.0, 1.0, count + 1)
        return list(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))

    def march(self, move: int, start: float, stop: float, since: float) -> MilledPart | None:
        path, field = self.sweep.path, self.sweep.field
        way, length, feed, speed = path.moves[move], float(path.lengths[move]), float(path.feed[move + 1]), float(path.speed[move + 1])
        if not speed > 0.0:
            stands = "0, the spindle stands" if speed == 0.0 else "none"
            raise InputError("spindle speed", f"{stands} on the move to {self._told(move)}", "one above 0 on every move that cuts")
        here = path.places[move] + start * way
        frame, span = PathFrame(here[:2], float(np.arctan2(way[1], way[0]))), (stop - start) * length
        cut = self._cut(frame, span, here[2], speed)
        if cut is None:
            self.rest()
            return None
        parts = cut.parts
        reach = self._reach
        goes_on = self._goes_on(frame, parts.height)
        if not goes_on:
            self._sweep()
        walls = Walls.beside(field, frame, here[2] + parts.height, (-reach, span + reach), reach, self.options.spacing)
        of_dexels = walls.tops.copy()
        if goes_on:
            self._overlay(frame, walls)
            if move not in self.pending:
                self._sweep()
        if not np.any(walls.tops > NOTHING):
            self.rest()
            return None
        carrier = self.carriers(move, frame)
        steps = int(min(max(self.options.steps, np.ceil(_WAVE * carrier.fastest / speed)), _MOST_STEPS))
        steps = -(-steps // self.alike) * self.alike
        if steps != self.steps or self.went is None:
            self.steps, self.rest_of_turn, self.since = steps, np.empty((0, 10)), 0.0
        step = 2.0 * np.pi / speed / steps
        # the first instant is a whole step behind the last one of the move before
        first = step - min(self.since, step)
        taken = span / feed
        count = int((taken - first) / step + 1e-9) + 1 if taken >= first else 0
        if not count:
            self.since += taken
            return None
        self.since = taken - first - (count - 1) * step
        fresh = start_of(carrier, cut, step, since + start * length / feed + first - step, self._angle(frame))
        went = fresh if self.went is None else self._gone_on(fresh, carrier, frame)
        x = feed * (first + step * np.arange(count))
        laid = walls.tops.copy()
        found = march(went, carrier, cut, walls, np.column_stack([x, np.zeros_like(x)]))
        self.went, self.modes = found, carrier.modes
        self.before = frame, walls, (walls.tops < laid) | (laid != of_dexels), cut
        return self._turns(move, found, frame, walls, cut, here, x)

    @property
    def _reach(self) -> float:
        """As far beside the path as the tool comes, run-out and all [m]."""
        return 1.2 * (self.sweep.solid.radius + float(np.max(np.abs(self.cutter.runout))))

    def _told(self, move: int) -> str:
        path = self.sweep.path
        return f"line {path.line[move + 1]}" if path.line[move + 1] else f"place {move + 2}"

    def _cut(self, frame: PathFrame, span: float, level: float, speed: float) -> Cut | None:
        """The slices of the material that stands beside a part of the path; None where there is none as high as the edges."""
        # what stands at the tool's own radius is the wall that it leaves
        radius = self.sweep.solid.radius - 0.5 * float(self.sweep.field.cell[:2].max())
        beside = self.sweep.field.heights_beside(frame.origin, frame.back(np.array([[span, 0.0]]))[0], radius, level)
        if beside is None:
            return None
        bottom, top = beside[0] - level, min(beside[1] - level, self.sweep.solid.edge)
        if top - bottom < _THIN:
            return None
        if self.before is not None:
            old = self.before[3]
            inside = bottom >= old.bottom - _THIN and top <= old.depth + _THIN and top - bottom > 0.5 * (old.depth - old.bottom)
            if inside and old.spindle_speed == speed:
                return old
        slices = int(np.clip(np.ceil((top - bottom) / _SLICE), _FEWEST, _MOST))
        return Cut(self.cutter, self.coefficients, top, speed, slices, bottom if bottom > _THIN else 0.0)

    def _angle(self, frame: PathFrame) -> float:
        """Where tooth 1 stands: angles count from the normal of the frame, clockwise."""
        return 0.0 if self.went is None or self.before is None else self.went.angle + frame.angle - self.before[0].angle

    def _gone_on(self, fresh: March, carrier: Carrier, frame: PathFrame) -> March:
        """The state of the carrier, as it is seen from a new frame."""
        assert self.went is not None
        assert self.before is not None
        before = self.went
        if before.state.shape == fresh.state.shape:
            fresh = replace(fresh, state=before.state)
        old = self.before[0]
        turn = frame.turn @ old.turn.T
        if _same_poles(self.modes, carrier.modes):
            fresh = replace(fresh, swing=before.swing)
        elif carrier.modes is not None:
            # other modes stand where the mean force of the last turn holds them
            mean = before.force[-self.steps :].mean(axis=0)
            mean[:2] = turn @ mean[:2]
            fresh = replace(fresh, swing=-(carrier.modes.inputs @ mean) / carrier.modes.pole)
        if before.trail.shape == fresh.trail.shape:
            trail = frame.to(old.back(before.trail.reshape(-1, 2))).reshape(before.trail.shape)
            fresh = replace(fresh, trail=trail, held=before.held)
        force = before.force[-1:].copy()
        force[:, :2] = force[:, :2] @ turn.T
        return replace(fresh, force=force, lost=before.lost)

    def _goes_on(self, frame: PathFrame, heights: FloatArray) -> bool:
        """Whether teeth find what teeth left on the move before."""
        if self.before is None:
            return False
        bend = np.angle(np.exp(1j * (frame.angle - self.before[0].angle)))
        return bool(abs(bend) <= _BEND) and np.array_equal(self.before[3].parts.height, heights)

    def _overlay(self, frame: PathFrame, walls: Walls) -> None:
        """Take what teeth left on the move before in place of what the dexels have."""
        assert self.before is not None
        old, left, taken, _ = self.before
        for k in range(walls.tops.shape[1]):
            pieces = []
            for side, sign in ((0, 1.0), (1, -1.0)):
                told = taken[side, k]
                # up to the material before the teeth, so that no fin stays there
                both = np.flatnonzero((told[1:] | told[:-1]) & (np.minimum(left.tops[side, k, 1:], left.tops[side, k, :-1]) > NOTHING))
                ends = np.column_stack(
                    [left.x[both], sign * left.tops[side, k, both], left.x[both + 1], sign * left.tops[side, k, both + 1]]
                )
                pieces.append(frame.to(old.back(ends.reshape(-1, 2))).reshape(-1, 4))
            kernels.overlay(np.ascontiguousarray(np.concatenate(pieces)), walls.start, walls.spacing, NOTHING, walls.tops[:, k])

    def _turns(self, move: int, found: March, frame: PathFrame, walls: Walls, cut: Cut, here: FloatArray, x: FloatArray) -> MilledPart:
        """What happened, turn by turn; a turn that is not whole waits for the next part."""
        assert self.before is not None
        into = np.eye(3)
        into[:2, :2] = frame.turn
        places = np.column_stack([frame.back(np.column_stack([x, np.zeros_like(x)])), np.full(x.size, here[2])])
        rows = np.concatenate([self.rest_of_turn, np.column_stack([found.time, places, found.force @ into, found.tip @ into])])
        steps = self.steps
        count = len(rows) // steps
        self.rest_of_turn = rows[count * steps :]
        turns = rows[: count * steps].reshape(count, steps, 10)
        mean, across = turns.mean(axis=1), turns[..., 4:6]
        return MilledPart(
            move,
            mean[:, 1:4],
            mean[:, 0],
            mean[:, 4:7],
            np.linalg.norm(across, axis=2).max(axis=1, initial=0.0),
            mean[:, 7:],
            turns[:, 0, 7:9],
            np.linalg.norm(np.diff(turns[:, :: steps // self.alike, 7:9], axis=1), axis=2).max(axis=1, initial=0.0),
            np.linalg.norm(np.ptp(turns[..., 7:9], axis=1), axis=1),
            frame,
            walls,
            self.before[2],
            float(x[-1] - (x[min(steps, x.size - 1)] - x[0])),
            cut.parts.radius,
            cut.parts.height,
            float(here[2]),
            found.unsettled,
            found.lost,
        )


def _same_poles(one: object, two: object) -> bool:
    return one is two or (one is not None and two is not None and np.array_equal(one.pole, two.pole))  # type: ignore[attr-defined]
