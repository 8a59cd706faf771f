"""Nodes and element matrices of the rotor: steps, bearings, and tool and holder side by side in the bore.

Its own mesh rule, finer than that of the identification's model; only the element matrices are shared.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.timoshenko import Section, beam_matrices, layer_matrices, section

#: Elements per outer diameter, and the least number in a stretch between two steps, straight or tapered.
ELEMENTS_PER_DIAMETER = 8.0
LEAST_ELEMENTS = 2
LEAST_ON_TAPER = 16

#: Bodies, as nodes are told apart.
TOOL, HOLDER, SHAFT = 0, 1, 2

#: Freedoms, and a matrix over them.
_Part = tuple[NDArray[np.intp], FloatArray]


def nanometres(z: float) -> int:
    """Positions are told apart to a nanometre."""
    return round(z * 1e9)


class Mesh:
    """Collects nodes and element matrices; nodes are keyed by body and position along it."""

    def __init__(self) -> None:
        self.count = 0
        self.nodes: dict[tuple[int, int], int] = {}
        self.flange = -1
        self.beams: dict[tuple[int, int], tuple[Section, float, NDArray[np.intp]]] = {}
        self.mass: list[_Part] = []
        self.stiffness: list[_Part] = []
        self.loss: list[_Part] = []
        self.rotary: list[_Part] = []
        self.damping: list[_Part] = []

    def new_node(self) -> int:
        """Return the number of one more node."""
        self.count += 1
        return self.count - 1

    def node(self, body: int, z: int) -> int:
        """Return the number of a body's node at `z` [nm], new or known."""
        key = (body, z)
        if key not in self.nodes:
            self.nodes[key] = self.new_node()
        return self.nodes[key]

    def body(self, number: int, origin: float, segments: tuple[BeamSegment, ...], keys: list[int]) -> None:
        """Mesh one body with nodes at `keys`, which hold all its steps.

        `number`: the body's
        `origin` [m]: position of its first segment's start
        `keys`: list of int [nm], positions of its nodes
        """
        for a, b in itertools.pairwise(keys):
            start, end = a * 1e-9, b * 1e-9
            beam = section(_piece(origin, segments, start, end))
            first, last = self.node(number, a), self.node(number, b)
            index = np.array([2 * first, 2 * first + 1, 2 * last, 2 * last + 1])
            mass, stiffness = beam_matrices(beam, end - start)
            rotary, _ = beam_matrices(replace(beam, mass=0.0), end - start)
            self.mass.append((index, mass))
            self.stiffness.append((index, stiffness))
            self.loss.append((index, beam.loss_factor * stiffness))
            self.rotary.append((index, rotary))
            self.beams[number, a] = (beam, end - start, index)

    @staticmethod
    def sum(parts: list[_Part], freedoms: int) -> scipy.sparse.csc_array:
        """Add up matrices given with the freedoms that they belong to."""
        if not parts:
            return scipy.sparse.csc_array((freedoms, freedoms))
        rows = np.concatenate([np.repeat(i, i.size) for i, _ in parts])
        cols = np.concatenate([np.tile(i, i.size) for i, _ in parts])
        data = np.concatenate([np.asarray(m).ravel() for _, m in parts])
        return scipy.sparse.csc_array(scipy.sparse.coo_array((data, (rows, cols)), shape=(freedoms, freedoms)))


def element_edges(origin: float, segments: tuple[BeamSegment, ...], stops: list[int], refinement: int) -> list[int]:
    """Return node positions [nm] with every step and stop among them, evenly spaced between.

    `origin` [m]: position of the first segment's start
    `stops`: list of int [nm], further positions that get a node
    `refinement`: divides every element further
    """
    keys: list[int] = []
    start = origin
    for segment in segments:
        end = start + segment.length
        steps = sorted({nanometres(start), nanometres(end), *(z for z in stops if nanometres(start) < z < nanometres(end))})
        for a, b in itertools.pairwise(steps):
            elements = (b - a) * 1e-9 * ELEMENTS_PER_DIAMETER / min(segment.diameter, segment.end)
            count = max(int(np.ceil(elements)), LEAST_ELEMENTS if segment.end_diameter is None else LEAST_ON_TAPER) * refinement
            keys += [a + round((b - a) * i / count) for i in range(count)]
        start = end
    return [*keys, nanometres(start)]


def _piece(origin: float, segments: tuple[BeamSegment, ...], start: float, end: float) -> BeamSegment:
    """The part of the body between two positions that lie in one segment."""
    first = origin
    for segment in segments:
        if 0.5 * (start + end) < first + segment.length:
            return segment.part(start - first, end - first)
        first += segment.length
    raise InputError("segments", f"{end * 1e3:g} mm", "a position on the body")


def add_tooling(mesh: Mesh, tooling: ToolAssembly, refinement: int) -> None:
    """Add tool and holder to a mesh: two parallel beams over the insertion, tied by the distributed contact or sharing their nodes.

    `mesh`: gets the elements
    `refinement`: divides every element further
    """
    face, depth = nanometres(tooling.stickout), nanometres(tooling.tool_length)
    if not tooling.holder:
        mesh.body(TOOL, 0.0, tooling.tool, element_edges(0.0, tooling.tool, [], refinement))
        mesh.flange = mesh.nodes[TOOL, depth]
        return
    # inside the bore both bodies get the nodes of the thinner tool, which has one at every step of either
    steps = np.cumsum([0.0, *(s.length for s in tooling.holder)]) + tooling.stickout
    inner = element_edges(0.0, tooling.tool, [nanometres(z) for z in steps], refinement)
    shared = [z for z in inner if face <= z <= depth]
    outer = element_edges(tooling.stickout, tooling.holder, [depth], refinement)
    outer = [*shared, *(z for z in outer if z > depth)]
    mesh.body(TOOL, 0.0, tooling.tool, inner)
    contact = tooling.contact
    tied = contact is None or depth == face
    if tied:
        for z in shared:
            mesh.nodes[HOLDER, z] = mesh.nodes[TOOL, z]
    mesh.body(HOLDER, tooling.stickout, tooling.holder, outer)
    mesh.flange = mesh.nodes[HOLDER, nanometres(tooling.stickout + tooling.holder_length)]
    if contact is None or tied:
        return
    for z in shared[:-1]:
        tool, length, first = mesh.beams[TOOL, z]
        holder, _, last = mesh.beams[HOLDER, z]
        gap, turn = layer_matrices(tool, holder, length)
        index = np.concatenate([first, last])
        mesh.stiffness.append((index, contact.translational_stiffness * gap + contact.rotational_stiffness * turn))
        mesh.damping.append((index, contact.translational_damping * gap + contact.rotational_damping * turn))
