"""Misfit of a robot at several postures: each line is moved by the forces along all axes, through the arm and the spindle in its hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.identification._kernels.lines import whiten
from rcsa_ident.identification.arm._kernels import ArmArrays, LineArrays, PosedPoints, SpindleArrays, posed_lines
from rcsa_ident.identification.arm.data import PosedData
from rcsa_ident.identification.arm.unknowns import PosedLayout, chain, unpack
from rcsa_ident.identification.coupled.misfit import Forces
from rcsa_ident.identification.misfit import Answer, Misfit, WeightedLines
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import DIRECTIONS, JOINT, Unknowns, scaled_joint


class PosedMisfit(Misfit):
    """The residual of an identification of a robot.

    `data`: points of both axes
    `priors`, `model_error`, `cut_weight`: as in `Misfit`; `ArmPriors`
    """

    def __init__(self, data: PosedData, priors: Priors, model_error: tuple[float, ...], cut_weight: FloatArray | None = None) -> None:
        super().__init__(data.base, priors, model_error, cut_weight)
        self.points_data = data

    def _answers(self, theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        return self._answered(theta, layout, False)

    def _with_slopes(self, answers: Sequence[Answer], theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        del answers
        return self._answered(theta, layout, True)

    def _answered(self, theta: FloatArray, layout: Unknowns, normal: bool) -> Sequence[Answer]:
        assert isinstance(layout, PosedLayout)
        data, robot, joint = self.points_data, unpack(theta, layout), scaled_joint(theta[layout.joint])
        forces = Forces(data, theta[layout.force])
        lines = [_room(axis, layout.tail + JOINT, normal) for axis in self._axes]
        spindle, mass = robot.spindle, np.einsum("b,cbij->cij", robot.heavier, data.mass)
        posed_lines(
            ArmArrays(mass, data.bodies, data.shapes, robot.stiffness, robot.damping),
            SpindleArrays(spindle.omega_n, spindle.psi, spindle.pull, spindle.factor, spindle.residual, joint),
            PosedPoints(data.omega, data.posture, data.place, data.flange, data.tip, forces.of_points),
            *lines,
        )
        answers = []
        for i, found in enumerate(lines):
            factor = forces.factor(i)
            parts = found.parts * factor[:, None, None]
            if not normal:
                answers.append(_PosedAnswer(parts.sum(axis=2)))
                continue
            found.gradient[:] *= factor[:, None, None]
            scale = np.concatenate([chain(robot, theta, layout), joint])
            compliance = compliance_of(found.felt, found.moved, factor)
            answers.append(_PosedAnswer(parts.sum(axis=2), found.gradient, forces.slopes(i, parts), compliance, scale))
        return answers


def _room(axis: WeightedLines, columns: int, normal: bool) -> LineArrays:
    """Room for what the kernel says of an axis' lines. `columns`: of its gradient."""
    n, o = axis.points.shape[0], axis.outputs
    rows = n if normal else 0
    shapes = (n, o, 3), (rows, o, columns), (rows, o, DIRECTIONS), (rows, DIRECTIONS)
    return LineArrays(*(np.empty(shape, dtype=complex) for shape in shapes))


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
class _PosedAnswer:
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
