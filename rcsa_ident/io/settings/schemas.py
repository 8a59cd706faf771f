"""JSON Schema of the TOML files that people write, made of what their readers ask of some files: no key has a second list.

A reader is run over files that make it ask for everything it knows. What it asks there (types, limits, choices, what must be there) is
the schema; a limit that two files of these disagree on hangs on other keys, and only the reader knows it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from contextvars import Context
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.io.settings.cases import cases_of
from rcsa_ident.io.settings.machines import machine_of
from rcsa_ident.io.settings.modes import modes_of
from rcsa_ident.io.settings.robots import robot_of
from rcsa_ident.io.settings.setups import campaign_of, tooling_of
from rcsa_ident.io.validated_table import Asked, Table, listening
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict

#: draft-07 is what editors' TOML extensions understand.
DIALECT = "http://json-schema.org/draft-07/schema#"

_SEGMENTS = [
    {"length_mm": 26.0, "outer_diameter_mm": 9.6, "material": "carbide", "area_mm2": 50.0, "second_moment_mm4": 300.0},
    {"length_mm": 84.5, "outer_diameter_mm": 12.0, "material": "own"},
]
_MATERIAL = {"youngs_modulus_gpa": 600.0, "density": 14400.0, "poisson": 0.22}
_MATERIALS = {"own": _MATERIAL, "carbide": dict(_MATERIAL)}
_HOLDER: dict[str, Any] = {
    "insertion_mm": 40.0,
    "segments": [
        {"length_mm": 40.0, "outer_diameter_mm": 50.0, "material": "steel"},
        {"length_mm": 20.0, "outer_diameter_mm": 60.0, "material": "steel"},
    ],
}
_WAVE: dict[str, Any] = {"amplitude_mm": 0.2, "wavelength_mm": 1.5, "shape": "table", "table": [0.0, 1.0]}
_OFFSETS = {"runout_mm": [0.0] * 2, "axial_runout_mm": [0.0] * 2}
_CUTTER: dict[str, Any] = {
    "teeth": 4, "diameter_mm": 12.0, "pitch_deg": [90.0] * 4, "serration": _WAVE | {"shift": [0.0] * 4},
    "runout_mm": [0.0] * 4, "axial_runout_mm": [0.0] * 4,
}  # fmt: skip
_STIFF = {"translational_stiffness": 2e10, "rotational_stiffness": 6e5, "translational_damping": 6e4, "rotational_damping": 9.0}
_PLAIN: dict[str, Any] = {
    "cutter": {"teeth": 2, "diameter_mm": 12.0},
    "tool": {"stickout_mm": 60.0, "segments": [{"length_mm": 100.0, "outer_diameter_mm": 12.0, "material": "carbide"}]},
    "holder": _HOLDER,
}
_TOOLINGS = (
    _PLAIN,
    _PLAIN | {"cutter": _CUTTER | {"teeth": 2, "pitch_deg": [180.0] * 2, "serration": _WAVE | {"shift": [0.0] * 2}} | _OFFSETS},
    _PLAIN | {"cutter": {"teeth": 2, "diameter_mm": 12.0, "serration": {"amplitude_mm": 0.2, "wavelength_mm": 1.5}}},
    {
        "cutter": _CUTTER,
        "tool": {"stickout_mm": 70.0, "segments": _SEGMENTS},
        "holder": _HOLDER,
        "contact": _STIFF,
        "materials": _MATERIALS,
        "spread": {},
    },
)
#: A tooling of other sizes: what hangs on those of the tooling is no limit of a campaign's keys.
_WIDER = _PLAIN | {"cutter": {"teeth": 2, "diameter_mm": 14.0}, "tool": _PLAIN["tool"] | {"stickout_mm": 58.0}}
_WORKPIECE = {
    "name": "EN AW-6082",
    "tangential_coefficient_mpa": 900.0,
    "radial_ratio": 0.3,
}
_FEED = {"axial_depth_mm": 0.4, "feed_per_tooth_mm": 0.1, "feed_direction": "+X"}
_ANGLES = {**_FEED, "entry_angle_deg": 90.0, "exit_angle_deg": 180.0}
_STOCKS: tuple[dict[str, Any], ...] = (
    {"stock": "stepover", "radial_depth_mm": 3.0, "strategy": "down"},
    {"stock": "block", "y_from_mm": -6.0, "y_to_mm": 2.0},
    {"engagement": [[0.0, 90.0, 180.0], [1.0, 90.0, 180.0]]},
)
_CAMPAIGNS = (
    {
        "sensors": {
            "fixture_x": {"quantity": "acceleration", "axis": "X", "sensitivity": 1.1e-3},
            "force_z": {"quantity": "force", "axis": "Z", "sensitivity": 1e-2},
            "trigger": {"quantity": "trigger"},
        },
        "workpiece": _WORKPIECE,
        "toolings": {"S1": "toolings/S1.toml", "S2": "toolings/S2.toml"},
        "cuts": [
            {"id": "1", "tooling": "S1", "spindle_speed_rpm": 8000.0, **_ANGLES, "cut": "recordings/1.h5", "air": "recordings/a.h5"},
            {"id": "wider", "tooling": "S2", "spindle_speed_rpm": 8000.0, **_FEED, **_STOCKS[0], "cut": "recordings/5.h5"},
            *(
                {"id": f"{2 + k}", "tooling": "S1", "spindle_speed_rpm": 8000.0, **_FEED, **stock, "cut": f"recordings/{2 + k}.h5"}
                for k, stock in enumerate(_STOCKS)
            ),
        ],
    },
    {
        "sensors": {"flange_y": {"quantity": "displacement", "axis": "Y", "sensitivity": 1e4}},
        "workpiece": dict(_WORKPIECE),
        "toolings": {"S1": "toolings/S1.toml"},
        "cuts": [
            {"id": "1", "tooling": "S1", "spindle_speed_rpm": 8000.0, "spindle_speed_to_rpm": 9e3, **_ANGLES, "cut": "recordings/1.h5"},
            {"id": "2", "tooling": "S1", "spindle_speed_rpm": 500.0, **_ANGLES, "cut": "recordings/2.h5", "posture_deg": [0.0, 20.0]},
        ],
    },
    {
        "toolings": {"S1": "toolings/S1.toml", "S2": "toolings/S2.toml"},
        "frfs": [
            {"id": "longer", "tooling": "S2", "axis": "X", "response": 80.0, "force": "flange", "file": "frfs/1.frf"},
            {"id": "1", "tooling": "S1", "axis": "X", "response": "tip", "force": 80.0, "file": "frfs/1.frf"},
        ],
    },
)
_BEARING = {"position_mm": 48.0, "stiffness": [3.6e8, 3.3e8], "damping": [8.5e3, 7.6e3]}
_HOUSING = {
    "position_mm": 190.0, "mass": 160.0, "inertia": 5.5, "stiffness": [8.3e7, 7e7], "damping": [1.1e4, 1e4],
    "tilting_stiffness": [1.1e7, 9.5e6], "tilting_damping": [9e2, 8e2],
}  # fmt: skip
_SIDE_MODE = {"natural_frequency_hz": 420.0, "damping_ratio": 0.04, "stiffness_n_per_m": 1e7}
_MACHINE: dict[str, Any] = {
    "shaft": {"segments": [{"length_mm": 500.0, "outer_diameter_mm": 88.0, "material": "steel"}]},
    "bearings": [_BEARING],
    "housing": _HOUSING,
    "joint": {key: 1e3 * value for key, value in _STIFF.items()},
    "workpiece": _WORKPIECE,
    "cuts": {"toolings": ["S1.toml"], "spindle_speeds_rpm": [8000.0], **_ANGLES},
}
_MACHINES = (
    _MACHINE,
    _MACHINE
    | {
        "shaft": {"segments": _SEGMENTS},
        "materials": _MATERIALS,
        "cuts": {**_MACHINE["cuts"], "spindle_speeds_rpm": {"from": 8000.0, "to": 20_000.0, "count": 4}},
        "workpiece_side": {"y": [_SIDE_MODE]},
    },
    _MACHINE
    | {
        "cuts": {
            **{key: value for key, value in _MACHINE["cuts"].items() if key != "spindle_speeds_rpm"},
            "passes_rpm": {"from": 8000.0, "to": 20_000.0, "count": 12},
        },
        "sensors": {"housing_positions_mm": [350.0]},
        "workpiece_side": {"x": [_SIDE_MODE]},
        "warming": {"loss_percent": 5.0},
        "joint_changes": {},
        "chip_law": {"exponent": -0.2},
    },
)
_MODE = {"natural_frequency_hz": 500.0, "damping_ratio": 0.03}
_MODES = (
    {
        "x": [_MODE | {"modal_mass_kg": 1.0}, _MODE | {"stiffness_n_per_m": 1e7}],
        "z": [_MODE | {"modal_mass_kg": 1.0}, _MODE | {"stiffness_n_per_m": 1e7}],
    },
    {
        "y": [
            _MODE | {"modal_mass_kg": 1.0},
            _MODE | {"stiffness_n_per_m": 1e7},
        ],
        "coefficients": {"tangential_mpa": 900.0, "radial_mpa": 270.0},
    },
    {
        "modes": [
            _MODE | {"modal_mass_kg": 1.0, "direction_cosines": [0.6, 0.8, 0.0]},
            _MODE | {"stiffness_n_per_m": 1e7, "direction_cosines": [0.6, 0.8, 0.0]},
        ]
    },
)
_LINK: dict[str, Any] = {"mass_kg": 200.0}
_TURNED = {"offset_mm": [0.0, 0.0, 500.0], "turn_deg": [90.0, 0.0, 0.0]}
_WEIGHED = {"center_of_mass_mm": [0.0, 0.0, 250.0], "inertia_kg_m2": [20.0, 20.0, 5.0, 0.0, 0.0, 0.0]}
_JOINT: dict[str, Any] = {"name": "J1", "axis": [0.0, 0.0, 1.0], "stiffness_nm_per_rad": 2e6}
_ROBOTS: tuple[dict[str, Any], ...] = (
    {"robot": {"name": "plain"}, "joints": [_JOINT | {"link": _LINK}]},
    {
        "robot": {"name": "all", "gravity_m_per_s2": [0.0, 0.0, -9.81]},
        "joints": [
            {
                **_JOINT,
                "limits_deg": [-120.0, 120.0],
                "link": _LINK | _WEIGHED,
                "tilts": [{"axis": [0.0, 1.0, 0.0], "stiffness_nm_per_rad": 5e6}],
            }
        ],
        "flange": dict(_TURNED),
        "tool_point": dict(_TURNED),
        "payload": _LINK | _WEIGHED,
    },
    {"robot": {"name": "frames"}, "joints": [_JOINT | _TURNED], "payload": dict(_LINK)},
)


_NAMED = {"tooling": "S1.toml", "feed_direction": "+X"}
_CASES = (
    {"cases": [_NAMED | {"entry_angle_deg": 90.0, "exit_angle_deg": 180.0}]},
    {"cases": [{"tests": "CUTS.csv", "tooling": "S1.toml", **stock} for stock in _STOCKS]},
    {"cases": [_NAMED | {"tooling": "S2.toml"} | _STOCKS[0]]},
)


def _read_cases(data: Mapping[str, Any]) -> object:
    some = {key: Context().run(tooling_of, data, "", "") for key, data in (("S1.toml", _PLAIN), ("S2.toml", _WIDER))}
    cuts = TestedCuts(np.ones(1), np.ones(1), (Verdict.STABLE,))
    return cases_of(data, "", Path(), lambda path: some.get(path.name, some["S1.toml"]), lambda _path: cuts)


def _read_campaign(data: Mapping[str, Any]) -> object:
    # in a context of its own, where nobody listens: a tooling is another file
    some = {key: Context().run(tooling_of, data, "", "") for key, data in (("S1", _PLAIN), ("S2", _WIDER))}

    def tooling(table: Table, key: str) -> Tooling:
        table.text(key, allowed="the path of a tooling file")
        return some.get(key, some["S1"])

    return campaign_of(data, "", "", tooling, lambda table, key: Path(table.text(key, allowed="the path of a recording")))


#: Files by name: what they are, their reader, and files that between them have every table, every choice of keys, and what is asked for
#: only where it is there; each of these is missing from one of them.
_FILES: dict[str, tuple[str, Callable[[Mapping[str, Any]], object], Iterable[Mapping[str, Any]]]] = {
    "tooling": ("A holder, a tool clamped in it, and the cutter", lambda data: tooling_of(data, "", ""), _TOOLINGS),
    "campaign": ("campaign.toml: sensors, workpiece, toolings, cuts and hammer tests", _read_campaign, _CAMPAIGNS),
    "machine": ("MACHINE.toml: a virtual machine", lambda data: machine_of(data, "", "", Path()), _MACHINES),
    "modes": ("MODES.toml: modes of the tip", lambda data: modes_of(data, ""), _MODES),
    "cases": ("CASES.toml: tested cuts of several toolings, which `cases` lays over their lobes", _read_cases, _CASES),
    "robot": ("ROBOT.toml: an arm, its joints, links and springs", lambda data: robot_of(dict(data), ""), _ROBOTS),
}
SCHEMAS = tuple(_FILES)


@cache
def schema_of(name: str) -> dict[str, Any]:
    """Return the JSON Schema of one of `SCHEMAS`. Raises `KeyError` if there is none of that name."""
    title, read, files = _FILES[name]
    visits: dict[str, list[Asked]] = {}
    for data in files:
        with listening() as asked:
            read(data)
        opened = {visit.path for visit in asked.values() if visit.known is None}
        for visit in asked.values():
            parent, _, _last = visit.path.rpartition(".")
            place = f"{parent}.*" if parent in opened else re.sub(r"\[\d+\]", "[]", visit.path)
            visits.setdefault(place, []).append(visit)
    return {"$schema": DIALECT, "title": title, **_table(visits, "")}


def schema_text(name: str) -> str:
    """Return the JSON Schema of one of `SCHEMAS` as a file holds it."""
    return json.dumps(schema_of(name), indent=2, ensure_ascii=False) + "\n"


def _table(visits: Mapping[str, list[Asked]], place: str) -> dict[str, Any]:
    """The schema of a table; keys that depend on another's choice make it one of several."""
    kinds: dict[tuple[str, ...] | None, list[Asked]] = {}
    for visit in visits[place]:
        kinds.setdefault(None if visit.known is None else tuple(visit.known), []).append(visit)
    if None in kinds:
        inner = [schema for visit in kinds[None] for schema in visit.keys.values()]
        return {"type": "object", "additionalProperties": _merged(inner, visits) if inner else _table(visits, f"{place}.*")}
    found = [_kind(visits, group, len(kinds) > 1) for group in kinds.values()]
    return found[0] if len(found) == 1 else {"anyOf": found}


