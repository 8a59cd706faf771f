"""Tables of what a tool does along a path, with its places in millimetres."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.io.files import write_text
from rcsa_ident.toolpath.path import ToolPath

PLACE = ("x_mm", "y_mm", "z_mm")


def place_columns(places: FloatArray) -> dict[str, FloatArray]:
    """Return the columns of places, shape (k, 3) [m]; metres and back leave a last digit that nobody asked for."""
    return dict(zip(PLACE, (1e3 * places).round(9).T, strict=True))


class JudgedMoves(Protocol):
    """Moves of a path and what a tool does on them, as `workflows.path_stability.CutsAlong` has them."""

    @property
    def depth(self) -> FloatArray: ...
    @property
    def speed(self) -> FloatArray: ...
    @property
    def feed_per_tooth(self) -> FloatArray: ...
    @property
    def margin(self) -> FloatArray: ...
    @property
    def margin_low(self) -> FloatArray: ...
    @property
    def limit(self) -> FloatArray: ...
    @property
    def chatter_frequency(self) -> FloatArray: ...
    @property
    def mean_force(self) -> FloatArray: ...
    @property
    def peak_force(self) -> FloatArray: ...
    @property
    def deflection(self) -> FloatArray: ...
    @property
    def form_error(self) -> FloatArray: ...


class MilledTurns(Protocol):
    """Turns of a tool in material, as `workflows.path_milling.PathMilling` has them."""

    @property
    def move(self) -> np.ndarray: ...
    @property
    def time(self) -> FloatArray: ...
    @property
    def places(self) -> FloatArray: ...
    @property
    def mean_force(self) -> FloatArray: ...
    @property
    def peak_force(self) -> FloatArray: ...
    @property
    def mean_tip(self) -> FloatArray: ...
    @property
    def swing(self) -> FloatArray: ...
    @property
    def beside_turns(self) -> FloatArray: ...


def stability_columns(found: JudgedMoves, path: ToolPath, moves: np.ndarray) -> dict[str, FloatArray]:
    """Return the columns of STABILITY.csv for some moves of a path."""
    way = np.arctan2(path.moves[:, 1], path.moves[:, 0])
    c, s = np.cos(way), np.sin(way)
    x, y, z = found.mean_force.T
    # from the feed's axes into the machine's
    force = np.column_stack([c * x - s * y, s * x + c * y, z])
    return place_columns(path.places[1:][moves]) | {
        "line": path.line[1:][moves],
        "depth_mm": 1e3 * found.depth[moves],
        "spindle_speed_rpm": to_rpm(found.speed[moves], 9),
        "feed_per_tooth_mm": 1e3 * found.feed_per_tooth[moves],
        "margin": found.margin[moves],
        "margin_low": found.margin_low[moves],
        "limit_depth_mm": 1e3 * found.limit[moves],
        "chatter_frequency_hz": to_hz(found.chatter_frequency[moves]),
        "force_x_n": force[moves, 0],
        "force_y_n": force[moves, 1],
        "force_z_n": force[moves, 2],
        "peak_force_n": found.peak_force[moves],
        "deflection_um": 1e6 * found.deflection[moves],
        "form_error_um": 1e6 * found.form_error[moves],
    }


def milling_columns(found: MilledTurns, path: ToolPath) -> dict[str, FloatArray]:
    """Return the columns of FORCES.csv, a row for each turn."""
    columns = {"time_s": found.time} | place_columns(found.places)
    columns |= {f"force_{axis}_n": found.mean_force[:, k] for k, axis in enumerate("xyz")}
    columns |= {"peak_force_n": found.peak_force}
    columns |= {f"deflection_{axis}_um": 1e6 * found.mean_tip[:, k] for k, axis in enumerate("xyz")}
    return columns | {"swing_um": 1e6 * found.swing, "beside_turns_um": 1e6 * found.beside_turns, "line": path.line[1:][found.move]}


def write_columns(path: str | Path, columns: Mapping[str, FloatArray]) -> None:
    """Write columns of one length, nine digits of each number; what is not finite is an empty cell."""
    write_text(path, columns_text(columns))


def columns_text(columns: Mapping[str, FloatArray]) -> str:
    """Return the text that `write_columns` writes."""
    return "\n".join([",".join(columns), *_rows(columns.values())]) + "\n"


def _rows(columns: Iterable[FloatArray]) -> Iterable[str]:
    for row in zip(*(np.asarray(values).tolist() for values in columns), strict=True):
        yield ",".join(str(v) if isinstance(v, int) else f"{v:.9g}" if np.isfinite(v) else "" for v in row)
