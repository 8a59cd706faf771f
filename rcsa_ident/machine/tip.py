"""The tip of a tool-holder on a machine: C11 = A11 - A12 (A22 + W)^-1 A21, and how it varies with what is not known of W.

The identified machine's spread has a hundred directions; each costs two machines at every frequency that is asked for. So variations are
computed where they are asked for, and those of W, which are the same for every tooling, can be kept (`kept`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.coupling._kernels import changes_of_planes, tip_changes, tips_of_planes, tips_over
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.uncertain import Doubted, Places, UncertainReceptance, Variation
from rcsa_ident.errors import InputError
from rcsa_ident.machine.flange_part import Doubt, FlangePart, JointedFlange
from rcsa_ident.tool_holder.drawings import FittedDrawing
from rcsa_ident.tool_holder.geometry import ToolAssembly, stiffened
from rcsa_ident.tool_holder.model import tool_holder_poles
from rcsa_ident.tool_holder.turning import both_planes, entries_at_speed

#: Of a tool-holder's receptances (translation and slope of the tip, then of the flange): tip, tip over flange, flange over tip, flange.
_ENTRIES = ((0, 0), (0, 2), (0, 3), (2, 0), (3, 0), (2, 2), (2, 3), (3, 2), (3, 3))
#: The same of receptances that are symmetric.
_SYMMETRIC = ((0, 0), (0, 2), (0, 3), (2, 2), (2, 3), (3, 3))


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

    Parameters
    ----------
    ahead, behind : complex arrays, shape (n, p, 3) for one plane, (p, n, b, b) for planes that feel each other
        One plane: translation, both, slope; asked for at some frequencies, all directions of each, so they stand together in memory.
    """

    ahead: ComplexArray
    behind: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One part of a machine behind the flange, at frequencies that many toolings share.

    Parameters
    ----------
    part : FlangePart
    omega : array, shape (n,) [rad/s]
    nominal : complex array, shape (n, b, b)
        W of what is believed.
    ends : Ends or None
        At all frequencies where it is kept, else computed for each question.
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
    def axes(self) -> tuple[Coordinate, ...]:
        """The tip's translations that it moves."""
        return tuple(Coordinate("tip", c.dof) for c in self.part.coordinates if not c.dof.is_slope)

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


def _planes(w: ComplexArray) -> ComplexArray:
    """The same with the frequencies last, shape (..., n, 2, 2) -> (..., 3, n)."""
    return np.stack([w[..., 0, 0], 0.5 * (w[..., 0, 1] + w[..., 1, 0]), w[..., 1, 1]], axis=-2)


