"""A small library of cutting coefficients, each with its source and how far another cutter may be from it."""

from __future__ import annotations

import difflib
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients

_COEFFICIENTS = {
    "tangential_coefficient_mpa", "radial_ratio", "axial_ratio", "tangential_edge_n_per_mm", "radial_edge_n_per_mm", "axial_edge_n_per_mm",
    "tangential_coefficient_spread_percent", "radial_ratio_spread_percent", "edge_spread_percent",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CuttingMaterial:
    """A workpiece material as one source has cut it.

    `condition`: cutter, lubrication, feed: what the coefficients hold for
    `coefficients`: their spreads are what the user of another cutter has to expect
    """

    name: str
    condition: str
    coefficients: CuttingCoefficients
    source: str
    notes: str = ""


@cache
def materials() -> tuple[CuttingMaterial, ...]:
    """Return all materials of the library, in its order."""
    data = tomllib.loads(files("rcsa_ident.cutting").joinpath("materials.toml").read_text(encoding="utf-8"))
    review = f"{data['review']['title']}, {data['review']['where']}"
    return tuple(_material(entry, review) for entry in data["materials"])


def material(name: str) -> CuttingMaterial:
    """Return a material by name, whatever its capitals and spaces.

    Parameters
    ----------
    name : str
        One of `materials()`.

    Raises
    ------
    InputError
        If there is none; it holds the nearest names.

    Examples
    --------
    >>> material("en aw-6082").coefficients.tangential
    902000000.0
    """
    library = {_plain(m.name): m for m in materials()}
    found = library.get(_plain(name))
    if found is None:
        # a part of a name finds it, too: most say "7075"
        near = [m.name for key, m in library.items() if _plain(name) and _plain(name) in key]
        near = near or [library[key].name for key in difflib.get_close_matches(_plain(name), library, 3, 0.4)]
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise InputError("material", name, f"one of {', '.join(m.name for m in materials())}{hint}")
    return found


def _plain(name: str) -> str:
    return "".join(c for c in name.casefold() if c.isalnum())


def _material(entry: dict[str, Any], review: str) -> CuttingMaterial:
    value = {key: float(entry.get(key, 0.0)) for key in _COEFFICIENTS}
    coefficients = CuttingCoefficients(
        value["tangential_coefficient_mpa"] * 1e6,
        value["radial_ratio"],
        value["axial_ratio"],
        *(value[f"{name}_edge_n_per_mm"] * 1e3 for name in ("tangential", "radial", "axial")),
        *(value[f"{name}_spread_percent"] / 100.0 for name in ("tangential_coefficient", "radial_ratio", "edge")),
    )
    source = entry["source"].replace("review", review, 1) if entry["source"].startswith("review") else entry["source"]
    return CuttingMaterial(entry["name"], entry["condition"], coefficients, source, entry.get("notes", ""))
