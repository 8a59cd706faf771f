"""Holders generated from a few dimensions: a taper's flange, a chuck's body, each with its source."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib.resources import files
from typing import Any

from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.plausibility import PlausibilityCode
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Shown
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.spread import IDENTIFIED, LENGTHS, Spread

#: Least length of a chuck's body in front of the flange [m].
_LEAST_BODY = 5e-3
#: Nobody makes a chuck whose nose is wider than so many diameters of the taper's flange.
_WIDEST = 1.4
_OF_CONTACT = ("translational", "rotational")
#: What each field of an `Alteration` is, and the field of `Spread` that says how well it is known.
_PARAMETERS = {
    "stickout": ("stickout", "stickout"),
    "fluted_length": ("length of the fluted part", "segment_length"),
    "fluted_diameter": ("diameter of the fluted part", "fluted_diameter"),
    "youngs_modulus": ("modulus of the tool", "youngs_modulus"),
    "holder_diameter": ("diameter of the holder", "holder_diameter"),
    **{
        f"{way}_{what}": (f"{way} {what} of the holder–tool joint", f"contact_{what}")
        for way in _OF_CONTACT
        for what in ("stiffness", "damping")
    },
}


@dataclass(frozen=True, slots=True)
class TypicalContact:
    """What the contact of tool and holder is worth before anybody has measured it.

    `kind`: how the chuck clamps, as ``collet``
    `contact`: per metre of insertion
    `stiffness_spread`, `damping_spread` [-]: standard deviations of the logarithms
    `source`: where the values come from
    """

    kind: str
    contact: Contact
    stiffness_spread: float
    damping_spread: float
    source: str

    @property
    def spread(self) -> Spread:
        """How well a drawing with this contact is known: the contact as stated here, the rest as drawings usually are."""
        return Spread(contact_stiffness=self.stiffness_spread, contact_damping=self.damping_spread)


@dataclass(frozen=True, slots=True, repr=False)
class CatalogueHolder(Shown):
    """A holder as its dimensions make it, without the taper behind the spindle's face.

    `segments`: from the nose to the spindle's face (HSK) or the gauge line (BT, CAT); of steel
    `insertion` [m]: how deep its bore clamps
    `sources`: where the taper's dimensions and the chuck's come from, or that they are typical
    `contact`: None where nothing is known of this kind of chuck; a tap test of the clamped tool tells it
    """

    taper: str
    chuck: str
    segments: tuple[BeamSegment, ...]
    insertion: float
    sources: tuple[str, ...]
    contact: TypicalContact | None

    @property
    def spread(self) -> Spread:
        """How well a tooling with this holder and its contact is known before anybody has measured it."""
        return Spread() if self.contact is None else self.contact.spread

    @property
    def length(self) -> float:
        """Length from the nose to the spindle's face or the gauge line [m]."""
        return sum(s.length for s in self.segments)

    @property
    def mass(self) -> float:
        """Mass of the segments [kg]: with collet and nut, without the taper and the tool."""
        return sum(s.mass for s in self.segments)

    def __str__(self) -> str:
        return f"{self.taper} {self.chuck}, bore {1e3 * self.segments[0].inner_diameter:g} mm, {1e3 * self.length:g} mm, {self.mass:.2f} kg"


def tapers() -> tuple[str, ...]:
    """Return the names of the tapers."""
    return tuple(_data()["tapers"])


def chucks() -> tuple[str, ...]:
    """Return the names of the chucks."""
    return tuple(_data()["chucks"])


def bores(chuck: str, taper: str | None = None) -> tuple[float, float]:
    """Return the least and the largest bore of a chuck [m], of all its sizes or of those that a taper carries."""
    found = _entry("chucks", "chuck", chuck)
    sizes = found["sizes"]
    if taper is not None:
        flange = _entry("tapers", "taper", taper)["flange_diameter"]
        sizes = [size for size in sizes if size[1] <= _WIDEST * flange]
        if not sizes:
            raise InputError("chuck", chuck, f"one that {taper} carries, with a nose of at most {_WIDEST * flange:g} mm")
    return 1e-3 * found["least_bore"], 1e-3 * sizes[-1][0]


def holder(taper: str, chuck: str, bore: float, length: float | None = None) -> CatalogueHolder:
    """Return a holder of the catalogue for a shank.

    `taper`: one of `tapers()`, as ``HSK-A63``
    `chuck`: one of `chucks()`, as ``ER32``
    `bore` [m]: diameter of the tool's shank; the smallest size that takes it is chosen
    `length` [m]: from the nose to the spindle's face or the gauge line, which a drawing calls A; by default a typical one
    Raises `InputError` of a name that is not there, a shank that the chuck does not take, or a length that leaves no room for the chuck.

    Examples
    --------
    >>> print(holder("HSK-A63", "ER32", 0.012))
    HSK-A63 ER32, bore 12 mm, 100 mm, 1.54 kg
    """
    flange, body = _entry("tapers", "taper", taper), _entry("chucks", "chuck", chuck)
    least, most = bores(chuck, taper)
    bore = positive("bore", bore, "m")
    if not least - 1e-9 <= bore <= most + 1e-9:
        raise InputError("bore", f"{1e3 * bore:g} mm", f"from {1e3 * least:g} to {1e3 * most:g} mm for {taper} {chuck}")
    _, nose, behind, clamped = (1e-3 * v for v in next(size for size in body["sizes"] if 1e-3 * size[0] >= bore - 1e-9))
    length = 1e-3 * body["length"] if length is None else positive("holder length", length, "m")
    collar = 1e-3 * flange["flange_length"]
    shortest = max(collar + _LEAST_BODY, clamped)
    if length < shortest:
        raise InputError("holder length", f"{1e3 * length:g} mm", f"at least {1e3 * shortest:g} mm for {taper} {chuck}")
    behind = max(nose, min(behind, 1e-3 * flange["flange_diameter"]))
    outer = _body(nose, behind, length - collar, body.get("slope_deg"))
    outer.append(BeamSegment(collar, 1e-3 * flange["flange_diameter"], MATERIALS["steel"]))
    rear = body["rear"] * bore if body["rear"] < 1.0 else min(1e-3 * body["rear"], 0.8 * nose)
    segments = tuple(_bored(outer, clamped, bore, rear))
    typical = typical_contact(body["contact"]) if "contact" in body else None
    sources = f"{taper}: {flange['source']}", f"{chuck}: {body['source']}"
    return CatalogueHolder(taper, chuck, segments, clamped, sources, typical)


