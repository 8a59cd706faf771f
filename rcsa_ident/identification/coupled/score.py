"""Whether the planes feel each other: a score test at the answer that knows nothing of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.modal_parameters import side_by_side
from rcsa_ident.identification.unknowns import DIRECTIONS, EVERY_PAIR, CoupledLayout, Layout, lower_triangle, pack, unpack

#: Deviations above what chance gives, beyond which the planes are fitted together.
STRIKES = 6.0


@dataclass(frozen=True, slots=True)
class Coupling:
    """What a step across the planes would take from the misfit.

    `score` [-]: by how many standard deviations it is more than chance gives
    `oblique`, `gyroscopic` [-]: the same for what is felt across in phase (shapes, damping, residual), and for the gyroscopic coupling,
        each alone
    `explained` [-]: share of the lines' misfit that all of it would take away
    """

    score: float
    oblique: float
    gyroscopic: float
    explained: float

    @property
    def found(self) -> bool:
        """Whether the planes feel each other."""
        return self.score > STRIKES


def coupled_start(theta: FloatArray, layout: Layout, skew: int = 0, turning: int = 0) -> tuple[FloatArray, CoupledLayout]:
    """Return a vector of two planes that feel nothing of each other as one of a whole machine.

    `theta`, shape (p,): of X and Y
    `layout`: of both, with as many outputs each
    `skew`, `turning`: as in `CoupledLayout`
    """
    axes = [unpack(theta[layout.axis(i)], part) for i, part in enumerate(layout.axes)]
    fixture, softening = (all(getattr(part, name) for part in layout.axes) for name in ("places", "softening"))
    modes = sum(layout.modes_of_axes)
    coupled = CoupledLayout(modes, fixture, softening, skew, turning, layout.coefficients, layout.clampings)
    return np.concatenate([pack(side_by_side(*axes), coupled.block), theta[layout.tail :]]), coupled


def coupling(theta: FloatArray, layout: Layout, nuisance: FloatArray, misfit: CoupledMisfit) -> Coupling:
    """Return what the lines say against planes that feel nothing of each other.

    With the gradient g_c and the information H of everything felt across, all other unknowns u following,
    T = g_c^T (H_cc - H_cu H_uu^-1 H_uc)^-1 g_c is what one step would gain; by chance it is e, the trace of the data's share of that
    information, with a variance of 2 e.

    `theta`, shape (p,): the optimum of both planes apart
    `nuisance`, shape (k, 2): the cuts' delays and angles there
    `misfit`: with the noise that was learned there
    """
    modes_x = layout.axes[0].modes
    vector, coupled = coupled_start(theta, layout, EVERY_PAIR)
    evaluation = misfit.evaluate(vector, coupled, nuisance, normal=True)
    linear = evaluation.linear
    assert linear is not None
    across, turning = _across(coupled, modes_x), np.zeros(coupled.size, dtype=bool)
    turning[coupled.block.parts["skew"]] = True
    per_point = max(sum(evaluation.chi2) / misfit.points, 1e-300)
    prior = misfit.rows(coupled).spread

    def score(asked: np.ndarray, known: np.ndarray) -> tuple[float, float]:
        gain, chance = _gain(linear.hessian, linear.gradient, prior, asked, known)
        return (gain / per_point - chance) / np.sqrt(2.0 * max(chance, 1.0)), gain

    known = ~(across | turning)
    both, gain = score(across | turning, known)
    return Coupling(both, score(across, known)[0], score(turning, known)[0], gain / max(sum(evaluation.chi2), 1e-300))


def _across(layout: CoupledLayout, modes_x: int) -> np.ndarray:
    """Which unknowns are zero for planes that feel nothing of each other, but the gyroscopic ones, shape (p,) bool."""
    found, parts = np.zeros(layout.size, dtype=bool), layout.block.parts
    of_y = np.arange(layout.modes) >= modes_x
    slope_y = np.arange(DIRECTIONS) >= DIRECTIONS // 2
    found[parts["shapes"]] = (of_y[:, None] != slope_y[None, :]).ravel()
    rows, cols, _ = lower_triangle(layout.modes)
    found[parts["damping"]] = of_y[rows] != of_y[cols]
    rows, cols = np.tril_indices(DIRECTIONS)
    found[parts["residual"]] = slope_y[rows] != slope_y[cols]
    if layout.fixture:
        both = np.concatenate([of_y, slope_y])
        found[parts["places"]] = np.concatenate([both, ~both])
    return found


def _gain(hessian: FloatArray, gradient: FloatArray, prior: FloatArray, asked: np.ndarray, known: np.ndarray) -> tuple[float, float]:
    """What a step of some unknowns gains, all known ones following, and the effective number of unknowns asked."""
    following = scipy.linalg.cho_solve(
        scipy.linalg.cho_factor(hessian[np.ix_(known, known)]), np.column_stack([hessian[np.ix_(known, asked)], gradient[known]])
    )
    schur = hessian[np.ix_(asked, asked)] - hessian[np.ix_(asked, known)] @ following[:, :-1]
    slope = gradient[asked] - hessian[np.ix_(asked, known)] @ following[:, -1]
    solved = np.linalg.solve(schur, np.column_stack([slope, np.diag(1.0 / prior[asked] ** 2)]))
    return float(slope @ solved[:, 0]), float(np.sum(asked) - np.trace(solved[:, 1:]))
