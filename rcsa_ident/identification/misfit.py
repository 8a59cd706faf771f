"""Misfit between model and lines, with every cut's delay and air-cut angle fitted inside."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.identification._kernels import cross_frf, fit_cuts
from rcsa_ident.identification.data import AxisData, IdentificationData
from rcsa_ident.identification.parameters import axis_size, chain, scaled_joint, split, unpack
from rcsa_ident.identification.priors import Priors, prior_rows

#: Unit of a delay in the normal equations [s].
DELAY_UNIT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """Cost at a vector, and its normal equations where asked for.

    Parameters
    ----------
    cost : float [-]
        chi2 of all axes, of the cuts' priors and of the parameters' priors.
    chi2 : tuple of float
        Of each axis' lines.
    nuisance : array, shape (k, 2)
        Delay [s] and angle [rad] of each cut at the optimum for this vector.
    linear : Linearisation or None
        Gradient and Gauss-Newton matrix of half the cost, where asked for.
    models : tuple of complex arrays [m/N]
        The model's cross FRF on the lines of each axis.
    residual : Residual
        Whose squares add up to the cost.
    """

    cost: float
    chi2: tuple[float, ...]
    nuisance: FloatArray
    models: tuple[ComplexArray, ...]
    residual: Residual
    linear: Linearisation | None = None

    @property
    def hessian(self) -> FloatArray:
        """Gauss-Newton matrix of half the cost, shape (p, p)."""
        assert self.linear is not None
        return self.linear.hessian


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """Everything whose squares add up to the cost: lines, parameters' priors, cuts' priors; all in standard deviations."""

    lines: tuple[ComplexArray, ...]
    own: FloatArray
    cuts: FloatArray

    def minus(self, other: Residual, factor: float = 1.0) -> Residual:
        """Return self - factor other."""
        lines = tuple(a - factor * b for a, b in zip(self.lines, other.lines, strict=True))
        return Residual(lines, self.own - factor * other.own, self.cuts - factor * other.cuts)

    def times(self, factor: float) -> Residual:
        """Return factor self."""
        return Residual(tuple(factor * a for a in self.lines), factor * self.own, factor * self.cuts)


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """Residual to first order in the parameters and in each cut's delay and angle; the latter two are eliminated.

    Parameters
    ----------
    blocks : tuple of (slice, complex array (n, q + 4))
        Per axis: which parameters, and the lines' change with them and the joint's four.
    columns : tuple of complex arrays, shape (n, 2)
        The lines' change with their cut's delay (in `DELAY_UNIT`) and angle.
    cut : tuple of int arrays, shape (n,)
    own : array, shape (p, p)
        The priors' change.
    cut_prior : array, shape (k, 2)
        Square roots of the weights of the cuts' priors.
    gradient, hessian : arrays, shapes (p,), (p, p)
    inner : array, shape (k, 2, 2)
    mixed : array, shape (k, 2, p)
    """

    blocks: tuple[tuple[slice, ComplexArray], ...]
    columns: tuple[ComplexArray, ...]
    cut: tuple[np.ndarray, ...]
    own: FloatArray
    cut_prior: FloatArray
    gradient: FloatArray
    hessian: FloatArray
    inner: FloatArray
    mixed: FloatArray

    def follow(self, step: FloatArray) -> FloatArray:
        """Return how delay and angle of each cut follow a step of the parameters, shape (k, 2)."""
        return -np.linalg.solve(self.inner, (self.mixed @ step)[:, :, None])[:, :, 0]

    def push(self, step: FloatArray, cuts: FloatArray) -> Residual:
        """Return the residual's change with a step of the parameters and of the cuts' unknowns."""
        lines = tuple(
            jacobian @ np.concatenate([step[block], step[-4:]]) + np.einsum("ni,ni->n", columns, cuts[cut])
            for (block, jacobian), columns, cut in zip(self.blocks, self.columns, self.cut, strict=True)
        )
        return Residual(lines, self.own @ step, self.cut_prior * cuts)

    def pull(self, residual: Residual) -> FloatArray:
        """Return the gradient that a residual would have, the cuts' unknowns eliminated, shape (p,)."""
        slope = self.own.T @ residual.own
        right = self.cut_prior * residual.cuts
        for (block, jacobian), columns, cut, r in zip(self.blocks, self.columns, self.cut, residual.lines, strict=True):
            down = (jacobian.conj().T @ r).real
            slope[block] += down[:-4]
            slope[-4:] += down[-4:]
            for i in range(2):
                right[:, i] += np.bincount(cut, (columns[:, i].conj() * r).real, minlength=right.shape[0])
        return slope - np.einsum("kip,ki->p", self.mixed, np.linalg.solve(self.inner, right[:, :, None])[:, :, 0])


