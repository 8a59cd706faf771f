"""Misfit of both planes together: each line is moved by the forces along both axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.identification._kernels.lines import whiten
from rcsa_ident.identification.coupled._kernels import LineArrays, MachineArrays, PointArrays, coupled_lines
from rcsa_ident.identification.coupled.data import CoupledData, coupled_data
from rcsa_ident.identification.coupled.parameters import DIRECTIONS, CoupledLayout, CoupledParameters, chain, skew_chain, unpack
from rcsa_ident.identification.coupled.priors import coupled_prior_rows
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.misfit import Answer, Misfit, WeightedLines
from rcsa_ident.identification.parameters import JOINT, Unknowns, scaled_joint
from rcsa_ident.identification.priors import PriorRows, Priors


class CoupledMisfit(Misfit):
    """The residual of an identification in which both planes feel each other.

    Parameters
    ----------
    data : CoupledData
    priors : Priors
    model_error : tuple of float [-]
        As in `Misfit`.
    cut_weight : array, shape (k,), optional
        As in `Misfit`.
    """

    def __init__(self, data: CoupledData, priors: Priors, model_error: tuple[float, ...], cut_weight: FloatArray | None = None) -> None:
        super().__init__(data.base, priors, model_error, cut_weight)
        self.points_data = data

    def with_cut_weight(self, weight: FloatArray) -> CoupledMisfit:
        """Return the misfit of the same data with other factors on the weights of the cuts' lines, shape (k,)."""
        return CoupledMisfit(self.points_data, self.priors, self.model_error, weight)

    def with_data(self, data: IdentificationData, weight: FloatArray, error: tuple[float, ...] | None = None) -> CoupledMisfit:
        """Return the misfit of other data of the same machine, with factors on the weights of its cuts' lines, shape (k,)."""
        return CoupledMisfit(coupled_data(data), self.priors, self.model_error if error is None else error, weight)

    def prior(self, layout: Unknowns) -> PriorRows:
        """Return the priors of a layout's unknowns."""
        assert isinstance(layout, CoupledLayout)
        return coupled_prior_rows(layout, self.priors, self.data.coefficient_spread[: layout.coefficients])

    def _answers(self, theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        return self._answered(theta, layout, False)

    def _with_slopes(self, answers: Sequence[Answer], theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        return self._answered(theta, layout, True)

    def _answered(self, theta: FloatArray, layout: Unknowns, normal: bool) -> Sequence[Answer]:
        assert isinstance(layout, CoupledLayout)
        data, machine, logs = self.points_data, unpack(theta, layout), theta[layout.joint]
        named = len(self.data.coefficients)
        coefficients = theta[layout.force]
        force = data.force * np.exp(data.slope[:, :, : min(named, coefficients.size)] @ coefficients[:named])
        lines = [_lines(axis, layout, normal) for axis in self._axes]
        coupled_lines(
            MachineArrays(
                machine.omega_n,
                np.hstack([machine.psi, machine.fixture]),
                machine.factor,
                machine.softening,
                machine.skew,
                machine.residual,
                machine.fixture_residual,
                scaled_joint(logs),
                np.stack([self.seen_at(i, theta, layout) for i in range(2)]),
            ),
            PointArrays(
                data.omega, data.relative_speed, data.speed, data.place, data.flange[layout.turning], data.tip[layout.turning], force
            ),
            *lines,
        )
        answers = []
        for i, (axis, found) in enumerate(zip(self.data.axes, lines, strict=True)):
            own = np.flatnonzero(data.place[:, i] >= 0)
            at = np.empty(own.size, dtype=np.intp)
            at[data.place[own, i]] = own
            # smooth errors are those of the axis' own lines, whichever force has moved them
            smooth = axis.force_slope[:, named : layout.coefficients]
            factor = np.exp(smooth @ coefficients[named:]) / axis.force
            parts = found.parts * factor[:, None, None]
            if normal:
                found.gradient[:] *= factor[:, None, None]
            change = np.einsum("nos,nsc->noc", parts, data.slope[at][:, :, : min(named, layout.coefficients)])
            model = parts.sum(axis=2)
            extra = np.concatenate([change, model[:, :, None] * smooth[:, None, :]], axis=2)
            place = self.distance_place(i, layout)
            if normal and place is not None:
                extra[:, 0, place] = found.turned * factor
            answers.append(_CoupledAnswer(model, found.gradient, extra, compliance_of(found.felt, found.moved, factor), machine, theta))
        return answers


def _lines(axis: WeightedLines, layout: CoupledLayout, normal: bool) -> LineArrays:
    """Room for what the kernel says of an axis' lines."""
    n, o = axis.points.shape[0], axis.outputs
    columns = layout.skews.start + JOINT
    if layout.skew:
        columns += layout.modes * (layout.modes - 1) // 2
    rows = n if normal else 0
    shapes = (n, o, 2), (rows, o, columns), (rows, o, DIRECTIONS), (rows, DIRECTIONS), (rows,)
    return LineArrays(*(np.empty(shape, dtype=complex) for shape in shapes))


def compliance_of(felt: ComplexArray, moved: ComplexArray, factor: ComplexArray) -> ComplexArray:
    """Return the lines' change with the flange's symmetric receptance, its upper triangle by rows, shape (n, o, 10).

    Parameters
    ----------
    felt, moved : complex arrays, shapes (n, o, 4), (n, 4)
        v and x of a line's change v^T dB x.
    factor : complex array, shape (n,) or longer
        On each line.
    """
    rows, cols = np.triu_indices(DIRECTIONS)
    both = felt[:, :, :, None] * moved[:, None, None, :]
    found: ComplexArray = both[:, :, rows, cols] + np.where(rows != cols, both[:, :, cols, rows], 0.0)
    return found * factor[: found.shape[0], None, None]


@dataclass(frozen=True, slots=True, eq=False)
class _CoupledAnswer:
    """One axis' lines, their gradient in kernel units, and the machine behind them."""

    model: ComplexArray
    gradient: ComplexArray
    extra: ComplexArray
    compliance: ComplexArray
    machine: CoupledParameters
    theta: FloatArray

    def jacobian(self, lines: WeightedLines, layout: Unknowns) -> tuple[FloatArray, ComplexArray]:
        """As in `Answer`; the flange's receptance is asked for its upper triangle by rows, shape (n o, 10)."""
        assert isinstance(layout, CoupledLayout)
        gradient = self.gradient
        if layout.skew:
            first = layout.skews.start
            skew = gradient[:, :, first:-JOINT] @ skew_chain(self.theta, layout)
            gradient = np.concatenate([gradient[:, :, :first], skew, gradient[:, :, -JOINT:]], axis=2)
        scale = np.concatenate([chain(self.machine, layout), scaled_joint(self.theta[layout.joint])])
        rows = gradient.reshape(-1, gradient.shape[2])
        extra = self.extra.reshape(rows.shape[0], -1)
        out = np.empty((rows.shape[1] + extra.shape[1], 2 * rows.shape[0]))
        whiten(rows, extra, lines.weight, scale, out)
        return out, self.compliance.reshape(rows.shape[0], -1) * -lines.root[:, None]
