"""A tool along a path through stock: read and weighed before a job is accepted, then cut, judged or milled, and drawn for a page."""

from __future__ import annotations

import base64
import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from api.work import tasks
from api.work.path_answers import drawn_path, outline_of, part_of, sentences_of, thinned, wall_errors, way_along
from api.work.requests import MachineText, ToolingSource
from api.work.robots import is_posed, posed
from api.work.toolings import tooling_from, weigh
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz
from rcsa_ident.io.paths.gcode import gcode_of
from rcsa_ident.io.paths.meshes import mesh_of
from rcsa_ident.io.paths.path_tables import columns_text, milling_columns, place_columns, stability_columns
from rcsa_ident.io.paths.tool_paths import PROGRAMS, tool_path_of
from rcsa_ident.io.settings.engagements import write_engagement
from rcsa_ident.machine.machine import TipSource
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.lobes import method_named
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.toolpath.dexel import DexelField, Surface, memory_of
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.workflows.paths.milling import mill_path
from rcsa_ident.workflows.paths.removal import STEP, default_cell, field_of, remove_along, solid_of
from rcsa_ident.workflows.paths.stability import DRAWS, cuts_along, described, stations_along
from rcsa_ident.workflows.tool_change import ToolChange

#: Largest files.
LARGEST_PATH, LARGEST_STOCK = 4_000_000, 8_000_000
#: Places of a path after it is cut up, bytes of the stock's lines, meetings of places and lines, and instants of milling in time.
MOST_PLACES, MOST_MEMORY, MOST_MEETINGS, MOST_INSTANTS = 200_000, 4e8, 2e9, 2e8

#: Told the stage, how much of it is done, and of how much.
Told = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class PathRequest:
    """A path through stock, and what is asked of it.

    `kind`: removal, stability or milling
    `file`, `text`: name and content of the path's file
    `block`: tuple of float [m] or None, lower and upper corner
    `surface`: instead of the block, a closed surface: base64 of an STL file
    `cell`, `step` [m]
    `speed` [rad/s]: of the spindle, where the path has none
    `method`: one of `stability.lobes.METHODS`
    `cutoff` [m]
    """

    kind: str
    file: str
    text: str
    block: tuple[float, ...] | None
    surface: str
    cell: float | None
    step: float | None
    speed: float | None
    cut: CutSpec
    method: str
    bands: bool
    play: bool
    weight: bool
    turn_steps: int
    cutoff: float

    def change(self, machine: TipSource, tooling: Tooling) -> ToolChange:
        """Return the cut on its machine; the depth is each move's own."""
        speeds = np.zeros(0) if self.speed is None else np.array([self.speed])
        judged = self.kind == "stability"
        method = method_named(self.method if judged else ZeroOrder.name)
        return ToolChange(machine, tooling, self.cut, speeds, 1.0, method, DRAWS if judged and self.bands else 0)


def path_of(file: str, text: str) -> ToolPath:
    """Return the path of a file's text; its suffix tells a program from a table, errors name the line."""
    kind = Path(file).suffix.lower()
    if kind not in (*PROGRAMS, ".csv"):
        raise InputError("path", file[-80:] or "nothing", f"a file that ends in {', '.join(PROGRAMS)} or .csv")
    try:
        return gcode_of(text, "") if kind in PROGRAMS else tool_path_of(text, "")
    except InputError as error:
        where = ", ".join(filter(None, (error.where.strip(), error.field)))
        raise InputError("path", f"{where}: {error.found}", error.allowed) from None


def preview(file: str, text: str) -> dict[str, Any]:
    """Return what a path is: its places, length, time at its feeds, and what its moves lack."""
    path = path_of(file, text)
    cutting, lengths = path.cutting, path.lengths
    moving = lengths > 1e-9
    lacking = moving & cutting & ~(path.feed[1:] > 0.0)
    warnings: list[str] = [*path.remarks]
    if np.any(lacking):
        warnings.append(f"{np.count_nonzero(lacking)} moves have no feed")
    still = moving & cutting & ~(path.speed[1:] > 0.0)
    if np.any(still):
        warnings.append(f"{np.count_nonzero(still)} moves have no spindle speed: give one")
    tools = sorted({int(each) for each in path.tool[1:] if each})
    if len(tools) > 1:
        warnings.append(
            f"the program changes its tool: {', '.join(f'T{each}' for each in tools)}; the tooling that is given makes all moves"
        )
    # where the tool may cut; of a path of rapid moves alone, all of it
    ends = np.flatnonzero(cutting & moving)
    reached = path.places[np.unique([*ends, *(ends + 1)]) if ends.size else slice(None)]
    low, high = reached.min(axis=0), reached.max(axis=0)
    return {
        "places": len(path),
        "length_mm": 1e3 * path.length,
        "cutting_length_mm": 1e3 * float(lengths[cutting].sum()),
        "time_s": None if np.any(lacking) else float(path.times[-1]),
        "low_mm": (1e3 * low).tolist(),
        "high_mm": (1e3 * high).tolist(),
        "spindle_speed_told": not bool(np.any(still)),
        "warnings": warnings,
    } | {"path": drawn_path(path)}


