"""Damped Gauss-Newton steps down to the nearest minimum (Levenberg-Marquardt with Marquardt's scaling)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.dynamics.arrays import FloatArray
from rcsa_ident.identification.misfit import Evaluation, Misfit

#: No parameter (all are logarithms or of order one) moves further in one step.
LARGEST_STEP = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """A vector, its cost, and how it was reached.

    Parameters
    ----------
    theta : array, shape (p,)
    orders : tuple of int
    evaluation : Evaluation
        With normal equations.
    converged : bool
        False where the steps ran out.
    steps : int
    """

    theta: FloatArray
    orders: tuple[int, ...]
    evaluation: Evaluation
    converged: bool
    steps: int

    @property
    def cost(self) -> float:
        """chi2 with priors."""
        return self.evaluation.cost


def polish(
    misfit: Misfit,
    theta: FloatArray,
    orders: tuple[int, ...],
    nuisance: FloatArray,
    max_steps: int,
    grid: int = 0,
    tolerance: float = 1e-4,
) -> Solution:
    """Return the minimum near `theta`.

    Parameters
    ----------
    misfit : Misfit
    theta : array, shape (p,)
    nuisance : array, shape (k, 2)
        Where the cuts' own fits start.
    max_steps : int
    grid : int
        Delays tried over a tooth-passing period at every step: needed far from the minimum.
    tolerance : float
        Stop where a step lowers the cost by less than this share.
    """
    here = misfit.evaluate(theta, orders, nuisance, grid, normal=True)
    damping = 1e-2
    for step_number in range(max_steps):
        accepted = None
        for _ in range(7):
            step = _step(here, damping)
            if step is not None:
                trial = misfit.evaluate(theta + step, orders, here.nuisance, grid)
                if trial.cost < here.cost:
                    accepted = step
                    break
            damping *= 5.0
        if accepted is None:
            # no descent at any damping: rounding is reached, or the model is stuck on a ridge
            return Solution(theta, orders, here, True, step_number)
        gained = here.cost - trial.cost
        theta = theta + accepted
        damping = max(0.25 * damping, 1e-7)
        here = misfit.evaluate(theta, orders, trial.nuisance, grid, normal=True)
        if gained < tolerance * here.cost:
            return Solution(theta, orders, here, True, step_number + 1)
    return Solution(theta, orders, here, False, max_steps)


def _step(here: Evaluation, damping: float) -> FloatArray | None:
    assert here.hessian is not None
    assert here.gradient is not None
    scale = np.sqrt(np.maximum(np.diag(here.hessian), 1e-12))
    matrix = here.hessian / np.outer(scale, scale)
    matrix[np.diag_indices_from(matrix)] += damping
    try:
        factor = scipy.linalg.cho_factor(matrix, check_finite=False)
    except scipy.linalg.LinAlgError:
        return None
    step = -scipy.linalg.cho_solve(factor, here.gradient / scale, check_finite=False) / scale
    largest = float(np.max(np.abs(step)))
    if not np.isfinite(largest):
        return None
    return step if largest <= LARGEST_STEP else step * (LARGEST_STEP / largest)
