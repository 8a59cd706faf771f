"""Unknowns beyond the machine's own, for what the lines contradict the model with: each is added to the data of an identification."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.data import AxisData, IdentificationData
from rcsa_ident.identification.made_cuts import USUAL_PAUSE

#: Spreads: of the force in an order of the teeth, of a cut's scale, of a clamping's joint stiffness, and of that with the cuts' loudness.
ORDER, SCALE, GRIP, GIVING_WAY = 0.1, 0.03, 0.08, 0.025
#: Exponent of the speed in the heat of friction; spreads of that, of the time constant's logarithm, of the warmth at the first cut after
#: a long pause, and of a cut's warmth about its course.
FRICTION, FRICTION_SPREAD, TIME_SPREAD, START, OFF_COURSE = 1.25, 0.2, float(np.log(2.0)), 0.4, 0.04
#: For which the spindle turns on at most where the next cut comes later [s].
LONGEST_TURNING = 2.0 * USUAL_PAUSE
#: A pause in which nobody knows what the spindle did [s], and how many of them are told from each other: of more none is.
LONG_PAUSE, MOST_PAUSES = 600.0, 8
#: Steps of its unknowns within which a course is a straight line; and that of their differences.
NEAR, _STEP = 0.3, 1e-4


@dataclass(frozen=True, slots=True)
class OrderFactors:
    """A complex factor on the force along an axis in each order of the spindle, one for all cuts of like engagement and feed.

    The machine depends on the frequency, order times speed, and the force on the order alone: that tells them apart. The factors stand
    for the law of the chip, the force at the edge, and the angle at which teeth enter.

    `keys`: tuple of (int, int, int); axis, kind of cut and order that have one
    """

    keys: tuple[tuple[int, int, int], ...]
    spread: float = ORDER

    def on(self, data: IdentificationData) -> IdentificationData:
        """Return the same data with the factors' logarithms, real and imaginary part each, as further unknowns."""
        known = {key: k for k, key in enumerate(self.keys)}
        slopes = []
        for i, axis in enumerate(data.axes):
            slope = np.zeros((axis.omega.size, len(known), 2), dtype=complex)
            at = np.array([known.get(key, -1) for key in _orders(data, i, axis)], dtype=np.intp)
            has = np.flatnonzero(at >= 0)
            slope[has, at[has]] = 1.0, 1j
            slopes.append(slope.reshape(axis.omega.size, -1))
        return replace(data.with_unknowns((self.spread,) * (2 * len(known)), slopes), further=(*data.further, self))


@dataclass(frozen=True, slots=True)
class CutScales:
    """A factor on the force of each cut: the material, its width and the edge are not the same in each."""

    cut_ids: tuple[str, ...]

    def on(self, data: IdentificationData) -> IdentificationData:
        """Return the same data with the factors' logarithms as further unknowns."""
        known = {id: k for k, id in enumerate(self.cut_ids)}
        own = np.array([known.get(id, -1) for id in data.cut_ids])
        slopes = [(own[axis.cut][:, None] == np.arange(len(known))).astype(float) for axis in data.axes]
        return replace(data.with_unknowns((SCALE,) * len(known), slopes), further=(*data.further, self))


@dataclass(frozen=True, slots=True)
class Grips:
    """A factor on the joint's stiffnesses for each tooling: it was clamped once, and is another joint the next time."""

    toolings: tuple[str, ...]

    def on(self, data: IdentificationData) -> IdentificationData:
        """Return the same data with the factors' logarithms as further unknowns."""
        own = np.equal.outer(np.array(data.toolings)[data.cut_tooling], np.array(self.toolings)).astype(float)
        return _with_grip(data, own, GRIP, self)


@dataclass(frozen=True, slots=True)
class GivingWay:
    """A joint that gives way with amplitude: its stiffnesses' logarithm changes with the loudness of the cut.

    The answer is the machine in a cut of middle loudness.
    """

    def on(self, data: IdentificationData) -> IdentificationData:
        """Return the same data with that change, for a standard deviation of the cuts' loudness, as a further unknown."""
        return _with_grip(data, loudness(data)[:, None], GIVING_WAY, self)