def weighed(machine: MachineText | None, tooling: ToolingSource, request: PathRequest) -> None:
    """Refuse what cannot be read, and what is too large for a job, before it is accepted.

    Raises `InputError`, which names the part of the form or the key of its query.
    """
    tool, path = tooling_from(tooling), path_of(request.file, request.text)
    if not np.any(path.lengths > 0.0):
        raise InputError("path", "no move", "one or more")
    block, surface = _stock(request)
    if block is None:
        assert surface is not None
        block = surface[0].min(axis=0), surface[0].max(axis=0)
    low, high = block
    solid = solid_of(tool)
    cell = default_cell(solid.radius, high - low) if request.cell is None else request.cell
    memory = memory_of(high - low, cell)
    if memory > MOST_MEMORY:
        raise InputError(
            "cell_mm",
            f"{1e3 * cell:g} mm, for which the stock takes {memory / 1e6:.0f} MB",
            f"cells for which it takes at most {MOST_MEMORY / 1e6:g} MB",
        )
    step = STEP * solid.radius if request.step is None else request.step
    milled = request.kind == "milling"
    if milled:
        _count_instants(path, request)
    places = len(path) + (0 if milled else int(path.length / step))
    if places > MOST_PLACES:
        field, found = ("path", "one") if milled else ("step_mm", f"{1e3 * step:g} mm, which makes one")
        raise InputError(field, f"{found} of {places} places", f"at most {MOST_PLACES} of them")
    meetings = places * (2.0 * solid.radius / cell) ** 2
    if meetings > MOST_MEETINGS:
        raise InputError(
            "cell_mm",
            f"{1e3 * cell:g} mm on {places} places, where the tool meets {meetings:.2g} lines",
            f"cells with which it meets at most {MOST_MEETINGS:g}",
        )
    if machine is not None:
        change = request.change(_machine(machine, request.bands), tool)
        weigh(tool.assembly, to_hz(float(change.omega[-1])))
        _ = change.process  # coefficients that are not known are said before anything is computed


def _count_instants(path: ToolPath, request: PathRequest) -> None:
    speed = np.where(path.speed[1:] > 0.0, path.speed[1:], request.speed or np.nan)
    moving = path.cutting & (path.lengths > 0.0)
    if np.any(moving & np.isnan(speed)):
        raise InputError("spindle_speed_rpm", "nothing, and the path has none on some moves", "a spindle speed")
    instants = float(np.sum((np.diff(path.times) * speed)[moving])) / (2.0 * np.pi) * request.turn_steps
    if instants > MOST_INSTANTS:
        raise InputError("path", f"one of {instants:.2g} instants", f"at most {MOST_INSTANTS:g}: a part of the path, or fewer steps a turn")


def _stock(request: PathRequest) -> tuple[tuple[FloatArray, FloatArray] | None, Surface | None]:
    """A block's corners [m], or the surface of an STL file."""
    if request.block is not None:
        return (np.array(request.block[:3]), np.array(request.block[3:])), None
    try:
        return None, mesh_of(base64.b64decode(request.surface), ".stl", "")
    except InputError as error:
        raise InputError("stock", error.found, error.allowed) from None


def _machine(text: MachineText, spread: bool) -> TipSource:
    return posed(text.text) if is_posed(text.text) else tasks.known(text, spread)


def cut(machine: MachineText | None, tooling: ToolingSource, request: PathRequest, told: Told) -> dict[str, str]:
    """Return the answer of a job as JSON, and the table of all its rows as the command writes it."""
    tool, path = tooling_from(tooling), path_of(request.file, request.text)
    field = field_of(tool, *_stock(request), request.cell)
    before = field.volume
    if request.kind == "milling":
        assert machine is not None
        answer, table = _milled(request.change(_machine(machine, False), tool), path, field, request, told)
    else:
        answer, table = _judged(machine, tool, path, field, request, told)
    answer |= {
        "kind": request.kind,
        "tooling": tooling.name,
        "removed_volume_mm3": 1e9 * (before - field.volume),
        "left_volume_mm3": 1e9 * field.volume,
        "cell_mm": 1e3 * float(field.cell.max()),
        "path": drawn_path(path),
        "tool_outline_mm": outline_of(solid_of(tool)),
    }
    return {"answer": json.dumps(answer, allow_nan=False), "table": table}


