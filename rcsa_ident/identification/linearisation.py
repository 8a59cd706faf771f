"""The residual of an identification, and how it changes with the unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.identification._kernels.lines import sum_cuts
from rcsa_ident.identification.unknowns import Unknowns

#: Unit of a delay in the normal equations [s].
DELAY_UNIT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """Everything whose squares add up to the cost, in standard deviations.

    `lines`: tuple of arrays, shape (2 n,); residuals of each axis: real parts of all lines, then imaginary parts
    `own`, shape (p,): residuals of the parameters' priors
    `cuts`, shape (k, 2): residuals of the cuts' priors: delay, angle
    """

    lines: tuple[FloatArray, ...]
    own: FloatArray
    cuts: FloatArray

    def minus(self, other: Residual, factor: float = 1.0) -> Residual:
        """Return the residual less another one times a factor."""
        lines = tuple(a - factor * b for a, b in zip(self.lines, other.lines, strict=True))
        return Residual(lines, self.own - factor * other.own, self.cuts - factor * other.cuts)

    def times(self, factor: float) -> Residual:
        """Return the residual times a factor."""
        return Residual(tuple(factor * a for a in self.lines), factor * self.own, factor * self.cuts)

    @property
    def chi2(self) -> tuple[float, ...]:
        """Sum of squares of each axis' lines, in standard deviations."""
        return tuple(float(r @ r) for r in self.lines)

    @property
    def cost(self) -> float:
        """Sum of all squares, those of the priors too."""
        return sum(self.chi2) + float(self.own @ self.own) + float(np.sum(self.cuts**2))


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """Residual to first order in the parameters and in each cut's delay and angle; the latter two are eliminated.

    `jacobians`: tuple of arrays, shape (q + c, 2 n); change of each axis' lines with its own parameters, the joint's and the coefficients'
    `columns`: tuple of complex arrays, shape (n, 2); the lines' change with their cut's delay (in `DELAY_UNIT`) and angle
    `cut`: tuple of int arrays, shape (n,); the cut that each line belongs to
    `own`, shape (p, p): the priors' change
    `cut_prior`, shape (k, 2): square roots of the weights of the cuts' priors
    `clamping`: (array of int, array), shape (k,) each; place in the vector of the tooth angle that a cut's prior depends on, and by how
        much (0 where by none)
    `gradient`, `hessian`: arrays, shapes (p,), (p, p); of half the cost, the cuts' unknowns eliminated
    `inner`, shape (k, 2, 2): normal equations of each cut's delay and angle
    `mixed`, shape (k, 2, p): what couples them to the parameters
    `compliance`: tuple of complex arrays, shape (n o, 3); change of each axis' residual, as complex numbers, with the flange's receptance
        tt, tr, rr, for what may be added to it
    """

    layout: Unknowns
    jacobians: tuple[FloatArray, ...]
    columns: tuple[ComplexArray, ...]
    cut: tuple[np.ndarray, ...]
    own: FloatArray
    cut_prior: FloatArray
    clamping: tuple[np.ndarray, FloatArray]
    gradient: FloatArray
    hessian: FloatArray
    inner: FloatArray
    mixed: FloatArray
    compliance: tuple[ComplexArray, ...]

    def follow(self, step: FloatArray) -> FloatArray:
        """Return how delay and angle of each cut follow a step of the parameters, shape (k, 2)."""
        return -_solve_pairs(self.inner, self.mixed @ step)

    def push(self, step: FloatArray, cuts: FloatArray) -> Residual:
        """Return the residual's change with a step of the parameters and of the cuts' unknowns."""
        shared = step[self._shared]
        lines = []
        for i, (jacobian, columns, cut) in enumerate(zip(self.jacobians, self.columns, self.cut, strict=True)):
            turned = columns[:, 0] * cuts[cut, 0] + columns[:, 1] * cuts[cut, 1]
            change = np.concatenate([step[self.layout.axis(i)], shared]) @ jacobian
            lines.append(change + np.concatenate([turned.real, turned.imag]))
        prior = self.cut_prior * cuts
        prior[:, 0] += self.clamping[1] * step[self.clamping[0]]
        return Residual(tuple(lines), self.own @ step, prior)

    def pull(self, residual: Residual) -> FloatArray:
        """Return the gradient that a residual would have, the cuts' unknowns eliminated, shape (p,)."""
        slope = self.own.T @ residual.own
        right = self.cut_prior * residual.cuts
        for i, (jacobian, columns, cut, r) in enumerate(zip(self.jacobians, self.columns, self.cut, residual.lines, strict=True)):
            down = jacobian @ r
            block = self.layout.axis(i)
            size = block.stop - block.start
            slope[block] += down[:size]
            slope[self._shared] += down[size:]
            sum_cuts(columns, cut, r, right)
        if self.layout.clampings:
            np.add.at(slope, self.clamping[0], self.clamping[1] * residual.cuts[:, 0])
        return slope - np.tensordot(_solve_pairs(self.inner, right), self.mixed, axes=2)

    def border(self, rows: Mapping[int, FloatArray], together: int, residual: Residual) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what further unknowns would add to the normal equations, so many of them at a time.

        `rows`: mapping of axis number to array, shape (2 n, g q); change of the axis' lines with them; of the others nothing changes
        `together`: q
        Returns gradient (g q,), own matrices (g, q, q), mixed with the parameters (p, g q), the cuts' unknowns eliminated from all.
        """
        cuts = self.inner.shape[0]
        size = next(iter(rows.values())).shape[1]
        turned, gradient, mixed = np.zeros((cuts, 2, size)), np.zeros(size), np.zeros((self.layout.size, size))
        own = np.zeros((size // together, together, together))
        for i, changes in rows.items():
            columns, cut = self.columns[i], self.cut[i]
            n = cut.size
            start = np.flatnonzero(np.diff(cut, prepend=-1))
            for j in range(2):
                products = columns[:, j].real[:, None] * changes[:n] + columns[:, j].imag[:, None] * changes[n:]
                turned[cut[start], j] += np.add.reduceat(products, start, axis=0)
            gradient += changes.T @ residual.lines[i]
            groups = changes.reshape(2 * n, -1, together)
            own += np.einsum("nki,nkj->kij", groups, groups, optimize=True)
            block = self.layout.axis(i)
            products = self.jacobians[i] @ changes
            mixed[block] += products[: block.stop - block.start]
            mixed[self._shared] += products[block.stop - block.start :]
        solved = np.linalg.solve(self.inner, turned)
        right = self.cut_prior * residual.cuts
        for lines, index, r in zip(self.columns, self.cut, residual.lines, strict=True):
            sum_cuts(lines, index, r, right)
        gradient -= np.tensordot(right, solved, axes=2)
        shape = (cuts, 2, -1, together)
        own -= np.einsum("cjki,cjkl->kil", turned.reshape(shape), solved.reshape(shape), optimize=True)
        mixed -= np.tensordot(self.mixed, solved, axes=((0, 1), (0, 1)))
        return gradient, own, mixed

    @property
    def _shared(self) -> slice:
        return slice(self.layout.tail, self.layout.force.stop)

    def delay_std(self, covariance: FloatArray) -> FloatArray:
        """Return the standard deviation of each cut's delay, shape (k,) [s]: its own fit's, and what the parameters add.

        `covariance`, shape (p, p): covariance of the parameters
        """
        follow = np.linalg.solve(self.inner, self.mixed)[:, 0]
        own = np.linalg.inv(self.inner)[:, 0, 0]
        return np.sqrt(own + np.einsum("kp,pq,kq->k", follow, covariance, follow)) * DELAY_UNIT


def _solve_pairs(inner: FloatArray, right: FloatArray) -> FloatArray:
    """Solve symmetric 2 x 2 systems (k, 2, 2) for right sides (k, 2)."""
    a, b, c = inner[:, 0, 0], inner[:, 0, 1], inner[:, 1, 1]
    determinant = a * c - b * b
    return np.stack([(c * right[:, 0] - b * right[:, 1]) / determinant, (a * right[:, 1] - b * right[:, 0]) / determinant], axis=1)
