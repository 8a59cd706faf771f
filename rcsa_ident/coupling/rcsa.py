"""Receptance coupling [schmitz2000] of a tool-holder and a spindle through a lumped joint ([inprocess], eqs. 10 and 12)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rcsa_ident.base.arrays import ComplexArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance

SPINDLE = "spindle"


def couple(
    tool_holder: Receptance, spindle: Receptance, joint: LumpedJoint | None, behind: Mapping[Dof, float] | None = None
) -> Receptance:
    """Return the receptances of the coupled machine at the tip (point 1) and at the spindle's flange (point 3).

    C11 = A11 - A12 Z A21,  C31 = B33 Z A21,  C33 = B33 - B33 Z B33,  Z = [A22 + K^-1 + B33]^-1.

    Parameters
    ----------
    tool_holder : Receptance
        Points ``tip`` and ``flange``; per point translation and slope of one bending plane, or of both (4 x 4 blocks).
    spindle : Receptance
        Point ``flange`` with the same directions in the same order, at the same frequencies.
    joint : LumpedJoint or None
        None is a rigid connection, or one whose compliance the spindle's receptance holds already.
    behind : mapping of Dof to float, optional [m]
        Where the spindle's translations are looked at, along each axis: so far behind the joint, w + d theta. Negative: in front of it,
        where they are the tool-holder's. By default at the joint.

    Returns
    -------
    Receptance
        Points ``tip`` and ``spindle``; only rows, motions, are those of another place than the joint's.

    Examples
    --------
    Two free rigid bodies of 1 kg, whose tip and flange move alike, on a stiff joint move as one of 2 kg:

    >>> from rcsa_ident.dynamics.coordinates import plane
    >>> omega = np.array([50.0])
    >>> body = np.diag([-1.0 / omega[0] ** 2, -1000.0 / omega[0] ** 2])[None]
    >>> holder = Receptance(omega, np.kron(np.ones((2, 2)), body), plane("tip") + plane("flange"), plane("tip") + plane("flange"))
    >>> spindle = Receptance(omega, body, plane("flange"), plane("flange"))
    >>> machine = couple(holder, spindle, LumpedJoint(5e8, 2e6))
    >>> round(float((machine.between("tip.x", "tip.x")[0] * -(omega[0] ** 2)).real), 4)
    0.5
    """
    if tool_holder.omega.shape != spindle.omega.shape or not np.array_equal(tool_holder.omega, spindle.omega):
        raise InputError("spindle receptance", f"{spindle.omega.size} frequencies", "the tool-holder's frequencies")
    a11, a12 = tool_holder["tip", "tip"], tool_holder["tip", "flange"]
    a21, a22 = tool_holder["flange", "tip"], tool_holder["flange", "flange"]
    b33 = spindle["flange", "flange"]
    directions = _directions(tool_holder.rows, "flange")
    for name, found in (("columns", _directions(tool_holder.cols, "flange")), ("spindle", _directions(spindle.rows, "flange"))):
        if found != directions:
            raise InputError(
                f"directions at the flange ({name})", " ".join(found), f"the tool-holder's, {' '.join(directions)}, in that order"
            )
    interface, given = a22 + b33, np.zeros((tool_holder.omega.size, len(directions)), dtype=complex)
    if joint is not None:
        i = np.arange(len(directions))
        given += joint.compliance_along(tool_holder.omega, directions)
        interface[:, i, i] += given
    tips = a21.shape[2]
    carried = np.linalg.solve(interface, np.concatenate([a21, b33], axis=2))
    from_tip, from_spindle = carried[:, :, :tips], carried[:, :, tips:]
    c11 = a11 - a12 @ from_tip
    c31 = b33 @ from_tip
    c13 = a12 @ from_spindle
    c33 = b33 - b33 @ from_spindle
    for axis, distance in (behind or {}).items():
        if distance and axis in directions:
            c31, c33 = _seen(c31, given, from_tip, directions, axis, distance), _seen(c33, given, -from_spindle, directions, axis, distance)
    values = np.concatenate([np.concatenate([c11, c13], axis=2), np.concatenate([c31, c33], axis=2)], axis=1)
    spindle_end = tuple(Coordinate(SPINDLE, dof) for dof in directions)
    rows, cols = ((*(c for c in side if c.point == "tip"), *spindle_end) for side in (tool_holder.rows, tool_holder.cols))
    return Receptance(tool_holder.omega, values, rows, cols)


def _seen(
    motion: ComplexArray, given: ComplexArray, carried: ComplexArray, directions: tuple[Dof, ...], axis: Dof, distance: float
) -> ComplexArray:
    """The spindle's motions, shape (n, b, c), with an axis' translation as it is seen at a distance behind the joint; in front of it the
    joint gives way by K^-1, shape (n, b), for the forces that it carries, shape (n, b, c).
    """
    t, r = directions.index(axis), next(k for k, dof in enumerate(directions) if dof.is_slope and dof.plane is axis)
    at = motion[:, [t, r]] + (given[:, [t, r], None] * carried[:, [t, r]] if distance < 0.0 else 0.0)
    found = motion.copy()
    found[:, t] = at[:, 0] + distance * at[:, 1]
    return found


def _directions(coordinates: tuple[Coordinate, ...], point: str) -> tuple[Dof, ...]:
    return tuple(c.dof for c in coordinates if c.point == point)
