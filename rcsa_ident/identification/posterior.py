"""What the posterior says about a derived quantity: linear propagation of the unknowns' covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.errors import InputError
from rcsa_ident.identification.parameters import JOINT, AxisLayout, flange_modes, joint_of, unpack
from rcsa_ident.machine.spindle import Spindle


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Unknowns of one axis' flange and of the joint with their covariance.

    Parameters
    ----------
    theta : array, shape (p,)
    covariance : array, shape (p, p)
    layout : AxisLayout
        Without fixture.
    speed_range : (float, float) [rad/s]
        Middle of the campaign's spindle speeds and half their range; only a layout with softening asks for it.
    rivals : tuple of array
        Unknowns of other models of the same data, with fewer modes or more: how far they differ belongs to what is not known.
    """

    theta: FloatArray
    covariance: FloatArray
    layout: AxisLayout
    speed_range: tuple[float, float] = (0.0, 0.0)
    rivals: tuple[FloatArray, ...] = ()

    def __post_init__(self) -> None:
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
        """
        vector = self.theta if theta is None else theta
        layout = self.layout if vector.size == self.theta.size else self.layout_of(vector.size - JOINT)
        middle, half = self.speed_range
        x = 0.0 if speed is None or half == 0.0 else float(np.clip((speed - middle) / half, -1.0, 1.0))
        return flange_modes(unpack(vector[:-JOINT], layout).at(x), axis), joint_of(vector[-JOINT:])

    def layout_of(self, size: int) -> AxisLayout:
        """Return the layout of a rival whose part without the joint has this size."""
        layouts = (replace(self.layout, modes=m) for m in range(1, 100))
        found = next((layout for layout in layouts if layout.size == size), None)
        if found is None:
            raise InputError("rivals", size, "a size that belongs to a whole number of modes")
        return found


@dataclass(frozen=True, slots=True)
class MachineAxis:
    """One axis of an identified machine.

    Parameters
    ----------
    spindle : Spindle
    joint : LumpedJoint
    posterior : Posterior or None
        Where the identification gave one.
    """

    spindle: Spindle
    joint: LumpedJoint
    posterior: Posterior | None = None

    def at(self, axis: Dof, speed: float | None) -> tuple[ModalModel, LumpedJoint]:
        """Return modes and joint at a spindle speed [rad/s], by default the campaign's middle one."""
        return (self.spindle.modes, self.joint) if self.posterior is None else self.posterior.machine(axis, speed=speed)


def spread(
    posterior: Posterior, axis: Dof, response: Callable[[ModalModel, LumpedJoint], ComplexArray], speed: float | None = None
) -> ComplexArray:
    """Return the response's change per standard deviation along each of the covariance's own axes and to each rival, shape (p, n).

    Sums of its rows with independent standard normal weights are draws of the linearised response.

    Parameters
    ----------
    response : callable
        Modes and joint to a complex array, shape (n,).
    speed : float or None [rad/s]
    """
    values, vectors = np.linalg.eigh(posterior.covariance)
    slopes = []
    for size, direction in zip(np.sqrt(np.maximum(values, 0.0)), vectors.T, strict=True):
        # stiff directions take a full deviation, loose ones a step that stays linear
        step = min(size, 0.05)
        if step == 0.0:
            continue
        ahead = response(*posterior.machine(axis, posterior.theta + step * direction, speed))
        behind = response(*posterior.machine(axis, posterior.theta - step * direction, speed))
        slopes.append((ahead - behind) / (2.0 * step) * size)
    here = response(*posterior.machine(axis, speed=speed))
    slopes += [response(*posterior.machine(axis, rival, speed)) - here for rival in posterior.rivals]
    return np.array(slopes) if slopes else np.zeros((1, here.size), dtype=complex)
