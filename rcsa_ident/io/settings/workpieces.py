"""A workpiece's keys, alike in campaign, machine file and result: material, cutting coefficients and how well they are known."""

from __future__ import annotations

from typing import Any

from rcsa_ident.base.plausibility import AXIAL_RATIO, EDGE, RADIAL_RATIO, TANGENTIAL
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.cut import Workpiece

#: Edge forces of a workpiece: key and unit in N/m.
_EDGES = {"tangential_edge_n_per_mm": 1e3, "radial_edge_n_per_mm": 1e3, "axial_edge_n_per_mm": 1e3}
#: What a noun without them takes: a file's silence means the same.
_USUAL = CuttingCoefficients(1e9, 0.0)
#: Standard deviations in percent, 0 being known exactly.
_SPREADS = {
    "tangential_coefficient_spread_percent": _USUAL.tangential_spread,
    "radial_ratio_spread_percent": _USUAL.ratio_spread,
    "edge_spread_percent": _USUAL.edge_spread,
}
_UNTOLD_EDGE = "edge_force_spread_n_per_mm"
WORKPIECE_KEYS = ("name", "tangential_coefficient_mpa", "radial_ratio", "axial_ratio", *_EDGES, *_SPREADS, _UNTOLD_EDGE)


def workpiece_of(table: Table) -> Workpiece:
    """Return the workpiece of a table that holds some of `WORKPIECE_KEYS`."""
    coefficients = CuttingCoefficients(
        table.quantity("tangential_coefficient_mpa", TANGENTIAL) * 1e6,
        table.quantity("radial_ratio", RADIAL_RATIO),
        table.quantity("axial_ratio", AXIAL_RATIO, 0.0),
        *(table.quantity(key, EDGE, 0.0) * unit for key, unit in _EDGES.items()),
        *(table.number(key, "%", 100.0 * usual, least=0.0, most=100.0) / 100.0 for key, usual in _SPREADS.items()),
    )
    usual = Workpiece("", _USUAL).edge_force_spread
    return Workpiece(table.text("name"), coefficients, table.number(_UNTOLD_EDGE, "N/mm", usual * 1e-3, least=0.0, most=200.0) * 1e3)


def workpiece_keys(workpiece: Workpiece, all_spreads: bool = False) -> dict[str, Any]:
    """Return a workpiece as a file holds it; forces that are zero are left away.

    Parameters
    ----------
    all_spreads : bool
        Also those that a reader would take anyway.
    """
    c = workpiece.coefficients
    data: dict[str, Any] = {"name": workpiece.name, "tangential_coefficient_mpa": c.tangential * 1e-6, "radial_ratio": c.radial_ratio}
    if c.axial_ratio != 0.0:
        data["axial_ratio"] = c.axial_ratio
    edges = (c.tangential_edge, c.radial_edge, c.axial_edge)
    data |= {key: value / unit for (key, unit), value in zip(_EDGES.items(), edges, strict=True) if value != 0.0}
    if workpiece.edge_force_spread != Workpiece("", _USUAL).edge_force_spread:
        data[_UNTOLD_EDGE] = workpiece.edge_force_spread * 1e-3
    spreads = zip(_SPREADS.items(), (c.tangential_spread, c.ratio_spread, c.edge_spread), strict=True)
    return data | {key: _percent(value) for (key, usual), value in spreads if all_spreads or value != usual}


def _percent(share: float) -> float:
    # 100 x 0.07 is not 7, and nobody wrote the last digit
    return float(f"{100.0 * share:.14g}")
