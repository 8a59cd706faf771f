"""`learned` of RESULT.json, and how an axis changes with a temperature: what was learned beyond the modes, out and in."""

from __future__ import annotations

from typing import Any

import numpy as np

from rcsa_ident.cutting.coefficients import ForceLaw
from rcsa_ident.identification.learned_changes import LearnedChanges, LearnedFactor, LearnedWarming
from rcsa_ident.identification.posterior import Posterior, Warmed
from rcsa_ident.io.validated_table import Table


def changes_to_json(found: LearnedChanges) -> dict[str, Any]:
    """Return the table `learned`; empty where nothing was learned."""
    told: dict[str, Any] = {"in_words": list(found.words)} if found else {}
    if found.warming is not None:
        known = found.warming
        warming = {
            "by": "temperature" if known.thermometer else "time",
            "frequency_percent": 100.0 * known.frequency,
            "frequency_std_percent": 100.0 * known.deviation,
            "time_constant_min": None if known.time_constant is None else known.time_constant / 60.0,
            "speed_exponent": known.exponent,
            "warmed_up": None if known.thermometer else known.warmed_up,
            "coldest_c": known.coldest,
            "warmest_c": known.warmest,
        }
        told["warming"] = {key: value for key, value in warming.items() if value is not None}
    if found.orders:
        told["force_orders"] = [
            {"axis": axis.upper(), "kind": kind + 1, "order": order} | _factor(each) | {"angle_deg": float(np.degrees(each.log.imag))}
            for (axis, kind, order), each in found.orders.items()
        ]
    if found.law is not None:
        told["force_law"] = _law(found.law)
    for key, factors in (("force_scales", found.scales), ("joints", found.joints)):
        if factors:
            told[key] = {name: _factor(each) for name, each in factors.items()}
    if found.amplitude is not None:
        told["joint_in_loudest_cut"] = _factor(found.amplitude)
    return told


def _law(found: ForceLaw) -> dict[str, Any]:
    return {
        "chip_exponent": _known(found.exponent),
        "tangential_edge_n_per_mm": _known(found.tangential_edge, 1e-3),
        "radial_edge_n_per_mm": _known(found.radial_edge, 1e-3),
        "entry_deg": [{"kind": kind + 1} | _known(each, float(np.degrees(1.0))) for kind, each in found.entry.items()],
        "explained_percent": 100.0 * found.explained,
        "feed_per_tooth_mm": 1e3 * found.feed,
    }


def law_of(top: Table) -> ForceLaw | None:
    """Return the law of the force that a result has learned; None where it does not say so."""
    table = top.table("learned", default={})
    law = table.table("force_law", default={})
    if "feed_per_tooth_mm" not in law:
        return None
    k_te, k_re = (_pair(law.table(f"{name}_edge_n_per_mm"), 1e3) for name in ("tangential", "radial"))
    entries = {each.number("kind", least=1, whole=True) - 1: _pair(each, float(np.radians(1.0))) for each in law.tables("entry_deg")}
    explained = 1e-2 * law.number("explained_percent", "%", least=0.0)
    feed = 1e-3 * law.number("feed_per_tooth_mm", "mm", above=0.0)
    return ForceLaw(_pair(law.table("chip_exponent")), k_te, k_re, entries, explained, feed)


def _pair(table: Table, unit: float = 1.0) -> tuple[float, float]:
    return unit * table.number("value"), unit * table.number("std", least=0.0)


def _known(value: tuple[float, float], unit: float = 1.0) -> dict[str, float]:
    return {"value": unit * value[0], "std": unit * value[1]}


def _factor(found: LearnedFactor) -> dict[str, float]:
    return {"percent": 100.0 * found.share, "std_percent": 100.0 * (1.0 + found.share) * found.deviation}


def warming_of(top: Table) -> LearnedWarming | None:
    """Return how a result's machine warms up; None where it does not say so."""
    table = top.table("learned", default={})
    if "warming" not in table:
        return None
    known = table.table("warming")
    by = known.text("by", choices=("time", "temperature"))
    shares = known.number("frequency_percent", "%") * 1e-2, known.number("frequency_std_percent", "%", least=0.0) * 1e-2
    if by == "time":
        constant, warmed_up = known.number("time_constant_min", "min", above=0.0) * 60.0, known.value("warmed_up", "true or false", False)
        return LearnedWarming(*shares, constant, known.number("speed_exponent"), warmed_up=bool(warmed_up))
    coldest, warmest = known.number("coldest_c", "°C"), known.number("warmest_c", "°C")
    if not coldest < warmest:
        known.refuse("warmest_c", f"{warmest:g}", f"above coldest_c, {coldest:g} [°C]")
    return LearnedWarming(*shares, coldest=coldest, warmest=warmest)


def warmed_to_json(posterior: Posterior) -> dict[str, Any]:
    """Return how an axis changes with the temperature, beside its other unknowns; empty where it does not."""
    known = posterior.warmed
    if known is None:
        return {}
    rows = {"unknowns": known.change, "cross": known.cross, "covariance": known.covariance}
    told = {name: each.tolist() for name, each in rows.items()}
    return {"warming": told | {"rivals": [rival.tolist() for rival in known.rivals]}}


def warmed_of(axis: Table, size: int, pairs: int, rivals: int) -> Warmed | None:
    """Return the same of an axis.

    `size`: of its other unknowns
    `pairs`: entries of a lower triangle over its modes
    `rivals`: how many it has
    """
    if "warming" not in axis:
        return None
    table = axis.table("warming")
    change = np.array(table.numbers("unknowns", pairs))
    cross, covariance = (_matrix(table, name, (count, pairs)) for name, count in (("cross", size), ("covariance", pairs)))
    others = table.value("rivals", "a list of numbers for each rival", [])
    if not isinstance(others, list) or len(others) != rivals:
        table.refuse("rivals", f"{len(others) if isinstance(others, list) else 'no'} lists", f"{rivals}, one for each rival of the axis")
    rows = [np.array(Table({"rivals": row}, table.where, table.path).numbers("rivals", None)) for row in others]
    return Warmed(change, cross, covariance, tuple(rows))


def _matrix(table: Table, name: str, shape: tuple[int, int]) -> np.ndarray:
    allowed = f"{shape[0]} rows of {shape[1]} numbers"
    rows = table.value(name, allowed)
    if not isinstance(rows, list) or len(rows) != shape[0]:
        table.refuse(name, f"{len(rows) if isinstance(rows, list) else 'no'} rows", allowed)
    return np.array([Table({name: row}, table.where, table.path).numbers(name, shape[1]) for row in rows]).reshape(shape)
