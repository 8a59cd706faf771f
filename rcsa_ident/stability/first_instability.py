"""The smallest depth at which something starts to grow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.optimize

#: Ratio of the depths at which the growth is looked at before a change of sign is refined, and far from one.
RATIO, _LONG = 1.2, 1.6
#: The same where islands may stand.
CAREFUL = 1.05
#: A peak of the growth below zero that comes so near to it, as a share of the growth without a cut, is looked at closely.
_NEAR = 0.4


def first_loss(
    growth: Callable[[float], float], low: float, high: float, tolerance: float, ratio: float = RATIO, careful_from: float = np.inf
) -> float | None:
    """Return the smallest depth at which `growth` changes from negative to positive, or None if there is none up to `high`.

    The growth is looked at on a ladder of depths; between three of them it may rise above zero and fall again, as it does where
    a lens of period doubling lies below the other lobes: a peak that comes near zero is climbed.

    `growth`: of a depth
    `low`: where it is surely negative; lowered if it is not
    `tolerance`: of the depth, relative
    `ratio`: between steps of the ladder
    `careful_from`: depth beyond which its steps are small whatever the growth: islands may stand there
    """
    seen: dict[float, float] = {}

    def known(depth: float) -> float:
        if depth not in seen:
            seen[depth] = growth(depth)
        return seen[depth]

    low = low if low < high else 0.5 * high
    at_low = known(low)
    for _ in range(40):
        if at_low < 0.0:
            break
        low /= 4.0
        at_low = known(low)
    else:
        return low
    depths, values = [low], [at_low]
    while depths[-1] < high:
        # far below zero, as deep as a tool that does not cut, the ladder's steps are long
        calm = min(max(2.0 * values[-1] / at_low - 1.0, 0.0), 1.0)
        step = ratio + (_LONG - ratio) * calm
        depths.append(min(max(min(depths[-1] * step, careful_from), depths[-1] * CAREFUL), high))
        values.append(known(depths[-1]))
        if values[-1] >= 0.0:
            return _root(known, depths[-2], depths[-1], tolerance)
        if len(values) > 2 and values[-2] > max(values[-3], values[-1]) and values[-2] > _NEAR * at_low:
            found = _climbed(known, depths[-3], depths[-1], tolerance)
            if found is not None:
                return found
    return None


def _climbed(growth: Callable[[float], float], left: float, right: float, tolerance: float) -> float | None:
    """The root below the highest place between two depths, if that is above zero."""
    seen: dict[float, float] = {}

    def down(place: float) -> float:
        seen[place] = growth(float(np.exp(place)))
        return -seen[place]

    scipy.optimize.minimize_scalar(down, bounds=(np.log(left), np.log(right)), method="bounded", options={"maxiter": 10, "xatol": 1e-3})
    above = [place for place, value in seen.items() if value >= 0.0]
    if not above:
        return None
    return _root(growth, left, float(np.exp(min(above))), tolerance)


def _root(growth: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    return float(scipy.optimize.brentq(growth, low, high, xtol=0.5 * tolerance * low, rtol=1e-12))
