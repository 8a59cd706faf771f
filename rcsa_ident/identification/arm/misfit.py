"""Misfit of a robot at several postures: each line is moved by the forces along all axes, through the arm and the spindle in its hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.identification.arm.data import PosedData
from rcsa_ident.identification.arm.unknowns import PosedLayout, chain, unpack
from rcsa_ident.identification.coupled._kernels import ArmArrays, LineArrays, PosedPoints, SpindleArrays, posed_lines
from rcsa_ident.identification.coupled.misfit import SharedMisfit
from rcsa_ident.identification.unknowns import Unknowns, scaled_joint


class PosedMisfit(SharedMisfit):
    """The residual of an identification of a robot; parameters as in `SharedMisfit`, of `PosedData` and `ArmPriors`."""

    points_data: PosedData

    def distance_place(self, i: int, layout: Unknowns) -> None:
        """Return nothing: a robot's flange sensors look at the flange itself."""
        del i, layout

    def _fill(self, theta: FloatArray, layout: Unknowns, force: ComplexArray, lines: Sequence[LineArrays]) -> None:
        assert isinstance(layout, PosedLayout)
        data, robot = self.points_data, unpack(theta, layout)
        spindle, mass = robot.spindle, np.einsum("b,cbij->cij", robot.heavier, data.mass)
        own = spindle.omega_n, spindle.psi, spindle.pull, spindle.factor, spindle.residual
        posed_lines(
            ArmArrays(mass, data.bodies, data.shapes, robot.stiffness, robot.damping),
            SpindleArrays(*own, scaled_joint(theta[layout.joint])),
            PosedPoints(data.omega, data.posture, data.place, data.flange, data.tip, force),
            *lines,
        )

    def _turned(self, gradient: ComplexArray, theta: FloatArray, layout: Unknowns) -> tuple[ComplexArray, FloatArray]:
        assert isinstance(layout, PosedLayout)
        return gradient, np.concatenate([chain(unpack(theta, layout), theta, layout), scaled_joint(theta[layout.joint])])
