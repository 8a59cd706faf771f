"""Tooltip FRF of any tooling on an identified machine, with bands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification.posterior import MachineAxis, spread
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance

_SECOND_PLANE = {Dof.X: Dof.Y, Dof.SLOPE_X: Dof.SLOPE_Y}


@dataclass(frozen=True, slots=True)
class TooltipResponse:
    """Coupled receptances of a tooling, per axis.

    Parameters
    ----------
    coupled : mapping of Dof to Receptance
        Points ``tip`` and ``spindle``.
    spread : mapping of Dof to complex array, shape (p, n) [m/N]
        The tip-tip receptance's change along each independent direction of the posterior, per standard deviation.
    """

    coupled: Mapping[Dof, Receptance]
    spread: Mapping[Dof, ComplexArray] = field(default_factory=dict)

    def tip(self, axis: Dof) -> ComplexArray:
        """Return the tip-tip receptance, shape (n,) [m/N]."""
        return self.coupled[axis]["tip", "tip"][:, 0, 0]

    @property
    def deviation(self) -> dict[Dof, tuple[FloatArray, FloatArray]]:
        """Standard deviations of the tip-tip receptance's real and imaginary part, shape (n,) each [m/N]."""
        return {axis: (np.sqrt(np.sum(each.real**2, axis=0)), np.sqrt(np.sum(each.imag**2, axis=0))) for axis, each in self.spread.items()}


def tooltip(machine: Mapping[Dof, MachineAxis], assembly: ToolAssembly, omega: FloatArray, bands: bool = True) -> TooltipResponse:
    """Return the response of a tooling on an identified machine.

    Parameters
    ----------
    machine : mapping of Dof to MachineAxis
    assembly : ToolAssembly
    omega : array, shape (n,) [rad/s]
    bands : bool
        Also propagate the posterior, where there is one: two responses for each of its directions.
    """
    omega = frozen(np.asarray(omega, dtype=float))
    # a tool-holder is alike in all directions: one solution serves both planes
    plane = tool_holder_receptance(assembly, omega)
    coupled, changes = {}, {}
    for axis, part in machine.items():
        turned = plane if axis is Dof.X else turned_plane(plane)
        coupled[axis] = couple(turned, part.spindle.receptance(omega), part.joint)
        if bands and part.posterior is not None:

            def tip(modes: ModalModel, joint: LumpedJoint, turned: Receptance = turned) -> ComplexArray:
                return couple(turned, modes.receptance(omega), joint)["tip", "tip"][:, 0, 0]

            changes[axis] = spread(part.posterior, axis, tip)
    return TooltipResponse(coupled, changes)


def turned_plane(receptance: Receptance) -> Receptance:
    """The same receptance in the Y plane."""
    rows = tuple(Coordinate(c.point, _SECOND_PLANE[c.dof]) for c in receptance.rows)
    return Receptance(receptance.omega, receptance.values, rows, rows)
