"""Stable and unstable cuts over speed and depth: the boundary traced, or every point looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import AXIAL_DEPTH
from rcsa_ident.base.shown import Drawn
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import asked_speeds
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multiplier_limits import ROUGH, Growth, longest_step
from rcsa_ident.stability.tip_modes import TipModes

#: Points along the side of a block at the start.
_BLOCK = 4
#: A block whose corners are alike is divided where one of them comes so near to zero, as a share of their range.
_NEAR = 0.5
#: Depths on the boundary that are compared with those of a shorter step, and how much shorter.
_PROBES, _SHORTER = 5, 1.6


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StabilityMap(Drawn):
    """How fast the most persistent vibration grows, over speed and depth.

    Parameters
    ----------
    spindle_speed : array, shape (n,) [rad/s]
    depth : array, shape (k,) [m]
    growth : array, shape (n, k) [-]
        Logarithm of its multiplier per tooth period: stable below 0.
    computed : array of bool, shape (n, k)
        Where `growth` was computed; elsewhere it stands between its neighbours, far from the boundary.
    crossing_speed, crossing_depth : arrays, shape (c,) [rad/s], [m]
        All points of the boundary at the map's speeds, by speed, then depth.
    evaluations : int
    error : float [-]
        Largest change of some of the crossing depths with a shorter step, as a share of them.
    method : str

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> import numpy as np
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> chart = ri.stability_map(tip, cut, ri.rpm(8000, 16_000, 2000), np.linspace(0.2e-3, 2e-3, 10))
    >>> (1e3 * chart.limit_depth).round(2)
    array([0.62, 0.33, 1.25, 0.82, 0.33])
    """

    spindle_speed: FloatArray
    depth: FloatArray
    growth: FloatArray
    computed: NDArray[np.bool_]
    crossing_speed: FloatArray
    crossing_depth: FloatArray
    evaluations: int
    error: float
    method: str

    def __post_init__(self) -> None:
        for name in ("spindle_speed", "depth", "growth", "crossing_speed", "crossing_depth"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "computed", frozen(self.computed, np.bool_))
        for name in ("growth", "computed"):
            shape = (self.spindle_speed.size, self.depth.size)
            if getattr(self, name).shape != shape:
                raise InputError(name, getattr(self, name).shape, f"shape {shape}: speeds, depths")

    @property
    def stable(self) -> NDArray[np.bool_]:
        """True where every vibration dies away, shape (n, k)."""
        return self.growth < 0.0

    @property
    def limit_depth(self) -> FloatArray:
        """The smallest depth at which stability is lost, shape (n,) [m]; infinite where there is none up to the map's largest."""
        limit = np.full(self.spindle_speed.size, np.inf)
        for speed, depth in zip(self.crossing_speed[::-1], self.crossing_depth[::-1], strict=True):
            limit[self.spindle_speed == speed] = depth
        return np.where(self.growth[:, 0] >= 0.0, self.depth[0], limit)

    @classmethod
    def joined(cls, parts: Sequence[StabilityMap]) -> StabilityMap:
        """Return the maps of several blocks of speeds, which have the same depths, as one with rising speeds."""
        speed = np.concatenate([part.spindle_speed for part in parts])
        back = np.argsort(speed)
        crossing = np.concatenate([part.crossing_speed for part in parts])
        order = np.argsort(crossing, kind="stable")
        return cls(
            speed[back],
            parts[0].depth,
            np.concatenate([part.growth for part in parts])[back],
            np.concatenate([part.computed for part in parts])[back],
            crossing[order],
            np.concatenate([part.crossing_depth for part in parts])[order],
            sum(part.evaluations for part in parts),
            max(part.error for part in parts),
            parts[0].method,
        )

    def __str__(self) -> str:
        n, k = self.growth.shape
        speed, depth = to_rpm(self.spindle_speed), 1e3 * float(self.depth[-1])
        cuts = f"{n} x {k} cuts, {speed.min():.0f} to {speed.max():.0f} rev/min up to {depth:.3g} mm"
        return f"{self.method}, {cuts}: {100.0 * float(np.mean(self.stable)):.0f} % stable"


@runtime_checkable
class MonodromyMethod(Protocol):
    """A method that finds the limit from Floquet multipliers: it also knows them at every other depth."""

    name: ClassVar[str]

    def monodromy(self, tip: TipModes, process: MillingProcess) -> MonodromyOperator:
        """Return the cut's monodromy operator."""
        ...


