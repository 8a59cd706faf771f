"""Tool libraries of Fusion 360 and HSM become toolings: plain JSON, that JSON in a zip container (.tools), or XML (.hsmlib).

An entry may also hold the properties of ISO 13399 by their names, as makers print them: DC, RE, KAPR, APMX, ZEFP and so on.

A library knows the shape of cutter and holder. What it cannot know is said in the tooling's own notes: how the fluted part
bends, how deep the tool sits, what holds it. Segments of a holder run from the tool's side to the spindle's, as a tooling's do.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.outlines import key_of, missing
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.io.files import MEGABYTE, read_bytes
from rcsa_ident.io.settings.hsm_libraries import hsm_entries, is_xml
from rcsa_ident.io.settings.library_entries import plain_entry, preset_notes
from rcsa_ident.io.settings.library_shapes import NotRead, check_type, iso_geometry, iso_shape_keys, shape_keys
from rcsa_ident.io.settings.setups import tooling_of
from rcsa_ident.io.settings.toolings import contact_spread_keys, tooling_text
from rcsa_ident.io.toml_text import keys_of_toml
from rcsa_ident.io.validated_table import Table, listed
from rcsa_ident.setup.fields import CONTACT, keys_told
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.catalogue import typical_contact
from rcsa_ident.tool_holder.geometry import MATERIALS, Contact
from rcsa_ident.tool_holder.spread import Spread

LARGEST_LIBRARY = 32 * MEGABYTE
MOST_ENTRIES = 20_000
MOST_SEGMENTS = 200
_MOST_FILES = 100
UNITS = {"millimeters": 1.0, "inches": 25.4}
_CUTTER_ALONE = (
    "[cutter] alone, since the library tells no holder: lobes and advice take it with modes or FRFs of its tip; for a model of the tool "
    "add [tool], [holder] and [contact], or name one of the library's holders"
)
#: Of a holder's length and a gauge line: they come from drawings with rounded figures.
_ROUNDING = 0.05
_HOLDER = "holder"
_CARBIDE, _STEEL = "carbide", "steel"
_BODIES = {"carbide": _CARBIDE, "hss": _STEEL, "hssco": _STEEL}


@dataclass(frozen=True, slots=True)
class Assumptions:
    """What a library cannot tell.

    `flute_ratio`: diameter of the solid cylinder that bends as the fluted part, over the cutting diameter
    `helix_deg` [deg]: helix of tools for which the library gives none
    `stickout_mm`, `insertion_mm` [mm]: None takes the library's length below the holder, and what is left of the tool behind it
    `material`: material of the tools; None takes the library's
    `contact`: contact of tool and holder; None assumes the catalogue's
    `spread`: how well that contact is known, where its tooling states it
    `holder`: holder of the library for tools that have none of their own
    """

    flute_ratio: float = 0.8
    helix_deg: float = 30.0
    stickout_mm: float | None = None
    insertion_mm: float | None = None
    material: str | None = None
    contact: Contact | None = None
    spread: Spread | None = None
    holder: str | None = None

    def __post_init__(self) -> None:
        if not 0.3 <= self.flute_ratio <= 1.0:
            raise InputError("flute ratio", self.flute_ratio, "a ratio from 0.3 to 1")
        if not 0.0 <= self.helix_deg <= 80.0:
            raise InputError("helix", self.helix_deg, "an angle from 0 to 80 [deg]")
        if self.material is not None and self.material not in MATERIALS:
            raise InputError("material", self.material, f"one of {', '.join(MATERIALS)}")
        if self.stickout_mm is not None and not 0.0 < self.stickout_mm <= 5000.0:
            raise InputError("stickout", self.stickout_mm, "a length above 0, at most 5000 [mm]")
        if self.insertion_mm is not None and not 0.0 <= self.insertion_mm <= 5000.0:
            raise InputError("insertion", self.insertion_mm, "a length from 0 to 5000 [mm]")


class Imported(NamedTuple):
    """An entry of a library.

    `number`: place in the library, from 1
    `text`: the tooling as TOML, its notes as comments; empty without one
    `notes`: what was assumed
    `reason`: why there is no tooling
    """

    number: int
    name: str
    kind: str
    tooling: Tooling | None
    text: str
    notes: tuple[str, ...]
    reason: str


def read_tool_library(path: str | Path, assumptions: Assumptions | None = None) -> list[Imported]:
    """Return every entry of a library file, with a tooling or with the reason why there is none.

    Raises `InputError`: the file as a whole is no library.
    """
    return import_tools(read_bytes(path, "tool library", LARGEST_LIBRARY), str(path), assumptions)


def import_tools(raw: bytes, where: str, assumptions: Assumptions | None = None, most: int = MOST_ENTRIES) -> list[Imported]:
    """Return every entry of a library that is already in memory, at most so many, see `read_tool_library`.

    `raw`: the library's JSON
    `where`: the file, for the messages
    `assumptions`: in place of what the library cannot tell
    `most`: entries that are allowed
    """
    given = assumptions or Assumptions()
    content = _content(raw, where)
    entries = content.get("data", [content]) if isinstance(content, Mapping) else content
    if (
        not isinstance(entries, list)
        or not entries
        or not any(isinstance(e, Mapping) and e.keys() & {"geometry", "segments", "DC"} for e in entries)
    ):
        allowed = "a list 'data' of tools with 'geometry' and 'holder', or with properties of ISO 13399"
        raise InputError("tool library", "no list of tools", allowed, where)
    if len(entries) > most:
        raise InputError("tool library", f"{len(entries)} entries", f"at most {most}", where)
    spare = None
    if given.holder is not None:
        holders = [e for e in entries if isinstance(e, Mapping) and e.get("type") == _HOLDER]
        named = [e for e in holders if given.holder in (_name(e), _line(e.get("product-id", "")))]
        if len(named) != 1:
            known = listed([_name(e) for e in holders]) or "it has none"
            raise InputError("holder", f"{given.holder}, {len(named)} times", f"one of the library's holders: {known}", where)
        spare = plain_entry(named[0])[0]
    found = []
    for number, entry in enumerate(entries, start=1):
        place = f"data[{number - 1}]" if len(entries) > 1 or "data" in content else ""
        if not isinstance(entry, Mapping):
            found.append(Imported(number, "", "", None, "", (), "no table of keys"))
            continue
        name, kind = _name(entry), _line(entry.get("type", ""))
        try:
            read, found_in = plain_entry(entry)
            data, notes = _tooling(Table(read, where, place), name, given, spare)
            notes += [*found_in, *preset_notes(read)]
            text = tooling_text(data, notes)
            tooling = tooling_of(keys_of_toml(text, "tooling", where), where, name, tip_known="tool" not in data)
            _check_drawn(tooling)
            found.append(Imported(number, name, kind, tooling, text, tuple(notes), ""))
        except NotRead as skipped:
            found.append(Imported(number, name, kind, None, "", (), str(skipped)))
        except InputError as error:
            reason = _line(f"{error.field}: found {error.found}, allowed is {error.allowed}", 400)
            found.append(Imported(number, name, kind, None, "", (), reason))
    return found


def _check_drawn(tooling: Tooling) -> None:
    """Refuse a shape that would be computed as a cylinder."""
    cutter = tooling.cutter
    if cutter.profile is None and cutter.shape is not CutterShape.FLAT:
        lacking = ", ".join(key_of(name) for name in missing(cutter.shape, cutter.corner_radius, cutter.dimensions))
        raise NotRead(f"a cutter of the shape {cutter.shape} of which {lacking or 'too little'} is not told")


def file_names(names: Sequence[str]) -> list[str]:
    """Return a file name for each tooling: letters, digits, points and dashes, no two alike."""
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-._")[:60] or "tool"
        count, free = 1, plain
        while free.lower() in taken:
            count += 1
            free = f"{plain}-{count}"
        taken.add(free.lower())
        found.append(f"{free}.toml")
    return found


def _content(raw: bytes, where: str) -> Any:
    """The JSON of a library, out of its container where it is in one."""
    if raw[:4] == b"PK\x03\x04":
        raw = _unpacked(raw, where)
    if is_xml(raw):
        return hsm_entries(raw, where)

    def refuse(text: str) -> NoReturn:
        raise InputError("tool library", text, "finite numbers", where)

    try:
        return json.loads(raw.decode("utf-8-sig"), parse_constant=refuse)
    except InputError:
        raise
    except UnicodeDecodeError:
        raise InputError("tool library", "bytes that are not text", "JSON in UTF-8, or a .tools container with it", where) from None
    except json.JSONDecodeError as error:
        raise InputError(
            "tool library", f"no JSON ({error.msg})", "JSON, or a .tools container with it", f"{where} line {error.lineno}"
        ) from None
    except (RecursionError, ValueError):
        raise InputError(
            "tool library", "numbers too long, or lists nested too deeply", "JSON in the form of a tool library", where
        ) from None


def _unpacked(raw: bytes, where: str) -> bytes:
    """The one JSON file of a zip container; it is unpacked no further than the limit."""
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as container:
            files = container.infolist()
            chosen = [f for f in files if f.filename.lower().endswith(".json")]
            if len(files) > _MOST_FILES or len(chosen) != 1:
                raise InputError("tool library", f"{len(chosen)} JSON files among {len(files)}", f"one, among at most {_MOST_FILES}", where)
            # other methods unpack more than they are asked for
            if chosen[0].compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or chosen[0].flag_bits & 1:
                raise InputError("tool library", "a packed file of another method", "plain or deflated, without a password", where)
            with container.open(chosen[0]) as file:
                content = file.read(LARGEST_LIBRARY + 1)
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, ValueError, NotImplementedError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("tool library", "a container that is damaged", "a complete zip container", where) from None
    if len(content) > LARGEST_LIBRARY:
        raise InputError("tool library", f"more than {LARGEST_LIBRARY // MEGABYTE} MB", f"at most {LARGEST_LIBRARY // MEGABYTE} MB", where)
    return content


def _line(value: Any, longest: int = 200) -> str:
    """A text of the library as one printable line."""
    text = value if isinstance(value, str) else ""
    return " ".join("".join(sign if sign.isprintable() else " " for sign in text).split())[:longest]


def _name(entry: Mapping[str, Any]) -> str:
    return next((text for key in ("description", "product-id", "guid") if (text := _line(entry.get(key, "")))), "tool")


def _tooling(entry: Table, name: str, given: Assumptions, spare: Mapping[str, Any] | None) -> tuple[dict[str, Any], list[str]]:
    """Keys of a tooling file, lengths in millimetres, and what was assumed."""
    notes: list[str] = []
    scale = _unit(entry, notes)
    geometry, shape = _geometry(entry, scale, notes)
    diameter = geometry.number("DC", "", above=0.0) * scale
    teeth = geometry.number("NOF", least=1, most=100, whole=True)
    helix = geometry.number("FHA", "deg", None, least=0.0, most=80.0)
    if helix is None:
        inserts = shape.get("shape") in (CutterShape.FACE, CutterShape.HIGH_FEED)
        helix = 0.0 if inserts else given.helix_deg
        notes.append(f"helix angle {helix:g}° assumed{', as of inserts' if inserts else ''}: none in the library")
    cutter = {"teeth": teeth, "diameter_mm": diameter, "helix_deg": helix} | shape
    if spare is None and not _has_segments(entry.data.get("holder")):
        return {"name": name, "cutter": cutter}, [*notes, _CUTTER_ALONE]
    material = _body(entry, given, notes)
    segments, shank = _tool_segments(entry, geometry, diameter, scale, given, material, notes)
    stickout, insertion = _lengths(geometry, scale, given, notes)
    holder = _holder_segments(entry, scale, shank, insertion, spare, notes)
    if insertion is None:
        insertion = _behind(sum(s["length_mm"] for s in segments) - stickout, holder, notes)
        holder = _bored(holder, insertion, shank)
    data: dict[str, Any] = {
        "name": name,
        "cutter": cutter,
        "tool": {"stickout_mm": stickout, "segments": segments},
        "holder": {"insertion_mm": insertion, "segments": holder},
    }
    contact, spread = given.contact, given.spread
    if contact is None:
        own = entry.data.get("holder")
        named = " ".join(_name(each) for each in (own, spare) if isinstance(each, Mapping))
        typical = typical_contact("shrink fit" if "shrink" in named.lower() else "collet")
        contact, spread = typical.contact, typical.spread
        notes.append(
            f"contact assumed, that of a {typical.kind}: {typical.source}; calibrate it, or take that of a tooling with the same clamping"
        )
    else:
        notes.append("contact taken from another tooling")
    data["contact"] = keys_told(CONTACT, contact)
    # without a word on it the reader knows what is usual, and of an assumed contact what the catalogue states
    data["spread"] = contact_spread_keys(spread) if spread is not None and spread.stated else {}
    return data, notes


def _geometry(entry: Table, scale: float, notes: list[str]) -> tuple[Table, dict[str, Any]]:
    """A tool's geometry, and the keys that draw its outline: of a library's entry, or of properties of ISO 13399 by their names."""
    if "geometry" not in entry and "DC" in entry:
        geometry = Table(iso_geometry(entry.data), entry.where, entry.path)
        return geometry, iso_shape_keys(entry.text("shape", None, choices=tuple(CutterShape)), geometry, scale, notes)
    kind = _line(entry.data.get("type", ""))
    check_type(kind)
    geometry = entry.table("geometry")
    return geometry, shape_keys(kind, geometry, scale, notes)


def _unit(table: Table, notes: list[str]) -> float:
    if "unit" not in table:
        notes.append("lengths assumed in millimetres: no unit in the library")
        return 1.0
    unit = table.text("unit", choices=tuple(UNITS))
    if unit == "inches":
        notes.append("lengths converted from inches")
    return UNITS[unit]


def _body(entry: Table, given: Assumptions, notes: list[str]) -> str:
    if given.material is not None:
        return given.material
    named = _line(entry.data.get("BMC", "")).lower()
    material = _BODIES.get(re.sub(r"[^a-z]", "", named), _CARBIDE)
    if re.sub(r"[^a-z]", "", named) not in _BODIES:
        notes.append(f"tool material {material} assumed: the library states {named or 'none'}")
    elif material == _STEEL:
        notes.append("high-speed steel modelled as steel")
    return material


def _tool_segments(
    entry: Table, geometry: Table, diameter: float, scale: float, given: Assumptions, material: str, notes: list[str]
) -> tuple[list[dict[str, Any]], float]:
    """From the tip: fluted part, neck, the library's shaft, shank; and the shank's diameter."""
    whole = geometry.number("OAL", "", above=0.0) * scale
    fluted = min(geometry.number("LCF", "", above=0.0) * scale, whole)
    shank = geometry.number("SFDM", "", None, above=0.0)
    if shank is None:
        notes.append("shank diameter assumed equal to the cutting diameter: none in the library (SFDM)")
    shank = diameter if shank is None else shank * scale
    segments = [{"length_mm": fluted, "outer_diameter_mm": given.flute_ratio * diameter}]
    notes.append(f"fluted part modelled as a cylinder of {given.flute_ratio:g} times the cutting diameter")
    shoulder = min((geometry.number("shoulder-length", "", None, least=0.0) or 0.0) * scale, whole)
    if shoulder > fluted + 1e-6:
        neck = geometry.number("shoulder-diameter", "", None, above=0.0)
        segments.append({"length_mm": shoulder - fluted, "outer_diameter_mm": diameter if neck is None else neck * scale})
    shaft = entry.data.get("shaft")
    if isinstance(shaft, Mapping) and shaft.get("segments"):
        segments += _stack(Table(shaft, entry.where, entry.name("shaft")), scale)
    left = whole - sum(s["length_mm"] for s in segments)
    if left < -_ROUNDING:
        geometry.refuse("OAL", f"{whole:.6g} mm, {-left:.6g} mm less than flutes, neck and shaft", "the overall length")
    if left > 1e-6:
        segments.append({"length_mm": left, "outer_diameter_mm": shank})
    return [s | {"material": material} for s in _merged(segments)], shank


def _merged(segments: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Neighbours of one diameter become one."""
    found: list[dict[str, Any]] = []
    for each in segments:
        last = found[-1] if found else each
        if found and last["outer_diameter_mm"] == each["outer_diameter_mm"] and not {"end_diameter_mm"} & (last.keys() | each.keys()):
            found[-1] = last | {"length_mm": last["length_mm"] + each["length_mm"]}
        else:
            found.append(each)
    return found


