"""What is known of an axis' unknowns after all cuts, and which machines that allows: linear propagation of their covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.modal_parameters import flange_modes
from rcsa_ident.identification.unknowns import JOINT, ModalBlock, joint_of, unpack
from rcsa_ident.machine.flange_part import Doubt, FlangePart, JointedFlange, OpenQuestion, Perturbation
from rcsa_ident.machine.spindle import Spindle

#: Longest step along a direction of the covariance from which a change is told: logarithms, or of order one.
LONGEST_STEP = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class PlaneUnknowns:
    """Unknowns of one axis' flange and of the joint, as a search starts from them. `theta`, shape (p,). `layout`: without fixture."""

    theta: FloatArray
    layout: ModalBlock

    def __post_init__(self) -> None:
        object.__setattr__(self, "theta", frozen(self.theta))
        if self.theta.size != self.layout.size + JOINT:
            raise InputError("unknowns", self.theta.size, f"{self.layout.size + JOINT} for {self.layout.modes} modes and a joint")


@dataclass(frozen=True, slots=True, eq=False)
class Warmed:
    """How an axis' stiffness changes with its warmth: further unknowns, the lower triangle of `ModalParameters.warming` by rows.

    `change`, shape (w,): the most probable ones
    `cross`, shape (p, w): their covariance with the axis' other unknowns
    `covariance`, shape (w, w)
    `rivals`: tuple of array; the same of each rival, by the number of its modes
    """

    change: FloatArray
    cross: FloatArray
    covariance: FloatArray
    rivals: tuple[FloatArray, ...]

    def __post_init__(self) -> None:
        for name in ("change", "cross", "covariance"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "rivals", tuple(frozen(each) for each in self.rivals))
        count = self.change.size
        if self.covariance.shape != (count, count) or self.cross.shape[1:] != (count,):
            found = f"{self.cross.shape} and {self.covariance.shape}"
            raise InputError("warming", found, f"covariances of {count} unknowns, with the others and among themselves")


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Unknowns of one axis' flange and of the joint with their covariance.

    `theta`, shape (p,): the most probable unknowns
    `covariance`, shape (p, p)
    `layout`: which unknown stands where; without fixture
    `speed_range`: (float, float) [rad/s]; middle of the campaign's spindle speeds and half their range; only a layout with softening asks
        for it
    `rivals`: unknowns of other models of the same data, with fewer modes or more: how far they differ belongs to what is not known
    `tooling_cross`, shape (p, u): covariance of the unknowns with what is known of toolings (`KnownToolings`), in its units
    `tooling_covariance`, shape (u, u): of that
    `rival_toolings`: tuple of array, shape (u,) each; how far each rival's toolings are from those
    `warmed`: how it changes with a temperature that a thermometer shows; None where that is not known. All else is of the warm machine.
    `warmth` [-]: at which a layout with warming stands, from -1 (cold) to 0 (warm)
    """

    theta: FloatArray
    covariance: FloatArray
    layout: ModalBlock
    speed_range: tuple[float, float] = (0.0, 0.0)
    rivals: tuple[FloatArray, ...] = ()
    tooling_cross: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    tooling_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    rival_toolings: tuple[FloatArray, ...] = ()
    warmed: Warmed | None = None
    warmth: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "tooling_cross", frozen(self.tooling_cross))
        object.__setattr__(self, "tooling_covariance", frozen(self.tooling_covariance))
        object.__setattr__(self, "theta", frozen(self.theta))
        object.__setattr__(self, "covariance", frozen(self.covariance))
        object.__setattr__(self, "rivals", tuple(frozen(r) for r in self.rivals))
        if self.theta.size != self.layout.size + JOINT:
            raise InputError("unknowns", self.theta.size, f"{self.layout.size + JOINT} for {self.layout.modes} modes and a joint")
        if self.covariance.shape != (self.theta.size,) * 2:
            raise InputError("covariance", self.covariance.shape, f"a square matrix for {self.theta.size} unknowns")

    def machine(self, axis: Dof, theta: FloatArray | None = None, speed: float | None = None) -> tuple[ModalModel, LumpedJoint]:
        """Return modes and joint at `theta`, by default at the optimum, and at a spindle speed [rad/s], by default the middle one.

        Outside the campaign's speeds the machine of the nearest of them answers.

        `axis`: bending plane of the answer
        `theta`, shape (p,): unknowns, of this model or of a rival; by default the optimum's
        `speed` [rad/s]
        """
        vector = self.theta if theta is None else theta
        layout = self.layout if vector.size == self.theta.size else self.layout_of(vector.size - JOINT)
        middle, half = self.speed_range
        x = 0.0 if speed is None or half == 0.0 else float(np.clip((speed - middle) / half, -1.0, 1.0))
        return flange_modes(unpack(vector[:-JOINT], layout).at(x, self.warmth), axis), joint_of(vector[-JOINT:])

    def at_warmth(self, warmth: float) -> Posterior:
        """Return the same where the machine is as warm as that, -1 (cold) to 0 (warm); itself where nothing is known of that."""
        if self.warmed is None:
            return self
        layout, own = replace(self.layout, warming=True), self.warmed
        count, place = own.change.size, self.layout.parts["softening"].start
        if layout.pairs != count:
            raise InputError("warming", count, f"{layout.pairs} unknowns for {layout.modes} modes")
        # the vector's order: what changes with the warmth stands in front of what changes with the speed
        turn = np.insert(np.arange(self.theta.size), place, self.theta.size + np.arange(count))
        whole = np.block([[self.covariance, own.cross], [own.cross.T, own.covariance]])[np.ix_(turn, turn)]
        rivals = []
        for rival, change in zip(self.rivals, own.rivals, strict=True):
            rivals.append(np.insert(rival, self.layout_of(rival.size - JOINT).parts["softening"].start, change))
        theta = np.append(self.theta, own.change)[turn]
        return replace(self, theta=theta, covariance=whole, layout=layout, rivals=tuple(rivals), warmed=None, warmth=warmth)

    def layout_of(self, size: int) -> ModalBlock:
        """Return the layout of a rival whose part without the joint has this size."""
        layouts = (replace(self.layout, modes=m) for m in range(1, 100))
        found = next((layout for layout in layouts if layout.size == size), None)
        if found is None:
            raise InputError("rivals", size, "a size that belongs to a whole number of modes")
        return found

    def doubt(self, axis: Dof, speed: float | None = None) -> Doubt:
        """Return the machines a step to both sides along each of the covariance's own axes, and the rivals, at a speed [rad/s]."""
        steps = steps_along(self.theta, self.covariance, lambda theta: self.candidate(axis, theta, speed))
        rivals = tuple(self.candidate(axis, rival, speed) for rival in self.rivals)
        if not self.tooling_covariance.size:
            return Doubt(steps, rivals)
        values, vectors = np.linalg.eigh(self.covariance)
        told = values > 0.0
        moved = (vectors[:, told] / np.sqrt(values[told])).T @ self.tooling_cross
        return Doubt(steps, rivals, np.vstack([moved, *self.rival_toolings]), self.tooling_covariance - moved.T @ moved)

    def part(self, axis: Dof, speed: float | None = None) -> FlangePart:
        """Return the axis as a part of the flange, with what is not known of it, at a spindle speed [rad/s]."""
        believed = self.candidate(axis, speed=speed)
        return FlangePart(plane("flange", axis), believed, OpenQuestion(self, (axis, speed)))

    def candidate(self, axis: Dof, theta: FloatArray | None = None, speed: float | None = None) -> JointedFlange:
        """Return `machine` as what stands behind the flange."""
        modes, joint = self.machine(axis, theta, speed)
        return JointedFlange(modes, joint)


