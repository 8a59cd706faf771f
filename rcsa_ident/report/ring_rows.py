"""What a ring told of a tooling, in the drawing's terms: rows for machines, sentences for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from rcsa_ident.base.plausibility import CONTACT
from rcsa_ident.base.units import to_hz
from rcsa_ident.identification.ring.ringing import UNKNOWNS, RungLine, RungTooling
from rcsa_ident.tool_holder.alteration import fluted_segments


class Change(NamedTuple):
    """A number of the drawing, before and after. `what`, `key`: in words, and as the file has it."""

    what: str
    key: str
    before: float
    before_std: float
    after: float
    after_std: float
    unit: str

    def __str__(self) -> str:
        digits = max(0, -int(np.floor(np.log10(self.after_std)))) if 0.0 < self.after_std < 100.0 else 0
        if max(abs(self.after), abs(self.before)) >= 1e5:
            return f"{self.what} {self.before:.3g} ± {self.before_std:.1g} → {self.after:.3g} ± {self.after_std:.1g} {self.unit}"
        return f"{self.what} {self.before:.{digits}f} ± {self.before_std:.1g} → {self.after:.{digits}f} ± {self.after_std:.1g} {self.unit}"


def changes(found: RungTooling) -> tuple[Change, ...]:
    """Return the numbers of the drawing that a ring may change, those that were exact left out."""
    return tuple(each for each in _changes(found) if each.before_std > 0.0)


def _changes(found: RungTooling) -> Iterator[Change]:
    stds = dict(zip(UNKNOWNS, zip(found.prior_std, found.std, strict=True), strict=True))
    before, after = found.before.assembly, found.after.assembly

    def change(what: str, key: str, unknown: str, old: float, new: float, unit: str, power: float = 1.0) -> Change:
        first, last = (power * float(each) for each in stds[unknown])
        return Change(what, key, old, first * abs(old), new, last * abs(new), unit)

    first, last = (1e3 * float(each) for each in stds["stickout"])
    yield Change("stickout", "tool.stickout_mm", 1e3 * before.stickout, first, 1e3 * after.stickout, last, "mm")
    flutes = fluted_segments(before.tool)
    for i in range(flutes):
        old, new, place = before.tool[i], after.tool[i], f"tool.segments[{i}]"
        name = "fluted diameter" if flutes == 1 else f"fluted diameter {i + 1}"
        yield change(name, f"{place}.outer_diameter_mm", "fluted_diameter", 1e3 * old.diameter, 1e3 * new.diameter, "mm")
        if old.second_moment is not None and new.second_moment is not None:
            told = 1e12 * old.second_moment, 1e12 * new.second_moment
            yield change(f"second moment {i + 1}", f"{place}.second_moment_mm4", "fluted_diameter", *told, "mm^4", 4.0)
    if flutes:
        first, last = (1e3 * float(each) for each in stds["fluted_length"])
        lengths = 1e3 * before.tool[flutes - 1].length, 1e3 * after.tool[flutes - 1].length
        yield Change("fluted length", f"tool.segments[{flutes - 1}].length_mm", lengths[0], first, lengths[1], last, "mm")
    old_material, new_material = before.tool[-1].material, after.tool[-1].material
    moduli = 1e-9 * old_material.youngs_modulus, 1e-9 * new_material.youngs_modulus
    yield change("Young's modulus", "materials.youngs_modulus_gpa", "youngs_modulus", *moduli, "GPa")
    yield change("density", "materials.density", "density", old_material.density, new_material.density, "kg/m³")
    for name, kind in CONTACT.items():
        if before.contact is not None and after.contact is not None:
            told = getattr(before.contact, name), getattr(after.contact, name)
            yield change(f"contact's {name.replace('_', ' ')}", f"contact.{name}", name, *told, kind.unit)
    diameters = 1e3 * before.holder[0].diameter, 1e3 * after.holder[0].diameter
    yield change("holder's diameter", "holder.segments[0].outer_diameter_mm", "holder_diameter", *diameters, "mm")


def ring_row(found: RungTooling) -> dict[str, Any]:
    """Return what a ring told of a tooling as commands and service tell it, in the drawing's terms."""
    return {
        "tooling": found.before.name,
        "status": "suspect" if found.suspect else "good",
        "probability": found.probability,
        "heard": [_line(line) for line in found.lines],
        "changes": [each._asdict() for each in changes(found)],
        "remarks": list(found.remarks),
    }


def _line(line: RungLine) -> dict[str, Any]:
    heard, mode = line.heard, line.mode
    return {
        "of": "tool alone" if line.bare else "tooling",
        "is": None if mode is None else str(mode),
        "frequency_hz": to_hz(heard.omega),
        "frequency_std_hz": to_hz(heard.omega_std),
        "damping_percent": 100.0 * heard.damping,
        "damping_std_percent": 100.0 * heard.damping_std,
        "planes_apart_percent": 100.0 * heard.split,
        "drawn_hz": None if mode is None else to_hz(mode.omega),
        "drawn_damping_percent": None if mode is None or mode.damping is None else 100.0 * mode.damping,
        "learned_hz": None if line.after is None else to_hz(line.after),
        "learned_damping_percent": None if line.damping_after is None else 100.0 * line.damping_after,
    }


def sentences(found: RungTooling) -> list[str]:
    """Return what a ring told, a line each."""
    said = []
    for row in ring_row(found)["heard"]:
        name = row["is"] or "no mode of it"
        words = f"{row['of']}: {row['frequency_hz']:.1f} ± {row['frequency_std_hz']:.1g} Hz, damping {row['damping_percent']:.3g} %: {name}"
        if row["learned_hz"] is not None:
            words += f", expected at {row['drawn_hz']:.0f} Hz, learned {row['learned_hz']:.0f} Hz"
        said.append(words)
    return said + [str(each) for each in changes(found)]