class Misfit:
    """The residual of an identification.

    Parameters
    ----------
    data : IdentificationData
    priors : Priors
    model_error : tuple of float [-]
        Of each axis: standard deviation of what the force model leaves out, as a share of each line.
    """

    def __init__(self, data: IdentificationData, priors: Priors, model_error: tuple[float, ...]) -> None:
        self.data = data
        self.priors = priors
        self.model_error = model_error
        self.weight = tuple(_weight(a, f) for a, f in zip(data.axes, model_error, strict=True))
        # lines of all axes, cut by cut: a cut's delay and angle are the same for both
        cut = np.concatenate([a.cut for a in data.axes])
        self._order = np.argsort(cut, kind="stable")
        self._start = np.searchsorted(cut[self._order], np.arange(len(data.cut_ids) + 1))
        self._lines = np.concatenate([a.lines for a in data.axes])[self._order]
        columns = [np.stack([a.omega, a.order, w], axis=1) for a, w in zip(data.axes, self.weight, strict=True)]
        self._weights = np.concatenate(columns)[self._order]

    @property
    def points(self) -> int:
        """Number of real residuals of the lines."""
        return 2 * sum(a.omega.size for a in self.data.axes)

    def evaluate(self, theta: FloatArray, orders: tuple[int, ...], nuisance: FloatArray, grid: int = 0, normal: bool = False) -> Evaluation:
        """Return the cost at `theta`, and with `normal` its gradient and Hessian.

        Parameters
        ----------
        theta : array, shape (p,)
            See `parameters`.
        orders : tuple of int
            Modes of each axis.
        nuisance : array, shape (k, 2)
            Where each cut's fit starts; not changed.
        grid : int
            Delays tried over a tooth-passing period; 0 stays near `nuisance`.
        """
        models, gradients, axes, scaled = self._models(theta, orders, normal)
        nuisance = nuisance.copy()
        fit_cuts(self._lines, self._weights, np.concatenate(models)[self._order], self._start, self.data.cut_prior, nuisance, grid)
        residual, own_jacobian = self._residual(theta, orders, models, nuisance)
        chi2 = tuple(float(np.sum(np.abs(r) ** 2)) for r in residual.lines)
        cost = sum(chi2) + float(np.sum(residual.own**2)) + float(np.sum(residual.cuts**2))
        linear = None
        if normal:
            blocks = []
            first = 0
            for axis, gradient, w, m in zip(axes, gradients, self.weight, orders, strict=True):
                scale = np.concatenate([chain(axis), scaled])
                blocks.append((slice(first, first + axis_size(m)), -gradient * scale * np.sqrt(w)[:, None]))
                first += axis_size(m)
            linear = self._linearise(residual, own_jacobian, tuple(blocks), nuisance)
        return Evaluation(cost, chi2, nuisance, tuple(models), residual, linear)

    def residual_at(self, theta: FloatArray, orders: tuple[int, ...], nuisance: FloatArray) -> Residual:
        """Return the residual with the cuts' delays and angles as they are given."""
        models = self._models(theta, orders, False)[0]
        return self._residual(theta, orders, models, nuisance)[0]

    def _models(self, theta: FloatArray, orders: tuple[int, ...], normal: bool):
        """Cross FRF on each axis' lines, its gradient in kernel units, and the axes' physics."""
        parts, joint = split(theta, orders)
        scaled = scaled_joint(joint)
        models, gradients, axes = [], [], []
        for data, part, m in zip(self.data.axes, parts, orders, strict=True):
            axis = unpack(part, m)
            values = np.empty(data.omega.size, dtype=complex)
            gradient = np.empty((data.omega.size if normal else 0, axis_size(m) + 4), dtype=complex)
            cross_frf(axis.stiffness, axis.psi, axis.factor, axis.residual, scaled, data.omega, data.flange, data.tip, values, gradient)
            axes.append(axis)
            models.append(values)
            gradients.append(gradient)
        return models, gradients, axes, scaled

    def _residual(
        self, theta: FloatArray, orders: tuple[int, ...], models: list[ComplexArray], nuisance: FloatArray
    ) -> tuple[Residual, FloatArray]:
        lines = tuple(self._rest(i, model, nuisance) for i, model in enumerate(models))
        own, own_jacobian = prior_rows(theta, orders, self.priors)
        prior = self.data.cut_prior
        cuts = np.sqrt(prior[:, 1:3]) * (nuisance - np.stack([prior[:, 0], np.zeros(len(prior))], axis=1))
        return Residual(lines, own, cuts), own_jacobian

    def without_delay(self, axis: AxisData, nuisance: FloatArray) -> ComplexArray:
        """Return the measured lines of an axis as they would be with tooth 1 at immersion 0 at the start [m/N]."""
        return self._turned(axis, nuisance)[0]

    def _rest(self, i: int, model: ComplexArray, nuisance: FloatArray) -> ComplexArray:
        return (self._turned(self.data.axes[i], nuisance)[0] - model) * np.sqrt(self.weight[i])

    @staticmethod
    def _turned(axis: AxisData, nuisance: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Lines as they would be without delay, and the air cut's part of them."""
        delay, angle = nuisance[axis.cut].T
        back = np.exp(1j * axis.omega * delay)
        air = axis.lines[:, 1] * np.exp(1j * axis.order * angle) * back
        return axis.lines[:, 0] * back - air, air

    def _linearise(self, residual, own_jacobian, blocks, nuisance):
        """Gauss-Newton matrices of the parameters after eliminating two unknowns per cut (Schur complement)."""
        size = own_jacobian.shape[0]
        prior = self.data.cut_prior
        cuts = len(self.data.cut_ids)
        cut_prior = np.sqrt(prior[:, 1:3]) * np.array([DELAY_UNIT, 1.0])
        hessian = own_jacobian.T @ own_jacobian
        mixed = np.zeros((cuts, 2, size))
        inner = np.zeros((cuts, 2, 2))
        inner[:, [0, 1], [0, 1]] = cut_prior**2
        tail = slice(size - 4, size)
        all_columns = []
        for axis, weight, (block, jacobian) in zip(self.data.axes, self.weight, blocks, strict=True):
            stacked = np.concatenate([jacobian.real, jacobian.imag])
            square = stacked.T @ stacked
            hessian[block, block] += square[:-4, :-4]
            hessian[block, tail] += square[:-4, -4:]
            hessian[tail, block] += square[-4:, :-4]
            hessian[tail, tail] += square[-4:, -4:]
            columns = self._columns(axis, weight, nuisance)
            all_columns.append(columns)
            first = np.flatnonzero(np.diff(axis.cut, prepend=-1))
            present = axis.cut[first]
            for i in range(2):
                products = np.add.reduceat((columns[:, i].conj()[:, None] * jacobian).real, first, axis=0)
                mixed[present, i, block] += products[:, :-4]
                mixed[present, i, tail] += products[:, -4:]
            self._add_inner(inner, axis, columns)
        _without_information(inner)
        flat = mixed.reshape(2 * cuts, size)
        hessian -= flat.T @ np.linalg.solve(inner, mixed).reshape(2 * cuts, size)
        index = tuple(axis.cut for axis in self.data.axes)
        linear = Linearisation(blocks, tuple(all_columns), index, own_jacobian, cut_prior, np.empty(0), hessian, inner, mixed)
        return replace(linear, gradient=linear.pull(residual))

    def _columns(self, axis: AxisData, weight: FloatArray, nuisance: FloatArray) -> ComplexArray:
        """The lines' change with delay and angle of their cut."""
        measured, air = self._turned(axis, nuisance)
        return np.stack([1j * axis.omega * DELAY_UNIT * measured, -1j * axis.order * air], axis=1) * np.sqrt(weight)[:, None]

    @staticmethod
    def _add_inner(inner: FloatArray, axis: AxisData, columns: ComplexArray) -> None:
        for i in range(2):
            for j in range(2):
                products = (columns[:, i].conj() * columns[:, j]).real
                inner[:, i, j] += np.bincount(axis.cut, products, minlength=inner.shape[0])

    def delay_std(self, nuisance: FloatArray) -> FloatArray:
        """Return each cut's standard deviation of the delay for a given model, shape (k,) [s]."""
        prior = self.data.cut_prior
        inner = np.zeros((len(prior), 2, 2))
        inner[:, 0, 0], inner[:, 1, 1] = prior[:, 1] * DELAY_UNIT**2, prior[:, 2]
        for axis, weight in zip(self.data.axes, self.weight, strict=True):
            self._add_inner(inner, axis, self._columns(axis, weight, nuisance))
        unknown = _without_information(inner)
        # at worst it lies anywhere in a tooth-passing period
        return np.where(unknown, prior[:, 3] / np.sqrt(12.0), np.sqrt(np.linalg.inv(inner)[:, 0, 0]) * DELAY_UNIT)


def _without_information(inner: FloatArray) -> np.ndarray:
    """Find the cuts whose delay nothing tells, no line and no trigger, shape (k,); any information keeps theirs solvable."""
    unknown = ~(inner[:, 0, 0] > 0.0)
    inner[unknown, 0, 0] = 1.0
    return unknown


def _weight(axis: AxisData, model_error: float) -> FloatArray:
    size = np.abs(axis.measured) ** 2
    # a line of nothing in a record without noise is not infinitely sure
    floor = 1e-12 * float(np.mean(size)) if np.any(size) else 1e-30
    return 1.0 / np.maximum(axis.variance + 0.5 * model_error**2 * size, floor)
