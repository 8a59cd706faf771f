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
from rcsa_ident.tool_holder.geometry import ToolAssembly, stiffened
from rcsa_ident.tool_holder.model import tool_holder_receptance

#: Relative standard deviation of a tool-holder's stiffness that stands for its mesh.
STIFFNESS_SPREAD = 5e-4
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


def tooltip(
    machine: Mapping[Dof, MachineAxis],
    assembly: ToolAssembly,
    omega: FloatArray,
    bands: bool = True,
    speed: float | None = None,
    stiffness_spread: float = STIFFNESS_SPREAD,
) -> TooltipResponse:
    """Return the response of a tooling on an identified machine.

    Parameters
    ----------
    machine : mapping of Dof to MachineAxis
    assembly : ToolAssembly
    omega : array, shape (n,) [rad/s]
    bands : bool
        Also propagate the posterior, where there is one: two responses for each of its directions.
    speed : float or None [rad/s]
        Spindle speed, for a machine that changes with it; by default the middle of the campaign's.
    stiffness_spread : float
        Standard deviation of the tool-holder's stiffness, as a share: the mesh alone by default; 0.01 for a modulus from a handbook.
    """
    omega = frozen(np.asarray(omega, dtype=float))
    # a tool-holder is alike in all directions: one solution serves both planes
    plane = tool_holder_receptance(assembly, omega)
    coupled, changes = {}, {}
    stiffer = tool_holder_receptance(stiffened(assembly, stiffness_spread), omega) if bands and stiffness_spread > 0.0 else None
    for axis, part in machine.items():
        turned = plane if axis is Dof.X else turned_plane(plane)
        modes, joint = part.at(axis, speed)
        flange = modes.receptance(omega)
        coupled[axis] = couple(turned, flange, joint)
        if bands and part.posterior is not None:

            def tip(modes: ModalModel, joint: LumpedJoint, turned: Receptance = turned) -> ComplexArray:
                return couple(turned, modes.receptance(omega), joint)["tip", "tip"][:, 0, 0]

            changes[axis] = spread(part.posterior, axis, tip, speed)
            if stiffer is not None:
                other = couple(stiffer if axis is Dof.X else turned_plane(stiffer), flange, joint)["tip", "tip"][:, 0, 0]
                changes[axis] = np.vstack([changes[axis], other - coupled[axis]["tip", "tip"][:, 0, 0]])
    return TooltipResponse(coupled, changes)


def turned_plane(receptance: Receptance) -> Receptance:
    """The same receptance in the Y plane."""
    rows = tuple(Coordinate(c.point, _SECOND_PLANE[c.dof]) for c in receptance.rows)
    return Receptance(receptance.omega, receptance.values, rows, rows)
