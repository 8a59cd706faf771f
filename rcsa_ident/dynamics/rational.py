"""Rational functions with common poles, fitted to receptances over frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.sparse.csgraph import connected_components

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.poles import PoleResidue, pair_sum
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.dynamics.vector_fitting import Candidate, Problem, growing, order_of

#: Share of the largest part below which a residue's further rank-one parts are dropped.
_RANK = 1e-6
#: So many orders in succession without a gain end the search for further poles above the noise.
_IDLE = 2
#: Times the band's end beyond which a pole is no more than a part of the constant, which it would nearly cancel.
_FAR = 20.0
#: Most pairs of poles that functions with common poles take beside those that were nearly theirs.
_FURTHER = 8
#: How far beside the band a pole's flank is still seen, as a ratio.
_FLANK = 1.2


class FitStatus(StrEnum):
    """Whether a fit is within its tolerance, or within the noise."""

    CONVERGED = "converged"
    TOLERANCE_NOT_MET = "tolerance not met"


@dataclass(frozen=True, slots=True, eq=False)
class RationalFit:
    """A stable rational function with real coefficients: common poles, a residue matrix for each.

    `pole` [rad/s], shape (m,): imaginary parts not negative, real parts negative
    `residue`, shape (m, r, c): in H(s) = sum_k residue[k] / (s - pole[k]) + conj(residue[k]) / (s - conj(pole[k])) + constant; a real
        pole's is half
    `constant`, shape (r, c): residual compliance; 0 where the fit is strictly proper
    `error` [-]: root mean square of the weighted misfit: relative where no noise was given, else in standard deviations
    `relative_error` [-]: norm of the misfit over norm of the values, the worst entry's
    `order`: number of poles, both of each pair counted: the degree of the denominator
    """

    pole: ComplexArray
    residue: ComplexArray
    constant: FloatArray
    error: float
    relative_error: float
    order: int
    status: FitStatus

    def __post_init__(self) -> None:
        for name, dtype in (("pole", complex), ("residue", complex), ("constant", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return the function over frequency, shape (n, r, c)."""
        return pair_sum(omega, self.pole, self.residue) + self.constant

    def modes(self, rank: float = _RANK) -> PoleResidue:
        """Return the function with each residue as a sum of rank-one parts, by singular values.

        `rank`: share of a residue's largest singular value below which a part is dropped; 1 keeps a single shape for each pole, as a
            structure's modes have
        """
        parts = []
        for pole, residue in zip(self.pole, self.residue, strict=True):
            # a real residue has real shapes
            left, size, right = np.linalg.svd(residue if pole.imag > 0.0 else residue.real, full_matrices=False)
            kept = max(int(np.sum(size > rank * size[0])), 1)
            parts += [(pole, left[:, j] * np.sqrt(size[j]), right[j] * np.sqrt(size[j])) for j in range(kept)]
        r, c = self.constant.shape
        return PoleResidue(
            np.array([p for p, _, _ in parts]),
            np.array([u for _, u, _ in parts]).reshape(-1, r).T,
            np.array([v for _, _, v in parts]).reshape(-1, c),
            self.constant,
        )

    def state_space(self) -> StateSpace:
        """Return the real state space in modal form."""
        return self.modes(1e-14).state_space()


def rational_fit(
    omega: FloatArray,
    values: ComplexArray,
    *,
    order: int | None = None,
    tolerance: float = 1e-3,
    noise: FloatArray | float | None = None,
    weight: FloatArray | None = None,
    constant: bool = True,
    highest_order: int = 60,
) -> RationalFit:
    """Return the rational function that fits receptances best, by relaxed vector fitting.

    Parameters
    ----------
    omega : array, shape (n,) [rad/s]
        Above 0.
    values : complex array, shape (n,), (n, r) or (n, r, c)
        All entries share the poles.
    order : int, optional
        Number of poles. By default the smallest with which the weighted rms misfit is within the tolerance; or within the noise, and
        then as many more as gain by Bayes's information criterion: one mode among many lines of noise hardly changes the rms.
    tolerance : float
        Relative rms misfit that is looked for where no noise is given.
    noise : array of the values' shape (or broadcast to it), optional
        Standard deviation of the real and of the imaginary part each.
    weight : array of the values' shape (or broadcast to it), optional
        Further factor on each misfit.
    constant : bool
        Whether a real constant (the modes above the band) is fitted too; without it the function is strictly proper.
    highest_order : int
        Where the search ends. If no order is good enough, Bayes's information criterion chooses, and the status says so.

    Raises
    ------
    InputError
        If values and frequencies do not fit each other, or hold too little for the order.

    Notes
    -----
    With sigma(s) = sum_k c~_k phi_k(s) + d~ and the poles of the last step, sigma h = sum_k c_k phi_k + d is solved by linear
    least squares; zeros of sigma are the next poles ([gustavsen1999]; relaxed: [gustavsen2006]; each entry
    condensed by its own QR: [deschrijver2008]). An unstable pole is mirrored. The next higher order starts from the poles
    of the last and a pair where the misfit is largest, and from evenly spaced poles.
    """
    problem = Problem.of(omega, values, tolerance, noise, weight, constant)
    if order is not None:
        if not 1 <= order <= problem.highest:
            raise InputError("order", order, f"a whole number from 1 to {problem.highest}")
        candidates = list(growing(problem.thinned(order), order))
        best = min((c for c in candidates if c.order == order), key=lambda c: c.rms)
        return _finished(problem, best.pole)
    found: list[Candidate] = []
    good, idle = None, 0
    thinned = problem.thinned(min(highest_order, problem.highest))
    for candidate in growing(thinned, min(highest_order, problem.highest)):
        found.append(candidate)
        if good is not None:
            share = candidate.independent
            gains = thinned.criterion(candidate, share) < thinned.criterion(good, share)
            good, idle = (candidate, 0) if gains else (good, idle + 1)
            if idle == _IDLE:
                break
        elif candidate.rms <= problem.target(candidate.order):
            fit = _finished(problem, candidate.pole)
            if fit.status is FitStatus.CONVERGED:
                if noise is None:
                    return fit
                good = candidate
    if not found:
        raise InputError("frequencies", problem.omega.size, "enough for two poles")
    return _finished(problem, (min(found, key=problem.criterion) if good is None else good).pole)


