"""What is known of both planes after all cuts, and which machines that allows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, damped_modes
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.modal_parameters import flange_of, lower_factor
from rcsa_ident.identification.posterior import PlaneUnknowns, steps_along
from rcsa_ident.identification.unknowns import JOINT, CoupledLayout, ModalBlock, joint_of, pack, unpack
from rcsa_ident.machine.flange_part import Doubt, FlangePart, JointedFlange, OpenQuestion

#: Directions of the flange in the order of the unknowns.
FLANGE: tuple[Coordinate, ...] = (*plane("flange", Dof.X), *plane("flange", Dof.Y))
_SI = np.array([1.0, 1.0 / LEVER, 1.0, 1.0 / LEVER])
#: Least share of a mode's squared shape that lies in a plane whose search starts with it.
OWN_SHARE = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class CoupledUnknowns:
    """Unknowns of a whole machine's flange and of the joint.

    `theta`, shape (p,)
    `layout`: of a flange: without fixture, forces and tooth angles
    """

    theta: FloatArray
    layout: CoupledLayout

    def __post_init__(self) -> None:
        object.__setattr__(self, "theta", frozen(self.theta))
        if self.theta.shape != (self.layout.size,):
            raise InputError("unknowns", self.theta.size, f"{self.layout.size} for {self.layout.modes} modes and a joint")

    @property
    def joint(self) -> LumpedJoint:
        """The joint."""
        return joint_of(self.theta[-JOINT:])

    def modes(self, speed: float, x: float = 0.0) -> TurningModes:
        """Return the modes at a spindle speed [rad/s] and relative speed x."""
        machine = unpack(self.theta, self.layout.block).at(x)
        sense = -1.0 if self.layout.turning < 0 else 1.0
        skew = sense * machine.skew if machine.skew.size else np.zeros((machine.order, machine.order))
        residual = machine.residual @ machine.residual.T * np.outer(_SI, _SI)
        return TurningModes(machine.omega_n, machine.factor @ machine.factor.T, skew, machine.psi * _SI, residual, sense * speed, FLANGE)

    def standing(self, x: float = 0.0) -> ModalModel:
        """Return the modes of the machine that does not turn, in both planes; its stiffness is that at relative speed x, by default the
        one at the middle of the campaign's speeds.
        """
        machine = unpack(self.theta, self.layout.block).at(x)
        residual = machine.residual @ machine.residual.T * np.outer(_SI, _SI)
        return damped_modes(machine.omega_n, machine.factor @ machine.factor.T, machine.psi * _SI, residual, FLANGE)

    def seen_along(self, axis: Dof) -> PlaneUnknowns:
        """Return the modes that move one plane, as if it felt nothing of the other: where its own search may start."""
        machine = unpack(self.theta, self.layout.block)
        own = slice(0, 2) if axis is Dof.X else slice(2, 4)
        share = np.sum(machine.psi[:, own] ** 2, axis=1) / np.maximum(np.sum(machine.psi**2, axis=1), 1e-300)
        kept = np.flatnonzero(share >= OWN_SHARE)
        if not kept.size:
            kept = np.array([int(np.argmax(share))])
        factor, residual = lower_factor(machine.factor[kept]), lower_factor(machine.residual[own])
        alone = flange_of(machine.omega_n[kept], machine.psi[kept, own], factor, residual)
        return PlaneUnknowns(np.concatenate([pack(alone), self.theta[-JOINT:]]), ModalBlock(kept.size))


@dataclass(frozen=True, slots=True, eq=False)
class CoupledPosterior:
    """Unknowns of both planes with their covariance.

    `best`: the most probable ones
    `covariance`, shape (p, p)
    `speed_range`: (float, float) [rad/s]; middle of the campaign's spindle speeds and half their range
    `rivals`: other models of the same data: how far they differ belongs to what is not known
    """

    best: CoupledUnknowns
    covariance: FloatArray
    speed_range: tuple[float, float]
    rivals: tuple[CoupledUnknowns, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen(self.covariance))
        if self.covariance.shape != (self.best.theta.size,) * 2:
            raise InputError("covariance", self.covariance.shape, f"a square matrix for {self.best.theta.size} unknowns")

    @property
    def turns(self) -> bool:
        """Whether tool-holders have their gyroscopic moments."""
        return self.best.layout.turning != 0

    def candidate(self, unknowns: CoupledUnknowns, speed: float | None) -> JointedFlange:
        """Return what stands behind the flange at a spindle speed [rad/s], by default the campaign's middle one.

        Outside the campaign's speeds the stiffness is that of the nearest of them; gyroscopic moments go on with the speed.
        """
        speed = self.speed_range[0] if speed is None else speed
        return JointedFlange(unknowns.modes(speed, self.relative(speed)), unknowns.joint)

    def relative(self, speed: float | None) -> float:
        """Return a spindle speed [rad/s], by default the campaign's middle one, as -1 at its lowest and 1 at its highest, no further."""
        middle, half = self.speed_range
        return 0.0 if speed is None or half == 0.0 else float(np.clip((speed - middle) / half, -1.0, 1.0))

    def part(self, speed: float | None) -> FlangePart:
        """Return both planes as one part of the flange, with what is not known of it, at a spindle speed [rad/s]."""
        return FlangePart(FLANGE, self.candidate(self.best, speed), OpenQuestion(self, (speed,)))

    def doubt(self, speed: float | None) -> Doubt:
        """Return the machines a step to both sides along each of the covariance's own axes, and the rivals."""
        steps = steps_along(self.best.theta, self.covariance, lambda theta: self.candidate(replace(self.best, theta=theta), speed))
        return Doubt(steps, tuple(self.candidate(rival, speed) for rival in self.rivals))
