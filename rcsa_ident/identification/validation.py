"""Does the answer predict toolings that took no part in it as well as its bands promise?

Each tooling in turn is left out: from the whole answer the others are polished without it, and its lines are predicted. What belongs to
the cutter's clamping alone, its run-out and its tooth angle, is taken from the whole answer, and each cut's delay is its own; all else,
what its drawing does not tell included, is what the other toolings say. In directions that these hardly tell, the polish hardly leaves the
whole answer: what was promised is the measure of that. Cuts that were made to judge the answer took no part from the first.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.force import ForceTerm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.data import SMOOTH_ERROR, IdentificationData
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.linearisation import Linearisation
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.sweep_correction import unswept
from rcsa_ident.identification.unknowns import Layout

#: Weight of cuts that take no part: their delays are still fitted.
_NO_PART = 1e-10
#: Steps of the polish without a tooling, the relative gain below which it ends, and delays that are tried over a tooth's pitch.
_STEPS, _GAIN, _GRID = 40, 1e-4, 32
#: Errors up to so many times what was promised are as promised: 95 % of them.
WITHIN = 2.0
#: Where half of the lines are promised no better than this, nothing is.
TOO_WIDE = 0.5


@dataclass(frozen=True, slots=True)
class Prediction:
    """A tooling's measured lines along an axis against those that the other toolings predict.

    `error` [-]: norm of the difference over that of what was measured
    `promised` [-]: the same as bands and noise promise it: the root mean square
    `typical` [-]: promised deviation of a line over its size: the median. A few lines at a resonance make the root mean square.
    """

    tooling: str
    axis: Dof
    error: float
    promised: float
    typical: float

    @property
    def holds(self) -> bool:
        """Whether the error is as promised."""
        return self.error <= WITHIN * self.promised


def predictions(solution: Solution, misfit: Misfit, wider: float = 1.0) -> tuple[Prediction, ...]:
    """Return how each tooling's lines are predicted by the other ones; none where there is one tooling alone.

    `solution`: the whole answer
    `misfit`: whose minimum it is
    `wider`: factor on all standard deviations
    """
    data = misfit.data
    cuts = data.cut_tooling[: data.cuts]
    toolings = [t for t in range(len(data.toolings)) if np.any(cuts == t)]
    if len(toolings) < 2 or data.tests:
        return ()
    return _finite(
        each for t in toolings for each in _predicted(solution, misfit, data.cut_tooling == t, _of_the_clamping(solution, misfit, t), wider)
    )


def judged(solution: Solution, misfit: Misfit, whole: IdentificationData, wider: float = 1.0) -> tuple[Prediction, ...]:
    """Return how the cuts that were made to judge an answer are predicted, for each of their toolings.

    `solution`: the whole answer
    `misfit`: whose minimum it is
    `whole`: the same cuts, and those that took no part
    `wider`: factor on all standard deviations
    """
    aside = whole.made.judged
    if not np.any(aside) or whole.tests:
        return ()
    if whole.sweeps:
        if not isinstance(solution.layout, Layout):
            return ()
        whole = unswept(whole, misfit.priors, solution.theta, solution.layout)
    # nobody has learned the tooth angle at their triggers: each delay is asked for
    smooth = replace(whole, clamping=np.where(aside, -1, whole.clamping)).with_smooth_errors(SMOOTH_ERROR)
    weight, nuisance = np.ones(aside.size), np.zeros((aside.size, 2))
    weight[~aside], nuisance[~aside] = misfit.cut_weight, solution.evaluation.nuisance
    together = misfit.with_data(smooth, weight)
    here = replace(solution, evaluation=together.evaluate(solution.theta, solution.layout, nuisance, grid=_GRID))
    toolings = np.unique(whole.cut_tooling[aside])
    nothing = np.zeros(0, dtype=np.intp)
    return _finite(each for t in toolings for each in _predicted(here, together, aside & (whole.cut_tooling == t), nothing, wider))


def _finite(found: Iterable[Prediction]) -> tuple[Prediction, ...]:
    # of odd data a polish may run anywhere
    with np.errstate(all="ignore"):
        return tuple(each for each in found if np.isfinite(each.error + each.promised))


def validated(found: Sequence[Prediction]) -> bool:
    """Return whether every axis was predicted, by a promise that says something."""
    axes = {each.axis for each in found}
    return bool(axes) and all(any(each.axis is axis and each.typical <= TOO_WIDE for each in found) for axis in axes)


def widening(found: Sequence[Prediction]) -> float:
    """Return the factor on the bands' widths that predictions ask for: 1 where they are as good as promised."""
    return max((each.error / each.promised for each in found if not each.holds), default=1.0)


