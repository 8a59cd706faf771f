"""How many modes: as many as the data pay for, by Laplace's approximation of the evidence."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.parameters import pack, split, unpack, with_mode, without_mode
from rcsa_ident.identification.polish import Solution, polish
from rcsa_ident.identification.priors import log_volume, prior_rows

#: The walk stops where the evidence lies this far behind the best seen: nothing below comes back from there.
GIVE_UP = 60.0


def evidence(solution: Solution, misfit: Misfit) -> float:
    """Return minus twice the log evidence, up to a constant of the data: less is better.

    cost + log det(posterior information) - log det(prior information); a mode that the data do not need costs the second
    term, one that they need costs the first.
    """
    sign, volume = np.linalg.slogdet(solution.evaluation.hessian)
    value = float(solution.cost + volume - log_volume(solution.orders, misfit.priors))
    return value if sign > 0.0 and np.isfinite(value) else np.inf


def drop_modes(solution: Solution, misfit: Misfit, report: Callable[[str, float], None] | None = None, smallest: int = 2) -> Solution:
    """Return the best of the models with ever fewer modes, for one axis.

    Every mode in turn is left out for a few steps; the two best omissions are polished and the better one is kept, until the
    evidence has clearly turned.

    Parameters
    ----------
    solution : Solution
        Of one axis, polished.
    smallest : int
        Fewest modes tried.
    """
    best, best_evidence = solution, evidence(solution, misfit)
    here = solution
    while here.orders[0] > smallest:
        (part,), joint = split(here.theta, here.orders)
        m = here.orders[0]
        axis = unpack(part, m)
        trials = []
        for mode in range(m):
            theta = np.concatenate([pack(without_mode(axis, mode)), joint])
            trials.append(polish(misfit, theta, (m - 1,), here.evaluation.nuisance, max_steps=5))
        trials.sort(key=lambda s: s.cost)
        polished = [polish(misfit, t.theta, t.orders, t.evaluation.nuisance, max_steps=60) for t in trials[:2]]
        here = min(polished, key=lambda s: s.cost)
        value = evidence(here, misfit)
        if report is not None:
            report(f"{m - 1} modes", value)
        if value < best_evidence:
            best, best_evidence = here, value
        elif value > best_evidence + GIVE_UP:
            break
    return best


def exchange_modes(
    solution: Solution,
    misfit: Misfit,
    band_hz: tuple[float, float],
    report: Callable[[str, float], None] | None = None,
    places: int = 9,
    rounds: int = 3,
) -> Solution:
    """Return the best model that is reached by adding a mode where it helps most and dropping those that are not needed.

    A walk downwards alone can't mend a mode that once settled in the wrong place; this one can. It ends with the first round
    that gains nothing.

    Parameters
    ----------
    solution : Solution
        Of one axis, polished.
    band_hz : (float, float)
        Lowest and highest line.
    places : int
        Frequencies at which a new mode is tried, in the band and on both sides of it, each with both signs of its slope.
    rounds : int
        Most rounds.
    """
    best, best_evidence = solution, evidence(solution, misfit)
    for _ in range(rounds):
        (part,), joint = split(best.theta, best.orders)
        axis, orders = unpack(part, best.orders[0]), (best.orders[0] + 1,)
        trials = []
        for frequency in np.linspace(0.3 * band_hz[0], 1.5 * band_hz[1], places):
            for slope in (0.1, -0.1):
                theta = np.concatenate([pack(with_mode(axis, 2.0 * np.pi * frequency, (0.1, slope))), joint])
                trials.append(polish(misfit, theta, orders, best.evaluation.nuisance, max_steps=5))
        trials.sort(key=lambda s: s.cost)
        grown = [polish(misfit, t.theta, orders, t.evaluation.nuisance, max_steps=60) for t in trials[:2]]
        reached = drop_modes(min(grown, key=lambda s: s.cost), misfit)
        value = evidence(reached, misfit)
        if report is not None:
            report("exchange", reached.cost)
        if value >= best_evidence - 1.0:
            break
        best, best_evidence = reached, value
    return best


def model_error(solution: Solution, misfit: Misfit, smallest: float = 5e-4) -> tuple[float, ...]:
    """Return, per axis, the share of each line that the residuals show to be unexplained beyond the records' noise.

    The share f solves sum |rest|^2 / (variance + f^2 |h|^2 / 2) = degrees of freedom, the data's less those that parameters
    and cuts have used.

    Parameters
    ----------
    smallest : float
        Floor: no simulated force is better than that.
    """
    jacobian = prior_rows(solution.theta, solution.orders, misfit.priors)[1]
    # parameters that the data have moved away from their priors
    used = solution.theta.size - float(np.trace(np.linalg.solve(solution.evaluation.hessian, jacobian.T @ jacobian)))
    used += 2.0 * len(misfit.data.cut_ids)
    free = max(1.0 - used / misfit.points, 0.1)
    shares = []
    for axis, rest, weight in zip(misfit.data.axes, solution.evaluation.residual.lines, misfit.weight, strict=True):
        squares, size = np.abs(rest) ** 2 / weight, np.abs(axis.measured) ** 2
        shares.append(_share(squares, axis.variance, size, 2.0 * axis.omega.size * free, smallest))
    return tuple(shares)


def _share(squares: FloatArray, noise: FloatArray, size: FloatArray, freedom: float, smallest: float) -> float:
    """Solve for the share by bisection of its logarithm: the sum falls with it."""
    low, high = smallest, 1.0
    # lines of nothing, in a record without noise, say nothing about shares
    told = (noise > 0.0) | (size > 0.0)
    squares, noise, size = squares[told], noise[told], size[told]
    if np.sum(squares / (noise + 0.5 * low**2 * size)) <= freedom:
        return smallest
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        if np.sum(squares / (noise + 0.5 * middle**2 * size)) > freedom:
            low = middle
        else:
            high = middle
    return high
