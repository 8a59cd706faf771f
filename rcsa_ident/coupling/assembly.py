"""Two structures and a joint as one structure: the same physics as `rcsa`, by another road."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import SPINDLE
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.structure import Structure


def assemble(tool_holder: Structure, spindle: Structure, joint: LumpedJoint) -> Structure:
    """Return tool-holder and spindle in one system, the joint's springs between their flanges.

    `tool_holder`: coordinates at ``tip`` and ``flange``
    `spindle`: coordinates at ``flange``
    `joint`: its springs and dampers tie the two flanges in every direction that the spindle has
    """
    d = tool_holder.mass.shape[0]
    mass = scipy.linalg.block_diag(tool_holder.mass, spindle.mass)
    damping = scipy.linalg.block_diag(tool_holder.damping, spindle.damping)
    stiffness = scipy.linalg.block_diag(tool_holder.stiffness, spindle.stiffness)
    loss = scipy.linalg.block_diag(tool_holder.structural_damping, spindle.structural_damping)
    springs = (joint.translational_stiffness, joint.rotational_stiffness)
    dampers = (joint.translational_damping, joint.rotational_damping)
    flange = [(i, c) for i, c in enumerate(spindle.coordinates) if c.point == "flange"]
    for i, coordinate in flange:
        here = d + spindle.index[i]
        there = tool_holder.index[tool_holder.coordinates.index(coordinate)]
        pair = np.ix_([here, there], [here, there])
        tie = np.array([[1.0, -1.0], [-1.0, 1.0]])
        stiffness[pair] += springs[coordinate.dof.is_slope] * tie
        damping[pair] += dampers[coordinate.dof.is_slope] * tie
    tips = [(i, c) for i, c in enumerate(tool_holder.coordinates) if c.point == "tip"]
    coordinates = (*(c for _, c in tips), *(Coordinate(SPINDLE, c.dof) for _, c in flange))
    index = np.concatenate([tool_holder.index[[i for i, _ in tips]], d + spindle.index[[i for i, _ in flange]]])
    return Structure(mass, damping, stiffness, loss, coordinates, index)
