"""The finite-element model of tool and holder, free in space, seen at tip and flange."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.dynamics.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.structure import Structure, poles
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.timoshenko import Section, ShearCoefficient, beam_matrices, cowper, layer_matrices, section

#: Elements per bending wavelength at the highest frequency, and per diameter: in slender parts the error of a natural
#: frequency falls with the fourth power of the element's length, in stubby ones (shear) with the second.
ELEMENTS_PER_WAVELENGTH = 40.0
ELEMENTS_PER_DIAMETER = 6.0


@dataclass(frozen=True, slots=True)
class _Element:
    body: int
    start: float
    length: float
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
    max_frequency : float [Hz]
        The mesh is chosen for it.
    axis : Dof
        The bending plane; the assembly is the same in all.
    refinement : int
        Divides every element further: for convergence studies.

    Notes
    -----
    Nodes stand at every step of either body, so that the contact is integrated over elements that match.
    """
    origin = assembly.stickout
    tool = _cuts(assembly.tool, 0.0)
    holder = _cuts(assembly.holder, origin)
    ends = (tool[-1][1] if tool else 0.0, holder[-1][1] if holder else 0.0)
    steps = sorted({round(z, 12) for first, last, _ in (*tool, *holder) for z in (first, last)})
    rigid = assembly.contact is None
    elements: list[_Element] = []
    for body, pieces in enumerate((tool, holder)):
        for first, last, segment in pieces:
            inside = [z for z in steps if first + 1e-9 < z < last - 1e-9]
            edges = [first, *inside, last]
            for a, b in zip(edges[:-1], edges[1:], strict=True):
                elements += _divide(body, a, b, segment.part(a - first, b - first), max_frequency, shear_coefficient, refinement)
    elements = _match(elements, assembly, shear_coefficient)
    nodes = _number_nodes(elements, rigid, origin)
    d = 2 * (max(nodes.values()) + 1)
    mass, damping, stiffness, loss = (np.zeros((d, d)) for _ in range(4))
    for e in elements:
        freedoms = _freedoms(nodes, e)
        m, k = beam_matrices(e.section, e.length)
        mass[np.ix_(freedoms, freedoms)] += m
        stiffness[np.ix_(freedoms, freedoms)] += k
        loss[np.ix_(freedoms, freedoms)] += k * e.section.loss_factor
    if assembly.contact is not None:
        contact = assembly.contact
        holders = {_key(e.start): e for e in elements if e.body == 1}
        for e in elements:
            if e.body == 0 and e.start > origin - 1e-9:
                other = holders[_key(e.start)]
                freedoms = np.concatenate([_freedoms(nodes, e), _freedoms(nodes, other)])
                gap, turn = layer_matrices(e.section, other.section, e.length)
                stiffness[np.ix_(freedoms, freedoms)] += contact.translational_stiffness * gap + contact.rotational_stiffness * turn
                damping[np.ix_(freedoms, freedoms)] += contact.translational_damping * gap + contact.rotational_damping * turn
    tip = 2 * nodes[0, _key(0.0)]
    flange = 2 * nodes[(1, _key(ends[1])) if holder else (0, _key(ends[0]))]
    return Structure(
        mass, damping, stiffness, loss, (*plane("tip", axis), *plane("flange", axis)), np.array([tip, tip + 1, flange, flange + 1])
    )


def tool_holder_receptance(assembly: ToolAssembly, omega: FloatArray, axis: Dof = Dof.X, shear_coefficient: ShearCoefficient = cowper) -> Receptance:
    """Return the free-free receptances between tip and flange, shape (n, 4, 4), with mesh and modes chosen for `omega`."""
    omega = np.asarray(omega, dtype=float)
    highest = float(omega.max())
    structure = tool_holder_structure(assembly, highest / (2.0 * np.pi), axis, shear_coefficient)
    return poles(structure, highest).receptance(omega)


