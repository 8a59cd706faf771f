"""How many times stronger the material may be until a cut of one depth loses stability: the margin of cuts that change along the edge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.optimize

from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multiplier_limits import BEFORE, PASSES, ROUGH, Passage, dominant, longest_step
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.stability_map import MonodromyMethod
from rcsa_ident.stability.tip_modes import TipModes, require_modes
from rcsa_ident.stability.zero_order import ZeroOrder

#: How far beside a strength that is about right the right one is looked for at first, as a factor.
_BESIDE = 1.1
#: Said of a margin where it is no multiplier that decides.
PASSING = f"the margin is that to a vibration which grows a thousandfold within {PASSES} teeth, although it would die away after them"


class Strength(NamedTuple):
    """What a cut would bear.

    `times`: how many times its K_tc may be what it is; below 1 it chatters
    `chatter_frequency` [rad/s]: at that strength; not a number where even the largest is stable
    """

    times: float
    chatter_frequency: float
    warnings: tuple[str, ...] = ()


class Search(NamedTuple):
    """Where a strength is looked for.

    `most`: nobody asks for more, nor for less than one over it
    `tolerance`: of the answer, as a share
    `near`: what a similar cut bears; not a number where none is known
    """

    most: float
    tolerance: float
    near: float = np.nan

    @property
    def end(self) -> float:
        """Logarithm of the largest."""
        return float(np.log(self.most))


def strength(
    method: StabilityMethod, tip: Receptance | TipModes, process: MillingProcess, speed: float, depth: float, search: Search
) -> Strength:
    """Return how many times stronger the material may be.

    `tip`: as the method wants it
    `speed` [rad/s]; `depth` [m]
    """
    if isinstance(method, ZeroOrder):
        times, chatter = method.strength(tip, process, speed, depth, search.most)
        return Strength(min(max(times, 1.0 / search.most), search.most), chatter)
    if isinstance(method, MonodromyMethod):
        return _by_multipliers(method, require_modes(tip, method.name), process, speed, depth, search)
    return _by_limits(method, tip, process, speed, depth, search)


def _harder(process: MillingProcess, log_times: float) -> MillingProcess:
    known = process.coefficients
    return replace(process, coefficients=replace(known, tangential=float(np.exp(log_times)) * known.tangential))


def _by_multipliers(
    method: MonodromyMethod, tip: TipModes, process: MillingProcess, speed: float, depth: float, search: Search
) -> Strength:
    """Where the largest multiplier is one in size, or a vibration grows too much before it dies away."""
    start = None

    def cut(log_times: float) -> MonodromyOperator:
        return method.monodromy(tip, _harder(process, log_times))

    def growth(log_times: float) -> float:
        nonlocal start
        own = cut(log_times)
        found = own.multiplier(speed, depth, longest_step(own), start, residual=ROUGH)
        start = found.vector
        return float(np.log(max(abs(found.value), 1e-300)))

    def passing(log_times: float) -> float:
        own = cut(log_times)
        return Passage(own, speed, longest_step(own))(depth)

    low, high = -search.end, search.end
    told: tuple[str, ...] = ()
    at = _first(growth, low, high, search)
    high = min(at, high) + float(np.log(BEFORE))
    if high > low and passing(high) >= 0.0:
        at, told = _first(passing, low, high, search), (PASSING,)
    if np.isinf(at):
        return Strength(search.most, np.nan)
    own = cut(at)
    return Strength(float(np.exp(at)), dominant(own.multiplier(speed, depth, longest_step(own), start, waves=True)), told)


def _by_limits(
    method: StabilityMethod, tip: Receptance | TipModes, process: MillingProcess, speed: float, depth: float, search: Search
) -> Strength:
    """The least strength at which there is a limit up to the depth, by halving."""

    @cache
    def lobes(log_times: float) -> StabilityLobes:
        return stability_lobes(tip, _harder(process, log_times), np.array([speed]), depth, method, 0)

    low, high = _bracket(lambda at: 1.0 if np.isfinite(lobes(at).limit_depth[0]) else -1.0, -search.end, search.end, search.near)
    if np.isinf(high):
        return Strength(search.most, np.nan, lobes(search.end).warnings)
    while high - low > search.tolerance:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if np.isfinite(lobes(middle).limit_depth[0]) else (middle, high)
    return Strength(float(np.exp(low)), float(lobes(high).chatter_frequency[0]), lobes(high).warnings)


def _bracket(growth: Callable[[float], float], low: float, high: float, near: float) -> tuple[float, float]:
    """Places between which something begins to grow: low twice where it does there already, (high, inf) where not even at the end."""
    end = high
    if np.isfinite(near):
        about, beside = float(np.log(near)), float(np.log(_BESIDE))
        below, above = (float(np.clip(about + step, low, high)) for step in (-beside, beside))
        if growth(above) < 0.0:
            low = above
        elif growth(below) < 0.0:
            return below, above
        else:
            high = below
    if low == end:
        return end, np.inf
    if low == high or growth(low) >= 0.0:
        return low, low
    return (low, high) if growth(high) >= 0.0 else (end, np.inf)


def _first(growth: Callable[[float], float], low: float, high: float, search: Search) -> float:
    """Where something begins to grow; infinite where it does not up to the end, `low` where it does there already."""
    known = cache(growth)
    low, high = _bracket(known, low, high, search.near)
    return high if low == high or np.isinf(high) else float(scipy.optimize.brentq(known, low, high, xtol=0.5 * search.tolerance))
