"""Misfit where each line is moved by the forces along several axes: of both planes together, and what a robot's has in common with it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.identification._kernels.lines import whiten
from rcsa_ident.identification.coupled._kernels import LineArrays, MachineArrays, PointArrays, coupled_lines
from rcsa_ident.identification.coupled.data import CoupledData, coupled_data
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.misfit import Answer, Misfit, WeightedLines
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import DIRECTIONS, JOINT, CoupledLayout, ModalBlock, Unknowns, chain, scaled_joint, unpack


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


class SharedMisfit(Misfit):
    """The residual where one machine answers the forces along all axes. `priors`, `model_error`, `cut_weight`: as in `Misfit`."""

    def __init__(self, data: Points, priors: Priors, model_error: tuple[float, ...], cut_weight: FloatArray | None = None) -> None:
        super().__init__(data.base, priors, model_error, cut_weight)
        self.points_data = data

    @abstractmethod
    def _fill(self, theta: FloatArray, layout: Unknowns, force: ComplexArray, lines: Sequence[LineArrays]) -> None:
        """Have a kernel fill the lines of both axes."""

    @abstractmethod
    def _turned(self, gradient: ComplexArray, theta: FloatArray, layout: Unknowns) -> tuple[ComplexArray, FloatArray]:
        """A gradient in the vector's columns, shape (n, o, q), and the vector's own units, shape (q,)."""

    def _columns(self, layout: Unknowns) -> int:
        """Number of columns of the kernel's gradient."""
        return layout.tail + JOINT

    def _answers(self, theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        return self._answered(theta, layout, False)

    def _with_slopes(self, answers: Sequence[Answer], theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        return self._answered(theta, layout, True)

    def _answered(self, theta: FloatArray, layout: Unknowns, normal: bool) -> Sequence[Answer]:
        data, named, coefficients = self.points_data, len(self.data.coefficients), theta[layout.force]
        force = data.force * np.exp(data.slope[:, :, : min(named, coefficients.size)] @ coefficients[:named])
        lines = [self._room(axis, layout, normal) for axis in self._axes]
        self._fill(theta, layout, force, lines)
        answers = []
        for i, (axis, found) in enumerate(zip(self.data.axes, lines, strict=True)):
            own = np.flatnonzero(data.place[:, i] >= 0)
            at = np.empty(own.size, dtype=np.intp)
            at[data.place[own, i]] = own
            # smooth errors are those of the axis' own lines, whichever force has moved them
            smooth = axis.force_slope[:, named : layout.coefficients]
            factor = np.exp(smooth @ coefficients[named:]) / axis.force
            parts = found.parts * factor[:, None, None]
            model = parts.sum(axis=2)
            if not normal:
                answers.append(_SharedAnswer(model))
                continue
            found.gradient[:] *= factor[:, None, None]
            change = np.einsum("nos,nsc->noc", parts, data.slope[at][:, :, : min(named, layout.coefficients)])
            extra = np.concatenate([change, model[:, :, None] * smooth[:, None, :]], axis=2)
            place = self.distance_place(i, layout)
            if place is not None:
                extra[:, 0, place] = found.turned * factor
            gradient, scale = self._turned(found.gradient, theta, layout)
            answers.append(_SharedAnswer(model, gradient, extra, compliance_of(found.felt, found.moved, factor), scale))
        return answers

    def _room(self, axis: WeightedLines, layout: Unknowns, normal: bool) -> LineArrays:
        """Room for what the kernel says of an axis' lines."""
        n, o, forces = axis.points.shape[0], axis.outputs, self.points_data.force.shape[1]
        rows = n if normal else 0
        shapes = (n, o, forces), (rows, o, self._columns(layout)), (rows, o, DIRECTIONS), (rows, DIRECTIONS), (rows,)
        return LineArrays(*(np.empty(shape, dtype=complex) for shape in shapes))


class CoupledMisfit(SharedMisfit):
    """The residual of an identification in which both planes feel each other; parameters as in `SharedMisfit`, of `CoupledData`."""

    points_data: CoupledData

    def with_cut_weight(self, weight: FloatArray) -> CoupledMisfit:
        """Return the misfit of the same data with other factors on the weights of the cuts' lines, shape (k,)."""
        return CoupledMisfit(self.points_data, self.priors, self.model_error, weight)

    def with_data(self, data: IdentificationData, weight: FloatArray, error: tuple[float, ...] | None = None) -> CoupledMisfit:
        """Return the misfit of other data of the same machine, with factors on the weights of its cuts' lines, shape (k,)."""
        return CoupledMisfit(coupled_data(data), self.priors, self.model_error if error is None else error, weight)

    def _columns(self, layout: Unknowns) -> int:
        block = _block(layout)
        return block.parts["skew"].start + JOINT + (block.modes * (block.modes - 1) // 2 if block.skew else 0)

    def _fill(self, theta: FloatArray, layout: Unknowns, force: ComplexArray, lines: Sequence[LineArrays]) -> None:
        assert isinstance(layout, CoupledLayout)
        data, machine, turning = self.points_data, unpack(theta, layout.block), layout.turning
        shapes, residual = np.hstack([machine.psi, machine.places]), (machine.residual, machine.place_residual)
        seen = np.stack([self.seen_at(i, theta, layout) for i in range(2)])
        coupled_lines(
            MachineArrays(
                machine.omega_n, shapes, machine.factor, machine.softening, machine.skew, *residual, scaled_joint(theta[layout.joint]), seen
            ),
            PointArrays(data.omega, data.relative_speed, data.speed, data.place, data.flange[turning], data.tip[turning], force),
            *lines,
        )

    def _turned(self, gradient: ComplexArray, theta: FloatArray, layout: Unknowns) -> tuple[ComplexArray, FloatArray]:
        block = _block(layout)
        if block.skew:
            first = block.parts["skew"].start
            skew = gradient[:, :, first:-JOINT] @ block.skew_chain(theta)
            gradient = np.concatenate([gradient[:, :, :first], skew, gradient[:, :, -JOINT:]], axis=2)
        return gradient, np.concatenate([chain(unpack(theta, block), block), scaled_joint(theta[layout.joint])])


def _block(layout: Unknowns) -> ModalBlock:
    assert isinstance(layout, CoupledLayout)
    return layout.block


def compliance_of(felt: ComplexArray, moved: ComplexArray, factor: ComplexArray) -> ComplexArray:
    """Return the lines' change with the flange's symmetric receptance, its upper triangle by rows, shape (n, o, 10).

    `felt`, `moved`: complex arrays, shapes (n, o, 4), (n, 4); v and x of a line's change v^T dB x
    `factor`, shape (n,): on each line
    """
    rows, cols = np.triu_indices(DIRECTIONS)
    both = felt[:, :, :, None] * moved[:, None, None, :]
    found: ComplexArray = both[:, :, rows, cols] + np.where(rows != cols, both[:, :, cols, rows], 0.0)
    return found * factor[:, None, None]


@dataclass(frozen=True, slots=True, eq=False)
class _SharedAnswer:
    """One axis' lines; where they are asked for, their gradients in the kernel's units with the vector's own."""

    model: ComplexArray
    gradient: ComplexArray = field(default_factory=lambda: np.empty((0, 0, 0), dtype=complex))
    extra: ComplexArray = field(default_factory=lambda: np.empty((0, 0, 0), dtype=complex))
    compliance: ComplexArray = field(default_factory=lambda: np.empty((0, 0, 0), dtype=complex))
    scale: FloatArray = field(default_factory=lambda: np.empty(0))

    def jacobian(self, lines: WeightedLines, layout: Unknowns) -> tuple[FloatArray, ComplexArray]:
        """As in `Answer`; the flange's receptance in both bending planes is asked for its upper triangle by rows, shape (n o, 10)."""
        del layout
        rows = self.gradient.reshape(-1, self.gradient.shape[2])
        extra = self.extra.reshape(rows.shape[0], -1)
        out = np.empty((rows.shape[1] + extra.shape[1], 2 * rows.shape[0]))
        whiten(rows, extra, lines.weight, self.scale, out)
        return out, self.compliance.reshape(rows.shape[0], -1) * -lines.root[:, None]
