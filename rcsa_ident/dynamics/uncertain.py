"""A receptance with what is not known of it: how it changes along independent directions, one standard deviation each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property, partial
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.receptance import Receptance

Places = NDArray[np.intp]
Name = TypeVar("Name", bound=str)
#: Largest change of a receptance between two nodes of `thinned`, as a share; quintics go through six nodes.
CHANGE = 0.065
#: Widest distance of two such nodes, in lines, and how much it grows from line to line.
WIDEST, GROWTH = 16.0, 0.1


class Doubted(StrEnum):
    """What may not be known well enough; the machine is whatever is none of the others."""

    CONTACT = "the contact of tool and holder"
    TOOL = "the tool's fluted diameter and modulus"
    LENGTHS = "the tool's stickout and lengths"
    HOLDER = "the holder's diameter"
    STIFFNESS = "the tool-holder's stiffness"
    WORKPIECE = "table and workpiece"
    COEFFICIENTS = "the cutting coefficients"
    MACHINE = "the machine"


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """Changes of a block of a receptance; the blocks of several variations do not overlap.

    `members`: rows, and as well columns, of the receptance that the block covers, b of them
    `change`, shape (p, n, b, b): along each of p independent directions, per standard deviation
    `common`: so many of the last directions are the same ones in all variations
    `unknowns`: mapping of Doubted to array, shape (k, p); what belongs to each, as k unknowns that move so far along the directions; of
        what is not named nothing is told
    `parameters`: mapping of str to array, shape (k, p); the same, parameter by parameter of a drawing; ``identified`` in front of those
        that records have told of
    """

    members: tuple[int, ...]
    change: ComplexArray
    common: int = 0
    unknowns: Mapping[Doubted, FloatArray] = field(default_factory=dict)
    parameters: Mapping[str, FloatArray] = field(default_factory=dict)


class Spread(Protocol):
    """Computes variations where they are asked for: along all directions at all frequencies they would take seconds."""

    @property
    def covers(self) -> frozenset[int]:
        """Rows of the receptance that vary."""
        ...

    def at(self, places: Places) -> tuple[Variation, ...]:
        """Return the variations at some of the receptance's frequencies, by their places."""
        ...

    def guides(self) -> ComplexArray:
        """Return curves that change as quickly from line to line as the variations do, shape (g, n)."""
        ...


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class UncertainReceptance(Receptance):
    """A receptance and its spread; sums of variations with independent standard normal weights are draws of it.

    `omega`, `values`, `rows`, `cols`: as of a `Receptance`; rows and columns are the same
    `variation`: None where the receptance is taken for exact
    `poles`: callable, returns PoleResidue or None; default none; what stands for it where modes are needed, known without a fit; asked only
        then
    """

    variation: Spread | None = None
    poles: Callable[[], PoleResidue | None] | None = None

    @property
    def spread(self) -> ComplexArray:
        """Changes along all p independent directions, per standard deviation, shape (p, n, r, r); p is 0 without any."""
        r = len(self.rows)
        parts = self._variations()
        count, directions = _directions(parts)
        found = np.zeros((count, self.omega.size, r, r), dtype=complex)
        for part, own in zip(parts, directions, strict=True):
            for i, row in enumerate(part.members):
                for j, col in enumerate(part.members):
                    found[own, :, row, col] = part.change[:, :, i, j]
        return found

    def unknowns(self) -> dict[Doubted, FloatArray]:
        """Return what the directions of `spread` belong to, shape (k, p) each: unknowns that move so far along them."""
        return _moves(parts := self._variations(), [part.unknowns for part in parts])

    def parameters(self) -> dict[str, FloatArray]:
        """Return the same as `unknowns`, parameter by parameter of a drawing."""
        return _moves(parts := self._variations(), [part.parameters for part in parts])

    def deviation(self) -> dict[tuple[Coordinate, Coordinate], tuple[FloatArray, FloatArray]]:
        """Return the standard deviations of real and imaginary part, shape (n,) each, of every entry that has one."""
        found = {}
        for part in self._variations():
            real = np.sqrt(np.sum(part.change.real**2, axis=0))
            imaginary = np.sqrt(np.sum(part.change.imag**2, axis=0))
            for i, row in enumerate(part.members):
                for j, col in enumerate(part.members):
                    found[self.rows[row], self.cols[col]] = real[:, i, j], imaginary[:, i, j]
        return found

    @property
    def complete(self) -> bool:
        """Whether there is a spread of every row that moves; only then draws mean something."""
        return self.variation is not None and self.variation.covers >= set(np.flatnonzero(np.any(self.values, axis=(0, 2))).tolist())

    def among(self, coordinates: Sequence[Coordinate]) -> UncertainReceptance:
        """Return the same over other coordinates: those that it does not have are rigid, those that are not wanted are left away."""
        wanted = tuple(coordinates)
        kept = [k for k, c in enumerate(self.rows) if c in wanted]
        own = np.array([wanted.index(self.rows[k]) for k in kept], dtype=np.intp)
        values = np.zeros((self.omega.size, len(wanted), len(wanted)), dtype=complex)
        values[:, own[:, None], own] = self.values[:, kept][:, :, kept]
        places = dict(zip(kept, own.tolist(), strict=True))
        variation = None if self.variation is None else _Among(self.variation, places)
        turn = np.zeros((len(wanted), len(self.rows)))
        turn[own, kept] = 1.0
        poles = None if self.poles is None else partial(_projected, self.poles, turn)
        return UncertainReceptance(self.omega, values, wanted, wanted, variation, poles)

    def thinned(self) -> UncertainReceptance:
        """Return the same at a part of the frequencies: close where it changes from line to line, far apart where a quintic suffices."""
        if self.variation is None:
            return self
        if isinstance(self.variation, Mixed) and self.variation.nodes is not None:
            return self.at_places(self.variation.nodes)
        return self.at_places(nodes_of([*curves_of(self.values), *self.variation.guides()]))

    def at_places(self, places: Places) -> UncertainReceptance:
        """Return the same at some of its frequencies."""
        variation = None if self.variation is None else _Part(self.variation, places)
        return UncertainReceptance(self.omega[places], self.values[places], self.rows, self.cols, variation)

    def drawn(self, draws: int, rng: np.random.Generator) -> ComplexArray:
        """Return receptances drawn from the spread, shape (draws, n, r, r)."""
        parts = self._variations()
        found = np.broadcast_to(self.values, (draws, *self.values.shape)).copy()
        # one draw after the other, so that more draws begin with the same ones
        weights = [[rng.standard_normal(len(part.change)) for part in parts] for _ in range(draws)]
        for k, part in enumerate(parts):
            own = np.array([row[k] for row in weights])
            if part.common:
                own[:, -part.common :] = [row[0][-part.common :] for row in weights]
            change = _weighted(own, part.change)
            for i, row in enumerate(part.members):
                for j, col in enumerate(part.members):
                    found[:, :, row, col] += change[:, :, i, j]
        return found

    def _variations(self) -> tuple[Variation, ...]:
        return () if self.variation is None else self.variation.at(np.arange(self.omega.size))

    def __str__(self) -> str:
        return f"{Receptance.__str__(self)}{'' if self.variation is None else ', with its spread'}"


