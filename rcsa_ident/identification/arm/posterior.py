"""What is known of a robot after all cuts, and which machines that allows at a posture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.identification.arm.data import SCALE
from rcsa_ident.identification.arm.unknowns import PosedLayout, unpack
from rcsa_ident.identification.posterior import steps_along
from rcsa_ident.identification.unknowns import DIRECTIONS, joint_of
from rcsa_ident.machine.flange_part import Doubt, JointedFlange
from rcsa_ident.machine.robot.carried_spindle import CarriedSpindle
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.model import RobotModel
from rcsa_ident.machine.robot.posed_robot import PosedRobot

_SI = 1.0 / SCALE[:DIRECTIONS]


@dataclass(frozen=True, slots=True, eq=False)
class RobotUnknowns:
    """Unknowns of a robot and of the joint in its spindle. `theta`, shape (p,). `layout`: without forces and tooth angles."""

    theta: FloatArray
    layout: PosedLayout

    def __post_init__(self) -> None:
        object.__setattr__(self, "theta", frozen(self.theta))
        if self.theta.shape != (self.layout.size,):
            found = f"{self.layout.size} for {self.layout.arm.freedoms} freedoms, {self.layout.modes} modes and a joint"
            raise InputError("unknowns", self.theta.size, found)

    @property
    def joint(self) -> LumpedJoint:
        """The joint between spindle and tool-holder."""
        return joint_of(self.theta[self.layout.joint])

    @property
    def spindle(self) -> CarriedSpindle:
        """The spindle's modes."""
        own = unpack(self.theta, self.layout).spindle
        residual = own.residual @ own.residual.T * np.outer(_SI, _SI)
        return CarriedSpindle(own.omega_n, own.factor @ own.factor.T, own.psi * _SI, own.pull / _SI, residual)

    def arm(self, sheet: RobotModel, tilts: bool) -> FlexibleRobot:
        """Return the arm of a data sheet with these springs, dampers and masses."""
        found = unpack(self.theta, self.layout)
        return FlexibleRobot(sheet.with_springs(found.stiffness, found.damping, tilts).heavier(found.heavier), tilts)


@dataclass(frozen=True, slots=True, eq=False)
class RobotPosterior:
    """Unknowns of a robot with their covariance.

    `sheet`: lengths, masses, and what was believed of its springs
    `tilts`: with the springs across the joints' axes
    `covariance`, shape (p, p)
    `believed`, shape (p,): standard deviations before any cut
    `rivals`: other models of the same data: how far they differ belongs to what is not known
    """

    sheet: RobotModel
    tilts: bool
    best: RobotUnknowns
    covariance: FloatArray
    believed: FloatArray
    rivals: tuple[RobotUnknowns, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen(self.covariance))
        object.__setattr__(self, "believed", frozen(self.believed))
        if self.covariance.shape != (self.best.theta.size,) * 2:
            raise InputError("covariance", self.covariance.shape, f"a square matrix for {self.best.theta.size} unknowns")

    @property
    def arm(self) -> FlexibleRobot:
        """The arm with its most probable springs."""
        return self.best.arm(self.sheet, self.tilts)

    def draws(self, count: int, rng: np.random.Generator) -> tuple[FlexibleRobot, ...]:
        """Return arms that the cuts allow, each as probable as the posterior has it; those of the rivals are not among them."""
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        thetas = self.best.theta + rng.normal(size=(count, values.size)) @ root.T
        return tuple(replace(self.best, theta=theta).arm(self.sheet, self.tilts) for theta in thetas)

    def at(self, posture: FloatArray, turn: float = 0.0, unknowns: RobotUnknowns | None = None) -> PosedRobot:
        """Return the robot at a posture [rad], its feed turned from the tool's x [rad]; of other unknowns than the best ones if told."""
        chosen = self.best if unknowns is None else unknowns
        doubtful = self if unknowns is None else None
        return PosedRobot(chosen.arm(self.sheet, self.tilts), posture, turn, chosen.spindle, chosen.joint, doubtful=doubtful)

    def doubt(self, posture: FloatArray, turn: float) -> Doubt:
        """Return the machines a step to both sides along each of the covariance's own axes, and the rivals."""

        def candidate(unknowns: RobotUnknowns) -> JointedFlange:
            return self.at(posture, turn, unknowns).parts[0].believed

        steps = steps_along(self.best.theta, self.covariance, lambda theta: candidate(replace(self.best, theta=theta)))
        return Doubt(steps, tuple(candidate(rival) for rival in self.rivals))