def mesh_error(assembly: ToolAssembly, omega: FloatArray, shear_coefficient: ShearCoefficient = cowper) -> float:
    """Return the relative error of the receptances against a mesh twice as fine, both solved exactly [-]."""
    omega = np.asarray(omega, dtype=float)
    highest = float(omega.max()) / (2.0 * np.pi)
    coarse, fine = (
        tool_holder_structure(assembly, highest, shear_coefficient=shear_coefficient, refinement=r).receptance(omega).values for r in (1, 2)
    )
    return float(np.max(np.linalg.norm(coarse - fine, axis=0) / np.linalg.norm(fine, axis=0)))


def _cuts(segments: tuple[BeamSegment, ...], origin: float) -> list[tuple[float, float, BeamSegment]]:
    pieces, z = [], origin
    for segment in segments:
        pieces.append((z, z + segment.length, segment))
        z += segment.length
    return pieces


def _divide(body, first, last, segment, max_frequency, shear_coefficient, refinement):  # type: ignore[no-untyped-def]
    """Elements of one uniform or tapered stretch, short against the bending wavelength of its thinnest end."""
    beam = section(segment, shear_coefficient)
    wavelength = 2.0 * np.pi * (beam.bending / beam.mass) ** 0.25 / np.sqrt(2.0 * np.pi * max(max_frequency, 1.0))
    density = max(ELEMENTS_PER_WAVELENGTH / wavelength, ELEMENTS_PER_DIAMETER / max(segment.diameter, segment.end))
    count = int(np.ceil(segment.length * density))
    if segment.end_diameter is not None:
        # a taper is a stair of mean sections: its error falls with the square of the step
        count = max(count, 12)
    count = max(count, 2) * refinement
    edges = np.linspace(0.0, segment.length, count + 1)
    return [
        _Element(body, first + a, b - a, section(segment.part(a, b), shear_coefficient)) for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]


def _match(elements: list[_Element], assembly: ToolAssembly, shear_coefficient: ShearCoefficient) -> list[_Element]:
    """Give both bodies the same nodes over the insertion: the finer division of the two counts."""
    start, end = assembly.stickout, assembly.tool_length
    if assembly.insertion <= 0.0:
        return elements
    shared = sorted({_key(z) for e in elements for z in (e.start, e.start + e.length) if start - 1e-9 < z < end + 1e-9})
    matched: list[_Element] = []
    for e in elements:
        cuts = [z * 1e-9 for z in shared if e.start + 1e-9 < z * 1e-9 < e.start + e.length - 1e-9]
        edges = [e.start, *cuts, e.start + e.length]
        matched += [_Element(e.body, a, b - a, e.section) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return matched


def _key(z: float) -> int:
    """Nodes are told apart to a nanometre."""
    return round(z * 1e9)


def _number_nodes(elements: list[_Element], rigid: bool, origin: float) -> dict[tuple[int, int], int]:
    """Number the nodes by position, so that the matrices are banded; a rigid contact shares them over the insertion."""
    keys = sorted({(_key(z), e.body) for e in elements for z in (e.start, e.start + e.length)})
    # where there is no layer between the bodies (rigid, or a butt joint), a tool node is the holder's node
    holders = {z for z, body in keys if body == 1}
    deepest = max((z for z, body in keys if body == 0), default=0)
    nodes: dict[tuple[int, int], int] = {}
    number = 0
    butt = deepest <= _key(origin)
    for z, body in keys:
        if body == 1 and (rigid or butt) and (0, z) in nodes and z in holders:
            nodes[1, z] = nodes[0, z]
            continue
        nodes[body, z] = number
        number += 1
    return nodes


def _freedoms(nodes: dict[tuple[int, int], int], e: _Element) -> np.ndarray:
    first, last = nodes[e.body, _key(e.start)], nodes[e.body, _key(e.start + e.length)]
    return np.array([2 * first, 2 * first + 1, 2 * last, 2 * last + 1])
