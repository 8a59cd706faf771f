"""[[cuts]] of a campaign: speed, depth, feed, and what stood around the cutter; read and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.plausibility import LARGEST_SWEEP, LEAST_SWEEP
from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.cutting.conditions import AnyEngagement, Block, CuttingConditions, Engagement, EngagementMap, Stepover
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.stock import check_cut, engagement_between, engagement_with
from rcsa_ident.io.settings.engagements import COLUMNS as MAP_COLUMNS
from rcsa_ident.io.settings.engagements import MOST_ROWS, engagement_map_of, read_engagement_map, rows_of_map
from rcsa_ident.io.validated_table import Table, as_number, describe
from rcsa_ident.setup.cut import Cut
from rcsa_ident.setup.fields import CUT, ENGAGEMENT, RECORDINGS, keys_of, told_in_si
from rcsa_ident.setup.tooling import Tooling

FEED_DIRECTIONS = {"+X": 0.0, "-X": np.pi, "+Y": 0.5 * np.pi, "-Y": -0.5 * np.pi}
_ANGLES, _SIDES, _RADIAL = ("entry_angle_deg", "exit_angle_deg"), ("y_from_mm", "y_to_mm"), ("radial_depth_mm", "strategy")
ENGAGEMENT_KEYS = keys_of(ENGAGEMENT)
_CUT = {each.key: each for each in (*CUT, *RECORDINGS)}
#: Recordings stand behind the direction of the feed.
CUT_KEYS = (*keys_of(CUT[: CUT.index(_CUT["posture_deg"])]), *keys_of(RECORDINGS), *keys_of(CUT[CUT.index(_CUT["posture_deg"]) :]))
_CONDITIONS = tuple(_CUT[key] for key in ("spindle_speed_rpm", "axial_depth_mm", "feed_per_tooth_mm"))


def cut_of(table: Table, toolings: Mapping[str, Tooling], locate: Callable[[Table, str], Path]) -> Cut:
    """Return a cut of a campaign.

    `table`: of `CUT_KEYS`
    `locate`: given the table and one of its keys ``cut``, ``air`` and ``engagement``, returns the file
    Raises `InputError`, which names the file, the key, what was found and what is allowed; also of a cut that the cutter cannot make.
    """
    tooling = table.text("tooling", choices=tuple(toolings), names_of="toolings")
    cutter = toolings[tooling].cutter
    programmed = told_in_si(_CONDITIONS, table.fields(_CONDITIONS))
    conditions = CuttingConditions(**programmed, engagement=engagement_of(table, cutter, locate), feed_angle=feed_angle_of(table))
    own = {"depth": table.name("axial_depth_mm"), "helix": table.name("axial_depth_mm")}
    with table.naming(own):
        check_cut(cutter, conditions.engagement, conditions.axial_depth, conditions.feed_per_tooth)
    name = table.text("id")
    air = locate(table, "air") if "air" in table else None
    posture = tuple(radians(each) for each in table.numbers("posture_deg", None, "deg")) if "posture_deg" in table else ()
    return Cut(
        name,
        tooling,
        conditions,
        locate(table, "cut"),
        air,
        _last_speed(table, conditions.spindle_speed),
        posture,
        table.moment("started"),
        table.field(_CUT["temperature_c"]),
        table.field(_CUT["validation"]),
    )


def engagement_of(table: Table, cutter: Cutter, locate: Callable[[Table, str], Path]) -> AnyEngagement:
    """Return how a cutter is engaged, of a table that has `ENGAGEMENT_KEYS`.

    `locate`: given the table and the key ``engagement``, returns the file
    """
    stock = table.field(_CUT["stock"])
    if "engagement" in table:
        _alone(table, "engagement", (*_ANGLES, *_RADIAL, *_SIDES, "stock"))
        lead = np.radians(table.field(_CUT["lead_deg"]))
        # what it does to the engagement is in the map
        table.field(_CUT["tilt_deg"])
        return _map(table, float(lead), locate)
    for key in ("lead_deg", "tilt_deg"):
        if key in table:
            table.refuse(key, "given without engagement", "a tool that leans needs the map of its engagement")
    if stock == "block" or (stock is None and any(key in table for key in _SIDES)):
        return _block(table, cutter)
    _alone(table, "stock = stepover", _SIDES)
    if any(key in table for key in _RADIAL):
        _alone(table, "radial_depth_mm", _ANGLES)
        widest = 2e3 * cutter.outline.largest_radius
        width = table.field(_CUT["radial_depth_mm"].up_to(widest * (1.0 + 1e-9)).needed)
        # a slot is up and down milling
        needs = "strategy" in table or width < widest * (1.0 - 1e-9)
        strategy = table.field(_CUT["strategy"].needed) if needs else "down"
        return engagement_with(Stepover(1e-3 * width, strategy), cutter)
    entry, leave = _angles(table)
    found = engagement_between(entry, leave, cutter)
    if stock == "stepover" and cutter.profile is not None and isinstance(found, Engagement):
        between = f"{np.degrees(entry):g} to {np.degrees(leave):g}"
        table.refuse("stock", f"a stepover between {between} degrees", "angles from 0 or to 180, or radial_depth_mm with a strategy")
    return found


def _map(table: Table, lead: float, locate: Callable[[Table, str], Path]) -> EngagementMap:
    """A map in a file of its own, or row by row."""
    allowed = f"a file with columns {', '.join(MAP_COLUMNS)}, or rows of these three numbers"
    row = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
    rows = {"type": "array", "items": row, "minItems": 1, "maxItems": MOST_ROWS}
    found = table.value("engagement", allowed, schema={"anyOf": [{"type": "string", "pattern": r"\S"}, rows], "description": allowed})
    if isinstance(found, str):
        return read_engagement_map(locate(table, "engagement"), lead)
    if not isinstance(found, list) or not 1 <= len(found) <= MOST_ROWS:
        table.refuse("engagement", describe(found), allowed)
    numbers = [[as_number(value) for value in each] if isinstance(each, list) and len(each) == 3 else [None] for each in found]
    wrong = next((k for k, each in enumerate(numbers) if None in each), None)
    if wrong is not None:
        table.refuse("engagement", f"row {wrong + 1}: {describe(found[wrong])}", allowed)
    with table.naming({name: table.name("engagement") for name in ("engagement map", "engagement map heights", "engagement map angles")}):
        z, entry, leave = np.array(numbers, dtype=float).T
        return engagement_map_of(z, entry, leave, lead)


def _block(table: Table, cutter: Cutter) -> AnyEngagement:
    """A block by its sides, or by the angles of its corners at the cutter's diameter."""
    _alone(table, "stock = block", _RADIAL)
    if any(key in table for key in _SIDES):
        _alone(table, "y_from_mm", _ANGLES)
        low, high = (table.field(_CUT[key].needed) * 1e-3 for key in _SIDES)
        if not low < high:
            table.refuse("y_to_mm", f"{1e3 * high:g}", f"above y_from_mm, {1e3 * low:g} [mm]")
    else:
        entry, leave = _angles(table)
        low, high = (0.5 * cutter.diameter * float(np.cos(angle)) for angle in (leave, entry))
    with table.naming({"y_from and y_to": table.name("y_from_mm")}):
        return engagement_with(Block(low, high), cutter)


