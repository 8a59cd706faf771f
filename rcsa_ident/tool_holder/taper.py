"""What a holder has behind its flange: the taper, and the pull stud that stays in it. A holder that hangs on a string carries both."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

from rcsa_ident.base.errors import InputError
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly

#: Kinds of hollow taper shank by the sizes that are made, and how many sizes smaller the taper of a flange of that size is.
_HSK = {"A": (range(6), 0), "C": (range(6), 0), "E": (range(5), 0), "F": (range(2, 5), 1)}
#: Share of a hollow taper's length, at its rear, that the clamping shoulder takes.
_SHOULDER = 0.4
#: Length of the cylinders that stand for a cone [m].
_STAIR = 10e-3


@dataclass(frozen=True, slots=True)
class Taper:
    """A taper by its name.

    `name`: as ``HSK-A63``, ``BT40``
    `segments`: from the flange face, or the gauge line, to the rear end, pull stud included; of steel
    `source`: where the dimensions come from
    """

    name: str
    segments: tuple[BeamSegment, ...]
    source: str

    @property
    def length(self) -> float:
        """Length behind the flange face or the gauge line [m]."""
        return sum(segment.length for segment in self.segments)

    @property
    def mass(self) -> float:
        """Mass behind the flange face or the gauge line [kg]."""
        return sum(segment.mass for segment in self.segments)


def tapers() -> tuple[str, ...]:
    """Return the names of the tapers.

    >>> tapers()[:3], "BT40" in tapers()
    (('HSK-A32', 'HSK-A40', 'HSK-A50'), True)
    """
    sizes = list(_data()["hsk"]["sizes"])
    return (*(f"HSK-{kind}{sizes[i]}" for kind, (made, _) in _HSK.items() for i in made), *_data()["steep"]["sizes"])


def taper(name: str) -> Taper:
    """Return a taper of the library.

    Raises `InputError` of a name that is not there.

    Examples
    --------
    >>> round(taper("HSK-A63").mass, 2), round(taper("BT40").mass, 2)
    (0.14, 0.55)
    """
    if name not in tapers():
        raise InputError("taper", name, f"one of {', '.join(tapers())}")
    if name.startswith("HSK-"):
        return _hollow(name)
    data = _data()["steep"]
    found = data["sizes"][name]
    diameter, length = (1e-3 * v for v in found["taper"])
    steel = MATERIALS["steel"]
    cone = BeamSegment(length, diameter, steel, end_diameter=diameter - data["steep"] * length)
    stud = (BeamSegment(1e-3 * long, 1e-3 * wide, steel) for long, wide in found["stud"])
    return Taper(name, (*_stairs(cone), *stud), f"{found['source']}: {data['source']}")


def hung(assembly: ToolAssembly, name: str) -> ToolAssembly:
    """Return a tool-holder as it hangs on a string: its holder goes on as the taper; an empty name is none.

    Examples
    --------
    >>> bar = ToolAssembly((BeamSegment(0.1, 0.02, MATERIALS["steel"]),), (BeamSegment(0.1, 0.063, MATERIALS["steel"]),), insertion=0.0)
    >>> round(hung(bar, "HSK-A63").holder_length, 6)
    0.132
    """
    return replace(assembly, holder=(*assembly.holder, *taper(name).segments)) if name else assembly


def _hollow(name: str) -> Taper:
    data = _data()["hsk"]
    sizes = list(data["sizes"])
    # the flange of kind F is that of the next larger taper
    size = sizes[sizes.index(name[5:]) - _HSK[name[4]][1]]
    diameter, length, behind, shoulder = (1e-3 * v for v in data["sizes"][size])
    cone = BeamSegment(length, diameter, MATERIALS["steel"], end_diameter=diameter - data["steep"] * length)
    front = (1.0 - _SHOULDER) * length
    segments = (replace(cone.part(0.0, front), inner_diameter=behind), replace(cone.part(front, length), inner_diameter=shoulder))
    return Taper(name, tuple(step for segment in segments for step in _stairs(segment)), data["source"])


def _stairs(cone: BeamSegment) -> tuple[BeamSegment, ...]:
    """A cone as cylinders of its mean diameters: here it is little more than a mass, and a free mode moves by less than 0.05 %."""
    count = max(1, round(cone.length / _STAIR))
    pieces = (cone.part(i * cone.length / count, (i + 1) * cone.length / count) for i in range(count))
    return tuple(replace(piece, diameter=0.5 * (piece.diameter + piece.end), end_diameter=None) for piece in pieces)


@cache
def _data() -> dict[str, Any]:
    return tomllib.loads(files("rcsa_ident.tool_holder").joinpath("tapers.toml").read_text(encoding="utf-8"))
