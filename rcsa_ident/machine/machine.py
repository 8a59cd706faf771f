"""A machine: whatever stands behind the flange, ready to take a tool-holder.

An identified spindle, a measured or decoupled flange and a robot at a posture differ in what they know of themselves; a tooling is coupled
to all of them in the same way, and nobody downstream asks which of them it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance, Substructure
from rcsa_ident.dynamics.uncertain import Places, UncertainReceptance, Variation
from rcsa_ident.errors import InputError
from rcsa_ident.machine.flange_part import Candidate, FlangePart, independent_parts
from rcsa_ident.machine.tip import Side, tip_over_sides
from rcsa_ident.machining_setup import Tooling, Workpiece
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance

#: Lower end of the receptances that limits are computed from, and their step [Hz].
LOWEST, STEP = 100.0, 1.0
#: Relative standard deviation of a tool-holder's stiffness that stands for its mesh.
STIFFNESS_SPREAD = 5e-4
_Respond = Callable[[Candidate, Receptance | None, FloatArray], Receptance]
_SLOPES = {Dof.X: Dof.SLOPE_X, Dof.Y: Dof.SLOPE_Y}


class TipSource(ABC):
    """Whoever knows what the tip of a tooling does: a machine that takes any, or a test of one."""

    @property
    @abstractmethod
    def band(self) -> tuple[float, float] | None:
        """Lowest and highest frequency at which it is known [rad/s]; None where it is known at all."""

    @property
    def speed_range(self) -> tuple[float, float] | None:
        """Lowest and highest spindle speed [rad/s] between which it is known how it changes; None where it does not change."""
        return None

    @property
    def unknowns(self) -> int:
        """Independent directions in which it may differ from what is believed."""
        return 0

    @property
    def prepared(self) -> bool:
        """Whether a further tooling costs milliseconds, its spread included."""
        return True

    @property
    def workpiece(self) -> Workpiece | None:
        """What was cut, where that is known: its coefficients serve a cut that names none."""
        return None

    @property
    def remarks(self) -> tuple[str, ...]:
        """What speaks against everything that is computed with it."""
        return ()

    def at(self, speed: float | None) -> TipSource:
        """Return what answers at a spindle speed [rad/s], by default at the middle of the speeds that it is known at."""
        del speed
        return self

    def models(self, speeds: FloatArray) -> Sequence[tuple[TipSource, NDArray[np.intp]]]:
        """Return each model that answers at some of the speeds [rad/s], and the places of those."""
        return [(self, np.arange(speeds.size))]

    @abstractmethod
    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return the frequencies [rad/s] of its receptances, up to so many times the highest at which it is known."""

    @abstractmethod
    def tip(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray | None = None,
        spread: bool = True,
        stiffness_spread: float = STIFFNESS_SPREAD,
    ) -> UncertainReceptance | TipModes:
        """Return what the tip of a tooling does."""