def _projected(poles: Callable[[], PoleResidue | None], turn: FloatArray) -> PoleResidue | None:
    found = poles()
    return None if found is None else found.projected(turn, turn.T)


@dataclass(frozen=True, slots=True)
class _Among:
    """A spread some of whose rows stand among others, by their places there."""

    whole: Spread
    places: Mapping[int, int]

    @property
    def covers(self) -> frozenset[int]:
        return frozenset(self.places[row] for row in self.whole.covers if row in self.places)

    def at(self, places: Places) -> tuple[Variation, ...]:
        return tuple(self._moved(each) for each in self.whole.at(places))

    def _moved(self, variation: Variation) -> Variation:
        kept = [k for k, m in enumerate(variation.members) if m in self.places]
        members = tuple(self.places[variation.members[k]] for k in kept)
        return replace(variation, members=members, change=variation.change[:, :, kept][:, :, :, kept])

    def guides(self) -> ComplexArray:
        return self.whole.guides()


@dataclass(frozen=True, slots=True)
class _Part:
    """A spread at some of the frequencies."""

    whole: Spread
    places: Places

    @property
    def covers(self) -> frozenset[int]:
        return self.whole.covers

    def at(self, places: Places) -> tuple[Variation, ...]:
        return self.whole.at(self.places[places])

    def guides(self) -> ComplexArray:
        return self.whole.guides()[:, self.places]


