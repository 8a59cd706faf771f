"""By how much a tool-holder differs from its drawing, in the few numbers that a drawing does not tell."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import exp

from rcsa_ident.tool_holder.geometry import BeamSegment, Contact, ToolAssembly


@dataclass(frozen=True, slots=True)
class Alteration:
    """Differences from a drawing: lengths, and logarithms of ratios.

    `stickout` [m]: the tool stands further out of its holder; its insertion stays
    `fluted_length` [m]: length of the fluted part, the tool's whole length staying
    `fluted_diameter` [-]: equivalent diameter of the fluted part; a told area goes with its square and a told second moment with its fourth
        power
    `youngs_modulus` [-]: of the tool
    `translational_stiffness`, `rotational_stiffness`, `translational_damping`, `rotational_damping` [-]: of the contact between tool and
        holder
    `holder_diameter` [-]: outer diameters of the holder

    Examples
    --------
    >>> from rcsa_ident.tool_holder.geometry import MATERIALS
    >>> carbide, steel = MATERIALS["carbide"], MATERIALS["steel"]
    >>> tool = (BeamSegment(0.030, 0.0096, carbide), BeamSegment(0.070, 0.012, carbide))
    >>> drawn = ToolAssembly(tool, (BeamSegment(0.060, 0.050, steel, inner_diameter=0.012),), insertion=0.040)
    >>> round(altered(drawn, Alteration(stickout=1e-3)).stickout, 6)
    0.061
    """

    stickout: float = 0.0
    fluted_length: float = 0.0
    fluted_diameter: float = 0.0
    youngs_modulus: float = 0.0
    translational_stiffness: float = 0.0
    rotational_stiffness: float = 0.0
    translational_damping: float = 0.0
    rotational_damping: float = 0.0
    holder_diameter: float = 0.0


ALTERATIONS = tuple(each.name for each in fields(Alteration))
_CONTACT = ("translational_stiffness", "rotational_stiffness", "translational_damping", "rotational_damping")


def fluted_segments(tool: tuple[BeamSegment, ...]) -> int:
    """Return how many segments from the tip are the fluted part: all in front of the last one, the shank."""
    return len(tool) - 1


def altered(assembly: ToolAssembly, by: Alteration) -> ToolAssembly:
    """Return a tool-holder that differs from its drawing. Raises `InputError` if nothing would be left of a segment."""
    flutes = fluted_segments(assembly.tool)
    tool = [_wider(segment, by.fluted_diameter) if i < flutes else segment for i, segment in enumerate(assembly.tool)]
    tool = [replace(s, material=replace(s.material, youngs_modulus=s.material.youngs_modulus * exp(by.youngs_modulus))) for s in tool]
    if flutes:
        tool[flutes - 1] = replace(tool[flutes - 1], length=tool[flutes - 1].length + by.fluted_length)
    tool[-1] = replace(tool[-1], length=tool[-1].length + by.stickout - (by.fluted_length if flutes else 0.0))
    holder = tuple(_wider(segment, by.holder_diameter) for segment in assembly.holder)
    contact = assembly.contact
    if contact is not None:
        contact = Contact(**{name: getattr(contact, name) * exp(getattr(by, name)) for name in _CONTACT})
    return ToolAssembly(tuple(tool), holder, assembly.insertion, contact)


def _wider(segment: BeamSegment, log_ratio: float) -> BeamSegment:
    """A segment whose outer diameters, or the section that is told in their place, are larger by a ratio."""
    ratio = exp(log_ratio)
    return replace(
        segment,
        diameter=segment.diameter * ratio,
        end_diameter=None if segment.end_diameter is None else segment.end_diameter * ratio,
        area=None if segment.area is None else segment.area * ratio**2,
        second_moment=None if segment.second_moment is None else segment.second_moment * ratio**4,
    )
