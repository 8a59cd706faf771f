"""Tool and holder as rods in a row: how they stretch along their axis, and how they twist.

What holds the tool axially and against turning is not drawn: the contact's translational stiffness and damping are taken, around the
shank for torsion. A connection without a contact is rigid.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import PoleModel
from rcsa_ident.dynamics.structure import Structure, poles, projection_basis
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly

#: Longest element [m].
ELEMENT = 2e-3
#: Ends of a rod that stretches, and of one that twists, in the order of `rod_poles`.
ENDS = (Coordinate("tip", Dof.Z), Coordinate("flange", Dof.Z))
TWISTING_ENDS = (Coordinate("tip", Dof.TORSION), Coordinate("flange", Dof.TORSION))
#: Stiffness over E A / L, and mass over rho A L.
_STIFFNESS = np.array([[1.0, -1.0], [-1.0, 1.0]])
_MASS = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0


def rod_structure(assembly: ToolAssembly, twisting: bool = False) -> Structure:
    """Return mass, damping and stiffness of the free assembly along its axis, with coordinates at ``tip`` and ``flange``.

    Parameters
    ----------
    assembly : ToolAssembly
    twisting : bool
        Of rotations about the axis instead; a fluted part twists as the circle of its second moment would.

    Examples
    --------
    A steel rod of 200 mm: its first axial mode is at half the speed of sound over its length.

    >>> from rcsa_ident.dynamics.structure import natural_frequencies
    >>> from rcsa_ident.tool_holder.geometry import MATERIALS
    >>> steel = MATERIALS["steel"]
    >>> rod = ToolAssembly((BeamSegment(0.1, 0.01, steel),), (BeamSegment(0.1, 0.01, steel),), insertion=0.0)
    >>> round(natural_frequencies(rod_structure(rod))[1] / (2 * np.pi)), round((steel.youngs_modulus / steel.density) ** 0.5 / 0.4)
    (12776, 12776)
    """
    layered = assembly.contact is not None and assembly.insertion > 0.0
    pieces = _pieces(assembly)
    edges = _stations([z for _, start, segment in pieces for z in (start, start + segment.length)])
    numbers = _numbers(edges, assembly, layered)
    d = len(set(numbers.values()))
    mass, damping, stiffness, loss = (np.zeros((d, d)) for _ in range(4))
    for body, start, segment in pieces:
        first, last = _key(start), _key(start + segment.length)
        for a, b in pairwise(z for z in edges.tolist() if first <= _key(z) <= last):
            rigidity, inertia = _section(segment.part(a - start, b - start), twisting)
            pair = np.ix_(*2 * ([numbers[body, _key(a)], numbers[body, _key(b)]],))
            stiffness[pair] += rigidity / (b - a) * _STIFFNESS
            loss[pair] += segment.material.loss_factor * rigidity / (b - a) * _STIFFNESS
            mass[pair] += inertia * (b - a) * _MASS
    if layered:
        assert assembly.contact is not None
        arm = 0.25 * assembly.tool[-1].diameter ** 2 if twisting else 1.0
        held = np.array([z for z in edges.tolist() if _key(assembly.stickout) <= _key(z) <= _key(assembly.tool_length)])
        for z, share in zip(held.tolist(), _shares(held).tolist(), strict=True):
            pair = np.ix_(*2 * ([numbers[0, _key(z)], numbers[1, _key(z)]],))
            stiffness[pair] += arm * share * assembly.contact.translational_stiffness * _STIFFNESS
            damping[pair] += arm * share * assembly.contact.translational_damping * _STIFFNESS
    ends = np.array([numbers[0, 0], numbers[1, _key(edges[-1])]], dtype=np.intp)
    return Structure(mass, damping, stiffness, loss, TWISTING_ENDS if twisting else ENDS, ends)


@lru_cache(maxsize=64)
def rod_poles(assembly: ToolAssembly, highest: float, twisting: bool = False) -> PoleModel:
    """Return the poles behind the axial receptances of the free assembly, between tip and flange, or behind those of its twist.

    `highest` [rad/s]: frequency up to which they are good
    """
    return poles(rod_structure(assembly, twisting), highest)


@dataclass(frozen=True, slots=True, eq=False)
class ReducedRod:
    """A free rod in few coordinates whose mass is the identity: its rigid motion, then elastic ones.

    `stiffness`, shape (m, m): with the materials' loss in its imaginary part
    `damping`, shape (m, m)
    `ports`, shape (2, m): motion of the tip, then of the flange
    """

    stiffness: ComplexArray
    damping: FloatArray
    ports: FloatArray


@lru_cache(maxsize=64)
def reduced_rod(assembly: ToolAssembly, highest: float, twisting: bool = False) -> ReducedRod:
    """Return the free assembly as a rod in few coordinates, its own exact solutions at a few frequencies; see `rod_poles`."""
    structure = rod_structure(assembly, twisting)
    rigid = np.ones((structure.mass.shape[0], 1)) / np.sqrt(np.sum(structure.mass))
    basis = np.hstack([rigid, projection_basis(structure, rigid, [np.zeros_like(structure.mass)], highest)])
    stiffness = basis.T @ (structure.stiffness + 1j * structure.structural_damping) @ basis
    damping = basis.T @ structure.damping @ basis
    # nothing holds a free rod
    for matrix in (stiffness, damping):
        matrix[0], matrix[:, 0] = 0.0, 0.0
    return ReducedRod(stiffness, damping, basis[structure.index])


def _pieces(assembly: ToolAssembly) -> list[tuple[int, float, BeamSegment]]:
    """Body (0 tool, 1 holder), start and segment of all stretches."""
    found = []
    for body, segments, z in ((0, assembly.tool, 0.0), (1, assembly.holder, assembly.stickout)):
        for segment in segments:
            found.append((body, z, segment))
            z += segment.length
    return found


def _stations(steps: list[float]) -> FloatArray:
    """All places where something begins or ends, and more in between: both bodies have nodes at the same places."""
    places = np.unique([_key(z) for z in steps]) * 1e-9
    inner = [np.linspace(a, b, int(np.ceil((b - a) / ELEMENT)) + 1)[1:] for a, b in pairwise(places)]
    return np.concatenate([places[:1], *inner])


def _numbers(edges: FloatArray, assembly: ToolAssembly, layered: bool) -> dict[tuple[int, int], int]:
    """The freedom of each body's node, by body and place; along the axis, so that matrices are banded."""
    found: dict[tuple[int, int], int] = {}
    number = 0
    for z in edges.tolist():
        of_tool, of_holder = _key(z) <= _key(assembly.tool_length), _key(z) >= _key(assembly.stickout)
        if of_tool:
            found[0, _key(z)] = number
        if of_holder:
            number += of_tool and layered
            found[1, _key(z)] = number
        number += 1
    return found


def _shares(held: FloatArray) -> FloatArray:
    """The length that each node over the insertion stands for."""
    half = 0.5 * np.diff(held)
    return np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half])


def _key(z: float) -> int:
    """Places are told apart to a nanometre."""
    return round(z * 1e9)


def _section(piece: BeamSegment, twisting: bool) -> tuple[float, float]:
    """E A and rho A; twisting, G J and rho J."""
    material = piece.material
    if not twisting:
        area = piece.mass / (material.density * piece.length)
        return material.youngs_modulus * area, material.density * area
    outer = 0.5 * (piece.diameter + piece.end)
    polar = np.pi / 32.0 * (outer**4 - piece.inner_diameter**4) if piece.second_moment is None else 2.0 * piece.second_moment
    return material.shear_modulus * polar, material.density * polar
