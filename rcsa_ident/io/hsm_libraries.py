"""Tool libraries of HSMWorks, ``.hsmlib``: XML, whose tools become entries as the JSON of Fusion 360 and HSM has them."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from rcsa_ident.errors import InputError

#: Attributes of a tool's body by the figures of an entry's geometry.
_BODY = {
    "diameter": "DC", "number-of-flutes": "NOF", "flute-length": "LCF", "overall-length": "OAL", "body-length": "LB",
    "shaft-diameter": "SFDM", "corner-radius": "RE", "taper-angle": "TA", "tip-diameter": "tip-diameter", "tip-length": "tip-length",
    "shoulder-length": "shoulder-length", "shoulder-diameter": "shoulder-diameter", "flute-angle": "FHA",
}  # fmt: skip
_MOTION = {"spindle-rpm": "n", "cutting-feedrate": "v_f"}


def hsm_entries(raw: bytes, where: str) -> list[dict[str, Any]]:
    """Return the tools of a library; holders are left out, since the file does not say which end of a section its diameter belongs to.

    Parameters
    ----------
    raw : bytes
    where : str
        The file, for the messages.

    Raises
    ------
    InputError
        The file is no XML, or declares entities, which may stand for any size.
    """
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("tool library", "bytes that are not text", "XML in UTF-8", where) from None
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
    motion = parts["motion"].attrib if "motion" in parts else {}
    preset = {name: motion[key] for key, name in _MOTION.items() if key in motion}
    if preset:
        entry["start-values"] = {"presets": [preset | {"name": "of the library"}]}
    return entry