class Holder:
    """A tool-holder's free receptances between tip and flange, alike in both bending planes.

    Parameters
    ----------
    assembly : ToolAssembly
    omega : array, shape (n,) [rad/s]
    highest : float or None [rad/s]
        Frequency up to which mesh and modes are good; that of `omega` by default.
    """

    def __init__(self, assembly: ToolAssembly, omega: FloatArray, highest: float | None = None) -> None:
        free = tool_holder_poles(assembly, float(omega[-1]) if highest is None else highest).entries(omega, _ENTRIES)
        to, back = free[1:3], free[3:5]
        self.free = free
        self.tip_tip, self.flange = free[0].copy(), np.stack([free[5], 0.5 * (free[6] + free[7]), free[8]])
        self.carried = np.stack([to[0] * back[0], to[0] * back[1] + to[1] * back[0], to[1] * back[1]])

    def at(self, places: Places) -> Holder:
        """Return the same at some of the frequencies."""
        part = object.__new__(Holder)
        part.free = self.free[:, places]
        part.tip_tip, part.flange, part.carried = self.tip_tip[places], self.flange[:, places], self.carried[:, places]
        return part

    def tip(self, w: ComplexArray) -> ComplexArray:
        """Return C11 of the translations for W, shape (..., n, b, b) -> (..., n, b / 2, b / 2), at this holder's frequencies."""
        if w.shape[-1] == 2:
            rows = np.ascontiguousarray(_planes(w))
            found: ComplexArray = tips_over(self.tip_tip, self.flange, self.carried, rows.reshape(-1, *rows.shape[-2:]))
            return found.reshape(*w.shape[:-2], 1, 1)
        return self._tip_of_planes(w)

    def _tip_of_planes(self, w: ComplexArray) -> ComplexArray:
        """The same where planes feel each other."""
        tip_tip, forward, back, middle = self.blocks(w.shape[-1] // 2)
        found: ComplexArray = tip_tip - forward @ np.linalg.solve(middle + w, np.broadcast_to(back, (*w.shape[:-1], back.shape[-1])))
        return found

    def blocks(self, count: int) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
        """Return A11, A12, A21, A22 of some planes, which it does not couple, shapes (n, a, a), (n, a, 2 a), (n, 2 a, a), (n, 2 a, 2 a)."""
        n = self.tip_tip.size
        unit = np.eye(count)
        a12, a21, a22 = self.free[1:3].T, self.free[3:5].T, self.free[5:9].T.reshape(n, 2, 2)
        forward = np.einsum("ab,ni->nabi", unit, a12).reshape(n, count, 2 * count)
        back = np.einsum("ab,ni->naib", unit, a21).reshape(n, 2 * count, count)
        middle = np.einsum("ab,nij->naibj", unit, a22).reshape(n, 2 * count, 2 * count)
        return self.tip_tip[:, None, None] * unit, forward, back, middle

    def changes(self, side: Side, places: Places) -> ComplexArray:
        """Return C11's change along each step of a part, shape (p, k, b / 2, b / 2), per standard deviation; places are this holder's."""
        assert side.doubt is not None
        weight = np.array([step.weight for step in side.doubt.steps])
        ends, own = side.ends_at(places)
        if side.single:
            if weight.size == 0:
                return np.zeros((0, places.size, 1, 1), dtype=complex)
            found: ComplexArray = tip_changes(self.tip_tip, self.flange, self.carried, ends.ahead, ends.behind, weight, own)
            return found[:, :, None, None]
        _, forward, back, middle = self.blocks(len(side.axes))
        across: ComplexArray = changes_of_planes(forward, back, middle, ends.ahead, ends.behind, weight, own)
        return across


class TurningHolder(Holder):
    """A tool-holder that turns with the spindle: its gyroscopic moments couple both planes.

    Parameters
    ----------
    assembly : ToolAssembly
    omega : array, shape (n,) [rad/s]
    speed : float [rad/s]
        Of the spindle.
    axes : tuple of Coordinate
        The tip's translations, in their order.
    """

    def __init__(self, assembly: ToolAssembly, omega: FloatArray, speed: float, axes: tuple[Coordinate, ...]) -> None:
        dofs = tuple(c.dof for c in axes)
        if set(dofs) != {Dof.X, Dof.Y}:
            raise InputError("machine", f"known along {', '.join(dofs)}", "both bending planes: a tool-holder that turns couples them")
        # from +Y to +X is backwards for whoever calls Y the first axis
        sense = 1.0 if dofs[0] is Dof.X else -1.0
        pair = entries_at_speed(assembly, omega, sense * speed, _SYMMETRIC)

        def block(*places: tuple[int, ...]) -> ComplexArray:
            of_each = [np.moveaxis(each[np.array(places)], -1, 0) for each in pair]
            return np.ascontiguousarray(both_planes(of_each[0], of_each[1]))

        self.all = block((0,)), block((1, 2)), block((1,), (2,)), block((3, 4), (4, 5))

    def at(self, places: Places) -> Holder:
        """Return the same at some of the frequencies."""
        part = object.__new__(TurningHolder)
        part.all = tuple(np.ascontiguousarray(each[places]) for each in self.all)  # type: ignore[assignment]
        return part

    def tip(self, w: ComplexArray) -> ComplexArray:
        """Return C11 of the translations for W, shape (..., n, 4, 4) -> (..., n, 2, 2), at this holder's frequencies."""
        # the kernel is compiled anew for read-only arrays: a copy is none
        found: ComplexArray = tips_of_planes(*self.all, np.array(w.reshape(-1, *w.shape[-3:])))
        return found.reshape(*w.shape[:-2], 2, 2)

    def blocks(self, count: int) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
        """Return A11, A12, A21, A22 of both planes."""
        del count
        return self.all


@dataclass(frozen=True, eq=False)
class TipSpread:
    """How a tip varies: with the machine's steps and rivals, with what its drawing leaves open, and with the tool-holder's stiffness.

    Parameters
    ----------
    sides : sequence of Side
    members : tuple of (tuple of int), one for each side
        Where its translations stand in the tip's receptance.
    holder : Holder
    drawing : FittedDrawing
    stiffness_spread : float
        Standard deviation of the tool-holder's stiffness, as a share.
    turning : float or None [rad/s]
        Spindle speed of the tool-holder's gyroscopic moments.
    """

    sides: Sequence[Side]
    members: tuple[tuple[int, ...], ...]
    holder: Holder
    drawing: FittedDrawing
    stiffness_spread: float
    turning: float | None = None

    @property
    def covers(self) -> frozenset[int]:
        """Rows of the tip's receptance that vary."""
        return frozenset(m for _, members in self._varying for m in members)

    @property
    def _varying(self) -> list[tuple[Side, tuple[int, ...]]]:
        both = zip(self.sides, self.members, strict=True)
        return [(side, members) for side, members in both if side.part.doubt is not None or self.drawing.ends]

    @cached_property
    def _known(self) -> list[tuple[Side, tuple[int, ...]]]:
        return [(side.doubted(), members) for side, members in self._varying]

    @cached_property
    def _ends(self) -> list[tuple[Holder, Holder]]:
        """The tool-holder a standard deviation ahead and behind along all that its drawing leaves open."""
        omega = self.sides[0].omega
        ahead, behind = ([holder_of(each, omega, self.sides, self.turning) for each in row] for row in zip(*self.drawing.ends, strict=True))
        return list(zip(ahead, behind, strict=True))

    def at(self, places: Places) -> tuple[Variation, ...]:
        """Return the variations at some of the frequencies."""
        holder, omega = self.holder.at(places), self.sides[0].omega
        stiffer = None
        if self.stiffness_spread > 0.0:
            # with the mesh and the modes of all frequencies, as the tool-holder itself
            assembly, highest = stiffened(self.drawing.assembly, self.stiffness_spread), float(omega[-1])
            stiffer = holder_of(assembly, omega[places], self.sides, self.turning, highest)
        found = []
        for side, members in self._known:
            here = holder.tip(side.nominal[places])
            machine = np.zeros((0, *here.shape), dtype=complex)
            if side.doubt is not None:
                machine = np.concatenate([holder.changes(side, places), holder.tip(side.rivals[:, places]) - here])
            machine, open_, moves = self._with_drawing(side, places, machine)
            kinds = [_KINDS[name] for name in self.drawing.fields]
            if stiffer is not None:
                open_ = np.concatenate([open_, (stiffer.tip(side.nominal[places]) - here)[None]])
                moves = np.pad(moves, ((0, 1), (0, 1)))
                moves[-1, -1] = 1.0
                kinds.append(Doubted.STIFFNESS)
            unknowns = {kind: moves[[each is kind for each in kinds]] for kind in dict.fromkeys(kinds)}
            change = np.concatenate([machine, open_])
            if not len(change):
                change, unknowns = np.zeros((1, *here.shape), dtype=complex), {}
            # the tool-holder is the same one in both planes
            found.append(Variation(members, change, len(open_), unknowns))
        return tuple(found)

    def _with_drawing(self, side: Side, places: Places, machine: ComplexArray) -> tuple[ComplexArray, ComplexArray, FloatArray]:
        """The machine's directions with the toolings that move along with them, what the drawing leaves open beside the machine, and how
        far each of the drawing's unknowns moves along all of these."""
        count = len(self.drawing.ends)
        if not count:
            return machine, np.zeros((0, *machine.shape[1:]), dtype=complex), np.zeros((0, len(machine)))
        w = side.nominal[places]
        along = np.array([0.5 * (ahead.at(places).tip(w) - behind.at(places).tip(w)) for ahead, behind in self._ends])
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
        known = [(side, members) for side, members in self._known if side.doubt is not None]
        curves = [self.holder.tip(side.rivals).transpose(0, 2, 3, 1).reshape(-1, side.omega.size) for side, _ in known]
        return np.concatenate([np.zeros((0, self.sides[0].omega.size), dtype=complex), *curves])


def holder_of(
    assembly: ToolAssembly, omega: FloatArray, sides: Sequence[Side], turning: float | None, highest: float | None = None
) -> Holder:
    """Return a tool-holder at some frequencies as the machine's parts need it, turning or not."""
    return Holder(assembly, omega, highest) if turning is None else TurningHolder(assembly, omega, turning, sides[0].axes)


def tip_over_sides(
    sides: Sequence[Side], drawing: FittedDrawing, stiffness_spread: float, turning: float | None = None
) -> UncertainReceptance:
    """Return the tip's receptance of a tooling on a machine, with its spread where something is not known.

    Parameters
    ----------
    sides : sequence of Side
        All parts of the machine, at the same frequencies.
    drawing : FittedDrawing
    stiffness_spread : float
        Standard deviation of the tool-holder's stiffness, as a share.
    turning : float or None [rad/s]
        Spindle speed of the tool-holder's gyroscopic moments, which couple the planes: the machine is one part then. None leaves them out.
    """
    omega = sides[0].omega
    holder = holder_of(drawing.assembly, omega, sides, turning)
    axes = [c for side in sides for c in side.axes]
    values, members = np.zeros((omega.size, len(axes), len(axes)), dtype=complex), []
    for side in sides:
        own = tuple(axes.index(c) for c in side.axes)
        values[:, own[0] : own[-1] + 1, own[0] : own[-1] + 1] = holder.tip(side.nominal)
        members.append(own)
    known = bool(drawing.ends) or any(side.part.doubt is not None for side in sides)
    spread = TipSpread(tuple(sides), tuple(members), holder, drawing, stiffness_spread, turning) if known else None
    return UncertainReceptance(omega, values, tuple(axes), tuple(axes), spread)