def _judged(
    machine: MachineText | None, tool: Tooling, path: ToolPath, field: DexelField, request: PathRequest, told: Told
) -> tuple[dict[str, Any], str]:
    """What each move takes out and, on a machine, how far it is from chatter."""
    removal = remove_along(tool, path, field, request.step, lambda done, total: told("removal", done, total))
    way, volume = removal.path, 1e9 * removal.engagement.volume
    warnings, status = list(removal.warnings), None
    if machine is None:
        moves = np.flatnonzero(volume > 1e-6)
        depth = 1e3 * np.maximum(removal.engagement.extent[:, 1] - np.maximum(removal.engagement.extent[:, 0], 0.0), 0.0)
        columns = place_columns(way.places[1:][moves]) | {"line": way.line[1:][moves], "depth_mm": depth[moves]}
        worst = -volume[moves]
        sentences = [f"{volume.sum():.6g} mm³ are taken out of {volume.sum() + 1e9 * field.volume:.6g} mm³ on {moves.size} moves."]
        with tempfile.TemporaryDirectory(prefix="rcsa-ident-") as folder:
            write_engagement(Path(folder) / "ENGAGEMENT.csv", way, removal.engagement, removal.arc_volume)
            table = (Path(folder) / "ENGAGEMENT.csv").read_text(encoding="utf-8")
    else:
        stands = _machine(machine, request.bands)
        change = request.change(stands, tool)
        stations = stations_along(stands, tool, way)
        found = cuts_along(change, way, removal.engagement, stations, lambda done, total: told("stability", done, total))
        moves = np.flatnonzero(found.cutting)
        columns = stability_columns(found, way, moves)
        worst, table = found.margin_low[moves], columns_text(columns)
        sentences = sentences_of(described(found, way))
        status = "no cut" if not moves.size else "chatter" if float(found.margin[moves].min()) < 1.0 else "stable"
        warnings += [*tool.remarks, *stands.remarks, *found.warnings]
    columns |= {"removed_volume_mm3": volume[moves], "way_mm": way_along(way)[moves], "length_mm": 1e3 * way.lengths[moves]}
    shown, row = thinned(columns, worst)
    part = part_of(field, way, moves, row, solid_of(tool).radius)
    said = {"status": status, "sentences": sentences, "warnings": list(dict.fromkeys(warnings))}
    return said | {"rows": int(moves.size), "columns": shown, "part": part}, table


def _milled(change: ToolChange, path: ToolPath, field: DexelField, request: PathRequest, told: Told) -> tuple[dict[str, Any], str]:
    """What happens turn by turn, and the walls that are left."""
    found = mill_path(
        change,
        path,
        field,
        request.turn_steps,
        request.play,
        request.weight,
        request.cutoff,
        progress=lambda done, total: told("milling", done, total),
    )
    columns = milling_columns(found, path)
    table = columns_text(columns)
    # each turn goes on from where the one before it on its move has ended
    goes_on = np.diff(found.move, prepend=-1) == 0
    begins = np.where(goes_on[:, None], np.roll(found.places, 1, axis=0), found.places)
    along = np.concatenate([[0.0], np.cumsum(path.lengths)])[found.move] + np.linalg.norm(found.places - path.places[found.move], axis=1)
    columns |= {"way_mm": 1e3 * along, "length_mm": 1e3 * np.linalg.norm(found.places - begins, axis=1)}
    columns |= {"form_error_um": wall_errors(found, len(path) - 1)[found.move]}
    shown, row = thinned(columns, -found.peak_force)
    turns = ToolPath(np.stack([begins, found.places], axis=1).reshape(-1, 3)) if found.time.size else path
    part = part_of(field, turns, 2 * np.arange(found.time.size), row, solid_of(change.tooling).radius)
    warnings = [*path.remarks, *field.remarks, *found.warnings, *change.tooling.remarks, *change.machine.remarks]
    said = {"status": found.status, "sentences": sentences_of(found.described(path)), "warnings": list(dict.fromkeys(warnings))}
    return said | {"rows": int(found.time.size), "columns": shown, "part": part}, table
