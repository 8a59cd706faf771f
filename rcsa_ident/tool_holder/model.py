"""The finite-element model of tool and holder, free in space, seen at tip and flange."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import PoleModel
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.structure import Structure, poles
from rcsa_ident.tool_holder.geometry import BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.timoshenko import (
    Section,
    ShearCoefficient,
    cowper,
    refined_beam_matrices,
    refined_layer_matrices,
    refined_rotary_matrices,
    section,
    stacked,
    together,
)

#: Elements per bending wavelength at the highest frequency, and per diameter; the error falls with their fourth power,
#: on a taper (a stair of mean sections) with the second.
ELEMENTS_PER_WAVELENGTH = 20.0
ELEMENTS_PER_DIAMETER = 2.5
ELEMENTS_PER_TAPER = 16


@dataclass(frozen=True, slots=True)
class _Element:
    body: int
    first: int
    """Station at its start; it ends at the next one."""
    section: Section


def tool_holder_structure(
    assembly: ToolAssembly,
    max_frequency: float,
    axis: Dof = Dof.X,
    shear_coefficient: ShearCoefficient = cowper,
    refinement: int = 1,
) -> Structure:
    """Return mass, damping and stiffness of the free assembly, with coordinates at ``tip`` and ``flange``.

    Parameters
    ----------
    assembly : ToolAssembly
    max_frequency : float [Hz]
        The mesh is chosen for it.
    axis : Dof
        The bending plane; the assembly is the same in all.
    shear_coefficient : callable of (Poisson's ratio, inner over outer diameter)
        `cowper` or `hutchinson`.
    refinement : int
        Divides every element further: for convergence studies.

    Notes
    -----
    Stations stand at every step of either body, and both bodies have nodes at all of them over the insertion, so that
    the contact is integrated over elements that match. A rigid connection makes one beam of the two there.
    """
    return free_body(assembly, max_frequency, axis, shear_coefficient, refinement).structure


@dataclass(frozen=True, slots=True, eq=False)
class FreeBody:
    """A free assembly with what a spindle that turns needs to know of it.

    `structure`: of one bending plane
    `rotary`, shape (d, d): the rotary inertia's share of its mass. Turning with W, a slope's rate asks for a moment 2 W times it in the
        other plane: of a thin slice the polar moment of inertia is twice the diametral one.
    `rigid`, shape (d, 2): translation and rotation about the tip, as no spring feels them: unit deflection, unit slope
    """

    structure: Structure
    rotary: FloatArray
    rigid: FloatArray


def free_body(
    assembly: ToolAssembly,
    max_frequency: float,
    axis: Dof = Dof.X,
    shear_coefficient: ShearCoefficient = cowper,
    refinement: int = 1,
    points: Sequence[float] = (),
    like: ToolAssembly | None = None,
) -> FreeBody:
    """Return what `tool_holder_structure` does, with the rotary inertia apart and the rigid-body motions.

    `max_frequency` [Hz]
    `points`: sequence of float [m], further points that the structure has coordinates at, behind tip and flange: distances from the tip, of
        the tool in front of the holder's nose and of the holder from there on
    `like`: an assembly of the same stretches whose division into elements is taken: matrices of both then have the same freedoms
    """
    layered = assembly.contact is not None and assembly.insertion > 0.0
    stations, elements = _mesh(assembly, max_frequency, shear_coefficient, refinement, not layered, points, like)
    length = np.diff(stations)
    first_freedom, d = _number(elements, stations.size, layered)
    mass, damping, stiffness, loss, rotary = (np.zeros((d, d)) for _ in range(5))
    freedoms = np.array([_freedoms(first_freedom, e) for e in elements])
    sections = stacked([e.section for e in elements])
    sizes = length[[e.first for e in elements]]
    matrices = (*refined_beam_matrices(sections, sizes), refined_rotary_matrices(sections, sizes))
    for total, each in zip((mass, stiffness, loss, rotary), matrices, strict=True):
        _add(total, freedoms, each)
    if layered:
        assert assembly.contact is not None
        _tie(elements, freedoms, length, assembly.contact, stiffness, damping)
    tip, flange = (first_freedom[_node(e.body, e.first + end)] for e, end in ((elements[0], 0), (elements[-1], 1)))
    outer = [_node(int(_key(z) >= _key(assembly.stickout)), int(np.argmin(np.abs(stations - z)))) for z in points]
    # where both are one beam, its nodes are the tool's
    further = [first_freedom[node if node in first_freedom else (node[0], 0)] for node in outer]
    index = np.array([i + own for i in (tip, flange, *further) for own in (0, 1)])
    rigid = np.zeros((d, 2))
    for (station, kind), number in first_freedom.items():
        if kind < 2:
            rigid[number], rigid[number + 1] = (1.0, stations[station]), (0.0, 1.0)
    coordinates = (*plane("tip", axis), *plane("flange", axis), *(each for z in points for each in plane(point_name(z), axis)))
    structure = Structure(mass, damping, stiffness, loss, coordinates, index)
    return FreeBody(structure, rotary, rigid)


def point_name(z: float) -> str:
    """Return what a point of a tool-holder is called, from its distance to the tip [m]."""
    return f"{1e3 * z:.9g} mm"


def receptance_at_points(
    assembly: ToolAssembly, omega: FloatArray, points: Sequence[float], sensor: tuple[float, float] | None = None, axis: Dof = Dof.X
) -> Receptance:
    """Return the free-free receptances between tip, flange and further points, shape (n, 4 + 2 k, 4 + 2 k).

    `omega` [rad/s], shape (n,)
    `points`: sequence of float [m], distances from the tip, as `free_body` takes them; `point_name` tells what they are called
    `sensor`: (float, float) or None [m], [kg]; where a sensor is fixed to the assembly, one of the points, and its mass
    `axis`: the bending plane
    Raises `InputError` if a point lies outside the assembly.

    Examples
    --------
    >>> from rcsa_ident.tool_holder.geometry import MATERIALS
    >>> steel = MATERIALS["steel"]
    >>> bar = ToolAssembly((BeamSegment(0.1, 0.02, steel),), (BeamSegment(0.1, 0.05, steel),), insertion=0.02)
    >>> receptance_at_points(bar, np.array([6e3]), [0.05]).values.shape
    (1, 6, 6)
    """
    length = assembly.stickout + assembly.holder_length
    for z in points:
        if not 0.0 <= z <= length:
            raise InputError("points", f"{1e3 * z:g} mm from the tip", f"0 to {1e3 * length:g} mm, the assembly's length")
    omega = np.asarray(omega, dtype=float)
    structure = free_body(assembly, float(omega.max()) / (2.0 * np.pi), axis, points=points).structure
    if sensor is not None:
        place = structure.index[4 + 2 * list(points).index(sensor[0])]
        mass = structure.mass.copy()
        mass[place, place] += sensor[1]
        structure = replace(structure, mass=mass)
    return poles(structure, float(omega.max())).receptance(omega)


def tool_holder_receptance(
    assembly: ToolAssembly, omega: FloatArray, axis: Dof = Dof.X, shear_coefficient: ShearCoefficient = cowper
) -> Receptance:
    """Return the free-free receptances between tip and flange, shape (n, 4, 4), with mesh and modes chosen for `omega`.

    Parameters
    ----------
    assembly : ToolAssembly
    omega : array, shape (n,) [rad/s]
    axis : Dof
        The bending plane.
    shear_coefficient : callable
        As in `tool_holder_structure`.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> from rcsa_ident.tool_holder.model import tool_holder_receptance
    >>> assembly = ri.sample_tooling("S1-ER32").assembly
    >>> print(tool_holder_receptance(assembly, ri.hz(500.0, 4000.0, 5.0)))
    tip.x, tip.x', flange.x, flange.x': 701 frequencies, 500 to 4000 Hz
    """
    omega = np.asarray(omega, dtype=float)
    return tool_holder_poles(assembly, float(omega.max()), axis, shear_coefficient).receptance(omega)


@lru_cache(maxsize=64)
def tool_holder_poles(assembly: ToolAssembly, highest: float, axis: Dof = Dof.X, shear_coefficient: ShearCoefficient = cowper) -> PoleModel:
    """Return the poles behind those receptances: translation and slope of the tip, then of the flange.

    Parameters
    ----------
    assembly : ToolAssembly
    highest : float [rad/s]
        Frequency up to which they are good.
    axis : Dof
        The bending plane.
    shear_coefficient : callable
        As in `tool_holder_structure`.

    Notes
    -----
    The last ones are kept: a machine that changes with speed asks for the same tool-holder at every speed.
    """
    return poles(tool_holder_structure(assembly, highest / (2.0 * np.pi), axis, shear_coefficient), highest)


def mesh_error(assembly: ToolAssembly, omega: FloatArray, shear_coefficient: ShearCoefficient = cowper) -> float:
    """Return the relative error of the receptances against a mesh twice as fine, both solved exactly [-].

    `omega` [rad/s], shape (n,)
    `shear_coefficient`: as in `tool_holder_structure`
    """
    omega = np.asarray(omega, dtype=float)
    highest = float(omega.max()) / (2.0 * np.pi)
    coarse, fine = (
        tool_holder_structure(assembly, highest, shear_coefficient=shear_coefficient, refinement=r).receptance(omega).values for r in (1, 2)
    )
    return float(np.max(np.linalg.norm(coarse - fine, axis=0) / np.linalg.norm(fine, axis=0)))


def _mesh(
    assembly: ToolAssembly,
    max_frequency: float,
    shear_coefficient: ShearCoefficient,
    refinement: int,
    merged: bool,
    points: Sequence[float] = (),
    like: ToolAssembly | None = None,
) -> tuple[FloatArray, list[_Element]]:
    """Stations along z and the elements between them, from the tip to the flange."""
    stretches = _stretches(assembly, points)
    counts = [
        max(_division(segment, b - a, max_frequency, shear_coefficient) for _, _, segment in here) * refinement
        for a, b, here in (stretches if like is None else _stretches(like, points))
    ]
    stations, elements = [0.0], []
    for (a, b, here), count in zip(stretches, counts, strict=True):
        edges = np.linspace(a, b, count + 1)
        tapered = any(segment.end_diameter is not None for _, _, segment in here)
        for i, (start, end) in enumerate(pairwise(edges)):
            if i == 0 or tapered:
                parts = [(body, section(segment.part(start - first, end - first), shear_coefficient)) for body, first, segment in here]
                if merged:
                    parts = [(parts[0][0], together([each for _, each in parts]))]
            elements += [_Element(body, len(stations) - 1 + i, each) for body, each in parts]
        stations += edges[1:].tolist()
    return np.array(stations), elements


def _stretches(assembly: ToolAssembly, points: Sequence[float]) -> list[tuple[float, float, list[tuple[int, float, BeamSegment]]]]:
    """Start and end of each stretch between two steps of either body, with body, start and segment of what is there."""
    pieces = _pieces(assembly)
    steps = sorted({_key(z) for _, first, last, _ in pieces for z in (first, last)} | {_key(z) for z in points})
    found = []
    for a, b in ((a * 1e-9, b * 1e-9) for a, b in pairwise(steps)):
        middle = 0.5 * (a + b)
        found.append((a, b, [(body, first, segment) for body, first, last, segment in pieces if first < middle < last]))
    return found


def _pieces(assembly: ToolAssembly) -> list[tuple[int, float, float, BeamSegment]]:
    """Body (0 tool, 1 holder), start, end and segment of all stretches."""
    pieces = []
    for body, segments, start in ((0, assembly.tool, 0.0), (1, assembly.holder, assembly.stickout)):
        z = start
        for segment in segments:
            pieces.append((body, z, z + segment.length, segment))
            z += segment.length
    return pieces


def expected_elements(assembly: ToolAssembly, max_frequency: float) -> float:
    """Return about how many finite elements an assembly has up to a frequency [Hz], before any of them is made."""
    return sum(_elements(segment, segment.length, max_frequency, cowper) for segment in (*assembly.tool, *assembly.holder))


def _division(segment: BeamSegment, length: float, max_frequency: float, shear_coefficient: ShearCoefficient) -> int:
    """Elements of a stretch."""
    return int(np.ceil(_elements(segment, length, max_frequency, shear_coefficient)))


def _elements(segment: BeamSegment, length: float, max_frequency: float, shear_coefficient: ShearCoefficient) -> float:
    """Elements of a stretch, short against the bending wavelength and the diameter."""
    beam = section(segment, shear_coefficient)
    wavelength = 2.0 * np.pi * float((beam.bending / beam.mass) ** 0.25) / np.sqrt(2.0 * np.pi * max(max_frequency, 1.0))
    density = max(ELEMENTS_PER_WAVELENGTH / wavelength, ELEMENTS_PER_DIAMETER / max(segment.diameter, segment.end))
    return max(length * density, 2.0 if segment.end_diameter is None else float(ELEMENTS_PER_TAPER))


def _key(z: float) -> int:
    """Steps are told apart to a nanometre."""
    return round(z * 1e9)


def _node(body: int, station: int) -> tuple[int, int]:
    return station, body


def _number(elements: list[_Element], stations: int, layered: bool) -> tuple[dict[tuple[int, int], int], int]:
    """First freedom of each node, and of each element's inside (keyed by station and body + 2), by position: the matrices are banded."""
    slots = {(e.first, e.body + 2) for e in elements}
    slots |= {_node(e.body, e.first + end) for e in elements for end in (0, 1)}
    numbers: dict[tuple[int, int], int] = {}
    number = 0
    for station, kind in sorted(slots):
        # without a layer between the bodies the tool's last node is the holder's
        if kind == 1 and not layered and (station, 0) in numbers:
            numbers[station, 1] = numbers[station, 0]
            continue
        numbers[station, kind] = number
        number += 2
    return numbers, number


def _freedoms(numbers: dict[tuple[int, int], int], e: _Element) -> list[int]:
    first, last = numbers[_node(e.body, e.first)], numbers[_node(e.body, e.first + 1)]
    inside = numbers[e.first, e.body + 2]
    return [first, first + 1, last, last + 1, inside, inside + 1]


def _add(total: FloatArray, freedoms: np.ndarray, each: FloatArray) -> None:
    """Add the elements' matrices, shape (m, q, q), at their freedoms, shape (m, q)."""
    np.add.at(total, (freedoms[:, :, None], freedoms[:, None, :]), each)


def _tie(
    elements: list[_Element], freedoms: np.ndarray, length: FloatArray, contact: Contact, stiffness: FloatArray, damping: FloatArray
) -> None:
    """Add the distributed contact between the elements of both bodies that lie side by side."""
    holders = {e.first: i for i, e in enumerate(elements) if e.body == 1}
    pairs = [(i, holders[e.first]) for i, e in enumerate(elements) if e.body == 0 and e.first in holders]
    tools, bores = (stacked([elements[pair[side]].section for pair in pairs]) for side in (0, 1))
    both = np.array([[*freedoms[i], *freedoms[j]] for i, j in pairs])
    gap, turn = refined_layer_matrices(tools, bores, length[[elements[i].first for i, _ in pairs]])
    _add(stiffness, both, contact.translational_stiffness * gap + contact.rotational_stiffness * turn)
    _add(damping, both, contact.translational_damping * gap + contact.rotational_damping * turn)
