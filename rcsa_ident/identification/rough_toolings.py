"""What drawings do not tell of the toolings of a campaign, as unknowns with priors that toolings of the same model share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.tool_holder.alteration import ALTERATIONS, Alteration, fluted_segments
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.rough import RoughToolHolder
from rcsa_ident.tool_holder.spread import Spread

_STIFFNESSES = ("translational_stiffness", "rotational_stiffness")
_DAMPINGS = ("translational_damping", "rotational_damping")


class Drawing(NamedTuple):
    """A tooling as drawn, and how well that is known.

    Parameters
    ----------
    assembly : ToolAssembly
    spread : Spread
    tool_model, holder_model : str
        Empty where nothing is shared.
    """

    assembly: ToolAssembly
    spread: Spread
    tool_model: str = ""
    holder_model: str = ""


class RoughUnknown(NamedTuple):
    """One number that a drawing does not tell.

    Parameters
    ----------
    field : str
        Of `Alteration`.
    owner : str
        Name of the tooling, or of the model of tool or holder, that it belongs to.
    kind : str
        ``tooling``, ``tool`` or ``holder``: what the owner is.
    """

    field: str
    owner: str
    kind: str


@dataclass(frozen=True, slots=True, eq=False)
class RoughToolings:
    """Unknowns of several toolings.

    Parameters
    ----------
    unknowns : tuple of RoughUnknown, length u
    spread : array, shape (u,)
        Standard deviations before any cut: of logarithms, or [m].
    weights : array, shape (t, 9, u)
        Which unknowns add up to each field of each tooling's alteration.
    """

    unknowns: tuple[RoughUnknown, ...]
    spread: FloatArray
    weights: FloatArray

    def alteration(self, tooling: int, values: FloatArray) -> Alteration:
        """Return how a tooling differs from its drawing; `values` of shape (u,), in units of their spreads."""
        return Alteration(*(self.weights[tooling] @ (self.spread * values)).tolist())

    def fields_of(self, tooling: int) -> tuple[str, ...]:
        """Return the fields of a tooling's alteration that are unknown."""
        return tuple(name for name, row in zip(ALTERATIONS, self.weights[tooling], strict=True) if np.any(row))


def rough_toolings(drawings: Mapping[str, Drawing]) -> RoughToolings | None:
    """Return what is unknown of several toolings, None where all are exact.

    Tools of one model share fluted part and modulus, holders of one model their contact and diameter. A contact differs a little
    in each clamping beside what its model shares.

    Parameters
    ----------
    drawings : mapping of tooling to Drawing
    """
    spreads: dict[RoughUnknown, float] = {}
    members: list[list[tuple[str, RoughUnknown]]] = []
    sharing = [d.holder_model for d in drawings.values() if d.holder_model]
    for name, drawing in drawings.items():
        spread, own = drawing.spread, list[tuple[str, RoughUnknown]]()
        tool = (drawing.tool_model, "tool") if drawing.tool_model else (name, "tooling")
        holder = (drawing.holder_model, "holder") if drawing.holder_model else (name, "tooling")
        wanted: list[tuple[str, tuple[str, str], float]] = [("stickout", (name, "tooling"), spread.stickout)]
        if fluted_segments(drawing.assembly.tool):
            wanted += [("fluted_length", tool, spread.segment_length), ("fluted_diameter", tool, spread.fluted_diameter)]
        wanted += [("youngs_modulus", tool, spread.youngs_modulus), ("holder_diameter", holder, spread.holder_diameter)]
        if drawing.assembly.contact is not None and drawing.assembly.insertion > 0.0:
            shared = sharing.count(drawing.holder_model) > 1
            for each in _STIFFNESSES:
                again = spread.reclamping
                if shared:
                    wanted += [(each, holder, spread.contact_stiffness), (each, (name, "tooling"), again)]
                else:
                    wanted.append((each, holder, float(np.hypot(spread.contact_stiffness, again))))
            contact = drawing.assembly.contact
            wanted += [(each, holder, spread.contact_damping) for each in _DAMPINGS if getattr(contact, each) > 0.0]
        for field, (owner, kind), size in wanted:
            if size > 0.0:
                unknown = RoughUnknown(field, owner, kind)
                # models whose files disagree are known as well as the best of them says
                spreads[unknown] = min(spreads.get(unknown, np.inf), size)
                own.append((field, unknown))
        members.append(own)
    if not spreads:
        return None
    place = {unknown: k for k, unknown in enumerate(spreads)}
    weights = np.zeros((len(drawings), len(ALTERATIONS), len(spreads)))
    for t, own in enumerate(members):
        for field, unknown in own:
            weights[t, ALTERATIONS.index(field), place[unknown]] = 1.0
    return RoughToolings(tuple(spreads), np.array(list(spreads.values())), weights)


