"""What cuts that were not made yet would tell of both planes together.

As in `experiment_design`, unknowns are whitened by the posterior's covariance and each cut's own delay is taken out; here every line is
moved by both forces, so that a cut's feed direction decides what it tells across the planes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.coupled.data import CoupledData, coupled_data
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.coupled.posterior import CoupledPosterior, CoupledUnknowns
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.experiment_design import LEAST_MODEL_ERROR, without_delay
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import CoupledLayout


def directions_of(posterior: CoupledPosterior) -> FloatArray:
    """Return S with S S^T the covariance, shape (p, q), in the order in which `CoupledPosterior.doubt` takes its steps."""
    values, vectors = np.linalg.eigh(posterior.covariance)
    size = np.sqrt(np.maximum(values, 0.0))
    found: FloatArray = vectors[:, size > 0.0] * size[size > 0.0]
    return found


def coupled_information(data: IdentificationData, posterior: CoupledPosterior, model_error: Mapping[Dof, float]) -> tuple[FloatArray, ...]:
    """Return J of each cut, its own delay taken out, shape (r, d) each.

    Unknowns: the posterior's directions, its rivals, then the uncertain coefficients of the forces, which all cuts share.

    `data`: cuts from `experiment_design.expected_cut` with lines of X and Y, and tool-holders that turn; what the lines hold does not
        matter
    `model_error`: share of each line that neither model nor noise explains; at least `LEAST_MODEL_ERROR`
    """
    best, spread = posterior.best, np.asarray(data.coefficient_spread)
    shares = tuple(max(model_error[axis.axis], LEAST_MODEL_ERROR) for axis in data.axes)
    theta, layout = _with_forces(best, spread.size)
    # a model error is a share of the line: the model's own, for want of another
    lines = CoupledMisfit(_points(data, posterior), Priors(), shares).models(theta, layout)
    filled = [replace(axis, lines=np.stack([model, np.zeros_like(model)], axis=2)) for axis, model in zip(data.axes, lines, strict=True)]
    points = _points(replace(data, axes=tuple(filled)), posterior)
    misfit = CoupledMisfit(points, Priors(), shares)
    found = misfit.evaluate(theta, layout, np.zeros((len(data.cut_ids), 2)), normal=True)
    assert found.linear is not None
    rivals = [misfit.models(*_with_forces(rival, spread.size)) for rival in posterior.rivals]
    whitened = directions_of(posterior)
    machine = best.theta.size
    parts: list[list[FloatArray]] = [[] for _ in data.cut_ids]
    for i, (jacobian, columns, cut) in enumerate(zip(found.linear.jacobians, found.linear.columns, found.linear.cut, strict=True)):
        weight = misfit.root_weight(i)
        apart = [_stacked(-weight * (rival[i] - found.models[i])[:, 0]) for rival in rivals]
        rows = np.column_stack([jacobian[:machine].T @ whitened, *apart, jacobian[machine:].T * spread, _stacked(columns[:, 0])])
        n = cut.size
        for k in np.unique(cut):
            own = np.flatnonzero(cut == k)
            parts[int(k)] += [rows[own], rows[n + own]]
    size = whitened.shape[1] + len(rivals) + spread.size
    return tuple(without_delay(np.concatenate(each)) if each else np.zeros((0, size)) for each in parts)


def _points(data: IdentificationData, posterior: CoupledPosterior) -> CoupledData:
    """The cuts' points at the relative speeds that the posterior knows."""
    points = coupled_data(data)
    return replace(points, relative_speed=np.array([posterior.relative(speed) for speed in points.speed.tolist()]))


def _with_forces(unknowns: CoupledUnknowns, coefficients: int) -> tuple[FloatArray, CoupledLayout]:
    """The vector of a campaign whose forces are as they are believed to be."""
    return np.concatenate([unknowns.theta, np.zeros(coefficients)]), replace(unknowns.layout, coefficients=coefficients)


def _stacked(values: np.ndarray) -> FloatArray:
    return np.concatenate([values.real, values.imag])
