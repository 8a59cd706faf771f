"""Misfit between model and lines, with every cut's delay and air-cut angle fitted inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.dynamics.arrays import ComplexArray, FloatArray
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
    gradient, hessian : arrays, shapes (p,), (p, p), or None
        Of half the cost, Gauss-Newton, delays and angles eliminated.
    models : tuple of complex arrays [m/N]
        The model's cross FRF on the lines of each axis.
    """

    cost: float
    chi2: tuple[float, ...]
    nuisance: FloatArray
    models: tuple[ComplexArray, ...]
    gradient: FloatArray | None = None
    hessian: FloatArray | None = None


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
        nuisance = nuisance.copy()
        prior = self.data.cut_prior
        fit_cuts(self._lines, self._weights, np.concatenate(models)[self._order], self._start, prior, nuisance, grid)
        rest = [self._rest(i, model, nuisance) for i, model in enumerate(models)]
        chi2 = tuple(float(np.sum(np.abs(r) ** 2)) for r in rest)
        own, own_jacobian = prior_rows(theta, orders, self.priors)
        cuts = prior[:, 1] * (nuisance[:, 0] - prior[:, 0]) ** 2 + prior[:, 2] * nuisance[:, 1] ** 2
        cost = sum(chi2) + float(own @ own) + float(cuts.sum())
        if not normal:
            return Evaluation(cost, chi2, nuisance, tuple(models))
        jacobians = []
        first = 0
        for axis, gradient, w, m in zip(axes, gradients, self.weight, orders, strict=True):
            scale = np.concatenate([chain(axis), scaled])
            jacobians.append((slice(first, first + axis_size(m)), -gradient * scale * np.sqrt(w)[:, None]))
            first += axis_size(m)
        hessian, slope = self._normal_equations(rest, jacobians, nuisance, theta.size)
        return Evaluation(
            cost, chi2, nuisance, tuple(models), slope + own_jacobian.T @ own, hessian + own_jacobian.T @ own_jacobian
        )

    def residuals(self, evaluation: Evaluation) -> list[ComplexArray]:
        """Return each axis' residuals in standard deviations."""
        return [self._rest(i, model, evaluation.nuisance) for i, model in enumerate(evaluation.models)]

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

    def _normal_equations(self, rest, jacobians, nuisance, size):  # type: ignore[no-untyped-def]
        """Gauss-Newton matrices of the parameters after eliminating two unknowns per cut (Schur complement)."""
        hessian = np.zeros((size, size))
        slope = np.zeros(size)
        prior = self.data.cut_prior
        cuts = len(self.data.cut_ids)
        mixed = np.zeros((cuts, 2, size))
        inner = np.zeros((cuts, 2, 2))
        inner[:, 0, 0] = prior[:, 1] * DELAY_UNIT**2
        inner[:, 1, 1] = prior[:, 2]
        inner_slope = np.stack([prior[:, 1] * (nuisance[:, 0] - prior[:, 0]) * DELAY_UNIT, prior[:, 2] * nuisance[:, 1]], axis=1)
        tail = slice(size - 4, size)
        for axis, r, weight, (block, jacobian) in zip(self.data.axes, rest, self.weight, jacobians, strict=True):
            stacked = np.concatenate([jacobian.real, jacobian.imag])
            square = stacked.T @ stacked
            down = stacked.T @ np.concatenate([r.real, r.imag])
            hessian[block, block] += square[:-4, :-4]
            hessian[block, tail] += square[:-4, -4:]
            hessian[tail, block] += square[-4:, :-4]
            hessian[tail, tail] += square[-4:, -4:]
            slope[block] += down[:-4]
            slope[tail] += down[-4:]
            measured, air = self._turned(axis, nuisance)
            columns = np.stack([1j * axis.omega * DELAY_UNIT * measured, -1j * axis.order * air], axis=1) * np.sqrt(weight)[:, None]
            first = np.flatnonzero(np.diff(axis.cut, prepend=-1))
            present = axis.cut[first]
            for i in range(2):
                products = np.add.reduceat((columns[:, i].conj()[:, None] * jacobian).real, first, axis=0)
                mixed[present, i, block] += products[:, :-4]
                mixed[present, i, tail] += products[:, -4:]
                inner_slope[present, i] += np.add.reduceat((columns[:, i].conj() * r).real, first)
                for j in range(2):
                    inner[present, i, j] += np.add.reduceat((columns[:, i].conj() * columns[:, j]).real, first)
        solved = np.linalg.solve(inner, np.concatenate([mixed, inner_slope[:, :, None]], axis=2))
        flat = mixed.reshape(2 * cuts, size)
        hessian -= flat.T @ solved[:, :, :-1].reshape(2 * cuts, size)
        slope -= flat.T @ solved[:, :, -1].reshape(2 * cuts)
        return hessian, slope

    def delay_std(self, nuisance: FloatArray) -> FloatArray:
        """Return each cut's standard deviation of the delay for a given model, shape (k,) [s]."""
        prior = self.data.cut_prior
        inner = np.zeros((len(prior), 2, 2))
        inner[:, 0, 0], inner[:, 1, 1] = prior[:, 1] * DELAY_UNIT**2, prior[:, 2]
        for axis, weight in zip(self.data.axes, self.weight, strict=True):
            measured, air = self._turned(axis, nuisance)
            columns = np.stack([1j * axis.omega * DELAY_UNIT * measured, -1j * axis.order * air], axis=1)
            for i in range(2):
                for j in range(2):
                    np.add.at(inner[:, i, j], axis.cut, weight * (columns[:, i].conj() * columns[:, j]).real)
        return np.sqrt(np.linalg.inv(inner)[:, 0, 0]) * DELAY_UNIT


def _weight(axis: AxisData, model_error: float) -> FloatArray:
    return 1.0 / (axis.variance + 0.5 * model_error**2 * np.abs(axis.measured) ** 2)
