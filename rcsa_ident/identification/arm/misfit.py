"""Misfit of a robot at several postures: each line is moved by the forces along all axes, through the arm and the spindle in its hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.identification._kernels.lines import whiten
from rcsa_ident.identification.arm.data import PosedData
from rcsa_ident.identification.arm.parameters import DIRECTIONS, PosedLayout, chain, unpack
from rcsa_ident.identification.arm.priors import ArmPriors, posed_prior_rows
from rcsa_ident.identification.coupled._kernels import ArmArrays, LineArrays, PosedPoints, SpindleArrays, posed_lines
from rcsa_ident.identification.coupled.misfit import compliance_of
from rcsa_ident.identification.misfit import Answer, Misfit, WeightedLines
from rcsa_ident.identification.parameters import JOINT, Unknowns, scaled_joint
from rcsa_ident.identification.priors import PriorRows


class PosedMisfit(Misfit):
    """The residual of an identification of a robot.

    Parameters
    ----------
    data : PosedData
    priors : ArmPriors
    model_error : tuple of float [-]
        As in `Misfit`.
    cut_weight : array, shape (k,), optional
        As in `Misfit`.
    """

    def __init__(self, data: PosedData, priors: ArmPriors, model_error: tuple[float, ...], cut_weight: FloatArray | None = None) -> None:
        super().__init__(data.base, priors.spindle, model_error, cut_weight)
        self.posed = data
        self.arm_priors = priors

    def prior(self, layout: Unknowns) -> PriorRows:
        """Return the priors of a layout's unknowns."""
        assert isinstance(layout, PosedLayout)
        return posed_prior_rows(layout, self.arm_priors, self.data.coefficient_spread[: layout.coefficients])

    def _answers(self, theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        return self._answered(theta, layout, False)

    def _with_slopes(self, answers: Sequence[Answer], theta: FloatArray, layout: Unknowns) -> Sequence[Answer]:
        return self._answered(theta, layout, True)

    def _answered(self, theta: FloatArray, layout: Unknowns, normal: bool) -> Sequence[Answer]:
        assert isinstance(layout, PosedLayout)
        data, robot = self.posed, unpack(theta, layout)
        named = min(len(self.data.coefficients), layout.coefficients)
        force = data.force * np.exp(data.slope[:, :, :named] @ theta[layout.force][:named])
        lines = [_lines(axis, layout, normal) for axis in self._axes]
        spindle, joint = robot.spindle, scaled_joint(theta[layout.joint])
        posed_lines(
            ArmArrays(np.einsum("b,cbij->cij", robot.heavier, data.mass), data.bodies, data.shapes, robot.stiffness, robot.damping),
            SpindleArrays(spindle.omega_n, spindle.psi, spindle.pull, spindle.factor, spindle.residual, joint),
            PosedPoints(data.omega, data.posture, data.place, data.flange, data.tip, force),
            *lines,
        )
        scale, answers = np.concatenate([chain(robot, theta, layout), joint]), []
        for i, (axis, found) in enumerate(zip(self.data.axes, lines, strict=True)):
            seen = np.flatnonzero(data.place[:, i] >= 0)
            at = np.empty(seen.size, dtype=np.intp)
            at[data.place[seen, i]] = seen
            factor = 1.0 / axis.force
            parts = found.parts * factor[:, None, None]
            if normal:
                found.gradient[:] *= factor[:, None, None]
            change = np.einsum("nos,nsc->noc", parts, data.slope[at][:, :, :named])
            answers.append(_PosedAnswer(parts.sum(axis=2), found.gradient, change, compliance_of(found.felt, found.moved, factor), scale))
        return answers


def _lines(axis: WeightedLines, layout: PosedLayout, normal: bool) -> LineArrays:
    """Room for what the kernel says of an axis' lines."""
    n, o = axis.points.shape[0], axis.outputs
    rows = n if normal else 0
    # a robot's flange sensors look at the flange itself
    shapes = (n, o, 3), (rows, o, layout.tail + JOINT), (rows, o, DIRECTIONS), (rows, DIRECTIONS), (0,)
    return LineArrays(*(np.empty(shape, dtype=complex) for shape in shapes))


@dataclass(frozen=True, slots=True, eq=False)
class _PosedAnswer:
    """One axis' lines, and their gradient in the kernel's units with the unknowns' own."""

    model: ComplexArray
    gradient: ComplexArray
    extra: ComplexArray
    compliance: ComplexArray
    scale: FloatArray

    def jacobian(self, lines: WeightedLines, layout: Unknowns) -> tuple[FloatArray, ComplexArray]:
        """As in `Answer`; the flange's receptance in both bending planes is asked for its upper triangle by rows, shape (n o, 10)."""
        del layout
        rows = self.gradient.reshape(-1, self.gradient.shape[2])
        extra = self.extra.reshape(rows.shape[0], -1)
        out = np.empty((rows.shape[1] + extra.shape[1], 2 * rows.shape[0]))
        whiten(rows, extra, lines.weight, self.scale, out)
        return out, self.compliance.reshape(rows.shape[0], -1) * -lines.root[:, None]
