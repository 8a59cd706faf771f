"""Modes of a tool, or of tool and holder, that hangs on a string: bending with its damping, axial and torsional ones from rods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from rcsa_ident.dynamics.structure import Structure, natural_frequencies, poles
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_structure
from rcsa_ident.tool_holder.rods import rod_structure
from rcsa_ident.tool_holder.timoshenko import ShearCoefficient, cowper


class Motion(StrEnum):
    """How a mode moves."""

    BENDING = "bending"
    AXIAL = "axial"
    TORSION = "torsion"


@dataclass(frozen=True, slots=True)
class FreeMode:
    """A mode of a free body.

    `order`: from 1 in its kind; bending modes stand for both planes
    `omega` [rad/s]: undamped natural frequency, the modulus of the pole
    `damping` [-]: damping ratio; None where the model tells none, of axial and torsional modes
    """

    motion: Motion
    order: int
    omega: float
    damping: float | None = None

    def __str__(self) -> str:
        return f"{self.motion} {self.order}"


def bending_modes(body: ToolAssembly, count: int, highest: float, shear_coefficient: ShearCoefficient = cowper) -> tuple[FreeMode, ...]:
    """Return the first bending modes of a free tool-holder, in ascending order, fewer where fewer are below the highest frequency.

    `body`: with what hangs behind its flange, see `rcsa_ident.tool_holder.taper.hung`; of a tool alone see `bare`
    `highest` [Hz]: the mesh is chosen for it, and modes end there
    `shear_coefficient`: as in `rcsa_ident.tool_holder.model.tool_holder_structure`

    Examples
    --------
    A steel rod of 200 mm by 10 mm: the closed form without shear and rotary inertia says 1140 Hz.

    >>> from rcsa_ident.tool_holder.geometry import MATERIALS
    >>> rod = bare((BeamSegment(0.2, 0.01, MATERIALS["steel"]),))
    >>> round(bending_modes(rod, 1, 5000.0)[0].omega / (2 * np.pi))
    1130
    """
    structure = tool_holder_structure(body, highest, shear_coefficient=shear_coefficient)
    found = damped_poles(structure, highest)[:count]
    return tuple(FreeMode(Motion.BENDING, k + 1, abs(pole), float(-pole.real / abs(pole))) for k, pole in enumerate(found))


def damped_poles(structure: Structure, highest: float) -> np.ndarray:
    """Return the poles of a free structure above its rigid-body motions, in ascending order [1/s].

    `structure`: of one bending plane
    `highest` [Hz]
    """
    omega = 2.0 * np.pi * highest
    found = poles(structure, omega).pole
    # rigid-body motions stand as pairs at a ten-millionth of the highest frequency
    found = found[(found.imag > 1e-3 * omega) & (np.abs(found) <= omega)]
    return np.asarray(found[np.argsort(np.abs(found))])


def bare(tool: Sequence[BeamSegment]) -> ToolAssembly:
    """Return a tool alone as a body: its last segment is cut in two, the rear one standing where a holder would."""
    *front, last = tool
    half = 0.5 * last.length
    return ToolAssembly((*front, last.part(0.0, half)), (last.part(half, last.length),), insertion=0.0)


def rod_modes(body: ToolAssembly, motion: Motion, highest: float) -> tuple[FreeMode, ...]:
    """Return axial or torsional modes of a free body up to a frequency, from rods in a row; they tell lines apart, and nothing is learned.

    `motion`: axial or torsion
    `highest` [Hz]

    Examples
    --------
    The first axial mode of a rod is at half the speed of sound over its length:

    >>> from rcsa_ident.tool_holder.geometry import MATERIALS
    >>> steel = MATERIALS["steel"]
    >>> mode, = rod_modes(bare((BeamSegment(0.2, 0.01, steel),)), Motion.AXIAL, 15e3)
    >>> round(mode.omega / (2 * np.pi)), round((steel.youngs_modulus / steel.density) ** 0.5 / 0.4)
    (12776, 12776)
    """
    omega = natural_frequencies(rod_structure(body, motion is Motion.TORSION))[1:]
    return tuple(FreeMode(motion, k + 1, float(w)) for k, w in enumerate(omega[omega <= 2.0 * np.pi * highest]))


def denser(tool: Sequence[BeamSegment], log_ratio: float) -> tuple[BeamSegment, ...]:
    """Return a tool whose material is denser by a ratio."""
    ratio = float(np.exp(log_ratio))
    return tuple(replace(s, material=replace(s.material, density=s.material.density * ratio)) for s in tool)