def fitted_poles(
    omega: FloatArray,
    values: ComplexArray,
    tolerance: float = 1e-3,
    damped_outside: float = 0.0,
    noise: FloatArray | None = None,
) -> tuple[PoleResidue, float]:
    """Return the poles of a square receptance, and the norm of what is left as a share; planes that do not couple keep their own poles.

    `omega` [rad/s], shape (n,): others than those above 0 are left aside
    `values`, shape (n, r, r): directions that do not couple, directly or through others, are fitted apart; one that is rigid has no poles
    `tolerance`: as in `rational_fit`
    `damped_outside`: least damping ratio of poles outside the band: they stand for many modes and are nobody's. Above 0, the constant
        stands for poles far above the band, which would ask whoever marches through time for steps of their own length.
    `noise`, shape (n, r, r): as in `rational_fit`
    Raises `InputError` if the receptance is zero at every frequency.
    """
    above = omega > 0.0
    omega, values = omega[above], values[above]
    noise = None if noise is None else noise[above]
    r = values.shape[1]
    there = np.any(values, axis=0)
    parts = []
    count, group = connected_components(there, directed=False)
    for rows in (np.flatnonzero(group == k) for k in range(count)):
        if not np.any(there[np.ix_(rows, rows)]):
            continue
        block = values[:, rows][:, :, rows]
        fit = rational_fit(omega, block, tolerance=tolerance, noise=None if noise is None else noise[:, rows][:, :, rows])
        unit = np.eye(r)[:, rows]
        parts.append(_damped_outside(fit, omega, block, damped_outside).modes().projected(unit, unit.T))
    if not parts:
        raise InputError("tip receptance", "zero at every frequency", "at least one flexible direction")
    found = PoleResidue.joined(parts)
    return found, float(np.linalg.norm(found.response(omega) - values) / np.linalg.norm(values))


def _damped_outside(fit: RationalFit, omega: FloatArray, values: ComplexArray, zeta: float) -> RationalFit:
    """The fit with well damped poles outside the band, none far above it: residues by least squares, so that the peaks of the band stay
    what they are."""
    size = np.abs(fit.pole)
    outside = ((size < omega[0]) | (size > omega[-1])) & (-fit.pole.real < zeta * size)
    near = size <= _FAR * omega[-1] if zeta > 0.0 else np.ones(size.size, dtype=bool)
    if near.all() and not outside.any():
        return fit
    pole = np.where(outside, size * complex(-zeta, np.sqrt(1.0 - zeta**2)), fit.pole)[near]
    flat = values.reshape(1, omega.size, -1)
    (residue,), (constant,) = _residues(omega, flat, np.ones(flat.shape[1:]), pole)
    return replace(fit, pole=pole, residue=residue.reshape(-1, *fit.constant.shape), constant=constant.reshape(fit.constant.shape))


