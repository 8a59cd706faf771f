"""Modes of a tool, or of tool and holder, that hangs on a string: bending with its damping, axial and torsional ones from rods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np
import scipy.linalg

from rcsa_ident.arrays import FloatArray
from rcsa_ident.dynamics.structure import Structure, poles
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_structure
from rcsa_ident.tool_holder.timoshenko import ShearCoefficient, cowper

#: Longest element of a rod [m].
_ELEMENT = 2e-3


class Motion(StrEnum):
    """How a mode moves."""

    BENDING = "bending"
    AXIAL = "axial"
    TORSION = "torsion"


@dataclass(frozen=True, slots=True)
class FreeMode:
    """A mode of a free body.

    Parameters
    ----------
    motion : Motion
    order : int
        From 1 in its kind; bending modes stand for both planes.
    omega : float [rad/s]
        Undamped natural frequency, the modulus of the pole.
    damping : float or None [-]
        Damping ratio; None where the model tells none, of axial and torsional modes.
    """

    motion: Motion
    order: int
    omega: float
    damping: float | None = None

    def __str__(self) -> str:
        return f"{self.motion} {self.order}"


def bending_modes(body: ToolAssembly, count: int, highest: float, shear_coefficient: ShearCoefficient = cowper) -> tuple[FreeMode, ...]:
    """Return the first bending modes of a free tool-holder, in ascending order, fewer where fewer are below the highest frequency.

    Parameters
    ----------
    body : ToolAssembly
        With what hangs behind its flange, see `rcsa_ident.tool_holder.taper.hung`; of a tool alone see `bare`.
    count : int
    highest : float [Hz]
        The mesh is chosen for it, and modes end there.
    shear_coefficient : callable
        As in `rcsa_ident.tool_holder.model.tool_holder_structure`.

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

    Parameters
    ----------
    structure : Structure
        Of one bending plane.
    highest : float [Hz]
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

    A fluted part twists as the circle of its second moment would. What holds the tool axially and against turning is not drawn: the
    contact's translational stiffness is taken, around the shank for torsion.

    Parameters
    ----------
    body : ToolAssembly
    motion : Motion
        Axial or torsion.
    highest : float [Hz]

    Examples
    --------
    The first axial mode of a rod is at half the speed of sound over its length:

    >>> from rcsa_ident.tool_holder.geometry import MATERIALS
    >>> steel = MATERIALS["steel"]
    >>> mode, = rod_modes(bare((BeamSegment(0.2, 0.01, steel),)), Motion.AXIAL, 15e3)
    >>> round(mode.omega / (2 * np.pi)), round((steel.youngs_modulus / steel.density) ** 0.5 / 0.4)
    (12776, 12776)
    """
    tool, holder = _rod(body.tool, motion), _rod(body.holder, motion)
    layered = body.contact is not None and body.insertion > 0.0
    nose = body.stickout
    if not layered and body.insertion > 0.0:
        # rigid: nodes of both bodies at the same place move as one
        cuts = np.unique(np.round(np.concatenate([tool[0], nose + holder[0]]), 9))
        tool, holder = _rod(body.tool, motion, cuts), _rod(body.holder, motion, cuts - nose)
    places = [(0, z) for z in tool[0]] + [(1, z + nose) for z in holder[0]]
    number: dict[tuple[int, int], int] = {}
    for side, z in places:
        joined = not layered and (0, round(z * 1e9)) in number
        number.setdefault((side, round(z * 1e9)), number[0, round(z * 1e9)] if joined else len(set(number.values())))
    size = len(set(number.values()))
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    for side, (edges, rigidity, inertia) in ((0, tool), (1, holder)):
        at = [number[side, round((z + side * nose) * 1e9)] for z in edges]
        for i, length in enumerate(np.diff(edges)):
            pair = np.ix_(at[i : i + 2], at[i : i + 2])
            stiffness[pair] += rigidity[i] / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
            mass[pair] += inertia[i] * length / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    if layered:
        assert body.contact is not None
        spring = body.contact.translational_stiffness * (0.25 * body.tool[-1].diameter ** 2 if motion is Motion.TORSION else 1.0)
        inside = tool[0][tool[0] >= nose - 1e-9]
        share = body.insertion / inside.size
        beside = holder[0] + nose
        for z in inside:
            pair = np.ix_(*2 * ([number[0, round(z * 1e9)], number[1, round(beside[np.argmin(np.abs(beside - z))] * 1e9)]],))
            stiffness[pair] += spring * share * np.array([[1.0, -1.0], [-1.0, 1.0]])
    omega = np.sqrt(np.maximum(scipy.linalg.eigvalsh(stiffness, mass), 0.0))[1:]
    return tuple(FreeMode(motion, k + 1, float(w)) for k, w in enumerate(omega[omega <= 2.0 * np.pi * highest]))


def _rod(segments: Sequence[BeamSegment], motion: Motion, cuts: FloatArray | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Stations of a body [m], and rigidity and inertia per length between them: E A and rho A, or G J and rho J."""
    edges, pieces, start = [0.0], [], 0.0
    for segment in segments:
        count = int(np.ceil(segment.length / _ELEMENT))
        inner = np.linspace(0.0, segment.length, count + 1)
        if cuts is not None:
            inner = np.unique(np.round(np.concatenate([inner, [c - start for c in cuts if 0.0 < c - start < segment.length]]), 9))
        pieces += [segment.part(a, b) for a, b in pairwise(inner)]
        edges += [start + b for b in inner[1:]]
        start += segment.length
    rigidity, inertia = np.array([_section(piece, motion) for piece in pieces]).T
    return np.array(edges), rigidity, inertia


def _section(piece: BeamSegment, motion: Motion) -> tuple[float, float]:
    material = piece.material
    if motion is Motion.AXIAL:
        area = piece.mass / (material.density * piece.length)
        return material.youngs_modulus * area, material.density * area
    outer = 0.5 * (piece.diameter + piece.end)
    polar = np.pi / 32.0 * (outer**4 - piece.inner_diameter**4) if piece.second_moment is None else 2.0 * piece.second_moment
    return material.shear_modulus * polar, material.density * polar


def denser(tool: Sequence[BeamSegment], log_ratio: float) -> tuple[BeamSegment, ...]:
    """Return a tool whose material is denser by a ratio."""
    ratio = float(np.exp(log_ratio))
    return tuple(replace(s, material=replace(s.material, density=s.material.density * ratio)) for s in tool)
