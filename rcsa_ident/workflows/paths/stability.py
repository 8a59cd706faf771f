"""A tool along a path: on every move its engagement, how far it is from chatter, its force, and where it leaves the wall."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import Map
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.conditions import AnyEngagement, Engagement, EngagementMap
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.machine.machine import TipSource
from rcsa_ident.machine.robot.posed_robot import PosedRobot
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.margins import FARTHEST
from rcsa_ident.toolpath.engagement import PathEngagement
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.workflows.paths.judged_cuts import Cut, judged
from rcsa_ident.workflows.paths.robot_milling import feed_turn
from rcsa_ident.workflows.robot_postures import following
from rcsa_ident.workflows.tool_change import ToolChange

#: Entry and exit, direction of the feed [rad] and share of the depth within which two cuts count as one; arcs that change less along the
#: edge are the same all along it.
SAME_ANGLE, SAME_WAY, SAME_DEPTH = np.radians(2.0), np.radians(5.0), 0.02
#: What is taken off one wall once more is no cut: share of the cutter's diameter, and of a turn for angles as near to a wall.
_GRAZING = 1e-3
#: Machines drawn from what is left open of one: of the twentieth that bears least ten are left.
DRAWS = 200
#: Way on which a robot counts as standing at one posture [m].
EVERY = 0.02


class Station(NamedTuple):
    """Who carries the tool on a move, and which way the feed goes in the X-Y plane of that machine [rad]."""

    machine: TipSource
    feed_angle: float


def stations_along(machine: TipSource, tooling: Tooling, path: ToolPath) -> Callable[[int], Station]:
    """Return who carries a tool on each move of a path in X, Y and Z of a machine, or of a robot's base.

    A robot's posture is that at the first place of every `EVERY` of the way, its tip's X the base's as far as the tool's axis allows.

    Raises `InputError` if the robot does not reach such a place; it says which.
    """
    ways = path.moves
    if not isinstance(machine, PosedRobot):
        angles = np.arctan2(ways[:, 1], ways[:, 0])
        return lambda move: Station(machine, float(angles[move]))
    robot = machine.robot
    along = np.concatenate([[0.0], np.cumsum(path.lengths)])[:-1]
    _, first, which = np.unique(np.floor(along / EVERY), return_index=True, return_inverse=True)
    postures = following(robot.model, machine.angles, path.places[first], path.axes[first], tooling.assembly)
    turns = [feed_turn(robot, posture, np.array([1.0, 0.0, 0.0])) for posture in postures]
    posed = [replace(machine, angles=posture, turn=turn) for posture, turn in zip(postures, turns, strict=True)]

    def station(move: int) -> Station:
        at = int(which[move])
        axis, way = path.axes[first[at]], ways[move]
        across = way - axis * (axis @ way)
        # straight along its axis a tool has no feed direction
        plunges = np.linalg.norm(across) < 1e-6 * np.linalg.norm(way)
        return Station(posed[at], 0.0 if plunges else turns[at] - feed_turn(robot, postures[at], way))

    return station


@dataclass(frozen=True, slots=True, eq=False)
class CutsAlong:
    """What a tool does on the moves of a path; nan, and nothing told, where it cuts nothing.

    `depth` [m], shape (k,): of material on its edges, along its axis
    `speed`, `feed_per_tooth` [rad/s, m], shape (k,)
    `margin`, shape (k,): how many times as deep as it is a cut becomes unstable, where it is the same all along the edge; else how many
        times stronger the material would have to be. Below 1 it chatters; `FARTHEST` says as much or more.
    `of_strength`: array of bool, shape (k,); where the margin is the material's: of cuts that change along the edge
    `margin_low`, shape (k,): what 95 % of the drawn machines reach; the margin itself where none are drawn
    `chatter_frequency` [rad/s], shape (k,): at the limit
    `mean_force` [N], shape (k, 3): on the tool along the feed, its normal and the axis towards the spindle
    `peak_force` [N], shape (k,): across the axis, in a revolution
    `deflection` [m], shape (k,): of the tip across the axis, the largest in a revolution of a stable cut
    `form_error` [m], shape (k,): of the wall that is left, mean along the edge; positive where material is left. nan where no wall is, or
        the cut is unstable
    `groups`: different cuts that were computed
    """

    depth: FloatArray
    speed: FloatArray
    feed_per_tooth: FloatArray
    margin: FloatArray
    of_strength: np.ndarray
    margin_low: FloatArray
    chatter_frequency: FloatArray
    mean_force: FloatArray
    peak_force: FloatArray
    deflection: FloatArray
    form_error: FloatArray
    groups: int
    warnings: tuple[str, ...]

    @property
    def limit(self) -> FloatArray:
        """Depth at which each cut would become unstable, shape (k,) [m]: margin times depth; infinite beyond `FARTHEST`.

        nan of cuts that change along the edge: deeper they would be other cuts.
        """
        limit = np.where(self.margin >= FARTHEST, np.inf, self.margin * self.depth)
        return np.where(self.of_strength, np.nan, limit)

    @property
    def cutting(self) -> np.ndarray:
        """Which moves cut, shape (k,)."""
        return np.isfinite(self.margin)


def cuts_along(
    change: ToolChange,
    path: ToolPath,
    engaged: PathEngagement,
    stations: Callable[[int], Station],
    progress: Callable[[int, int], None] | None = None,
    map_: Map = map,
) -> CutsAlong:
    """Return what a tool does on every move of a path.

    Cuts that differ by less than two degrees in entry and exit, five in direction and two hundredths in depth are computed once. A chip of
    less than a thousandth of the diameter is no cut.

    Parameters
    ----------
    change : ToolChange
        The tooling, and the cut with its material; what the path says takes the place of its engagement, feed and speeds. Where the path
        has no spindle speed its only one counts.
    path : ToolPath
    engaged : PathEngagement
        Of the same path.
    stations : callable
        Who carries the tool on a move.
    progress : callable, optional
        Told how many different cuts are done, and of how many.
    map_ : callable, optional
        Over tasks of some cuts: the builtin, a pool's, a cluster's. The answer is the same, to the last digit.

    Raises
    ------
    InputError
        If the path has no feed, or nobody told a spindle speed, on a move that cuts.
    """
    moves = len(path) - 1
    told = path.speed[1:]
    speed = np.where(np.isnan(told), change.speeds[0], told) if change.speeds.size == 1 else told
    teeth = change.tooling.cutter.teeth
    depths, feed, of_strength = np.full(moves, np.nan), np.full(moves, np.nan), np.zeros(moves, dtype=bool)
    groups: dict[tuple[object, ...], list[int]] = {}
    cuts: list[Cut] = []
    tips: dict[tuple[object, ...], tuple[int, ToolChange]] = {}
    for move in range(moves):
        found = engaged.at(move)
        if found is None or not path.cutting[move] or not float(found.heights[-1]) > 0.0:
            continue
        if not speed[move] > 0.0 or not path.feed[move + 1] > 0.0:
            lacking = "feed" if speed[move] > 0.0 else "spindle speed"
            raise InputError(lacking, f"none on the move to {_told(path, move)}", f"a {lacking} on every move that cuts")
        engagement, depth = plain(found, change.tooling.cutter)
        if isinstance(engagement, Engagement) and engagement.immersion < _GRAZING:
            continue
        station = stations(move)
        depths[move] = depth
        feed[move] = 2.0 * np.pi * path.feed[move + 1] / (teeth * speed[move])
        of_strength[move] = not isinstance(engagement, Engagement)
        alike = id(station.machine), _rounded(station, engagement, depth), round(speed[move], 6), round(1e9 * feed[move])
        if alike not in groups:
            per_tooth = float(feed[move])
            spec = replace(change.cut, engagement=engagement, feed_angle=station.feed_angle, feed_per_tooth=per_tooth, speed_variation=None)
            one = replace(change, machine=station.machine, cut=spec, speeds=speed[move : move + 1])
            process = one.process
            place = id(station.machine), float(speed[move]), process.is_plain
            cuts.append(Cut(tips.setdefault(place, (len(tips), one))[0], process, depth))
        groups.setdefault(alike, []).append(move)
    answers = judged([each for _, each in tips.values()], cuts, map_, progress)
    margins, columns = (np.full((3, moves), np.nan) for _ in range(2))
    mean = np.full((moves, 3), np.nan)
    for which, answer in zip(groups.values(), answers, strict=True):
        margins[:, which] = np.array(answer.margin[:3])[:, None]
        columns[:, which] = np.array(answer[2:])[:, None]
        mean[which] = answer.mean_force
    # how thin a chip is the path says, and not whoever gave it
    warnings = [each for answer in answers for each in answer.margin.warnings if not each.startswith("radial immersion")]
    spindle = np.where(np.isnan(depths), np.nan, speed)
    (times, low, chatter), (peak, moved, error) = margins, columns
    said = _alike_once(warnings)
    return CutsAlong(depths, spindle, feed, times, of_strength, low, chatter, mean, peak, moved, error, len(groups), said)


def _alike_once(warnings: Sequence[str]) -> tuple[str, ...]:
    """The first of all sentences that differ in their numbers alone: every cut has its own."""
    first: dict[str, str] = {}
    for each in warnings:
        first.setdefault(re.sub(r"[\d.]+", "#", each), each)
    return tuple(first.values())


def plain(found: EngagementMap, cutter: Cutter) -> tuple[AnyEngagement, float]:
    """Return an engagement as plain as it is, and the depth that it is about [m].

    One arc in front of the tool that is the same at all heights, to `SAME_ANGLE`, is an `Engagement` over the height of the material, which
    begins at the tip unless the cutter is a cylinder; all else stays a map, up to its top.
    """
    # arcs that end within a degree of 0 or 180 end there: a wall is left
    near, z = 0.5 * SAME_ANGLE, found.z
    start = np.where(found.start < near, 0.0, found.start)
    end = np.where(np.abs(found.end - np.pi) < near, np.pi, found.end)
    start, end = np.minimum(start, end), end
    alone = np.unique(z).size == z.size and found.feed_rise == 0.0 and (cutter.is_cylinder or z[0] < 1e-6)
    if alone and np.ptp(start) <= SAME_ANGLE and np.ptp(end) <= SAME_ANGLE:
        entry, leave = float(np.mean(start)), min(float(np.mean(end)), np.pi)
        if leave > entry:
            return Engagement(entry, leave), float(z[-1] - z[0])
    return EngagementMap(z, start, end, found.feed_rise), float(z[-1])


def _rounded(station: Station, engagement: AnyEngagement, depth: float) -> tuple[object, ...]:
    """What two cuts that count as one have in common."""
    step = np.log(depth) // np.log1p(SAME_DEPTH)
    turn = round(station.feed_angle / SAME_WAY)
    if isinstance(engagement, Engagement):
        return step, turn, round(engagement.entry / SAME_ANGLE), round(engagement.exit / SAME_ANGLE)
    assert isinstance(engagement, EngagementMap)
    arcs = np.round(np.concatenate([engagement.start, engagement.end]) / SAME_ANGLE).astype(int)
    return step, turn, arcs.tobytes(), np.round(engagement.z / (SAME_DEPTH * depth)).astype(int).tobytes()


def _told(path: ToolPath, move: int) -> str:
    line = int(path.line[move + 1])
    place = ", ".join(f"{1e3 * v:.3f}" for v in path.places[move + 1])
    return f"{place} mm" + (f", line {line}" if line else "")


def described(found: CutsAlong, path: ToolPath) -> str:
    """Return in a sentence where a path is nearest to chatter, or beyond it."""
    cutting = np.flatnonzero(found.cutting)
    if not cutting.size:
        return "nothing is cut"
    worst = int(cutting[np.argmin(found.margin[cutting])])
    speed, depth = to_rpm(float(found.speed[worst])), 1e3 * found.depth[worst]
    chatters = int(np.count_nonzero(found.margin[cutting] < 1.0))
    doubtful = int(np.count_nonzero(found.margin_low[cutting] < 1.0)) - chatters
    where = f"{speed:.0f} rev/min, {depth:.2f} mm deep, on the move to {_told(path, worst)}"
    could = "material could be {:.2f} times as strong there" if found.of_strength[worst] else "could be {:.2f} times as deep"
    could = could.format(found.margin[worst])
    may = f"; {doubtful} more may, as far as the machine is known" if doubtful else ""
    if chatters:
        return f"{chatters} of {cutting.size} moves chatter{may}; the worst {could}: {where}"
    first = f"{doubtful} of {cutting.size} moves may chatter, as far as the machine is known" if doubtful else "no move chatters"
    return f"{first}; the nearest to it {could}: {where}"