def _angles(table: Table) -> tuple[float, float]:
    entry, leave = (table.field(_CUT[key].needed) for key in _ANGLES)
    if leave <= entry:
        table.refuse("exit_angle_deg", f"{leave:g}", f"above entry_angle_deg, {entry:g}, and at most 180 [deg]")
    return float(np.radians(entry)), float(np.radians(leave))


def _alone(table: Table, told: str, others: tuple[str, ...]) -> None:
    """Refuse keys that tell the engagement a second time."""
    for key in others:
        if key in table:
            table.refuse(key, f"given beside {told}", f"one way to tell the engagement: without it, or without {told}")


def _last_speed(table: Table, first: float) -> float | None:
    """At which a pass ends whose speed changes, [rad/s]."""
    if "spindle_speed_to_rpm" not in table:
        return None
    last = from_rpm(table.field(_CUT["spindle_speed_to_rpm"]))
    if not LEAST_SWEEP <= abs(last / first - 1.0) <= LARGEST_SWEEP:
        allowed = f"{100 * LEAST_SWEEP:g} % to {100 * LARGEST_SWEEP:g} % beside spindle_speed_rpm, {to_rpm(first):g}"
        table.refuse("spindle_speed_to_rpm", f"{to_rpm(last):g}", f"{allowed}; without it the cut keeps its speed")
    return last


def feed_angle_of(table: Table) -> float:
    value = table.field(_CUT["feed_direction"])
    return FEED_DIRECTIONS[value] if isinstance(value, str) else float(np.radians(value))


def feed_direction_of(angle: float) -> str | float:
    """Return what ``feed_direction`` says of an angle [rad]: an axis, or degrees from +X."""
    return next((axis for axis, known in FEED_DIRECTIONS.items() if abs(angle - known) < 1e-12), float(np.degrees(angle)))


def cut_keys(
    name: str, tooling: str, conditions: CuttingConditions, last_speed: float | None = None, posture: Sequence[float] = ()
) -> dict[str, Any]:
    """Return an entry of ``[[cuts]]``; its recordings are named after it.

    `last_speed` [rad/s]: of a pass whose speed changes
    `posture`: sequence of float [rad], of a robot's joints, if it is one
    """
    return {
        "id": name,
        "tooling": tooling,
        "spindle_speed_rpm": to_rpm(conditions.spindle_speed),
        **({} if last_speed is None else {"spindle_speed_to_rpm": to_rpm(last_speed)}),
        "axial_depth_mm": conditions.axial_depth * 1e3,
        "feed_per_tooth_mm": conditions.feed_per_tooth * 1e3,
        **_engagement_keys(conditions.engagement),
        "feed_direction": feed_direction_of(conditions.feed_angle),
        "cut": f"recordings/{name}_cut.h5",
        "air": f"recordings/{name}_air.h5",
        **({"posture_deg": [degrees(each) for each in posture]} if len(posture) else {}),
    }


def _engagement_keys(engagement: AnyEngagement) -> dict[str, Any]:
    match engagement:
        case Block(y_from, y_to):
            return {"stock": "block", "y_from_mm": 1e3 * y_from, "y_to_mm": 1e3 * y_to}
        case Stepover(width, strategy):
            return {"stock": "stepover", "radial_depth_mm": 1e3 * width, "strategy": strategy}
        case EngagementMap():
            lead = {"lead_deg": float(np.degrees(engagement.feed_rise))} if engagement.feed_rise else {}
            return {"engagement": rows_of_map(engagement).tolist(), **lead}
        case Engagement(entry, leave):
            return {"entry_angle_deg": float(np.degrees(entry)), "exit_angle_deg": float(np.degrees(leave))}
