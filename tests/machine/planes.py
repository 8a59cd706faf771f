"""Machines whose bending planes feel each other, and the same worked out by other roads."""

from __future__ import annotations

import numpy as np

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.tool_holder.model import tool_holder_receptance

BAND = (2.0 * np.pi * 300.0, 2.0 * np.pi * 3000.0)
JOINT = LumpedJoint(2e9, 5e6, 2000.0, 10.0)
FLANGES = (*plane("flange", Dof.X), *plane("flange", Dof.Y))
TIPS = (*plane("tip", Dof.X), *plane("tip", Dof.Y))
TIP = (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y))
#: Natural frequencies [Hz] and mass-normalised shapes over `FLANGES`: none moves along a machine axis.
FREQUENCIES = np.array([700.0, 950.0, 1400.0, 2100.0])
SHAPES = np.array([[0.20, 1.5, 0.07, 0.4], [-0.06, -0.5, 0.17, 1.9], [0.14, -1.0, 0.05, 2.2], [0.09, 2.5, -0.13, -1.2]])
RESIDUAL = np.diag([2e-10, 3e-8, 2e-10, 3e-8])


def oblique(change: float = 1.0, turn: float = 0.0) -> ModalModel:
    """Modes that are oblique to both axes, turned from X towards Y by an angle [rad]; `change` scales the first frequency."""
    natural = 2.0 * np.pi * FREQUENCIES * np.array([change, 1.0, 1.0, 1.0])
    return normal_modes(natural, np.array([0.05, 0.04, 0.05, 0.03]), SHAPES @ turned(turn).T, FLANGES, RESIDUAL)


def turned(angle: float) -> np.ndarray:
    """What a flange's coordinates become where the machine is turned about its spindle, shape (4, 4)."""
    return np.kron(rotation(angle), np.eye(2))


def rotation(angle: float) -> np.ndarray:
    """From X towards Y, shape (2, 2)."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def holder_in_both_planes(assembly, omega: np.ndarray) -> Receptance:
    """The tool-holder in X and Y at once, which it does not couple: written down entry by entry."""
    one = tool_holder_receptance(assembly, omega).values
    ends = (*TIPS, *FLANGES)
    values = np.zeros((omega.size, 8, 8), dtype=complex)
    for first in (0, 2):
        places = np.array([first, first + 1, first + 4, first + 5])
        values[:, places[:, None], places] = one
    return Receptance(omega, values, ends, ends)


def coupled_in_both_planes(assembly, flange, omega: np.ndarray, joint: LumpedJoint | None = JOINT) -> Receptance:
    """Tip and spindle by the 4 x 4 coupling."""
    return couple(holder_in_both_planes(assembly, omega), flange.receptance(omega), joint)


def tip_in_both_planes(assembly, flange, omega: np.ndarray, joint: LumpedJoint | None = JOINT) -> np.ndarray:
    """The tip's translations of that, shape (n, 2, 2)."""
    return coupled_in_both_planes(assembly, flange, omega, joint).block(TIP).values


def beside(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference of square receptances, each entry over the geometric mean of its diagonal ones."""
    size = np.sqrt(np.abs(np.einsum("...ii->...i", expected)))
    return float(np.max(np.abs(found - expected) / size[..., :, None] / size[..., None, :]))