def _with_grip(data: IdentificationData, changes: FloatArray, spread: float, further: Grips | GivingWay) -> IdentificationData:
    """The data whose joints change in each cut with further unknowns, a column each."""
    first, count = len(data.coefficient_spread), changes.shape[1]
    grip = np.hstack([data.grip, changes]) if data.grip.size else changes
    places = np.append(data.grip_places, first + np.arange(count))
    more = data.with_unknowns((spread,) * count, None)
    return replace(more, grip=grip, grip_places=places, further=(*data.further, further))


def loudness(data: IdentificationData) -> FloatArray:
    """Return how far the flange moves in each cut, as a logarithm in standard deviations about its mean, shape (k,).

    The sensors' noise is much the same in all cuts: lines of a larger force have less of it.
    """
    squares = np.zeros(len(data.cut_ids))
    for axis in data.axes:
        np.add.at(squares, axis.cut, np.abs(axis.measured) ** 2 / np.maximum(axis.noise, 1e-300))
    found = np.log(np.maximum(squares, 1e-300))
    found -= found.mean()
    return found / max(float(found.std()), 1e-300)


@dataclass(frozen=True, slots=True)
class Warming:
    """A stiffness that changes as the machine warms up: by a thermometer, or by the heat of friction of the cuts.

    `cut_ids`: which have a deviation of their own
    `time_constant` [s]: with which the machine takes up the heat of friction; None where a thermometer tells how warm it is
    `exponent` [-]: of the speed in that heat
    `warmed_up`: whether the spindle is thought to have turned before the first cut and in long pauses
    """

    cut_ids: tuple[str, ...]
    time_constant: float | None
    exponent: float = FRICTION
    warmed_up: bool = False

    def on(self, data: IdentificationData) -> IdentificationData:
        """Return the same data with the warmth of each cut in the model.

        What is not known of it are further unknowns: the clock's time constant and exponent, a deviation of each cut, and, of a spindle
        that had turned before, how warm the machine was at the first cut and after each long pause. The answer is for the warm machine: as
        warm as it becomes at each speed, as it was in the cuts on average where it had turned before, or as the highest temperature.
        """
        own = OFF_COURSE * np.equal.outer(np.array(data.cut_ids[: data.cuts]), np.array(self.cut_ids)).astype(float)
        learned, steady = ~data.made.judged, 0.0
        if self.time_constant is None:
            told = data.made.temperature
            middle, ways = (told - told[learned].max()) / np.ptp(told[learned]), own
        else:
            speed, half = data.speed_range
            share = speed / (speed + half)
            # d n^p / dx of n = speed + x half, over the highest speed's
            steady = self.exponent * share**self.exponent * half / speed

            def colder(constant: float, exponent: float) -> FloatArray:
                return warmth(data, constant, exponent, self.warmed_up) - share**exponent

            middle = colder(self.time_constant, self.exponent)
            slower = TIME_SPREAD * (colder(self.time_constant * np.exp(_STEP), self.exponent) - middle) / _STEP
            steeper = FRICTION_SPREAD * (colder(self.time_constant, self.exponent + _STEP) - middle) / _STEP
            ways = np.column_stack([slower, steeper])
            if self.warmed_up:
                ways = np.hstack([ways, START * still_felt(data, self.time_constant)])
                # how warm it would become nobody has seen
                middle, ways = middle - middle[learned].mean(), ways - ways[learned].mean(axis=0)
            ways = np.hstack([ways, own])
        more, first = data.with_unknowns((1.0,) * ways.shape[1], None), len(data.coefficient_spread)
        return replace(more, warmth=middle, course=ways, course_first=first, steady=steady, further=(*data.further, self))

    def moved(self, values: FloatArray) -> Warming | None:
        """Return the same at values of its unknowns, in their order; None where it is near enough for what was linearised."""
        if self.time_constant is None or bool(np.all(np.abs(values[:2]) < NEAR)):
            return None
        constant = self.time_constant * float(np.exp(TIME_SPREAD * np.clip(values[0], -2.0, 2.0)))
        return replace(self, time_constant=constant, exponent=max(self.exponent + FRICTION_SPREAD * float(values[1]), 0.0))


