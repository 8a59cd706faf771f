"""The unknowns as one vector, made of blocks: each knows its places, what its numbers stand for, and what is known of them beforehand.

A machine's blocks come first: one for each bending plane, one for both planes together, or an arm and the spindle in its hand. What all
lines share stands at the end: the joint's four logarithms, logarithms of the cutting coefficients' scales, tooth angles of the clampings.
A new unknown of a machine is a part of `ModalBlock`, or a block of its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import accumulate, pairwise
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.modal_parameters import ModalParameters
from rcsa_ident.identification.priors import PriorRows, Priors

#: Units of the damping factor [sqrt(rad/s)], of the residual compliance's factor [sqrt(m/N)] and of another place's residual [m/N].
DAMPING_UNIT = 30.0
RESIDUAL_UNIT = np.sqrt(1e-9)
PLACE_UNIT = 1e-9
#: Unknowns of the joint.
JOINT = 4
#: Directions of the flange where both planes are one machine: translation and slope in X, then in Y; their translations.
DIRECTIONS = 4
TRANSLATIONS = (0, 2)
#: `ModalBlock.skew` where each pair of modes has an entry of its own.
EVERY_PAIR = -1
#: What a direction's shape is called, by their number.
_SHAPES = {2: ("t", "lever*r"), DIRECTIONS: ("x_t", "lever*x_r", "y_t", "lever*y_r")}


@lru_cache
def lower_triangle(order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows and columns of a lower triangle's entries in the vector's order, and which are on the diagonal."""
    rows, cols = (frozen(index, np.intp) for index in np.tril_indices(order))
    return rows, cols, frozen(rows == cols, np.bool_)


