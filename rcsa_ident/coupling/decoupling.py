"""Decoupling [park2003]: a known tool-holder taken out of a measured assembly leaves the spindle's flange."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import SPINDLE
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance


def decouple(measured: Receptance, tool_holder: Receptance, joint: LumpedJoint | None = None) -> Receptance:
    """Return the spindle's flange from an assembly whose receptances are known with rotations, exactly.

    With D = A22 + K^-1: B33 = A21 (A11 - C11)^-1 A12 - D where the tip was measured, else B33 = (C33^-1 - D^-1)^-1 at the
    spindle's end of the joint, or B33 = (I - G)^-1 G D with G = C31 A21^-1 across: [inprocess], eq. 10, turned round.

    `measured`: points ``tip`` or ``spindle`` or both, as `couple` returns them, with all directions of the tool-holder's flange
    `tool_holder`: points ``tip`` and ``flange``, at the same frequencies
    `joint`: None is a rigid connection: a real joint then belongs to the flange that comes out
    Returns Receptance: point ``flange``.
    """
    if not np.array_equal(measured.omega, tool_holder.omega):
        raise InputError("measured receptance", f"{measured.omega.size} frequencies", "the tool-holder's frequencies")
    directions = tuple(c.dof for c in tool_holder.rows if c.point == "flange")
    a12, a21 = tool_holder["tip", "flange"], tool_holder["flange", "tip"]
    interface = interface_receptance(tool_holder, directions, joint)
    tip = tuple(c.dof for c in tool_holder.rows if c.point == "tip")
    seen = {point: tuple(c.dof for c in measured.rows if c.point == point) for point in ("tip", SPINDLE)}
    seen_cols = {point: tuple(c.dof for c in measured.cols if c.point == point) for point in ("tip", SPINDLE)}
    if seen["tip"] == seen_cols["tip"] == tip and len(tip) == len(directions):
        b33 = a21 @ np.linalg.solve(tool_holder["tip", "tip"] - measured["tip", "tip"], a12) - interface
    elif seen[SPINDLE] == seen_cols[SPINDLE] == directions:
        b33 = np.linalg.inv(np.linalg.inv(measured[SPINDLE, SPINDLE]) - np.linalg.inv(interface))
    elif seen[SPINDLE] == directions and seen_cols["tip"] == tip and len(tip) == len(directions):
        g = np.swapaxes(np.linalg.solve(np.swapaxes(a21, 1, 2), np.swapaxes(measured[SPINDLE, "tip"], 1, 2)), 1, 2)
        b33 = np.linalg.solve(np.eye(len(directions)) - g, g @ interface)
    else:
        found = ", ".join(str(c) for c in dict.fromkeys((*measured.rows, *measured.cols)))
        wanted = f"all of {' '.join(directions)} at the tip, at the spindle or across; else least_squares_flange with several toolings"
        raise InputError("measured coordinates", found, wanted)
    flange = tuple(Coordinate("flange", dof) for dof in directions)
    return Receptance(measured.omega, b33, flange, flange)


def interface_receptance(tool_holder: Receptance, directions: tuple[Dof, ...], joint: LumpedJoint | None) -> ComplexArray:
    """Return A22 + K^-1, shape (n, d, d): what the spindle's flange is coupled to.

    `tool_holder`: point ``flange`` among its points
    `directions`: tuple of Dof, length d; of the flange, in the tool-holder's order
    `joint`: None is a rigid connection
    """
    interface = np.array(tool_holder["flange", "flange"])
    if joint is not None:
        i = np.arange(len(directions))
        interface[:, i, i] += joint.compliance_along(tool_holder.omega, directions)
    return interface


def with_slope(translations: ComplexArray, positions: FloatArray) -> ComplexArray:
    """Return translation and slope receptances at the first of several neighbouring points, by finite differences.

    The polynomial through k points gives the slope's weights W at the first; H = W H_k W^T: errors of order k - 1 in the
    spacing, noise grown by about the inverse spacing for each rotation.

    `translations` [m/N], shape (n, k, k): receptances between all pairs of points, two at least
    `positions` [m], shape (k,): along z from the tip towards the spindle
    Returns a complex array of shape (n, 2, 2).
    """
    offset = np.asarray(positions, dtype=float) - positions[0]
    count = offset.size
    if translations.shape[1:] != (count, count) or count < 2:
        raise InputError("translations", translations.shape, f"(n, {count}, {count}), two points at least")
    if np.unique(offset).size < count:
        raise InputError("positions", offset.tolist(), "places that differ [m]")
    size = np.max(np.abs(offset))
    powers = np.vander(offset / size, count, increasing=True)
    weights = np.zeros((2, count))
    weights[0, 0] = 1.0
    weights[1] = np.linalg.solve(powers.T, np.eye(count)[1]) / size
    return weights @ translations @ weights.T
