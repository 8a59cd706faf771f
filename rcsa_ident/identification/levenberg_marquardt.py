"""Damped Gauss-Newton steps down to the nearest minimum (Levenberg-Marquardt with Marquardt's scaling, [marquardt1963])."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.linearisation import DELAY_UNIT
from rcsa_ident.identification.misfit import Evaluation, Misfit
from rcsa_ident.identification.unknowns import Unknowns

#: No parameter (all are logarithms or of order one) moves further in one step.
LARGEST_STEP = 1.0
#: Share of a step at which the residual's bend is probed, and the largest acceleration over velocity that is believed.
PROBE = 0.1
LARGEST_BEND = 0.75
#: Times the damping is raised fourfold for one step: from the least to far beyond any scale.
RETRIES = 20
_CUT_UNITS = np.array([DELAY_UNIT, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """A vector, its cost, and how it was reached.

    `theta`, shape (p,)
    `evaluation`: cost and residual there, with normal equations
    `converged`: False where the steps ran out
    """

    theta: FloatArray
    layout: Unknowns
    evaluation: Evaluation
    converged: bool
    steps: int

    @property
    def cost(self) -> float:
        """Sum of squares in standard deviations, those of the priors too."""
        return self.evaluation.cost

    @property
    def candidate(self) -> Candidate:
        """The solution without its equations."""
        return Candidate(self.theta, self.layout, self.evaluation.nuisance, self.cost, self.evaluation.hessian)


def refine(
    misfit: Misfit,
    theta: FloatArray,
    layout: Unknowns,
    nuisance: FloatArray,
    max_steps: int,
    grid: int = 0,
    tolerance: float = 1e-4,
) -> Solution:
    """Return the minimum near `theta`.

    `theta`, shape (p,)
    `nuisance`, shape (k, 2): delay [s] and angle [rad] at which each cut's own fit starts
    `max_steps`: steps after which the search ends unconverged
    `grid`: delays tried over a tooth-passing period at every step: needed far from the minimum
    `tolerance`: stop where two steps in a row lower the cost by less than this share
    """
    here = misfit.evaluate(theta, layout, nuisance, grid, normal=True)
    damping = 1e-2
    quiet = 0
    for step_number in range(max_steps):
        trial = None
        for _ in range(RETRIES):
            step = _step(misfit, theta, layout, here, damping)
            if step is not None:
                assert here.linear is not None
                ahead = here.nuisance + here.linear.follow(step) * _CUT_UNITS
                candidate = misfit.evaluate(theta + step, layout, ahead, grid)
                if candidate.cost < here.cost:
                    trial = candidate
                    break
            damping *= 4.0
        if trial is None or step is None:
            # no descent at any damping: rounding is reached, or the model is stuck on a ridge; without a step nothing is reached
            return Solution(theta, layout, here, step is not None, step_number)
        gained = here.cost - trial.cost
        theta = theta + step
        damping = max(0.2 * damping, 1e-8)
        here = misfit.linearised(trial, theta, layout)
        quiet = quiet + 1 if gained < tolerance * here.cost else 0
        if quiet == 2:
            return Solution(theta, layout, here, True, step_number + 1)
    return Solution(theta, layout, here, False, max_steps)


def _step(misfit: Misfit, theta: FloatArray, layout: Unknowns, here: Evaluation, damping: float) -> FloatArray | None:
    """Damped step with geodesic acceleration [transtrum2012]: it bends along the valley, not into its wall."""
    linear = here.linear
    assert linear is not None
    scale = np.sqrt(np.maximum(np.diag(linear.hessian), 1e-12))
    matrix = linear.hessian / (scale[:, None] * scale)
    matrix.flat[:: scale.size + 1] += damping
    # straight to LAPACK: at this size SciPy's own checks would cost as much
    factor, failed = dpotrf(matrix, lower=1, clean=0)
    if failed:
        return None
    velocity = -dpotrs(factor, linear.gradient / scale, lower=1)[0] / scale
    largest = float(np.max(np.abs(velocity)))
    if not np.isfinite(largest):
        return None
    if largest > LARGEST_STEP:
        return velocity * (LARGEST_STEP / largest)
    cuts = linear.follow(velocity)
    ahead = here.nuisance + PROBE * cuts * _CUT_UNITS
    change = misfit.residual_at(theta + PROBE * velocity, layout, ahead).minus(here.residual)
    bend = change.times(1.0 / PROBE).minus(linear.push(velocity, cuts)).times(2.0 / PROBE)
    acceleration = -0.5 * dpotrs(factor, linear.pull(bend) / scale, lower=1)[0] / scale
    # where the bend is as large as the step, the expansion says nothing
    bent = 2.0 * np.linalg.norm(acceleration * scale) < LARGEST_BEND * np.linalg.norm(velocity * scale)
    return velocity + acceleration if bent else velocity