def steps_along(theta: FloatArray, covariance: FloatArray, candidate: Callable[[FloatArray], JointedFlange]) -> tuple[Perturbation, ...]:
    """Return the machines a step to both sides along each of a covariance's own axes.

    `theta`, shape (p,): the most probable unknowns
    `covariance`, shape (p, p)
    `candidate`: unknowns to what stands behind the flange
    """
    values, vectors = np.linalg.eigh(covariance)
    steps = []
    for size, direction in zip(np.sqrt(np.maximum(values, 0.0)), vectors.T, strict=True):
        # stiff directions take a full deviation, loose ones a step that stays linear
        step = min(size, LONGEST_STEP)
        if step > 0.0:
            ahead, behind = (candidate(theta + sign * step * direction) for sign in (1.0, -1.0))
            steps.append(Perturbation(ahead, behind, size / (2.0 * step)))
    return tuple(steps)


@dataclass(frozen=True, slots=True)
class MachineAxis:
    """One axis of an identified machine. `posterior`: where the identification gave one."""

    spindle: Spindle
    joint: LumpedJoint
    posterior: Posterior | None = None

    def at_warmth(self, axis: Dof, warmth: float) -> MachineAxis:
        """Return the same axis where the machine is as warm as that, -1 (cold) to 0 (warm)."""
        if self.posterior is None or self.posterior.warmed is None:
            return self
        posterior = self.posterior.at_warmth(warmth)
        modes, joint = posterior.machine(axis)
        return MachineAxis(Spindle(modes), joint, posterior)

    def at(self, axis: Dof, speed: float | None) -> tuple[ModalModel, LumpedJoint]:
        """Return modes and joint at a spindle speed [rad/s], by default the campaign's middle one."""
        return (self.spindle.modes, self.joint) if self.posterior is None else self.posterior.machine(axis, speed=speed)

    def part(self, axis: Dof, speed: float | None) -> FlangePart:
        """Return this axis as a part of the flange, with what the posterior leaves open, at a spindle speed [rad/s]."""
        if self.posterior is not None:
            return self.posterior.part(axis, speed)
        return FlangePart(plane("flange", axis), JointedFlange(self.spindle.modes, self.joint))

    @property
    def softening_range(self) -> tuple[float, float] | None:
        """Lowest and highest spindle speed [rad/s] between which it changes; None where it does not change."""
        if self.posterior is None or not self.posterior.layout.softening:
            return None
        middle, half = self.posterior.speed_range
        return middle - half, middle + half