def stability_map(
    tip: TipModes,
    process: MillingProcess,
    speeds: FloatArray,
    depths: FloatArray,
    method: MonodromyMethod | None = None,
    full: bool = False,
    tolerance: float = 5e-3,
) -> StabilityMap:
    """Return the map of stable and unstable cuts.

    Parameters
    ----------
    tip : TipModes
    process : MillingProcess
    speeds : array, shape (n,) [rad/s], ascending
    depths : array, shape (k,) [m], ascending
    method : FullDiscretisation (default) or SemiDiscretisation
    full : bool
        Compute every point. By default blocks of the grid are divided only where the boundary passes, or may.
    tolerance : float
        Of the crossings' depths, relative.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> import numpy as np
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> print(ri.stability_map(tip, cut, ri.rpm(8000, 16_000, 500), np.linspace(0.1e-3, 2e-3, 20)))
    full-discretisation, 17 x 20 cuts, 8000 to 16000 rev/min up to 2 mm: 43 % stable
    """
    speeds, depths = (_ascending(name, values) for name, values in (("speeds", speeds), ("depths", depths)))
    asked_speeds(speeds)
    for end in depths[[0, -1]].tolist():
        AXIAL_DEPTH.checked("depths", end)
    chosen: MonodromyMethod = FullDiscretisation() if method is None else method
    cut = chosen.monodromy(tip, process)
    step = longest_step(cut)
    known = np.full((speeds.size, depths.size), np.nan)
    columns = [Growth(cut, float(speed), step, ROUGH) for speed in speeds]
    exact = [Growth(cut, float(speed), step) for speed in speeds]

    def at(i: int, j: int) -> float:
        if np.isnan(known[i, j]):
            known[i, j] = columns[i](float(depths[j]))
        return float(known[i, j])

    growth = np.empty_like(known)
    if full:
        for i in range(speeds.size):
            for j in range(depths.size):
                growth[i, j] = at(i, j)
    else:
        blocks = [(i, k, j, m) for i, k in _parts(speeds.size) for j, m in _parts(depths.size)]
        while blocks:
            i, k, j, m = blocks.pop()
            corners = at(i, j), at(i, m), at(k, j), at(k, m)
            if max(k - i, m - j) <= 1:
                continue
            low, high = min(corners), max(corners)
            if low * high > 0.0 and min(abs(low), abs(high)) > _NEAR * (high - low):
                s, t = np.linspace(0.0, 1.0, k - i + 1)[:, None], np.linspace(0.0, 1.0, m - j + 1)
                one, two = corners[0] + t * (corners[1] - corners[0]), corners[2] + t * (corners[3] - corners[2])
                growth[i : k + 1, j : m + 1] = one + s * (two - one)
                continue
            first = [(i, (i + k) // 2), ((i + k) // 2, k)] if k - i > 1 else [(i, k)]
            second = [(j, (j + m) // 2), ((j + m) // 2, m)] if m - j > 1 else [(j, m)]
            blocks += [(*a, *b) for a in first for b in second]
        growth = np.where(np.isnan(known), growth, known)
        # the boundary is followed into blocks that did not look as if it passed there
        while (unsure := _beside_the_boundary(growth) & np.isnan(known)).any():
            for i, j in zip(*np.nonzero(unsure), strict=True):
                growth[i, j] = at(int(i), int(j))
    computed = ~np.isnan(known)
    crossings: list[tuple[int, float, float]] = []
    for i, j in zip(*np.nonzero(np.diff(growth >= 0.0, axis=1)), strict=True):
        i, j = int(i), int(j)
        low, high, at_low, at_high = float(depths[j]), float(depths[j + 1]), at(i, j), at(i, j + 1)
        guess = low - at_low * (high - low) / (at_high - at_low)
        crossings.append((i, *_crossing(exact[i], low, high, guess, tolerance)))
    error, probes = 0.0, []
    for probe in crossings[:: max(1, len(crossings) // _PROBES)]:
        i, depth, slope = probe
        probes.append(Growth(cut, float(speeds[i]), step / _SHORTER))
        error = max(error, abs(probes[-1](depth) / slope) / depth)
    places = np.array([i for i, _, _ in crossings], dtype=int)
    return StabilityMap(
        speeds,
        depths,
        growth,
        computed,
        speeds[places],
        np.array([depth for _, depth, _ in crossings]),
        sum(column.calls for column in (*columns, *exact, *probes)),
        error,
        chosen.name,
    )


def _beside_the_boundary(growth: FloatArray) -> NDArray[np.bool_]:
    """Points with one of the other sign up to two rows and columns away: where lobes meet, gaps and tips are no wider than a point."""
    grows = np.pad(growth >= 0.0, 2, mode="edge")
    here, beside = grows[2:-2, 2:-2], np.zeros(growth.shape, dtype=bool)
    for i in range(5):
        for j in range(5):
            beside |= grows[i : i + here.shape[0], j : j + here.shape[1]] != here
    return beside


def _crossing(growth: Growth, low: float, high: float, guess: float, tolerance: float) -> tuple[float, float]:
    """Depth and slope of a change of sign between two depths, first looked for about `guess`."""
    width = 2.0 * tolerance * guess
    below, above = max(guess - width, low), min(guess + width, high)
    ends = growth(below), growth(above)
    if ends[0] * ends[1] >= 0.0:
        if growth(low) * growth(high) >= 0.0:
            # only a rough look saw it: one of the grid's points lies on the boundary, within what a rough look may be off
            root = low if abs(growth(low)) < abs(growth(high)) else high
            return root, (growth(high) - growth(low)) / (high - low)
        root = float(scipy.optimize.brentq(growth, low, high, xtol=0.5 * tolerance * low, rtol=1e-12))
        below, above = 0.999 * root, 1.001 * root
        ends = growth(below), growth(above)
    # nearer than the tolerance a straight line is good enough
    slope = (ends[1] - ends[0]) / (above - below)
    return below - ends[0] / slope, slope


def _parts(size: int) -> list[tuple[int, int]]:
    """A line of points cut into blocks that share their ends."""
    edges = [*range(0, size - 1, _BLOCK), size - 1]
    return list(pairwise(edges)) or [(0, 0)]


def _ascending(name: str, values: FloatArray) -> FloatArray:
    found = np.atleast_1d(np.asarray(values, dtype=float))
    if found.ndim != 1 or found.size == 0 or not np.all(np.isfinite(found)) or found[0] <= 0.0 or np.any(np.diff(found) <= 0.0):
        raise InputError(name, f"{found.size} values", "one or more finite values above 0, ascending")
    return found