def _kind(visits: Mapping[str, list[Asked]], group: list[Asked], several: bool) -> dict[str, Any]:
    known = tuple(group[0].known or ())
    keys = {key: [visit.keys[key] for visit in group if key in visit.keys] for key in known}
    if silent := [key for key, asked in keys.items() if not asked]:
        raise LookupError(f"nobody asks for {', '.join(silent)} of [{group[0].path}]: a file of this module lacks it")
    properties = {key: _merged(asked, visits) for key, asked in keys.items()}
    if several:
        # what the choices of this kind are shows in the files of this kind
        for key, found in properties.items():
            if "enum" in found and all(key in visit.required for visit in group):
                taken = {visit.data[key] for visit in group}
                found["enum"] = [choice for choice in found["enum"] if choice in taken]
    schema: dict[str, Any] = {"type": "object", "properties": properties, "additionalProperties": False}
    if required := [key for key in known if all(key in visit.required for visit in group)]:
        schema["required"] = required
    if pairs := list(dict.fromkeys(pair for visit in group for pair in visit.one_of)):
        schema["allOf"] = [{"oneOf": [{"required": [key]} for key in pair]} for pair in pairs]
    return schema


def _merged(asked: list[dict[str, Any]], visits: Mapping[str, list[Asked]]) -> dict[str, Any]:
    """What all agree on, of each type."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for schema in asked:
        kinds.setdefault("table" if "table" in schema else schema.get("type", ""), []).append(schema)
    merged = []
    for kind, schemas in kinds.items():
        if kind == "table":
            (place,) = {re.sub(r"\[\d+\]", "[]", schema["table"]) for schema in schemas}
            merged.append(_table(visits, place))
            continue
        same = {word: value for word, value in schemas[0].items() if all(schema.get(word) == value for schema in schemas)}
        if all("enum" in schema for schema in schemas):
            same["enum"] = list(dict.fromkeys(choice for schema in schemas for choice in schema["enum"]))
        if all("anyOf" in schema for schema in schemas):
            same["anyOf"] = [_merged(list(kind), visits) for kind in zip(*(schema["anyOf"] for schema in schemas), strict=True)]
        if "table" in schemas[0].get("items", {}):
            same["items"] = _merged([schema["items"] for schema in schemas], visits)
        merged.append(same)
    return merged[0] if len(merged) == 1 else {"anyOf": merged}
