"""A virtual machine's campaign on disk: the folder as a machine shop would send it, and the truth outside it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_rpm
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.io.files import filling, write_text
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.settings.cuts import cut_keys
from rcsa_ident.io.settings.machines import MachineFile, RobotSetup
from rcsa_ident.io.settings.workpieces import workpiece_keys
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.virtual.campaign import SimulatedCut, TrueFlange, TrueReceptances
from rcsa_ident.virtual.changes import Turn, course_of
from rcsa_ident.virtual.machine import CutPlan
from rcsa_ident.virtual.robot import robot_cut_id
from rcsa_ident.virtual.sensors import accelerometer_places

Progress = Callable[[int, int], None]
#: When a machine that warms up begins its campaign.
_FIRST = datetime(2026, 1, 5, 8)
#: Files and rows of a campaign are named by its toolings: no folder elsewhere, no formula of a spreadsheet.
_FILE_NAME = re.compile(r"\w[\w .+()-]*")


@dataclass(frozen=True, slots=True)
class SimulatedCampaign:
    """Where a simulated campaign was written.

    `truth`: ``tip/``, ``cross/``, ``spindle.csv``: receptances at the mean of the speeds, with the terms between X and Y where there are
        some; ``tip/`` and ``cross/`` of a machine that changes with the speed also at the slowest and the fastest. ``workpiece_side.csv``:
        what gives way under the workpiece, where something does. ``records.csv``: true speeds and tooth angles at the first sample;
        ``forces/``: lines of the true force. No reader of the folder sees it.
    """

    folder: Path
    truth: Path
    cuts: int


def write_simulation(
    out: str | Path,
    setup: MachineFile,
    toolings: Sequence[Tooling],
    cuts: Iterable[SimulatedCut],
    receptances: Iterable[TrueReceptances],
    flange: TrueFlange,
    progress: Progress | None = None,
    seed: int = 1,
) -> SimulatedCampaign:
    """Write the campaign into `out` and the truth into ``<out>.truth``; whoever ends it half-way finds neither.

    `out`: a folder that does not exist yet, or an empty one
    `setup`: the virtual machine and its plan of cuts
    `toolings`: those of the cuts, in the order of ``setup.toolings``
    `flange`: receptances of the bare spindle
    `progress`: callable of (done, total)
    `seed`: of the cuts
    """
    out = Path(out)
    truth = out.with_name(out.name + ".truth")
    for folder in (out, truth):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError("out", str(folder), "a folder that does not exist or is empty")
    total = len(toolings) * len(setup.plan.cuts)
    with filling(out, "out") as runs, filling(truth, "out") as known:
        for place in ("tip", "cross", "forces"):
            (known / place).mkdir()
        _write_head(runs, dict(zip(setup.toolings, toolings, strict=True)))
        write_text(runs / "campaign.toml", campaign_text(setup, toolings, seed))
        rows = ["record,spindle_speed_rpm,tooth_angle_deg"]
        for done, cut in enumerate(cuts, start=1):
            _write_columns(known / "forces" / f"{cut.id}.csv", ("order",), np.arange(cut.force_lines.shape[0]), cut.force_lines)
            _write_records(runs, cut, setup.sensors.rate)
            for kind, record in cut.records.items():
                rows.append(f"{cut.id}_{kind},{to_rpm(record.spindle_speed):.9g},{np.degrees(record.tooth_angle):.9g}")
            if progress is not None:
                progress(done, total)
        write_text(known / "records.csv", "\n".join(rows) + "\n")
        if setup.workpiece_side is not None:
            gives_way = np.einsum("nii->ni", setup.workpiece_side.receptance(from_hz(flange.frequency_hz)))
            _write_columns(known / "workpiece_side.csv", ("frequency_hz",), flange.frequency_hz, gives_way)
        mean = float(np.mean(setup.plan.programmed))
        for true in receptances:
            speed = None if true.spindle_speed == mean else true.spindle_speed
            for place, values in (("tip", true.tip), ("cross", true.cross)):
                names, columns = _directions(values[:, :, None, :, None])
                _write_columns(known / place / true_name(true.tooling, speed), ("frequency_hz",), true.frequency_hz, columns, names)
        names, columns = _directions(flange.values.reshape(-1, 2, 2, 2, 2), tuple(f"_{entry}" for entry in ("tF", "tM", "rF", "rM")))
        _write_columns(known / "spindle.csv", ("frequency_hz",), flange.frequency_hz, columns, names)
    return SimulatedCampaign(out, truth, total)


def true_name(tooling: str, speed: float | None = None) -> str:
    """Return the name of a file of true receptances, at the mean of the speeds or at another one [rad/s]."""
    return f"{tooling}.csv" if speed is None else f"{tooling}-{to_rpm(speed):.0f}rpm.csv"


def _directions(values: ComplexArray, entries: tuple[str, ...] = ("",)) -> tuple[list[str], ComplexArray]:
    """Names and columns of receptances over both axes: X, Y, and motion in X under a force in Y and the reverse, where there are some.

    `values`, shape (n, 2, k, 2, k): axis and what moves there, axis and what acts there
    `entries`: endings of the k * k names
    """
    chosen = [(0, 0), (1, 1)]
    if np.any(values[:, 0, :, 1]) or np.any(values[:, 1, :, 0]):
        chosen += [(0, 1), (1, 0)]
    names = ["XY"[row] if row == col else "XY"[row] + "XY"[col] for row, col in chosen]
    columns = [values[:, row, :, col].reshape(values.shape[0], -1) for row, col in chosen]
    return [name + entry for name in names for entry in entries], np.concatenate(columns, axis=1)


def _write_columns(path: Path, first: tuple[str], abscissa: FloatArray, values: np.ndarray, names: Sequence[str] = ("X", "Y")) -> None:
    """Complex columns as real and imaginary parts, the way of FRF.csv."""
    parts = np.stack([values.real, values.imag], axis=2).reshape(values.shape[0], -1)
    header = [*first, *(f"{name}_{part}" for name in names for part in ("re", "im"))]
    lines = [",".join(f"{value:.9g}" for value in row) for row in np.column_stack([abscissa, parts])]
    write_text(path, "\n".join([",".join(header), *lines]) + "\n")


def campaign_text(setup: MachineFile, toolings: Sequence[Tooling], seed: int = 1) -> str:
    """Return the campaign file, as a machinist would write it; recordings are ``recordings/<cut>_cut.h5`` and ``_air.h5``."""
    plan = setup.plan
    # in the order in which they were made
    course = course_of(plan, setup.spindle, setup.changes, len(toolings), seed)
    cuts = []
    for turn in course:
        tooling, (name, speed, last, duration) = toolings[turn.tooling].name, plan.cuts[turn.cut]
        told = _when(turn, duration) if setup.changes.warming is not None else {}
        cuts.append(cut_keys(f"{tooling}-{name}", tooling, _conditions(plan, speed), last) | told)
    return _campaign_text(setup.name, setup, toolings, cuts)


def _when(turn: Turn, duration: float) -> dict[str, Any]:
    """When a recording began, of which the turn tells the middle, and how warm it was then."""
    began = _FIRST + timedelta(seconds=turn.started - 0.5 * duration)
    told: dict[str, Any] = {"started": began.isoformat(timespec="milliseconds")}
    return told if turn.temperature is None else told | {"temperature_c": round(turn.temperature, 2)}


def robot_campaign_text(name: str, setup: RobotSetup, toolings: Sequence[Tooling]) -> str:
    """Return the same of a robot: each cut tells the posture that it was made at."""
    plan = setup.plan
    cuts = [
        cut_keys(robot_cut_id(tooling.name, number, name), tooling.name, _conditions(plan, speed), last, posture.tolist())
        for tooling in toolings
        for number, posture in enumerate(setup.postures)
        for name, speed, last, _ in plan.cuts
    ]
    return _campaign_text(name, setup, toolings, cuts)


def write_robot_campaign(
    out: str | Path,
    name: str,
    setup: RobotSetup,
    toolings: Mapping[Path, Tooling],
    cuts: Iterable[SimulatedCut],
    progress: Progress | None = None,
) -> None:
    """Write a robot's campaign into a folder; no truth beside it.

    `out`: a folder that does not exist yet, or an empty one
    `toolings`: their files
    `progress`: callable of (done, total)
    """
    total = len(toolings) * len(setup.postures) * len(setup.plan.cuts)
    with filling(out, "out") as runs:
        _write_head(runs, toolings)
        write_text(runs / "campaign.toml", robot_campaign_text(name, setup, list(toolings.values())))
        for done, cut in enumerate(cuts, start=1):
            _write_records(runs, cut, setup.sensors.rate)
            if progress is not None:
                progress(done, total)


def _write_head(runs: Path, toolings: Mapping[Path, Tooling]) -> None:
    """Folders, and the toolings' files; refuses a tooling's name that names no file."""
    for part in ("recordings", "toolings"):
        (runs / part).mkdir()
    for path, tooling in toolings.items():
        if not _FILE_NAME.fullmatch(tooling.name):
            raise InputError("name", tooling.name, "letters, digits, blanks and . _ + ( ) -, with a letter or digit in front", str(path))
        # where the schema for editors lies is another way from there
        text = path.read_text("utf-8-sig")
        write_text(runs / "toolings" / f"{tooling.name}.toml", re.sub(r"\A#:schema .*\n", "", text))


def _write_records(runs: Path, cut: SimulatedCut, rate: float) -> None:
    for kind, record in cut.records.items():
        write_hdf5(runs / "recordings" / f"{cut.id}_{kind}.h5", rate, record.channels)


def _conditions(plan: CutPlan, speed: float) -> CuttingConditions:
    return CuttingConditions(speed, plan.axial_depth, plan.feed_per_tooth, plan.engagement, plan.feed_angle)


def _campaign_text(name: str, setup: MachineFile | RobotSetup, toolings: Sequence[Tooling], cuts: list[dict[str, Any]]) -> str:
    suite = setup.sensors
    gap = ("displacement", suite.gap_sensitivity, suite.gap_delay, suite.gap_bandwidth)
    acceleration = ("acceleration", suite.acceleration_sensitivity, suite.acceleration_delay, suite.acceleration_bandwidth)
    told = {"distance_behind_flange_mm": 1e3 * setup.spindle.seen_at, "distance_spread_mm": 0.0}
    sensors = {f"flange_{axis.lower()}": _sensor(axis, *gap) | told for axis in "XY"}
    side = None if setup.workpiece_side is None else setup.workpiece_side.role
    places = accelerometer_places(len(setup.spindle.housing_positions), side)
    for place in places:
        # one accelerometer beside a displacement sensor is its fixture's, several say what they are fixed to
        role = {"role": "fixture" if place == places[0] else place if place == side else "spindle"} if len(places) > 1 else {}
        sensors |= {f"{place}_{axis.lower()}": _sensor(axis, *acceleration) | role for axis in "XY"}
    if suite.trigger:
        angle = float(f"{np.degrees(suite.tooth_angle):.9g}")
        sensors["trigger"] = {"quantity": "trigger", "pulses_per_revolution": 1, "tooth_angle_deg": angle}
    exact = {"campaign": {"name": name, "sampling_rate_hz": suite.rate}, "sensors": sensors}
    rest = {"workpiece": workpiece_keys(setup.workpiece), "toolings": {t.name: f"toolings/{t.name}.toml" for t in toolings}, "cuts": cuts}
    return toml_of(exact) + "\n" + toml_of(rest, digits=9)


def _sensor(axis: str, quantity: str, sensitivity: float, delay: float, bandwidth: float | None) -> dict[str, Any]:
    found: dict[str, Any] = {"quantity": quantity, "axis": axis, "sensitivity": sensitivity}
    if delay != 0.0:
        found["delay_s"] = delay
    return found if bandwidth is None else found | {"bandwidth_hz": bandwidth}
