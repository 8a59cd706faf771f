"""The tip of a tool-holder on a machine: C11 = A11 - A12 (A22 + W)^-1 A21, and how it varies with what is not known of W.

The identified machine's spread has a hundred directions; each costs two machines at every frequency that is asked for. So variations are
computed where they are asked for, and those of W, which are the same for every tooling, can be kept (`kept`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.uncertain import Doubted, Places, UncertainReceptance, Variation
from rcsa_ident.machine._kernels import changes_of_planes, tip_changes, tips_of_planes, tips_over
from rcsa_ident.machine.flange_part import Doubt, FlangePart, JointedFlange
from rcsa_ident.tool_holder.drawings import FittedDrawing
from rcsa_ident.tool_holder.geometry import ToolAssembly, stiffened
from rcsa_ident.tool_holder.model import tool_holder_poles
from rcsa_ident.tool_holder.rods import rod_poles
from rcsa_ident.tool_holder.spread import IDENTIFIED
from rcsa_ident.tool_holder.turning import both_planes, entries_at_speed

#: Of a tool-holder's receptances (translation and slope of the tip, then of the flange) those that the tip's translation asks for: tip,
#: tip over flange, flange over tip, flange.
_ENTRIES = ((0, 0), (0, 2), (0, 3), (2, 0), (3, 0), (2, 2), (2, 3), (3, 2), (3, 3))
#: All of them, row by row.
_ALL = tuple((i, j) for i in range(4) for j in range(4))


#: What the fields of an alteration belong to.
_KINDS = {
    "stickout": Doubted.LENGTHS,
    "fluted_length": Doubted.LENGTHS,
    "fluted_diameter": Doubted.TOOL,
    "youngs_modulus": Doubted.TOOL,
    "translational_stiffness": Doubted.CONTACT,
    "rotational_stiffness": Doubted.CONTACT,
    "translational_damping": Doubted.CONTACT,
    "rotational_damping": Doubted.CONTACT,
    "holder_diameter": Doubted.HOLDER,
}


def _none() -> ComplexArray:
    return np.zeros((0, 0, 0, 0), dtype=complex)


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """W at both ends of each step of a part, as the kernels read them.

    `ahead`, `behind`: complex arrays, shape (n, p, 3) for one plane, (p, n, b, b) for planes that feel each other; one plane: translation,
        both, slope; asked for at some frequencies, all directions of each, so they stand together in memory
    """

    ahead: ComplexArray
    behind: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One part of a machine behind the flange, at frequencies that many toolings share.

    `omega` [rad/s], shape (n,)
    `nominal`, shape (n, b, b): W of what is believed
    `ends`: at all frequencies where it is kept, else computed for each question
    """

    part: FlangePart
    omega: FloatArray
    nominal: ComplexArray
    doubt: Doubt | None = None
    rivals: ComplexArray = field(default_factory=_none)
    ends: Ends | None = None

    @classmethod
    def of(cls, part: FlangePart, omega: FloatArray) -> Side:
        """Return a part at some frequencies, its doubts left for later."""
        return cls(part, omega, frozen(part.believed.interface(omega), np.complex128))

    @property
    def single(self) -> bool:
        """Whether it is one bending plane."""
        return len(self.part.coordinates) == 2

    @property
    def axial(self) -> bool:
        """Whether it is what stands behind the tool-holder along its axis."""
        return len(self.part.coordinates) == 1

    def moves(self, slopes: bool = False) -> tuple[Coordinate, ...]:
        """Return the tip's directions that it moves: translations, with the slopes if asked."""
        moved = (c.dof for c in self.part.coordinates if c.dof is not Dof.TORSION)
        return tuple(Coordinate("tip", dof) for dof in moved if slopes or not dof.is_slope)

    def doubted(self) -> Side:
        """Return the same with what is not known of it, without the steps' ends."""
        if self.part.doubt is None or self.doubt is not None:
            return self
        doubt = self.part.doubt()
        size = len(self.part.coordinates)
        rivals = np.array([c.interface(self.omega) for c in doubt.rivals]).reshape(-1, self.omega.size, size, size)
        return replace(self, doubt=doubt, rivals=rivals)

    def kept(self) -> Side:
        """Return the same with the ends of all steps at all frequencies."""
        side = self.doubted()
        return side if side.doubt is None or side.ends is not None else replace(side, ends=side.ends_at(np.arange(self.omega.size))[0])

    def ends_at(self, places: Places) -> tuple[Ends, Places]:
        """Return the ends of all steps, and where those of `places` stand in them."""
        if self.ends is not None:
            return self.ends, places
        assert self.doubt is not None
        omega = self.omega[places]
        ahead, behind = ([_laid(c.interface(omega), self.single) for c in row] for row in _both(self.doubt))
        if self.single:
            return Ends(*(np.array(each).reshape(-1, omega.size, 3).transpose(1, 0, 2).copy() for each in (ahead, behind))), np.arange(
                omega.size
            )
        size = len(self.part.coordinates)
        return Ends(*(np.array(each).reshape(-1, omega.size, size, size) for each in (ahead, behind))), np.arange(omega.size)


