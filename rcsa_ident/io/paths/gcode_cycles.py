"""What one line of G-code does in several moves: holes of canned cycles, and corners that a straight line rounds or cuts off."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.toolpath.arcs import chord_count, chords

#: Cycles by how the tool comes back: at once, at the feed, in steps.
_RAPID_BACK, _FED_BACK, _IN_STEPS = (73, 76, 81, 82, 86, 88), (74, 84, 85, 89), (83,)
CYCLES = (*_RAPID_BACK, *_FED_BACK, *_IN_STEPS)
#: Steps of a hole, and holes of a line.
_MOST_STEPS, MOST_REPEATS = 10_000, 9_999
#: Directions that differ by less are one [rad], and the slack of a corner's legs [mm].
_STRAIGHT, _SLACK = 1e-6, 1e-6


@dataclass(slots=True)
class Cycle:
    """A canned cycle as it stands from line to line, in millimetres.

    `code`: one of `CYCLES`
    `initial`: height at which the tool stood before
    `bottom`, `clearance`, `step`: heights of Z and R, and Q; no number where nobody told
    """

    code: int
    initial: float
    bottom: float = math.nan
    clearance: float = math.nan
    step: float = math.nan

    def told(self, z: float | None, r: float | None, q: float | None, absolute: bool) -> None:
        """Take the words of a line: heights, or steps from where the tool stood and from R."""
        if r is not None:
            self.clearance = r if absolute else self.initial + r
        if z is not None:
            self.bottom = z if absolute else self.clearance + z
        self.step = self.step if q is None else abs(q)
        if math.isnan(self.bottom) or math.isnan(self.clearance):
            raise InputError("cycle", f"G{self.code} without Z or R", "both, of the first hole at least")
        if self.bottom > self.clearance:
            raise InputError("cycle", f"Z {self.bottom:g} mm above R {self.clearance:g} mm", "a hole that goes down from R")
        if self.code in _IN_STEPS and not (self.step > 0.0 and (self.clearance - self.bottom) / self.step <= _MOST_STEPS):
            found = "nothing" if math.isnan(self.step) else f"{self.step:g} mm"
            raise InputError("Q", found, f"the step of a hole, above 0, at most {_MOST_STEPS} of them")

    def hole(self, at: list[float], x: float, y: float, to_initial: bool) -> list[tuple[list[float], bool]]:
        """Return the places of a hole, and whether the tool goes there by a rapid move.

        Across where the tool stands, R or higher, to R, down to Z as the code says, and back to R or to where it stood before the cycle.
        """
        level = max(self.initial, self.clearance) if to_initial else self.clearance
        across = max(at[2], self.clearance)
        moves = [([*at[:2], across], True), ([x, y, across], True), ([x, y, self.clearance], True)]
        if self.code in _IN_STEPS:
            depth = self.clearance
            while depth - self.step > self.bottom:
                moves += [([x, y, depth], True), ([x, y, depth - self.step], False), ([x, y, self.clearance], True)]
                depth -= self.step
            moves.append(([x, y, depth], True))
        moves.append(([x, y, self.bottom], False))
        if self.code in _FED_BACK:
            moves.append(([x, y, self.clearance], False))
        return [*moves, ([x, y, level], True)]


@dataclass(frozen=True, slots=True)
class Corner:
    """A corner that waits for the move behind it, in millimetres.

    `kind`: ``R`` of a radius, ``C`` of a chamfer
    `size`: the radius, or how far from the corner the chamfer begins and ends
    `start`, `place`: where the move to the corner begins, and the corner itself
    `number`: line of the program
    """

    kind: str
    size: float
    start: list[float]
    place: list[float]
    feed: float
    number: int

    def places(self, target: list[float], plane: tuple[int, int, int], tolerance: float) -> list[list[float]]:
        """Return the places from the end of the first leg to the beginning of the second, which leads to `target`."""
        u, v, w = plane
        legs = [np.array([b[u] - a[u], b[v] - a[v]]) for a, b in ((self.start, self.place), (self.place, target))]
        if self.start[w] != self.place[w] or target[w] != self.place[w]:
            raise self.refused("moves that leave the plane", "two moves in the plane")
        lengths = [float(np.hypot(*leg)) for leg in legs]
        if min(lengths) <= _SLACK:
            raise self.refused("a move without a way", "two moves with a way")
        first, second = (leg / length for leg, length in zip(legs, lengths, strict=True))
        turn = math.atan2(first[0] * second[1] - first[1] * second[0], float(first @ second))
        if abs(turn) < _STRAIGHT:
            return [self.place]
        back = self.size * (math.tan(0.5 * abs(turn)) if self.kind == "R" and abs(turn) < math.pi - _STRAIGHT else 1.0)
        if abs(turn) > math.pi - _STRAIGHT or back > min(lengths) + _SLACK:
            raise self.refused(f"{self.size:g} mm between moves of {lengths[0]:.6g} and {lengths[1]:.6g} mm", "one that fits between them")
        begin, end = np.array(self.place), np.array(self.place)
        begin[[u, v]] -= back * first
        end[[u, v]] += back * second
        if self.kind == "C":
            return [begin.tolist(), end.tolist()]
        side = math.copysign(1.0, turn) * self.size
        centre = begin[u] - side * first[1], begin[v] + side * first[0]
        count = chord_count(1e-3 * self.size, turn, tolerance)
        places: FloatArray = chords(begin, end, centre, plane, turn, count)
        return [begin.tolist(), *places.tolist()]

    def refused(self, found: str, allowed: str) -> InputError:
        """Return the error of a corner, named by its own line."""
        return InputError(f",{self.kind} of line {self.number}", found, f"{allowed}, G1 both")