class Machine(TipSource):
    """What stands behind the flange.

    A subclass says what it is by `parts` and `band`, and what else it knows of itself: how it changes with the speed (`at`, `models`,
    `speed_range`), and what speaks against it (`remarks`).
    """

    @property
    @abstractmethod
    def parts(self) -> tuple[FlangePart, ...]:
        """Directions of the flange that feel each other, group by group."""

    @property
    def ends(self) -> bool:
        """Whether it answers at no frequency beyond `band`, as a measurement does."""
        return False

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Directions of the flange that are known."""
        return tuple(c for part in self.parts for c in part.coordinates)

    @property
    def axes(self) -> tuple[Dof, ...]:
        """Machine axes along which the tip moves."""
        return tuple(c.dof for c in self.coordinates if not c.dof.is_slope)

    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return frequencies [rad/s] 1 Hz apart, from 100 Hz or below up to so many times the highest at which the machine is known."""
        assert self.band is not None
        low, high = (w / (2.0 * np.pi) for w in self.band)
        return 2.0 * np.pi * np.arange(min(LOWEST, low), beyond * high + 0.5 * STEP, STEP)

    def at(self, speed: float | None) -> Machine:
        """Return the machine at a spindle speed [rad/s], by default at the middle of the speeds that it is known at."""
        del speed
        return self

    def kept(self, spread: bool = True) -> Machine:
        """Return the same machine, with what many toolings share worked out, where that saves time; of its spread only if asked."""
        del spread
        return self

    def sides(self, omega: FloatArray) -> tuple[Side, ...]:
        """Return what a tip feels of the machine at some frequencies [rad/s]."""
        omega = frozen(omega)
        return tuple(Side.of(part, omega) for part in self.parts)

    def receptance(self, omega: FloatArray, axes: Sequence[Dof] | None = None) -> UncertainReceptance:
        """Return the receptance at the flange, over all its coordinates.

        Parameters
        ----------
        omega : array, shape (n,) [rad/s]
        axes : sequence of Dof, default all
            Only these machine axes, and what they feel of others.
        """
        return self._response(omega, axes, _at_flange, None)

    def coupled(self, tooling: Tooling | ToolAssembly, omega: FloatArray, axes: Sequence[Dof] | None = None) -> UncertainReceptance:
        """Return the receptances of a tooling on the machine between tip and spindle, translations and slopes.

        Parameters
        ----------
        tooling : Tooling or ToolAssembly
        omega : array, shape (n,) [rad/s]
        axes : sequence of Dof, default all
            Only these machine axes, and what they feel of others.

        Returns
        -------
        UncertainReceptance
            Points ``tip`` and ``spindle``; the tool-holder is taken for exact.
        """
        holder = tool_holder_receptance(_assembly(tooling), frozen(omega))
        return self._response(omega, axes, _at_ends, holder)

    def tip(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray | None = None,
        spread: bool = True,
        stiffness_spread: float = STIFFNESS_SPREAD,
    ) -> UncertainReceptance:
        """Return the tip's receptance of a tooling on the machine, over ``tip.x`` and ``tip.y`` with their cross terms.

        Parameters
        ----------
        tooling : Tooling or ToolAssembly
        omega : array, shape (n,) [rad/s], default the machine's `lines`
            Ascending.
        spread : bool
            With what is not known of the machine, where something is; it is computed where it is asked for.
        stiffness_spread : float
            Standard deviation of the tool-holder's stiffness, as a share: the mesh alone by default; 0.01 for a modulus from a handbook.
        """
        sides = self.sides(self.lines() if omega is None else omega)
        tip = tip_over_sides(sides, _assembly(tooling), stiffness_spread)
        return tip if spread else replace(tip, variation=None)

    def _response(
        self,
        omega: FloatArray,
        axes: Sequence[Dof] | None,
        respond: _Respond,
        holder: Receptance | None,
    ) -> UncertainReceptance:
        omega = frozen(omega)
        wanted = [part for part in self.parts if axes is None or any(c.dof in axes for c in part.coordinates)]
        parts = [_PartResponse(part, respond, None if holder is None else in_planes(holder, part), omega) for part in wanted]
        whole = Receptance.block_diagonal([part.nominal for part in parts])
        known = any(part.part.doubt is not None for part in parts)
        return UncertainReceptance(omega, whole.values, whole.rows, whole.cols, _Responses(tuple(parts)) if known else None)


@dataclass(frozen=True, eq=False)
class _PartResponse:
    """What a part of the machine responds, alone or with its share of a tool-holder."""

    part: FlangePart
    respond: _Respond
    holder: Receptance | None
    omega: FloatArray

    @cached_property
    def nominal(self) -> Receptance:
        return self.of(self.part.believed, np.arange(self.omega.size))

    def of(self, candidate: Candidate, places: Places) -> Receptance:
        holder = self.holder
        if holder is not None and places.size < self.omega.size:
            holder = Receptance(holder.omega[places], holder.values[places], holder.rows, holder.cols)
        return self.respond(candidate, holder, self.omega[places])


@dataclass(frozen=True)
class _Responses:
    """How the responses of all parts vary."""

    parts: tuple[_PartResponse, ...]

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


