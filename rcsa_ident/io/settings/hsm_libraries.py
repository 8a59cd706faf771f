"""Tool libraries of HSMWorks, Inventor CAM and Fusion 360, ``.hsmlib``: XML, whose tools become entries as the JSON of these has them.

Nobody publishes a specification: what is read here is what public files and readers of others show. The programs write UTF-16, other tools
UTF-8. Sections of a holder run from the tool's side up; each leads from the diameter before it to its own, one without length is a step.
"""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from rcsa_ident.base.errors import InputError

#: Attributes of a tool's body by the figures of an entry's geometry.
_BODY = {
    "diameter": "DC", "number-of-flutes": "NOF", "flute-length": "LCF", "overall-length": "OAL", "body-length": "LB",
    "shaft-diameter": "SFDM", "corner-radius": "RE", "taper-angle": "TA", "tip-diameter": "tip-diameter", "tip-length": "tip-length",
    "shoulder-length": "shoulder-length", "shoulder-diameter": "shoulder-diameter",
}  # fmt: skip
_MOTION = {"spindle-rpm": "n", "cutting-feedrate": "v_f"}
#: Parameters of a preset, which newer files have in the place of one motion.
_PRESET = {"tool_spindleSpeed": "n", "tool_feedCutting": "v_f"}
_PER_REVOLUTION = "per-revolution"
_UTF16 = (b"\xff\xfe", b"\xfe\xff")


def is_xml(raw: bytes) -> bool:
    """Return whether bytes may be such a library."""
    return raw.startswith(_UTF16) or raw[:200].removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")


def hsm_entries(raw: bytes, where: str) -> list[dict[str, Any]]:
    """Return the tools of a library.

    `where`: the file, for the messages
    Raises `InputError`: the file is no XML, or declares entities, which may stand for any size.
    """
    try:
        text = raw.decode("utf-16" if raw.startswith(_UTF16) else "utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("tool library", "bytes that are not text", "XML in UTF-16 or UTF-8", where) from None
    # with zeros between its signs a declaration would not be found
    if "\0" in text or "<!doctype" in text.lower() or "<!entity" in text.lower():
        raise InputError("tool library", "a document type, or binary data", "XML without declarations of its own", where)
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError("tool library", f"XML that cannot be read ({error})", "a complete .hsmlib file", where) from None
    return [_entry(tool) for tool in root.iter() if _tag(tool) == "tool"]


def _tag(element: ElementTree.Element) -> str:
    """A tag without its namespace."""
    return element.tag.rpartition("}")[2]


def _entry(tool: ElementTree.Element) -> dict[str, Any]:
    parts = {_tag(part): part for part in tool}
    entry: dict[str, Any] = {key: tool.get(key, "") for key in ("type", "unit", "guid") if tool.get(key)}
    entry |= {key: (parts[key].text or "").strip() for key in ("description", "product-id") if key in parts}
    if "material" in parts:
        entry["BMC"] = parts["material"].get("name", "")
    body = parts["body"].attrib if "body" in parts else {}
    entry["geometry"] = {name: body[key] for key, name in _BODY.items() if key in body}
    entry |= {
        key: {"description": parts[key].get("description", ""), "segments": _cones(parts[key])}
        for key in ("holder", "shaft")
        if key in parts
    }
    motion = parts["motion"].attrib if "motion" in parts else {}
    told = {name: motion[key] for key, name in _MOTION.items() if key in motion and motion.get("feed-mode") != _PER_REVOLUTION}
    presets = [{"name": each.get("name", ""), **_parameters(each)} for each in parts.get("presets", ()) if _tag(each) == "preset"]
    entry["start-values"] = {"presets": [*([told | {"name": "of the library"}] if told else []), *presets]}
    return entry


def _cones(part: ElementTree.Element) -> list[dict[str, str]]:
    sections = [(each.get("diameter", ""), each.get("length", "")) for each in part if _tag(each) == "section"]
    before = [sections[0][0] if sections else "", *(diameter for diameter, _ in sections)]
    return [
        {"height": length, "lower-diameter": lower, "upper-diameter": upper}
        for lower, (upper, length) in zip(before, sections, strict=False)
    ]


def _parameters(preset: ElementTree.Element) -> dict[str, str]:
    told = {each.get("key", ""): each.get("value", "") for each in preset if _tag(each) == "parameter"}
    return {name: told[key] for key, name in _PRESET.items() if key in told}