def _lengths(geometry: Table, scale: float, given: Assumptions, notes: list[str]) -> tuple[float, float | None]:
    """Stickout, and insertion where it is given."""
    if given.stickout_mm is not None:
        stickout = given.stickout_mm
    else:
        stickout = geometry.number("LB", "length below the holder", above=0.0) * scale
        notes.append(f"stickout {stickout:.6g} mm, the library's length below the holder (LB)")
    return stickout, given.insertion_mm


def _stack(table: Table, scale: float) -> list[dict[str, Any]]:
    """Cones of a shaft or a holder; those without height only mark a step."""
    cones = table.tables("segments")
    if len(cones) > MOST_SEGMENTS:
        table.refuse("segments", f"{len(cones)} segments", f"at most {MOST_SEGMENTS}")
    found = []
    for cone in cones:
        height = cone.number("height", "", least=0.0) * scale
        if height < 1e-6:
            continue
        lower, upper = (cone.number(key, "", above=0.0) * scale for key in ("lower-diameter", "upper-diameter"))
        found.append({"length_mm": height, "outer_diameter_mm": lower} | ({} if lower == upper else {"end_diameter_mm": upper}))
    return found


def _holder_segments(
    entry: Table, scale: float, shank: float, insertion: float | None, spare: Mapping[str, Any] | None, notes: list[str]
) -> list[dict[str, Any]]:
    """The holder's cones up to its gauge line, of steel, bored for the tool where the insertion is given."""
    own = entry.data.get("holder")
    if _has_segments(own):
        table = Table(own, entry.where, entry.name("holder"))
    else:
        assert spare is not None
        table = Table(spare, entry.where, "holder")
        notes.append(f"holder {_name(spare)} of the library")
    if "unit" in table:
        scale = UNITS[table.text("unit", choices=tuple(UNITS))]
    cones = _stack(table, scale)
    if not cones:
        table.refuse("segments", "no height", "cones with a height above 0")
    gauge = table.number("gaugeLength", "", None, least=0.0)
    total = sum(c["length_mm"] for c in cones)
    if gauge and gauge * scale < total - _ROUNDING:
        cones = _cut(cones, gauge * scale)[0]
        notes.append(f"holder up to its gauge line, {gauge * scale:.6g} of {total:.6g} mm: the rest is inside the spindle")
    elif not gauge:
        notes.append(f"holder up to the end of its last segment, {total:.6g} mm: no gauge line in the library")
    notes.append("holder of solid steel behind the tool: no bore in the library")
    cones = [c | {"material": _STEEL} for c in cones]
    return cones if insertion is None else _bored(cones, insertion, shank)


