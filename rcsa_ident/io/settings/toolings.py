"""TOOLING.toml, written: what `rcsa_ident.io.settings.setups` reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rcsa_ident.io.files import write_text
from rcsa_ident.io.settings.cutters import cutter_keys
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.setup.fields import CONTACT, MATERIAL, SEGMENT, SPREAD, keys_told
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.catalogue import CatalogueHolder, TypicalContact
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Material
from rcsa_ident.tool_holder.spread import Spread

#: As files have it: the end in front of the bore.
_SEGMENT = (*SEGMENT[:2], SEGMENT[3], SEGMENT[2], *SEGMENT[4:])
CONTACT_SPREADS = ("contact_stiffness_percent", "contact_damping_percent")


def write_tooling(path: str | Path, tooling: Tooling) -> None:
    """Write a tooling's file."""
    write_text(path, tooling_text(tooling_keys(tooling)))


def tooling_keys(tooling: Tooling) -> dict[str, Any]:
    """Return a tooling as its file holds it, in the machinist's units."""
    assembly = tooling.assembly
    materials = dict(MATERIALS)
    for segment in (*tooling.whole_tool, *assembly.holder):
        if segment.material not in materials.values():
            materials[f"material {len(materials) - len(MATERIALS) + 1}"] = segment.material
    names = {material: name for name, material in materials.items()}
    data: dict[str, Any] = {
        "name": tooling.name,
        "cutter": cutter_keys(tooling.cutter),
        "tool": {"stickout_mm": 1e3 * assembly.stickout, "segments": [_segment(s, names) for s in _joined(tooling)]},
        "holder": {"insertion_mm": 1e3 * assembly.insertion, "segments": [_segment(s, names) for s in assembly.holder]},
    }
    if assembly.contact is not None:
        data["contact"] = keys_told(CONTACT, assembly.contact)
    for part, model in (("tool", tooling.tool_model), ("holder", tooling.holder_model)):
        if model:
            data[part]["model"] = model
    if tooling.taper:
        data["holder"]["taper"] = tooling.taper
    if tooling.spread.stated:
        data["spread"] = keys_told(SPREAD, tooling.spread)
    own = {name: material for name, material in materials.items() if name not in MATERIALS}
    return data | ({"materials": {name: keys_told(MATERIAL, material) for name, material in own.items()}} if own else {})


def _joined(tooling: Tooling) -> list[BeamSegment]:
    """The whole tool's segments, that which the insertion ends in as one again."""
    *front, last = tooling.assembly.tool
    if not tooling.tool_behind:
        return [*front, last]
    first, *rear = tooling.tool_behind
    slope = (last.end - last.diameter) / last.length
    same = replace(first, length=1.0, diameter=1.0, end_diameter=None) == replace(last, length=1.0, diameter=1.0, end_diameter=None)
    goes_on = abs(last.end - first.diameter) < 1e-9 and abs((first.end - first.diameter) / first.length - slope) < 1e-9
    if not (same and goes_on):
        return [*front, last, first, *rear]
    return [*front, replace(last, length=last.length + first.length, end_diameter=None if last.end_diameter is None else first.end), *rear]


def holder_keys(holder: CatalogueHolder) -> dict[str, Any]:
    """Return a holder of the catalogue as `holder` of a tooling file, in millimetres."""
    names = {material: name for name, material in MATERIALS.items()}
    return {"insertion_mm": 1e3 * holder.insertion, "segments": [_segment(s, names) for s in holder.segments]}


def contact_spread_keys(spread: Spread) -> dict[str, float]:
    """Return what `spread` of a tooling file states of the contact alone, so that the rest counts as drawings usually do."""
    # a share and back leaves a last digit that nobody stated
    return {key: round(keys_told(SPREAD, spread)[key], 9) for key in CONTACT_SPREADS}


def typical_contact_keys(typical: TypicalContact | None) -> dict[str, Any] | None:
    """Return what the catalogue knows of a contact as commands and service tell it: its keys, spreads in percent, source."""
    if typical is None:
        return None
    return {
        "kind": typical.kind,
        "keys": keys_told(CONTACT, typical.contact),
        "stiffness_spread_percent": 100.0 * typical.stiffness_spread,
        "damping_spread_percent": 100.0 * typical.damping_spread,
        "source": typical.source,
    }


def tooling_text(data: Mapping[str, Any], notes: Sequence[str] = ()) -> str:
    """Return the text of a tooling file of its keys, or of those parts of one that are there. `notes`: remarks in front of it."""
    # metres and back leave a last digit that nobody wrote
    return toml_of(data, notes, digits=12)


def _segment(segment: BeamSegment, names: Mapping[Material, str]) -> dict[str, Any]:
    return keys_told(_SEGMENT, segment, usual=False) | {"material": names[segment.material]}
