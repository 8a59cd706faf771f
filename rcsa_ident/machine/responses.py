"""What a machine responds between any of its points, alone or with a tool-holder, and how that varies: the plain road of coupling."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import Places, UncertainReceptance, Variation
from rcsa_ident.machine.flange_part import FlangePart, JointedFlange

Respond = Callable[[JointedFlange, Receptance | None, FloatArray], Receptance]
_SLOPES = {Dof.X: Dof.SLOPE_X, Dof.Y: Dof.SLOPE_Y}


def respond_over(parts: Sequence[FlangePart], omega: FloatArray, respond: Respond, holder: Receptance | None = None) -> UncertainReceptance:
    """Return what all parts respond, with zeros between them.

    `omega` [rad/s], shape (n,)
    `respond`: a candidate, its share of the tool-holder and frequencies to a receptance: `at_flange` or `at_ends`
    `holder`: free tool-holder in one bending plane, or in both where they feel each other
    """
    each = [PartResponse(part, respond, None if holder is None else in_planes(holder, part), omega) for part in parts]
    whole = Receptance.block_diagonal([part.nominal for part in each])
    known = any(part.doubt is not None for part in parts)
    return UncertainReceptance(omega, whole.values, whole.rows, whole.cols, Responses(tuple(each)) if known else None)


@dataclass(frozen=True, eq=False)
class PartResponse:
    """What a part of the machine responds, alone or with its share of a tool-holder."""

    part: FlangePart
    respond: Respond
    holder: Receptance | None
    omega: FloatArray

    @cached_property
    def nominal(self) -> Receptance:
        return self.of(self.part.believed, np.arange(self.omega.size))

    def of(self, candidate: JointedFlange, places: Places) -> Receptance:
        holder = self.holder
        if holder is not None and places.size < self.omega.size:
            holder = Receptance(holder.omega[places], holder.values[places], holder.rows, holder.cols)
        return self.respond(candidate, holder, self.omega[places])


@dataclass(frozen=True)
class Responses:
    """How the responses of all parts vary."""

    parts: tuple[PartResponse, ...]

    @cached_property
    def members(self) -> list[tuple[int, ...]]:
        ends = np.cumsum([0, *(len(part.nominal.rows) for part in self.parts)])
        return [tuple(range(first, last)) for first, last in pairwise(ends.tolist())]

    @property
    def covers(self) -> frozenset[int]:
        pairs = zip(self.parts, self.members, strict=True)
        return frozenset(m for each, members in pairs if each.part.doubt is not None for m in members)

    def at(self, places: Places) -> tuple[Variation, ...]:
        found = []
        for each, members in zip(self.parts, self.members, strict=True):
            _, change = each.part.response(partial(_values, each, places))
            if change is not None:
                found.append(Variation(members, change))
        return tuple(found)

    def guides(self) -> ComplexArray:
        size = self.parts[0].omega.size
        rivals = [
            each.of(rival, np.arange(size)).values.reshape(size, -1).T
            for each in self.parts
            if each.part.doubt is not None
            for rival in each.part.doubt().rivals
        ]
        return np.concatenate([np.zeros((0, size), dtype=complex), *rivals])


def at_flange(candidate: JointedFlange, _holder: Receptance | None, omega: FloatArray) -> Receptance:
    """Return a candidate's receptance at the flange."""
    return candidate.flange.receptance(omega)


def at_ends(
    candidate: JointedFlange, holder: Receptance | None, omega: FloatArray, behind: Mapping[Dof, float] | None = None
) -> Receptance:
    """Return a tool-holder's receptances on a candidate, between tip and spindle; `behind` as of `couple`."""
    assert holder is not None
    return couple(holder, candidate.flange.receptance(omega), candidate.joint, behind)


def _values(part: PartResponse, places: Places, candidate: JointedFlange) -> ComplexArray:
    return part.of(candidate, places).values


def in_plane(holder: Receptance, axis: Dof) -> Receptance:
    """Return a tool-holder's receptance in the bending plane of an axis; it is the same in all of them."""
    rows = tuple(Coordinate(c.point, _SLOPES[axis] if c.dof.is_slope else axis) for c in holder.rows)
    return holder if rows == holder.rows else Receptance(holder.omega, holder.values, rows, rows)


def in_planes(holder: Receptance, part: FlangePart) -> Receptance:
    """Return a tool-holder's receptance in all bending planes of a part; one that is given in a single plane does not couple them."""
    if len({c.dof.plane for c in holder.rows}) > 1:
        return _ordered(holder, part)
    blocks = [in_plane(holder, c.dof) for c in part.coordinates if not c.dof.is_slope]
    return blocks[0] if len(blocks) == 1 else Receptance.block_diagonal(blocks)


def _ordered(holder: Receptance, part: FlangePart) -> Receptance:
    """A tool-holder in both planes, in the part's order."""
    wanted = [Coordinate(point, c.dof) for point in ("tip", "flange") for c in part.coordinates]
    if set(wanted) != set(holder.rows):
        found = ", ".join(str(c) for c in part.coordinates)
        raise InputError("machine", f"a part with {found}", "one part with both bending planes: a tool-holder that turns couples them")
    return holder.block(wanted)