def _residues(omega: FloatArray, values: ComplexArray, weight: FloatArray, pole: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """Residues, shape (d, m, e), and constants (d, e) of functions of e entries, shape (d, n, e), by least squares of weight (n, e)."""
    first, second = (1.0 / (1j * omega[:, None] - p) for p in (pole, pole.conj()))
    # the columns differ by many powers of ten
    basis = np.hstack([first + second, 1j * (first - second), np.ones((omega.size, 1))])
    residue, constant = np.empty((len(values), pole.size, values.shape[2]), dtype=complex), np.empty((len(values), values.shape[2]))
    for e, own in enumerate(weight.T):
        columns, right = own[:, None] * basis, own[:, None] * values[:, :, e].T
        scale = np.linalg.norm(columns, axis=0)
        # the second of a real pole is none
        scale[scale == 0.0] = 1.0
        columns = columns / scale
        both = np.linalg.lstsq(np.vstack([columns.real, columns.imag]), np.vstack([right.real, right.imag]), rcond=1e-13)[0].T / scale
        residue[:, :, e], constant[:, e] = both[:, : pole.size] + 1j * both[:, pole.size : -1], both[:, -1]
    return residue, constant


def common_poles(
    omega: FloatArray, values: ComplexArray, start: ComplexArray, allowed: FloatArray, damped_outside: float = 0.0
) -> ComplexArray:
    """Return the poles that fit several functions best, by vector fitting from poles that are nearly theirs.

    `omega` [rad/s], shape (n,): above 0
    `values`, shape (d, n, e): functions of e entries each
    `start` [rad/s], shape (m,)
    `allowed`, shape (n, e): what a fit may be beside each of them
    `damped_outside`: as in `fitted_poles`, of poles whose flank is not seen
    """
    beside = np.moveaxis(values, 0, 1).reshape(omega.size, -1)
    problem = Problem.of(omega, beside, 1.0, np.tile(allowed, len(values)), None, True)
    best = problem.settled(start / problem.top)
    for _ in range(_FURTHER):
        if best.rms <= 1.0:
            break
        best = min(best, problem.settled(best.with_pair(problem.omega)), key=lambda candidate: candidate.rms)
    pole = best.pole * problem.top
    size, damping = np.abs(pole), -pole.real / np.abs(pole)
    inside = (size >= omega[0]) & (size <= omega[-1])
    near = (size >= omega[0] / _FLANK) & (size <= _FLANK * omega[-1])
    # the flank of a pole beside the band tells its damping, too, but none below that of the others
    least = np.where(near, np.min(damping[inside], initial=damped_outside), damped_outside)
    zeta = np.where(inside, damping, np.maximum(damping, least))
    found: ComplexArray = np.where(zeta > damping, size * (-zeta + 1j * np.sqrt(1.0 - np.minimum(zeta, 1.0) ** 2)), pole)
    return found[size <= _FAR * omega[-1]]


def shared_residues(
    omega: FloatArray, values: ComplexArray, allowed: FloatArray, pole: ComplexArray, shape: tuple[int, int]
) -> tuple[list[PoleResidue], float]:
    """Return functions that share their poles, each with residues of its own, and the largest share that is left of one of them.

    `omega`, `allowed`, `pole`: as in `common_poles`
    `values`, shape (d, n, e)
    `shape`: (int, int); rows and columns that the e entries of a function stand for
    """
    residue, constant = _residues(omega, values, 1.0 / allowed, pole)
    fits = [
        RationalFit(pole, own.reshape(-1, *shape), direct.reshape(shape), 0.0, 0.0, order_of(pole), FitStatus.CONVERGED)
        for own, direct in zip(residue, constant, strict=True)
    ]
    left = [
        np.linalg.norm(fit.response(omega).reshape(each.shape) - each) / np.linalg.norm(each)
        for fit, each in zip(fits, values, strict=True)
    ]
    return [fit.modes() for fit in fits], float(max(left))


def _finished(problem: Problem, pole: ComplexArray) -> RationalFit:
    """The fit on all frequencies, in physical units."""
    pole = problem.settled(pole).pole
    coefficients, weighted = problem.residues(pole)
    misfit = np.abs(weighted / problem.weight)
    relative = np.linalg.norm(misfit, axis=0) / np.maximum(np.linalg.norm(problem.values, axis=0), 1e-300)
    residue, k = np.empty((pole.size, problem.values.shape[1]), dtype=complex), 0
    for i, p in enumerate(pole):
        if p.imag > 0.0:
            residue[i] = coefficients[k] + 1j * coefficients[k + 1]
            k += 2
        else:
            residue[i] = 0.5 * coefficients[k]
            k += 1
    constant = coefficients[k] if problem.constant else np.zeros(problem.values.shape[1])
    error = float(np.sqrt(np.mean(np.abs(weighted) ** 2))) * problem.tolerance
    order = order_of(pole)
    shape = (*problem.shape[1:], 1, 1)[:2]
    return RationalFit(
        pole=pole * problem.top,
        residue=(residue * problem.top * problem.size).reshape(-1, *shape),
        constant=(constant * problem.size).reshape(shape),
        error=error,
        relative_error=float(relative.max()),
        order=order,
        status=FitStatus.CONVERGED if error <= problem.goal(order) else FitStatus.TOLERANCE_NOT_MET,
    )