def _both(doubt: Doubt) -> tuple[list[JointedFlange], list[JointedFlange]]:
    return [step.ahead for step in doubt.steps], [step.behind for step in doubt.steps]


def _laid(w: ComplexArray, single: bool) -> ComplexArray:
    """Translation, both and slope of a plane's W, shape (n, 3)."""
    return np.stack([w[:, 0, 0], 0.5 * (w[:, 0, 1] + w[:, 1, 0]), w[:, 1, 1]], axis=1) if single else w


def _spread_out(laid: ComplexArray) -> ComplexArray:
    """The W of a plane that was laid so, shape (n, p, 3) -> (p, n, 2, 2)."""
    return np.ascontiguousarray(laid[:, :, [[0, 1], [1, 2]]].transpose(1, 0, 2, 3))


def _planes(w: ComplexArray) -> ComplexArray:
    """The same with the frequencies last, shape (..., n, 2, 2) -> (..., 3, n)."""
    return np.stack([w[..., 0, 0], 0.5 * (w[..., 0, 1] + w[..., 1, 0]), w[..., 1, 1]], axis=-2)


@dataclass(frozen=True, slots=True, eq=False)
class Holder:
    """A tool-holder's free receptances between tip and flange, as a part of the machine needs them.

    `blocks`: complex arrays, shapes (n, a, a), (n, a, b), (n, b, a), (n, b, b); A11, A12, A21, A22 over a directions of the tip and b of
        the flange
    """

    blocks: tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]

    def at(self, places: Places) -> Holder:
        """Return the same at some of the frequencies."""
        a11, a12, a21, a22 = (each[places] for each in self.blocks)
        return Holder((a11, a12, a21, a22))

    def tip(self, w: ComplexArray) -> ComplexArray:
        """Return C11 for W, shape (..., n, b, b) -> (..., n, a, a), at this holder's frequencies."""
        # the kernel is compiled anew for read-only arrays: a copy is none
        found: ComplexArray = tips_of_planes(*self.blocks, np.array(w.reshape(-1, *w.shape[-3:])))
        return found.reshape(*w.shape[:-2], *found.shape[-2:])

    def changes(self, side: Side, places: Places) -> ComplexArray:
        """Return C11's change along each step of a part, shape (p, k, a, a), per standard deviation; places are this holder's."""
        assert side.doubt is not None
        weight = np.array([step.weight for step in side.doubt.steps])
        ends, own = side.ends_at(places)
        ahead, behind = (_spread_out(each) if side.single else each for each in (ends.ahead, ends.behind))
        found: ComplexArray = changes_of_planes(*self.blocks[1:], ahead, behind, weight, own)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class PlaneHolder:
    """The same of one bending plane and the tip's translation alone, in closed form.

    `tip_tip`, shape (n,)
    `flange`, `carried`, shape (3, n): as `rcsa_ident.machine._kernels.tips_over` takes them
    """

    tip_tip: ComplexArray
    flange: ComplexArray
    carried: ComplexArray

    @classmethod
    def of(cls, free: ComplexArray) -> PlaneHolder:
        """Return a plane of the entries `_ENTRIES`, shape (9, n)."""
        to, back = free[1:3], free[3:5]
        carried = np.stack([to[0] * back[0], to[0] * back[1] + to[1] * back[0], to[1] * back[1]])
        return cls(free[0].copy(), np.stack([free[5], 0.5 * (free[6] + free[7]), free[8]]), carried)

    def at(self, places: Places) -> PlaneHolder:
        """Return the same at some of the frequencies."""
        # laid out in memory as the whole ones are: one compiled kernel for both
        return PlaneHolder(self.tip_tip[places], *(np.ascontiguousarray(each[:, places]) for each in (self.flange, self.carried)))

    def tip(self, w: ComplexArray) -> ComplexArray:
        """Return C11 for W, shape (..., n, 2, 2) -> (..., n, 1, 1), at this holder's frequencies."""
        rows = np.ascontiguousarray(_planes(w), dtype=complex)
        found: ComplexArray = tips_over(self.tip_tip, self.flange, self.carried, rows.reshape(-1, *rows.shape[-2:]))
        return found.reshape(*w.shape[:-2], 1, 1)

    def changes(self, side: Side, places: Places) -> ComplexArray:
        """Return C11's change along each step of a part, shape (p, k, 1, 1), per standard deviation; places are this holder's."""
        assert side.doubt is not None
        weight = np.array([step.weight for step in side.doubt.steps])
        if weight.size == 0:
            return np.zeros((0, places.size, 1, 1), dtype=complex)
        ends, own = side.ends_at(places)
        found: ComplexArray = tip_changes(self.tip_tip, self.flange, self.carried, ends.ahead, ends.behind, weight, own)
        return found[:, :, None, None]


