"""A robot's unknowns as one vector: springs, dampers and masses of the arm, then the spindle in its hand as a block of modes.

Springs behind each other, about axes that coincide, show their sum alone: compliances add up, so that what is known of both stays a plane.
They keep above nothing by u = log(1 + e^{a t}) / a, the share of an unknown t that is one where it is large.

The spindle's modes are those of shaft and bearings in a housing that is held. The housing's mass is the hand's; a mode whose pull is P
takes P P^T of the payload's mass with it when the housing moves slowly. So the same few modes hold at every posture, whatever the wrist
weighs there. Lengths of the arm are known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.identification import unknowns
from rcsa_ident.identification.modal_parameters import ModalParameters
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import DIRECTIONS, Block, ModalBlock, Unknowns
from rcsa_ident.machine.robot.model import RobotModel

#: a of the compliances' unknowns: from a third of the data sheet's compliance on they go together.
SHARPNESS = 3.0
#: Standard deviations of a drive's compliance over the data sheet's, of that across a joint's axis, and of a damper's logarithm.
DRIVE, TILT, DAMPER = 0.6, 0.8, 1.0
#: Standard deviations of the logarithms of a link's mass and of the payload's, which somebody has weighed.
MASS, PAYLOAD = 0.05, 0.02
#: Damping over the root of the stiffness [sqrt(N m) s] where a data sheet has none: that of the arm of [huynh2018].
_USUAL_DAMPING = 0.269


@dataclass(frozen=True, slots=True, eq=False)
class ArmPriors(Priors):
    """What is known of all freedoms of an arm before any cut, and of spindles.

    `centre`, `spread`, shape (2 n + b,): of the compliances' unknowns, of the logarithms of damping [N m s/rad] and of the bodies' masses
        over those of the data sheet
    `springs`: tuple of float, length n [N m/rad]; the data sheet's
    """

    centre: FloatArray = field(default_factory=lambda: np.zeros(0))
    spread: FloatArray = field(default_factory=lambda: np.zeros(0))
    springs: tuple[float, ...] = ()


def arm_priors(robot: RobotModel, tilts: bool = True) -> ArmPriors:
    """Return what a robot's file says of its springs and dampers, believed to a factor."""
    chain = robot.chain(tilts)
    damping = np.where(chain.damping > 0.0, chain.damping, _USUAL_DAMPING * np.sqrt(chain.stiffness))
    stiff = np.full(chain.stiffness.size, TILT)
    stiff[chain.driven] = DRIVE
    heavier = np.array([MASS] * len(robot.joints) + [PAYLOAD] * (robot.payload is not None))
    as_told = np.full(stiff.size, float(unknown_of(np.array(1.0))))
    centre = np.concatenate([as_told, np.log(damping), np.zeros(heavier.size)])
    spread = np.concatenate([stiff, np.full(stiff.size, DAMPER), heavier])
    return ArmPriors(centre=frozen(centre), spread=frozen(spread), springs=tuple(chain.stiffness.tolist()))


@dataclass(frozen=True)
class ArmBlock:
    """An arm: compliance over the data sheet's (n), log damping (n), logarithms of the masses over the data sheet's (b).

    `freedoms`: joints and tilts
    `masses`: of links and payload; with a mass goes its inertia
    """

    freedoms: int
    masses: int

    @property
    def size(self) -> int:
        """Length of the block."""
        return 2 * self.freedoms + self.masses

    @cached_property
    def parts(self) -> Mapping[str, slice]:
        """Places of each kind of unknown."""
        n = self.freedoms
        return {"compliances": slice(n), "damping": slice(n, 2 * n), "masses": slice(2 * n, self.size)}

    @property
    def follows(self) -> tuple[np.ndarray, np.ndarray]:
        """No damping follows a frequency."""
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)

    def known(self, priors: Priors) -> tuple[FloatArray, FloatArray]:
        """Return what the data sheet says."""
        assert isinstance(priors, ArmPriors)
        return priors.centre, priors.spread


