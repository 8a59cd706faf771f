"""Misfit of both planes together: each line is moved by the forces along X and Y."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.identification.coupled._kernels import MachineArrays, PointArrays, coupled_frf, coupled_frf_gradient
from rcsa_ident.identification.coupled.data import CoupledData, coupled_data
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.misfit import Answer, Misfit, WeightedLines, complex_columns
from rcsa_ident.identification.modal_parameters import ModalParameters, residual_turn
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import JOINT, RESIDUAL_UNIT, CoupledLayout, ModalBlock, Unknowns, chain, scaled_joint, unpack


class Points(Protocol):
    """Points of a campaign, each one tooth-passing line of one cut, in X, in Y or in both."""

    @property
    def base(self) -> IdentificationData:
        """Lines of X and Y."""
        ...

    @property
    def place(self) -> np.ndarray:
        """The line of X and of Y that stands there, -1 where there is none, shape (p, 2)."""
        ...

    @property
    def force(self) -> ComplexArray:
        """Simulated forces, shape (p, f) [N]."""
        ...

    @property
    def slope(self) -> ComplexArray:
        """Change of the forces' logarithms with the uncertain coefficients, shape (p, f, c) [-]."""
        ...


class CoupledMisfit(Misfit):
    """The residual of an identification in which both planes feel each other.

    `data`: points of both axes
    `priors`, `model_error`, `cut_weight`: as in `Misfit`
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

    def _answers(self, theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        assert isinstance(layout, CoupledLayout)
        data, machine, turning = self.points_data, unpack(theta, layout.block), layout.turning
        forces = Forces(data, theta[layout.force])
        shapes, residual = np.hstack([machine.psi, machine.places]), (machine.residual, machine.place_residual)
        seen = np.stack([self.seen_at(i, theta, layout) for i in range(2)])
        joint = scaled_joint(theta[layout.joint])
        arrays = MachineArrays(machine.omega_n, shapes, machine.factor, machine.softening, machine.skew, *residual, joint, seen)
        points = PointArrays(
            data.omega, data.relative_speed, data.speed, data.place, data.flange[turning], data.tip[turning], forces.of_points
        )
        parts = tuple(np.empty((*axis.points.shape[:1], axis.outputs, 2), dtype=complex) for axis in self._axes)
        slopes = tuple(np.empty(each.shape[0], dtype=complex) for each in parts)
        kept = coupled_frf(arrays, points, parts, slopes)
        physics = _Both(machine, layout.block, theta, joint, arrays, points, kept)
        answers = []
        for i, (moved, slope) in enumerate(zip(parts, slopes, strict=True)):
            factor = forces.factor(i)
            own = moved * factor[:, None, None]
            answers.append(_CoupledAnswer(own.sum(axis=2), i, factor, own, slope * factor, self.distance_place(i, layout), forces, physics))
        return answers

    def _with_slopes(self, answers: Sequence[Answer], theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        del theta, layout
        return answers


class Forces:
    """What the forces of a campaign's points are of those that were simulated.

    `data`: of points
    `logs`, shape (c,): logarithms of the coefficients' scales, and behind them the smooth errors of each axis' own lines
    """

    def __init__(self, data: Points, logs: FloatArray) -> None:
        self.data, self.logs = data, logs
        self.named = min(len(data.base.coefficients), logs.size)
        #: Shape (p, f) [N].
        self.of_points: ComplexArray = data.force * np.exp(data.slope[:, :, : self.named] @ logs[: self.named])

    def factor(self, axis: int) -> ComplexArray:
        """Return the factor on the displacement of an axis' lines that makes cross FRFs of it, shape (n,) [1/N]."""
        lines = self.data.base.axes[axis]
        found: ComplexArray = np.exp(self._smooth(axis) @ self.logs[self.named :]) / lines.force
        return found

    def slopes(self, axis: int, parts: ComplexArray) -> ComplexArray:
        """Return how an axis' lines change with each of the unknowns. `parts`: by each force, shape (n, o, f). Shape (n, o, c)."""
        place = self.data.place[:, axis]
        own = np.flatnonzero(place >= 0)
        at = np.empty(own.size, dtype=np.intp)
        at[place[own]] = own
        change = np.einsum("nos,nsc->noc", parts, self.data.slope[at][:, :, : self.named])
        return np.concatenate([change, parts.sum(axis=2)[:, :, None] * self._smooth(axis)[:, None, :]], axis=2)

    def _smooth(self, axis: int) -> ComplexArray:
        # smooth errors are those of the axis' own lines, whichever force has moved them
        return self.data.base.axes[axis].force_slope[:, len(self.data.base.coefficients) : self.logs.size]


def _block(layout: Unknowns) -> ModalBlock:
    assert isinstance(layout, CoupledLayout)
    return layout.block


@dataclass(frozen=True, slots=True, eq=False)
class _Both:
    """What both axes' lines are made of: the machine, its vector, and what the kernel took and kept."""

    machine: ModalParameters
    block: ModalBlock
    theta: FloatArray
    joint: FloatArray
    arrays: MachineArrays
    points: PointArrays
    kept: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _CoupledAnswer:
    """One axis' lines, and what their gradient is made of.

    `parts`, shape (n, o, 2): by each force
    `turned`, shape (n,): how they change with the slope that the flange's sensor sees
    `place`: where what is not known of its distance stands among the coefficients
    """

    model: ComplexArray
    axis: int
    factor: ComplexArray
    parts: ComplexArray
    turned: ComplexArray
    place: int | None
    forces: Forces
    both: _Both

    def jacobian(self, lines: WeightedLines, layout: Unknowns) -> tuple[FloatArray, ComplexArray]:
        """As in `Answer`; the flange's receptance in both bending planes is asked for its upper triangle by rows, shape (n o, 10)."""
        both, block = self.both, self.both.block
        n, o = self.model.shape
        bare, skew = block.parts["residual"], block.parts["skew"]
        own = block.size + JOINT
        root = -lines.root.reshape(n, o)
        scale = np.concatenate([chain(both.machine, block), both.joint])
        # first as it changes with the flange's receptance itself
        scale[bare] = 1.0
        out = np.empty((own + layout.coefficients, 2 * n * o))
        turns = block.skew_chain(both.theta) if block.skew else np.empty((0, 0))
        pairs = np.empty((turns.shape[0], 2 * n * o))
        weight = root * self.factor[:, None]
        coupled_frf_gradient(both.arrays, both.points, self.axis, both.kept, weight, scale, out[:own], pairs)
        if block.skew:
            np.matmul(turns.T, pairs, out=out[skew])
        compliance = complex_columns(out[bare])
        out[bare] = (RESIDUAL_UNIT * residual_turn(both.machine.residual)).T @ out[bare]
        change = self.forces.slopes(self.axis, self.parts)
        if self.place is not None:
            change[:, 0, self.place] = self.turned
        change = (change * root[:, :, None]).reshape(n * o, -1).T
        out[own:, : n * o], out[own:, n * o :] = change.real, change.imag
        return out, compliance