@dataclass(frozen=True, slots=True, eq=False)
class Behind:
    """What stands behind a tool-holder, and which directions of its tip are asked for.

    `turning` [rad/s]: spindle speed of the tool-holder's gyroscopic moments, which couple the planes: both are one part then. None leaves
        them out.
    `slopes`: the tip's slopes beside its translations
    """

    sides: tuple[Side, ...]
    turning: float | None = None
    slopes: bool = False

    def holders(self, assembly: ToolAssembly, omega: FloatArray, highest: float | None = None) -> tuple[Holder | PlaneHolder, ...]:
        """Return a tool-holder at some frequencies as each part needs it.

        `omega` [rad/s], shape (n,)
        `highest` [rad/s]: frequency up to which mesh and modes are good; that of `omega` by default
        """
        made: dict[int, Holder | PlaneHolder] = {}
        highest = float(omega[-1]) if highest is None else highest
        for side in self.sides:
            size = len(side.part.coordinates)
            if size not in made:
                made[size] = self._holder(side, assembly, omega, highest)
        return tuple(made[len(side.part.coordinates)] for side in self.sides)

    def _holder(self, side: Side, assembly: ToolAssembly, omega: FloatArray, highest: float) -> Holder | PlaneHolder:
        if side.axial:
            return Holder(_cut(rod_poles(assembly, highest).receptance(omega).values, 1, 1))
        if self.turning is not None:
            return _turning_holder(assembly, omega, self.turning, side, self.slopes)
        poles = tool_holder_poles(assembly, highest)
        if side.single and not self.slopes:
            return PlaneHolder.of(poles.entries(omega, _ENTRIES))
        coordinates = side.part.coordinates
        if len(coordinates) > 4:
            return _whole_holder(assembly, omega.tobytes(), highest, coordinates[4:], self.slopes)
        return Holder(_bending(assembly, omega, highest, 1 if side.single else 2, self.slopes))


@lru_cache(maxsize=4)
def _whole_holder(assembly: ToolAssembly, frequencies: bytes, highest: float, rods: tuple[Coordinate, ...], slopes: bool) -> Holder:
    """A tool-holder in both planes, along its axis and about it, as far as these are asked for: the same at all postures of a robot."""
    omega = np.frombuffer(frequencies)
    parts = [_bending(assembly, omega, highest, 2, slopes)]
    for dof in (c.dof for c in rods):
        tips, across, back, own = _cut(rod_poles(assembly, highest, dof is Dof.TORSION).receptance(omega).values, 1, 1)
        if dof is Dof.TORSION:
            # what twists the tip is nobody's question
            tips, across, back = tips[:, :0, :0], across[:, :0], back[:, :, :0]
        parts.append((tips, across, back, own))
    a11, a12, a21, a22 = (_beside(each) for each in zip(*parts, strict=True))
    return Holder((a11, a12, a21, a22))


def _bending(
    assembly: ToolAssembly, omega: FloatArray, highest: float, planes: int, slopes: bool
) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
    """A11, A12, A21, A22 of a tool-holder in one or both bending planes, which it does not couple."""
    free = tool_holder_poles(assembly, highest).entries(omega, _ALL).T.reshape(-1, 4, 4)
    kept = [0, 1, 2, 3] if slopes else [0, 2, 3]
    a11, a12, a21, a22 = ([each] * planes for each in _cut(free[:, kept][:, :, kept], len(kept) - 2, 2))
    return _beside(a11), _beside(a12), _beside(a21), _beside(a22)