class ToolingAt(NamedTuple):
    """A rough tooling at the points of one axis that it cut.

    Parameters
    ----------
    points : array of int, shape (k,)
    values : complex array, shape (k, 5) [m/N]
        Flange tt, tr, rr, flange over tip t, r, scaled by the lever.
    slopes : complex array, shape (k, 5, m), or (0, 5, m) where nobody asked
        Their change with each of its unknowns.
    unknowns : array of int, shape (m,)
        Where these stand among the coefficients.
    """

    points: np.ndarray
    values: ComplexArray
    slopes: ComplexArray
    unknowns: np.ndarray


class _Asked(NamedTuple):
    """What never changes about a rough tooling's lines: fields and how they change with its unknowns, frequencies and who asks for them."""

    tooling: int
    holder: RoughToolHolder
    fields: tuple[str, ...]
    rows: FloatArray
    members: np.ndarray
    omega: FloatArray
    points: list[np.ndarray]
    places: list[np.ndarray]


class RoughLines:
    """Tool-holders at the lines of all axes, as functions of what their drawings do not tell.

    Parameters
    ----------
    toolings : RoughToolings
    holders : sequence of RoughToolHolder
        One for each tooling.
    points : sequence of (array, array)
        Of each axis: frequency [rad/s] and number of the tooling at each point.
    lever : float [m]
    first : int
        Where their unknowns begin among the coefficients.
    """

    def __init__(
        self,
        toolings: RoughToolings,
        holders: Sequence[RoughToolHolder],
        points: Sequence[tuple[FloatArray, np.ndarray]],
        lever: float,
        first: int,
    ) -> None:
        self.toolings, self._lever, self._first = toolings, lever, first
        self._axes = len(points)
        self._asked = []
        for t, holder in enumerate(holders):
            own = [np.flatnonzero(tooling == t) for _, tooling in points]
            asked = [w[k] for (w, _), k in zip(points, own, strict=True)]
            omega = np.unique(np.concatenate(asked))
            fields = toolings.fields_of(t)
            if not fields or not omega.size:
                continue
            rows = toolings.weights[t, [ALTERATIONS.index(f) for f in fields]] * toolings.spread
            members = np.flatnonzero(np.any(rows, axis=0))
            places = [np.searchsorted(omega, w) for w in asked]
            self._asked.append(_Asked(t, holder, fields, rows[:, members], members, omega, own, places))

    def at(self, values: FloatArray, slopes: bool) -> list[list[ToolingAt]]:
        """Return each axis' rough toolings.

        Parameters
        ----------
        values : array, shape (u,)
            The unknowns, in units of their spreads.
        slopes : bool
        """
        found: list[list[ToolingAt]] = [[] for _ in range(self._axes)]
        for each in self._asked:
            by = self.toolings.alteration(each.tooling, values)
            receptances, changes = each.holder.receptances(by, each.omega, self._lever, each.fields if slopes else ())
            # from fields to the unknowns that add up to them
            turned = changes @ each.rows if slopes else np.empty((0, receptances.shape[1], each.members.size), dtype=complex)
            for axis, points, place in zip(found, each.points, each.places, strict=True):
                axis.append(ToolingAt(points, receptances[place], turned[place] if slopes else turned, self._first + each.members))
        return found
