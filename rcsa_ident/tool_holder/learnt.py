"""What was believed of toolings before their cuts, and what after, in the terms of their drawings."""

from __future__ import annotations

from collections.abc import Mapping
from math import exp
from typing import NamedTuple

import numpy as np

from rcsa_ident.tool_holder.alteration import ALTERATIONS, fluted_segments
from rcsa_ident.tool_holder.drawings import Drawing, KnownToolings, owners_of
from rcsa_ident.tool_holder.geometry import ToolAssembly

#: Deviation over spread from which on a number was hardly taught by the cuts.
HARDLY = 0.8
#: Words and SI unit of each field of an `Alteration`.
TERMS = {
    "stickout": ("stickout", "m"),
    "fluted_length": ("fluted length", "m"),
    "fluted_diameter": ("fluted diameter", "m"),
    "youngs_modulus": ("modulus of the tool", "Pa"),
    "translational_stiffness": ("contact stiffness, translational, per metre", "N/m²"),
    "rotational_stiffness": ("contact stiffness, rotational, per metre", "N"),
    "translational_damping": ("contact damping, translational, per metre", "N s/m²"),
    "rotational_damping": ("contact damping, rotational, per metre", "N s"),
    "holder_diameter": ("diameter of the holder's nose", "m"),
}
#: Fields that are lengths to be added; the others are logarithms of ratios.
_ADDED = ("stickout", "fluted_length")


class LearnedValue(NamedTuple):
    """One number of a drawing before and after the cuts.

    `field`: of `Alteration`
    `toolings`: that share it
    `drawn`, `spread`: what the drawing says, and its standard deviation
    `found`, `deviation`: what is believed now, and its standard deviation
    """

    field: str
    toolings: tuple[str, ...]
    drawn: float
    spread: float
    found: float
    deviation: float

    @property
    def words(self) -> str:
        """What it is."""
        return TERMS[self.field][0]

    @property
    def unit(self) -> str:
        """SI unit of its numbers."""
        return TERMS[self.field][1]

    @property
    def hardly(self) -> bool:
        """Whether the cuts hardly taught it."""
        share = 1.0 if self.field in _ADDED else self.found / self.drawn
        return self.deviation > HARDLY * self.spread * share


def learned(known: KnownToolings, drawings: Mapping[str, Drawing]) -> tuple[LearnedValue, ...]:
    """Return what the cuts taught, number by number; toolings whose models share all of a number share a row.

    `drawings`: mapping of tooling to Drawing, those that cut; others are left aside
    """
    place = {unknown: k for k, unknown in enumerate(known.unknowns)}
    rows: dict[tuple[str, tuple[int, ...], float], list[str]] = {}
    for name in (name for name in known.toolings if name in drawings):
        drawing = drawings[name]
        own = [unknown for unknown in place if (unknown.owner, unknown.kind) in owners_of(name, drawing)]
        for field in ALTERATIONS:
            which = tuple(place[unknown] for unknown in own if unknown.field == field)
            if which:
                rows.setdefault((field, which, drawn_value(drawing.assembly, field)), []).append(name)
    return tuple(_value(known, field, which, drawn, tuple(names)) for (field, which, drawn), names in rows.items())


def _value(known: KnownToolings, field: str, which: tuple[int, ...], drawn: float, toolings: tuple[str, ...]) -> LearnedValue:
    places = np.array(which)
    size = known.spread[places]
    # a contact is its model's with what its own clamping adds
    change = float(size @ known.mean[places])
    before, after = float(np.linalg.norm(size)), float(np.sqrt(size @ known.covariance[np.ix_(places, places)] @ size))
    # wider bands do not make less known than was known before
    after = min(after, before)
    if field in _ADDED:
        return LearnedValue(field, toolings, drawn, before, drawn + change, after)
    found = drawn * exp(change)
    return LearnedValue(field, toolings, drawn, drawn * before, found, found * after)


def drawn_value(assembly: ToolAssembly, field: str) -> float:
    """Return the number of a drawing that a field of `Alteration` alters [SI]; of several fluted segments the longest one's diameter."""
    flutes = assembly.tool[: fluted_segments(assembly.tool)]
    if field == "stickout":
        return assembly.stickout
    if field == "fluted_length":
        return sum(segment.length for segment in flutes)
    if field == "fluted_diameter":
        return max(flutes, key=lambda segment: segment.length).diameter
    if field == "youngs_modulus":
        return assembly.tool[-1].material.youngs_modulus
    if field == "holder_diameter":
        return assembly.holder[0].diameter
    return float(getattr(assembly.contact, field))