def _has_segments(holder: Any) -> bool:
    return isinstance(holder, Mapping) and bool(holder.get("segments"))


def _behind(left: float, holder: list[dict[str, Any]], notes: list[str]) -> float:
    """Insertion that the library leaves open: what there is of the tool behind the holder's nose, inside of the holder."""
    if left <= 0.0:
        raise NotRead("a tool that ends at the holder's nose (OAL and LB); the insertion has to be given")
    # a nanometre less than the whole: figures are rounded when they are written
    insertion = min(left, sum(c["length_mm"] for c in holder) - 1e-6)
    notes.append(f"insertion {insertion:.6g} mm assumed: all of the tool behind the holder's nose (OAL and LB); the bore may be shorter")
    return insertion


def _cut(cones: list[dict[str, Any]], length: float) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The stack in front of a length and the one behind it."""
    front: list[dict[str, Any]] = []
    for i, cone in enumerate(cones):
        if cone["length_mm"] > length + 1e-9:
            if length < 1e-9:
                return front, cones[i:]
            first, last = cone["outer_diameter_mm"], cone.get("end_diameter_mm", cone["outer_diameter_mm"])
            middle = first + (last - first) * length / cone["length_mm"]
            ends = ({"end_diameter_mm": middle}, {"end_diameter_mm": last}) if "end_diameter_mm" in cone else ({}, {})
            before = cone | {"length_mm": length} | ends[0]
            return [*front, before], [
                cone | {"length_mm": cone["length_mm"] - length, "outer_diameter_mm": middle} | ends[1],
                *cones[i + 1 :],
            ]
        front.append(cone)
        length -= cone["length_mm"]
    return front, []


def _bored(cones: list[dict[str, Any]], insertion: float, shank: float) -> list[dict[str, Any]]:
    front, behind = _cut(cones, insertion)
    return [c | {"inner_diameter_mm": shank} for c in front] + behind
