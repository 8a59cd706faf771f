"""What drawings do not tell of toolings: unknowns with spreads that toolings of the same model share, and what is known of them later."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.tool_holder.alteration import ALTERATIONS, Alteration, altered, fluted_segments
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.spread import Spread

_STIFFNESSES = ("translational_stiffness", "rotational_stiffness")
_DAMPINGS = ("translational_damping", "rotational_damping")
#: Scatter of another clamping than the one that told of a contact: that one's is in what it told.
_ANOTHER = float(np.sqrt(2.0))


class Drawing(NamedTuple):
    """A tooling as drawn, and how well that is known. `tool_model`, `holder_model`: empty where nothing is shared."""

    assembly: ToolAssembly
    spread: Spread
    tool_model: str = ""
    holder_model: str = ""


class RoughUnknown(NamedTuple):
    """One number that a drawing does not tell.

    `field`: of `Alteration`
    `owner`: name of the tooling, or of the model of tool or holder, that it belongs to
    `kind`: ``tooling``, ``tool`` or ``holder``: what the owner is
    """

    field: str
    owner: str
    kind: str


@dataclass(frozen=True, slots=True, eq=False)
class RoughToolings:
    """Unknowns of several toolings.

    `unknowns`: tuple of RoughUnknown, length u
    `spread`, shape (u,): standard deviations before any cut: of logarithms, or [m]
    `weights`, shape (t, 9, u): which unknowns add up to each field of each tooling's alteration
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