@dataclass(frozen=True)
class PosedLayout(Unknowns):
    """Which unknown of a robot stands where in the vector.

    `springs`: tuple of float, length n [N m/rad]; the data sheet's stiffness of the arm's freedoms, joints and tilts
    `masses`: of links and payload
    `modes`: of the spindle
    `coefficients`, `clampings`: as in `unknowns.Layout`
    """

    springs: tuple[float, ...]
    masses: int
    modes: int = 0
    coefficients: int = 0
    clampings: int = 0

    @cached_property
    def arm(self) -> ArmBlock:
        """The arm, at the vector's beginning."""
        return ArmBlock(len(self.springs), self.masses)

    @cached_property
    def spindle(self) -> ModalBlock:
        """The spindle behind it."""
        return ModalBlock(self.modes, directions=DIRECTIONS, pulls=True)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Arm and spindle."""
        return self.arm, self.spindle

    def with_modes(self, k: int, modes: int) -> PosedLayout:
        """Return the layout with another number of modes of the spindle."""
        del k
        return replace(self, modes=modes)

    @property
    def machine(self) -> slice:
        """Places of all but forces and tooth angles."""
        return slice(0, self.joint.stop)


@dataclass(frozen=True, slots=True, eq=False)
class RobotParameters:
    """A robot in physical units.

    `stiffness`, `damping`: arrays, shape (n,) [N m/rad], [N m s/rad]
    `heavier` [-], shape (b,): masses over those of the data sheet
    `spindle`: on a held housing
    """

    stiffness: FloatArray
    damping: FloatArray
    heavier: FloatArray
    spindle: ModalParameters


def posed(layout: Unknowns) -> PosedLayout:
    """Return the layout as a robot's, which it is known to be."""
    assert isinstance(layout, PosedLayout)
    return layout


def unpack(theta: FloatArray, layout: PosedLayout) -> RobotParameters:
    """Return the physics of a vector."""
    parts = layout.arm.parts
    stiffness = np.array(layout.springs) / share_of(theta[parts["compliances"]])
    spindle = unknowns.unpack(theta[layout.places[1]], layout.spindle)
    return RobotParameters(stiffness, np.exp(theta[parts["damping"]]), np.exp(theta[parts["masses"]]), spindle)


def share_of(unknown: FloatArray) -> FloatArray:
    """Return compliances over the data sheet's, above 0, of unknowns of any sign."""
    return np.logaddexp(0.0, SHARPNESS * unknown) / SHARPNESS


def unknown_of(share: FloatArray) -> FloatArray:
    """Return the unknowns of such compliances; the inverse of `share_of`."""
    return share + np.log(-np.expm1(-SHARPNESS * share)) / SHARPNESS


def stiffening(theta: FloatArray, layout: PosedLayout) -> FloatArray:
    """Return the change of the logarithms of the stiffnesses with their unknowns, below 0, shape (n,)."""
    unknown = theta[layout.arm.parts["compliances"]]
    found: FloatArray = -1.0 / (1.0 + np.exp(-SHARPNESS * unknown)) / share_of(unknown)
    return found


def pack(robot: RobotParameters, layout: PosedLayout) -> FloatArray:
    """Return the machine's own part of the vector, its spindle's modes as many as it has; the inverse of `unpack`."""
    spindle = unknowns.pack(robot.spindle, ModalBlock(robot.spindle.order, directions=DIRECTIONS, pulls=True))
    compliance = unknown_of(np.array(layout.springs) / robot.stiffness)
    return np.concatenate([compliance, np.log(robot.damping), np.log(robot.heavier), spindle])


def chain(robot: RobotParameters, theta: FloatArray, layout: PosedLayout) -> FloatArray:
    """Return d physics / d vector for each entry, in the vector's order."""
    spindle = unknowns.chain(robot.spindle, layout.spindle)
    return np.concatenate([robot.stiffness * stiffening(theta, layout), robot.damping, robot.heavier, spindle])
