"""A tool-holder and a machine that turn as one set of poles: component mode synthesis, without a fit.

Both sides stand in few coordinates of unit mass; joint and residual compliance, one behind the other, are a spring and a damper between
their flanges. The poles of the whole at a spindle speed cost a small eigenvalue problem, where a rational fit costs seconds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.turning_modes import TurningModes, gyroscopic_poles
from rcsa_ident.machine.flange_part import JointedFlange
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.rods import ReducedRod, reduced_rod
from rcsa_ident.tool_holder.turning import TurningToolHolder, turning_tool_holder

#: Directions of the flange, X plane and Y plane; and all six, with those that a tool-holder feels as a rod.
FLANGE = (*plane("flange", Dof.X), *plane("flange", Dof.Y))
WHOLE_FLANGE = (*FLANGE, Coordinate("flange", Dof.Z), Coordinate("flange", Dof.TORSION))
#: Poles beyond so many times the tool-holder's highest frequency are a residual compliance.
BEYOND = 2.0


def synthesised_poles(
    holder: TurningToolHolder,
    flange: TurningModes,
    joint: LumpedJoint | None,
    turning: float | None,
    slopes: bool = False,
    rods: Sequence[ReducedRod] = (),
) -> PoleResidue | None:
    """Return the tip's receptance of a tool-holder on a machine as poles, or None where joint and residual hold rigidly.

    Parameters
    ----------
    holder : TurningToolHolder
    flange : TurningModes
        Over translation and slope of the flange in X, then in Y; then along its axis and about it, as far as there are rods.
    joint : LumpedJoint or None
    turning : float or None [rad/s]
        Spindle speed of the tool-holder's gyroscopic moments; None leaves them out.
    slopes : bool
        Over translation and slope of each plane, instead of both translations.
    rods : sequence of ReducedRod, default none
        The tool-holder along its axis, and about it; with the first the tip moves along the axis, too.

    Notes
    -----
    Modes with real coefficients have no hysteretic loss: the materials' loss S becomes viscous, S_ij / sqrt(w_i w_j) between modes of
    the whole, the same at each resonance. The joint's damper behind a residual compliance is taken to first order. Both are below
    1e-3 of the receptance on the tests' machines.
    """
    between = _spring(flange, joint)
    if between is None:
        return None
    spring, damper = between
    h, m = len(holder.damping), flange.omega_n.size
    n = 2 * h + sum(len(rod.damping) for rod in rods) + m
    planes = (slice(0, h), slice(h, 2 * h))
    stiffness, damping, loss, moments = (np.zeros((n, n)) for _ in range(4))
    seen = 2 if slopes else 1
    moved = 2 * seen + min(len(rods), 1)
    gap, tip = np.zeros((4 + len(rods), n)), np.zeros((moved, n))
    for k, own in enumerate(planes):
        stiffness[own, own], loss[own, own], damping[own, own] = holder.stiffness.real, holder.stiffness.imag, holder.damping
        gap[2 * k : 2 * k + 2, own] = holder.ports[2:]
        tip[seen * k : seen * (k + 1), own] = holder.ports[:seen]
    across = 0.0 if turning is None else 2.0 * turning
    moments[planes[0], planes[1]], moments[planes[1], planes[0]] = -across * holder.rotary, across * holder.rotary
    first = 2 * h
    for k, rod in enumerate(rods):
        own = slice(first, first + len(rod.damping))
        stiffness[own, own], loss[own, own], damping[own, own] = rod.stiffness.real, rod.stiffness.imag, rod.damping
        gap[4 + k, own] = rod.ports[1]
        if k == 0:
            tip[-1, own] = rod.ports[0]
        first = own.stop
    own = slice(first, n)
    stiffness[own, own], damping[own, own], moments[own, own] = flange.stiffness, flange.damping, flange.speed * flange.gyroscopic
    gap[:, own] = -flange.psi.T
    squares, shapes = scipy.linalg.eigh(stiffness + gap.T @ spring @ gap)
    natural = np.sqrt(squares)
    viscous = shapes.T @ (damping + gap.T @ damper @ gap) @ shapes + shapes.T @ loss @ shapes / np.sqrt(np.outer(natural, natural))
    poles = gyroscopic_poles(natural, viscous, shapes.T @ moments @ shapes, (tip @ shapes).T, np.zeros((moved, moved)))
    return _within(poles, BEYOND * holder.highest)


def poles_of(
    assembly: ToolAssembly, believed: JointedFlange, highest: float, turning: float | None, slopes: bool = False
) -> PoleResidue | None:
    """Return the same of a flange and the joint in front of it, or None where it does not stand in modes.

    `believed`: of both bending planes, or of all six directions
    `highest` [rad/s]: up to which the tip is asked for
    `turning` [rad/s]: spindle speed of the tool-holder's gyroscopic moments; None leaves them out
    `slopes`: as in `synthesised_poles`
    """
    flange = believed.flange
    if not isinstance(flange, TurningModes) or flange.coordinates not in (FLANGE, WHOLE_FLANGE):
        return None
    holder = turning_tool_holder(assembly, highest, 0.0 if turning is None else turning)
    rods = [reduced_rod(assembly, highest, twisting) for twisting in (False, True)] if flange.coordinates == WHOLE_FLANGE else []
    return synthesised_poles(holder, flange, believed.joint, turning, slopes, rods)


def _spring(flange: TurningModes, joint: LumpedJoint | None) -> tuple[FloatArray, FloatArray] | None:
    """Stiffness and damping of joint and residual compliance behind each other, shape (d, d) each; None where they are rigid."""
    d = len(flange.coordinates)
    compliance, lag = np.array(flange.residual), np.zeros(d)
    if joint is not None:
        stiffness = np.array([joint.translational_stiffness, joint.rotational_stiffness] * (d // 2))
        compliance[np.arange(d), np.arange(d)] += 1.0 / stiffness
        lag = np.array([joint.translational_damping, joint.rotational_damping] * (d // 2)) / stiffness**2
    scale = np.sqrt(np.diag(compliance))
    if not np.all(scale > 0.0) or np.linalg.cond(compliance / np.outer(scale, scale)) > 1e8:
        return None
    spring = np.linalg.inv(compliance / np.outer(scale, scale)) / np.outer(scale, scale)
    return spring, spring @ (lag[:, None] * spring)


def _within(poles: PoleResidue, highest: float) -> PoleResidue:
    """The poles up to a frequency [rad/s]; those beyond it are what they are at rest."""
    kept = np.abs(poles.pole) <= highest
    beyond = poles.outputs[:, ~kept] / -poles.pole[~kept] @ poles.inputs[~kept]
    return PoleResidue(poles.pole[kept], poles.outputs[:, kept], poles.inputs[kept], poles.constant + 2.0 * beyond.real)