def _beside(blocks: Sequence[ComplexArray]) -> ComplexArray:
    """Blocks of directions that feel nothing of each other, shapes (n, a, b), (n, c, d), ... -> (n, a + c + ..., b + d + ...)."""
    if len(blocks) == 1:
        return blocks[0]
    both = np.zeros((len(blocks[0]), sum(each.shape[1] for each in blocks), sum(each.shape[2] for each in blocks)), dtype=complex)
    row = col = 0
    for each in blocks:
        rows, cols = each.shape[1:]
        both[:, row : row + rows, col : col + cols] = each
        row, col = row + rows, col + cols
    return both


def _cut(free: ComplexArray, tip: int, flange: int) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
    """A11, A12, A21, A22 of receptances over directions of the tip, then of the flange."""
    rows = slice(0, tip), slice(tip, tip + flange)
    a11, a12, a21, a22 = (np.ascontiguousarray(free[:, r, c]) for r in rows for c in rows)
    return a11, a12, a21, a22


def _turning_holder(assembly: ToolAssembly, omega: FloatArray, speed: float, side: Side, slopes: bool) -> Holder:
    """A tool-holder that turns with the spindle: its gyroscopic moments couple both planes."""
    dofs = tuple(c.dof for c in side.moves())
    if set(dofs) != {Dof.X, Dof.Y}:
        raise InputError("machine", f"known along {', '.join(dofs)}", "both bending planes: a tool-holder that turns couples them")
    # from +Y to +X is backwards for whoever calls Y the first axis
    sense = 1.0 if dofs[0] is Dof.X else -1.0
    tip, flange = (0, 1) if slopes else (0,), (2, 3)
    # a receptance of a plane that turns is symmetric
    wanted = sorted({(min(i, j), max(i, j)) for i in (*tip, *flange) for j in (*tip, *flange)})
    pair = entries_at_speed(assembly, omega, sense * speed, wanted)

    def block(rows: tuple[int, ...], cols: tuple[int, ...]) -> ComplexArray:
        places = np.array([[wanted.index((min(i, j), max(i, j))) for j in cols] for i in rows])
        forward, backward = (np.moveaxis(each[places], -1, 0) for each in pair)
        return np.ascontiguousarray(both_planes(forward, backward))

    return Holder((block(tip, tip), block(tip, flange), block(flange, tip), block(flange, flange)))


