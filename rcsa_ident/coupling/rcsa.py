"""Receptance coupling [schmitz2000] of a tool-holder and a spindle through a lumped joint ([inprocess], eqs. 10 and 12)."""

from __future__ import annotations

import numpy as np

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError

SPINDLE = "spindle"


def couple(tool_holder: Receptance, spindle: Receptance, joint: LumpedJoint | None) -> Receptance:
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

    Returns
    -------
    Receptance
        Points ``tip`` and ``spindle``.

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
    interface = a22 + b33
    if joint is not None:
        i = np.arange(len(directions))
        interface[:, i, i] += joint.compliance_along(tool_holder.omega, directions)
    tips = a21.shape[2]
    carried = np.linalg.solve(interface, np.concatenate([a21, b33], axis=2))
    from_tip, from_spindle = carried[:, :, :tips], carried[:, :, tips:]
    c11 = a11 - a12 @ from_tip
    c31 = b33 @ from_tip
    c13 = a12 @ from_spindle
    c33 = b33 - b33 @ from_spindle
    values = np.concatenate([np.concatenate([c11, c13], axis=2), np.concatenate([c31, c33], axis=2)], axis=1)
    spindle_end = tuple(Coordinate(SPINDLE, dof) for dof in directions)
    rows, cols = ((*(c for c in side if c.point == "tip"), *spindle_end) for side in (tool_holder.rows, tool_holder.cols))
    return Receptance(tool_holder.omega, values, rows, cols)


def _directions(coordinates: tuple[Coordinate, ...], point: str) -> tuple[Dof, ...]:
    return tuple(c.dof for c in coordinates if c.point == point)
