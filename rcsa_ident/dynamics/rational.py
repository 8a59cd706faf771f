"""Rational functions with common poles, fitted to receptances over frequency."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics._kernels import pole_sum
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.dynamics.vector_fitting import Candidate, Problem, growing, order_of
from rcsa_ident.errors import InputError

#: Share of the largest part below which a residue's further rank-one parts are dropped.
_RANK = 1e-6


class FitStatus(StrEnum):
    """Whether a fit is within its tolerance, or within the noise."""

    CONVERGED = "converged"
    TOLERANCE_NOT_MET = "tolerance not met"


@dataclass(frozen=True, slots=True, eq=False)
class RankOneModes:
    """Receptances as sum of outputs inputs / (s - pole), with the conjugates of all: what modal methods work on.

    Parameters
    ----------
    pole : complex array, shape (m,) [rad/s]
        Imaginary parts not negative, real parts negative.
    outputs : complex array, shape (r, m)
    inputs : complex array, shape (m, c)
    constant : array, shape (r, c)
        Residual compliance.

    Notes
    -----
    H(s) = sum_k outputs[:, k] inputs[k] / (s - pole[k]) + conj(outputs[:, k] inputs[k]) / (s - conj(pole[k])) + constant; a
    real pole stands with half its residue, so that the sum holds for it, too (as in `ModalModel`).
    """

    pole: ComplexArray
    outputs: ComplexArray
    inputs: ComplexArray
    constant: FloatArray

    def __post_init__(self) -> None:
        for name, dtype in (("pole", complex), ("outputs", complex), ("inputs", complex), ("constant", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return the receptances at frequencies omega, shape (n,) [rad/s]; shape (n, r, c)."""
        residues = np.einsum("rm,mc->mrc", self.outputs, self.inputs)
        return _pair_sum(np.asarray(omega, dtype=float), self.pole, residues) + self.constant

    def state_space(self) -> StateSpace:
        """Return the real state space in modal form: two states for each pair of poles, one for a real pole."""
        order = int(np.sum(np.where(self.pole.imag > 0.0, 2, 1)))
        r, c = self.constant.shape
        a, b, output, k = np.zeros((order, order)), np.zeros((order, c)), np.zeros((r, order)), 0
        for pole, u, v in zip(self.pole, self.outputs.T, self.inputs, strict=True):
            if pole.imag > 0.0:
                # z' = pole z + v f, y = 2 Re(u z) in the real and imaginary part of z
                a[k : k + 2, k : k + 2] = [[pole.real, -pole.imag], [pole.imag, pole.real]]
                b[k], b[k + 1] = v.real, v.imag
                output[:, k], output[:, k + 1] = 2.0 * u.real, -2.0 * u.imag
                k += 2
            else:
                a[k, k], b[k], output[:, k] = pole.real, v.real, 2.0 * u.real
                k += 1
        return StateSpace(a, b, output, self.constant)


@dataclass(frozen=True, slots=True, eq=False)
class RationalFit:
    """A stable rational function with real coefficients: common poles, a residue matrix for each.

    Parameters
    ----------
    pole : complex array, shape (m,) [rad/s]
        Imaginary parts not negative, real parts negative.
    residue : complex array, shape (m, r, c)
        In H(s) = sum_k residue[k] / (s - pole[k]) + conj(residue[k]) / (s - conj(pole[k])) + constant; a real pole's is half.
    constant : array, shape (r, c)
        Residual compliance; 0 where the fit is strictly proper.
    error : float [-]
        Root mean square of the weighted misfit: relative where no noise was given, else in standard deviations.
    relative_error : float [-]
        Norm of the misfit over norm of the values, the worst entry's.
    order : int
        Number of poles, both of each pair counted: the degree of the denominator.
    status : FitStatus
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
        """Return the function at frequencies omega, shape (n,) [rad/s]; shape (n, r, c)."""
        return _pair_sum(np.asarray(omega, dtype=float), self.pole, self.residue) + self.constant

    def modes(self, rank: float = _RANK) -> RankOneModes:
        """Return the function with each residue as a sum of rank-one parts, by singular values.

        Parameters
        ----------
        rank : float
            Share of a residue's largest singular value below which a part is dropped; 1 keeps a single shape for each pole, as a
            structure's modes have.
        """
        parts = []
        for pole, residue in zip(self.pole, self.residue, strict=True):
            # a real residue has real shapes
            left, size, right = np.linalg.svd(residue if pole.imag > 0.0 else residue.real, full_matrices=False)
            kept = max(int(np.sum(size > rank * size[0])), 1)
            parts += [(pole, left[:, j] * np.sqrt(size[j]), right[j] * np.sqrt(size[j])) for j in range(kept)]
        r, c = self.constant.shape
        return RankOneModes(
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
        Number of poles. By default the smallest with which the weighted rms misfit is within the tolerance, or within the noise.
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
    for candidate in growing(problem.thinned(min(highest_order, problem.highest)), min(highest_order, problem.highest)):
        found.append(candidate)
        if candidate.rms <= problem.target(candidate.order):
            fit = _finished(problem, candidate.pole)
            if fit.status is FitStatus.CONVERGED:
                return fit
    if not found:
        raise InputError("frequencies", problem.omega.size, "enough for two poles")
    return _finished(problem, min(found, key=problem.criterion).pole)


def tip_modes(receptance: Receptance, **options: float | int | bool | None) -> RankOneModes:
    """Return modal shapes for the whole receptance; planes that do not couple keep their own poles.

    Parameters
    ----------
    receptance : Receptance
        Square; where all entries off the diagonal are 0, each diagonal entry is fitted for itself.
    options
        Keyword arguments of `rational_fit`.
    """
    values = receptance.values
    r, c = values.shape[1:]
    positive = receptance.omega > 0.0
    omega, values = receptance.omega[positive], values[positive]
    if r != c or np.any(values[:, ~np.eye(r, dtype=bool)]):
        return rational_fit(omega, values, **options).modes()  # type: ignore[arg-type]
    poles, outputs, inputs, rest = [], [], [], np.zeros((r, r))
    for i in range(r):
        if not np.any(values[:, i, i]):
            continue
        part = rational_fit(omega, values[:, i, i], **options).modes()  # type: ignore[arg-type]
        unit = np.eye(r)[i]
        poles.append(part.pole)
        outputs.append(unit[:, None] * part.outputs)
        inputs.append(part.inputs * unit)
        rest[i, i] = part.constant[0, 0]
    if not poles:
        raise InputError("receptance", "zero at every frequency", "at least one entry that is not")
    return RankOneModes(np.concatenate(poles), np.hstack(outputs), np.vstack(inputs), rest)


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


def _pair_sum(omega: FloatArray, pole: ComplexArray, residue: ComplexArray) -> ComplexArray:
    m, r, c = residue.shape
    flat = np.ascontiguousarray(residue.reshape(m, r * c))
    both = np.concatenate([flat, flat.conj()])
    return pole_sum(omega, np.concatenate([pole, pole.conj()]), both).reshape(omega.size, r, c)
