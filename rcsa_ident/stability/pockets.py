"""Levels over spindle speed: where they are highest, and how low they are near a speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_rpm

#: Speeds with those beside them, at most: limits, and those of drawn machines, take memory for each.
MOST_SPEEDS = 100_000
#: Two peaks are one pocket unless the level between them falls below this share of the higher one.
POCKET = 0.85
#: Levels that differ by less than this share are one.
SAME = 1e-9
#: A speed beyond those that were asked for may lie this much below what a tolerance needs, as a share.
COARSE = 0.9
#: How far beside a pocket's top a better speed is looked for, and in steps of which share of the speed.
AROUND, FINE = 0.015, 0.005


def peaks(speed: FloatArray, level: FloatArray, count: int = 3) -> list[tuple[float, float]]:
    """Return the speeds at which a level is highest, one for each pocket, the best first.

    `speed`, `level`, shape (n,): in any order; an infinite level is one, too
    `count`: at most so many
    Returns list of (float, float): speed and level of the peaks; the middle of a plateau.
    """
    order = np.argsort(speed)
    speed, limit = np.asarray(speed)[order], np.asarray(level)[order]
    # what one bound gives at every speed is one plateau, whatever rounding makes of it
    edges = np.flatnonzero(np.concatenate([[True], ~np.isclose(limit[1:], limit[:-1], rtol=SAME, atol=0.0)]))
    ends = np.concatenate([edges[1:], [limit.size]]) - 1
    level = limit[edges]
    outside = np.concatenate([[-np.inf], level, [-np.inf]])
    tops = [k for k in range(level.size) if level[k] > outside[k] and level[k] > outside[k + 2]]
    width = speed[ends] - speed[edges]
    tops.sort(key=lambda k: (-level[k], -width[k]))
    chosen: list[int] = []
    for k in tops:
        # an infinite limit and its neighbour are pockets of their own: something finite lies between them
        if all(np.min(level[min(k, c) : max(k, c) + 1]) < POCKET * level[k] for c in chosen):
            chosen.append(k)
    return [(float(0.5 * (speed[edges[k]] + speed[ends[k]])), float(level[k])) for k in chosen[:count]]


@dataclass(frozen=True, slots=True, eq=False)
class Neighbourhood:
    """Close speeds around a pocket's top.

    `tops`: (float, float); between which the top may move
    `speeds`, shape (n,): rising, as far beyond as a tolerance needs
    """

    tops: tuple[float, float]
    speeds: FloatArray


def speeds_around(tops: Sequence[float], tolerance: float, between: tuple[float, float]) -> list[Neighbourhood]:
    """Return the neighbourhood of each of some pockets' tops: `AROUND` on both sides of it.

    `tops`: one nearer to an earlier one than `AROUND` belongs to that
    `tolerance`: as in `least_within_tolerance`
    `between`: (float, float); tops do not move beyond
    """
    step = max(FINE, tolerance / 8.0)
    found: list[Neighbourhood] = []
    kept: list[float] = []
    for top in tops:
        if any(abs(top / other - 1.0) <= AROUND for other in kept):
            continue
        kept.append(top)
        low, high = max(between[0], top * (1.0 - AROUND)), min(between[1], top * (1.0 + AROUND))
        first, last = low * (1.0 - tolerance), high * (1.0 + tolerance)
        speeds = np.linspace(first, last, 1 + int(np.ceil((last - first) / (step * top) - 1e-9)))
        found.append(Neighbourhood((low, high), _apart(np.unique(np.concatenate([speeds, [low, top, high]])))))
    return found


def least_within_tolerance(speed: FloatArray, limit: FloatArray, tolerance: float) -> FloatArray:
    """Return the smallest limit within a share of each speed on both sides, shape (n,).

    `speed`, shape (n,): rising; nothing is known beyond its ends
    `limit`, shape (n,): finite; straight lines in between
    `tolerance`: as 0.02 for 2 %
    """
    if not 0.0 <= tolerance < 0.5:
        raise InputError("tolerance", tolerance, "a share from 0 to below 0.5")
    if np.any(np.diff(speed) < 0.0):
        raise InputError("speeds", np.asarray(speed).tolist(), "speeds that rise [rad/s]")
    if tolerance == 0.0:
        return np.array(limit, dtype=float)
    low, high = speed * (1.0 - tolerance), speed * (1.0 + tolerance)
    least = np.minimum(np.interp(low, speed, limit), np.interp(high, speed, limit))
    first, last = np.searchsorted(speed, low), np.searchsorted(speed, high, side="right")
    # a speed lies within its own tolerance, so that no range is empty; one that ends with the last speed ends before the infinity
    ranges = np.stack([first, last], axis=1).ravel()
    within = np.minimum.reduceat(np.append(limit, np.inf), ranges)[::2]
    return np.minimum(least, within)


def pad_speeds(speeds: FloatArray, tolerance: float, also: Sequence[float] = ()) -> FloatArray:
    """Return the speeds with as many beyond both ends as a tolerance needs, and some of their own between them, rising."""
    speeds = np.unique(np.asarray(speeds, dtype=float))
    step = float(np.min(np.diff(speeds), initial=0.02 * speeds[0] if speeds.size < 2 else np.inf))
    inner = np.concatenate([speeds, np.asarray(also, dtype=float)])
    low, high = inner.min() * (1.0 - tolerance), inner.max() * (1.0 + tolerance)
    count = inner.size + max(speeds[0] - low, 0.0) / step + max(high - speeds[-1], 0.0) / step
    if count > MOST_SPEEDS:
        found = f"{count:.3g} speeds, with those in steps of {to_rpm(step):.3g} rev/min up to a planned cut's"
        raise InputError("speeds", found, f"at most {MOST_SPEEDS}: wider steps, or planned cuts within the range of speeds")
    below = np.arange(speeds[0] - step, low - step, -step) if low < speeds[0] else np.zeros(0)
    above = np.arange(speeds[-1] + step, high + step, step) if high > speeds[-1] else np.zeros(0)
    # a coarse step leads far out, down to a standstill: where it does, the tolerance's own end will do
    below, above = np.where(below > COARSE * low, below, low), np.where(COARSE * above < high, above, high)
    return _apart(np.unique(np.concatenate([inner, below, above])))


def _apart(speeds: FloatArray) -> FloatArray:
    """Rising speeds, none of them twice but for its last digit."""
    return speeds[np.concatenate([[True], np.diff(speeds) > 1e-9 * speeds[1:]])]
