"""A workpiece's keys, alike in campaign, machine file and result: material, cutting coefficients and how well they are known."""

from __future__ import annotations

from typing import Any

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.setup.fields import WORKPIECE, keys_of, told_in_si

WORKPIECE_KEYS = keys_of(WORKPIECE)
_NAME, *_COEFFICIENTS, _UNTOLD_EDGE = WORKPIECE
_USUAL = Workpiece("", CuttingCoefficients(1e9, 0.0))


def workpiece_of(table: Table) -> Workpiece:
    """Return the workpiece of a table that holds some of `WORKPIECE_KEYS`."""
    coefficients = CuttingCoefficients(**told_in_si(_COEFFICIENTS, table.fields(_COEFFICIENTS)))
    own = (_NAME, _UNTOLD_EDGE)
    return Workpiece(coefficients=coefficients, **told_in_si(own, table.fields(own)))


def workpiece_keys(workpiece: Workpiece, all_spreads: bool = False) -> dict[str, Any]:
    """Return a workpiece as a file holds it; forces that are zero are left away.

    `all_spreads`: also those that a reader would take anyway
    """
    c = workpiece.coefficients
    data: dict[str, Any] = {"name": workpiece.name, "tangential_coefficient_mpa": c.tangential * 1e-6, "radial_ratio": c.radial_ratio}
    own = {each: getattr(c, each.name) for each in _COEFFICIENTS}
    data |= {each.key: value / each.number.size for each, value in own.items() if each.default == 0.0 and value != 0.0}
    if workpiece.edge_force_spread != _USUAL.edge_force_spread:
        data[_UNTOLD_EDGE.key] = workpiece.edge_force_spread * 1e-3
    spreads = {each: value for each, value in own.items() if each.number.unit == "%"}
    return data | {each.key: _percent(value) for each, value in spreads.items() if all_spreads or value != each.in_si(each.default)}


def _percent(share: float) -> float:
    # 100 x 0.07 is not 7, and nobody wrote the last digit
    return float(f"{100.0 * share:.14g}")