def _predicted(solution: Solution, misfit: Misfit, own: np.ndarray, kept: np.ndarray, wider: float) -> list[Prediction]:
    """The lines of some cuts of one tooling, axis by axis, by the other ones and by what is kept of the answer."""
    data, layout = misfit.data, solution.layout
    aside = own | np.pad(data.made.judged, (0, own.size - data.cuts))
    without = misfit.with_cut_weight(np.where(aside, _NO_PART, misfit.cut_weight))
    found = refine(without, solution.theta, layout, solution.evaluation.nuisance, _STEPS, tolerance=_GAIN)
    theta = found.theta.copy()
    theta[kept] = solution.theta[kept]
    there = misfit.evaluate(theta, layout, solution.evaluation.nuisance, normal=True)
    assert there.linear is not None
    others = np.setdiff1d(np.arange(theta.size), kept)
    covariance = wider**2 * np.linalg.inv(found.evaluation.hessian)[np.ix_(others, others)]
    doubt = _line_variance(there.linear, covariance, others)
    rows = []
    for i, axis in enumerate(data.axes):
        root = misfit.root_weight(i)
        lines = own[np.repeat(axis.cut, axis.outputs)]
        if not np.any(lines):
            continue
        off = np.sum((there.residual.lines[i].reshape(2, -1) / root) ** 2, axis=0)[lines]
        promised = np.sum(doubt[i].reshape(2, -1) / root**2, axis=0)[lines] + 2.0 * axis.variance.ravel()[lines]
        size = np.maximum(np.abs(axis.lines[:, :, 0] - axis.lines[:, :, 1]).ravel()[lines] ** 2, 1e-300)
        error, promise = (float(np.sqrt(np.sum(each) / np.sum(size))) for each in (off, promised))
        typical = float(np.sqrt(np.median(promised / size)))
        rows.append(Prediction(data.toolings[data.cut_tooling[own][0]], axis.axis, error, promise, typical))
    return rows


def _of_the_clamping(solution: Solution, misfit: Misfit, tooling: int) -> np.ndarray:
    """Places of what belongs to a tooling's clamping alone: run-out, and the tooth angle at its trigger."""
    data, layout = misfit.data, solution.layout
    name = data.toolings[tooling]
    places = [layout.force.start + c for c, each in enumerate(data.coefficients) if each.term is ForceTerm.RUNOUT and each.tooling == name]
    if layout.clampings:
        places += [layout.clamping.start + c for c in np.unique(data.clamping[data.cut_tooling == tooling]) if c >= 0]
    return np.array(places, dtype=np.intp)


def _line_variance(linear: Linearisation, covariance: FloatArray, places: np.ndarray) -> Sequence[FloatArray]:
    """Variance of each axis' whitened lines where some of the unknowns have a covariance and each cut's delay follows, shape (2 n,)."""
    values, vectors = np.linalg.eigh(covariance)
    found = [np.zeros(each.shape[1]) for each in linear.jacobians]
    for value, vector in zip(values, vectors.T, strict=True):
        if value <= 0.0:
            continue
        step = np.zeros(linear.layout.size)
        step[places] = np.sqrt(value) * vector
        for total, change in zip(found, linear.push(step, linear.follow(step)).lines, strict=True):
            total += change**2
    return found