@dataclass(frozen=True, slots=True, eq=False)
class KnownToolings:
    """What cuts, taps or rings have told of toolings.

    `unknowns`: tuple of RoughUnknown, length u
    `spread`, shape (u,): standard deviations before
    `mean`, shape (u,): what they are believed to be, in units of their spreads
    `covariance`, shape (u, u): in the same units
    `toolings`: that have told it
    """

    unknowns: tuple[RoughUnknown, ...]
    spread: FloatArray
    mean: FloatArray
    covariance: FloatArray
    toolings: tuple[str, ...]

    def __post_init__(self) -> None:
        count = len(self.unknowns)
        for name, shape in (("spread", (count,)), ("mean", (count,)), ("covariance", (count, count))):
            object.__setattr__(self, name, frozen(getattr(self, name)))
            if getattr(self, name).shape != shape:
                raise InputError(f"toolings.{name}", getattr(self, name).shape, f"shape {shape} for {count} unknowns")

    @property
    def deviation(self) -> FloatArray:
        """Standard deviations now, in units of those before, shape (u,)."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True, slots=True, eq=False)
class FittedDrawing:
    """A tooling as it is believed to be, and how it may differ.

    `assembly`: with the most probable values of what its drawing does not tell
    `ends`: tuple of (ToolAssembly, ToolAssembly), length k + n; one standard deviation ahead and behind along each unknown: first those of
        which something is known, then its own
    `fields`: tuple of str, length k + n; of `Alteration`, that they belong to
    `known`: array of int, shape (k,); which of `KnownToolings` the first ones are
    `deviation`, shape (k,): their standard deviations in the units of `KnownToolings`
    """

    assembly: ToolAssembly
    ends: tuple[tuple[ToolAssembly, ToolAssembly], ...] = ()
    fields: tuple[str, ...] = ()
    known: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    deviation: FloatArray = field(default_factory=lambda: np.zeros(0))


def rough_toolings(drawings: Mapping[str, Drawing], known: KnownToolings | None = None) -> RoughToolings | None:
    """Return what is unknown of several toolings, None where all are exact.

    Tools of one model share fluted part and modulus, holders of one model their contact and diameter. A contact differs a little
    in each clamping beside what its model shares.

    `drawings`: mapping of tooling to Drawing, None of them told of `known`
    `known`: what others have told of the same models
    """
    sharing = [d.holder_model for d in drawings.values() if d.holder_model]
    told = set() if known is None else {unknown.owner for unknown in known.unknowns if unknown.kind == "holder"}

    def reclamped(drawing: Drawing) -> float | None:
        if drawing.holder_model in told:
            return _ANOTHER
        return 1.0 if sharing.count(drawing.holder_model) > 1 else None

    members = [_unknowns_of(name, each, reclamped(each)) for name, each in drawings.items()]
    spreads: dict[RoughUnknown, float] = {}
    for own in members:
        for unknown, size in own.items():
            # models whose files disagree are known as well as the best of them says
            spreads[unknown] = min(spreads.get(unknown, np.inf), size)
    if not spreads:
        return None
    place = {unknown: k for k, unknown in enumerate(spreads)}
    weights = np.zeros((len(drawings), len(ALTERATIONS), len(spreads)))
    for t, own in enumerate(members):
        for unknown in own:
            weights[t, ALTERATIONS.index(unknown.field), place[unknown]] = 1.0
    return RoughToolings(tuple(spreads), np.array(list(spreads.values())), weights)


def fitted(name: str, drawing: Drawing, known: KnownToolings | None = None) -> FittedDrawing:
    """Return a tooling as it is believed to be: by what is known of it or of its models, else as drawn."""
    if drawing.spread.exact:
        return FittedDrawing(drawing.assembly)
    told = {} if known is None else {unknown: k for k, unknown in enumerate(known.unknowns)}
    owners = owners_of(name, drawing)
    of_holder = any((unknown.owner, unknown.kind) == (drawing.holder_model, "holder") for unknown in told)
    # another clamping than those that told of the contact: theirs is in what they told, its own comes on top
    elsewhere = known is not None and name not in known.toolings
    wanted = _unknowns_of(name, drawing, _ANOTHER if of_holder and elsewhere else None)
    values = dict.fromkeys(ALTERATIONS, 0.0)
    first, own = [], []
    for unknown in dict.fromkeys((*wanted, *(each for each in told if (each.owner, each.kind) in owners))):
        if unknown in told:
            assert known is not None
            k = told[unknown]
            values[unknown.field] += float(known.spread[k] * known.mean[k])
            first.append((unknown.field, float(known.spread[k] * known.deviation[k]), k))
        else:
            own.append((unknown.field, wanted[unknown]))
    by = Alteration(**values)

    def end(field: str, step: float) -> ToolAssembly:
        return altered(drawing.assembly, replace(by, **{field: getattr(by, field) + step}))

    places = np.array([k for _, _, k in first], dtype=np.intp)
    deviation = np.zeros(0) if known is None else known.deviation[places]
    steps = [*((field, size) for field, size, _ in first), *own]
    ends = tuple((end(field, size), end(field, -size)) for field, size in steps)
    return FittedDrawing(
        altered(drawing.assembly, by), ends, tuple(field for field, _ in steps), frozen(places, np.intp), frozen(deviation)
    )


def owners_of(name: str, drawing: Drawing) -> set[tuple[str, str]]:
    """Return name and kind of everything that the unknowns of a tooling may belong to."""
    return {(name, "tooling"), (drawing.tool_model, "tool"), (drawing.holder_model, "holder")}


def _unknowns_of(name: str, drawing: Drawing, reclamped: float | None) -> dict[RoughUnknown, float]:
    """What is unknown of a tooling, with its spread.

    `reclamped`: factor on the scatter of its own clamping, which comes on top of what its holder's model shares; None where nothing is
        shared, and one unknown holds both
    """
    spread, assembly = drawing.spread, drawing.assembly
    tool = (drawing.tool_model, "tool") if drawing.tool_model else (name, "tooling")
    holder = (drawing.holder_model, "holder") if drawing.holder_model else (name, "tooling")
    found = {RoughUnknown("stickout", name, "tooling"): spread.stickout}
    if fluted_segments(assembly.tool):
        found[RoughUnknown("fluted_length", *tool)] = spread.segment_length
        found[RoughUnknown("fluted_diameter", *tool)] = spread.fluted_diameter
    found[RoughUnknown("youngs_modulus", *tool)] = spread.youngs_modulus
    found[RoughUnknown("holder_diameter", *holder)] = spread.holder_diameter
    if assembly.contact is not None and assembly.insertion > 0.0:
        for each in _STIFFNESSES:
            if reclamped is None:
                found[RoughUnknown(each, *holder)] = float(np.hypot(spread.contact_stiffness, spread.reclamping))
            else:
                found[RoughUnknown(each, *holder)] = spread.contact_stiffness
                found[RoughUnknown(each, name, "tooling")] = float(reclamped * spread.reclamping)
        # a contact that damps nothing damps nothing by any factor
        found |= {RoughUnknown(each, *holder): spread.contact_damping for each in _DAMPINGS if getattr(assembly.contact, each) > 0.0}
    return {unknown: size for unknown, size in found.items() if size > 0.0}