def assumed_contact(contact: Contact | None) -> TypicalContact | None:
    """Return what the catalogue says of a contact that has its assumed values, None of any other.

    Examples
    --------
    >>> assumed_contact(Contact(2e10, 6e5, 1e5, 40.0)).kind
    'collet'
    >>> assumed_contact(Contact(1.9e10, 6e5, 1e5, 40.0)) is None
    True
    """
    return next((each for kind in _data()["contacts"] if _alike((each := typical_contact(kind)).contact, contact)), None)


def assumption(assembly: ToolAssembly, spread: Spread) -> Remark | None:
    """Return a remark on a contact that only the catalogue assumes, where it is taken as if it were known better, else None.

    Who states 0 has measured it, or knows it as only a virtual machine is known.
    """
    typical = assumed_contact(assembly.contact)
    if typical is None or assembly.insertion == 0.0:
        return None
    if not spread.stated:
        taken = "it counts as exact"
    elif any(0.0 < getattr(spread, key) < getattr(typical.spread, key) - 1e-9 for key in ("contact_stiffness", "contact_damping")):
        taken = f"[spread] states {_percents(spread)}"
    else:
        return None
    return Remark(
        PlausibilityCode.ASSUMED,
        f"the contact has the catalogue's assumed values of a {typical.kind}, which nobody has measured, but {taken}: safe depths come "
        f"out too high; [spread] should state {_percents(typical.spread)}",
    )


def stated(parameter: str, contact: Contact | None, spread: Spread) -> str:
    """Return what a parameter of a drawing is and how well it is known; see `Tooling.stated`."""
    field = parameter.removeprefix(IDENTIFIED)
    words, key = _PARAMETERS[field]
    if field != parameter:
        return f"{words}, which was identified"
    size = getattr(spread, key)
    told = f"{1e3 * size:g} mm" if key in LENGTHS else f"{100.0 * size:g} %"
    assumed = field.startswith(_OF_CONTACT) and assumed_contact(contact) is not None
    return f"{words}, which is assumed ({told})" if assumed else f"{words}, whose standard deviation is {told}"


@cache
def typical_contact(kind: str) -> TypicalContact:
    """Return what the catalogue assumes of the contact of a kind of chuck, ``collet`` or ``shrink fit``."""
    found = _entry("contacts", "contact", kind)
    contact = Contact(**{field.name: found[field.name] for field in fields(Contact)})
    return TypicalContact(kind, contact, 1e-2 * found["stiffness_spread_percent"], 1e-2 * found["damping_spread_percent"], found["source"])


@cache
def _data() -> dict[str, dict[str, Any]]:
    return tomllib.loads(files("rcsa_ident.tool_holder").joinpath("holders.toml").read_text(encoding="utf-8"))


def _entry(table: str, field: str, name: str) -> dict[str, Any]:
    known = _data()[table]
    if name not in known:
        raise InputError(field, name, f"one of {', '.join(known)}")
    found: dict[str, Any] = known[name]
    return found


def _alike(typical: Contact, contact: Contact | None) -> bool:
    """Whether a contact is the typical one but for the rounding of whoever wrote it."""
    return contact is not None and all(
        math.isclose(getattr(typical, field.name), getattr(contact, field.name), rel_tol=1e-6) for field in fields(Contact)
    )


def _percents(spread: Spread) -> str:
    stiffness, damping = 100.0 * spread.contact_stiffness, 100.0 * spread.contact_damping
    return f"contact_stiffness_percent = {stiffness:g} and contact_damping_percent = {damping:g}"


def _body(nose: float, behind: float, length: float, slope_deg: float | None) -> list[BeamSegment]:
    """The chuck in front of the flange: a cylinder, one of two diameters with the step in the middle, or a cone and what follows it."""
    steel = MATERIALS["steel"]
    if behind == nose:
        return [BeamSegment(length, nose, steel)]
    if slope_deg is None:
        return [BeamSegment(0.5 * length, nose, steel), BeamSegment(0.5 * length, behind, steel)]
    cone = 0.5 * (behind - nose) / math.tan(math.radians(slope_deg))
    whole = BeamSegment(cone, nose, steel, end_diameter=behind)
    return [whole.part(0.0, length)] if cone >= length else [whole, BeamSegment(length - cone, behind, steel)]


def _bored(outer: list[BeamSegment], clamped: float, bore: float, rear: float) -> list[BeamSegment]:
    """The same with its bore: the shank's as deep as it clamps, another one behind."""
    found, start = [], 0.0
    for segment in outer:
        inside = min(max(clamped - start, 0.0), segment.length)
        if inside > 1e-9:
            found.append(replace(segment.part(0.0, inside), inner_diameter=bore))
        if segment.length - inside > 1e-9:
            found.append(replace(segment.part(inside, segment.length), inner_diameter=rear))
        start += segment.length
    return found
