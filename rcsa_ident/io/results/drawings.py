"""What is known of toolings whose drawings are rough, between RESULT.json and nouns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import SHOWN
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.io.validated_table import Table, describe
from rcsa_ident.tool_holder.alteration import ALTERATIONS
from rcsa_ident.tool_holder.drawings import KnownToolings, RoughUnknown
from rcsa_ident.tool_holder.learnt import TERMS, LearnedValue
from rcsa_ident.tool_holder.spread import LENGTHS

_NUMBERS = ("drawn", "spread", "found", "deviation")
_KINDS = ("tooling", "tool", "holder")
#: Fields of an alteration that are lengths: the spreads that are, and the fluted part's.
_LENGTHS = (*LENGTHS, "fluted_length")


def known_toolings_to_json(known: KnownToolings, learned: Sequence[LearnedValue] = ()) -> dict[str, Any]:
    """Return what is known of toolings as a result holds it: each number in millimetres or percent, and the covariance in their spreads.

    `learned`: the same in the terms of the drawings, for those who read it
    """
    rows = []
    for k, unknown in enumerate(known.unknowns):
        size = known.spread[k] * (1e3 if unknown.field in _LENGTHS else 100.0)
        unit = "mm" if unknown.field in _LENGTHS else "percent"
        rows.append(
            {
                "what": unknown.field,
                "of": unknown.owner,
                "kind": unknown.kind,
                f"spread_{unit}": float(size),
                f"found_{unit}": float(size * known.mean[k]),
                f"std_{unit}": float(size * known.deviation[k]),
            }
        )
    told = {"learned": [_learned(each) for each in learned]} if learned else {}
    return {"cut": list(known.toolings), **told, "unknowns": rows, "covariance": known.covariance.tolist()}


def _learned(value: LearnedValue) -> dict[str, Any]:
    """A number of a drawing before and after the cuts, in the unit that it is shown in."""
    unit, size = SHOWN.get(value.unit, (value.unit, 1.0))
    numbers = {name: getattr(value, name) * size for name in _NUMBERS}
    return {"toolings": list(value.toolings), "what": value.words, "unit": unit, **numbers, "hardly_taught": value.hardly}


def learned_of(toolings: Mapping[str, Any]) -> tuple[LearnedValue, ...]:
    """Return the numbers of drawings before and after the cuts from a result's ``toolings``; none where the file holds none."""
    fields = {words: field for field, (words, _) in TERMS.items()}
    found = []
    for row in toolings.get("learned", ()):
        field = fields[row["what"]]
        _, size = SHOWN.get(TERMS[field][1], ("", 1.0))
        found.append(LearnedValue(field, tuple(row["toolings"]), *(row[name] / size for name in _NUMBERS)))
    return tuple(found)


def known_toolings_of(table: Table) -> KnownToolings:
    """Return what is known of toolings from a result's table. Raises `InputError` if something is missing or does not belong together."""
    unknowns, spread, mean = [], [], []
    for row in table.tables("unknowns"):
        field = row.text("what", choices=ALTERATIONS)
        unknowns.append(RoughUnknown(field, row.text("of"), row.text("kind", choices=_KINDS)))
        unit, size = ("mm", 1e-3) if field in _LENGTHS else ("percent", 1e-2)
        wide = row.number(f"spread_{unit}", unit, above=0.0)
        spread.append(wide * size)
        mean.append(row.number(f"found_{unit}", unit) / wide)
    covariance = matrix_of(table, "covariance", (len(unknowns), len(unknowns)))
    return KnownToolings(
        tuple(unknowns), np.array(spread), np.array(mean), covariance, tuple(table.texts("cut", "names of toolings", False))
    )


def axis_toolings_to_json(posterior: Posterior) -> dict[str, Any]:
    """Return how an axis' unknowns hang on those of the toolings; nothing where these are exact."""
    if not posterior.tooling_covariance.size:
        return {}
    return {"toolings": {"cross": posterior.tooling_cross.tolist(), "rivals": [each.tolist() for each in posterior.rival_toolings]}}


def axis_toolings_of(axis: Table, known: KnownToolings | None, size: int, rivals: int) -> Mapping[str, Any]:
    """Return the fields of an axis' `Posterior` that belong to toolings.

    `size`: unknowns of the axis
    `rivals`: other models of the same data
    """
    if known is None or "toolings" not in axis:
        return {}
    table, count = axis.table("toolings"), len(known.unknowns)
    return {
        "tooling_cross": matrix_of(table, "cross", (size, count)),
        "tooling_covariance": known.covariance,
        "rival_toolings": tuple(matrix_of(table, "rivals", (rivals, count))),
    }


def matrix_of(table: Table, key: str, shape: Sequence[int]) -> FloatArray:
    """Return a list of rows of numbers as an array of a shape."""
    allowed = f"{shape[0]} rows of {shape[1]} finite numbers"
    rows = table.value(key, allowed)
    try:
        found = np.array(rows, dtype=float).reshape(shape)
    except (TypeError, ValueError):
        table.refuse(key, describe(rows), allowed)
    if not np.all(np.isfinite(found)):
        table.refuse(key, "numbers that are not finite", allowed)
    return found