@dataclass(frozen=True, eq=False)
class TipSpread:
    """How a tip varies: with the machine's steps and rivals, with what its drawing leaves open, and with the tool-holder's stiffness.

    `members`: tuple of (tuple of int), one for each part; where its directions stand in the tip's receptance
    `stiffness_spread`: standard deviation of the tool-holder's stiffness, as a share
    """

    behind: Behind
    members: tuple[tuple[int, ...], ...]
    holders: tuple[Holder | PlaneHolder, ...]
    drawing: FittedDrawing
    stiffness_spread: float

    @property
    def covers(self) -> frozenset[int]:
        """Rows of the tip's receptance that vary."""
        return frozenset(m for k in self._varying for m in self.members[k])

    @property
    def _varying(self) -> list[int]:
        # along the axis the machine is taken for exact: only what is not known of the tool-holder moves the tip
        return [k for k, side in enumerate(self.behind.sides) if side.part.doubt is not None or self.drawing.ends or side.axial]

    @cached_property
    def _known(self) -> dict[int, Side]:
        return {k: self.behind.sides[k].doubted() for k in self._varying}

    @cached_property
    def _ends(self) -> list[tuple[tuple[Holder | PlaneHolder, ...], ...]]:
        """The tool-holder a standard deviation ahead and behind along all that its drawing leaves open."""
        omega = self.behind.sides[0].omega
        return [tuple(self.behind.holders(each, omega) for each in both) for both in self.drawing.ends]

    def at(self, places: Places) -> tuple[Variation, ...]:
        """Return the variations at some of the frequencies."""
        omega = self.behind.sides[0].omega
        stiffer = None
        if self.stiffness_spread > 0.0:
            # with the mesh and the modes of all frequencies, as the tool-holder itself
            stiffer = self.behind.holders(stiffened(self.drawing.assembly, self.stiffness_spread), omega[places], float(omega[-1]))
        found = []
        for k, side in self._known.items():
            holder, w = self.holders[k].at(places), side.nominal[places]
            here = holder.tip(w)
            machine = np.zeros((0, *here.shape), dtype=complex)
            if side.doubt is not None:
                machine = np.concatenate([holder.changes(side, places), holder.tip(side.rivals[:, places]) - here])
            machine, open_, moves = self._with_drawing(k, places, machine)
            kinds, told = [_KINDS[name] for name in self.drawing.fields], self.drawing.fields[: self.drawing.known.size]
            if stiffer is not None:
                open_ = np.concatenate([open_, (stiffer[k].tip(w) - here)[None]])
                moves = np.pad(moves, ((0, 1), (0, 1)))
                moves[-1, -1] = 1.0
                kinds.append(Doubted.STIFFNESS)
            unknowns = {kind: moves[[each is kind for each in kinds]] for kind in dict.fromkeys(kinds)}
            names = [IDENTIFIED + name if name in told else name for name in self.drawing.fields]
            parameters = {name: moves[[k for k, each in enumerate(names) if each == name]] for name in names}
            change = np.concatenate([machine, open_])
            if not len(change):
                change, unknowns = np.zeros((1, *here.shape), dtype=complex), {}
            # the tool-holder is the same one for all parts
            found.append(Variation(self.members[k], change, len(open_), unknowns, parameters))
        return tuple(found)

    def _with_drawing(self, k: int, places: Places, machine: ComplexArray) -> tuple[ComplexArray, ComplexArray, FloatArray]:
        """The machine's directions with the toolings that move along with them, what the drawing leaves open beside the machine, and how
        far each of the drawing's unknowns moves along all of these."""
        count = len(self.drawing.ends)
        if not count:
            return machine, np.zeros((0, *machine.shape[1:]), dtype=complex), np.zeros((0, len(machine)))
        side = self._known[k]
        w = side.nominal[places]
        along = np.array([0.5 * (ahead[k].at(places).tip(w) - behind[k].at(places).tip(w)) for ahead, behind in self._ends])
        shifts, root, known = np.zeros((len(machine), count)), np.eye(count), self.drawing.known
        if known.size and side.doubt is not None and side.doubt.left.size:
            first, deviation = slice(known.size), self.drawing.deviation
            shifts[:, first] = side.doubt.shifts[:, known] / deviation
            values, vectors = np.linalg.eigh(side.doubt.left[np.ix_(known, known)])
            # the symmetric root, so that directions of both planes belong to the same unknowns
            root[first, first] = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T / deviation
        return machine + np.tensordot(shifts, along, axes=1), np.tensordot(root, along, axes=1), np.vstack([shifts, root]).T

    def guides(self) -> ComplexArray:
        """Return the tips of the rivals, each entry a curve."""
        known = [(self.holders[k], side) for k, side in self._known.items() if side.doubt is not None]
        curves = [holder.tip(side.rivals).transpose(0, 2, 3, 1).reshape(-1, side.omega.size) for holder, side in known]
        return np.concatenate([np.zeros((0, self.behind.sides[0].omega.size), dtype=complex), *curves])


def tip_over(behind: Behind, drawing: FittedDrawing, stiffness_spread: float) -> UncertainReceptance:
    """Return the tip's receptance of a tooling on a machine, with its spread where something is not known.

    `behind`: all parts of the machine, at the same frequencies
    `stiffness_spread`: standard deviation of the tool-holder's stiffness, as a share
    """
    omega = behind.sides[0].omega
    holders = behind.holders(drawing.assembly, omega)
    moves = [side.moves(behind.slopes) for side in behind.sides]
    axes = tuple(c for each in moves for c in each)
    values, members = np.zeros((omega.size, len(axes), len(axes)), dtype=complex), []
    for side, holder, own in zip(behind.sides, holders, moves, strict=True):
        first = axes.index(own[0])
        values[:, first : first + len(own), first : first + len(own)] = holder.tip(side.nominal)
        members.append(tuple(range(first, first + len(own))))
    known = bool(drawing.ends) or any(side.part.doubt is not None for side in behind.sides)
    spread = TipSpread(behind, tuple(members), holders, drawing, stiffness_spread) if known else None
    return UncertainReceptance(omega, values, axes, axes, spread)
