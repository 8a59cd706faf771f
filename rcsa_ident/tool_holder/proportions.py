"""Cutter, tool and holder as a whole: do diameters, bores and lengths fit each other?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import (
    CONTACT,
    CONTACT_FREQUENCY,
    CONTACT_LOSS,
    DENSITY,
    LOSS_FACTOR,
    MODULUS,
    SEGMENT_DIAMETER,
    SEGMENT_LENGTH,
    STICKOUT,
    PlausibilityCode,
    Range,
    proportion,
    remarks_of,
)
from rcsa_ident.base.remarks import Remark
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly

#: Each as (usual, possible): the cutter's diameter over the tool's at its tip (a fluted part is written as a thinner cylinder, a disc
#: may be left out), stickout over the thickest part of it, a tool's bore (coolant) and a holder's over their outer diameters, and the
#: holder's bore over the tool in it (an interference fit is written as a smaller bore).
_CUTTER, _SLENDER = ((0.7, 2.2), (0.1, 8.0)), ((0.2, 15.0), (0.02, 100.0))
_COOLANT, _WALL = ((0.0, 0.6), (0.0, 0.95)), ((0.0, 0.9), (0.0, 0.99))
_FIT = ((0.98, 1.15), (0.8, 2.5))
#: The insertion over the tool's diameter there.
_HELD = ((0.4, 15.0), (0.04, 100.0))
#: Share of the cutter's diameter below which a segment is a fluted one.
_FLUTED = 0.95


def proportions(assembly: ToolAssembly, cutter: Cutter) -> tuple[Remark, ...]:
    """Return what is unusual about a cutter, the tool that carries it and its holder, each called as in a file.

    Raises `InputError` if something is impossible.
    """
    found = remarks_of(_values(assembly, cutter))
    found += [each for each in _shapes(assembly, cutter) if each is not None]
    return tuple(found)


def edge_length(assembly: ToolAssembly, cutter: Cutter) -> tuple[float, str]:
    """Return how deep a tool can cut at most, and what ends there: the fluted part where the segments show one, else the stickout [m]."""
    flutes = _flutes(assembly, cutter)
    return (flutes, "fluted part") if 0.0 < flutes < assembly.stickout else (assembly.stickout, "stickout")


def _flutes(assembly: ToolAssembly, cutter: Cutter) -> float:
    """Length of the fluted part [m]: segments in front with a section of their own, or thinner than cutter and shank; 0 without any."""
    shank, length = assembly.tool[-1].end, 0.0
    for segment in assembly.tool[:-1]:
        if segment.area is None and not max(segment.diameter, segment.end) < _FLUTED * min(cutter.diameter, shank):
            break
        length += segment.length
    return length


def _values(assembly: ToolAssembly, cutter: Cutter) -> Iterator[tuple[str, Range, float]]:
    yield from cutter.values
    yield "tool.stickout_mm", STICKOUT, assembly.stickout
    for body, segments in (("tool", assembly.tool), ("holder", assembly.holder)):
        for i, segment in enumerate(segments):
            place = f"{body}.segments[{i}]"
            yield f"{place}.material: youngs_modulus_gpa", MODULUS, segment.material.youngs_modulus
            yield f"{place}.material: density", DENSITY, segment.material.density
            yield f"{place}.material: loss_factor", LOSS_FACTOR, segment.material.loss_factor
            yield f"{place}.length_mm", SEGMENT_LENGTH, segment.length
            yield f"{place}.outer_diameter_mm", SEGMENT_DIAMETER, segment.diameter
            if segment.end_diameter is not None:
                yield f"{place}.end_diameter_mm", SEGMENT_DIAMETER, segment.end_diameter
    if assembly.contact is not None:
        for name, kind in CONTACT.items():
            yield f"contact.{name}", kind, getattr(assembly.contact, name)


def _shapes(assembly: ToolAssembly, cutter: Cutter) -> Iterator[Remark | None]:
    tip = assembly.tool[0].diameter
    words = f"{_mm(cutter.diameter)} on a tool that is {_mm(tip)} thick at its tip"
    yield proportion("cutter.diameter_mm", cutter.diameter / tip, *_CUTTER, words, _times(_CUTTER[0], "that diameter"))
    thick = max(max(s.diameter, s.end) for s, start, _ in _placed(assembly.tool) if start < assembly.stickout)
    words = f"{_mm(assembly.stickout)} of a tool that is {_mm(thick)} thick"
    yield proportion("tool.stickout_mm", assembly.stickout / thick, *_SLENDER, words, _times(_SLENDER[0], "its diameter"))
    for body, segments, limits in (("tool", assembly.tool, _COOLANT), ("holder", assembly.holder, _WALL)):
        for i, segment in enumerate(segments):
            outer = min(segment.diameter, segment.end)
            words = f"{_mm(segment.inner_diameter)} in an outer diameter of {_mm(outer)}"
            wanted = f"a bore of at most {limits[0][1]:g} times the outer diameter (a wall of {_mm(0.5 * (1.0 - limits[0][1]) * outer)})"
            yield proportion(f"{body}.segments[{i}].inner_diameter_mm", segment.inner_diameter / outer, *limits, words, wanted)
    yield from _held(assembly)
    yield from _fits(assembly)
    flutes = _flutes(assembly, cutter)
    if flutes > assembly.stickout + 1e-6:
        words = (
            f"tool.stickout_mm is {_mm(assembly.stickout)}, but the tool's fluted part is {_mm(flutes)} long: it is clamped in the holder"
        )
        yield Remark(PlausibilityCode.PROPORTION, words)


def _held(assembly: ToolAssembly) -> Iterator[Remark | None]:
    """How far the tool is in the holder, and what the contact damps there."""
    contact, depth, thick = assembly.contact, assembly.insertion, assembly.tool[-1].end
    if depth == 0.0:
        if contact is not None:
            allowed = "a length above 0 [mm]: the contact holds the tool per metre of it; of one piece, tool and holder have no [contact]"
            raise InputError("holder.insertion_mm", "0 mm beside a [contact]", allowed)
        return
    words, wanted = f"{_mm(depth)} of a tool that is {_mm(thick)} thick there", _times(_HELD[0], "its diameter")
    yield proportion("holder.insertion_mm", depth / thick, *_HELD, words, wanted)
    for kind, limits in CONTACT_LOSS.items():
        stiffness, damping = (0.0 if contact is None else getattr(contact, f"{kind}_{name}") for name in ("stiffness", "damping"))
        if stiffness == 0.0:
            continue
        loss = damping * CONTACT_FREQUENCY / stiffness
        words = f"{damping:.4g} beside a stiffness of {stiffness:.4g}, a loss factor of {loss:.2g} at 1000 Hz"
        softer = CONTACT[f"{kind}_stiffness"].remark(f"contact.{kind}_stiffness", stiffness)
        wanted = "; ".join([f"a loss factor of at most {limits[0][1]:g}", *([] if softer is None else [softer])])
        yield proportion(f"contact.{kind}_damping", loss, *limits, words, wanted)


def _fits(assembly: ToolAssembly) -> Iterator[Remark | None]:
    """The holder's bore beside the tool in it, once for each of the holder's segments."""
    for i, (segment, start, end) in enumerate(_placed(assembly.holder)):
        inside = [
            _diameter(piece, station - first)
            for piece, first, last in _placed(assembly.tool, -assembly.stickout)
            for station in (max(first, start), min(last, end, assembly.insertion))
            if min(last, end, assembly.insertion) - max(first, start) > 1e-6
        ]
        if not inside:
            continue
        thick, bore, field = max(inside), segment.inner_diameter, f"holder.segments[{i}].inner_diameter_mm"
        if bore == 0.0:
            told = f"{field} is 0, but a tool that is {_mm(thick)} thick is clamped there: tool and holder would fill the same place"
            yield Remark(PlausibilityCode.PROPORTION, told)
            continue
        words = f"{_mm(bore)} around a tool that is {_mm(thick)} thick there"
        wanted = f"a bore of the tool's own diameter, {_mm(thick)}, over the insertion of {_mm(assembly.insertion)}"
        yield proportion(field, bore / thick, *_FIT, words, wanted)


def _placed(segments: tuple[BeamSegment, ...], start: float = 0.0) -> list[tuple[BeamSegment, float, float]]:
    """Segments between their ends [m]."""
    ends = start + np.concatenate([[0.0], np.cumsum([s.length for s in segments])])
    return [(segment, float(first), float(last)) for segment, first, last in zip(segments, ends[:-1], ends[1:], strict=True)]


def _diameter(segment: BeamSegment, at: float) -> float:
    return segment.diameter + (segment.end - segment.diameter) * at / segment.length


def _mm(length: float) -> str:
    return f"{1e3 * length:.5g} mm"


def _times(usual: tuple[float, float], what: str) -> str:
    return f"{usual[0]:g} to {usual[1]:g} times {what}"