@lru_cache
def strict_triangle(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the entries above a square's diagonal, row by row: those of a skew matrix."""
    rows, cols = (frozen(index, np.intp) for index in np.triu_indices(order, 1))
    return rows, cols


class Block(Protocol):
    """Some unknowns of a machine that stand together."""

    @property
    def size(self) -> int:
        """How many they are."""
        ...

    def known(self, priors: Priors) -> tuple[FloatArray, FloatArray]:
        """Return what is known of them beforehand: centres and standard deviations, shape (size,) each."""
        ...

    @property
    def follows(self) -> tuple[np.ndarray, np.ndarray]:
        """Places of the modes' own damping, and of the frequencies that it follows (see `PriorRows`)."""
        ...


@dataclass(frozen=True)
class ModalBlock:
    """Modes of a machine, seen at the flange: of one bending plane, or of both.

    In the vector's order: log natural frequencies (m); mass-normalised shapes by modes (d m); what the housing's motion pulls a mode with
    (d m); the lower triangle of the damping factor L by rows, its diagonal as logarithm; the lower triangle of the residual compliance's
    factor; of each other place its shapes (m) and its residual to the flange (d); what standing still changes (2); the lower triangle of
    the warming by rows, and that of the softening; the gyroscopic coupling.

    `places`: other places of the machine whose motion is in the outputs: a displacement sensor's fixture (one a plane), the spindle's
        housing
    `softening`: the stiffness changes with the spindle's speed
    `warming`: the stiffness changes as the machine warms up; the block describes the warm one
    `standstill`: some of the lines belong to a spindle that stands still: all natural frequencies and all damping may differ by a share
        there
    `directions`: 2 of one bending plane, translation and lever x slope; `DIRECTIONS` of both
    `pulls`: the housing moves
    `skew`: how the gyroscopic coupling G is written: none (0), as a sum of so many a b^T - b a^T, each what a disc's two slopes do, or
        entry by entry (`EVERY_PAIR`)
    """

    modes: int
    places: int = 0
    softening: bool = False
    standstill: bool = False
    directions: int = 2
    pulls: bool = False
    skew: int = 0
    warming: bool = False

    @cached_property
    def parts(self) -> Mapping[str, slice]:
        """Places of each kind of unknown."""
        m, d, pairs = self.modes, self.directions, self.pairs
        sizes = {
            "frequencies": m,
            "shapes": d * m,
            "pulls": d * m * self.pulls,
            "damping": pairs,
            "residual": d * (d + 1) // 2,
            "places": (m + d) * self.places,
            "standstill": 2 * self.standstill,
            "warming": pairs * self.warming,
            "softening": pairs * self.softening,
            "skew": m * (m - 1) // 2 if self.skew == EVERY_PAIR else 2 * m * self.skew,
        }
        return dict(zip(sizes, (slice(*ends) for ends in pairwise(accumulate(sizes.values(), initial=0))), strict=True))

    @cached_property
    def pairs(self) -> int:
        """Number of entries of a lower triangle over the modes."""
        return self.modes * (self.modes + 1) // 2

    @cached_property
    def core(self) -> int:
        """Length of the part that describes the flange at the campaign's middle speed, without gyroscopic coupling."""
        return self.parts["residual"].stop

    @cached_property
    def size(self) -> int:
        """Length of the block."""
        return self.parts["skew"].stop

    @cached_property
    def machine(self) -> np.ndarray:
        """Places of all that describes the flange while it turns and is warm: neither other places nor what standing still changes."""
        places = np.arange(self.size)
        return np.concatenate([places[: self.core], places[self.parts["warming"].stop :]])

    @property
    def names(self) -> tuple[str, ...]:
        """What the unknowns of a flange are called, without other places and standing still."""
        m, d = self.modes, self.directions
        pairs = [(i, j) for i in range(m) for j in range(i + 1)]
        names = [f"log natural_frequency_rad_s[{n}]" for n in range(m)]
        names += [f"psi_{k}[{n}]" for n in range(m) for k in _SHAPES[d]]
        names += [f"log damping_factor[{i},{j}]" if i == j else f"damping_factor[{i},{j}]" for i, j in pairs]
        names += [f"residual_factor[{i},{j}]" for i in range(d) for j in range(i + 1)]
        names += [f"softening[{i},{j}]" for i, j in pairs if self.softening]
        names += [f"disc_{k}_{side}[{n}]" for k in range(max(self.skew, 0)) for side in ("a", "b") for n in range(m)]
        names += [f"gyroscopic[{i},{j}]" for i in range(m) for j in range(i + 1, m) if self.skew == EVERY_PAIR]
        return tuple(names)

    @property
    def follows(self) -> tuple[np.ndarray, np.ndarray]:
        """Places of the modes' own damping, and of their frequencies."""
        return self.parts["damping"].start + np.flatnonzero(lower_triangle(self.modes)[2]), np.arange(self.modes)

    def known(self, priors: Priors) -> tuple[FloatArray, FloatArray]:
        """Return centres and standard deviations: of both planes those of one, with as much room for what is felt across."""
        centre, spread, own = np.zeros(self.size), np.empty(self.size), self.follows[0]
        diagonal = lower_triangle(self.modes)[2]
        centre[self.parts["frequencies"]] = np.log(2.0 * np.pi * priors.frequency_hz)
        centre[own] = 0.5 * np.log(2.0 * priors.damping_ratio) - np.log(DAMPING_UNIT)
        spreads = {
            "frequencies": priors.frequency_spread,
            "shapes": priors.shape,
            "pulls": priors.pull,
            "damping": np.where(diagonal, 0.5 * priors.damping_spread, priors.damping_coupling),
            "residual": priors.residual,
            "places": ([priors.shape] * self.modes + [priors.residual**2] * self.directions) * self.places,
            "standstill": priors.standstill if self.standstill else (),
            "warming": 2.0 * priors.softening,
            "softening": priors.softening,
            # an entry of G is the product of two slopes; twice the share of rotary kinetic energy bounds it
            "skew": priors.skew if self.skew == EVERY_PAIR else np.sqrt(priors.skew),
        }
        for name, place in self.parts.items():
            spread[place] = spreads[name]
        return centre, spread

    def discs(self, part: FloatArray) -> FloatArray:
        """Return the gyroscopic coupling's a and b, shape (skew, 2, m)."""
        found: FloatArray = part[self.parts["skew"]].reshape(max(self.skew, 0), 2, self.modes)
        return found

    def skew_chain(self, part: FloatArray) -> FloatArray:
        """Return d G_ij (i < j, row by row) / d the gyroscopic unknowns, shape (m (m - 1) / 2, their number)."""
        m = self.modes
        rows, cols = strict_triangle(m)
        if self.skew == EVERY_PAIR:
            return np.eye(rows.size)
        place = np.arange(rows.size)
        found = np.zeros((rows.size, self.skew, 2, m))
        for k, (a, b) in enumerate(self.discs(part)):
            # G_ij = a_i b_j - b_i a_j
            found[place, k, 0, rows] = b[cols]
            found[place, k, 0, cols] = -b[rows]
            found[place, k, 1, cols] = a[rows]
            found[place, k, 1, rows] = -a[cols]
        return found.reshape(rows.size, -1)


def unpack(part: FloatArray, block: ModalBlock) -> ModalParameters:
    """Return the physics of a block's part of the vector; what stands behind it is left alone."""
    m, d = block.modes, block.directions
    of = {name: part[place] for name, place in block.parts.items()}
    rows, cols, diagonal = lower_triangle(m)
    lower = DAMPING_UNIT * of["damping"]
    lower[diagonal] = DAMPING_UNIT * np.exp(of["damping"][diagonal])
    factor, residual = np.zeros((m, m)), np.zeros((d, d))
    factor[rows, cols] = lower
    residual[lower_triangle(d)[:2]] = RESIDUAL_UNIT * of["residual"]
    beside = of["places"].reshape(block.places, m + d)
    softening = warming = skew = np.zeros((0, 0))
    if block.softening:
        softening = np.zeros((m, m))
        softening[rows, cols] = softening[cols, rows] = of["softening"]
    if block.warming:
        warming = np.zeros((m, m))
        warming[rows, cols] = warming[cols, rows] = of["warming"]
    if block.skew:
        if block.skew == EVERY_PAIR:
            half = np.zeros((m, m))
            half[strict_triangle(m)] = of["skew"]
        else:
            discs = block.discs(part)
            half = np.einsum("ki,kj->ij", discs[:, 0], discs[:, 1])
        skew = half - half.T
    pull = of["pulls"].reshape(m, d) if block.pulls else np.zeros((0, 0))
    shapes = of["shapes"].reshape(m, d)
    places, still = (beside[:, :m].T, PLACE_UNIT * beside[:, m:]), of["standstill"]
    return ModalParameters(np.exp(of["frequencies"]), shapes, factor, residual, *places, softening, still, skew, pull, warming)


def pack(machine: ModalParameters, block: ModalBlock | None = None, discs: FloatArray | None = None) -> FloatArray:
    """Return the vector of a machine; the inverse of `unpack`. By default of its flange alone, at the middle speed.

    Of other places the block's first ones are told, and those that the machine does not know rest.

    `discs`, shape (skew, 2, m): the gyroscopic coupling's a and b; by default none, or with `EVERY_PAIR` the machine's own entries
    """
    m, d = machine.psi.shape
    block = ModalBlock(m, directions=d) if block is None else block
    rows, cols, diagonal = lower_triangle(m)
    lower = machine.factor[rows, cols] / DAMPING_UNIT
    lower = np.where(diagonal, np.log(np.where(diagonal, np.abs(lower), 1.0)), lower)
    beside = np.zeros((block.places, m + d))
    told = min(block.places, machine.places.shape[1])
    beside[:told] = np.hstack([machine.places.T, machine.place_residual / PLACE_UNIT])[:told]
    values: dict[str, FloatArray | None] = {
        "frequencies": np.log(machine.omega_n),
        "shapes": machine.psi.ravel(),
        "pulls": machine.pull.ravel(),
        "damping": lower,
        "residual": machine.residual[lower_triangle(d)[:2]] / RESIDUAL_UNIT,
        "places": beside.ravel(),
        "standstill": machine.standstill,
        "warming": machine.warming[rows, cols] if machine.warming.size else None,
        "softening": machine.softening[rows, cols] if machine.softening.size else None,
        "skew": None if discs is None else discs.ravel(),
    }
    if block.skew == EVERY_PAIR and machine.skew.size:
        values["skew"] = machine.skew[strict_triangle(m)]
    found = np.zeros(block.size)
    for name, place in block.parts.items():
        value = values[name]
        if value is not None and value.size and place.stop > place.start:
            found[place] = value
    return found


def chain(machine: ModalParameters, block: ModalBlock) -> FloatArray:
    """Return d physics / d vector for each entry (the map is entry by entry), in the vector's order, as the kernels take it.

    They tell the change with logarithms of frequencies, and with entries of the gyroscopic coupling, which has a chain of its own.
    """
    rows, cols, diagonal = lower_triangle(block.modes)
    found, parts = np.ones(block.size), block.parts
    found[parts["damping"]] = np.where(diagonal, machine.factor[rows, cols], DAMPING_UNIT)
    found[parts["residual"]] = RESIDUAL_UNIT
    found[parts["places"]] = ([1.0] * block.modes + [PLACE_UNIT] * block.directions) * block.places
    return found


class Unknowns(ABC):
    """Which unknown stands where in a vector: blocks of machines first, then what all their lines share."""

    #: Cutting coefficients whose scale is unknown, and clampings whose tooth angle at the trigger's edge is.
    coefficients: int
    clampings: int

    @property
    @abstractmethod
    def blocks(self) -> tuple[Block, ...]:
        """What the vector is made of, in its order."""

    def axis(self, i: int) -> slice:
        """Return the part of the machines that the lines of an axis depend on: all of it, where planes feel each other."""
        del i
        return slice(0, self.tail)

    @cached_property
    def places(self) -> tuple[slice, ...]:
        """Places of each block."""
        return tuple(slice(*ends) for ends in pairwise(accumulate((block.size for block in self.blocks), initial=0)))

    @cached_property
    def tail(self) -> int:
        """Place in the vector at which begins what all axes share."""
        return self.places[-1].stop

    @property
    def modal(self) -> tuple[tuple[int, ModalBlock], ...]:
        """The blocks of modes with their number among all; the modes of one may be exchanged with each other without changing anything."""
        return tuple((k, block) for k, block in enumerate(self.blocks) if isinstance(block, ModalBlock))

    @property
    def modes_of_axes(self) -> tuple[int, ...]:
        """Numbers of modes of these blocks."""
        return tuple(block.modes for _, block in self.modal)

    @abstractmethod
    def with_modes(self, k: int, modes: int) -> Unknowns:
        """Return the layout with another number of modes in block `k`."""

    @cached_property
    def size(self) -> int:
        """Length of the vector."""
        return self.tail + JOINT + self.coefficients + self.clampings

    @cached_property
    def joint(self) -> slice:
        """Places of the logarithms of the joint's stiffnesses and damping."""
        return slice(self.tail, self.tail + JOINT)

    @cached_property
    def force(self) -> slice:
        """Places of the logarithms of the cutting coefficients' scales."""
        return slice(self.tail + JOINT, self.size - self.clampings)

    @cached_property
    def clamping(self) -> slice:
        """Places of the clampings' tooth angles [rad]."""
        return slice(self.size - self.clampings, self.size)


@dataclass(frozen=True)
class Layout(Unknowns):
    """Each axis has its own machine.

    `coefficients`: cutting coefficients whose scale is unknown
    `clampings`: clampings whose tooth angle at the trigger's edge is unknown
    """

    axes: tuple[ModalBlock, ...]
    coefficients: int = 0
    clampings: int = 0

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The axes."""
        return self.axes

    def axis(self, i: int) -> slice:
        """Return the part of an axis."""
        return self.places[i]

    def with_modes(self, k: int, modes: int) -> Layout:
        """Return the layout with another number of modes of an axis."""
        return replace(self, axes=tuple(replace(axis, modes=modes) if i == k else axis for i, axis in enumerate(self.axes)))


@dataclass(frozen=True)
class CoupledLayout(Unknowns):
    """Both planes are one machine.

    `modes`: of the whole machine
    `fixture`: gap and fixture are two outputs; else their sum, the flange's own motion, is the only one
    `skew`: as in `ModalBlock`
    `turning`: 1 where tool-holders have their gyroscopic moments, -1 where the spindle turns the other way, 0 where they have none
    `coefficients`, `clampings`: as in `Layout`
    """

    modes: int
    fixture: bool = False
    softening: bool = False
    skew: int = 0
    turning: int = 0
    coefficients: int = 0
    clampings: int = 0

    @cached_property
    def block(self) -> ModalBlock:
        """The machine; its fixture is seen in X and in Y."""
        return ModalBlock(self.modes, 2 * self.fixture, self.softening, directions=DIRECTIONS, skew=self.skew)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The machine alone."""
        return (self.block,)

    def with_modes(self, k: int, modes: int) -> CoupledLayout:
        """Return the layout with another number of modes."""
        del k
        return replace(self, modes=modes)

    @property
    def flange(self) -> CoupledLayout:
        """The same without what only the campaign needs: fixture, forces and tooth angles."""
        return replace(self, fixture=False, coefficients=0, clampings=0)


def planes(layout: Unknowns) -> Layout:
    """Return the layout as one whose axes have their own machines, which it is known to be."""
    assert isinstance(layout, Layout)
    return layout


def flange_layout(*modes: int, places: int = 0) -> Layout:
    """Return the layout of axes with so many modes each, as many other places, and a joint."""
    return Layout(tuple(ModalBlock(m, places) for m in modes))


@lru_cache(maxsize=64)
def prior_rows(layout: Unknowns, priors: Priors, coefficients: tuple[float, ...] = ()) -> PriorRows:
    """Return the priors of a layout's unknowns.

    `coefficients`: standard deviations of the logarithms of the cutting coefficients' scales
    """
    centre, spread = np.zeros(layout.size), np.empty(layout.size)
    for block, place in zip(layout.blocks, layout.places, strict=True):
        centre[place], spread[place] = block.known(priors)
    centre[layout.joint], spread[layout.joint] = np.log(priors.joint), priors.joint_spread
    spread[layout.force], spread[layout.clamping] = coefficients, priors.tooth_angle
    own, frequency = (
        np.concatenate([place.start + block.follows[k] for block, place in zip(layout.blocks, layout.places, strict=True)]) for k in (0, 1)
    )
    jacobian = np.diag(1.0 / spread)
    jacobian[own, frequency] = -0.5 / spread[own]
    return PriorRows(frozen(centre), frozen(spread), frozen(own, np.intp), frozen(frequency, np.intp), frozen(jacobian))


def parameter_names(block: ModalBlock) -> tuple[str, ...]:
    """Return the names of the unknowns of a flange and the joint, in the vector's order."""
    return (*block.names, "log joint.k_t", "log joint.k_r", "log joint.c_t", "log joint.c_r")


def split(theta: FloatArray, layout: Layout) -> tuple[list[FloatArray], FloatArray]:
    """Return the axes' parts and the joint's."""
    return [theta[place] for place in layout.places], theta[layout.joint]


def scaled_joint(logs: FloatArray) -> FloatArray:
    """Return k_t, k_r, c_t, c_r with the rotational ones per lever squared, as the kernel takes them."""
    return np.exp(logs) / np.array([1.0, LEVER**2, 1.0, LEVER**2])


def joint_of(logs: FloatArray) -> LumpedJoint:
    """Return the joint of the vector's last entries."""
    k_t, k_r, c_t, c_r = (float(v) for v in np.exp(logs))
    return LumpedJoint(k_t, k_r, c_t, c_r)
