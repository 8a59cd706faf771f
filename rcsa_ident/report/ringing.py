"""What a ring told of a tooling, in the drawing's terms: rows for machines, sentences for people, a figure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rcsa_ident.identification.ringing import UNKNOWNS, RungLine, RungTooling
from rcsa_ident.report.figures import _STYLE, COLOURS
from rcsa_ident.tool_holder.alteration import fluted_segments
from rcsa_ident.tool_holder.free_modes import Motion
from rcsa_ident.units import to_hz

_CONTACT = {
    "translational_stiffness": "N/m per m", "rotational_stiffness": "N m/rad per m", "translational_damping": "N s/m per m",
    "rotational_damping": "N m s/rad per m",
}  # fmt: skip
_PRIOR, _AFTER = "#9aa5b1", "#009E73"


class Change(NamedTuple):
    """A number of the drawing, before and after.

    Parameters
    ----------
    what, key : str
        In words, and as the file has it.
    before, before_std, after, after_std : float
    unit : str
    """

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
    for name, unit in _CONTACT.items():
        if before.contact is not None and after.contact is not None:
            told = getattr(before.contact, name), getattr(after.contact, name)
            yield change(f"contact's {name.replace('_', ' ')}", f"contact.{name}", name, *told, unit)
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


def ring_figure(found: RungTooling) -> Figure:
    """Draw what a ring told: lines beside the modes as drawn and as learned, unknowns before and after.

    Parameters
    ----------
    found : RungTooling
    """
    known = [line for line in found.lines if line.mode is not None and line.mode.motion is Motion.BENDING and line.after is not None]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(8.4, 3.2 + 0.3 * len(UNKNOWNS)), layout="constrained")
        top, bottom = figure.subplots(2, 1, height_ratios=(1.0, 2.0))
        figure.suptitle(f"{found.after.name}: what its ring tells", fontsize=11, fontweight="bold")
        for i, line in enumerate(known):
            assert line.mode is not None
            assert line.after is not None
            away = 100.0 * np.log(np.array([line.mode.omega, line.after]) / line.heard.omega)
            top.plot(away[0], i, "o", color=_PRIOR, label="drawn" if i == 0 else None)
            top.plot(away[1], i, "o", color=_AFTER, label="learned" if i == 0 else None)
        names = [f"{'tool alone' if line.bare else 'tooling'}, {line.mode}, {to_hz(line.heard.omega):.0f} Hz" for line in known]
        top.axvline(0.0, color=COLOURS["X"], lw=1.0)
        top.set(yticks=range(len(names)), yticklabels=names, ylim=(-0.6, len(names) - 0.4), xlabel="computed over heard, minus 1 [%]")
        if known:
            top.legend(loc="best")
        free = [i for i, std in enumerate(found.prior_std) if std > 0.0]
        share, left = found.mean[free] / found.prior_std[free], found.std[free] / found.prior_std[free]
        rows = np.arange(len(free))
        bottom.barh(rows, 2.0, left=-1.0, height=0.7, color=_PRIOR, alpha=0.35, label="believed before, ± 1 standard deviation")
        bottom.errorbar(share, rows, xerr=left, fmt="o", color=_AFTER, capsize=3, label="after")
        bottom.set(
            yticks=rows,
            yticklabels=[UNKNOWNS[i].replace("_", " ") for i in free],
            xlabel="difference from the drawing [its standard deviations]",
        )
        bottom.invert_yaxis()
        bottom.legend(loc="best")
    return figure