@dataclass(frozen=True, eq=False)
class AtNodes:
    """A spread that many ask at the same places: it is worked out there once.

    `nodes`: array of int, shape (k,), ascending; places that suffice for draws (as `UncertainReceptance.thinned` has them)
    """

    whole: Spread
    nodes: Places

    @property
    def covers(self) -> frozenset[int]:
        """Rows that vary."""
        return self.whole.covers

    @cached_property
    def _kept(self) -> tuple[Variation, ...]:
        return self.whole.at(self.nodes)

    def at(self, places: Places) -> tuple[Variation, ...]:
        """Return the variations at some of the frequencies; those at nodes are kept."""
        if np.array_equal(places, self.nodes):
            return self._kept
        own = np.searchsorted(self.nodes, places).clip(max=self.nodes.size - 1)
        if not np.array_equal(self.nodes[own], places):
            return self.whole.at(places)
        return tuple(replace(each, change=each.change[:, own]) for each in self._kept)

    def guides(self) -> ComplexArray:
        """Return the curves of the whole."""
        return self.whole.guides()


@dataclass(frozen=True, slots=True)
class Mixed:
    """A spread between two others whose directions are the same ones: straight lines from the first to the second.

    `share`: from 0, the first, to 1, the second
    """

    first: Spread
    second: Spread
    share: float

    @property
    def nodes(self) -> Places | None:
        """Places that suffice for draws, where both ends have kept the same ones."""
        if not (isinstance(self.first, AtNodes) and isinstance(self.second, AtNodes)):
            return None
        return self.first.nodes if np.array_equal(self.first.nodes, self.second.nodes) else None

    @property
    def covers(self) -> frozenset[int]:
        """Rows that vary: the same at both ends."""
        return self.first.covers

    def at(self, places: Places) -> tuple[Variation, ...]:
        """Return the variations between those of both ends."""
        pairs = zip(self.first.at(places), self.second.at(places), strict=True)
        return tuple(replace(a, change=(1.0 - self.share) * a.change + self.share * b.change) for a, b in pairs)

    def guides(self) -> ComplexArray:
        """Return the curves of both ends."""
        return np.concatenate([self.first.guides(), self.second.guides()])


def _directions(parts: Sequence[Variation]) -> tuple[int, list[Places]]:
    """How many directions there are in all, and which of them those of each variation are: own ones, then what is common."""
    common = min((part.common for part in parts), default=0)
    own = [len(part.change) - common for part in parts]
    last = np.arange(sum(own), sum(own) + common)
    firsts = np.cumsum([0, *own])
    return sum(own) + common, [np.concatenate([np.arange(first, first + size), last]) for first, size in zip(firsts, own, strict=False)]


def _moves(parts: Sequence[Variation], named: Sequence[Mapping[Name, FloatArray]]) -> dict[Name, FloatArray]:
    """How far what each variation names moves along the directions of all."""
    count, directions = _directions(parts)
    rows: dict[Name, list[FloatArray]] = {}
    for own, each in zip(directions, named, strict=True):
        for name, moves in each.items():
            rows.setdefault(name, []).append(np.zeros((len(moves), count)))
            rows[name][-1][:, own] = moves
    return {name: np.concatenate(each) for name, each in rows.items()}


def _weighted(weights: FloatArray, change: ComplexArray) -> ComplexArray:
    """Return weights @ change without making the weights complex first, shapes (d, p), (p, n, b, b) -> (d, n, b, b)."""
    parts = np.ascontiguousarray(change).reshape(len(change), -1).view(float)
    found: ComplexArray = (weights @ parts).view(complex)
    return found.reshape(len(weights), *change.shape[1:])


def curves_of(values: ComplexArray) -> list[ComplexArray]:
    """Return the entries of a receptance that are not zero throughout, each a curve over frequency; shape (n, r, c)."""
    entries = values.reshape(len(values), -1).T
    return [*entries[np.any(entries != 0.0, axis=1)]]


def nodes_of(curves: Sequence[ComplexArray]) -> Places:
    """Return places between whose neighbours no curve changes by more than `CHANGE`, first and last among them."""
    step = np.zeros(curves[0].size - 1)
    for curve in curves:
        size = np.abs(curve)
        step = np.maximum(step, np.abs(np.diff(curve)) / np.maximum(np.maximum(size[1:], size[:-1]), 1e-300))
    # lines from node to node; they grow gently, for a quintic's six nodes should stand at like distances
    distance = np.clip(CHANGE / np.maximum(step, 1e-300), 1.0, WIDEST)
    ramp = GROWTH * np.arange(step.size)
    distance = np.minimum.accumulate(distance - ramp) + ramp
    distance = (np.minimum.accumulate((distance + ramp)[::-1])[::-1]) - ramp
    # a share of a node for each line; its sum passes a whole number where a node stands
    count = np.concatenate([[0.0], np.cumsum(1.0 / distance)])
    nodes = np.flatnonzero(np.diff(np.floor(count * (1.0 + 1e-12)), prepend=-1.0) > 0.0)
    return frozen(np.unique(np.concatenate([nodes, [count.size - 1]])), np.intp)
