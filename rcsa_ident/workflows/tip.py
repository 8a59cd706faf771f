"""Tooltip FRF of any tooling on an identified machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.arrays import FloatArray, frozen
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance


@dataclass(frozen=True, slots=True)
class Machine:
    """An identified machine: per axis a spindle and the joint in front of it."""

    axes: Mapping[Dof, tuple[Spindle, LumpedJoint]]


def coupled_receptance(machine: Machine, assembly: ToolAssembly, omega: FloatArray) -> dict[Dof, Receptance]:
    """Return, per axis, the receptances of the machine with this tooling at tip and spindle flange.

    Parameters
    ----------
    machine : Machine
    assembly : ToolAssembly
    omega : array, shape (n,) [rad/s]
    """
    omega = frozen(np.asarray(omega, dtype=float))
    # a tool-holder is alike in all directions: one solution serves both planes
    plane = tool_holder_receptance(assembly, omega)
    coupled = {}
    for axis, (spindle, joint) in machine.axes.items():
        turned = tuple(type(c)(c.point, _in_plane(c.dof, axis)) for c in plane.rows)
        coupled[axis] = couple(Receptance(omega, plane.values, turned, turned), spindle.receptance(omega), joint)
    return coupled


def _in_plane(dof: Dof, axis: Dof) -> Dof:
    pairs = {(Dof.X, Dof.Y): Dof.Y, (Dof.SLOPE_X, Dof.Y): Dof.SLOPE_Y}
    return pairs.get((dof, axis), dof)