def warmth(data: IdentificationData, time_constant: float, exponent: float = FRICTION, warmed_up: bool = False) -> FloatArray:
    """Return how warm the machine was at each cut, over what it comes to at the highest speed of those that are learned from, shape (k,).

    T' = (n^p - T) / tau with the cut's speed n while it is made and for a usual pause behind it, then none.

    `warmed_up`: before the first cut and in long pauses the spindle turned as in the cuts; by default the machine is cold, and stood
    """
    order, started, first = _sessions(data)
    heat = (data.spindle_speed[: data.cuts][order] / max(sum(data.speed_range), 1e-300)) ** exponent
    before = np.where(first, heat.mean(), np.nan) if warmed_up else np.full(heat.size, np.nan)
    found = np.empty(heat.size)
    found[order] = _taken_up(heat, started, time_constant, before)
    return found


def still_felt(data: IdentificationData, time_constant: float) -> FloatArray:
    """Return what is left at each cut of the warmth before its session, as a share, shape (k, sessions)."""
    order, started, first = _sessions(data)
    found = np.zeros((order.size, int(first.sum())))
    for session, place in enumerate(np.flatnonzero(first)):
        before = np.where(first, 0.0, np.nan)
        before[place] = 1.0
        found[order, session] = _taken_up(np.zeros(order.size), started, time_constant, before)
    return found


def _sessions(data: IdentificationData) -> tuple[np.ndarray, FloatArray, np.ndarray]:
    """Places of the cuts in the order in which they were made, when that was [s], and which came first or after a long pause."""
    order = np.argsort(data.made.started, kind="stable")
    started = data.made.started[order]
    long = np.diff(started) > LONG_PAUSE
    return order, started, np.append(True, long if np.count_nonzero(long) <= MOST_PAUSES else np.zeros_like(long))


def _taken_up(heat: FloatArray, started: FloatArray, time_constant: float, before: FloatArray) -> FloatArray:
    """Warmth at cuts in their order; `before`: warmth before a cut, NaN where it is what the one before has left."""
    found, now = np.empty(heat.size), 0.0
    for k, pause in enumerate(np.diff(started, append=started[-1:] + USUAL_PAUSE)):
        now = now if np.isnan(before[k]) else before[k]
        # half of the cut lies behind its recording's middle
        turning = min(float(pause), LONGEST_TURNING)
        kept = np.exp(-0.5 * turning / time_constant)
        found[k] = now * kept + heat[k] * (1.0 - kept)
        now = (found[k] * kept + heat[k] * (1.0 - kept)) * np.exp((turning - pause) / time_constant)
    return found


#: What may be added to the data of an identification.
Further = OrderFactors | CutScales | Grips | GivingWay | Warming


def further_places(data: IdentificationData) -> list[tuple[Further, slice]]:
    """Return what was added to data without smooth errors, and where its unknowns stand among the coefficients: they are the last ones."""
    counts = [_count(each, data) for each in data.further]
    ends = [*itertools.accumulate(counts, initial=len(data.coefficient_spread) - sum(counts))]
    return [(each, slice(*place)) for each, place in zip(data.further, itertools.pairwise(ends), strict=True)]


def _count(further: Further, data: IdentificationData) -> int:
    match further:
        case OrderFactors(keys=keys):
            return 2 * len(keys)
        case CutScales(cut_ids=ids):
            return len(ids)
        case Grips(toolings=names):
            return len(names)
        case GivingWay():
            return 1
    return data.course.shape[1]


def order_factors(data: IdentificationData) -> OrderFactors:
    """Return the factors that the lines of some data may have."""
    return OrderFactors(tuple(sorted({key for i, axis in enumerate(data.axes) for key in _orders(data, i, axis)})))


def _orders(data: IdentificationData, i: int, axis: AxisData) -> Sequence[tuple[int, int, int]]:
    kinds, orders = data.made.kind[axis.cut], np.rint(axis.order).astype(np.intp)
    return [(i, kind, order) for kind, order in zip(kinds.tolist(), orders.tolist(), strict=True)]