def _at_flange(candidate: Candidate, _holder: Receptance | None, omega: FloatArray) -> Receptance:
    return candidate.flange.receptance(omega)


def _at_ends(candidate: Candidate, holder: Receptance | None, omega: FloatArray) -> Receptance:
    assert holder is not None
    return couple(holder, candidate.flange.receptance(omega), candidate.joint)


def _values(part: _PartResponse, places: Places, candidate: Candidate) -> ComplexArray:
    return part.of(candidate, places).values


def in_plane(holder: Receptance, axis: Dof) -> Receptance:
    """Return a tool-holder's receptance in the bending plane of an axis; it is the same in all of them."""
    rows = tuple(Coordinate(c.point, _SLOPES[axis] if c.dof.is_slope else axis) for c in holder.rows)
    return holder if rows == holder.rows else Receptance(holder.omega, holder.values, rows, rows)


def in_planes(holder: Receptance, part: FlangePart) -> Receptance:
    """Return a tool-holder's receptance in all bending planes of a part, which it does not couple."""
    blocks = [in_plane(holder, c.dof) for c in part.coordinates if not c.dof.is_slope]
    return blocks[0] if len(blocks) == 1 else Receptance.block_diagonal(blocks)


def _assembly(tooling: Tooling | ToolAssembly) -> ToolAssembly:
    return tooling.assembly if isinstance(tooling, Tooling) else tooling


@dataclass(frozen=True, eq=False)
class FlangeMachine(Machine):
    """A machine that is known by its flange's receptance: modes, a measurement, or another structure, taken for exact.

    Parameters
    ----------
    flanges : tuple of Substructure
        Coordinates at ``flange``, those of one substructure feel nothing of another's.
    known : (float, float) [rad/s]
        Lowest and highest frequency at which the flange is known.
    joint : LumpedJoint or None
        None where the flange holds the joint's compliance, as one that was decoupled from clamped tool-holders does.
    name : str
    ends : bool
        Whether nothing at all is known beyond `known`, as of a measurement.

    Examples
    --------
    >>> from rcsa_ident.dynamics.modal import normal_modes
    >>> from rcsa_ident.dynamics.coordinates import plane
    >>> modes = normal_modes([6000.0], [0.05], [[0.2, 0.1]], plane("flange"))
    >>> machine = FlangeMachine((modes,), (600.0, 30_000.0), LumpedJoint(3e9, 6e6))
    >>> machine.receptance([1000.0]).values.shape
    (1, 2, 2)
    """

    flanges: tuple[Substructure, ...]
    known: tuple[float, float]
    joint: LumpedJoint | None = None
    name: str = "flange"
    ends: bool = False

    def __post_init__(self) -> None:
        if not self.flanges or not 0.0 <= self.known[0] < self.known[1]:
            raise InputError("flange", f"{len(self.flanges)} from {self.known[0]:g} to {self.known[1]:g} rad/s", "one or more, in a band")

    @cached_property
    def parts(self) -> tuple[FlangePart, ...]:
        """Bending planes, or both together where they feel each other."""
        found = []
        for flange in self.flanges:
            look = flange.receptance(frozen(np.linspace(*self.known, 5)))
            for group in independent_parts(look):
                own = flange if group == look.rows else _Group(flange, group)
                found.append(FlangePart(group, Candidate(own, self.joint)))
        return tuple(found)

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency at which the flange is known [rad/s]."""
        return self.known

    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return frequencies [rad/s] 1 Hz apart; of a measurement between its first and last one, whatever is asked for beyond."""
        if not self.ends:
            return super().lines(beyond)
        low, high = (w / (2.0 * np.pi) for w in self.known)
        inner = np.arange(np.ceil(low / STEP + 1e-9), np.floor(high / STEP - 1e-9) + 0.5) * STEP
        return 2.0 * np.pi * np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]])


@dataclass(frozen=True, eq=False)
class _Group:
    """Some of a flange's directions, which feel nothing of the others."""

    flange: Substructure
    coordinates: tuple[Coordinate, ...]

    def receptance(self, omega: FloatArray) -> Receptance:
        return self.flange.receptance(omega).block(self.coordinates)
